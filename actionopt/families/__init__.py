"""Many paths: along a parameter, and all between two events."""
