"""The arrays behind the pictures that take a computation of their own."""
