"""Matrices of Newton's method: their layout, and their factors."""
