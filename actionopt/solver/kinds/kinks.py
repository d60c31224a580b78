"""Paths that cross kinks of L in q: each side has a law, and the crossings are events.

Newton's method does not see what a kink adds to the second derivatives. Where it lost the path, the
path is sought as one of several legs, which passes from one branch of L to the next at times that
are found, with the same momentum and energy. Which kinks it crosses, in which order, is read off
the path at hand, and off the answer again until both agree.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from actionopt.analysis.solution import Solution
from actionopt.analysis.status import Status
from actionopt.discrete.action.transcription import Transcription
from actionopt.discrete.between_nodes.crossing import CONTINUOUS
from actionopt.discrete.meshes.mesh import Mesh
from actionopt.discrete.meshes.path import Path
from actionopt.mechanics.laws.branches import Branches
from actionopt.mechanics.laws.tracing import SAMPLES
from actionopt.mechanics.question.events import Event
from actionopt.mechanics.question.problem import Problem
from actionopt.solver.input.arguments import Guess, curve
from actionopt.solver.kinds.between import Choices, Found, between
from actionopt.solver.kinds.revisions import revise, revise_all
from actionopt.solver.kinds.through import solve_through
from actionopt.solver.refinement.family import LOST
from actionopt.solver.refinement.first_mesh import COARSE_DEGREE
from actionopt.solver.search.near_guess import GUESS_MESHES
from actionopt.solver.search.strategies import CHEAP, GUESS_ONLY
from actionopt.tools.types import NDInt

# Kinks beyond which a path is sought as one of several laws at once, such as those of a table, and
# how well the path is known from which these are read. Measured: a table of 60 points takes .6 to
# 1.8 s for 2 to 15 s and more, one of 120 with 46 crossings 4 s, of 300 with 116 15 s.
MANY, ROUGHLY_KNOWN = 16, 1e-2
MOST_CROSSINGS = 128  # of a path that is sought; ad hoc
CROSSING_ROUNDS = 6  # rounds in which the crossings of an answer are taken for the next; ad hoc
TOGETHER = 1e-9  # of the duration: kinks nearer to one another are passed as one; ad hoc


def cross_kinks(problem: Problem, guess: Guess | None, choices: Choices) -> Found:
    """Return the path between events at given times, and the verdict with its figures.

    It is sought as one of several laws where quick ways lose it, or kinks are many; where that
    fails, in all other ways.
    """
    branches = problem.system.branches
    assert branches is not None
    many = sum(knots.size for knots in branches.knots) > MANY
    strategies = CHEAP if guess is None else GUESS_ONLY
    tol = max(choices.tol, ROUGHLY_KNOWN) if many else choices.tol
    found = between(problem, guess, replace(choices, tol=tol, strategies=strategies))
    if not many and found[0].status not in (*LOST, Status.FLOOR):
        return revise(problem, guess, choices, found)
    crossed = _cross(branches, problem, guess, choices, found[0].path)
    return crossed or revise_all(problem, guess, choices)


def _cross(
    branches: Branches, problem: Problem, guess: Guess | None, choices: Choices, attempt: Path
) -> Found | None:
    """Return a path of several laws that crosses kinks of L as one of the first paths does."""
    seen: list[NDInt] = []
    for path, led in _first_paths(problem, guess, attempt):
        kinks, pieces = crossings(branches, problem, path)
        for _ in range(CROSSING_ROUNDS):
            again = led and any(_alike(pieces, other) for other in seen)
            if not 0 < len(kinks) <= MOST_CROSSINGS or again:
                break
            seen.append(pieces)
            legs = _legs(branches, problem, kinks, pieces)
            known = choices.tol, path if led else None, choices.principle, choices.watch
            solution, _ = solve_through(legs, *known)
            if not solution.success:
                break
            path, led = solution.path, True
            kinks, there = crossings(branches, problem, path)
            if _alike(there, pieces):
                return None if _jumps(branches, problem, solution, pieces) else (solution, "")
            pieces = there
    return None


def _alike(one: NDInt, other: NDInt) -> bool:
    """Whether the pieces are the same; numpy's own function swallows what a time limit raises."""
    return one.shape == other.shape and bool((one == other).all())


def crossings(
    branches: Branches, problem: Problem, path: Path
) -> tuple[list[tuple[int, int]], NDInt]:
    """Return which kinks a path crosses, one after the other, and the pieces on its legs (k+1, S).

    Of each the number of the kink and that of its knot. Those that are crossed at once are one.
    """
    ends = problem.start.t, problem.end.t
    # Without the ends, which may be on a kink.
    t = np.unique(np.append(np.linspace(*ends, SAMPLES), path.mesh.nodes))[1:-1]
    x = branches.evaluate(path(t).T, t[:, None], problem.packed)[0].copy()
    pieces = branches.pieces(x)
    crossed = []
    for k, which in np.argwhere(np.diff(pieces, axis=0)).tolist():
        before, after = pieces[k : k + 2, which].tolist()
        up = after > before
        for knot in range(before, after) if up else range(before - 1, after - 1, -1):
            off = branches.knots[which][knot] - x[k : k + 2, which]
            when = t[k] + (t[k + 1] - t[k]) * off[0] / (off[0] - off[1])
            crossed.append((when, which, knot, knot + up))
    rows, kinks, last = [pieces[0]], [], -np.inf
    for when, which, knot, piece in sorted(crossed):
        if when - last > TOGETHER * problem.duration:
            kinks.append((which, knot))
            rows.append(rows[-1].copy())
        rows[-1][which], last = piece, when
    return kinks, np.array(rows)


def _jumps(branches: Branches, problem: Problem, solution: Solution, pieces: NDInt) -> bool:
    """Return whether L jumps where a path passes from one law to the next: it is no answer then."""
    given = problem.parameters
    times = [event.t for event in solution.problem.through if event.t is not None]
    states = zip(times, solution(times).T, solution.velocity(times).T, strict=True)
    for (t, q, v), row in zip(states, pairwise(pieces.tolist()), strict=True):
        before, after = (
            float(branches.law(one).lagrangian(q, v, t, parameters=given)) for one in row
        )
        if abs(after - before) > CONTINUOUS * max(abs(before), abs(after)):
            return True
    return False


def _legs(
    branches: Branches, problem: Problem, kinks: Sequence[tuple[int, int]], pieces: NDInt
) -> Problem:
    """Return the same question of a path that crosses these kinks."""
    laws = [branches.law(row) for row in pieces.tolist()]
    through = [Event(None, None, on=branches.surface(*kink)) for kink in kinks]
    given = problem.parameters
    return Problem(laws, problem.start, problem.end, parameters=given, through=through)


def _first_paths(
    problem: Problem, guess: Guess | None, attempt: Path
) -> Iterator[tuple[Path, bool]]:
    """Yield paths whose crossings may be those of the answer, and whether these are near it."""
    mesh = Mesh.uniform(problem.start.t, problem.end.t, GUESS_MESHES[-1], COARSE_DEGREE)
    if guess is not None:
        yield curve(problem, guess)(mesh), True
    yield attempt, True
    if guess is None:
        yield Path(mesh, Transcription(problem, mesh, problem.lengths).straight().T), False
