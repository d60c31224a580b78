"""All the paths between two events, as far as they can be found.

Of one degree of freedom they are the roots of a function of the initial velocity. Others are sought
in every way at hand: least paths from several coarse starts, forward motions in all directions
aimed at the second event, Newton's method that keeps away from what is known, and continuation of
every path found through folds in the end time, where paths appear in pairs. Each is then solved to
the tolerance and compared with the forward motion from its own start. No search of this kind proves
that nothing is left.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress
from html import escape

import numpy as np

from actionopt.analysis.solution import Solution
from actionopt.families.searches.centres import guesses
from actionopt.families.searches.searches import SAME_PATH, SURE, Answers
from actionopt.mechanics.question.problem import Problem
from actionopt.mechanics.question.scales import first_state
from actionopt.solver.ends.window import for_search
from actionopt.solver.input.arguments import check_problem
from actionopt.solver.solve import solve_near
from actionopt.tools.blas import one_thread
from actionopt.tools.checks import tolerance
from actionopt.tools.immutable import immutable
from actionopt.tools.shown import row_of
from actionopt.tools.types import Array
from actionopt.tools.watch import Progress, check_progress, time_limit

SAME_MOTION = 0.05  # of its size, by which a path may differ from one on a window; ad hoc
# Rounds of a closed path that are told, and places at which it is compared with itself; ad hoc.
ROUNDS_TOLD, ROUND_SAMPLES = 24, 240
PERIOD_PROBES = 16  # random points at which periodicity is checked; ad hoc: one would do, as a rule


@immutable
class Paths:
    """Distinct stationary paths between the same events, by increasing action.

    Attributes
    ----------
    solutions : tuple of Solution
        Each agrees with the forward motion from its own start, but along an obstacle, where
        contact is no motion; `morse_index` and `kind` say what each is. The end event of a
        solution with windings is the given one plus 2 pi each; of a closed path, the advance.
    windings : tuple of tuple of int
        For each path, how many turns more than the events say each of `angles` makes.
    found_by : tuple of str
        How each was found first.
    angles : tuple of str
        The coordinates whose values count modulo 2 pi.
    searched : dict
        How often each way of searching was tried.
    rejected : int
        Discrete solutions left out because forward motion contradicts them.
    families : tuple of Solution
        Of each family of paths that the events do not tell apart one, by increasing action; they
        are not among `solutions`. The verdict of such a path is DEGENERATE, or its `kind`
        "degenerate": S changes along a family by nothing, or, at a fold, less than quadratically.
    kinked : int
        Paths left out that return to a coordinate which the start gives, but with another
        momentum: they do not close.
    complete : bool
        Whether theory says that there are no others within the windings: linear equations of
        motion have one path.
    interrupted : bool
    """

    solutions: tuple[Solution, ...]
    windings: tuple[tuple[int, ...], ...]
    found_by: tuple[str, ...]
    angles: tuple[str, ...]
    searched: dict[str, int]
    rejected: int
    complete: bool
    interrupted: bool
    families: tuple[Solution, ...] = ()
    kinked: int = 0

    def __repr__(self) -> str:
        """Show how many paths there are, their actions, and whether there may be others."""
        actions = row_of((f"{s.action:.6g}" for s in self.solutions), len(self))
        more = f"; {len(self.families)} families" if self.families else ""
        ended = "; interrupted" if self.interrupted else ""
        return f"Paths({len(self)}: S = {actions or 'none'}{more}{ended})"

    def __len__(self) -> int:
        """Return the number of paths."""
        return len(self.solutions)

    def __iter__(self) -> Iterator[Solution]:
        """Iterate over the solutions."""
        return iter(self.solutions)

    def __getitem__(self, k: int) -> Solution:
        """Return path k, counted by increasing action. Raises IndexError if there is none."""
        try:
            return self.solutions[k]
        except IndexError:
            raise IndexError(f"expected one of {len(self)} paths, found number {k}") from None

    @property
    def indices(self) -> tuple[int, ...]:
        """Morse indices of the paths. Raises ValueError where the paths are forced."""
        return tuple(s.morse_index for s in self.solutions)

    @property
    def rounds(self) -> tuple[int, ...]:
        """How many times each path runs round a shorter closed one; 1 where it does not.

        The least period of a closed path is its duration divided by this number.
        """
        return tuple(_rounds(s) for s in self.solutions)

    def _repr_html_(self) -> str:
        """Show a row for each path, and how they were sought, as a notebook does."""
        from actionopt.tools.notebook import table

        rows = []
        for s, turns, how in zip(self.solutions, self.windings, self.found_by, strict=True):
            index = ""
            with suppress(ValueError):  # forced paths have none
                index = f"index {s.morse_index}"
            wound = f"windings {turns}" if self.angles else ""
            rows.append((f"S = {s.action:.10g}", index, wound, f"found by {how}"))
        first, _, rest = str(self).partition("\n")
        said = [line for line in rest.split("\n") if not line.startswith(" ")]
        return table(first, rows) + "".join(f"<p>{escape(line)}</p>" for line in said)

    def __str__(self) -> str:
        """Say what was found and how it was sought, in sentences."""
        lines = ["1 path" if len(self) == 1 else f"{len(self)} paths"]
        each = zip(self.solutions, self.windings, self.found_by, self.rounds, strict=True)
        for s, turns, how, rounds in each:
            what = ""
            with suppress(ValueError):  # forced paths have none
                what = f"index {s.morse_index}, "
            if rounds > 1:
                what += (
                    f"{rounds} times round a closed path of duration {s.duration / rounds:.6g}, "
                )
            wound = f"windings {turns}, " if self.angles else ""
            lines.append(f"  S = {s.action:.10g}, {what}{wound}found by {how}")
        for s in self.families:
            lines.append(f"  S = {s.action:.10g}, a family: its paths join the same events")
        tried = ", ".join(f"{count} {how}" for how, count in self.searched.items())
        lines.append(f"searched: {tried}" + (" (interrupted)" if self.interrupted else ""))
        if self.rejected:
            lines.append(f"left out: {self.rejected} that forward motion does not confirm")
        if self.kinked:
            lines.append(f"left out: {self.kinked} that return with another momentum, in a kink")
        lines.append(
            "there are no others: the equations of motion are linear"
            if self.complete
            else "there may be others: a search proves nothing about what it did not find"
        )
        return "\n".join(lines)


@one_thread
def solve_all(
    problem: Problem,
    *,
    tol: float = 1e-8,
    angles: Sequence[str] | None = None,
    windings: int = 1,
    starts: int = 6,
    shots: int = 100,
    continuations: int = 20,
    seed: int = 0,
    seconds: float | None = None,
    progress: Progress | None = None,
) -> Paths:
    """Return the distinct stationary paths between the events of `problem` that were found.

    Where the events do not determine the path, as between antipodal points of a sphere, one path
    of the family is kept, apart from the others. Where the end is `Periodic` the paths close,
    momenta included. Where an event lies on a surface, paths are sought to points all over it, and
    motions that meet it, the first time or later.
    Along an obstacle they are least paths, round all sides of it, from `starts` curves drawn by
    `seed` and then across each contact of those found: twice as many for each body on the way.

    Parameters
    ----------
    problem : Problem
    tol : float
        As for `solve`, for each path.
    angles : sequence of str, optional
        Coordinates that count modulo 2 pi. By default those that L, f and Q contain and are
        periodic in; an azimuth that they do not contain looks like any other coordinate and
        must be named.
    windings : int
        Most additional turns of each angle, either way; of a closed path, in its advance. Of more
        than 1000 combinations, as one turn of 7 angles has, the 1000 of fewest turns are tried.
        At a given energy, how often paths of one degree of freedom may pass their end before.
        Under constraints, where ever faster motions may arrive, it says how fast those are that
        several degrees of freedom are tried with: as such turns of the coordinates' sizes are.
    starts : int
        Curves, in each class of windings, from which least and deflated solves start.
    shots : int
        Forward motions in a batch; batches are repeated until one has found nothing new, and one
        three times as large has not, either. For one degree of freedom ten times as many, and more
        where they do not resolve where motions end; where all can be followed, no paths are sought
        by `starts` and `continuations`.
    continuations : int
        Most paths to be followed through folds.
    seed : int
        Of the random directions.
    seconds : float, optional
        The time it may take; then the search ends as if it were interrupted.
    progress : callable, optional
        `progress(stage, done, total, detail)`: the way of searching, how many starts of it were
        tried, how many there are, and {"found": the paths so far}. An interruption
        (KeyboardInterrupt) ends the search and keeps what was found.

    Raises
    ------
    ValueError
        For an unknown angle, a tol that `solve` would refuse, or numbers that are negative; for
        closed paths without a clock, of which there are families; where `solve` refuses the
        problem and nothing was found.
    """
    check_problem(problem)
    tolerance(tol)
    check_progress(progress)
    problem = problem.original
    _check_clock(problem)
    whole = problem.whole
    if whole.is_infinite:
        problem = for_search(whole, tol)
    names = problem.system.coordinates
    if angles is None:
        turning = detected_angles(problem)
    else:
        sequence = isinstance(angles, Sequence) and not isinstance(angles, str)
        if not sequence or not all(a in names for a in angles):
            raise ValueError(
                f"expected a sequence of angles among {', '.join(names)}, found {angles!r}"
            )
        turning = tuple(names.index(a) for a in angles)
    for count in (windings, starts, shots, continuations):
        if not isinstance(count, (int, np.integer)) or count < 0:
            raise ValueError(
                "expected whole numbers >= 0 of windings, starts, shots and continuations, "
                f"found {count!r}"
            )
    if problem.system.r and angles:
        raise ValueError(
            "expected no angles for a system with an obstacle, found some: give events that "
            "differ by the turns"
        )
    fixed = problem.system.r or problem.on_surface or problem.is_joined
    turning = () if problem.system.r or problem.is_joined else turning
    run = Answers(problem, tol, turning, 0 if fixed else windings, seed, progress)
    with time_limit(seconds):
        try:
            for start in run.starts(starts, shots, continuations):
                run.answer(start)
        except KeyboardInterrupt:
            run.interrupted = True
        if run.refused is not None and not (run.found or run.families or run.interrupted):
            raise run.refused
        if whole.is_infinite:
            candidates, run.found = run.found, []
            try:
                _add_without_end(run, whole, candidates)
            except KeyboardInterrupt:
                run.interrupted = True
    return _by_action(run)


def _add_without_end(
    run: Answers, whole: Problem, candidates: list[tuple[Solution, tuple[int, ...], str]]
) -> None:
    """Add to a search the paths of infinite times near `candidates`, which are on a window."""
    found, candidates = run.found, list(candidates)
    if whole.system.n == 1 and not whole.start.pinned and np.isinf(whole.end.t):
        rest, none = whole.end.near[0], (0,) * len(run.turning)
        for guess in guesses(run.problem, float(rest or 0.0)):
            run.tried["motions from the centre"] += 1
            path = solve_near(whole, guess, run.tol)
            if path.success:
                candidates.append((path, none, "a motion from the centre"))
    for near, turns, how in candidates:
        t = near.mesh.nodes
        path = solve_near(whole, near, run.tol)
        size = np.abs(near.path.values).max(axis=1, keepdims=True)
        size = np.where(size > 0, size, 1.0)
        if not path.success or np.any(np.abs(path(t) - near.path.values) > SAME_MOTION * size):
            continue  # it was held at the window's edge
        if all(np.any(np.abs(path(t) - other(t)) > SAME_PATH * size) for other, _, _ in found):
            found.append((path, turns, how))


def _check_clock(problem: Problem) -> None:
    """Raise ValueError if closed paths may start anywhere along themselves."""
    structure = problem.system.structure
    if problem.advance is not None and problem.free_time:
        raise ValueError(
            "expected events, or a period that is given, to look for all paths, found closed ones "
            "of a given energy; give a guess to `solve`, and follow it by `trace`"
        )
    if problem.advance is None or problem.start.pinned:
        return
    if not (structure.depends_on_time or structure.linear):
        raise ValueError(
            "expected closed paths that have a clock, found a system that does not depend on t "
            "and a start that gives no coordinate: each path may start anywhere along itself; "
            "give one coordinate at the start"
        )


def _by_action(run: Answers) -> Paths:
    """Return what was found, by increasing action."""
    ordered = sorted(run.found, key=lambda item: item[0].action)
    names, all_turns = run.problem.system.coordinates, (2 * run.windings + 1) ** len(run.turning)
    return Paths(
        tuple(s for s, _, _ in ordered),
        tuple(k for _, k, _ in ordered),
        tuple(how for _, _, how in ordered),
        tuple(names[i] for i in run.turning),
        dict(run.tried),
        run.rejected,
        run.linear and len(run.found) == all_turns and not run.interrupted,
        run.interrupted,
        tuple(sorted((s for s, _ in run.families), key=lambda s: s.action)),
        len(run.kinked),
    )


def _rounds(solution: Solution) -> int:
    """Return how many times a path runs round a shorter closed one, `ROUNDS_TOLD` at most."""
    problem, advance = solution.problem, solution.problem.advance
    if advance is None or list(problem.order) != sorted(problem.order):
        return 1
    s = np.linspace(0, 1, ROUND_SAMPLES, endpoint=False)

    def beside_advance(part: Array) -> Array:
        return solution(solution.start.t + part * solution.duration) - advance[:, None] * part

    q = beside_advance(s)
    near = max(SAME_PATH, SURE * solution.error) * np.abs(solution.path.values).max(axis=1)
    if (np.ptp(q, axis=1) <= near).all():  # at rest, or in uniform motion: so at any time
        return 1
    for k in range(ROUNDS_TOLD, 1, -1):
        again = beside_advance((s + 1 / k) % 1)
        if (np.abs(again - q).max(axis=1) <= near).all():
            return k
    return 1


def detected_angles(problem: Problem) -> tuple[int, ...]:
    """Return the coordinates in which L, f and Q are periodic with 2 pi, and not constant.

    On all legs, if these have laws of their own; none where integrals are given.
    """
    system = problem.system
    if problem.integral is not None:
        return ()
    rng = np.random.default_rng(0)
    known = [x for e in (problem.start, problem.end) for x in e.q if x is not None]
    size = max(1.0, *(abs(x) for x in known)) if known else 1.0
    q, v = size * rng.standard_normal((2, system.n, PERIOD_PROBES))
    duration = 1.0 if problem.free_time else problem.duration
    t = (problem.start.t or 0.0) + duration * rng.random(PERIOD_PROBES)
    here = _laws_at(problem, q, v, t)
    result = []
    for i, name in enumerate(system.coordinates):
        if name in system.structure.cyclic:
            continue
        shift = np.zeros((system.n, 1))
        shift[i] = 1.0
        turned = _laws_at(problem, q + 2 * np.pi * shift, v, t) - here
        moved = _laws_at(problem, q + shift, v, t) - here
        # A whole turn changes nothing; a step of one radian changes more than rounding does.
        both = np.isfinite(turned) & np.isfinite(moved)
        change = np.max(np.abs(moved[both]), initial=0.0)
        known = change > 1e-9 * np.max(np.abs(here[both]), initial=0.0)
        if known and np.max(np.abs(turned[both])) < 1e-6 * change:
            result.append(i)
    return tuple(result)


def _laws_at(problem: Problem, q: Array, v: Array, t: Array) -> Array:
    """Return L, constraints and forces of each law at q, v (n, K) and t (K,), in rows (rows, K)."""
    rows = []
    for law in problem.laws or (problem.system,):
        state = *first_state(law, q.T, v.T), t[:, None], problem.packed_of(law)
        with np.errstate(all="ignore"):
            rows.append(law.pointwise("value")(*state)[0].T.copy())
            if law.m:
                f = law.pointwise("constraint")(q.T, t[:, None], problem.packed_of(law))[0]
                rows.append(f.T.copy())
            if law.structure.forced:
                rows.append(law.pointwise("force")(*state)[0].T.copy())
    return np.concatenate(rows)
