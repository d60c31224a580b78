"""`actionopt list`: name the scenes, or tell of one."""

from __future__ import annotations

import argparse
from collections.abc import Sequence

from actionopt.tools.table import print_table


def add_to(command: argparse.ArgumentParser) -> None:
    """Add the arguments, and what runs."""
    command.description = "Name the scenes; with the name of one, tell of it."
    command.set_defaults(run=run)
    command.add_argument("scene", nargs="?", help="its parameters, its source, what is known")


def run(options: argparse.Namespace) -> int:
    """Print a table of the scenes, or what there is to know of one."""
    from actionopt import scenes

    if options.scene is not None:
        return _tell(options.scene)
    rows = []
    for name in scenes.SCENES:
        scene = scenes.get(name)
        system = scene.problem.system
        rows.append((name, _some(system.coordinates), str(system.m or ""), scene.title))
    print_table([("scene", "coordinates", "constraints", "what it is"), *rows])
    return 0


def _tell(name: str) -> int:
    """Print what there is to know of a scene before it is solved."""
    from actionopt import scenes

    scene = scenes.get(name)
    known = (["the path"] if scene.exact is not None else []) + sorted(scene.facts)
    settings = [f"{key}={value!r}" for key, value in scenes.parameters(name).items()]
    print(f"{name}: {scene.title}")
    print_table(
        [
            ("source", scene.source),
            ("coordinates", ", ".join(scene.problem.system.coordinates)),
            ("known exactly", ", ".join(known).replace("_", " ")),
            ("parameters", "for --set, with what they are by default"),
            *(("", setting) for setting in settings),
        ]
    )
    return 0


def _some(names: Sequence[str]) -> str:
    """Return the names, those in the middle of a long row left out."""
    shown = names if len(names) <= 4 else (*names[:3], "...", names[-1])
    return ", ".join(shown)
