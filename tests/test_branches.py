"""The branches of Lagrangians with kinks: which kinks there are, and what holds on each side."""

import casadi as ca
import numpy as np
import pytest
from helpers import at_once

import actionopt as ao
from actionopt.mechanics.laws import branches


def of(potential, **more):
    law = ao.System(lambda q, v, t, **p: v @ v / 2 - potential(q, **p), ["x", "y"], **more)
    return law.branches


def test_laws_without_kinks_have_no_branches():
    assert of(lambda q: q @ q) is None
    assert ao.System(lambda q, v, t: abs(v[0]) - abs(q[0]), ["x"]).branches is None


@at_once(
    "potential, sides",
    [
        (lambda q: abs(q[0] - 1), {0: lambda x, y: 1 - x, 1: lambda x, y: x - 1}),
        (lambda q: np.fmax(q[0], 2 * q[1]), {0: lambda x, y: x, 1: lambda x, y: 2 * y}),
        (lambda q: np.fmin(q[0], 2 * q[1]), {0: lambda x, y: 2 * y, 1: lambda x, y: x}),
        (lambda q: np.where(q[0] > 1, q[0] - 1, 0), {0: lambda x, y: 0, 1: lambda x, y: x - 1}),
        (
            lambda q: ca.interpolant("V", "linear", [[0, 1, 2]], [0, 1, 4])(q[0]),
            {0: lambda x, y: x, 1: lambda x, y: 3 * x - 2},
        ),
    ],
)
def test_each_side_has_a_law(potential, sides):
    found = of(potential)
    for piece, law in sides.items():
        for q in ([0.3, -0.7], [1.6, 0.4]):
            got = -found.law((piece,)).lagrangian(q, [0.0, 0.0], 0.0)
            assert float(got) == pytest.approx(law(*q))
    at = np.array([[0.3, -0.7], [1.6, 0.4]])
    pieces = found.pieces(found.evaluate(at, np.zeros((2, 1)), np.zeros((1, 0)))[0])
    for q, (piece,) in zip(at, pieces, strict=True):
        assert sides[piece](*q) == pytest.approx(float(-found.system.lagrangian(q, q * 0, 0.0)))


def test_operations_are_read_once_for_all_sides(monkeypatch):
    found, read = of(lambda q: abs(q[0]) + np.interp(q[1], [0, 1, 3, 4], [0, 2, 1, 5])), []
    fold = branches._fold
    monkeypatch.setattr(branches, "_fold", lambda *given: read.append(1) or fold(*given))
    at = np.array([[0.5, 0.5], [-0.5, 2.0], [0.3, 3.5]])
    pieces = found.pieces(found.evaluate(at, np.zeros((3, 1)), np.zeros((1, 0)))[0])
    for q, row in zip(at, pieces.tolist(), strict=True):
        here, law = (float(s.lagrangian(q, q, 0.0)) for s in (found.system, found.law(row)))
        assert law == pytest.approx(here)
    assert sum(read) == 1
