"""The second variation as a quadratic form: its index, and derivatives of the action."""
