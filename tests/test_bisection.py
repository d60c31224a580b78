"""Bisection down to neighbouring floats."""

import numpy as np

from actionopt.tools.bisection import bisect


def test_a_change_is_found_between_two_floats_that_are_neighbours_in_each_interval():
    squares = np.array([2.0, 3.0])
    low, high = bisect(np.ones(2), np.full(2, 2.0), lambda x: x**2 < squares)
    assert (low**2 < squares).all() and (high**2 >= squares).all()
    assert (high == np.nextafter(low, 2.0)).all()
