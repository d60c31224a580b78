"""Run time against error: actionopt and its peers on the same problems, by one command."""
