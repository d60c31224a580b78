"""What is given to solve: arguments, a guess as a curve, and what can be wrong with a question."""
