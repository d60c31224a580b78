"""Where a Lagrangian jumps in time, and the velocity beyond."""

import numpy as np
import pytest
from helpers import at_once

from actionopt import State, System
from actionopt.mechanics.question.jumps import across, jumps


def found(lagrangian, t0=0.0, t1=1.0, n=1, q=0.7, v=1.3, **options):
    """Return the instants seen from 64 intervals, along which the motion stands still."""
    system = System(lagrangian, ["x", "y"][:n], **options)
    return jumps(system, None, np.linspace(t0, t1, 65), np.full((n, 64), q), np.full((n, 64), v))


@pytest.mark.long
@pytest.mark.parametrize("c", [0.3141592, 0.25, 1 / 3, 1e-9, 1 - 1e-9])
def test_the_two_times_are_neighbours(c):
    """A mass, a force, and a gyroscopic term, that belong to either side of the time c."""
    laws = (
        lambda q, v, t: np.where(t > c, 3.0, 1.0) * v[0] ** 2 / 2,
        lambda q, v, t: v[0] ** 2 / 2 + np.where(t > c, 5.0, 0.0) * q[0],
        lambda q, v, t: v[0] ** 2 / 2 + np.where(t > c, q[0] * v[0], 0.0),
    )
    for lagrangian in laws:
        assert found(lagrangian) == [(c, np.nextafter(c, 2.0))]
    at_once = found(lambda q, v, t: np.where(t >= c, 3.0, 1.0) * v[0] ** 2 / 2)
    assert at_once == [(np.nextafter(c, 0.0), c)]


def test_several_jumps_are_found_in_order():
    instants = found(lambda q, v, t: v[0] ** 2 / 2 + np.floor(4 * t) * q[0])
    assert [after for _, after in instants] == [0.25, 0.5, 0.75, 1.0]
    close = found(
        lambda q, v, t: (np.where(t > 0.3, 1.0, 0.0) + np.where(t > 0.301, 1.5, 1.0)) * v[0] ** 2
    )
    assert [before for before, _ in close] == [0.3, 0.301]


def test_times_far_from_zero():
    c = 1e9 + 0.3
    assert found(lambda q, v, t: np.where(t > c, 3.0, 1.0) * v[0] ** 2 / 2, 1e9, 1e9 + 2) == [
        (c, np.nextafter(c, 2e9))
    ]


def test_a_rate_of_the_constraint_jumps():
    instants = found(
        lambda q, v, t: v @ v / 2,
        n=2,
        constraint=lambda q, t: q[1] - np.where(t > 0.3, 2 * (t - 0.3), 0.0) * q[0],
    )
    assert instants == [(0.3, np.nextafter(0.3, 1.0))]


@at_once(
    "lagrangian",
    [
        lambda q, v, t: v[0] ** 2 / 2 - np.abs(q[0]),  # no time in it
        lambda q, v, t: v[0] ** 2 / 2 + np.abs(t - 0.3) * q[0],  # a kink
        lambda q, v, t: v[0] ** 2 / 2 + np.exp(-(((t - 0.3) / 1e-3) ** 2)) * np.abs(q[0]),
        lambda q, v, t: (2 + np.tanh((t - 0.3) * 1e8)) * v[0] ** 2 - np.abs(q[0]),  # steep
        lambda q, v, t: np.cos(300 * t) * v[0] ** 2 - np.abs(q[0]),  # fast
        lambda q, v, t: np.where(q[0] > 0, 1.0, 2.0) * v[0] ** 2 + t * q[0],  # in q
    ],
)
def test_what_is_no_jump_in_time(lagrangian):
    assert found(lagrangian) == []


def test_the_momentum_is_kept_and_not_the_velocity():
    system = System(
        lambda q, v, t, *, m: (
            np.where(t > 0.3, m, 1.0) * v[0] ** 2 / 2 + np.where(t > 0.3, q[0] * v[0], 0)
        ),
        ["x"],
        parameters={"m": 3.0},
    )
    before = State(0.3, [0.5], [1.2])
    beyond = across(system, {"m": 2.0}, before, np.nextafter(0.3, 1.0))
    assert beyond.t == np.nextafter(0.3, 1.0)
    assert beyond.q == pytest.approx(before.q, rel=1e-15)
    assert beyond.v == pytest.approx((1.2 - 0.5) / 2.0, rel=1e-15)  # 2 v + q = 1.2
