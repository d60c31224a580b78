"""Named examples: a problem, what is known exactly about it, its source and how to draw it.

One file a scene; the catalogue is the list of the files. A scene's file is imported when the
scene is asked for, and its system is derived once: `get` with other numbers reuses it.

>>> scene = get("projectile", duration=2.0)
>>> scene.problem.duration, scene.exact(1.0).shape
(2.0, (2,))
"""

from __future__ import annotations

import importlib
import pkgutil
from typing import Any

import numpy as np

from actionopt.mechanics.laws.tracing import suggestion
from actionopt.scenes import _scene
from actionopt.scenes._own import from_file
from actionopt.scenes._scene import Facts, Known, Measure, Scene, Words
from actionopt.scenes._shapes import Shape, body, circle, ground, project, rod, spring
from actionopt.tools.checks import among

__all__ = [
    "SCENES",
    "Facts",
    "Known",
    "Measure",
    "Scene",
    "Shape",
    "Words",
    "body",
    "circle",
    "from_file",
    "get",
    "ground",
    "parameters",
    "project",
    "rod",
    "spring",
    "title",
]

SCENES: tuple[str, ...] = tuple(
    sorted(m.name for m in pkgutil.iter_modules(__path__) if not m.name.startswith("_"))
)


def get(name: str, **parameters: Any) -> Scene:
    """Return the scene `name`, with its own parameters where none are given.

    Raises
    ------
    ValueError
        If there is no such scene or it has no such parameter (the nearest name is suggested),
        or the values do not make sense for it.
    """
    file = _module(name)
    known = _scene.parameters(file.scene)
    for key in parameters:
        if key not in known:
            raise ValueError(
                f"scene {name!r} has no parameter {key!r}; its parameters are "
                f"{', '.join(known)}{suggestion(key, known)}"
            )
        value = parameters[key]
        if np.any(getattr(value, "imag", 0)):
            raise ValueError(f"expected a real number for {key} of scene {name!r}, found {value!r}")
    try:
        with np.errstate(all="ignore"):  # what is not finite is refused as a number
            return _scene.build(file, known | parameters)
    except (TypeError, OverflowError, ZeroDivisionError) as error:
        given = ", ".join(f"{key}={value!r}" for key, value in parameters.items())
        raise ValueError(
            f"expected values that scene {name!r} can compute with, found {given}: {error}"
        ) from error


def parameters(name: str) -> dict[str, Any]:
    """Return the parameters of the scene `name` and their defaults, deriving nothing."""
    return _scene.parameters(_module(name).scene)


def title(name: str) -> str:
    """Return the scene's title, one line, deriving nothing."""
    return _module(name).TITLE


def _module(name: str):
    if not among(name, SCENES):
        raise ValueError(
            f"unknown scene {name!r}{suggestion(str(name), SCENES)} (there are {', '.join(SCENES)})"
        )
    return importlib.import_module(f"{__name__}.{name}")
