"""The least way to a rest may lead over another one, where a motion would stay."""

import numpy as np
import pytest

import actionopt as ao
from actionopt.solver.kinds.between import Choices
from actionopt.solver.kinds.rest_between import path_to_rest
from actionopt.solver.search.strategies import STRATEGIES

# V = -(1 - x^2)^2 / 2 - y^2 / 2 is highest, and zero, at rest at x = 1 and x = -1
TOPS = ao.System(lambda q, v, t: v @ v / 2 + (1 - q[0] ** 2) ** 2 / 2 + q[1] ** 2 / 2, ["x", "y"])
REST = ao.Event(np.inf, [1.0, 0.0])
PLAIN = Choices(1e-8, "auto", STRATEGIES, None, None)


@pytest.mark.parametrize("backwards", [False, True])
def test_the_least_way_leads_over_another_rest(backwards):
    event = ao.Event(0.0, [-1.8, 0.0])
    ends = (ao.Event(-np.inf, REST.q), event) if backwards else (event, REST)
    path, reason = path_to_rest(ao.Problem(TOPS, *ends), PLAIN)
    assert path is None and "over x = -1, y = " in reason


def test_a_path_to_rest_that_passes_no_other_is_near_the_motion():
    problem = ao.Problem(TOPS, ao.Event(0.0, [-0.5, 0.0]), REST)
    path, reason = path_to_rest(problem, PLAIN)
    # x' = 1 - x^2
    x = np.tanh(1.5 + np.arctanh(-0.5))
    assert not reason and path is not None and abs(path(1.5)[0] - x) < 1e-3


@pytest.mark.long
def test_what_is_behind_another_rest_is_told_soon():
    problem = ao.Problem(TOPS, ao.Event(0.0, [-1.8, 0.1]), REST)
    with pytest.raises(ao.SolveError, match="the least way found leads over x = -1"):
        ao.solve(problem)
