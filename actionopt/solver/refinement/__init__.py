"""A path on a mesh, moved by steps of Newton's and refined until its error meets the tolerance."""
