"""Curves over the lowest pass between two places, against passes known by hand."""

import numpy as np
import pytest

import actionopt as ao
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
