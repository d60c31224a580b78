"""Ends at infinite times, at times to be found, and anywhere along a closed path."""
