"""A pendulum that goes over the top a random number of times, between random angles.

Its energy above that of the top is drawn from five decades: with little more it dwells there, turn
after turn. The motion is an elliptic amplitude, and no other turns as often.
"""

from __future__ import annotations

import numpy as np
from scipy.special import ellipj, ellipkinc

import actionopt as ao
from benchmarks.stress.case import Case, Criterion, Question, beside, mine, within

TITLE = "Pendulums of many turns"
COUNTS = (40, 2)  # all, and quick
TURNS = 12  # at most
ABOVE = -4, 1  # decades of the energy above that at the top, in units of m g l
TOL, WRONG = 1e-9, 1e-8
SEED = 23


def question(k: int) -> Question:
    """Return one, with its exact path."""
    rng = np.random.default_rng([SEED, k])
    a, b = rng.uniform(-2, 2, 2)
    b += 2 * np.pi * rng.integers(1, TURNS + 1)
    m = 2 / (2 + 10 ** rng.uniform(*ABOVE))  # sin^2 of half the angle, over 1 / m, in sn
    clock = lambda angle: ellipkinc(angle / 2, m) * np.sqrt(m)  # noqa: E731
    system = ao.System(lambda q, v, t: v[0] ** 2 / 2 + np.cos(q[0]), ["phi"])
    return Question(
        ao.Problem(system, ao.Event(0.0, [a]), ao.Event(clock(b) - clock(a), [b])),
        lambda t: 2 * ellipj((t + clock(a)) / np.sqrt(m), m)[3][None],
        tol=TOL,
    )


def cases(quick: bool) -> list[Case]:
    """Return them."""
    return [Case(f"turns {k}", lambda k=k: question(k)) for k in range(COUNTS[quick])]


def criteria(rows) -> list[Criterion]:
    """Return them."""
    others = (beside(rows, solver, WRONG) for solver in ("solve_bvp", "shooting"))
    return [within(mine(rows), WRONG), *others]
