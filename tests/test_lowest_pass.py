"""Curves over the lowest pass between two places, against passes known by hand."""

import numpy as np
import pytest
from helpers import at_once

import actionopt as ao
from actionopt.solver.ends.durations import barrier, explain_rest
from actionopt.solver.ends.lowest_pass import explain_leg, lowest_pass
from actionopt.solver.kinds.first_paths import straight


def wells(energy, n=2, mass=1.0):
    """Return a question between two wells whose pass, V = 3/4, is half a square root of 2 aside."""

    def L(q, v, t):
        return mass * (v @ v) / 2 - (q @ q - 1) ** 2 - q[1:] @ q[1:]

    ends = np.eye(n)[0]
    system = ao.System(L, [f"x{k}" for k in range(n)])
    return ao.Problem(system, ao.Event(0.0, -ends), ao.Event(None, ends), energy=energy)


@pytest.mark.parametrize("n", [2, 3])
def test_the_height_of_a_pass(n):
    problem = wells(0.5, n, mass=1e6)
    curve, height = lowest_pass(problem, straight(problem), 0.5)
    # V is 1 on the straight line; points 1/40 of a way apart miss the top by less than a hundredth
    assert 0.75 - 0.01 < height + 0.5 < 0.8
    np.testing.assert_allclose(curve[[0, -1]], straight(problem)[[0, -1]], rtol=0, atol=1e-15)
    high = wells(0.85, n)
    curve, height = lowest_pass(high, straight(high), 0.85)
    assert height < 0
    assert np.all((np.sum(curve**2, axis=1) - 1) ** 2 + np.sum(curve[:, 1:] ** 2, axis=1) < 0.85)


def test_the_height_of_a_narrow_pass():
    """V = (1 + y^2) exp(-x^2 / 2 w^2) is 1 at its pass, to either side of which points slide."""

    def ridge(q, v, t):
        return v @ v / 2 - (1 + q[1] ** 2) * np.exp(-(q[0] ** 2) / (2 * 0.25**2))

    start, end = ao.Event(0.0, [-2.03, 0.4]), ao.Event(None, [2.0, 0.3])
    problem = ao.Problem(ao.System(ridge, ["x", "y"]), start, end, energy=0.9)
    assert 0 < lowest_pass(problem, straight(problem), 0.9)[1] < 0.1


@pytest.mark.long
def test_an_energy_below_all_passes_is_told():
    with pytest.raises(
        ao.SolveError, match=r"the energy 0\.5 is below the potential, 0\.7.* which"
    ):
        ao.solve(wells(0.5))


HILLS = ao.System(lambda q, v, t: v[0] ** 2 / 2 + (1 - q[0] ** 2) ** 2 / 2, ["x"])  # rest at 1, -1
LOOP = ao.System(lambda q, v, t: v[0] ** 2 / 2 + q[0] ** 2 / 2 - q[0] ** 4 / 4, ["x"])
EVER = ao.Event(-np.inf, [-1.0])


@at_once(
    ("problem", "passed"),
    [
        (ao.Problem(HILLS, EVER, ao.Event(0.0, [2.0])), "1 on its way to 2"),
        (ao.Problem(HILLS, EVER, ao.Event(0.0, [0.999])), ""),
        (ao.Problem(HILLS, EVER, ao.Event(np.inf, [1.0])), ""),
        (ao.Problem(LOOP, ao.Event(-np.inf, [0.0]), ao.Event(0.0, [1.5])), "1.49633 on its way"),
        (ao.Problem(LOOP, ao.Event(-np.inf, [0.0]), ao.Event(0.0, [1.4])), ""),
        (ao.Problem(LOOP, ao.Event(-np.inf, [0.0]), ao.Event(np.inf, [0.0])), ""),
    ],
)
def test_what_a_motion_from_rest_does_not_pass(problem, passed):
    # on the loop x^2 = x^4 / 2 where it turns, at a square root of 2
    reason = explain_rest(problem)
    assert (passed in reason) if passed else not reason


def test_an_event_beyond_a_rest_is_told():
    with pytest.raises(ao.SolveError, match="does not pass x = 1 on its way to 2"):
        ao.solve(ao.Problem(HILLS, EVER, ao.Event(0.0, [2.0])))


def ridges(hill):
    """Return a system in x, y with rests at x = 1, -1, of energy zero, and a hill between."""

    def L(q, v, t):
        away = q[0] ** 2 + (q[1] - 0.5) ** 2
        flat = (1 - q[0] ** 2) ** 2
        return v @ v / 2 + flat / 2 + q[1] ** 2 / 2 - flat * hill(away)

    return ao.System(L, ["x", "y"])


HILL = ridges(lambda away: 3 * np.exp(-8 * away))
RING = ridges(lambda away: 120 * away * np.exp(-20 * away))  # 2.2 at a distance of 0.22


def test_round_off_is_no_barrier_between_rests_of_one_energy():
    """Where cos(pi / 2)^2 is not quite zero: a path leads from rest to rest, with S = 2."""
    waves = ao.System(lambda q, v, t: v @ v / 2 + (np.sin(q[0]) ** 2 + q[1] ** 2) / 2, ["x", "y"])
    ever, after = ao.Event(-np.inf, [0.0, 0.0]), ao.Event(np.inf, [np.pi, 0.0])
    assert not explain_rest(ao.Problem(waves, ever, after))
    turning = ao.System(lambda q, v, t: (v @ v + q @ q) / 2 - (q @ q) ** 2 / 4, ["x", "y"])
    back = ao.Problem(turning, ever, ao.Event(0.0, [2**0.5, 0.0]))  # where V is 2e-16
    assert not explain_rest(back)
    assert not barrier(back, turning, np.array([back.end.q]), 0.0)


@pytest.mark.parametrize(
    ("system", "place", "told"),
    [
        # 3 - 1/2 - 1/8 and 3 e^{-2} - 1/2 - 1/2
        (HILL, [0.0, 0.5], "does not pass x = 0, y = 0.5, where the potential is 2.375"),
        (HILL, [0.0, 1.0], ""),
        (RING, [0.0, 0.5], ""),
    ],
)
def test_a_motion_from_rest_has_its_energy_in_several_coordinates(system, place, told):
    reason = explain_rest(ao.Problem(system, ao.Event(0.0, place), ao.Event(np.inf, [1.0, 0.0])))
    assert (told in reason) if told else not reason


@pytest.mark.parametrize(
    ("system", "place", "told"),
    [(RING, [0.0, 0.5], "the energy 0 is below the potential"), (HILL, [-0.9, 0.1], "")],
)
def test_a_way_from_rest_is_shut_where_no_pass_is_seen(system, place, told):
    # the straight line from (-0.9, 0.1) to (1, 0) leads over the hill, others beside it
    problem = ao.Problem(system, ao.Event(0.0, place), ao.Event(np.inf, [1.0, 0.0]))
    assert explain_leg(problem).startswith(told) and bool(explain_leg(problem)) == bool(told)


@pytest.mark.long
def test_what_is_shut_off_from_a_rest_is_told_soon():
    problem = ao.Problem(RING, ao.Event(0.0, [0.02, 0.5]), ao.Event(np.inf, [1.0, 0.0]))
    with pytest.raises(ao.SolveError, match="on the lowest of the curves"):
        ao.solve(problem)
