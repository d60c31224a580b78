"""`python -m actionopt` is the command `actionopt`."""

from actionopt.cli import main

if __name__ == "__main__":
    raise SystemExit(main())
