"""Paths followed along one quantity, through folds."""
