"""The arrays behind the pictures."""
