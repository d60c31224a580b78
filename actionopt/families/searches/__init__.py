"""All the paths between two events."""
