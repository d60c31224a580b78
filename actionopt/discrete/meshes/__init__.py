"""Meshes of elements, and the piecewise polynomials on them."""
