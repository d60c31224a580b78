"""The answer of a trace: a family of paths along one quantity, and the marks on it."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import numpy as np

from actionopt.analysis.solution import Solution
from actionopt.discrete.borders.borders import times_over
from actionopt.discrete.meshes.path import Path
from actionopt.families.traces.marks import Mark
from actionopt.mechanics.question.problem import Problem
from actionopt.solver.solve import solve
from actionopt.tools.checks import flat_index, number
from actionopt.tools.immutable import immutable
from actionopt.tools.shown import row_of
from actionopt.tools.types import Array

INTERRUPTED = "it was interrupted"


@immutable
class Trace:
    """A family of stationary paths, in the order in which it was followed.

    Attributes
    ----------
    values, actions : (P,) arrays
        The varied quantity and the action.
    indices : (P,) array of int
        Morse indices; -1 where none was counted or, with non-conservative forces, exists.
    paths : tuple of Path
    marks : tuple of Mark
        Folds and changes of the index.
    stopped : str
        Why it ended, a sentence; it says so where the value asked for was not reached.
    family : callable
        Maps a value to its Problem.
    tol : float
    stats : dict
        Steps, factorizations and meshes used.
    """

    values: Array
    actions: Array
    indices: Array
    paths: tuple[Path, ...]
    marks: tuple[Mark, ...]
    stopped: str
    family: Callable[[float], Problem]
    tol: float
    stats: dict[str, int]

    def __repr__(self) -> str:
        """Show how far it went and what it met, not the arrays."""
        found = f"{len(self.values)} paths from {self.values[0]:g} to {self.values[-1]:g}"
        told = (f"{mark.kind} at {mark.value:g}" for mark in self.marks)
        marks = row_of(told, len(self.marks))
        return f"Trace({found}; {marks or 'no marks'}; ended: {self.stopped})"

    @property
    def durations(self) -> Array:
        """How long each path takes, (P,)."""
        return np.array([path.mesh.duration for path in self.paths])

    @property
    def interrupted(self) -> bool:
        """Whether the user ended it."""
        return self.stopped == INTERRUPTED

    @property
    def returned(self) -> bool:
        """Whether the branch turned and came back to the first value, on another path."""
        return len(self.values) > 1 and bool(self.values[-1] == self.values[0])

    def solution(self, k: int) -> Solution:
        """Return point k as a full solution.

        Raises IndexError if there is no such point, SolveError if it is degenerate.
        """
        k = flat_index((k,), self.values.shape)
        return solve(self.family(float(self.values[k])), guess=self.paths[k], tol=self.tol)

    def at(self, value: float) -> list[Solution]:
        """Return the paths of the family at a value, one for each time the branch passes it."""
        value = number(value, "the value at which paths are wanted")
        folds = {mark.point: mark for mark in self.marks if mark.kind == "fold"}
        nodes: list[tuple[float, Path, bool]] = []  # the folds among them
        for k in range(len(self.values)):
            nodes.append((float(self.values[k]), self.paths[k], False))
            if k in folds:
                nodes.append((folds[k].value, folds[k].path, True))
        result = []
        for k, ((a, one, turned), (b, other, turns)) in enumerate(pairwise(nodes)):
            if not (min(a, b) <= value <= max(a, b)) or a == b or (value == a and k > 0):
                continue
            part = (value - a) / (b - a)
            if turned or turns:  # the branch is a parabola there
                part = np.sqrt(part) if turned else 1 - np.sqrt(1 - part)
            problem = self.family(value)
            pair = one, other
            a, b = (path.mesh.duration for path in pair)
            t0, t1 = times_over(problem, (1 - part) * a + part * b)
            ends = [Path(path.mesh.moved(t0, t1), path.values) for path in pair]
            mesh = ends[1].mesh
            guess = Path(mesh, (1 - part) * ends[0](mesh.nodes) + part * ends[1].values)
            result.append(solve(problem, guess=guess, tol=self.tol))
        return result
