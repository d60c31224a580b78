"""Motions about a curve that is known, by Picard's iteration: what comparing them takes.

On a panel of time, accelerations a at Gauss's points give velocities and coordinates there,

    v = v0 + T A a,    q = q0 + T A v,

A being the integrals of the polynomial through them, and these give accelerations again. Beginning
with a curve that is nearly a motion a few rounds do, and where they end does not depend on it:
only on the state at the start, as for every integration. What they do not settle is left to CVODES.

References
----------
Clenshaw and Norton, The Computer Journal 6 (1963) 88-92.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cache, cached_property
from math import isfinite
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import ArrayLike

from actionopt.analysis.motion.flow import (
    CVODES_LONGEST,
    STEP_NOISE,
    Flow,
    FlowUnits,
    Integrator,
    scaled_motion,
    span_within,
)
from actionopt.discrete.meshes.mesh import Mesh
from actionopt.mechanics.laws.compiled import AT_ONCE, Pointwise
from actionopt.mechanics.question.events import State
from actionopt.tools.immutable import immutable
from actionopt.tools.lobatto import legendre
from actionopt.tools.types import EPS, Array

# Ad hoc, where nothing else is said.
POINTS_A_DIGIT = 1.2  # of the tolerance, in a panel: halves of it are taken where these are too few
FEWEST_POINTS = 8
# Where accelerations are quotients, which cost less than the calls of numpy around them: how many
# are asked for at once before a panel is cut; flat from 30 to 50 on lattices of 10 to 160 masses.
MOST_POINTS = 40
PICARD_ROUNDS = (
    24  # of iteration: what contracts by half ends at round-off by then, from a hundredth
)
PANEL_HALVINGS = 7  # of a panel at most: what asks for more is left to CVODES
LEAST_CHANGE = 32 * EPS  # in a panel: some hundred of them are still far below the tolerance asked
# Baumgarte's, in a panel: a larger one needs more rounds. There is none along a whole curve of as
# few panels as that: drift grows as the square of their number, to 1e-13.
DRIFT_RATE, FEW_PANELS = 0.25, 30
STILL_CHANGES = 100.0  # times the tolerance: where round-off alone changes it from round to round


class Curve(Protocol):
    """A curve about which motions are integrated."""

    @property
    def mesh(self) -> Mesh: ...  # noqa: D102
    def __call__(self, t: ArrayLike) -> Array: ...  # noqa: D102
    def velocity(self, t: ArrayLike) -> Array: ...  # noqa: D102


class _Rule(NamedTuple):
    """Gauss's k points in [0, 1], and integrals of the polynomials through values there.

    Matrices that map values to the coefficients of Legendre's polynomials (k, k); and to integrals
    of integrals, and to integrals, from 0 to the points and to 1 (2, 1, k + 1, k).
    """

    points: Array
    ends: Array  # (k + 1, 1): the points and 1
    coefficients: Array
    integrals: Array


@cache
def _rule(count: int) -> _Rule:
    """Return the rule of so many points."""
    x, w = np.polynomial.legendre.leggauss(count)
    coefficients = (np.arange(count)[:, None] + 0.5) * legendre(count - 1, x) * w
    integrals = [each.T @ coefficients for each in _integrals(count, np.append(x, 1.0))[::-1]]
    points = (x + 1) / 2
    return _Rule(
        points, np.append(points, 1.0)[:, None], coefficients, np.stack(integrals)[:, None]
    )


def _integrals(count: int, x: Array) -> tuple[Array, Array]:
    """Return the integrals of `count` Legendre polynomials from -1 to x (K,), and those of these.

    Both (count, K), and for an interval of length one.
    """
    P, odd = legendre(count + 1, x), 2 * np.arange(1, count + 1)[:, None] + 1
    # (2 k + 1) P_k is the derivative of P_{k + 1} - P_{k - 1}; so for their integrals.
    once = np.concatenate([P[:1] + P[1:2], (P[2:] - P[:-2]) / odd])
    twice = np.concatenate([once[:1] + once[1:2], (once[2:] - once[:-2]) / odd[:-1]])
    return once[:-1] / 2, twice / 4


class _Panels(NamedTuple):
    """A motion on P panels: where they begin, in parts of the whole, and scaled q and v (P, 2, n).

    And coefficients (P, k, n) of Legendre's polynomials for the rates of v.
    """

    begins: Array
    states: Array
    rates: Array


@immutable
class FlowAbout(Flow):
    """The equations of motion, for motions about a curve."""

    curve: Curve = None  # type: ignore  # it is given
    known: dict[tuple, tuple[_Panels | None, FlowUnits]] = field(default_factory=dict, init=False)

    def integrator(
        self, s: Array, tolerance: float, longest: float = CVODES_LONGEST
    ) -> PicardIntegrator:
        """Return the integrator from s = 0 with output at the K increasing times `s` <= 1.

        It evaluates forces as often as steps of `longest` would.
        """
        return PicardIntegrator(self, s, tolerance, longest)

    def rough(self, local: float) -> float:
        """Return the tolerance of the run that finds the sizes: that of the next one is kept."""
        return local

    def several(
        self,
        asked: list[tuple[State, float]],
        units: FlowUnits,
        tolerance: float,
        s: Array,
        longest: float,
    ) -> list[tuple[Array, Array] | None]:
        """Return times (K,) and q (n, K) on motions from states to times, each on one panel.

        At the parts `s` (K,) of the time between; None where that does not settle it.
        """
        wanted = int(np.ceil(self.often / 2 / longest))
        rule, n = _rule(max(_points(tolerance), wanted)), units.q.size
        last = _integrals(rule.points.size, 2 * s - 1)[1].T @ rule.coefficients
        enough = max(tolerance, LEAST_CHANGE)
        most, found = max(AT_ONCE // (rule.points.size * 8 * n), 1), []
        for first in range(0, len(asked), most):
            states, ends = zip(*asked[first : first + most], strict=True)
            times = np.array([state.t for state in states])
            span = np.array([span_within(*both) for both in zip(times.tolist(), ends, strict=True)])
            here = np.array([[at.q / units.q for at in states], [at.v / units.v for at in states]])
            turn = span[:, None, None] * (units.v / units.q)
            of = np.column_stack([times, span, DRIFT_RATE / span]).repeat(rule.points.size, axis=0)
            rates = self.rates(of, units)(np.tile(rule.points, len(states))[:, None])
            about = _near(self.curve, times, span, rule, units)
            with np.errstate(all="ignore"):
                a, _, settled = _settle(rates, about, here[:, :, None], turn, 1.0, rule, enough)
                q, v = here[:, :, None]
                q = units.q * (q + turn * (v * s[:, None] + last @ a))
            t = times[:, None] + s * span[:, None]
            found += [
                (*each, y.T) if good else None for *each, y, good in zip(t, q, settled, strict=True)
            ]
        return found

    def rates(self, of: Array, units: FlowUnits) -> Callable[[Array], Callable[[Array], Array]]:
        """Return what makes of scaled times (K, 1) the rates of scaled v (K, n) for motions.

        As a function of scaled q and v (2, K, n) there. `of` (K, 3) are the time at which each
        begins, how long it lasts and Baumgarte's rate; or (1, 3).
        """
        system = self.system
        n, packed = system.n, system.table.pack(system.table.values(self.parameters))
        if system.has_diagonal_mass and not system.m:
            motion, factor = system.pointwise("even_motion"), of[:, 1:2] / units.v
            sizes = np.stack([units.q, units.v])[:, None]

            def quotients(s: Array) -> Callable[[Array], Array]:
                t = of[:, :1] + s * of[:, 1:2]

                def rates(x: Array) -> Array:
                    mass, bias = motion(*(x * sizes), t, packed)
                    return bias / mass * factor

                return rates

            return quotients
        made = system.memoize("scaled", lambda: Pointwise(scaled_motion(system)))
        same = packed, of, units.q[None], units.v[None], units.rows[None]
        values = np.concatenate([np.broadcast_to(x, (len(of), x.shape[1])) for x in same], axis=1)
        none = np.zeros((1, 0))
        return lambda s: lambda x: made(s, np.concatenate(x, axis=1), none, values, none)[0][:, n:]

    @property
    def often(self) -> float:
        """How often forces are evaluated while CVODES would take a step that is as long as may be.

        It evaluates them twice. What acts for a moment is told by how often.
        """
        return 2 if self.system.structure.depends_on_time else 1

    @cached_property
    def noise(self) -> Array:
        """The round-off of accelerations (n,) along the curve."""
        t = self.curve.mesh.nodes
        return self.round_off(self.curve(t), self.curve.velocity(t), t)


def _points(tolerance: float) -> int:
    return max(int(-POINTS_A_DIGIT * np.log10(tolerance)), FEWEST_POINTS)


def _near(curve: Curve, start: Array, span: Array, rule: _Rule, units: FlowUnits) -> Array:
    """Return scaled q and v (2, P, k + 1, n) of the curve at each panel's start and points."""
    t = start[:, None] + span[:, None] * np.append(0.0, rule.points)
    at = np.clip(t, *np.sort([start, start + span], axis=0)[:, :, None]).ravel()
    both = np.stack([curve(at).T / units.q, curve.velocity(at).T / units.v])
    return both.reshape(2, *t.shape, -1)


def _settle(
    rates: Callable[[Array], Array],
    about: Array,
    start: Array,
    turn: Array,
    h: float,
    rule: _Rule,
    enough: float,
) -> tuple[Array, Array, Array]:
    """Return the rates of v (P, k, n) on P panels, where they end, and which (P,) are settled.

    From scaled q and v (2, P, 1, n) where they begin, and those of a curve beside them, there and
    at the points, (2, P, k + 1, n). A panel lasts `h`; `turn` (P, 1, n) is the unit of v over that
    of q, and `enough` the largest change that counts as settled.
    """
    k, parts, since = rule.points.size, start.shape[1], h * rule.ends
    x = about[:, :, 1:] + (off := start - about[:, :, :1])
    x[0] += turn * (since[:-1] * off[1])
    straight = start.repeat(k + 1, axis=2)
    straight[0] += turn * (since * start[1])
    integrals = np.array([[[[h * h]]], [[[h]]]]) * rule.integrals
    last, settled = [np.nan] * parts, [False]
    for _ in range(PICARD_ROUNDS):
        a = rates(x.reshape(2, parts * k, -1)).reshape(x.shape[1:])
        new = integrals @ a
        new[0] *= turn
        new += straight
        change = np.abs(new[:, :, :k] - x).max(axis=(0, 2, 3)).tolist()
        x = new[:, :, :k]
        settled = [_is_settled(*both, enough) for both in zip(change, last, strict=True)]
        if all(good or not isfinite(c) for good, c in zip(settled, change, strict=True)):
            break
        last = change
    tails = h * np.abs(rule.coefficients[-2:] @ a) / (2 * k)
    good = np.array(settled) & (tails.max(axis=(1, 2)) <= STILL_CHANGES * enough)
    return a.copy(), new[:, :, k:], good


def _is_settled(change: float, last: float, enough: float) -> bool:
    """Return whether that change, after the `last` one, is the last that counts.

    The next one is as much smaller, at least.
    """
    falls = change <= enough or change * change <= enough * last
    return falls or last / 2 <= change <= STILL_CHANGES * enough


@dataclass(eq=False)
class PicardIntegrator:
    """Integrates as an `Integrator` does, which it asks where the iteration settles nothing."""

    flow: FlowAbout
    s: Array
    tolerance: float
    longest: float
    steps: int = 0

    @cached_property
    def _cvodes(self) -> Integrator:
        flow = Flow(self.flow.system, self.flow.parameters)
        return flow.integrator(self.s, self.tolerance, self.longest)

    def __call__(
        self, state: State, span: float, units: FlowUnits, rate: float = 10.0
    ) -> tuple[Array, Array]:
        """Return what an `Integrator` does; its `rate` is at most `DRIFT_RATE` in a panel.

        Or zero, along the whole of a curve of few panels.
        """
        known = self.flow.known
        b, points = self._panels(state.t, span)
        elements, m = self.flow.curve.mesh.elements, self.flow.system.m
        drifts = m and not elements < b.size <= FEW_PANELS + 1
        drift = min(rate, DRIFT_RATE / float(np.diff(b).max())) if drifts else 0.0
        asked = state.t, state.q.tobytes(), state.v.tobytes(), span, self.longest, points, drift
        if asked not in known or known[asked][0] is None:
            with np.errstate(all="ignore"):
                known[asked] = self._integrate(state, span, units, b, points, drift), units
        panels, of = known[asked]
        if panels is None:
            found = self._cvodes(state, span, units, rate)
            self.steps = self._cvodes.steps
            return found
        self.steps = panels.rates[:, :, 0].size
        e = np.clip(np.searchsorted(panels.begins, self.s) - 1, 0, None)
        h, since = np.diff(panels.begins, append=1.0)[e], self.s - panels.begins[e]
        weights = np.stack(_integrals(panels.rates.shape[1], 2 * since / h - 1))
        once, twice = (weights.transpose(2, 0, 1) @ panels.rates[e]).transpose(1, 2, 0)
        q, v = panels.states[e].transpose(1, 2, 0)
        q = of.q[:, None] * q + span * of.v[:, None] * (since * v + h**2 * twice)
        return q, of.v[:, None] * (v + h * once)

    def _integrate(
        self, state: State, span: float, units: FlowUnits, b: Array, points: int, rate: float
    ) -> _Panels | None:
        """Return the motion on panels between `b`, or halves; None if the iteration settles none.

        Of so many points each; `rate` is Baumgarte's.
        """
        flow, rule = self.flow, _rule(points)
        rates = flow.rates(np.array([[state.t, span, rate / span]]), units)
        turn = (span * units.v / units.q)[None, None]
        noise = float(STEP_NOISE * np.max(abs(span) * flow.noise / units.v))

        def near(b: Array) -> list[Array]:
            known = _near(flow.curve, state.t + span * b[:-1], span * np.diff(b), rule, units)
            return list(known.swapaxes(0, 1)[::-1, :, None])

        ahead, shortest = b[:0:-1].tolist(), float(np.diff(b).min()) * 0.5**PANEL_HALVINGS
        about, at, done = near(b), 0.0, []
        here = np.stack([state.q / units.q, state.v / units.v])[:, None, None]
        while ahead:
            h = ahead[-1] - at
            enough, there = max(self.tolerance, LEAST_CHANGE, h * noise), about.pop()
            rates_at = rates((at + h * rule.points)[:, None])
            a, end, settled = _settle(rates_at, there, here, turn, h, rule, enough)
            if settled[0]:
                done.append((at, here[:, 0, 0], rule.coefficients @ a[0]))
                at, here = ahead.pop(), end
            elif h / 2 < shortest:
                return None
            else:
                ahead.append(at + h / 2)
                about += near(np.array([at, at + h / 2, at + h]))
        return _Panels(*(np.array(each) for each in zip(*done, strict=True)))

    def _panels(self, start: float, span: float) -> tuple[Array, int]:
        """Return where panels begin, and one: at the curve's elements, or closer; and their points.

        Few of many points take fewer calls of numpy than many of few.
        """
        b = np.sort((self.flow.curve.mesh.boundaries - start) / span)
        b = np.array([0.0, *b[(b > EPS) & (b < 1 - EPS)], 1.0])
        wanted = self.flow.often * np.diff(b) / self.longest
        least = _points(self.tolerance)
        most = MOST_POINTS if self.flow.system.has_diagonal_mass and not self.flow.system.m else 0
        parts = np.ceil(wanted / max(most, least))
        points = max(least, int(np.ceil(np.max(wanted / parts))))
        if np.max(parts) > 1:
            e = np.arange(parts.size).repeat(parts.astype(int))
            within = np.arange(e.size) - np.searchsorted(e, e)
            b = np.append(b[e] + np.diff(b)[e] * within / parts[e], 1.0)
        return b, points
