"""Newton's method on the discrete action."""
