"""The KKT matrix, in blocks and sparse, against the one that `simple` derives symbol by symbol."""

import casadi as ca
import numpy as np
import pytest

from actionopt import simple
from actionopt.discrete.action.transcription import Transcription
from actionopt.discrete.matrices.factors import kkt_nonzeros
from actionopt.discrete.meshes.mesh import Mesh
from actionopt.mechanics.question.problem import Event, Problem
from actionopt.mechanics.system import System

ROUNDING = 1e-13  # of the largest entry; each is a sum of a dozen terms
LENGTHS = np.array([0.7, 3.0])


def lagrangian(q, v, t):
    (x, y), (u, w) = q, v
    return (1 + y**2) * u**2 / 2 + w**2 + u * w * np.cos(x) - (1 + t) * np.sin(x * y) + x**2 * w


LAWS = {
    "plain": {},
    "surface": {"constraint": lambda q, t: [q[0] ** 2 * q[1] + np.sin(q[1]) - t]},
    "force": {"force": lambda q, v, t: [q[1] - v[0] * np.sqrt(1 + v[0] ** 2), -t * v[1] * q[0]]},
}
LAWS["both"] = LAWS["surface"] | LAWS["force"]


@pytest.mark.long
@pytest.mark.parametrize("laws", LAWS)
@pytest.mark.parametrize("storage", ["blocks", "sparse"])
def test_entries_are_those_of_the_symbolic_derivative(laws, storage, monkeypatch):
    if storage == "sparse":
        monkeypatch.setattr("actionopt.discrete.matrices.layout.BLOCK_SIZE", 0)
        monkeypatch.setattr("actionopt.discrete.matrices.layout.FILLED", 1.0)
    system = System(lagrangian, ["x", "y"], **LAWS[laws])
    problem = Problem(system, Event(0.5, [0.3, None]), Event(2.0, [None, 0.4]))
    tr = Transcription(problem, Mesh.uniform(0.5, 2.0, 3, 4), LENGTHS)
    layout = tr.layout
    assert layout.storage == storage
    z = np.random.default_rng(0).uniform(-0.4, 0.4, layout.size)
    found, pattern = np.zeros((layout.size, layout.size)), layout.kkt
    found[pattern.row, pattern.col] = kkt_nonzeros(layout, tr.kkt(z))

    Q, lam = tr.unpack(z)
    given = LAWS[laws].get("constraint"), LAWS[laws].get("force")
    equations = simple.transcribe(lagrangian, *given, tr.mesh.nodes, 4, 2)
    S, r, known = map(ca.DM.full, equations(np.concatenate([Q.ravel(), lam.ravel()])))
    free = np.r_[layout.free, Q.size : Q.size + lam.size]  # a surface has a row at every node
    unit = np.concatenate([tr.x_unit, tr.mu_unit]) / tr.action_unit
    known = unit[:, None] * known[np.ix_(free, free)] * (unit * tr.action_unit)
    assert np.max(np.abs(found - known)) <= ROUNDING * np.max(np.abs(known))
    assert np.max(np.abs(tr.residual(z) - unit * r[free, 0])) <= ROUNDING * np.max(np.abs(known))
    assert tr.action(z) * tr.action_unit == pytest.approx(S.item(), rel=ROUNDING)


@pytest.mark.parametrize("storage", ["blocks", "sparse"])
def test_momenta_of_a_variation_work_as_its_velocities_say(storage, monkeypatch):
    if storage == "sparse":
        monkeypatch.setattr("actionopt.discrete.matrices.layout.BLOCK_SIZE", 0)
        monkeypatch.setattr("actionopt.discrete.matrices.layout.FILLED", 1.0)
    problem = Problem(System(lagrangian, ["x", "y"]), Event(0.5, [0.3, None]), Event(2.0, [0.1, 2]))
    tr = Transcription(problem, Mesh.uniform(0.5, 2.0, 3, 4), LENGTHS)
    assert tr.layout.storage == storage
    one, other = np.random.default_rng(1).uniform(-0.4, 0.4, (2, tr.layout.unknowns))
    v, w = (
        tr.velocities((tr.coordinates(y) - tr.coordinates(0 * y))[tr.layout.node_of]).T
        for y in (one, other)
    )
    x, y = 0.2, 2.0  # half way on the straight line, where the typical mass matrix is taken
    momentum = (1 + y**2) * v[0] + np.cos(x) * v[1], np.cos(x) * v[0] + 2 * v[1]
    known = np.sum(tr.weight[:, 0] * (momentum[0] * w[0] + momentum[1] * w[1])) / tr.action_unit
    assert other @ tr.momentum(one) == pytest.approx(known, rel=ROUNDING)
