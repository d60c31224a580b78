"""Where a path begins or ends at a place at which L is infinite, whatever the velocity is.

A fall from rest begins where v^2 / y is 0 / 0, a radial problem at the centre. Along a smooth path
L may be finite there all the same, and the discrete action need not ask for it, see
`lobatto.open_rule`. Where no smooth path is possible, such as into a centre of attraction, an end
is not singular in this sense, and the question is refused.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from actionopt.mechanics.question.scales import diagonal, first_state
from actionopt.tools.types import Array

# Ad hoc.
CHECKED_VELOCITIES = 4  # at an event
LEAVING_POWERS = (1, 2, 3)  # of the time, with which a smooth path may leave
LEAVING_PARTS = np.array([1e-2, 1e-3, 1e-6])  # parts of the duration until then
# From the first of these to the last, of what stays finite: 1 / sqrt(t) grows by 100.
FINITE_GROWTH = 3.0
# Of what has an integral, nearer to an end by a hundred: between 1 / sqrt(t) and 1 / t.
INTEGRABLE_GROWTH = 30.0
BESIDE_EVENT = 1e-3  # of the coordinates' sizes and of the duration: near an event, and not there


def singular_ends(problem: Any) -> tuple[int, int]:
    """Return the kinds of the start and the end: 0 where L and its derivatives are finite.

    Where they are not, at any velocity, and all coordinates are given: 1, or 2 where the inertia is
    infinite in all directions, and the path at rest (`lobatto.OPEN`, `RESTING`).
    """
    system = problem.system
    if system.order > 1 or not system.structure.narrow:
        return 0, 0
    start, end = (_kind(problem, event) for event in (problem.start, problem.end))
    return start, end


def _kind(problem: Any, event: Any) -> int:
    n = problem.system.n
    if event.t is None or not np.isfinite(event.t) or len(event.pinned) < n:
        return 0
    T = 1.0 if problem.free_time else problem.duration
    rates = problem.scales / T
    q = np.array(event.q, dtype=float)
    if not nonfinite(problem, q, event.t, rates):
        return 0
    inward = 1 if event is problem.start else -1
    steps = BESIDE_EVENT * np.diag(problem.scales)
    beside = [(q, event.t + inward * BESIDE_EVENT * T)]
    beside += [(q + step, event.t) for step in (*steps, *-steps)]
    if all(nonfinite(problem, *place, rates) for place in beside):
        return 0  # it overflows
    at = q[None], rates[None], np.array([[event.t]]), problem.packed
    with np.errstate(all="ignore"):
        inertia = diagonal(problem.system, 2, problem.system.pointwise("second")(*at)[2])
        rests = not np.isfinite(inertia).any()
        smooth = any(
            _stays_finite(problem, q, event.t, inward, power, direction, force=not rests)
            for power in LEAVING_POWERS[rests:]
            for direction in _directions(problem.scales)
        )
    return (1 + rests) * smooth


def _directions(scales: Array) -> Array:
    """Return directions (K, n) in general position, to all sides."""
    n = scales.size
    waves = 1.0 + np.cos(np.arange(1.0, 1 + n)) / 2
    signs = 1.0 - 2.0 * (np.arange(2 ** min(n, 3))[:, None] >> np.arange(n) % 3 & 1)
    return signs * waves * scales


def _stays_finite(
    problem: Any, q: Array, t: float, inward: int, power: int, direction: Array, *, force: bool
) -> bool:
    """Return whether L, and the `force` L_q, stay finite as q + direction s^power is left.

    At rest forces are infinite that are balanced by momenta.
    """
    T = 1.0 if problem.free_time else problem.duration
    s = LEAVING_PARTS[:, None]
    at = q + direction * s**power, inward * power * direction / T * s ** (power - 1)
    Lq, _, L = problem.system.pointwise("first")(*at, t + inward * T * s, problem.packed)
    return all(
        np.isfinite(x).all() and (np.abs(x[-1]) <= FINITE_GROWTH * np.abs(x[0]).max()).all()
        for x in ((L, Lq) if force else (L,))
    )


def finite_derivatives(problem: Any, q: Array, v: Array, t: Array) -> tuple[Array, Array]:
    """Return of which coordinates the momentum is finite at an end where L is infinite, (n,).

    And by which S has second derivatives there: where L_qq, of a coordinate that is the same along
    the path beside the end, has an integral. By what both are at places q (2, n) with velocities v
    and times t (2,), the second a hundredth as far from the end as the first.
    """
    at = q, v, t[:, None], problem.packed
    p = np.abs(problem.system.pointwise("first")(*at)[1])
    L_qq = np.abs(diagonal(problem.system, 0, problem.system.pointwise("second")(*at)[0]))
    grown = [x[1] > limit * x[0] for x, limit in ((p, FINITE_GROWTH), (L_qq, INTEGRABLE_GROWTH))]
    return ~grown[0], ~(grown[0] | grown[1])


def nonfinite(problem: Any, q: Array, t: float, rates: Array) -> str:
    """Return what is not finite at coordinates q (n,) at any velocity, if anything is.

    Of L, its derivatives and the force; velocities are of the size of `rates` (n,), and smaller.
    """
    system, n, finite = problem.system, problem.system.n, list[list[bool]]()
    for k in range(CHECKED_VELOCITIES):
        size = 10.0 ** (-6 * k / (CHECKED_VELOCITIES - 1))  # some stay below a limit
        v = np.cos(np.arange(1.0 + k * n, 1 + (k + 1) * n)) * rates * size
        state = *first_state(system, q[None], v[None]), np.full((1, 1), t), problem.packed
        with np.errstate(all="ignore"):
            values = system.pointwise("first")(*state)[::-1]
            if system.structure.forced:
                values = values + system.pointwise("force")(*state)
        finite.append([bool(np.isfinite(x).all()) for x in values])
        if all(finite[-1]):
            return ""
    names, known = ("L", "dL/dv", "dL/dq", "the force"), zip(*finite, strict=True)
    return next((x for x, good in zip(names, known, strict=False) if not any(good)), "L")
