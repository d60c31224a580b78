"""Along the branch between two members of a family."""

from dataclasses import replace

import numpy as np
import pytest
import systems

import actionopt as ao
from actionopt.families.continuation import continue_path, disagree
from actionopt.families.vary import with_values

BRATU = systems.bratu()


def bratu(lam):
    return with_values(BRATU, {"lam": lam})


@pytest.mark.parametrize(("lam", "turned"), [(3.5, False), (3.53, True)])
def test_the_branch_turns_back_at_the_fold(lam, turned):
    """Of Bratu's problem, at 3.5138307."""
    near = ao.solve(bratu(3.4))
    lost = replace(near, problem=bratu(lam), status=ao.Status.NOT_FOUND)
    found = continue_path(near, ({"lam": 3.4}, {"lam": lam}), lost, near.path, 1e-8)
    assert (found.turned, found.goes_on) == (turned, not turned)


def test_actions_change_as_their_slopes_tell():
    rise, before, after = np.array([2.0, 3.1, np.nan]), np.ones(3), 3 * np.ones(3)
    assert disagree(rise, before, after, 0.5).tolist() == [False, True, False]
