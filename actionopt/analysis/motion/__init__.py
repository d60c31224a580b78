"""Motions forward from a state, and how far a path is from them."""
