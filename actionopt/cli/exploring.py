"""`actionopt explore`: open a window on a trial path."""

from __future__ import annotations

import argparse

from actionopt.cli.question import add_question, question


def add_to(command: argparse.ArgumentParser) -> None:
    """Add the arguments, and what runs."""
    command.description = (
        "Open a window on a trial path of a scene or a file: drag its points, see the action and "
        "the missing force change, solve, and slide the end time through conjugate points."
    )
    command.set_defaults(run=run)
    add_question(command)


def run(options: argparse.Namespace) -> int:
    """Open the window, and wait until it is closed."""
    problem, guess = question(options)
    from actionopt import plot

    units = plot.UnitNames() if options.scene.endswith(".py") else plot.SI  # as all scenes are
    plot.explore(problem, guess=guess, units=units).show()
    return 0
