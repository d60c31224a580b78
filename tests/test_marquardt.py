"""Steps that keep what is slow: against dense least squares, and where Newton's method is lost."""

import numpy as np
import pytest
from helpers import at_once

from actionopt import scenes
from actionopt.discrete.action.transcription import Transcription
from actionopt.discrete.matrices.factors import full
from actionopt.discrete.meshes.mesh import Mesh
from actionopt.discrete.newton.marquardt import _Masses, settle
from actionopt.mechanics.question.problem import Event, Problem
from actionopt.mechanics.system import System

MESH = Mesh(np.array([0.0, 0.4, 1.0]), (3, 4))
KINDS = {
    "plain": {},
    "forced": {"force": lambda q, v, t: -0.3 * v * (1 + q @ q)},
    "constrained": {"constraint": lambda q, t: [q[0] ** 2 + 2 * q[1] ** 2 - 3]},
}


def lagrangian(q, v, t):
    """Masses that depend on the place, and are coupled."""
    a, b = 2 + np.sin(q[0]), 1 + q[1] ** 2
    return (a * v[0] ** 2 + b * v[1] ** 2) / 2 + 0.3 * v[0] * v[1] - q[0] ** 4 + q[0] * q[1]


def rough_path(kind):
    """A transcription, a point z of it, its mass matrix and KKT matrix in full."""
    system = System(lagrangian, ["x", "y"], **KINDS[kind])
    problem = Problem(system, Event(0.0, [1.0, 1.0]), Event(1.0, [-1.0, 1.0]))
    tr = Transcription(problem, MESH, np.array([1.0, 0.5]))
    z = np.random.default_rng(1).uniform(0.2, 1.5, tr.layout.size)
    Q = tr.coordinates(z)
    M = np.zeros((tr.layout.node_count, 2, 2))
    for g in MESH.groups:
        for e, nodes in zip(g.elements, g.nodes, strict=True):
            for k, weight in zip(nodes, g.rule.weights * MESH.lengths[e] / 2, strict=True):
                M[k] += weight * system.mass_matrix(Q[k], 0 * Q[k], MESH.nodes[k])
    full = np.zeros((2 * len(M), 2 * len(M)))
    for k, block in enumerate(M):
        full[2 * k : 2 * k + 2, 2 * k : 2 * k + 2] = block
    free = tr.layout.free
    M = full[np.ix_(free, free)] * np.outer(tr.x_unit, tr.x_unit) / tr.action_unit
    size = tr.layout.size
    A = np.stack([difference(tr, z, e) for e in np.eye(size)], axis=1)
    return tr, z, M, A


def difference(tr, z, direction, h=1e-6):
    """The derivative of the residual along a direction, by central differences."""
    return (tr.residual(z + h * direction) - tr.residual(z - h * direction)) / (2 * h)


@at_once("kind", KINDS)
@at_once("s", [0.1, 3.0])
def test_a_step_is_the_least_squares_one(kind, s):
    tr, z, M, A = rough_path(kind)
    cut, r = tr.layout.unknowns, tr.residual(z)
    root = np.linalg.cholesky(M)
    # Over dx and dmu, dx on the constraints' tangents: particular solution and null space.
    J = A[cut:, :cut]
    particular = -np.linalg.pinv(J) @ r[cut:]
    Z = np.linalg.svd(J)[2][len(J) :].T if len(J) else np.eye(cut)
    basis = np.zeros((tr.layout.size, Z.shape[1] + len(J)))
    basis[:cut, : Z.shape[1]], basis[cut:, Z.shape[1] :] = Z, np.eye(len(J))
    start = np.concatenate([particular, np.zeros(len(J))])
    rows = np.concatenate(
        [np.linalg.solve(root, A[:cut] @ basis), s * root.T @ basis[:cut]], axis=0
    )
    right = np.concatenate(
        [np.linalg.solve(root, r[:cut] + A[:cut] @ start), s * root.T @ particular]
    )
    known = start - basis @ np.linalg.lstsq(rows, right, rcond=None)[0]
    found = _Masses.of(tr, z).step(z, s)
    assert np.allclose(found, known, rtol=0, atol=1e-6 * np.max(np.abs(known)))


@pytest.mark.parametrize("kind", KINDS)
def test_multipliers_are_those_of_least_residual(kind):
    tr, z, M, A = rough_path(kind)
    cut, root = tr.layout.unknowns, np.linalg.cholesky(M)
    g = np.linalg.solve(root, tr.gradient(z[:cut]))
    J = np.linalg.solve(root, A[:cut, cut:])
    mu = -np.linalg.lstsq(J, g, rcond=None)[0] if J.size else np.zeros(0)
    found, norm = _Masses.of(tr, z).balance(z[:cut])
    assert np.array_equal(found[:cut], z[:cut])
    assert np.allclose(found[cut:], mu, rtol=0, atol=1e-6 * np.max(np.abs(mu), initial=1.0))
    assert norm == pytest.approx(np.linalg.norm(g + J @ mu), rel=1e-6)


def test_nothing_moves_where_a_mass_is_missing():
    system = System(lambda q, v, t: v[0] ** 2 / 2 - q[0] ** 2 * q[1] ** 2 + q[1], ["x", "y"])
    problem = Problem(system, Event(0.0, [1.0, 1.0]), Event(1.0, [0.5, None]))
    tr = Transcription(problem, MESH, np.ones(2))
    z = np.full(tr.layout.size, 0.7)
    found = settle(tr, z)
    assert not found.near and found.iterations == 0 and found.z is z


@pytest.mark.long
def test_a_guess_near_a_path_takes_newton_steps_alone(monkeypatch):
    """All links of a chain turned evenly: along its slowest oscillation, but for the clock."""
    monkeypatch.setattr(_Masses, "step", None)
    scene = scenes.get("chain", links=12)
    problem = scene.problem
    mesh = Mesh.uniform(problem.start.t, problem.end.t, 8, 6)
    tr = Transcription(problem, mesh, problem.lengths)
    found = settle(tr, tr.pack(scene.guess(mesh.nodes).T))
    assert found.near and found.iterations <= 4
    step = np.linalg.solve(full(tr.layout, tr.kkt(found.z)), tr.residual(found.z))
    assert np.max(np.abs(step[: tr.layout.unknowns])) < 1e-3
