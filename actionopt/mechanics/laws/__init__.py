"""Laws: what a user writes, traced, derived and compiled."""
