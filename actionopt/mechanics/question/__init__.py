"""The question: events, what lies between them, and whether they fit together."""
