"""What a path tells: its momenta, its index, its error, and the motion forward from its start."""
