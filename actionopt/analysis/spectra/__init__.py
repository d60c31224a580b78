"""What belongs to a solution's variations: modes, conjugate points, multipliers."""
