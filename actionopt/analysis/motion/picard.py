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
PICARD_ROUNDS = (
    24  # of iteration: what contracts by half ends at round-off by then, from a hundredth
)
PANEL_HALVINGS = 7  # of a panel at most: what asks for more is left to CVODES
LEAST_CHANGE = 32 * EPS  # in a panel: some hundred of them are still far below the tolerance asked
DRIFT_RATE = 0.25  # Baumgarte's, in a panel: a larger one needs more rounds
STILL_CHANGES = 100.0  # times the tolerance: where round-off alone changes it from round to round


class Curve(Protocol):
    """A curve about which motions are integrated."""

    @property
    def mesh(self) -> Mesh: ...  # noqa: D102
    def __call__(self, t: ArrayLike) -> Array: ...  # noqa: D102
    def velocity(self, t: ArrayLike) -> Array: ...  # noqa: D102


class _Rule(NamedTuple):
    """Gauss's k points in [0, 1], and integrals of the polynomials through values there.

    Matrices that map values to the coefficients of
    Legendre's polynomials (k, k), to integrals from 0 to the points and to 1 (k + 1, k), and to
    the integrals of these.
    """

    points: Array
    coefficients: Array
    once: Array
    twice: Array


@cache
def _rule(count: int) -> _Rule:
    """Return the rule of so many points."""
    x, w = np.polynomial.legendre.leggauss(count)
    coefficients = (np.arange(count)[:, None] + 0.5) * legendre(count - 1, x) * w
    once, twice = (each.T @ coefficients for each in _integrals(count, np.append(x, 1.0)))
    points = (x + 1) / 2
    return _Rule(points, coefficients, once, twice)


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
    """A motion on P panels: where they begin, in parts of the whole, and scaled q and v (P, n).

    And coefficients (P, n, k) of Legendre's polynomials for the rates of v.
    """

    begins: Array
    q: Array
    v: Array
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
        rule, n = _rule(max(_points(tolerance), int(np.ceil(1 / longest)))), units.q.size
        last = rule.coefficients.T @ _integrals(rule.points.size, 2 * s - 1)[1]
        enough = max(tolerance, LEAST_CHANGE)
        most, found = max(AT_ONCE // (rule.points.size * 8 * n), 1), []
        for first in range(0, len(asked), most):
            states, ends = zip(*asked[first : first + most], strict=True)
            times = np.array([state.t for state in states])
            span = np.array([span_within(*both) for both in zip(times.tolist(), ends, strict=True)])
            here = np.array([[*(at.q / units.q), *(at.v / units.v)] for at in states])[:, :, None]
            turn = span[:, None, None] * (units.v / units.q)[:, None]
            x = _shifted(_near(self.curve, times, span, rule, units), here, turn, rule.points)
            rates = self.rates(times, span, DRIFT_RATE / span, units, rule.points.size)
            with np.errstate(all="ignore"):
                a, settled = _settle(rates, x, here, turn, (0.0, 1.0), rule, enough)
                q = units.q[:, None] * (here[:, :n] + turn * (here[:, n:] * s + a @ last))
            t = times[:, None] + s * span[:, None]
            found += [each if good else None for *each, good in zip(t, q, settled, strict=True)]
        return found

    def rates(
        self, start: ArrayLike, span: ArrayLike, rate: ArrayLike, units: FlowUnits, points: int
    ) -> Callable[[Array], Callable[[Array], Array]]:
        """Return what makes of scaled times (K, 1) the rates of scaled v (K, n) for P motions.

        As a function of scaled q and v (K, 2 n) there: so many points of each motion.
        """
        system = self.system
        n, packed = system.n, system.table.pack(system.table.values(self.parameters))
        times = np.column_stack([start, span, rate]).repeat(points, axis=0)
        if system.has_diagonal_mass and not system.m:
            motion, factor = system.pointwise("even_motion"), times[:, 1:2] / units.v
            sizes = np.concatenate([units.q, units.v])

            def quotients(s: Array) -> Callable[[Array], Array]:
                t = times[:, :1] + s * times[:, 1:2]

                def rates(x: Array) -> Array:
                    there = x * sizes
                    mass, bias = motion(there[:, :n], there[:, n:], t, packed)
                    return bias / mass * factor

                return rates

            return quotients
        made = system.memoize("scaled", lambda: Pointwise(scaled_motion(system)))
        same = packed, times, units.q[None], units.v[None], units.rows[None]
        count, none = len(times), np.zeros((len(times), 0))
        values = np.concatenate([np.broadcast_to(x, (count, x.shape[1])) for x in same], axis=1)
        return lambda s: lambda x: made(s, x, none, values, none)[0][:, n:]

    @cached_property
    def noise(self) -> Array:
        """The round-off of accelerations (n,) along the curve."""
        t = self.curve.mesh.nodes
        return self.round_off(self.curve(t), self.curve.velocity(t), t)


def _points(tolerance: float) -> int:
    return max(int(-POINTS_A_DIGIT * np.log10(tolerance)), FEWEST_POINTS)


def _near(curve: Curve, start: Array, span: Array, rule: _Rule, units: FlowUnits) -> Array:
    """Return scaled q and v (P, 2 n, k + 1) of the curve at each panel's start and points."""
    t = start[:, None] + span[:, None] * np.append(0.0, rule.points)
    at = np.clip(t, *np.sort([start, start + span], axis=0)[:, :, None]).ravel()
    both = curve(at) / units.q[:, None], curve.velocity(at) / units.v[:, None]
    return np.concatenate(both).reshape(-1, *t.shape).transpose(1, 0, 2)


def _shifted(x: Array, here: Array, turn: Array, since: Array) -> Array:
    """Return q and v (P, 2 n, k) at the points, moved to a motion that begins beside the curve."""
    off, n = here - x[:, :, :1], here.shape[1] // 2
    x = x[:, :, 1:] + off
    x[:, :n] += turn * off[:, n:] * since
    return x


def _settle(
    rates: Callable[[Array], Callable[[Array], Array]],
    x: Array,
    start: Array,
    turn: Array,
    when: tuple[float, float],
    rule: _Rule,
    enough: float,
) -> tuple[Array, Array]:
    """Return the rates of v (P, n, k) on P panels, and which of them (P,) are settled.

    From scaled q and v (P, 2 n, k) there and where they begin, (P, 2 n, 1). `when` is the scaled
    time at which each begins, and how long it lasts; `turn` is the unit of v over that of q, and
    `enough` the largest change that counts as settled.
    """
    at, h = when
    parts, n, k = len(x), start.shape[1] // 2, rule.points.size
    straight = start.repeat(k, axis=2)
    straight[:, :n] += turn * (h * start[:, n:] * rule.points)
    integrals = np.stack([h * h * rule.twice[:-1].T, h * rule.once[:-1].T])
    scale = np.concatenate([turn, np.ones_like(turn)], axis=-2)
    rates_at = rates(np.tile(at + h * rule.points, parts)[:, None])
    last, settled = [np.nan] * parts, [False]
    for _ in range(PICARD_ROUNDS):
        places = x.transpose(0, 2, 1).reshape(parts * k, 2 * n)
        a = rates_at(places).reshape(parts, k, n).transpose(0, 2, 1)
        new = (a[:, None] @ integrals).reshape(parts, 2 * n, k)
        new *= scale
        new += straight
        change = np.abs(new - x).reshape(parts, -1).max(axis=1).tolist()
        x = new
        settled = [_is_settled(*both, enough) for both in zip(change, last, strict=True)]
        if all(good or not isfinite(c) for good, c in zip(settled, change, strict=True)):
            break
        last = change
    tails = h * np.abs(a @ rule.coefficients[-2:].T) / (2 * k)
    return a.copy(), np.array(settled) & (tails.max(axis=(1, 2)) <= STILL_CHANGES * enough)


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
        """Return what an `Integrator` does; its `rate` is at most `DRIFT_RATE` in a panel."""
        known, points = self.flow.known, _points(self.tolerance)
        b = self._boundaries(state.t, span, points)
        drift = min(rate, DRIFT_RATE / float(np.diff(b).max())) if self.flow.system.m else 0.0
        asked = state.t, state.q.tobytes(), state.v.tobytes(), span, self.longest, points, drift
        if asked not in known or known[asked][0] is None:
            with np.errstate(all="ignore"):
                known[asked] = self._integrate(state, span, units, b, drift), units
        panels, of = known[asked]
        if panels is None:
            found = self._cvodes(state, span, units, rate)
            self.steps = self._cvodes.steps
            return found
        self.steps = panels.rates[:, 0].size
        e = np.clip(np.searchsorted(panels.begins, self.s) - 1, 0, None)
        h, since = np.diff(panels.begins, append=1.0)[e], self.s - panels.begins[e]
        once, twice = (
            np.einsum("Knk,kK->nK", panels.rates[e], each)
            for each in _integrals(panels.rates.shape[2], 2 * since / h - 1)
        )
        v = panels.v[e].T
        q = of.q[:, None] * panels.q[e].T + span * of.v[:, None] * (since * v + h**2 * twice)
        return q, of.v[:, None] * (v + h * once)

    def _integrate(
        self, state: State, span: float, units: FlowUnits, b: Array, rate: float
    ) -> _Panels | None:
        """Return the motion on panels between `b`, or halves; None if the iteration settles none.

        `rate` is Baumgarte's.
        """
        flow, n, rule = self.flow, state.q.size, _rule(_points(self.tolerance))
        rates = flow.rates(state.t, span, rate / span, units, rule.points.size)
        turn = (span * units.v / units.q)[:, None]
        noise = float(STEP_NOISE * np.max(abs(span) * flow.noise / units.v))

        def near(b: Array) -> list[Array]:
            known = _near(flow.curve, state.t + span * b[:-1], span * np.diff(b), rule, units)
            return list(known[::-1])

        ahead, shortest = b[:0:-1].tolist(), float(np.diff(b).min()) * 0.5**PANEL_HALVINGS
        about, at, done = near(b), 0.0, []
        here = np.concatenate([state.q / units.q, state.v / units.v])[:, None]
        while ahead:
            h = ahead[-1] - at
            x = _shifted(about.pop()[None], here[None], turn, h * rule.points)
            enough = max(self.tolerance, LEAST_CHANGE, h * noise)
            a, settled = _settle(rates, x, here[None], turn, (at, h), rule, enough)
            if settled[0]:
                done.append((at, here[:n, 0], here[n:, 0], a[0] @ rule.coefficients.T))
                whole = h * a[0] @ np.stack([h * rule.twice[-1], rule.once[-1]], axis=1)
                q = here[:n] + turn * (h * here[n:] + whole[:, :1])
                here = np.concatenate([q, here[n:] + whole[:, 1:]])
                at = ahead.pop()
            elif h / 2 < shortest:
                return None
            else:
                ahead.append(at + h / 2)
                about += near(np.array([at, at + h / 2, at + h]))
        begins, places, speeds, rates = (np.array(each) for each in zip(*done, strict=True))
        return _Panels(begins, places, speeds, rates)

    def _boundaries(self, start: float, span: float, points: int) -> Array:
        """Return where panels begin, and one: those of the curve's elements, or closer."""
        b = np.sort((self.flow.curve.mesh.boundaries - start) / span)
        b = np.array([0.0, *b[(b > EPS) & (b < 1 - EPS)], 1.0])
        # CVODES evaluates forces twice a step. What acts for a moment is told by how often.
        often = 2 if self.flow.system.structure.depends_on_time else 1
        parts = np.ceil(often * np.diff(b) / (points * self.longest)).astype(int).tolist()
        cut = [np.linspace(b[e], b[e + 1], k, endpoint=False) for e, k in enumerate(parts)]
        return np.concatenate([*cut, [1.0]])
