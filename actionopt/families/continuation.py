"""From the path of one member of a family to that of a neighbour, along the branch between them.

Newton's method from a neighbour's path may lead to another kind of path. Where that is so the
action does not change between the two as its derivatives tell, or the index changes. The branch on
which the question changes evenly, followed by its arclength, leads to the path that goes on; where
it turns back first, at a fold, none does.
"""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np

from actionopt.analysis.solution import Solution
from actionopt.discrete.borders.arclength import STRAIGHT_STEP, Branch
from actionopt.discrete.meshes.path import Path
from actionopt.families.vary import Name, lead_to, slope_along, with_values
from actionopt.mechanics.question.problem import Problem
from actionopt.solver.ends.window import with_window_of
from actionopt.solver.solve import refuse_rest, solve_near
from actionopt.tools.types import Array, NDInt

Values = Mapping[Name, float]

# Ad hoc: of a path's size, from where it was expected: so near one goes on as its neighbours do,
# and farther than that one of the same index may be of another kind.
AS_EXPECTED, LEAP = 0.05, 0.5
# How far an action may be from what its slopes at both members tell, in parts of how much these
# differ, and of its change: beyond the first the index is asked, beyond the second the branch.
# Measured on 15 maps: of 246 paths beyond `AS_EXPECTED` that go on 125 are within the first and 11
# beyond the second; of 61 of another kind 6 are within the first, three of which are beyond `LEAP`.
OFF_SLOPES, OFF_BRANCH, SAME_CHANGE = 0.1, 1.0, 1e-3
# Ad hoc: the first step and the longest one, in parts of what changes on the way or, if that is
# less, of the coordinates' sizes; how many are tried, what one is that is straight, and the least
# change.
FIRST, LONGEST, BRANCH_STEPS, STRAIGHT, LEAST_WAY = 0.25, 1.0, 24, 0.99, 1e-3


class Continued(NamedTuple):
    """The path of a member beside a neighbour, or the best attempt.

    Whether it goes on from that; or whether the branch turned back before.
    """

    found: Solution
    goes_on: bool
    turned: bool = False


class _Branch(NamedTuple):
    """Where a branch leads: a path at the end of the way, or whether it turned back before."""

    path: Path | None
    turned: bool


def continue_path(
    near: Solution,
    ends: tuple[Values, Values],
    found: Solution,
    expected: Path,
    tol: float,
) -> Continued:
    """Return the path at the second values that goes on from that `near`, at the first ones.

    It is `found`, from where it was `expected`, if that goes on or none does.
    """
    if found.success and _goes_on(near, ends, found, expected):
        return Continued(found, True)
    try:
        path, turned = _follow(near, *ends)
    except ValueError:  # there is no question on the way
        return Continued(found, False)
    if path is None:
        return Continued(found, False, turned)
    other = refuse_rest(solve_near(found.problem, lead_to(path, found.problem), tol))
    return Continued(other, True) if other.success else Continued(found, False)


def disagree(rise: Array, before: Array, after: Array, part: float) -> NDInt:
    """Return where actions do not change as their slopes tell, to a `part` of their change, (C,).

    They `rise` from one member to another by the integral of a slope, which is about the mean of
    those at both, `before` and `after`. NaN where there are none, which tells nothing.
    """
    off = np.abs(rise - (before + after) / 2)
    return off > part * np.abs(after - before) + SAME_CHANGE * np.abs(rise)


def _goes_on(near: Solution, ends: tuple[Values, Values], found: Solution, expected: Path) -> bool:
    """Whether a path is near enough to where it was expected, or else tells that it goes on."""
    nodes = expected.mesh.nodes
    if not found.problem.has_tails:  # whose windows are parts of one time
        nodes = expected.mesh.moved(*found.mesh.boundaries[[0, -1]].tolist()).nodes
    size = np.abs(expected.values).max(axis=1)
    moved = np.abs(found(nodes) - expected.values).max(axis=1) / np.where(size > 0, size, 1.0)
    if moved.max() <= AS_EXPECTED:
        return True
    step = np.array([ends[1][name] - ends[0][name] for name in ends[1]])
    before, after = (slope_along(one, ends[1]) @ step for one in (near, found))
    known = np.array(found.action - near.action), before, after
    leapt, off = bool(moved.max() > LEAP), bool(disagree(*known, OFF_SLOPES))
    if leapt == off or disagree(*known, OFF_BRANCH):
        return not off
    with suppress(ValueError):  # there is no index
        return near.morse_index == found.morse_index
    return False


def _follow(near: Solution, start: Values, end: Values) -> _Branch:
    """Follow the branch of a path at some values to others.

    Raises ValueError where there is no question on the way.
    """
    family, at = partial(_between, near.problem, start, end), near.discrete
    ahead = 0.0, 1.0, 1.0
    branch, here = Branch.begin(family, at.problem, at.path, at.rows, at.tr.lengths, ahead)
    # The way counts as what changes along it does: near a fold that turns sharply else.
    rate = np.sqrt(max(1 / here.direction[-1] ** 2 - 1, LEAST_WAY**2))
    unit = min(rate, 1.0)
    branch.range = 1 / unit
    here = replace(here, direction=here.direction / branch.norm(here.tr, here.direction))
    length, longest = FIRST * unit, LONGEST * unit
    for left in range(BRANCH_STEPS, 0, -1):
        taken = branch.step(here, length)
        angle = 0.0 if taken is None else branch.angle(here, taken[0])
        if taken is None or angle < STRAIGHT_STEP:
            length /= 2
            continue
        there, corrections = taken
        if there.s >= 1:
            last = branch.to(there, 1.0) or branch.to(here, 1.0)
            return _Branch(None if last is None else last.path, turned=False)
        if there.direction[-1] <= 0:
            return _Branch(None, turned=True)
        if angle > STRAIGHT and corrections <= 3:
            length = min(2 * length, longest)
        here = there
        if length == longest and left * length * here.direction[-1] < 1 - here.s:  # it runs away
            break
    return _Branch(None, turned=False)


def _between(problem: Problem, start: Values, end: Values, part: float) -> Problem:
    """Return the problem at values a part of the way from some to others."""
    values = {name: (1 - part) * start[name] + part * end[name] for name in end}
    there = with_values(problem, values)
    return with_window_of(there, problem) if problem.has_tails else there
