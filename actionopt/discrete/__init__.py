"""The action on a mesh of elements, and Newton's method on it."""
