"""Scenes and problems of the user's own, from plain Python files."""

from __future__ import annotations

import inspect
import sys
from collections.abc import Callable, Mapping
from os import PathLike
from typing import Any

from actionopt.mechanics.laws.tracing import suggestion
from actionopt.mechanics.question.problem import Problem
from actionopt.scenes._scene import Scene
from actionopt.tools.checks import by_name


def from_file(
    file: str | PathLike[str], settings: Mapping[str, Any] | None = None
) -> Problem | Scene:
    """Return what a Python file defines as `scene` or, if it defines none, as `problem`.

    That is a Problem, a Scene, or a function of keyword parameters that returns one. `settings`
    are these parameters, or those of the system. The file is run; its folder is where it imports
    from.

    Where it defines another `problem` beside the scene, that is said on the standard error.

    Raises ValueError, with the line, if there is no such file, it raises or defines neither, or it
    has no such parameter.
    """
    import runpy  # which few ask for, as pathlib
    from pathlib import Path

    if not isinstance(file, (str, PathLike)):
        raise ValueError(f"expected the name of a Python file, found {file!r}")
    file, settings = Path(file), dict(by_name(settings, "parameters"))

    if not file.is_file():
        raise ValueError(f"expected a Python file, found no file {str(file)!r}")
    sys.path.insert(0, str(file.parent))  # as `python file` does, for its neighbours
    try:
        defined = runpy.run_path(str(file))
        found = defined.get("scene", defined.get("problem"))
        if {"scene", "problem"} <= defined.keys() and _problem(found) is not defined["problem"]:
            print(f"{file} defines `scene` and `problem`: the scene is taken", file=sys.stderr)
        if inspect.isfunction(found):
            _check_names(found, settings)
            found, settings = found(**settings), {}
    except Exception as error:
        raise ValueError(f"{_place(file, error)}: {type(error).__name__}: {error}") from error
    finally:
        sys.path.pop(0)
    if not isinstance(found, (Problem, Scene)):
        raise ValueError(
            f"expected {file} to define `problem` or `scene`, a Problem, a Scene or a function "
            f"that returns one, found {'neither' if found is None else repr(found)}"
        )
    return _problem(found).replace(parameters=settings) if settings else found


def _problem(found: Any) -> Any:
    """Return the problem of a scene, or what is none."""
    return found.problem if isinstance(found, Scene) else found


def _check_names(made: Callable[..., Any], settings: Mapping[str, Any]) -> None:
    """Raise ValueError if a function of the user's has no parameter of one of these names."""
    parameters = inspect.signature(made).parameters
    if any(p.kind is p.VAR_KEYWORD for p in parameters.values()):
        return
    for name in settings:
        if name not in parameters:
            raise ValueError(
                f"unknown parameter {name!r}; the parameters of {made.__name__} are "
                f"{', '.join(parameters) or 'none'}{suggestion(name, list(parameters))}"
            )


def _place(file: PathLike[str], error: Exception) -> str:
    """Return the file, and the last line in it that the error came through."""
    import traceback

    frames = traceback.extract_tb(error.__traceback__)
    lines = [frame.lineno for frame in frames if frame.filename == str(file)]
    if isinstance(error, SyntaxError) and error.lineno is not None:
        lines = [error.lineno]
    return f"{file}, line {lines[-1]}" if lines else str(file)
