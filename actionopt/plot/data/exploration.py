"""Exploring a problem step by step: bend a trial path, solve, and move the end time.

The end time slides along a motion: the end event stays where the motion, continued forward, is at
that time, so that the path from start to end is always the first part of one motion, its end
passes one conjugate point after the other, and its index counts them. What the trial deviates
from the motion is kept, so that one variation can be seen to raise S before and to lower it after.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property

from actionopt.analysis.motion.forward import IntegrationError, integrate
from actionopt.analysis.solution import Solution
from actionopt.analysis.spectra.conjugate import SAME_ROOT, ConjugatePoint, conjugate_points
from actionopt.analysis.status import Status
from actionopt.discrete.action.transcription import Transcription
from actionopt.discrete.meshes.path import Path
from actionopt.mechanics.question.problem import Event, Problem
from actionopt.plot.data.trial import Trial, move_node, straight, trial_at
from actionopt.solver.input.arguments import Guess
from actionopt.solver.search.search import REACHED
from actionopt.solver.solve import solve
from actionopt.tools.immutable import immutable
from actionopt.tools.shown import one_line

LONGEST_CONTINUED = 3.0  # durations of the first problem, to which its motion is continued
CONTINUED_PARTS = (1.0, 0.5, 0.2)  # of the way there, where it cannot be
CONJUGATE = (
    "the end is conjugate to the start: to second order the action is the same for neighbours of "
    "this motion between the same events, which do not determine the path; move the end time on"
)


@immutable
class Continuation:
    """A stationary path continued forward beyond its end.

    Attributes
    ----------
    path : Path
    conjugate : tuple of ConjugatePoint
        The times conjugate to the start along all of it.
    """

    path: Path
    conjugate: tuple[ConjugatePoint, ...]

    __repr__ = one_line

    @property
    def end(self) -> float:
        """The latest time."""
        return float(self.path.mesh.boundaries[-1])

    @property
    def times(self) -> list[float]:
        """The conjugate times, each as often as its multiplicity."""
        return [p.t for p in self.conjugate for _ in range(p.multiplicity)]

    def near(self, t: float, distance: float) -> float:
        """Return the conjugate time within `distance` of t, if there is one, else t."""
        nearest = min(self.times, key=lambda c: abs(c - t), default=t)
        return nearest if abs(nearest - t) <= distance else t

    def before(self, t: float) -> list[float]:
        """Return the conjugate times before t: their number is the index of the path to t."""
        close = SAME_ROOT * (t - float(self.path.mesh.boundaries[0]))
        return [c for c in self.times if c < t - close]


def motion(solution: Solution, latest: float) -> Continuation:
    """Return the motion that a solution is the first part of, continued to `latest` if it can."""
    problem, start, t = solution.problem, solution.start, solution.problem.end.t
    for part in CONTINUED_PARTS:
        end = t + part * (latest - t)
        try:
            path = integrate(problem.system, start, end, parameters=problem.parameters)
            whole = solve(_until(problem, path, end), guess=path, throw=False)
            return Continuation(path, _conjugate(whole if whole.status in REACHED else solution))
        except (IntegrationError, ValueError):
            continue
    return Continuation(solution.path, _conjugate(solution))


def _until(problem: Problem, path: Path, t: float) -> Problem:
    """Return the problem whose end is pinned where `path` is at the time t."""
    return problem.replace(end=Event(t, path(t)))


def _conjugate(solution: Solution) -> tuple[ConjugatePoint, ...]:
    try:
        return conjugate_points(solution)
    except ValueError:  # with non-conservative forces there is no second variation
        return ()


# -- the exploration -----------------------------------------------------------------------------


@immutable
class Exploration:
    """What is known at one moment: the trial, and the stationary path if one was found.

    Attributes
    ----------
    trial : Trial
    latest : float
        The last end time.
    guess : Path, callable, array or None
        Where to seek when nothing is found near the trial.
    solution : Solution or None
        The stationary path between the trial's events; None before it was sought, or where the
        events do not determine it.
    motion : Continuation or None
        What it is the first part of.
    message : str
        What came of the last step, a sentence; empty if there is nothing to say.
    """

    trial: Trial
    latest: float
    guess: Guess | None = None
    solution: Solution | None = None
    motion: Continuation | None = None
    message: str = ""

    __repr__ = one_line

    @cached_property
    def stationary(self) -> Trial | None:
        """The stationary path on the trial's mesh."""
        if self.motion is None:
            return None
        tr = self.trial.tr
        path = self.solution.path if self.solution else self.motion.path
        return trial_at(tr, path(tr.mesh.nodes).T)

    @cached_property
    def verdict(self) -> tuple[str, int] | None:
        """Kind and index of the stationary path; None if there is none, or no second variation."""
        if self.motion is None:
            return None
        if self.solution is None:
            return "degenerate", len(self.motion.before(self.trial.tr.problem.end.t))
        try:
            return self.solution.kind, self.solution.morse_index
        except ValueError:
            return None


def begin(problem: Problem, guess: Guess | None = None) -> Exploration:
    """Return an exploration with its first trial. Raises ValueError as `straight` does."""
    latest = problem.start.t + LONGEST_CONTINUED * problem.duration
    return Exploration(straight(problem, guess), latest, guess)


def bend(now: Exploration, trial: Trial, node: int, to: dict[int, float]) -> Exploration:
    """Return the exploration with `trial`, one of its own, `moved`; if it cannot, the reason."""
    try:
        return replace(now, trial=move_node(trial, node, to), message="")
    except ValueError as error:
        return replace(now, message=str(error))


def restart(now: Exploration) -> Exploration:
    """Return the exploration with the straight line, or the guess, between the present events."""
    try:
        return replace(now, trial=straight(now.trial.tr.problem, now.guess), message="")
    except ValueError as error:
        return replace(now, message=str(error))


def to_solution(now: Exploration) -> Exploration:
    """Return the exploration with the stationary path near the trial as its trial.

    Where none is found near, it is sought from the guess or from nothing, and that is said.
    """
    found = _with_solution(now)
    if found.solution is None:
        return found
    assert found.stationary is not None
    return replace(found, trial=found.stationary)


def _with_solution(now: Exploration) -> Exploration:
    """Return the exploration with the stationary path near the trial known."""
    problem, message = now.trial.tr.problem, ""
    guesses = (now.trial.path, None) if now.guess is None else (now.trial.path, now.guess, None)
    for guess in guesses:
        try:
            solution = solve(problem, guess=guess, throw=False)
        except (ValueError, ArithmeticError) as error:
            message = str(error)
            continue
        if solution.status in REACHED:
            if message:
                message = "No solution was found near the trial; this one is elsewhere."
            known = motion(solution, now.latest)
            return _with_note(replace(now, solution=solution, motion=known, message=message))
        message = _why(solution.status)
    return replace(now, message=message)


def lasting(now: Exploration, t: float) -> Exploration:
    """Return the exploration with the end event moved along the motion to the time t.

    The motion near the trial is sought first, if none is known. Coordinates that are free at the
    end stay so, and the motion is then another one. Where the end is conjugate to the start the
    motion is still there, though its ends do not determine it: the message says so.
    """
    if now.motion is None:
        now = _with_solution(now)
    if now.motion is None or now.stationary is None:
        return now
    problem, path = now.trial.tr.problem, now.motion.path
    t = min(t, now.motion.end)
    pinned = problem.end.pinned
    q = [float(x) if i in pinned else None for i, x in enumerate(path(t))]
    try:
        other = problem.replace(end=Event(t, q))
        tr = Transcription(other, now.trial.tr.mesh.moved(problem.start.t, t), now.trial.tr.lengths)
        solution = solve(other, guess=Path(tr.mesh, path(tr.mesh.nodes)), throw=False)
        known = solution.status in REACHED
        base = (solution.path if known else path)(tr.mesh.nodes).T
        trial = trial_at(tr, base + now.trial.Q - now.stationary.Q)
    except ValueError as error:
        return replace(now, message=str(error))
    same = len(pinned) == problem.system.n or not known
    there = replace(
        now,
        trial=trial,
        solution=solution if known else None,
        motion=now.motion if same else motion(solution, now.latest),
        message="" if known else _why(solution.status),
    )
    return _with_note(there)


def _with_note(now: Exploration) -> Exploration:
    """Return the exploration, with a word on it where the stationary path is degenerate."""
    degenerate = now.verdict is not None and now.verdict[0] == "degenerate"
    return replace(now, message=CONJUGATE) if degenerate and not now.message else now


def _why(status: Status) -> str:
    return CONJUGATE if status is Status.DEGENERATE else status.value
