"""From a first path to one that is stationary, by one strategy after the other."""
