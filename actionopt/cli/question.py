"""The question a command is about: a scene or a file of the user's own, and its settings."""

from __future__ import annotations

import argparse
import ast
import os
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from actionopt.mechanics.question.problem import Problem


def add_question(command: argparse.ArgumentParser) -> None:
    """Add the arguments that `question` reads."""
    look: Any = {"metavar": "SCENE|FILE.py", "help": "name of a scene, or a Python file"}
    scene: Any = command.add_argument("scene", **look)
    scene.completer = _scenes
    what = "a parameter by name; may be repeated (`actionopt list SCENE` names them)"
    look = {"metavar": "NAME=VALUE", "dest": "settings", "help": what}
    command.add_argument("--set", type=_setting, action="append", default=[], **look)


def question(options: argparse.Namespace) -> tuple[Problem, Any]:
    """Return the problem of a scene or of a user's file, and a guess if it has one."""
    from actionopt import scenes

    name, settings = options.scene, dict(options.settings)
    own = name.endswith(".py")
    if not own and os.path.splitext(name)[1]:
        raise ValueError(
            f"expected the name of a scene, or a file FILE.py that defines `problem`, found "
            f"{name!r}"
        )
    found = scenes.from_file(name, settings) if own else scenes.get(name, **settings)
    return (found.problem, found.guess) if isinstance(found, scenes.Scene) else (found, None)


def _scenes(**_: Any) -> tuple[str, ...]:
    """Return what a shell may complete to the name of a scene (of argcomplete)."""
    from actionopt.scenes import SCENES

    return SCENES


def _setting(text: str) -> tuple[str, Any]:
    name, equals, value = text.partition("=")
    try:
        if not (equals and name.isidentifier()):
            raise ValueError
        return name, ast.literal_eval(value.strip())
    except (ValueError, SyntaxError) as error:
        raise argparse.ArgumentTypeError(
            f"expected NAME=VALUE with a number, a list or None as the value, found {text!r}"
        ) from error


def seconds(time: float) -> str:
    """Return a time as it is printed."""
    return f"{time:.3g} s" if time >= 1 else f"{1e3 * time:.3g} ms"
