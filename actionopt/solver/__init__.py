"""How a path is found."""
