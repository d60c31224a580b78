"""A row of the chapter: what a section says about a system, and whether it comes out."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache
from itertools import chain

import numpy as np
from numpy.typing import ArrayLike

from actionopt import scenes
from actionopt.analysis.solution import Solution
from actionopt.scenes import Scene
from actionopt.solver.solve import solve
from actionopt.tools.types import Array

TOL = 1e-11  # asked of every path
PATH_OFF = 1e-10  # of its closed form, for what follows from the path itself
RATE_OFF = 1e-8  # for what needs its velocity or acceleration: one order of the mesh less
FLOW_OFF = 1e-8  # for a forward integration from the path's start, which amplifies its error
ROUND_OFF = 1e-12  # two formulas for one number


@dataclass(frozen=True)
class Line:
    """One comparison: a quantity, what the chapter expects and what was found.

    Numbers agree if they differ by at most `tolerance` times max(1, |expected|); words and
    verdicts if they are equal.
    """

    quantity: str
    expected: float | str | bool
    found: float | str | bool
    tolerance: float = PATH_OFF

    @property
    def error(self) -> float | None:
        """The difference that is compared with the tolerance; None for words."""
        if isinstance(self.expected, (str, bool)):
            return None
        return abs(float(self.found) - self.expected) / max(1.0, abs(self.expected))

    @property
    def agrees(self) -> bool:
        """Whether expected and found agree; NaN agrees with nothing."""
        if self.error is None:
            return self.expected == self.found
        return bool(self.error <= self.tolerance)


Lines = Iterator[Line]


@dataclass(frozen=True)
class Row:
    """A system of the chapter; `check()` yields its lines.

    Attributes
    ----------
    section : str
        Section of the chapter.
    system : str
        What it is about.
    check : callable
    """

    section: str
    system: str
    check: Callable[[], Lines]


def row(section: str, system: str, *names: str) -> Callable[[Callable[[], Lines]], Row]:
    """Make the decorated function a row of the chapter, after the paths of the scenes `names`."""

    def make(check: Callable[[], Lines]) -> Row:
        return Row(section, system, lambda: chain(*map(path, names), check()))

    return make


def other_numbers(name: str) -> dict[str, Array]:
    """Return a scene's parameters, each real one changed by a few per cent."""
    result = {}
    for i, (key, value) in enumerate(scenes.parameters(name).items()):
        if value is not None and not isinstance(value, (int, str)):
            result[key] = np.asarray(value, dtype=float)[()] * (1.04 + 0.02 * (i % 5))
    return result


@cache
def solve_scene(name: str, changed: bool = False) -> tuple[Scene, Solution]:
    """Return a scene, with its own numbers or with other ones, and its solution."""
    scene = scenes.get(name, **(other_numbers(name) if changed else {}))
    return scene, solve(scene.problem, tol=TOL, guess=scene.guess)


def times(solution: Solution, count: int = 41) -> Array:
    """Return equal times over the solution."""
    return np.linspace(solution.problem.start.t, solution.problem.end.t, count)


def states(solution: Solution) -> tuple[Array, Array, Array]:
    """Return q, v (n, K) and t (K,) along a solution."""
    t = times(solution)
    return solution(t), solution.velocity(t), t


def along(name: str) -> tuple[Scene, Solution, Array, Array, Array]:
    """Return a scene, its solution, and `states` along it."""
    scene, solution = solve_scene(name)
    return scene, solution, *states(solution)


def worst(
    quantity: str, expected: ArrayLike, found: ArrayLike, tolerance: float = PATH_OFF
) -> Line:
    """Return the comparison of two tables where they differ most, relative to their size."""
    a, b = np.broadcast_arrays(np.asarray(expected, dtype=float), np.asarray(found, dtype=float))
    size = max(1.0, float(np.max(np.abs(a))))
    at = np.unravel_index(np.argmax(np.abs(a - b)), a.shape)
    # Line compares with the entry itself, which may be smaller than the table's size.
    return Line(quantity, float(a[at]), float(b[at]), tolerance * size / max(1.0, abs(a[at])))


def path(name: str) -> Lines:
    """Compare a scene's path, action and forward integration, for two sets of numbers."""
    for changed in (False, True):
        scene, solution = solve_scene(name, changed)
        mark = f"{name}, other numbers:" if changed else f"{name}:"
        t = times(solution, 101)
        if scene.exact is not None:
            yield worst(f"{mark} path", scene.exact(t), solution(t))
        if scene.action is not None:
            yield Line(f"{mark} action", scene.action, solution.action)
        comparison = solution.compare()
        yield Line(f"{mark} forward deviation", 0.0, comparison.position, FLOW_OFF)


def constants(name: str) -> Lines:
    """Compare the conserved quantities of a scene at the end of its path with the start."""
    scene, _, q, v, t = along(name)
    for what, quantity in scene.facts["conserved"].items():
        values = quantity(q, v, t)
        yield worst(f"{name}: {what} constant", values[0], values, RATE_OFF)
