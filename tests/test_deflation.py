"""Other paths than those known, where all of them are known in closed form."""

import numpy as np
import pytest
from scipy.optimize import brentq

from actionopt.discrete.action.transcription import Transcription
from actionopt.discrete.meshes.mesh import Mesh
from actionopt.discrete.newton.newton import follow
from actionopt.families.searches.deflation import deflate
from actionopt.mechanics.question.problem import Event, Problem
from actionopt.mechanics.system import System

ACCURACY = 1e-8  # of degree 12 on four elements, for the steeper path
SLIDE = System(lambda q, v, t: v[0] ** 2 / 2 - np.exp(q[0]), ["x"])


def bratu(T):
    """Return both solutions of q'' = -exp(q), q(0) = q(T) = 0: peaks of one formula.

    q = -2 log(cosh((t / T - 1/2) k / 2) / cosh(k / 4)) with k = sqrt(2) T cosh(k / 4).
    """

    def gap(k):
        return k - np.sqrt(2) * T * np.cosh(k / 4)

    def peak(k):
        return lambda t: -2 * np.log(np.cosh((t / T - 0.5) * k / 2) / np.cosh(k / 4))

    top = 4 * np.arcsinh(4 / (np.sqrt(2) * T))
    return peak(brentq(gap, 0.0, top, xtol=1e-14)), peak(brentq(gap, top, 60.0, xtol=1e-14))


@pytest.mark.parametrize("T", [1.0, 1.7])
def test_the_other_path_is_found_and_no_third(T):
    mesh = Mesh.uniform(0.0, T, 4, 12)
    tr = Transcription(Problem(SLIDE, Event(0.0, [0.0]), Event(T, [0.0])), mesh, np.ones(1))
    low, high = bratu(T)
    first = follow(tr, tr.pack(low(mesh.nodes)[:, None])).z
    assert np.max(np.abs(tr.coordinates(first)[:, 0] - low(mesh.nodes))) <= ACCURACY
    start = tr.pack((low(mesh.nodes) + 0.3 * np.sin(np.pi * mesh.nodes / T))[:, None])
    assert deflate(tr, start, []) == pytest.approx(first, abs=1e-10)  # nothing keeps it away
    second = deflate(tr, start, [first])
    assert second is not None
    assert np.max(np.abs(tr.coordinates(second)[:, 0] - high(mesh.nodes))) <= ACCURACY
    assert deflate(tr, start, [first, second]) is None


def test_what_is_found_is_stationary_to_rounding():
    mesh = Mesh.uniform(0.0, 1.0, 4, 12)
    tr = Transcription(Problem(SLIDE, Event(0.0, [0.0]), Event(1.0, [0.0])), mesh, np.ones(1))
    found = deflate(tr, tr.pack(0.3 * np.sin(np.pi * mesh.nodes)[:, None]), [])
    assert found is not None
    assert np.max(np.abs(tr.residual(found))) < 1e-12


def test_steps_are_those_of_newtons_method_for_the_deflated_residual(monkeypatch):
    """(1 + 1 / |z - known|^2) R(z), linearised by differences, with the mean square for a norm."""
    mesh = Mesh.uniform(0.0, 1.0, 2, 5)
    tr = Transcription(Problem(SLIDE, Event(0.0, [0.0]), Event(1.0, [0.0])), mesh, np.ones(1))
    first = follow(tr, tr.pack(bratu(1.0)[0](mesh.nodes)[:, None])).z
    asked = []
    residual = tr.residual
    monkeypatch.setattr(tr, "residual", lambda z: asked.append(z) or residual(z))
    deflate(tr, first + 0.3 * np.sin(np.arange(1.0, first.size + 1)), [first])
    z, then = asked[:2]

    def held(z):
        return (1 + 1 / np.mean((z - first) ** 2)) * residual(z)

    sides = [held(z + 1e-6 * row) - held(z - 1e-6 * row) for row in np.eye(z.size)]
    step = -np.linalg.solve(np.transpose(sides) / 2e-6, held(z))
    assert np.max(np.abs(step)) < 1.0  # longer ones are cut
    assert then - z == pytest.approx(step, rel=1e-5, abs=1e-8)
