"""Paths along an obstacle: first ones, which parts of them are in contact, and the least."""
