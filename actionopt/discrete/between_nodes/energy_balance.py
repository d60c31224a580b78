"""The balance of energy along a path: where it does not hold, L jumps between the samples.

By the chain rule the energy H = v . L_v - L changes along any curve q(t), v = dq/dt, as

    H(b) - H(a) = int_a^b [v . (d/dt L_v - L_q) - dL/dt] dt,

dL/dt the explicit derivative. Along a motion d/dt L_v - L_q is the force Q + G' lam: the balance is
that of the work done. Here it is taken from the curve itself, so that the error of the path drops
out, and v . d/dt L_v is integrated by parts, as L_v is not differentiated by numbers:

    L(b) - L(a) = int_a^b [L_q . v + L_v . dv/dt + dL/dt] dt.    (1)

With accelerations in L, (1) is the same of (q, v) in place of q, and of their rates (v, a).

What does not hold of it is the quadrature's error, or a step of L that no derivative shows: one
that is written as a quotient (abs(q) / q), a branch of an inverse function (arctan(1 / q)), a
smooth one that is narrower than the samples are apart. The energy jumps by as much.

How far (1) may be off: a path whose error is `error`, in units of its coordinates' sizes s and of
their largest speeds u, has an L that is uncertain by

    error * sum (max_t |L_q| s + max_t |L_v| u)

and forces that are summed to that accuracy. Round-off adds some eps of the same sum, and of L.
(Measured, of 1500 right answers: 0.05 of that at most where L is smooth, 0.4 at a kink; at jumps
100 and more.)

Nor is it to move the path by more than its error. Where a body is slow an energy moves it far: one
that it does not get, dE, leaves it short of the momentum dE / v, which on a mesh that does not see
it appears nowhere else. `Balance.beyond` says what that allows in each interval.

Mostly that need not be drawn up: `plain_drift`.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import ClassVar, Literal

import numpy as np

from actionopt.discrete.action import second_quadrature
from actionopt.discrete.action.second_quadrature import Batch
from actionopt.discrete.action.transcription import Transcription
from actionopt.discrete.meshes.path import Path
from actionopt.discrete.newton.discrete_path import DiscretePath
from actionopt.mechanics.question.problem import Problem
from actionopt.tools.immutable import immutable
from actionopt.tools.lobatto import Sampling, lgl
from actionopt.tools.types import EPS, Array, NDInt

ROUNDOFF = 100 * EPS  # of the terms of (1), a few in each of its sums; ad hoc
INNER_PARTS = 16  # into which an interval is cut where the balance does not hold; ad hoc
INNER_RULE = lgl(6).same  # sums what is smooth in such a part; ad hoc
PERSISTENT = 0.4  # share that one part in 16 has of a step, at least: of a kink it is a sixteenth
FOLLOWED = 64  # intervals at once; ad hoc
AROUND = 64.0  # lengths of an interval: a surface that moves is not so much faster; ad hoc
PROBES = np.arange(1, 65) * (np.sqrt(5) - 1) / 2 % 1  # of the path, spread; how many is ad hoc
# Of the largest v . L_v, an energy that jumps between elements where velocities do. Where these are
# off by the error of a path it is a twelfth of its third power; at a corner, of its size.
CORNER = 1e-3
WORST_SHARE = 0.1  # of the largest imbalance, one that is as large; ad hoc
SHORTENED = 20  # times by 4, an interval in which L hardly changes; ad hoc
SUDDEN = 16.0  # ratio from an interval to one four times as long: no growth by rounding; ad hoc
ROUNDINGS = 16.0  # largest rounding of L, in typical ones: a quarter of a unit; ad hoc
ENDS = [0, -1]
FEW_ELEMENTS = 3  # the drift of fewer is not told by their means
AMPLIFIED = 4.0  # round-off where L is continued to the ends of panels; measured
STEP_SHARE = 0.06  # of a step among 6 to 35 points that 3 of 4 degrees leave at one, at least
# Of L, what an error of the path may explain of it where no drift of the energy is known; ad hoc.
UNCERTAIN_SHARE = 1e-2
# From what a varying energy shows of an error. Measured: 0.9 to 1.2 of it are the error at cusps.
DRIFT_SAFETY = 2.0
LINEAR_SHARE = 0.1  # of |m v| . |v|, an energy that changes v in proportion to it; ad hoc
NO_ELEMENTS: NDInt = np.empty(0, dtype=np.intp)
UNDECIDED = 16 * EPS  # of the times: on which side of a step a path is, in such an interval; ad hoc


@immutable
class Imbalance:
    """Where the balance does not hold."""

    # low, high (K,): times since the start between which it does not, in order.
    low: Array
    high: Array
    off: Array  # (K,): by how much L changes there without a reason; zero if that is not known
    allowed: Array  # (K,): how far L may change there without a reason
    is_jump: ClassVar[Literal[False]] = False
    sudden: bool = False  # whether it does so in a small part of what is between two samples

    def __str__(self) -> str:
        """Return a phrase that says where it is off most, and by how much."""
        k = int(np.argmax(np.abs(self.off)))
        where = f"within {self.high[k] - self.low[k]:.2g} of {self.low[k]:.6g} after the start"
        return f"{where} the energy changes by {abs(self.off[k]):.3g} without a force that shows it"


@immutable
class Balance:
    """The terms of the balance of energy along a path."""

    at: DiscretePath
    # How far L changes without a reason, from one end of each element over its samples to the
    # other, (E, points + 1), batch by batch; and between elements, (N - 1,).
    off: list[Array]
    # unit, read: what that may be for a path of the error 1, and what else is rounded.
    unit: float
    read: float
    energy: Array  # v . L_v - L at the samples, (points,)
    explicit: Array  # dL/dt there, (points,), or a zero
    velocity: Array  # v there, (points, n)
    # speeds, momenta, outer: v and L_v (n, N, 2), and L (N, 2), at both ends of each element.
    speeds: Array
    momenta: Array
    outer: Array
    # size, speed, momentum (n,): the largest |q|, |v| and |L_v|.
    size: Array
    speed: Array
    momentum: Array

    @classmethod
    def of(cls, at: DiscretePath) -> Balance:
        """Return the balance of a path."""
        tr, problem = at.tr, at.problem
        batches, point = tr.between_nodes, tr.place(at.x)
        with np.errstate(all="ignore"):
            q, v, force, momentum, L, explicit = second_quadrature.values(tr, at.x, batches)
            t, explicit = second_quadrature.times(tr, batches), _flat(explicit.copy())
            given = v  # in rows of coordinates numpy is fast
            v, force, momentum = (np.ascontiguousarray(y.T) for y in (v, force, momentum))
            size, speed = (np.abs(y.T).max(axis=1) for y in (point.at, point.v))
            most, largest = (np.abs(y).max(axis=1) for y in (force, momentum))
            read = float(np.abs(L).max())
            if not read < np.inf:
                read = float(np.abs(L[np.isfinite(L)]).max(initial=0.0))
            if explicit.size > 1:
                read += float(np.abs(explicit).max() * np.abs(t).max())
            rate = _rate(force, rates_of(q, v), explicit)
            # Of each element at its ends, on its own side of a switch.
            speeds, momenta, outer = _at_ends(tr, at.x)
            first, off = 0, []
            for b in batches:
                shape = b.elements.size, b.rule.nodes.size
                here = slice(first, first := first + shape[0] * shape[1])
                p, u = (y[:, here].reshape(-1, *shape) for y in (momentum, v))
                ends = outer[b.elements], speeds[:, b.elements]
                known = p, L[here].reshape(shape), rate[here].reshape(shape), u
                off.append(_off_between(b.rule, b.half[:, 0], *known, *ends))
                if b.singular:  # up to where L is infinite nothing is known
                    off[-1][:, [end for end in (0, -1) if tr.mesh.singular_ends[end]]] = 0.0
            between = steps_between(speeds, momenta, outer)
            if tr.sides is not None:  # where laws switch L may jump: their momentum is continuous
                between[tr.sides[0][1:] != tr.sides[1][:-1]] = 0.0
            if problem.through:  # momenta jump there
                inner = np.searchsorted(tr.mesh.offsets, tr.joints[1:-1])
                between[inner - 1] = 0.0
            unit = _sum(np.append(most * size, largest * speed))
            energy = (momentum * v).sum(axis=0) - L
            known = energy, explicit, given, speeds, momenta, outer, size, speed, largest
            return cls(at, [*off, between], unit, read, *known)

    @property
    def roundoff(self) -> float:
        """How far (1) may be off by round-off."""
        return ROUNDOFF * (self.unit + self.read)

    @cached_property
    def holds(self) -> bool:
        """Whether (1) holds to round-off."""
        return all((np.abs(part) <= self.roundoff).all() for part in self.off)

    def beyond(self, error: float, gain: float = 1.0) -> Imbalance | None:
        """Return where (1) is off by more than an error of the path allows, in its own size.

        Or by more than moves the path as far, if an impulse moves it `gain` times as far as a free
        body.
        """
        if self.holds or not np.isfinite(error):
            return None
        shown, known = error * self.unit, self.roundoff
        if self.at.tr.order > 1:  # where a step is as narrow as the error nothing else shows it
            shown = min(shown, UNCERTAIN_SHARE * self.read)
        off = np.concatenate([part.ravel() for part in self.off])
        allowed = np.full(off.size, shown)
        low, high = self._intervals()
        inner, width = self.at.mesh.since[1:-1], round_off_time(self.at.problem)
        low, high = np.append(low, inner - width), np.append(high, inner + width)
        order = np.argsort(low, kind="stable")
        if self.at.tr.order == 1:
            reach, kinetic = self._inertias()
            allowed = np.minimum(allowed, reach * (error / (gain * self.at.mesh.duration)))
        allowed += known
        wrong = ~(np.abs(off) <= allowed + self._velocity_rounding())
        if not wrong.any():
            return None
        if self.at.tr.order == 1 and (
            (np.abs(off) <= np.minimum(shown + known, LINEAR_SHARE * kinetic))[wrong].all()
        ):  # what one interval misses others may make up for, as sums across a knot of a spline do
            lengths = np.maximum(high - low, round_off_time(self.at.problem))[order]
            gained = off[order]
            moved = displacement(lengths * gained / 2, lengths, reach[order], 0.0, gained)
            if gain * moved <= error:
                return None
        order = order[wrong[order]]
        return Imbalance(low[order], high[order], np.nan_to_num(off[order]), allowed[order])

    def _inertias(self) -> tuple[Array, Array]:
        """Return |m v| . s and |m v| . |v| in the intervals in which L may be `off`, in one array.

        The lesser of both ends of each, and zero where the path turns between them: an energy dE
        that a body does not get, where its velocity is v, leaves it short of the momentum dE / v,
        and that moves a free body by dE T / (4 m v) at most, in the middle of the time T. So dE may
        be |m v| . s error / T, as others come to it. Infinite where nothing has inertia. Not with
        accelerations in L.
        """
        tr, first = self.at.tr, 0
        mass = second_quadrature.inertia(tr, self.at.x)
        outer = self.speeds.transpose(1, 2, 0)
        parts: list[tuple[Array, Array]] = []
        for b in tr.between_nodes:
            shape = b.elements.size, b.rule.nodes.size, -1
            v = self.velocity[first : (first := first + shape[0] * shape[1])].reshape(shape)
            ends = outer[b.elements]
            v = np.concatenate([ends[:, :1], v, ends[:, 1:]], axis=1)
            parts.append((v, v @ (mass if len(mass) == 1 else mass[b.elements])))
        v = np.stack([outer[:-1, 1], outer[1:, 0]], axis=1)
        parts.append((v, np.stack([(outer @ mass)[:-1, 1], (outer @ mass)[1:, 0]], axis=1)))
        found = []
        for v, p in parts:
            here, there = np.abs(p[:, :-1]), np.abs(p[:, 1:])
            least = np.where(p[:, :-1] * p[:, 1:] > 0, np.fmin(here, there), 0.0)
            slowest = np.fmin(np.abs(v[:, :-1]), np.abs(v[:, 1:]))
            found.append([(least @ self.size).ravel(), (least * slowest).sum(axis=2).ravel()])
        reach, kinetic = np.concatenate(found, axis=1)
        known = np.isfinite(reach) & bool(mass.any())
        return np.where(known, reach, np.inf), np.where(known, kinetic, np.inf)

    def largest(self) -> Imbalance | None:
        """Return where (1) is off most, by whatever it is above round-off; None if nowhere."""
        found = self.beyond(0.0)
        if found is None:
            return None
        most = np.abs(found.off) >= WORST_SHARE * np.abs(found.off).max()
        return Imbalance(found.low[most], found.high[most], found.off[most], found.allowed[most])

    def drift(self, rounding: float = 0.0, *, stepped: bool = False) -> float:
        """Return how far the path is carried by what its energy varies, in its own size.

        But for what a `rounding` of L may do, and where L steps in the time alone, if it is asked
        where it is `stepped`. Along a motion E = H - int (Q . v - lam . df/dt - dL/dt) dt is
        constant. A change of it by dE changes the velocity by dE / m v, and in the time since the
        path by the sum:

            max_t |int_0^t (E - E0) / (|m v| . s) dt|,

        with the E0 that leaves the end where it is, and the mean |v| of each element. That sees
        what no sum of forces does: a cusp, where what one sample weighs is nothing and the impulse
        is much, a corner of the path at a kink of L in v, where momenta agree at any time, or a
        feature that is met slowly, where a path is far from resolved that is so in its own size.
        Zero where it is not known.
        """
        structure, tr = self.at.problem.system.structure, self.at.tr
        if self.at.problem.through or tr.order > 1:
            return 0.0  # the energy may jump at events, and is another with accelerations in L
        with np.errstate(all="ignore"):
            energy = self.energy
            if structure.forced or structure.depends_on_time:
                try:
                    energy = energy - self._work(stepped)
                except ValueError:  # forces of constraints that depend on one another
                    return 0.0
            energy = _element_integrals(tr, energy)
            rounding = max(rounding, ROUNDOFF * self.read)
            return _drift_of(tr, self.at.x, energy, None, rounding)

    def _work(self, stepped: bool) -> Array:
        """Return int_0^t (Q . v - lam . df/dt - dL/dt) dt at the samples, (points,)."""
        tr, power = self.at.tr, self._power()
        low, high = self._intervals()
        first, done, inside = 0, np.zeros(low.size), np.ones(low.size, dtype=bool)
        by_time = np.zeros(low.size)
        jumps = np.zeros(tr.mesh.elements)
        if tr.sides is not None:  # where laws switch the energy jumps, and no momentum
            ends = (self.speeds * self.momenta).sum(axis=0) - self.outer
            jumps[1:] = ends[1:, 0] - ends[:-1, 1]
            # That of H at one L_v: velocities of short elements are rounded, and v dL_v by that.
            means = (self.speeds[:, 1:, 0] + self.speeds[:, :-1, 1]) / 2
            rounded = means * (self.momenta[:, 1:, 0] - self.momenta[:, :-1, 1])
            jumps[1:] -= rounded.sum(axis=0)
            jumps[1:] *= tr.sides[0][1:] != tr.sides[1][:-1]
        last = 0
        for b in tr.between_nodes:
            shape = b.elements.size, b.rule.nodes.size
            here = slice(first, first := first + shape[0] * shape[1])
            there = slice(last, last := last + shape[0] * (shape[1] + 1))
            parts = [
                b.rule.increments(b.half[:, 0] * rate[here].reshape(shape)) if rate.size > 1 else 0
                for rate in (power, self.explicit)
            ]
            done[there].reshape(shape[0], -1)[...] = parts[0]
            by_time[there].reshape(shape[0], -1)[...] = parts[1]
            done[there].reshape(shape[0], -1)[:, 0] += jumps[b.elements]
            inside[there].reshape(shape[0], -1)[:, -1] = False  # at the end of an element
        if stepped and self.explicit.size > 1:
            by_time += self._steps_in_time(low, high, by_time)
        done, order = np.nan_to_num(done - by_time), np.argsort(low, kind="stable")
        done[order] = done[order].cumsum()
        return done[inside]

    def _power(self) -> Array:
        """Return Q . v - lam . df/dt at the samples, (points,), or a zero.

        Raises ValueError where constraints that move are not independent.
        """
        at, problem, power = self.at, self.at.problem, np.zeros(1)
        system, batches = problem.system, at.tr.between_nodes
        q, v, *_ = second_quadrature.values(at.tr, at.x, batches)
        t = second_quadrature.times(at.tr, batches)
        if system.structure.forced:
            power = _product(system.pointwise("force")(q, v, t, problem.packed)[0], v)
        if system.m and t.size > 1:
            moved = system.pointwise("constraint_rate")(q, t, problem.packed)[0].copy()
            if moved.any():
                lam = np.nan_to_num(at.multipliers(t[:, 0]))
                power = power - _product(lam, moved)
        return power

    def _steps_in_time(self, low: Array, high: Array, known: Array) -> Array:
        """Return by how much L steps between times since the start, (K,), in the time alone.

        That is what it changes by there without a reason, if it is also what it changes by from
        one time to the other at the same q and v, less what is `known` of that.
        """
        problem = self.at.problem
        off = np.concatenate([part.ravel() for part in self.off])[: low.size]
        at = np.flatnonzero(np.abs(off) > self.roundoff)
        steps = np.zeros(low.size)
        ends = np.concatenate([low[at], high[at]])
        q, v = (part.T for part in self.at.path.carried_on(ends, 1.0, problem.system.order))
        L = [
            problem.system.pointwise("first")(q, v, t[:, None], problem.packed)[2][:, 0].copy()
            for t in (problem.start.t + np.tile(since[at], 2) for since in (low, high))
        ]
        change = (L[1] - L[0]).reshape(2, -1).mean(axis=0) - known[at]
        steps[at] = np.where(np.abs(change - off[at]) < np.abs(off[at]) / 2, off[at], 0.0)
        return steps

    def _velocity_rounding(self) -> Array:
        """Return how far velocities that are rounded change what is `off`, in one array.

        On an element of the length h and of degree d velocities are known to EPS s d^2 / h. L_v dv
        of that is balanced, and L_vv dv^2 is left, with L_v / v for L_vv. (Measured at h = 1e-9 to
        1e-13 of the time: 0.07 of that at most.)
        """
        degree = np.array(self.at.mesh.degrees)
        with np.errstate(all="ignore"):
            size = self.size[-self.speed.size :]  # of what the highest rate is the derivative of
            kinetic = _sum(self.momentum * size**2 / self.speed)
        here = kinetic * (EPS * degree**2 / self.at.mesh.lengths) ** 2
        parts = [
            np.repeat(here[b.elements], part.shape[1])
            for b, part in zip(self.at.tr.between_nodes, self.off, strict=False)
        ]
        return np.concatenate([*parts, here[1:] + here[:-1]])

    def _intervals(self) -> tuple[Array, Array]:
        """Return times since the start from sample to sample, (K,), as `off` has them."""
        low, high = [], []
        for b in self.at.tr.between_nodes:
            points = np.concatenate([[-1.0], b.rule.nodes, [1.0]])
            since = self.at.mesh.since[b.elements, None] + b.half[:, :, 0] * (1 + points)
            low.append(since[:, :-1].ravel())
            high.append(since[:, 1:].ravel())
        return np.concatenate(low), np.concatenate(high)


@np.errstate(all="ignore")
def plain_drift(at: DiscretePath) -> float | None:
    """Return the `Balance.drift` of a path along which L plainly has no step; else None.

    A step between the samples of a panel is no polynomial of 3 of 4 degrees that they have, or it
    is between two panels: where L is smooth to round-off it does not step, and elsewhere (1) is to
    hold to round-off. Steps closer than samples change H without a reason, as the drift shows:
    where that is not known the balance decides.
    """
    tr, problem, structure = at.tr, at.problem, at.problem.system.structure
    batches, N, n = tr.between_nodes, tr.mesh.elements, problem.system.n
    if structure.forced or problem.through or tr.order > 1 or N < FEW_ELEMENTS:
        return None
    if tr.sides is not None or (problem.system.m and structure.depends_on_time):
        return None
    _, v, force, p, L, explicit = second_quadrature.values(tr, at.x, batches)
    power = p * v
    power = power[:, 0] if n == 1 else power @ np.ones(n)
    most, read = float(power.max()), max(abs(float(L[k])) for k in (0, L.size // 2, -1))
    allowed = AMPLIFIED * ROUNDOFF * (most + read)
    speeds, momenta, outer = _at_ends(tr, at.x)
    first = 0
    for b in batches:
        rows = b.elements.size, b.rule.nodes.size
        here = slice(first, first := first + rows[0] * rows[1])

        def of_rows(odd: NDInt, b: Batch = b, here: slice = here) -> tuple[Array, ...]:
            shape = b.elements.size, -1, n
            found = (y[here].reshape(shape)[odd].transpose(2, 0, 1) for y in (p, v, force))
            timed = explicit if explicit.size == 1 else explicit[here].reshape(shape[:2])[odd]
            return *found, timed, speeds[:, b.elements[odd]]

        ends = outer[b.elements]
        if may_step(b.rule, b.half[:, 0], L[here].reshape(rows), ends, allowed, of_rows).size:
            return None
    if not np.abs(steps_between(speeds, momenta, outer)).max() <= allowed:
        return None
    energy, gained = _element_integrals(tr, power - L), None
    if explicit.size > 1:  # H + int dL/dt dt is constant
        energy += _element_integrals(tr, explicit, left=True) * tr.mesh.lengths
        gained = _element_integrals(tr, explicit)
    return _drift_of(tr, at.x, energy, gained, ROUNDOFF * read)


def _drift_of(
    tr: Transcription, x: Array, energy: Array, gained: Array | None, rounding: float
) -> float:
    """Return the `drift` along a path by integrals of the energy over its elements, (N,)."""
    lengths = tr.mesh.lengths
    if displacement(energy, lengths, np.ones(1), rounding, gained) == 0:
        return 0.0
    mass, size = second_quadrature.inertia(tr, x), np.abs(tr.place(x).at).max(axis=0)
    v, n = second_quadrature.values(tr, x, tr.between_nodes)[1], tr.problem.system.n
    squares = np.stack([_element_integrals(tr, v[:, i] ** 2) for i in range(n)], axis=1)
    reach = (np.abs(mass) @ np.sqrt(squares / lengths[:, None])[:, :, None])[:, :, 0] @ size
    return float(displacement(energy, lengths, reach, rounding, gained))


def _element_integrals(tr: Transcription, values: Array, *, left: bool = False) -> Array:
    """Return the integrals of values (points,) over each element, (N,).

    Of what is `left` of the element times the values, if so, in parts of its length.
    """
    found, first = np.empty(tr.mesh.elements), 0
    for b in tr.between_nodes:
        here = slice(first, first := first + b.elements.size * b.rule.nodes.size)
        weights = b.rule.weights * (1 - b.rule.nodes) / 2 if left else b.rule.weights
        found[b.elements] = values[here].reshape(b.elements.size, -1) @ weights * b.half[:, 0, 0]
    return found


def may_step(
    rule: Sampling,
    half: Array,
    L: Array,
    L_ends: Array,
    allowed: Array | float,
    of_rows: Callable[[NDInt], tuple[Array, ...]],
) -> NDInt:
    """Return the elements on which L may step, by more than is `allowed` to it (R,).

    Of R elements L (R, points) and L (R, 2) at the ends, and half the lengths (R, 1). `of_rows`
    returns of some of them, (r,), L_v, v and L_q (n, r, points), dL/dt (r, points) or a zero, and v
    (n, r, 2) at the ends.
    """
    rest, gaps = rule.rest_and_gaps(L, L_ends)
    least = np.min(allowed)
    limit = STEP_SHARE * least
    if -limit <= rest.min() and rest.max() <= limit and np.abs(gaps).max() <= least:
        return NO_ELEMENTS
    smooth = np.abs(rest).max(axis=1) <= STEP_SHARE * allowed
    smooth &= np.abs(gaps).max(axis=1) <= allowed
    odd = np.flatnonzero(~smooth)
    if not odd.size:
        return odd
    p, v, force, explicit, v_ends = of_rows(odd)
    p, v, force = (np.ascontiguousarray(y) for y in (p, v, force))
    rate = (force * v).sum(axis=0) + explicit
    off = _off_between(rule, half[odd], p, L[odd], rate, v, L_ends[odd], v_ends)
    known = np.abs(off).max(axis=1) <= np.broadcast_to(allowed, len(L))[odd]
    return odd[~known]


def steps_between(v: Array, p: Array, L: Array) -> Array:
    """Return how far L steps without a reason between elements, (..., N - 1).

    By v and L_v (n, ..., N, 2) and L (..., N, 2) at both ends of each. Velocities differ there by
    the error of the path.
    """
    means = p[..., 1:, 0] + p[..., :-1, 1]
    known = ((v[..., 1:, 0] - v[..., :-1, 1]) * means).sum(axis=0)
    return L[..., 1:, 0] - L[..., :-1, 1] - known / 2


def find_corners(at: DiscretePath) -> Imbalance | None:
    """Return where a path turns a corner, at which its energy jumps; None where it does nowhere.

    Of two velocities with one momentum a path of given nodes may take either on either side of one.
    It is no motion: there the energy is to be continuous, too (Weierstrass and Erdmann; Gelfand and
    Fomin, *Calculus of Variations* (1963), section 15).
    """
    tr = at.tr
    if tr.mesh.elements < 2 or tr.sides is not None or at.problem.through:
        return None
    with np.errstate(all="ignore"):
        v, p, L = _at_ends(tr, at.x)
        off, power = np.abs(steps_between(v, p, L)), np.abs(v * p).sum(axis=0)
        most, read = (np.abs(y[np.isfinite(y)]).max(initial=0.0) for y in (power, L))
        wrong = np.flatnonzero(off > max(CORNER * most, ROUNDOFF * read))
    inner, width = at.mesh.since[1:-1][wrong], round_off_time(at.problem)
    if not wrong.size:
        return None
    return Imbalance(inner - width, inner + width, off[wrong], np.zeros(wrong.size))


def displacement(
    energy: Array, lengths: Array, reach: Array, rounding: Array | float, gained: Array | None
) -> Array:
    """Return max_t |int_0^t (E - E0) / R dt|, (...), by integrals of E over parts (K, ...).

    The parts are of these lengths (K, ...), in which R is the `reach`; E0 lets the integral vanish
    at the end. What is `gained` in each part counts in all later ones. E is known but for a
    `rounding` (...). Zero where nothing varies, or nothing is known.
    """
    if gained is not None:
        energy = energy + lengths * (gained.cumsum(axis=0) - gained)
    mean = energy / lengths
    # What has no inertia is not carried.
    with np.errstate(divide="ignore", invalid="ignore"):
        slowness = np.where(reach > 0, lengths / reach, 0.0)
        mean = mean - (mean * slowness).sum(axis=0) / slowness.sum(axis=0)
    varied = np.sign(mean) * np.maximum(np.abs(mean) - rounding, 0.0)
    found = np.abs((varied * slowness).cumsum(axis=0)).max(axis=0)
    return np.where(found < np.inf, found, 0.0)


def narrowest_intervals(problem: Problem, path: Path, found: Imbalance) -> Imbalance | None:
    """Return the shortest intervals in which the balance does not hold.

    The intervals are cut as long as one part in 16 has most of what is off in the whole: a step is
    followed down to neighbouring times or to its width, a kink is left at once. None where L is
    known no better, or steps in the time alone, on which no force depends.
    """
    allowed = np.maximum(found.allowed, rounding(problem, path))
    above = ~(np.abs(found.off) <= allowed) | (found.off == 0)  # or not known
    if not above.any():
        return None
    found = Imbalance(found.low[above], found.high[above], found.off[above], allowed[above])
    shortest = round_off_time(problem)
    first = True  # what is off at first may be the sums'
    while (long := found.high - found.low > INNER_PARTS * shortest).any():
        edges = np.linspace(found.low[long], found.high[long], INNER_PARTS + 1)
        low, high = edges[:-1].T.ravel(), edges[1:].T.ravel()
        parts = _off(problem, path, low, high)
        share = 0.0 if first else PERSISTENT
        allowed = found.allowed[long]
        least = np.repeat(np.maximum(allowed, share * np.abs(found.off[long])), INNER_PARTS)
        wrong = np.flatnonzero(~(np.abs(parts) <= least))
        if not wrong.size:
            break
        kept = found.low, found.high, found.off, found.allowed
        new = low[wrong], high[wrong], np.nan_to_num(parts[wrong]), allowed[wrong // INNER_PARTS]
        known = (np.append(y[~long], z)[:FOLLOWED] for y, z in zip(kept, new, strict=True))
        found, first = Imbalance(*known, sudden=True), False
    if not problem.system.structure.depends_on_time:
        return found
    if first:  # that was the sum of dL/dt
        return None
    around = AROUND * (found.high - found.low)
    low, high = np.maximum(found.low - around, 0), np.minimum(found.high + around, problem.duration)
    of_path = ~(np.abs(_off(problem, path, low, high, timed=False)) <= found.allowed)
    if not of_path.any():
        return None
    known = found.low, found.high, found.off, found.allowed
    return Imbalance(*(part[of_path] for part in known), sudden=True)


def rounding(problem: Problem, path: Path) -> float:
    """Return how coarsely L is known along the path, where large numbers cancel in it.

    What (1) is off in an interval as short as one likes is then of the size of the rounding, or of
    the change of L if that is smaller: it grows gradually with the interval, anywhere on the path.
    A jump is in few of short intervals.
    """
    widths = problem.duration / PROBES.size * 4.0 ** np.arange(-SHORTENED, 1)
    low = np.multiply.outer(problem.duration - widths, PROBES)
    off = np.abs(_off(problem, path, low.ravel(), (low + widths[:, None]).ravel()))
    typical = np.median(np.nan_to_num(off.reshape(low.shape), nan=np.inf), axis=1)
    sudden = np.append(typical[1:] > SUDDEN * typical[:-1], True)
    return ROUNDINGS * float(typical[np.argmax(sudden)])


def round_off_time(problem: Problem) -> float:
    """Return an interval of time in which round-off may tell on which side of a step a path is."""
    return UNDECIDED * max(abs(problem.start.t), abs(problem.end.t), problem.duration)


def _off(problem: Problem, path: Path, low: Array, high: Array, *, timed: bool = True) -> Array:
    """Return how far L changes without a reason between times since the start, (K,).

    L(q, v, t) along the path, or with t held where it is half way if it is not `timed`.
    """
    half, order = (high - low)[:, None] / 2, problem.system.order
    since = np.clip(low[:, None] + half * (1 + INNER_RULE.nodes), low[:, None], high[:, None])
    q, v = path.carried_on(since.ravel(), 1.0, order)
    v = v.reshape(-1, *since.shape)
    # Where elements meet, the velocity is that of the one in which the interval lies.
    inside = np.nextafter(since[:, ENDS], since[:, ENDS[::-1]])
    v[..., ENDS] = path.carried_on(inside.ravel(), 1.0, order)[1].reshape(-1, *inside.shape)
    flat = v.reshape(len(v), -1)
    t = since if timed else np.repeat((low + high)[:, None] / 2, since.shape[1], axis=1)
    t = problem.start.t + t.reshape(-1, 1)
    with np.errstate(all="ignore"):
        found = problem.system.pointwise("first")(q.T, flat.T, t, problem.packed)
        Lq, p, L = (np.array(y.T, order="C") for y in found)
        explicit = np.zeros(1)
        if timed and problem.system.structure.depends_on_time:
            of_time = problem.system.pointwise("rate")(q.T, flat.T, t, problem.packed)[0]
            explicit = _flat(of_time[:, 0].copy())
        rate = _rate(Lq, rates_of(q.T, flat), explicit).reshape(since.shape)
        p, L = p.reshape(v.shape), L.reshape(since.shape)
        ends = L[:, ENDS], v[:, :, ENDS]
        return _off_between(INNER_RULE, half, p, L, rate, v, *ends).sum(axis=1)


def _at_ends(tr: Transcription, x: Array) -> tuple[Array, Array, Array]:
    """Return v and L_v (n, elements, 2), and L (elements, 2), at the ends of each element."""
    ends, shape = tr.layout.element_ends, (-1, tr.mesh.elements, 2)
    _, p, L = tr.first(x)
    v, p, L = (y.take(ends, axis=0).T for y in (tr.place(x).v, p, L))
    return v.reshape(shape), p.reshape(shape), L.reshape(shape[1:])


def rates_of(q: Array, v: Array) -> Array:
    """Return the rates (width, K) of what L takes in place of q (K, width), by that of v (n, K)."""
    n = len(v)
    return v if q.shape[1] == n else np.concatenate([q.T[n:], v])


def _rate(Lq: Array, v: Array, explicit: Array) -> Array:
    """Return L_q . v + dL/dt (K,), for L_q and v (n, K)."""
    return _flat((Lq * v).sum(axis=0) + explicit)


def _flat(rate: Array) -> Array:
    """Return a rate with zeros where L is finite and it overflows on the way: there L is flat."""
    if not np.isfinite(rate.sum()):
        rate[~np.isfinite(rate)] = 0.0
    return rate


def _off_between(
    rule: Sampling,
    half: Array,
    p: Array,
    L: Array,
    rate: Array,
    v: Array,
    L_ends: Array,
    v_ends: Array,
) -> Array:
    """Return what (1) leaves from each point to the next, (E, points + 1).

    For L_v and v (n, E, points), L and the `_rate` (E, points), L and v at the ends, (E, 2) and
    (n, E, 2), and half the lengths (E, 1). The integral of a constant L_v is taken apart, as v is
    known: where elements are short dv/dt is all round-off.
    """
    n, E, points = v.shape
    middle = p[:, :, points // 2, None]
    bent = rule.rates(v.reshape(n * E, points, 1)).reshape(v.shape)
    work = half * rate + ((p - middle) * bent).sum(axis=0)
    level = np.empty((E, points + 2))
    level[:, 1:-1] = L - (v * middle).sum(axis=0)
    level[:, :: points + 1] = L_ends - (v_ends * middle).sum(axis=0)
    return level[:, 1:] - level[:, :-1] - rule.increments(work)


def _sum(terms: Array) -> float:
    """Return the sum of those that are known."""
    total = float(terms.sum())
    return total if total == total else float(np.nansum(terms))


def _product(a: Array, b: Array) -> Array:
    return np.einsum("kn,kn->k", a, b)
