"""Sequences for warm starts: one parameter moves, and each member begins at the answer before.

A step tells what a solver may take on from the one before, and which bounds and rows come into
force or leave it: where none does, one Newton step is nearly enough.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from actionopt import suite
from actionopt.suite import solvers
from actionopt.suite.member import Member
from actionopt.tools.immutable import immutable
from actionopt.tools.shown import one_line
from actionopt.tools.types import Array

AT_BOUND = 1e-9  # in units of x, or of a row: what is so near its bound is in force


@immutable
class SequenceStep:
    """A member, and what is known from the one before.

    Attributes
    ----------
    value : float
        Of the parameter.
    problem : Member
    x, lam : (n,), (m,) array
        Optimum and multipliers of the member before.
    changes : int
        How many bounds and rows are in force at one of the two optima, and not at the other.
    """

    value: float
    problem: Member
    x: Array
    lam: Array
    changes: int

    __repr__ = one_line


def steps(
    name: str,
    parameter: str,
    values: Sequence[float],
    elements: int | None = None,
    degree: int | None = None,
) -> Iterator[SequenceStep]:
    """Yield a member for each value of a parameter but the first, which has none before it.

    Raises ValueError as `suite.get` and `suite.model` do.
    """
    before: Member | None = None
    for value in values:
        problem = suite.member(name, elements, degree, **{parameter: value})
        if before is not None:
            changes = int(np.sum(in_force(before) != in_force(problem)))
            yield SequenceStep(value, problem, before.x_star, before.lam_star, changes)
        before = problem


def in_force(problem: Member) -> NDArray[np.bool_]:
    """Return which bounds of x, then which rows, are met at the optimum, (n + m,)."""
    x, met = problem.x_star, []
    for values, sides, size in (
        (x, problem.bounds, problem.unit),
        (problem.constraints(x), problem.constraint_bounds, np.ones(problem.m)),
    ):
        away = np.minimum(values - sides[0], sides[1] - values)
        met.append(away <= AT_BOUND * size)
    return np.concatenate(met)


def compare(solver: str, sequence: Iterator[SequenceStep]) -> list[tuple[float, int, int, int]]:
    """Return value, changes, and evaluations of the gradient: from the own start and from x.

    Raises ValueError for an answer that is not the optimum of its member.
    """
    rows = []
    for step in sequence:
        counts = []
        for x0 in (step.problem.start(), step.x):
            answer = solvers.run(solver, step.problem, x0)
            if not step.problem.distance(answer.x) <= 1e-3:
                raise ValueError(
                    f"expected the optimum of {step.problem.name} at {step.value:g}, found "
                    f"{answer.said!r} at {step.problem.distance(answer.x):.2g} of its size from it"
                )
            counts.append(answer.evaluations.get("grad", 0))
        rows.append((step.value, step.changes, *counts))
    return rows
