"""Forward integration of the equations of motion.

This is the other way to a path: it knows nothing of the action, only of the Euler-Lagrange
equations (`flow`), and so it can contradict a solution.
"""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import replace
from functools import cached_property
from itertools import pairwise

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
from actionopt.analysis.motion.series import begin, begins_singular
from actionopt.discrete.meshes.mesh import Mesh
from actionopt.discrete.meshes.path import Path
from actionopt.mechanics.laws.instants import Instant
from actionopt.mechanics.question.events import State
from actionopt.mechanics.question.jumps import across, jumps
from actionopt.mechanics.question.surface import SURFACE_TOLERANCE
from actionopt.mechanics.system import System, check_system
from actionopt.tools.checks import number, tolerance
from actionopt.tools.immutable import immutable
from actionopt.tools.types import EPS, Array, NDInt

# Ad hoc, where nothing else is said.
MOTION_DEGREE = 12  # of the elements of the path
MOTION_ROUNDS = 12  # of splitting elements, or of finding units, before giving up
REFINED_BY = 8.0  # times finer than predicted: a round costs more than some elements
MAX_NUMBERS = 30_000_000  # coordinates and velocities at all nodes: 240 MB, a few copies of which
NARROWEST_PART = 1e-4  # of a leg: no element given asks for steps shorter than that
LENGTH_RATIO = 64.0  # the longest element of a leg to its shortest: as many steps cost little
DISTINCT_TIMES = 64  # times that can be told apart, in an element that is split: some for each node
LOCAL_SHARE = 1e-3  # of tol: CVODES bounds the error of one step; some hundred of them add up
FINEST_LOCAL = 5e-16  # below this local tolerance CVODES gains nothing: two eps
SIZE_SAMPLES = 65  # along the motion, to find the sizes
SERIES_TAIL = 1e-15  # coefficients left out of a power series, relative to q
ROUND_OFF_SPEED = 1e-6  # of the size of q over the duration: a velocity that is round-off


def integrate(
    system: System,
    state: State,
    t_end: float,
    *,
    tol: float = 1e-12,
    parameters: Mapping[str, ArrayLike] | None = None,
    mesh: Mesh | None = None,
) -> Path:
    """Integrate the Euler-Lagrange equations from `state` to `t_end`, forwards or backwards.

    Parameters
    ----------
    system : System
        The physics, constraints and forces included.
    state : State
        Time, coordinates and velocities to begin with.
    t_end : float
        Where to end; before `state.t`, the motion is followed backwards.
    tol : float
        What the path resolves, from 1e-14 to 0.1, in units of the size of each coordinate along
        the path, and of each velocity. CVODES is asked for a thousandth of it a step, so that
        this is also the order of the error of motions that do not amplify errors; 1e-13 is
        the least that is of use.
    parameters : mapping, optional
        Overrides the system's defaults by name; nothing is derived again.
    mesh : Mesh, optional
        Elements to begin with, over the same times; those that do not resolve the motion
        are split, and CVODES takes no step over one of them: where their lengths change much it
        begins anew. By default chosen from the number of steps that CVODES takes, of which there
        are two hundred at least: a force that acts for a thousandth of the time is noticed, one
        for much less may not be.

    Returns
    -------
    Path
        With the velocities stored. Where the Lagrangian jumps in time the momentum is continuous,
        and the velocity jumps within an element between neighbouring times. Accelerations are not
        asked for more than the round-off of q, v and t allows: far from t = 0, time in the
        Lagrangian makes the motion less certain.

    Raises
    ------
    ValueError
        If an argument does not fit, the state lies off the constraint surface or moves off it,
        or the equations of motion cannot be solved for the accelerations.
    IntegrationError
        If the motion cannot be followed to `t_end`.

    References
    ----------
    Hindmarsh et al., *SUNDIALS*, ACM Transactions on Mathematical Software 31 (2005) 363-396:
    variable-order Adams methods.

    Examples
    --------
    >>> fall = System(lambda q, v, t: v[0] ** 2 / 2 - q[0], ["z"])
    >>> path = integrate(fall, State(0.0, [1.0], [0.0]), 1.0)
    >>> bool(abs(path(1.0)[0] - 0.5) < 1e-12)
    True
    """
    if isinstance(system, System):  # else it is told what was expected
        system.check_order("a motion from initial values")
        system.check_free("forward integration does not know contact")
    return follow(Flow(system, parameters), state, t_end, tol=tol, mesh=mesh).path


@immutable
class Leg:
    """A part of a motion that is integrated without a stop."""

    times: Array  # (N + 1,): boundaries of elements in the order of integration, all up or all down
    degrees: NDInt  # (N,)
    units: FlowUnits
    local: float  # what it is integrated in, and the tolerance of a step
    longest: float  # a part of it that no step exceeds
    # Whether it is one element that begins where the mass vanishes, a power series (`series`).
    singular: bool = False

    @property
    def mesh(self) -> Mesh:
        """The elements in scaled times, from 0 to 1."""
        return Mesh((self.times - self.times[0]) / (self.times[-1] - self.times[0]), self.degrees)

    @property
    def span(self) -> float:
        """The time from start to end, negative if backwards."""
        return span_within(self.times[0], self.times[-1])

    def split(self, pieces: NDInt) -> Leg:
        """Return the leg with element e cut into pieces[e] equal ones of the same degree."""
        t = self.times
        parts = [np.linspace(t[e], t[e + 1], k, endpoint=False) for e, k in enumerate(pieces)]
        times = np.concatenate([*parts, t[-1:]])
        return replace(self, times=times, degrees=np.repeat(self.degrees, pieces))


@immutable
class ForwardMotion:
    """A motion followed leg by leg."""

    flow: Flow
    state: State  # its beginning
    t_end: float
    legs: tuple[Leg, ...]
    # (n, K): coordinates at the nodes of the legs, one after the other, two where they meet
    q: Array
    v: Array  # (n, K): velocities there

    def again(self, state: State, looser: float = 1.0, shorter: float = 1.0) -> Array:
        """Return q (n, K) at the same nodes from another state, tolerance and longest step."""
        tables, duration = [], abs(self.t_end - self.state.t)
        for leg in self.legs:
            other = replace(leg, local=looser * leg.local, longest=shorter * leg.longest)
            q, v = _run(self.flow, state, other, duration)
            tables.append(q)
            state = State(leg.times[-1], q[:, -1], v[:, -1])
        return np.concatenate(tables, axis=1)

    @cached_property
    def path(self) -> Path:
        """The motion as a path; over the instant of a jump its velocity is a straight line."""
        times, degrees, columns, first = [], [], [], 0
        for leg in self.legs:
            meets = int(len(times) > 0 and times[-1] == leg.times[0])
            if times and not meets:
                degrees.append(1)
            times += leg.times[meets:].tolist()
            degrees += list(leg.degrees)
            count = first + leg.mesh.nodes.size
            columns += range(first + meets, count)
            first = count
        times[0], times[-1] = self.state.t, self.t_end  # what jumps there is beyond the ends
        order = slice(None, None, 1 if self.t_end > self.state.t else -1)
        q, v = self.q[:, columns][:, order], self.v[:, columns][:, order]
        return Path(Mesh(times[order], degrees[order]), q, v)


def follow(
    flow: Flow,
    state: State,
    t_end: float,
    *,
    tol: float,
    mesh: Mesh | None = None,
    kinks: bool = False,
) -> ForwardMotion:
    """Return the motion from `state` to `t_end`: what `integrate` says, and what it raises.

    The integration begins anew after each jump of the Lagrangian in time, and where the lengths
    of the elements of the mesh change much, so that steps are as short as they are there, and
    not elsewhere. With `kinks`, coordinates alone are resolved in elements shorter than
    `NARROWEST_PART` of the duration: velocities may have a kink there.
    """
    span = _check(flow.system, state, t_end, tol)
    if begins_singular(flow, state, t_end):
        return _from_singular(flow, state, t_end, tol, mesh, kinks)
    units = flow.first_units(state, span)
    _check_on_surface(flow, state, span)
    first, last = sorted([state.t, t_end])
    elements = (
        Mesh.uniform(first, last, 1, MOTION_DEGREE)
        if mesh is None
        else _mesh_over(mesh, first, last)
    )
    local = max(LOCAL_SHARE * tol, FINEST_LOCAL)
    seen = _look_ahead(flow, state, _legs(elements, [], span < 0), units, flow.rough(local))
    if mesh is None:
        elements = Mesh.uniform(first, last, max(4, seen.steps // MOTION_DEGREE), MOTION_DEGREE)
    legs, tables, at = [], [], state
    resolve = _Resolve(flow, seen, tol, abs(span), kinks)
    for times, degrees in _legs(elements, seen.instants, span < 0):
        leg, q, v = resolve(at, times, degrees)
        at = State(leg.times[-1], q[:, -1], v[:, -1])
        legs.append(leg)
        tables.append((q, v))
    q, v = np.concatenate(tables, axis=2)
    return ForwardMotion(flow, state, t_end, tuple(legs), q, v)


def _from_singular(
    flow: Flow, state: State, t_end: float, tol: float, mesh: Mesh | None, kinks: bool
) -> ForwardMotion:
    """Return a motion that begins where the mass vanishes: a power series, then as all others."""
    span = t_end - state.t
    goal = max(LOCAL_SHARE * tol, SERIES_TAIL)
    elements = None if mesh is None else _mesh_over(mesh, *sorted([state.t, t_end]))
    h = span / 4 if elements is None else elements.lengths[0 if span > 0 else -1] * np.sign(span)
    for _ in range(MOTION_ROUNDS):
        times, degrees = np.array([state.t, state.t + h]), np.array([MOTION_DEGREE])
        with suppress(IntegrationError):
            q, v = begin(flow, state, times[1], MOTION_DEGREE)
            size = np.abs(q).max() or 1.0
            if _tails(Mesh([0.0, 1.0], degrees), q / size)[0] <= goal:
                break
        h /= 2
    else:
        raise IntegrationError(
            f"the motion from the singular point t = {state.t:.6g} on, where the mass matrix "
            "vanishes, is no power series there; begin a little beside it",
            state.t,
        )
    if np.abs(state.v - v[:, 0]).max() * abs(span) > ROUND_OFF_SPEED * size:
        raise ValueError(
            f"expected the velocity {v[:, 0]} at t = {state.t:.6g}, where the mass matrix vanishes "
            f"and the equations of motion decide it, found {state.v}"
        )
    later = None
    if elements is not None:
        b = elements.boundaries
        inner = b[b > times[1]] if span > 0 else b[b < times[1]]
        degrees_later = (
            elements.degrees[-inner.size :] if span > 0 else elements.degrees[: inner.size]
        )
        both = [times[1], *inner] if span > 0 else [*inner, times[1]]
        later = Mesh(both, degrees_later)
    rest = follow(
        flow, State(times[1], q[:, -1], v[:, -1]), t_end, tol=tol, mesh=later, kinks=kinks
    )
    first = Leg(times, degrees, rest.legs[0].units, goal, 1.0, singular=True)
    tables = [np.concatenate([a, b], axis=1) for a, b in ((q, rest.q), (v, rest.v))]
    return ForwardMotion(flow, state, t_end, (first, *rest.legs), tables[0], tables[1])


def restarts(mesh: Mesh, instants: list[Instant]) -> list[Instant]:
    """Return the last time of each leg but the last, and the first time of the next.

    And so for a jump at the first of all.
    """
    legs = [times.tolist() for times, _ in _legs(mesh, instants, False)]
    ends = [float(mesh.boundaries[0]), *(times[-1] for times in legs)]
    stops = [(end, times[0]) for end, times in zip(ends, legs, strict=False)]
    return stops if stops[0][0] != stops[0][1] else stops[1:]


@immutable
class _Rough:
    """The units and the sizes of a motion that rough integrations tell."""

    units: FlowUnits
    steps: int  # their number
    ends: Array  # (N,): last times of the legs
    noises: list[Array]  # (n,): the round-off of the accelerations in each leg
    lengths: list[float]  # how long the steps of each leg are
    # Where the Lagrangian jumps in time; the rough integrations do not heed it.
    instants: list[Instant]

    def within(self, t: float, local: float) -> tuple[FlowUnits, float]:
        """Return the units and the tolerance of a step at the time t."""
        later = self.ends >= t if self.ends[-1] >= self.ends[0] else self.ends <= t
        k = int(np.argmax(later))
        return self.units.above(self.noises[k], self.lengths[k], local)


def _look_ahead(
    flow: Flow, state: State, legs: list[tuple[Array, NDInt]], units: FlowUnits, local: float
) -> _Rough:
    """Integrate to a local tolerance, leg by leg, until the units are those of the motion."""
    s = np.linspace(0.0, 1.0, SIZE_SAMPLES)
    spans = [span_within(times[0], times[-1]) for times, _ in legs]
    runs = [flow.integrator(s[1:], local, longest_step(times)) for times, _ in legs]
    places = [
        np.append(times[0] + s[:-1] * span, times[-1])
        for (times, _), span in zip(legs, spans, strict=True)
    ]
    if np.all(
        units.v * abs(sum(spans)) <= ZERO_SIZE * units.q
    ):  # at rest, and nothing else is known
        noise = flow.round_off(state.q[:, None], state.v[:, None], places[0][:1])
        units, _ = units.above(noise, abs(spans[0]) * CVODES_LONGEST, local)
    own, tables, noises, lengths = units, [], [], []
    for _ in range(MOTION_ROUNDS):
        last, at, tables, noises, lengths = units, state, [], [], []
        for run, span, t in zip(runs, spans, places, strict=True):
            q, v = run(at, span, units)
            q, v = np.column_stack([at.q, q]), np.column_stack([at.v, v])
            at = State(t[-1], q[:, -1], v[:, -1])
            tables.append((q, v))
            noises.append(flow.round_off(q, v, t))
            lengths.append(abs(span) / max(run.steps, 1))
        q, v = np.concatenate(tables, axis=2)
        own = units = FlowUnits.of(q, v, units.rows)
        for noise, step in zip(noises, lengths, strict=True):
            units, _ = units.above(noise, step, local)
        if units.agree(last):
            break
    instants = []
    for (q, v), t in zip(tables, places, strict=True):
        order = slice(None, None, 1 if t[-1] > t[0] else -1)
        instants += jumps(flow.system, flow.parameters, t[order], q[:, order], v[:, order])
    steps = sum(run.steps for run in runs)
    ends = np.array([times[-1] for times, _ in legs])
    return _Rough(own, steps, ends, noises, lengths, sorted(instants))


def longest_step(times: Array) -> float:
    """Return a part of a leg that passes over none of its elements."""
    lengths = np.abs(np.diff(times))
    return float(min(max(lengths.min() / lengths.sum(), NARROWEST_PART), CVODES_LONGEST))


def _legs(mesh: Mesh, instants: list[Instant], backwards: bool) -> list[tuple[Array, NDInt]]:
    """Return boundaries (N + 1,) and degrees (N,) of legs in the order of integration.

    Their elements are of at least `MOTION_DEGREE` and alike in length; none has an instant within.
    """
    parts = [(mesh.boundaries, np.maximum(mesh.degrees, MOTION_DEGREE))]
    for before, after in instants:
        times, degrees = parts.pop()
        i, j = np.searchsorted(times, before), np.searchsorted(times, after, side="right")
        parts.append((np.append(times[:i], before), degrees[:i]))
        parts.append((np.append(after, times[j:]), degrees[j - 1 :]))
    legs = []
    for times, degrees in parts:
        lengths, cuts = np.diff(times), [0]
        if lengths.size and lengths.max() > LENGTH_RATIO * lengths.min():
            low, high = np.inf, 0.0
            for e, h in enumerate(lengths.tolist()):
                low, high = min(low, h), max(high, h)
                if high > LENGTH_RATIO * low:
                    cuts.append(e)
                    low = high = h
        legs += [
            (times[first : last + 1], degrees[first:last])
            for first, last in pairwise([*cuts, lengths.size])
            if last > first
        ]
    return [(t[::-1], d[::-1]) for t, d in reversed(legs)] if backwards else legs


def _run(flow: Flow, state: State, leg: Leg, duration: float) -> tuple[Array, Array]:
    """Return q and v (n, K) at the nodes of a leg of all the duration.

    The state is that before a jump there.
    """
    if leg.singular:
        return begin(flow, state, float(leg.times[1]), MOTION_DEGREE)
    start, mesh = begin_leg(flow, state, float(leg.times[0])), leg.mesh
    follow = flow.integrator(mesh.nodes[1:], leg.local, leg.longest)
    # Drift off constraints has the whole time to decay; faster, it would be round-off that acts.
    q, v = follow(start, leg.span, leg.units, mesh.elements * abs(leg.span) / duration)
    return np.column_stack([start.q, q]), np.column_stack([start.v, v])


def begin_leg(flow: Flow, state: State, t: float) -> State:
    """Return the state at the time t at which the next leg begins: beyond a jump, or the same."""
    if t == state.t:
        return state
    try:
        return across(flow.system, flow.parameters, state, t)
    except (ValueError, np.linalg.LinAlgError) as error:
        message = f"the Lagrangian jumps at t = {t:.6g}, and there is no velocity beyond: {error}"
        raise IntegrationError(message, state.t) from error


@immutable
class _Resolve:
    """Integrates legs, and splits their elements until these resolve q and v.

    With `kinks`, v is not asked for in elements shorter than `NARROWEST_PART`.
    """

    flow: Flow
    seen: _Rough
    tol: float
    duration: float
    kinks: bool

    def __call__(self, state: State, times: Array, degrees: NDInt) -> tuple[Leg, Array, Array]:
        """Return the leg with its elements, and q and v (n, K) at their nodes."""
        units, local = self.seen.within(
            (times[0] + times[-1]) / 2, max(LOCAL_SHARE * self.tol, FINEST_LOCAL)
        )
        leg = Leg(times, degrees, units, local, longest_step(times))
        short = NARROWEST_PART * self.duration if self.kinks else 0.0
        apart = DISTINCT_TIMES * np.spacing(np.max(np.abs(times)))
        goal = max(self.tol, 200 * leg.local)
        for _ in range(MOTION_ROUNDS):
            q, v = _run(self.flow, state, leg, self.duration)
            mesh, lengths = leg.mesh, np.abs(np.diff(leg.times))
            tails = np.where(lengths < short, 0.0, _tails(mesh, v / leg.units.v[:, None]))
            tails = np.maximum(tails, _tails(mesh, q / leg.units.q[:, None]))
            # A coefficient of degree d goes with the d-th power of the length; not yet quite so
            # where the motion is far from resolved.
            power = 1 / np.maximum(np.array(mesh.degrees) - 2, 1)
            pieces = np.clip(np.ceil((REFINED_BY * tails / goal) ** power), 1, 8).astype(int)
            pieces[tails <= goal] = 1
            if np.all(pieces == 1):
                return leg, q, v
            unresolved = pieces > 1
            first = float(leg.times[:-1][unresolved][0])
            if lengths[unresolved].min() < apart:
                break
            leg = leg.split(pieces)
            if 2 * q.shape[0] * leg.mesh.nodes.size > MAX_NUMBERS:
                break
        raise IntegrationError(
            f"the motion from t = {first:.6g} on is not resolved by {leg.mesh.elements} elements: "
            "it runs into a singularity there, such as a collision, or is not smooth, or takes too "
            "long; end before that time, or ask for a larger tol",
            first,
        )


def _tails(mesh: Mesh, table: Array) -> Array:
    """Return the larger of each element's last two Legendre coefficients in magnitude, (N,).

    Less the round-off of time, which the rates amplify.
    """
    tails = np.empty(mesh.elements)
    for g in mesh.groups:
        values = table[:, g.nodes]
        last = np.max(np.abs(values @ g.rule.to_legendre[-2:].T), axis=2)
        rates = np.max(np.abs(values @ g.rule.derivative.T), axis=2) * (
            2 / mesh.lengths[g.elements]
        )
        tails[g.elements] = np.max(last - 16 * EPS * rates, axis=0, initial=0.0)
    return tails


def _mesh_over(mesh: Mesh, t0: float, t1: float) -> Mesh:
    """Return the mesh over the times t0 to t1, or raise ValueError if it is over others."""
    if not isinstance(mesh, Mesh):
        raise ValueError(f"expected a Mesh(boundaries, degrees) or None, found {mesh!r}")
    if not np.allclose(mesh.boundaries[[0, -1]], [t0, t1], rtol=0, atol=1e-9 * (t1 - t0)):
        raise ValueError(
            f"expected a mesh over the times {t0} to {t1}, found one from "
            f"{mesh.boundaries[0]} to {mesh.boundaries[-1]}; use mesh.moved"
        )
    return mesh.moved(t0, t1)


def _check(system: System, state: State, t_end: float, tol: float) -> float:
    """Return the time span, or raise ValueError for arguments that do not fit."""
    if not isinstance(state, State):
        raise ValueError(f"expected a State(t, q, v) to begin with, found {state!r}")
    if state.q.size != check_system(system).n:
        raise ValueError(
            f"expected a state of {system.n} coordinates ({', '.join(system.coordinates)}), "
            f"found {state.q.size}"
        )
    tolerance(tol)
    end = number(t_end, "t_end")
    if end == state.t:
        raise ValueError(f"expected a t_end other than the start {state.t}, found {end}")
    return end - state.t


def _check_on_surface(flow: Flow, state: State, span: float) -> None:
    """Raise ValueError if the state is off the constraints, or about to leave them."""
    system, parameters = flow.system, flow.parameters
    if not system.m:
        return
    packed = system.table.pack(system.table.values(parameters))
    q, t = state.q[None, :], np.array([[state.t]])
    f = system.constraint(state.q, state.t, parameters=parameters)
    G = system.constraint_jacobian(state.q, state.t, parameters=parameters)
    f_t = system.pointwise("constraint_rate")(q, t, packed)[0][0].copy()
    # What f changes by when q and t change by their own size: |f| alone has no scale. A rate is
    # as bad as what it does to f over the whole time.
    length = np.where(state.q != 0, np.abs(state.q), np.max(np.abs(state.q)))
    scale = np.abs(G) @ length + np.abs(f_t * span)
    rate = G @ state.v + f_t
    rate_scale = np.abs(G) @ np.abs(state.v) + scale / abs(span)
    for what, found, size, remedy in (
        ("on the constraint surface", f, scale, "move it onto f(q, t) = 0"),
        ("moving along it", rate, rate_scale, "choose v with G v = -df/dt"),
    ):
        bad = np.abs(found) > SURFACE_TOLERANCE * np.maximum(size, np.finfo(float).tiny)
        if np.any(bad):
            i = int(np.flatnonzero(bad)[0])
            raise ValueError(
                f"expected a state {what}, found {'f' if found is f else 'df/dt'} = "
                f"{found[i]:.6g} in constraint row {i}; {remedy}"
            )
