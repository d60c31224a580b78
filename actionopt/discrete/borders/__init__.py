"""Numbers to be found beside a path, and the borders that they add to its matrix."""
