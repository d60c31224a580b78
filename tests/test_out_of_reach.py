"""Questions without an answer: that no motion comes to the end is seen, and said at once."""

import numpy as np
import pytest
from helpers import motion

import actionopt as ao
from actionopt.solver.search.out_of_reach import is_out_of_reach


def bratu(n: int, strength: float) -> ao.Problem:
    """Return the question of Bratu, of one or two coordinates; it has no answer beyond a fold."""
    system = ao.System(
        lambda q, v, t, *, lam: v @ v / 2 - lam * np.sum(np.exp(q)), list("xy"[:n]),
        parameters={"lam": strength},
    )  # fmt: skip
    return ao.Problem(system, ao.Event(0.0, [0.0] * n), ao.Event(1.0, [0.0] * n))


def beyond_a_wall(end: float) -> ao.Problem:
    """Return the question of a body beside a wall without a gap, at x = 0."""
    system = ao.System(lambda q, v, t: v @ v / 2 - 0.1 / q[0] ** 2 - q[1] ** 2 / 2, ["x", "y"])
    return ao.Problem(system, ao.Event(0.0, [-1.0, 0.2]), ao.Event(1.0, [end, -0.3]))


@pytest.mark.parametrize(
    ("problem", "out"),
    [
        (bratu(1, 3.5), False),  # the fold is at 3.5138
        (bratu(1, 3.53), True),
        (bratu(2, 3.0), False),
        (bratu(2, 5.0), True),
        (beyond_a_wall(-0.5), False),
        (beyond_a_wall(0.5), True),
    ],
)
def test_an_end_is_out_of_reach_beyond_a_fold_and_a_wall(problem, out):
    assert is_out_of_reach(problem, None) is out


def test_motions_through_a_narrow_force_rule_nothing_out():
    """They pass it unseen; one that is slowed by the step comes to the end."""
    system = ao.System(lambda q, v, t: v[0] ** 2 / 2 - 30 * np.tanh(q[0] / 1e-7), ["x"])
    assert not is_out_of_reach(
        ao.Problem(system, ao.Event(0.0, [-1.0]), ao.Event(1.0, [1.0])), None
    )


@pytest.mark.quick("problem0")
@pytest.mark.parametrize("problem", [bratu(1, 4.0), bratu(2, 5.0)])
def test_a_question_without_an_answer_is_not_searched_on(problem):
    refused = ao.solve(problem, throw=False)
    assert refused.status is ao.Status.NOT_FOUND
    assert sum(refused.stats["iterations"].values()) < 40  # a search takes hundreds
    with pytest.raises(ao.SolveError, match="no motion from the start"):
        ao.solve(problem)


def through_a_gap(q, v, t):
    """Return L of a body beside a wall at x = 0 that has a gap at y = -0.4."""
    gap = 0.1 * np.exp(-((31 * q[1] + 12.8) ** 2))
    return v @ v / 2 - 0.2 * q[1] ** 2 - 0.014 / (q[0] ** 2 + gap)


def round_a_centre(q, v, t):
    return (v[0] ** 2 + (q[0] * v[1]) ** 2) / 2 + 3.55 / q[0]


def over_a_bump(q, v, t):
    """Return L of an oscillator and a slight bump: ends of motions are near one another."""
    return (v @ v - q @ q) / 2 - 5e-4 * np.exp(-30 * ((q[0] + 0.85) ** 2 + (q[1] + 0.17) ** 2))


@pytest.mark.quick("through_a_gap-q0-v0-1.02", "over_a_bump-q2-v2-9.394")
@pytest.mark.parametrize(
    ("law", "q", "v", "T"),
    [
        (through_a_gap, [-1.0, 0.19], [1.12, -0.67], 1.02),
        (round_a_centre, [1.515, 0.0], [-1.093, 0.0666], 0.915),
        (over_a_bump, [-0.71, -0.034], [4.97, -1.70], 9.394),
    ],
)
def test_an_end_to_which_few_motions_lead_is_not_out_of_reach(law, q, v, T):
    system = ao.System(law, ["x", "y"])
    end = motion(system, q, v, 0.0, T)(T)
    assert not is_out_of_reach(ao.Problem(system, ao.Event(0.0, q), ao.Event(T, end)), None)
