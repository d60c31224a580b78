"""What a path does between the nodes of its mesh."""
