"""One question over a grid of values, on any executor."""
