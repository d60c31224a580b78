"""Compare a solution with forward integration, to see whether a motion goes its way.

A discrete problem can have solutions that are no paths at all, and its own residual does not
tell. The equations of motion do: they know nothing of the mesh or of the second event. Followed
from the solution's start they must stay on it and arrive. Where motions amplify small errors
nothing stays on anything for long, so the solution is also asked piece by piece; and how much they
amplify is told by motions with slightly other velocities. A motion that cannot be followed, as
through a collision, neither contradicts a solution nor confirms it.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Protocol

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from actionopt.analysis.motion.flow import (
    CVODES_LONGEST,
    ZERO_SIZE,
    Flow,
    FlowUnits,
    IntegrationError,
    span_within,
)
from actionopt.analysis.motion.forward import (
    LENGTH_RATIO,
    NARROWEST_PART,
    ForwardMotion,
    begin_leg,
    follow,
    longest_step,
    restarts,
)
from actionopt.analysis.motion.picard import FlowAbout, PicardIntegrator
from actionopt.analysis.motion.series import begins_singular
from actionopt.analysis.quadratic.second_variation import tangent
from actionopt.discrete.meshes.boundaries import sides
from actionopt.discrete.meshes.mesh import Mesh
from actionopt.discrete.meshes.path import Path
from actionopt.mechanics.laws.compiled import Pointwise
from actionopt.mechanics.laws.instants import Instant
from actionopt.mechanics.laws.laws import keep
from actionopt.mechanics.question.events import Event, State
from actionopt.mechanics.question.jumps import jumps
from actionopt.mechanics.question.problem import Problem
from actionopt.mechanics.system import System
from actionopt.tools.checks import tolerance
from actionopt.tools.immutable import immutable
from actionopt.tools.types import Array

# Ad hoc, where nothing else is said.
PIECES = 100  # at most; more say no more
# The least local tolerance there, and in parts of the deviation that is allowed.
PIECE_TOL, PIECE_SHARE = 1e-14, 1e-3
EVEN = 17  # times at which the round-off is asked for
MOST_CUTS = 2000  # at most, of pieces too unstable to say anything: bounds the time it takes
KINK_CUT = 0.38  # not in halves: a kink is where elements meet, and would hide between the parts
UNSTABLE = 100.0  # amplification within a piece that is cut
# The second run: of another tolerance, and steps in no simple ratio to the first one's.
LOOSER_TOL, SHORTER_STEPS = 10.0, 0.9
CHANGE_SHARE = 1e-4  # of a change of the start: the tolerance of a step that follows it
ERROR_MARGIN = 100.0  # from an estimated error to a deviation that contradicts it
EXPLAINED = 10.0  # times what a motion makes of a small change: a deviation that it explains
CERTAIN = 5e-2  # a deviation that no estimated error explains
# Of the deviation allowed, the tolerance of a step of the run that alone may confirm a solution; ad
# hoc: the run itself deviates by less then on motions that amplify errors a thousandfold.
RUN_SHARE = 1e-5
UNBALANCED = 1e-3  # a drift of the energy that is no round-off, also beside a large constant in L
# Rate of Baumgarte's terms, over a piece: drift off the constraints decays in it by exp(-10).
BAUMGARTE_RATE = 10.0
UNTOLD = "; piece by piece, as far as it can be followed, nothing contradicts the path"
QUARTERS = np.array([0.25, 0.5, 0.75, 1.0])  # of a piece
DRAWN_TOL = 1e-9  # of a motion that is drawn only: far below a pixel
NEARLY = (0.99, 0.9, 0.5)  # of the time that a motion lasts: parts of it that may be drawn


@immutable
class Comparison:
    """The distance between a solution and forward integration.

    Positions are in units of each coordinate's own size, the largest |q| it reaches along the
    path (as `tol` is), velocities in units of the largest |v|.

    Where the motion cannot be followed to the end event, the numbers that would need it are NaN.

    Attributes
    ----------
    position, velocity : float
        Largest deviation over the whole time, of the motion from the solution's start. Velocities
        are not compared where they may jump: in elements shorter than a ten-thousandth of the
        duration, and where the Lagrangian jumps in time.
    arrival : float
        Deviation of that motion's position at the end event.
    local : float
        Largest deviation of position from motions that begin anew, on the solution, in the
        middle of each element (or of each of a hundred groups of elements) and end in the
        middle of the next. Unlike `position` it is not amplified by unstable motions, and a
        kink where elements meet shows. What is more than `allowed` is looked at in shorter
        pieces if these amplify errors, and divided by what is left of that beyond ten times.
        None begins where velocities may jump; NaN if none of them could be followed.
    energy_drift : float
        Largest violation of the energy balance H(t) - H(t0) = work done since t0, at element
        boundaries, along the solution, in units of the largest |v . p|. The work is zero and
        H is conserved unless time or forces enter. Not asked where velocities may jump; for a
        system at rest the unit is that of a velocity of |q| over the duration.
    reference_error : float
        Uncertainty of the forward integration: how far `path` is, in position, from an
        integration with ten times its tolerance and other steps.
    allowed : float
        The deviation that is compatible with the solution's own estimate of its error.
    amplified : float
        What a relative change of the start's velocity by `allowed` makes of the position on the
        way; zero where `position` is allowed anyway.
    path : Path or None
        The forward integration, velocities included: over the whole time, or as far as the motion
        could be followed; None if not at all.
    reason : str
        Why it cannot be told whether the solution is a motion; empty where it can.
    """

    position: float
    velocity: float
    arrival: float
    local: float
    energy_drift: float
    reference_error: float
    allowed: float
    amplified: float
    path: Path | None
    reason: str = ""

    def __repr__(self) -> str:
        """Show the verdict, and what it depends on."""
        verdict = {True: "agrees", False: "differs", None: "unknown"}[self.agrees]
        drifts = f", energy drifts by {self.energy_drift:.1e}" if self._is_unbalanced else ""
        return (
            f"Comparison({verdict}: position {self.position:.1e} of {self.allowed:.1e} allowed, "
            f"velocity {self.velocity:.1e}, piece by piece {self.local:.1e}{drifts})"
        )

    @property
    def agrees(self) -> bool | None:
        """Whether the solution is a motion: as a whole, or piece by piece, and the whole explained.

        It is explained where the motion amplifies a change that is allowed to what is found, or
        to so much that the whole tells nothing, or that its integration is as uncertain. None if
        nothing contradicts the solution, but the motion cannot be followed: `reason` says why.

        No motion is what the energy drifts along by more than deviations explain, and by a
        thousandth: it crosses a jump of L, which forces do not show.
        """
        if self.reason:
            return None
        near = self.position <= self.allowed
        near = near or (self.local <= self.allowed and self._is_explained)
        return near and not self._is_unbalanced

    @property
    def _is_unbalanced(self) -> bool:
        """Whether the energy drifts by more than velocities and positions explain, twice as a rule.

        Where nothing was integrated, neither is known.
        """
        explained = EXPLAINED * max(self.position, self.velocity)
        return self.energy_drift > max(explained, UNBALANCED)

    @property
    def _is_explained(self) -> bool:
        """Whether a deviation of the whole says nothing."""
        explained = max(self.amplified, self.reference_error)
        return explained >= CERTAIN or self.position <= EXPLAINED * explained


class Claim(Protocol):
    """A path that is said to be a motion, such as a solution, to be judged."""

    @property
    def problem(self) -> Problem: ...  # noqa: D102
    @property
    def mesh(self) -> Mesh: ...  # noqa: D102
    @property
    def start(self) -> State: ...  # noqa: D102
    @property
    def error(self) -> float: ...  # noqa: D102
    def __call__(self, t: ArrayLike) -> Array: ...  # noqa: D102
    def velocity(self, t: ArrayLike) -> Array: ...  # noqa: D102


OF_NO_MOTION = dict.fromkeys(
    ("position", "velocity", "arrival", "energy_drift", "reference_error", "amplified"), np.nan
)


def compare(solution: Claim, *, tol: float = 1e-12, count: int | None = None) -> Comparison:
    """Compare a solution with forward integrations from its own states.

    The integration begins anew where the lengths of the solution's elements change much, and
    where the Lagrangian jumps in time: so it passes kinks, and steps over nothing that the
    solution has resolved.

    Parameters
    ----------
    solution : Solution, or whatever says as much of itself
        The path to be judged.
    tol : float
        Of the forward integration; see `integrate`.
    count : int, optional
        Of the coordinates only so many are compared, the first ones; the others are followed.

    Returns
    -------
    Comparison
        Where the motion from the solution's start cannot be followed to the end event, as at a
        collision, the pieces decide; if none of them contradicts the solution, its `agrees` is
        None.

    Raises
    ------
    ValueError
        If the tolerance is not between 1e-14 and 0.1.
    """
    tolerance(tol)
    out = _ends_without_motion(solution)
    if any(out):
        solution = _Inside.of(solution, out)
    problem, start, mesh = solution.problem, solution.start, solution.mesh
    span = problem.duration
    flow = FlowAbout(problem.system, problem.parameters, solution)
    motion, rows = _follow_whole(flow, solution, tol)
    t = (mesh if isinstance(motion, IntegrationError) else motion.path.mesh).nodes
    q, v = solution(t), solution.velocity(t)
    units = _units(q, v, rows, span)
    sizes = units.q[:count]
    allowed = _largest_deviation(solution, tol)
    instants = jumps(flow.system, flow.parameters, t, q, v)
    even = np.searchsorted(t, np.linspace(t[0], t[-1], EVEN))
    noise = flow.round_off(q[:, even], v[:, even], t[even])
    piece_tol = max(PIECE_SHARE * allowed, PIECE_TOL)
    accuracy = units.above(noise, span * CVODES_LONGEST, piece_tol)
    parts = _Parts.of(solution, flow, instants, accuracy)
    local, unknown = _piece_by_piece(solution, parts, units, allowed, count)
    if isinstance(motion, IntegrationError):
        path = _as_far(flow, start, mesh, motion.t)
        found = Comparison(**OF_NO_MOTION, local=local, allowed=allowed, path=path)
        return found if local > allowed else replace(found, reason=str(motion) + UNTOLD)
    path, smooth = motion.path, parts.smooth(t)
    assert path.velocities is not None
    position = _deviation(q, path(t), sizes)  # at t as it is rounded
    velocity = _deviation(v, path.velocities, units.v[:count])

    def again(run: ForwardMotion, state: State, looser: float, shorter: float) -> float:
        """Return the largest deviation of another integration from the first."""
        try:
            other = run.again(state, looser, shorter)
        except IntegrationError:  # so near a singularity that nothing is certain
            return np.inf
        return float(_deviation(other, motion.q, sizes).max())

    changed = position.max() > allowed
    # The other integration begins with this one's motion, whichever way it goes itself.
    about = replace(motion, flow=FlowAbout(problem.system, problem.parameters, path))
    # What leaves the path sooner yet is nowhere near a curve that is known.
    beside = replace(motion, flow=Flow(problem.system, problem.parameters))
    disturbed = _perturb(problem, start, units, allowed) if changed else start
    rougher = max(CHANGE_SHARE * allowed / max(leg.local for leg in motion.legs), 1.0)
    found = Comparison(
        position=float(position.max()),
        velocity=float(velocity[smooth].max(initial=0.0)),
        arrival=float(position[-1]),
        local=local,
        energy_drift=_energy_drift(problem, path, q, v, smooth, units.v),
        reference_error=again(about, start, LOOSER_TOL, SHORTER_STEPS),
        allowed=allowed,
        amplified=again(beside, disturbed, rougher, 1.0) if changed else 0.0,
        path=path,
    )
    doubted = local > allowed or found._is_unbalanced
    if unknown and not found.agrees and not doubted and found._is_explained:
        return replace(found, reason=unknown + UNTOLD)
    return found


def is_motion(solution: Claim) -> bool | None:
    """Return what `agrees` of the comparison is, and make that only where one run does not tell.

    A run of CVODES that stays on the solution, whose energy is balanced, is all that `agrees`
    asks for. It takes a tenth of the time of a comparison, which also tells how uncertain it is.
    """
    return _confirms(solution) or compare(solution).agrees


def _confirms(solution: Claim) -> bool:
    """Whether one integration from the start stays on the solution, and its energy is balanced."""
    problem, start, mesh = solution.problem, solution.start, solution.mesh
    if any(mesh.singular_ends) or min(mesh.degrees) == 1:
        return False
    span, allowed = span_within(start.t, problem.end.t), _largest_deviation(solution, 1e-12)
    t = mesh.nodes
    q, v = solution(t), solution.velocity(t)
    flow = Flow(problem.system, problem.parameters)
    local, longest = max(RUN_SHARE * allowed, PIECE_TOL), longest_step(mesh.boundaries)
    try:
        units = _units(q, v, flow.equilibrate(start), span)
        run = flow.integrator((t[1:] - t[0]) / (t[-1] - t[0]), local, longest)
        there, _ = run(start, span, units)
    except (IntegrationError, ValueError):
        return False
    position = _deviation(q[:, 1:], there, units.q).max()
    if not position <= allowed:
        return False
    smooth = np.ones(t.size, dtype=bool)
    drift = _energy_drift(problem, Path(mesh, q, v), q, v, smooth, units.v)
    return drift <= max(EXPLAINED * position, UNBALANCED)


def _largest_deviation(solution: Claim, tol: float) -> float:
    """Return the deviation that the estimated error of a solution is compatible with."""
    return min(ERROR_MARGIN * max(solution.error, tol), CERTAIN)


def _follow_whole(
    flow: Flow, solution: Claim, tol: float
) -> tuple[ForwardMotion | IntegrationError, Array]:
    """Return the motion from the start to the end, or why and from where on there is none.

    And the units of its equations, (n + m,).
    """
    start, end, mesh = solution.start, solution.problem.end.t, solution.mesh
    try:
        motion = follow(flow, start, end, tol=tol, mesh=mesh, kinks=True)
        return motion, motion.legs[-1].units.rows
    except IntegrationError as error:
        begun = start
        if begins_singular(flow, start, end):  # the mass vanishes there
            t = float(mesh.boundaries[1])
            begun = State(t, solution(t), solution.velocity(t))
        return error, flow.first_units(begun, solution.problem.duration).rows
    except ValueError as error:  # the constraints do not allow it, or no acceleration is finite
        failure = IntegrationError(f"the motion cannot be begun: {error}", start.t)
        return failure, np.ones(flow.system.n + flow.system.m)


def _ends_without_motion(solution: Claim) -> tuple[bool, bool]:
    """Return at which ends no motion is begun: where L is infinite, or it is not the only one.

    Of the motions that leave a place at which the mass vanishes each has another coordinate there.
    """
    problem, start = solution.problem, solution.start
    begins, ends = (bool(end) for end in solution.mesh.singular_ends)
    if not begins and len(problem.start.pinned) == problem.system.n:
        flow = Flow(problem.system, problem.parameters)
        begins = begins_singular(flow, start, problem.end.t)
    return begins, ends


@dataclass(frozen=True)
class _Inside:
    """A path but for half an element at ends where no motion is begun."""

    whole: Claim
    problem: Problem
    start: State
    mesh: Mesh

    @classmethod
    def of(cls, whole: Claim, out: tuple[bool, bool]) -> _Inside:
        """Return the claim of a solution but for half an element at each end that is `out`."""
        mesh, b = whole.mesh, whole.mesh.boundaries.copy()
        for end, beside in ((0, 1), (-1, -2)):
            if out[end]:
                b[end] = (b[end] + b[beside]) / 2
        t, (q0, q1) = b[[0, -1]], whole(b[[0, -1]]).T
        system = whole.problem.system
        given = {k: x for k, x in whole.problem.parameters.items() if k in system.table.shapes}
        problem = Problem(system, Event(t[0], q0), Event(t[1], q1), parameters=given)
        return cls(whole, problem, State(t[0], q0, whole.velocity(t[0])), Mesh(b, mesh.degrees))

    @property
    def error(self) -> float:
        """That of the whole path."""
        return self.whole.error

    def __call__(self, t: ArrayLike) -> Array:
        """Return the coordinates at times t."""
        return self.whole(t)

    def velocity(self, t: ArrayLike) -> Array:
        """Return the velocities at times t."""
        return self.whole.velocity(t)


def join(legs: Sequence[Comparison], missed: float) -> Comparison:
    """Return the comparison of a path through events: of each leg from its own start, the worst.

    And how far the next leg would be `missed`, in the unit of positions, if it left the event as a
    motion that is reflected or refracted there does.
    """
    numbers = {
        name: float(np.max([getattr(leg, name) for leg in legs]))
        for name in (
            *("position", "velocity", "arrival", "local", "energy_drift"),
            *("reference_error", "allowed", "amplified"),
        )
    }
    numbers |= {name: max(numbers[name], missed) for name in ("position", "local")}
    paths = [leg.path for leg in legs if leg.path is not None]
    reason = next((leg.reason for leg in legs if leg.reason), "")
    return Comparison(**numbers, path=_join_paths(paths), reason=reason)


def _join_paths(paths: Sequence[Path]) -> Path | None:
    """Return motions that follow one another in one path, up to where the first one ends early."""
    if not paths:
        return None
    kept = [paths[0]]
    for path in paths[1:]:
        if path.mesh.boundaries[0] != kept[-1].mesh.boundaries[-1]:
            break
        kept.append(path)
    boundaries = np.concatenate(
        [kept[0].mesh.boundaries, *(p.mesh.boundaries[1:] for p in kept[1:])]
    )
    degrees = np.concatenate([p.mesh.degrees for p in kept])
    values = [kept[0].values, *(p.values[:, 1:] for p in kept[1:])]
    rates = [
        p.velocities if k == 0 else p.velocities[:, 1:]
        for k, p in enumerate(kept)
        if p.velocities is not None
    ]
    velocities = np.concatenate(rates, axis=1) if len(rates) == len(kept) else None
    return Path(Mesh(boundaries, degrees), np.concatenate(values, axis=1), velocities=velocities)


def _units(q: Array, v: Array, rows: Array, span: float) -> FlowUnits:
    """Return the sizes of q and v (n, K), for a system at rest those of q over the duration."""
    units = FlowUnits.of(q, v, rows)
    slow = units.q / span
    return FlowUnits(units.q, slow, rows) if _at_rest(v, slow) else units


def _at_rest(v: Array, speeds: Array) -> bool:
    """Return whether velocities (n, K) are round-off beside the speeds (n,)."""
    return bool(np.all(np.abs(v) <= ZERO_SIZE * speeds[:, None]))


def _as_far(flow: Flow, start: State, mesh: Mesh, last: float) -> Path | None:
    """Return the motion nearly to the time `last`, beyond which it cannot be followed."""
    for part in NEARLY:
        end = start.t + part * (last - start.t)
        inner = mesh.boundaries[mesh.boundaries < end]
        with suppress(IntegrationError, ValueError):
            until = Mesh([*inner, end], mesh.degrees[: inner.size])
            return follow(flow, start, end, tol=DRAWN_TOL, mesh=until, kinks=True).path
    return None


def _deviation(values: Array, others: Array, size: Array) -> Array:
    """Return the largest difference of a row in units of its size, at each of K times, (K,).

    If there are fewer sizes than rows, the first rows are compared.
    """
    apart = np.abs(values[: size.size] - others[: size.size])
    return np.max(apart / size[:, None], axis=0)


def _perturb(problem: Problem, state: State, units: FlowUnits, part: float) -> State:
    """Return the state with the velocity changed by `part` of its size, as constraints allow.

    The coordinates are changed instead where the mass vanishes: they alone are free there.
    """
    flow = Flow(problem.system, problem.parameters)
    if begins_singular(flow, state, problem.end.t):
        return State(
            state.t, state.q + part * units.q * np.cos(1.0 + np.arange(state.q.size)), state.v
        )
    ones = np.ones(state.q.size)
    basis = tangent(problem, state.q[None], np.array([[state.t]]), ones)[0]
    # In no special direction: those of symmetry may be the stable ones.
    change = part * units.v * np.cos(1.0 + np.arange(state.q.size))
    return State(state.t, state.q, state.v + basis @ (basis.T @ change))


@immutable
class _Parts:
    """Motions over parts of the time, which stop where those over the whole do."""

    flow: FlowAbout
    mesh: Mesh  # of the solution
    # (N,): elements in which velocities may jump, so that those of the solution mean nothing
    kinked: Array
    stops: list[Instant]  # where the integration begins anew
    # (K + 1,): where motions begin and end, in the middle of elements: velocities are best there
    times: Array
    units: FlowUnits  # of the integration, as the tolerance
    tolerance: float

    @classmethod
    def of(
        cls,
        solution: Claim,
        flow: FlowAbout,
        instants: list[Instant],
        accuracy: tuple[FlowUnits, float],
    ) -> _Parts:
        """Return the parts of a solution, with units and tolerance for them."""
        mesh, span = solution.mesh, solution.problem.duration
        b = mesh.boundaries
        kinked = mesh.lengths < min(NARROWEST_PART, 1 / (LENGTH_RATIO * mesh.elements)) * span
        for before, after in instants:
            kinked |= (b[:-1] < after) & (b[1:] > before)
        groups = b[
            np.linspace(0, mesh.elements, min(mesh.elements, PIECES) + 1).round().astype(int)
        ]
        parts = cls(flow, mesh, kinked, restarts(mesh, instants), b[[0, -1]], *accuracy)
        middles = (groups[:-1] + groups[1:]) / 2
        smooth, times = parts.smooth(middles), [b[-1]]
        # From a short element to a long one the error of the velocity has much time to grow.
        for k in range(middles.size)[::-1]:
            if smooth[k] and times[-1] - middles[k] <= LENGTH_RATIO * (groups[k + 1] - groups[k]):
                times.append(middles[k])
        return replace(parts, times=np.array([*times, b[0]])[::-1])

    def smooth(self, t: Array) -> Array:
        """Return whether the solution's velocities mean something at the times t (K,)."""
        at = np.searchsorted(self.mesh.boundaries, t, side="right") - 1
        return ~self.kinked[np.clip(at, 0, self.kinked.size - 1)]

    def cut(self, start: float, end: float) -> float | None:
        """Return a time between the two at which a motion can begin, None if there is none."""
        t = start + KINK_CUT * (end - start)
        if not self.smooth(np.array([t]))[0]:
            b = self.mesh.boundaries
            later = np.flatnonzero(~self.kinked & (b[:-1] > t))
            t = (b[later[0]] + b[later[0] + 1]) / 2 if later.size else end
        return float(t) if t < end else None

    def follow(self, state: State, end: float) -> tuple[Array, Array]:
        """Return times (K,) on the way to the end, and q (n, K) there."""
        inside = [stop for stop in self.stops if state.t <= stop[0] and stop[1] < end]
        if not inside:
            return self._run(self._through, state, end, end - state.t)[:2]
        times, tables, whole = [], [], end - state.t
        for before, after in [*inside, (end, end)]:
            if before > state.t:
                t, q, state = self._run(self._stopping, state, before, whole)
                times.append(t)
                tables.append(q)
            state = begin_leg(self.flow, state, after)
        return np.concatenate(times), np.concatenate(tables, axis=1)

    def several(self, states: list[State], ends: list[float]) -> list[tuple[Array, Array] | None]:
        """Return times and q (n, K) of many motions; None for one that has to stop on its way."""
        through = [
            not any(state.t <= stop[0] and stop[1] < end for stop in self.stops)
            for state, end in zip(states, ends, strict=True)
        ]
        asked = [(state, end) for state, end, one in zip(states, ends, through, strict=True) if one]
        found = iter(self.flow.several(asked, self.units, self.tolerance, QUARTERS, self._longest))
        return [next(found) if one else None for one in through]

    def _run(
        self, run: PicardIntegrator, state: State, end: float, whole: float
    ) -> tuple[Array, Array, State]:
        """Return times (4,), q (n, 4) there and the state at the end, of a part of `whole`."""
        span = span_within(state.t, end)
        q, v = run(state, span, self.units, BAUMGARTE_RATE * span / whole)
        t = state.t + QUARTERS * span
        q += v * (t - state.t - QUARTERS * span)  # from the times meant to those there are
        return t, q, State(end, q[:, -1], v[:, -1])

    @cached_property
    def _through(self) -> PicardIntegrator:
        return self.flow.integrator(QUARTERS, self.tolerance, self._longest)

    @property
    def _longest(self) -> float:
        return min(CVODES_LONGEST * min(self.mesh.elements, PIECES), QUARTERS[0])

    @cached_property
    def _stopping(self) -> PicardIntegrator:
        return self.flow.integrator(QUARTERS, self.tolerance, CVODES_LONGEST)


def _piece_by_piece(
    solution: Claim, parts: _Parts, units: FlowUnits, allowed: float, count: int | None
) -> tuple[float, str]:
    """Return the largest deviation of motions from the middle of a piece to that of the next.

    And why not all of them could be followed.
    """
    times, cuts, unknown, sizes = parts.times, 0, "", units.q[:count]
    q, v = solution(times[:-1]).T, solution.velocity(times[:-1]).T
    states = [
        solution.start,
        *(State(*x) for x in zip(times[1:-1].tolist(), q[1:], v[1:], strict=False)),
    ]
    ends = times[1:].tolist()
    motions = parts.several(states, ends)
    pieces = list(zip(states, ends, motions, strict=True))
    first, known = np.full(len(pieces), np.inf), [x for x in motions if x is not None]
    if known:
        t, there = (np.concatenate(x, axis=-1) for x in zip(*known, strict=True))
        apart = _deviation(solution(t), there, sizes).reshape(len(known), -1)
        first[[x is not None for x in motions]] = apart.max(axis=1)
    near = first <= allowed
    worst = float(np.fmax.reduce(first[near], initial=np.nan))
    pieces = [piece for piece, good in zip(pieces, near, strict=True) if not good]
    while pieces:
        state, end, known = pieces.pop()
        try:
            t, there = known or parts.follow(state, end)
            found = _deviation(solution(t), there, sizes).max()
            if found > allowed:
                changed = _perturb(solution.problem, state, units, allowed)
                _, other = parts.follow(changed, end)
                gain = _deviation(other, there, sizes).max() / allowed
                cut = parts.cut(state.t, end) if gain > UNSTABLE and cuts < MOST_CUTS else None
                if cut is not None:
                    cuts += 1
                    middle = State(cut, solution(cut), solution.velocity(cut))
                    pieces += [(state, cut, None), (middle, end, None)]
                    continue
                found /= max(1.0, gain / EXPLAINED)
        except IntegrationError as error:
            unknown = str(error)
            continue
        worst = float(np.fmax(worst, found))
    return worst, unknown


def _energy_drift(
    problem: Problem, path: Path, q: Array, v: Array, smooth: Array, speeds: Array
) -> float:
    """Return the largest violation of H(t) - H(t0) = work, at the path's element boundaries.

    The work is the integral of dH/dt = -L_t + Q . v - lam . f_t: the Lagrangian's own change,
    non-conservative forces, and constraints that move. Where L jumps, H of the motion does. It is
    not asked at nodes that are not `smooth` (K,), where the velocities v mean nothing. Its unit is
    the largest |v . p|, or at rest that of motions with the `speeds` (n,).
    """
    system, parameters, mesh = problem.system, problem.parameters, path.mesh
    t, ends = mesh.nodes, mesh.offsets
    gained = system.energy(q[:, ends], v[:, ends], t[ends], parameters=parameters)
    if system.structure.depends_on_time or system.structure.forced:
        lam = np.zeros((0, t.size))
        if system.m:
            lam = system.multipliers(q, v, t, parameters=parameters)
        power_at = _power(system)
        # Each element on its own side of the instants at which L switches.
        bounds = sides(mesh, problem.instants) if problem.instants else None
        work = np.empty(mesh.elements)
        for g in mesh.groups:
            k, times = g.nodes.ravel(), t[g.nodes]
            if bounds is not None:
                times = np.clip(times, *(side[g.elements, None] for side in bounds))
            power = power_at(q.T[k], v.T[k], times.reshape(-1, 1), problem.packed, lam.T[k])[0]
            power = power.reshape(g.nodes.shape) @ g.rule.weights
            work[g.elements] = mesh.lengths[g.elements] / 2 * power
        jumped = np.flatnonzero(np.array(mesh.degrees) == 1)
        if jumped.size:
            assert path.velocities is not None
            a, b = (
                system.energy(path.values[:, k], path.velocities[:, k], t[k], parameters=parameters)
                for k in (ends[jumped], ends[jumped + 1])
            )
            work[jumped] = b - a
        gained[1:] -= np.cumsum(work)
    if _at_rest(v, speeds):
        v = np.broadcast_to(speeds[:, None], v.shape)
    kinetic = np.sum(v * system.momentum(q, v, t, parameters=parameters), axis=0)
    size = float(np.max(np.abs(kinetic)))
    gained = gained[smooth[ends]]
    drift = float(np.max(np.abs(gained - gained[0]))) if gained.size else 0.0
    return drift / (size if size > 0 else 1.0)


@keep
def _power(system: System) -> Pointwise:
    """Return the function of dH/dt by the equations of motion; the multipliers come last."""
    sym = system.symbols
    lam = ca.SX.sym("lam", system.m)
    power = -ca.jacobian(system.L, sym.t) - ca.dot(lam, ca.jacobian(system.f, sym.t))
    if system.structure.forced:
        power += ca.dot(system.Q, sym.v)
    arguments = [sym.q, sym.v, sym.t, sym.p, lam]
    return Pointwise(ca.Function("power", arguments, [ca.densify(power)]))
