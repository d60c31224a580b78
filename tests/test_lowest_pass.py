"""Curves over the lowest pass between two places, against passes known by hand."""

import numpy as np
import pytest

import actionopt as ao
from actionopt.solver.durations import explain_rest
from actionopt.solver.first_paths import straight
from actionopt.solver.lowest_pass import lowest_pass


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
    curve, height = lowest_pass(problem, straight(problem))
    # V is 1 on the straight line; points 1/40 of a way apart miss the top by less than a hundredth
    assert 0.75 - 0.01 < height + 0.5 < 0.8
    np.testing.assert_allclose(curve[[0, -1]], straight(problem)[[0, -1]], rtol=0, atol=1e-15)
    high = wells(0.85, n)
    curve, height = lowest_pass(high, straight(high))
    assert height < 0
    assert np.all((np.sum(curve**2, axis=1) - 1) ** 2 + np.sum(curve[:, 1:] ** 2, axis=1) < 0.85)


@pytest.mark.long
def test_an_energy_below_all_passes_is_told():
    with pytest.raises(
        ao.SolveError, match=r"the energy 0\.5 is below the potential, 0\.7.* which"
    ):
        ao.solve(wells(0.5))


HILLS = ao.System(lambda q, v, t: v[0] ** 2 / 2 + (1 - q[0] ** 2) ** 2 / 2, ["x"])  # rest at 1, -1
LOOP = ao.System(lambda q, v, t: v[0] ** 2 / 2 + q[0] ** 2 / 2 - q[0] ** 4 / 4, ["x"])
EVER = ao.Event(-np.inf, [-1.0])


@pytest.mark.parametrize(
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
