"""Steps of forces that lie between two samples of a path are not passed over in silence."""

import numpy as np
import pytest

import actionopt as ao

MIDDLE, WIDTH = 0.249, 3e-4


@pytest.mark.parametrize(
    ("work", "seen"), [pytest.param(-0.158, False, marks=pytest.mark.long), (-1e-11, True)]
)
def test_a_narrow_force(work, seen):
    # The path that sees none of it is off by about the work, where the motion is slower behind it.
    def force(q, v, t):
        apart = np.sign(q[0] - MIDDLE + WIDTH) - np.sign(q[0] - MIDDLE - WIDTH)
        return [work / (2 * WIDTH) * apart / 2 - 0.1 * v[0]]

    spring = ao.System(lambda q, v, t: (v[0] ** 2 - 2.63 * q[0] ** 2) / 2, ["x"], force=force)
    asked = ao.Problem(spring, ao.Event(0.0, [0.0]), ao.Event(1.0, [1.0]))
    found = ao.solve(asked, throw=False)
    assert found.success == seen
    assert (found.status is ao.Status.UNRESOLVED) != seen
