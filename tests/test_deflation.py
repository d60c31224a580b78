"""Newton's method that keeps away from what is known, on a path with two partners."""

import numpy as np
import pytest

from actionopt import Event, Mesh, Problem, System
from actionopt.discrete.transcription import Transcription
from actionopt.families.deflation import deflated

# x'' = -x^3 between x(0) = x(1) = 0: the path at rest, and oscillations of either sign.
QUARTIC = System(lambda q, v, t: v[0] ** 2 / 2 - q[0] ** 4 / 4, ["x"])


@pytest.fixture
def tr():
    problem = Problem(QUARTIC, Event(0.0, [0.0]), Event(4.0, [0.0]))
    return Transcription(problem, Mesh.uniform(0.0, 4.0, 8, 8), np.ones(1))


def wave(tr, size):
    return tr.pack(size * np.sin(np.pi * tr.mesh.nodes / 4)[:, None])


def test_what_is_found_is_stationary_to_rounding(tr):
    found = deflated(tr, wave(tr, 1.5), [])
    assert found is not None
    assert np.max(np.abs(tr.residual(found))) < 1e-12


def test_a_known_path_is_not_found_again(tr):
    first = deflated(tr, wave(tr, 1.5), [])
    second = deflated(tr, wave(tr, 1.5), [first])
    assert first is not None and second is not None
    assert np.max(np.abs(second - first)) > 1e-2
    assert np.max(np.abs(tr.residual(second))) < 1e-12
