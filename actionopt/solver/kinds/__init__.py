"""Each kind of question: its first paths, and the way to its solution."""
