"""What knows no mechanics: quadrature rules, checks of input, files, signals, progress."""
