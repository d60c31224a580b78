"""From a question whose duration is to be found, or whose paths close anywhere, to a solution.

A first path is one over a fixed duration, from how long a motion of the energy takes along the
straight line, or a guess. Newton's method on the path and what is beside it (`bordered`) takes it
to the energy, on a coarse mesh; from there it is followed from mesh to mesh, as between given
times.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from time import perf_counter
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from actionopt.analysis.shooting import motions
from actionopt.analysis.solution import Solution
from actionopt.analysis.status import Status
from actionopt.discrete.bordered import FULL, Bordered, loose, moves_of, over
from actionopt.discrete.discrete_path import DiscretePath
from actionopt.discrete.end_times import by_times
from actionopt.discrete.factors import Factors
from actionopt.discrete.mesh import Mesh
from actionopt.discrete.newton import approach, follow, is_roundoff
from actionopt.discrete.path import Path
from actionopt.discrete.resolution import refined, resolution
from actionopt.discrete.transcription import Transcription
from actionopt.mechanics.problem import Problem
from actionopt.solver.arguments import Guess, curve
from actionopt.solver.durations import along, rates, returning
from actionopt.solver.iterate import (
    SAFETY,
    UNKNOWN_GAIN,
    amplified,
    estimate,
    measured,
)
from actionopt.solver.ladder import COARSE_DEGREE
from actionopt.solver.record import Record
from actionopt.solver.refine import ILL_CONDITIONED, MAX_UNKNOWNS, ROUNDS, STALLED, UNDETERMINED
from actionopt.solver.workspace import MEASURABLE, ROUGHLY
from actionopt.tools.types import Array
from actionopt.tools.watch import OutOfTime, Watch

STOPS = "an end free in place and time is where a motion of the energy comes to rest"
# Ad hoc.
FIRST_ELEMENTS = 4
FIRST_TOL = 1e-3  # of paths that are to be followed to the energy
REPRESENTED = 1e-4, 1e-7  # of a guess: what its first mesh leaves out, and the next one tried
APPROACHES = 40  # damped steps of Newton's method
SCANNED = 9  # durations either way, each the root of two times the next, that are looked at
PASSED = 400  # times a period at which a closed path is looked for what its start gives
PARTS, CLOSED_IN = 40, 9  # of the time between two of them, in turn: 40^9 is more than 1 / EPS
ON_START = 1e-9  # of a coordinate's size, how far from that it may begin: the tolerance if larger
# Singular values of Newton's matrix, of the largest, at a family; the step that ends there; and how
# far a path moves that is no rest, of its size.
SINGULAR, SETTLED, MOVING = 1e-7, 1e-7, 1e-6
SLIVER = 0.1  # of an element, ad hoc
NEAR_START = 1e-2  # as far as a first mesh tells
PUSHED = 1e-8  # force on a closed path: measured, 1e-14 on motions, and 1 or more on what is none
TRIED = np.logspace(-8, 8, 65)  # durations at which a straight line is looked at
PARABOLAS = 12  # steps to the least energy of paths over given durations
ASIDE = 0.9  # of the duration of the lowest path
MERGED = 1e-7  # of it, within which two paths are one: half the digits
LINE = 41  # points on the straight line


class Reached(NamedTuple):
    """A path and what is beside it."""

    bordered: Bordered
    y: Array

    @property
    def at(self) -> DiscretePath:
        """The path."""
        return self.bordered.discrete(self.y)

    @property
    def pushed(self) -> float:
        """The forces that hold a closed path, in its units and sizes: none hold a motion."""
        forces = self.y[self.y.size - self.bordered.borders.c.size :]
        q = self.y[: self.bordered.first.layout.unknowns]
        largest = np.abs(forces).max(initial=0.0)
        return float(largest / np.abs(q).max()) if largest else 0.0


@dataclass
class Unfixed:
    """A search under way.

    Attributes
    ----------
    problem : Problem
    tol : float
    watch : Watch or None
    record : Record
    hint : str
        What to add to the verdict.
    here : Reached or None
        The path at hand, whether it is one or not.
    """

    problem: Problem
    tol: float
    solve: Callable[..., Solution]
    watch: Watch | None = None
    record: Record = field(default_factory=Record)
    hint: str = ""
    here: Reached | None = None
    gain: float = UNKNOWN_GAIN
    noise: float = 0.0
    error: float = np.inf
    found_by: str = "none"
    blocked: str = ""
    merged: bool = False
    _reached: bool = False

    def __post_init__(self) -> None:
        self.moves = moves_of(self.problem)

    # -- first paths -----------------------------------------------------------------------------

    def firsts(self, guess: Guess | None) -> Iterator[tuple[Path, Array | None, str]]:
        """Yield paths, with multipliers (K, m) or none, from which to set out, and whence."""
        if guess is not None:
            for represented in REPRESENTED:
                yield self._guessed(guess, represented), None, "guess"
            return
        if self.problem.on_surface:
            self.hint = "no point was found on the surface of an event; give a guess"
        if self.problem.closes or self.problem.on_surface:
            return
        if not (self.problem.start.pinned and self.problem.end.pinned):
            yield from ((path, None, "motion") for path in self._stopping())
        yield from ((at.path, at.rows, "duration") for at in self.near())
        with suppress(ValueError):  # that no motion of the energy takes the straight line
            yield timed(self.problem, straight(self.problem).T), None, "line"

    def _guessed(self, guess: Guess, represented: float) -> Path:
        """Return a guess on a mesh that represents it, with its duration."""
        problem = self.problem
        if isinstance(guess, Solution):
            guess = guess.path
        if problem.free_time and not isinstance(guess, Path):
            guess = timed(problem, guess)
        if isinstance(guess, Path):
            path, duration = guess, guess.mesh.duration
            known = over(problem, duration)
            stretched = path.mesh.moved(known.start.t, known.end.t)
            path = Path(stretched, path.values)
            curve_on = path.on if problem.closes else sheared(path, known).on
        else:
            known = over(problem, 1.0)
            curve_on = curve(known, guess)
        mesh = Mesh.uniform(known.start.t, known.end.t, FIRST_ELEMENTS, COARSE_DEGREE)
        found = curve_on(mesh)
        for _ in range(ROUNDS // 2):
            size = np.abs(found.values).max(axis=1)
            size = np.where(size > 1e-9 * size.max(), size, max(size.max(), 1e-300))
            shown = resolution(mesh, found.values.T, size)
            if shown.worst <= represented:
                break
            mesh = refined(shown, represented / 2)
            found = curve_on(mesh)
        return found

    def near(self) -> Iterator[DiscretePath]:
        """Yield paths over fixed durations, near those of the energy."""
        problem = self.problem
        t = next((e.t for e in (problem.start, problem.end) if e.t is not None), 0.0)
        q = straight(problem)
        known = along(problem, q, t)
        if known is not None and known[1] > 0:
            durations = [float(known[0][-1])]
        else:
            durations = self._crossed()
            if known is not None and known[1] < 0:
                self.blocked = "the energy is below the potential on the straight line; "
            if known is not None:
                durations.append(float(known[0][-1]))
        if not durations:
            durations = [returning(problem, q[0], t)]
        for k, T in enumerate(durations):
            first = self._over(T)
            if first is not None:
                yield first
            if k == len(durations) - 1:
                yield from self._scanned(T, first)

    def _crossed(self) -> list[float]:
        """Return the durations over which the straight line has the energy, on the average."""
        found, last = [], None
        for T in TRIED:
            known = over(self.problem, float(T))
            mesh = Mesh.uniform(known.start.t, known.end.t, 2, COARSE_DEGREE)
            at = DiscretePath.of(known, Path(mesh, self._line(mesh)))
            if not np.any(at.path.values[:, 0] != at.path.values[:, -1]):
                return []
            with np.errstate(all="ignore"):
                excess = self.excess(at)
            if last is not None and last[1] * excess < 0:
                part = last[1] / (last[1] - excess)
                found.append(float(last[0] * (T / last[0]) ** part))
            last = (T, excess) if np.isfinite(excess) else None
        return found

    def _line(self, mesh: Mesh) -> Array:
        """Return the straight line at the nodes of a mesh, (n, K)."""
        q, s = straight(self.problem), mesh.nodes_since / mesh.duration
        return np.stack([np.interp(s, np.linspace(0, 1, LINE), row) for row in q.T])

    def _scanned(self, T: float, first: DiscretePath | None) -> Iterator[DiscretePath]:
        """Yield paths between whose durations the energy is passed, and say how low it gets."""
        seen = [] if first is None else [first]
        crossed = False
        for sign in (1, -1):
            last, before = first, None if first is None else self.excess(first)
            for k in range(1, SCANNED + 1):
                at = self._over(T * 2.0 ** (sign * k / 2), last)
                if at is None:
                    break
                excess = self.excess(at)
                seen.append(at)
                if before is not None and excess * before < 0:
                    crossed = True
                    part = before / (before - excess)
                    T0, T1 = (last or at).mesh.duration, at.mesh.duration
                    middle = self._over(T0 * (T1 / T0) ** part, at)
                    yield middle if middle is not None else at
                last, before = at, excess
        if not seen:
            return
        low = max(seen, key=self.excess)
        if not crossed:
            low = self._lowest(seen, low)
            # Two paths between two of the durations, or one where they merge: seen from a side.
            aside = self._over(ASIDE * low.mesh.duration, low)
            if aside is not None:
                yield aside
        excess, T = self.excess(self._sharp(low)), low.mesh.duration
        energy = float(self.problem.energy or 0)
        self.hint = self.blocked + (
            f"of the paths over {2 * SCANNED + 1} durations that were tried, the lowest energy "
            f"is that over {T:.6g}, {energy - excess:.6g}"
        )
        spread = max(float(np.ptp([self.excess(at) for at in seen])), abs(energy))
        self.merged = not crossed and abs(excess) < MERGED * spread
        if self.merged:
            self.hint = (
                f"the energy is the least of a path to there, that over {T:.6g}: two paths merge, "
                "and their duration is determined to half the digits; give a little more energy"
            )

    def _sharp(self, at: DiscretePath) -> DiscretePath:
        """Return a path over a given duration to the tolerance, if that succeeds."""
        found = self.solve(at.problem, tol=self.tol, guess=at.path, throw=False)
        return found.discrete if found.success else at

    def _lowest(self, seen: list[DiscretePath], low: DiscretePath) -> DiscretePath:
        """Return a path of least energy between durations that were tried, by parabolas."""
        seen = sorted(seen, key=lambda at: at.mesh.duration)
        k = seen.index(low)
        if not 0 < k < len(seen) - 1:
            return low
        three = seen[k - 1 : k + 2]
        for _ in range(PARABOLAS):
            x = np.log([at.mesh.duration for at in three])
            curvature, slope, _ = np.polyfit(x - x[1], [-self.excess(at) for at in three], 2)
            to = x[1] - slope / 2 / curvature if curvature > 0 else np.nan
            if not x[0] < to < x[2] or abs(to - x[1]) < MERGED:
                break
            at = self._over(float(np.exp(to)), three[1])
            if at is None:
                break
            four = sorted([*three, at], key=lambda at: at.mesh.duration)
            k = max(1, min(2, int(np.argmax([self.excess(at) for at in four]))))
            three = four[k - 1 : k + 2]
        return max(three, key=self.excess)

    def _stopping(self) -> Iterator[Path]:
        """Yield motions to where they come to rest, if nothing is given at one end.

        No momentum is left at an end that is free in all coordinates. Of one coordinate, as there
        the energy leaves the motion no choice.
        """
        problem = self.problem
        t0 = problem.start.t or 0.0
        if problem.system.n > 1 or problem.end.pinned or not problem.start.pinned:
            return
        q0 = np.array(problem.start.q, dtype=float)
        speed, left = rates(problem, q0[None], np.ones((1, 1)), np.array([[t0]]))
        if not left[0] > 0:
            return
        T = returning(problem, q0, t0)
        for factor in np.logspace(0, SCANNED / 2, SCANNED + 1, base=2.0):
            known = over(problem, float(T * factor))
            for path in motions(known, np.array([[speed[0], -speed[0]]])):
                if path is None:
                    continue
                t = np.linspace(t0, t0 + T * factor, PASSED + 1)
                turned = np.flatnonzero(np.diff(np.sign(path.velocity(t)[0])))
                if turned.size:
                    k = turned[0]
                    b = path.mesh.boundaries
                    b = np.append(b[b < t[k]], t[k + 1])
                    cut = Mesh(b, path.mesh.degrees[: b.size - 1])
                    yield Path.interpolate(path, cut)
                    return

    def excess(self, at: DiscretePath) -> float:
        """Return by how much the given energy is above that of a path."""
        t0, t1 = by_times(at)
        slope = -t0 if self.problem.end.t is not None else t1
        return slope + float(self.problem.energy or 0.0)

    def _over(self, duration: float, near: DiscretePath | None = None) -> DiscretePath | None:
        """Return a path of the problem over a duration, near another one if that is given; or None.

        That is one on the same mesh, stretched: it tells the energy well enough.
        """
        known = over(self.problem, duration)
        values = self.problem.parameters
        fixed = Problem(known.system, known.start, known.end, parameters=values)
        if near is not None:
            mesh = near.mesh.moved(fixed.start.t, fixed.end.t)
            tr = Transcription(fixed, mesh, near.tr.lengths)
            result = follow(tr, tr.pack(near.Q, np.nan_to_num(near.rows)))
            at = DiscretePath(tr, result.z)
            if not result.converged:
                return None
            sizes = measured(fixed, at.Q)[0]
            return at if resolution(mesh, at.Q, sizes).worst < ROUGHLY else None
        try:
            found = self.solve(fixed, tol=FIRST_TOL, throw=False)
        except ValueError:
            return None
        return found.discrete if found.success else None

    # -- from a first path to one ---------------------------------------------------------------

    def reach(self, path: Path, lam: Array | None, *, damped: bool) -> bool:
        """Go to the path of the energy, or one that closes, near a rough one."""
        problem = loose(self.problem) if self.problem.closes else self.problem
        self.hint = "" if problem.closes else self.hint
        self.here = self._around(path, None if lam is None else np.nan_to_num(lam), problem)
        if not self._follow():
            if not damped:
                return False
            bordered, y = self.here
            with self.record.clock("solve"):
                found = approach(bordered, y, APPROACHES)  # type: ignore[arg-type]
            if found is None:
                return False
            self.record.iterations["newton"] += found[1]
            self.here = Reached(bordered, found[0])
            if not self._follow():
                return False
        return problem is self.problem or not self.problem.start.pinned or self._begun(NEAR_START)

    def _begun(self, near: float) -> bool:
        """Begin a closed path where it passes the coordinates that the start gives, or so near."""
        assert self.here is not None
        at, pinned = self.here.at, list(self.problem.start.pinned)
        wanted = np.array([self.problem.start.q[i] for i in pinned], dtype=float)[:, None]
        unit = at.tr.lengths[pinned, None]
        T = at.mesh.duration

        def away(since: Array) -> tuple[Array, Array]:
            q, v = beyond(at.path, at.problem, since)
            return (q[pinned] - wanted) / unit, v[pinned] / unit

        t = np.linspace(-T, T, 2 * PASSED + 1)[:-1]
        far = np.linalg.norm(away(t)[0], axis=0)
        nearest = np.flatnonzero((far <= np.roll(far, 1)) & (far <= np.roll(far, -1)))
        passed = [
            _nearest(away, float(t[k]) - T / PASSED, t[k] + T / PASSED, t[k]) for k in nearest
        ]
        passed = [(s, np.abs(away(np.array([s]))[0]).max()) for s in passed if abs(s) < T]
        passes = [s for s, off in passed if off <= near]
        if not passes:
            self.hint = (
                "the closed path near the guess does not pass what the start gives: it comes as "
                f"near as {min(off for _, off in passed):.2g} of the size of the coordinate; leave "
                "it free, or give fewer coordinates there"
            )
            return False
        shift = min(passes, key=abs)
        self.here = self._around(rolled(at.path, shift, at.problem), None)
        if not self._follow():
            self.hint = "no closed path near the guess begins at what the start gives"
            return False
        return True

    def _is_begun(self) -> bool:
        """Whether a closed path begins at what the start gives."""
        assert self.here is not None
        at, pinned = self.here.at, list(self.problem.start.pinned)
        if not self.problem.closes or not pinned:
            return True
        wanted = np.array([self.problem.start.q[i] for i in pinned], dtype=float)
        off = np.abs(at.Q[0, pinned] - wanted) / at.tr.lengths[pinned]
        return bool(off.max() <= ON_START)

    def _around(self, path: Path, lam: Array | None, problem: Problem | None = None) -> Reached:
        problem = problem or self.problem
        with self.record.clock("assemble"):
            lengths = measured(over(problem, path.mesh.duration), path.values.T)[1]
            bordered, y = Bordered.around(problem, path, lam, lengths, self.moves)
        bordered.first.counts, bordered.first.watch = self.record.evaluations, self.watch
        return Reached(bordered, y)

    def _follow(self) -> bool:
        """Polish the path where it is; False if it is not there."""
        assert self.here is not None
        target = min(self.tol / (10 * SAFETY), 1e-13)
        bordered, y = self.here
        with self.record.clock("solve"):
            result = follow(bordered, y, target=target, steps=20)  # type: ignore[arg-type]
        self.record.iterations["newton"] += result.iterations
        self._reached = result.converged
        if not result.converged:  # where it was may be one of a family of paths
            with np.errstate(all="ignore"):
                stays = is_roundoff(bordered, y, bordered.residual(y))  # type: ignore[arg-type]
            self.noise = np.inf if stays else self.noise
            return stays
        self.here, self.noise, self.factors = (
            Reached(bordered, result.z),
            result.noise,
            result.factors,
        )
        return True

    def is_family(self, guess: Guess) -> bool:
        """Whether closed paths near the guess are a family: it moves to one of them and stays.

        By Newton's steps of least norm, as its matrix has no inverse at any of them.
        """
        if not self.problem.closes:
            return False
        bordered, y = here = self._around(self._guessed(guess, REPRESENTED[0]), None)
        if y.size > FULL:
            return False
        with np.errstate(all="ignore"):
            for _ in range(APPROACHES):
                matrix, residual = bordered.layout.full(bordered.kkt(y)), bordered.residual(y)
                if not (np.isfinite(matrix).all() and np.isfinite(residual).all()):
                    return False
                step, _, rank, _ = np.linalg.lstsq(matrix, residual, rcond=SINGULAR)
                y = y - step
                size = bordered.measured(step)
                if size < SETTLED:
                    here = Reached(bordered, y)
                    if rank == y.size or here.pushed > PUSHED or not _moves(here.at):
                        return False
                    self.here, self.found_by = here, "guess"
                    self.hint = (
                        "closed paths near the guess are a family, also but for where they begin"
                    )
                    return True
        return False

    def settled(self) -> Status:
        """Refine, and begin a closed path where its start says: its mesh moves with it."""
        status = self.refine()
        if not status.success or self._is_begun():
            return status
        near = max(self.tol, ON_START)
        return self.refine() if self._begun(near) else Status.NOT_FOUND

    def refine(self) -> Status:
        """Follow the path from mesh to mesh until the tolerance is met or cannot be."""
        stalled, last = 0, np.inf
        for _ in range(ROUNDS):
            started, here = perf_counter(), self.here
            assert here is not None
            at = here.at
            sizes = measured(at.problem, at.Q)[0]
            shown = resolution(at.mesh, at.Q, sizes)
            unit = float((here.bordered.first.lengths / sizes).max())
            noise = self.noise * max(unit, 1.0)
            self.gain = max(self.gain, amplified(noise))
            self.error = estimate(self.gain, shown.worst, noise)
            self.record.round(at.tr, perf_counter() - started)
            self.record.rounds[-1]["estimate"] = self.error
            if self.error <= self.tol:
                missed = self._missed(here) * max(unit, 1.0)
                self.error = max(self.error, SAFETY * missed)
                if self.error <= self.tol:
                    return Status.SOLVED
                stalled += 1
                cuts = at.tr.cuts(at.z)
                parts = [np.append(b, c) for b, c in zip(at.mesh.since, cuts, strict=False)]
                degrees = np.repeat(at.mesh.degrees, [p.size for p in parts])
                mesh = at.mesh.cut(np.concatenate([*parts, at.mesh.since[-1:]]), degrees)
            else:
                if shown.worst < MEASURABLE or self.gain * shown.worst < noise:
                    return Status.DEGENERATE if noise > UNDETERMINED else Status.FLOOR
                stalled = stalled + 1 if shown.worst > last / 2 else 0
                mesh = refined(shown, self.tol / (2 * SAFETY * self.gain))
            last = shown.worst
            if stalled == STALLED or mesh.offsets[-1] * at.problem.system.n > MAX_UNKNOWNS:
                return self._failed()
            path = at.path.on(mesh)
            first = path.values.T
            self.here = self._around(path, at.rows_on(mesh))
            if not self._follow():
                self.here = here
                return self._failed()
            there = self.here.at
            change = float(np.max(np.abs(there.Q - first) / sizes))
            longer = abs(there.mesh.duration / at.mesh.duration - 1)
            change += self.here.bordered.reach * longer
            if shown.worst > MEASURABLE:
                self.gain = max(change / shown.worst, 1.0)
        return self._failed()

    def judged(self, status: Status) -> Status:
        """Return the verdict on the path at hand: one that has to be pushed is none."""
        found = status.success or status is Status.FLOOR
        if found and self.here and self.here.pushed > max(self.tol, self.error, PUSHED):
            self.hint = "near the guess a path closes only if it is pushed along itself"
            self.error = np.inf
            return Status.NOT_FOUND
        return status

    def _missed(self, here: Reached) -> float:
        """Return how far the path would move if its forces were summed over other points."""
        bordered, y = here
        at = here.at
        if at.problem.system.structure.steady:
            return 0.0
        residual, drift = at.tr.missed(at.z)
        right = np.concatenate([residual, np.zeros(y.size - residual.size)])
        factors = self.factors or Factors(bordered.layout, bordered.kkt(y))
        step = factors.solve(right)
        return max(bordered.measured(step), drift / (1.0 + at.tr.turns(at.z)))

    def _failed(self) -> Status:
        return Status.DEGENERATE if self.noise > ILL_CONDITIONED else Status.UNRESOLVED


def beyond(path: Path, problem: Problem, since: Array) -> tuple[Array, Array]:
    """Return q and v (n, K) of a closed path at times since its start, before and after as well."""
    t0, T = path.mesh.boundaries[0], path.mesh.duration
    order, advance = list(problem.order), problem.advance
    assert advance is not None
    turns = np.clip(np.floor(since / T), -1, 1)
    t = t0 + np.clip(since - turns * T, 0.0, T)
    q, v, back = path(t), path.velocity(t), np.argsort(order)
    earlier = (q - advance[:, None])[back], v[back]
    later = problem.closed_from(q), v[order]
    pairs = zip(earlier, (q, v), later, strict=True)
    q, v = (np.where(turns < 0, a, np.where(turns > 0, c, b)) for a, b, c in pairs)
    return q, v


def rolled(path: Path, shift: float, problem: Problem) -> Path:
    """Return a closed path begun at the time `shift` after its start, or before."""
    mesh = path.mesh
    t0, T = mesh.boundaries[0], mesh.duration
    since, ahead = mesh.since, shift % T
    cut = min(int(np.searchsorted(since, ahead, side="right")) - 1, mesh.elements - 1)
    b = np.concatenate([[0.0], since[cut + 1 :] - ahead, since[1 : cut + 1] + (T - ahead), [T]])
    degrees = np.concatenate([mesh.degrees[cut:], mesh.degrees[: cut + 1]])
    # The element that is cut in two: a sliver of it goes with its neighbour.
    sliver = SLIVER * mesh.lengths[cut]
    keep = np.ones(degrees.size, dtype=bool)
    keep[0], keep[-1] = b[1] > sliver, T - b[-2] > sliver
    inner = b[1:-1][keep[:-1] & np.r_[np.ones(degrees.size - 2, dtype=bool), keep[-1]]]
    b = np.concatenate([[0.0], inner, [T]])
    curve = lambda t: beyond(path, problem, t - t0 + shift)[0]  # noqa: E731
    return Path.interpolate(curve, mesh.cut(b, degrees[keep]))


def _nearest(
    away: Callable[[Array], tuple[Array, Array]], a: float, b: float, middle: float
) -> float:
    """Return where between a and b what `away` returns, with its rate, is least: `middle` if not.

    Where it vanishes, or turns back.
    """
    for _ in range(CLOSED_IN):
        times = np.linspace(a, b, PARTS + 1)
        growing = np.einsum("ik,ik->k", *away(times)) >= 0
        turns = np.flatnonzero(~growing[:-1] & growing[1:])
        if not turns.size:
            break
        a, b = (float(times[turns[0] + k]) for k in (0, 1))
        middle = (a + b) / 2
    return middle


def _moves(at: DiscretePath) -> bool:
    return bool(np.ptp(at.Q, axis=0).max() > MOVING * np.abs(at.Q).max())


def sheared(path: Path, problem: Problem) -> Path:
    """Return a path moved in proportion to time so that it begins and ends where the events say."""
    s = path.mesh.nodes_since / path.mesh.duration
    values = path.values.copy()
    for event, k, part in ((problem.start, 0, 1 - s), (problem.end, -1, s)):
        for i in event.pinned:
            values[i] += (np.array(event.q[i], dtype=float) - path.values[i, k]) * part
    return Path(path.mesh, values)


def straight(problem: Problem) -> Array:
    """Return points (K, n) on the straight line between the events."""
    pairs = zip(problem.start.q, problem.end.q, strict=True)
    known = [(b if a is None else a, a if b is None else b) for a, b in pairs]
    start, end = np.array([[x or 0.0 for x in pair] for pair in known]).T
    return start + np.linspace(0, 1, LINE)[:, None] * (end - start)


def timed(problem: Problem, guess: ArrayLike | Callable[[Array], ArrayLike]) -> Path:
    """Return waypoints as a path, in the time that a motion of the energy takes along them.

    Raises ValueError for other guesses, which have no duration.
    """
    if callable(guess):
        raise ValueError(
            "expected a guess that says its duration where that is to be found, a Path or a "
            "solution, or waypoints, found a callable; Path.interpolate(callable, mesh) has one"
        )
    shape = curve(over(problem, 1.0), guess)
    start = next((e.t for e in (problem.start, problem.end) if e.t is not None), 0.0)
    s = np.linspace(0.0, 1.0, 10 * LINE)
    known = over(problem, 1.0)
    unit = Mesh.uniform(known.start.t, known.end.t, 10 * FIRST_ELEMENTS, COARSE_DEGREE)
    q = shape(unit)(known.start.t + s).T
    found = along(problem, q, start)
    if found is None:
        raise ValueError(
            f"expected waypoints that a motion of the energy {problem.energy:g} can pass, found "
            "the potential above it at all of them"
        )
    times = found[0]
    ends = over(problem, float(times[-1]))
    t0 = ends.start.t
    mesh = Mesh.uniform(t0, ends.end.t, 10 * FIRST_ELEMENTS, COARSE_DEGREE)
    rows = lambda t: np.stack([np.interp(t - t0, times, row) for row in q.T])  # noqa: E731
    return Path.interpolate(rows, mesh)


def solve_unfixed(
    problem: Problem,
    solve: Callable[..., Solution],
    tol: float,
    guess: Guess | None,
    principle: Literal["auto", "least", "stationary"],
    watch: Watch | None,
    *,
    thorough: bool = True,
) -> tuple[Solution, str]:
    """Return the solution of a problem whose duration is free or whose paths close, and a hint.

    With `thorough`, also on a mesh that represents the guess better, and by damped steps.
    """
    started = perf_counter()
    run = Unfixed(problem, tol, solve, watch)
    status = Status.NOT_FOUND
    try:
        for damped in (False, True):
            for k, (path, lam, how) in enumerate(run.firsts(guess)):
                if k and not thorough:
                    break
                if not run.reach(path, lam, damped=damped):
                    continue
                run.found_by = how
                status = run.judged(run.settled())
                if status.success or status is Status.FLOOR:
                    break
            if run.here is not None and np.isfinite(run.error):
                break
        if status is Status.NOT_FOUND and guess is not None and run.is_family(guess):
            status = Status.DEGENERATE
    except OutOfTime:
        status = Status.OUT_OF_TIME
    if watch is not None and watch.raised is not None and not isinstance(watch.raised, OutOfTime):
        raise watch.raised
    events = () if problem.closes else (problem.start, problem.end)
    anywhere = any(e.t is None and e.on is None and not e.pinned for e in events)
    if anywhere and not status.success:
        run.hint = f"{STOPS}; {run.hint}" if run.hint else STOPS
    if run.merged and status in (Status.NOT_FOUND, Status.UNRESOLVED):
        status = Status.DEGENERATE
    solution = _solution(run, status, started)
    if principle == "least" and status.success and solution.morse_index > 0:
        solution = _solution(run, Status.NOT_LEAST, started)
    return solution, run.hint


def _solution(run: Unfixed, status: Status, started: float) -> Solution:
    """Return the path at hand as a solution of the problem, with its times found."""
    if run.here is None:
        path, rows, duration = None, None, 1.0
    else:
        at = run.here.at
        path, rows, duration = at.path, at.rows, at.mesh.duration
    problem = over(run.problem, duration)
    # An error as large as the path: it ran away, and lies on no surface.
    if path is not None and run.problem.on_surface and run.error < 1:
        problem = run.problem.found(problem.start.t, problem.end.t, path.values[:, [0, -1]].T)
    if path is None:
        mesh = Mesh.uniform(problem.start.t, problem.end.t, FIRST_ELEMENTS, COARSE_DEGREE)
        path = Path(mesh, run._line(mesh))
    known = DiscretePath.of(problem, path, rows)
    record = run.record
    record.time["total"] = perf_counter() - started
    noise = run.noise
    stats: dict[str, Any] = {
        "rung": run.found_by,
        "unknowns": known.tr.layout.unknowns,
        "rows": known.tr.layout.rows,
        "iterations": dict(record.iterations),
        "evaluations": dict(record.evaluations),
        "rounds": record.rounds,
        "gain": run.gain,
        "noise": noise,
        "condition": max(noise / np.finfo(float).eps, 1.0),
        "derived": problem.system.derived,
        "time": dict(record.time),
    }
    lam = known.rows.T
    error = run.error if status.success or status is Status.FLOOR else np.inf
    action = known.action
    return Solution(problem, known.path, action, lam, error, status, stats, known=known)
