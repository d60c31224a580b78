"""From a Lagrangian to the equations of motion, and the question put to them."""
