"""What a figure is asked for, checked by the names of its arguments: one name means one thing."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from functools import wraps
from os import PathLike
from typing import Any, TypeVar

import numpy as np

from actionopt.analysis.solution import question
from actionopt.families.sweeps.runs import Runs
from actionopt.mechanics.question.problem import Problem
from actionopt.plot._names import UnitNames
from actionopt.scenes import Scene
from actionopt.tools.checks import entries, flag, number, whole

Figure = TypeVar("Figure", bound=Callable[..., Any])


def check_arguments(figure: Figure) -> Figure:
    """Let a function raise ValueError for arguments of the names below that are not what they say.

    What is optional may be None. It is given what the checks return, if they return something. Its
    docstring says so.
    """
    taken = inspect.signature(figure)

    @wraps(figure)
    def call(*given: Any, **named: Any) -> Any:
        try:
            bound = taken.bind(*given, **named)
        except TypeError:  # too many or too few: it says so itself
            return figure(*given, **named)
        for name, value in list(bound.arguments.items()):
            if name in CHECKS and (value is not None or taken.parameters[name].default is not None):
                kept = CHECKS[name](value)
                if kept is not None:
                    bound.arguments[name] = kept
        return figure(*bound.args, **bound.kwargs)

    names = ", ".join(f"`{name}`" for name in taken.parameters if name in CHECKS)
    if names and "Raises\n" not in (figure.__doc__ or ""):
        about, head, rest = inspect.cleandoc(figure.__doc__ or "").partition("\n\nParameters\n")
        what = f"Raises ValueError if one of {names} is no such thing."
        call.__doc__ = f"{about}\n\n{what}{head}{rest}"
    return call  # type: ignore[return-value]


def _count(value: object) -> int:
    return whole(value, "how many there are to be", 1)


def _number(value: object) -> None:
    number(value, "a size in a figure")


def _positive(value: object) -> None:
    if number(value, "seconds, or a size in a figure") <= 0:
        raise ValueError(f"expected a positive number, found {value!r}")


def _index(value: object) -> int:
    return whole(value, "the index of a coordinate or a mode", 0)


def _axes(value: Any) -> None:
    several = isinstance(value, (list, tuple)) or (isinstance(value, np.ndarray) and value.ndim > 0)
    each: Any = np.ravel(np.array(value, dtype=object)) if several and len(value) else [value]
    if not all(hasattr(ax, "plot") and hasattr(ax, "set_xlabel") for ax in each):
        raise ValueError(f"expected axes of Matplotlib, as many as the figure has, found {value!r}")
    for ax in each:
        if getattr(ax, "name", "rectilinear") != "rectilinear":
            raise ValueError(f"expected plane axes with straight scales, found {ax.name!r} ones")


def _solution(value: Any) -> None:
    question(value)


def _solutions(value: Any) -> list[Any]:
    return _several(value, "solutions")


def _variations(value: Any) -> list[Any]:
    return _several(value, "variations")


def _several(value: Any, what: str) -> list[Any]:
    if (found := entries(value)) is None:
        raise ValueError(f"expected several {what}, found {value!r}; put it in a list")
    return found


def _runs(value: object) -> None:
    if not isinstance(value, Runs):
        raise ValueError(f"expected the answers of a sweep, found {value!r}")


def _file(value: object) -> None:
    if not isinstance(value, (str, PathLike)):
        raise ValueError(f"expected the name of a file, found {value!r}")


def _question(value: object) -> None:
    if not isinstance(value, (Scene, Problem)):
        hint = "; give its `problem`" if hasattr(value, "problem") else ""
        raise ValueError(
            f"expected a Problem(system, start, end) or a Scene, found {value!r}{hint}"
        )


def _units(value: object) -> None:
    if not isinstance(value, UnitNames):
        raise ValueError(f"expected plot.UnitNames(time='s', ...), found {value!r}")


def _text(value: object) -> None:
    if not isinstance(value, str):
        raise ValueError(f"expected a name as text, found {value!r}")


CHECKS: dict[str, Callable[[Any], Any]] = {
    "solution": _solution,
    "solutions": _solutions,
    "etas": _variations,
    "compare": lambda value: flag(value, "compare"),
    "force": lambda value: flag(value, "force"),
    "question": _question,
    "units": _units,
    "runs": _runs,
    "found": _runs,
    "ax": _axes,
    "axes": _axes,
    "count": _count,
    "points": _count,
    "steps": _count,
    "fps": _count,
    "mode": _index,
    "coordinate": _index,
    "size": _number,
    "spread": _number,
    "reach": _number,
    "hbar": _number,
    "seconds": _positive,
    "dpi": _positive,
    "until": _number,
    "file": _file,
    "method": _text,
    "quantity": _text,
}
