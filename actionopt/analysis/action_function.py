"""The discrete action of a solution as a function of CasADi's, and the program that it belongs to.

On the mesh of the solution, of the coordinates Q (n, K) at its nodes,

    S(Q) = sum_e (h_e / 2) sum_k w_k L(q_k, v_k, t_k),    v_k = (2 / h_e) sum_j D_kj q_j.
"""

from __future__ import annotations

import casadi as ca
import numpy as np

from actionopt.discrete.action.transcription import Transcription
from actionopt.discrete.meshes.path import Path
from actionopt.mechanics.laws.functions import ParameterInputs
from actionopt.mechanics.question.problem import Problem
from actionopt.mechanics.system import System
from actionopt.tools.types import Array


def action_function(problem: Problem, tr: Transcription) -> ca.Function:
    """Return S, its gradient and its Hessian as `Solution.action_function` says."""
    _check(problem)
    system = problem.system
    given = ParameterInputs.of(system.table, problem.parameters, ["Q", "S", "gradient", "hessian"])
    Q = ca.MX.sym("Q", system.n, tr.layout.node_count)
    S = _integral(system, system.L, tr, Q, given.packed)
    hessian, gradient = ca.hessian(S, Q)
    return ca.Function(
        "action",
        [Q, *given.symbols],
        [S, ca.reshape(gradient, Q.shape), hessian],
        ["Q", *given.names],
        ["S", "gradient", "hessian"],
        {"default_in": [0.0, *given.defaults]},
    )


def opti(problem: Problem, path: Path, tr: Transcription) -> tuple[ca.Opti, ca.MX]:
    """Return the program that asks for a path of least action, as `Solution.opti` says."""
    _check(problem)
    _check_program(problem)
    system, mesh, program = problem.plain or problem.system, path.mesh, ca.Opti()
    s, known = system.symbols, {name: problem.parameters[name] for name in system.table.shapes}
    packed = ca.DM(system.table.pack(known)).T
    Q = program.variable(system.n, mesh.nodes.size)
    program.minimize(_integral(system, system.L, tr, Q, packed))
    events = problem.start, *problem.through, problem.end
    for event, k in zip(events, tr.joints, strict=True):
        for i in event.pinned:
            program.subject_to(Q[i, k] == event.q[i])
    if problem.integral is not None:
        values = ca.DM(np.array(problem.integral))
        program.subject_to(_integral(system, system.g, tr, Q, packed) == values)
    rows = ca.Function("rows", [s.q, s.t, s.p], [system.f, system.outside])
    given = {k for event, k in zip(events, tr.joints, strict=True) if len(event.pinned) == system.n}
    for k in range(mesh.nodes.size) if system.m or system.r else ():
        f, outside = rows(Q[:, k], mesh.nodes[k], packed)
        if system.m and k not in given:
            program.subject_to(f == 0)
        if system.r and k not in given:
            program.subject_to(outside >= 0)
    program.set_initial(Q, path.values)
    return program, Q


def _check(problem: Problem) -> None:
    """Raise ValueError where more belongs to the discrete action than a sum of one law."""
    if not isinstance(problem, Problem) or problem.has_tails or problem.closes or problem.laws:
        raise ValueError(
            "expected a path between two events at finite times with one law, whose discrete "
            "action is a sum over its nodes, found one that closes, has an end at infinity or "
            "several systems; it is not written so"
        )


def _check_program(problem: Problem) -> None:
    """Raise ValueError where the path is not one of least action between events on its mesh."""
    asked = problem.original
    if problem.system.structure.forced:
        raise ValueError(
            "expected a system without non-conservative forces, found one that has some: their "
            "work is no part of an action that could be least; give the equations of motion to "
            "an Opti, by `system.dynamics_function()`"
        )
    if any(e.t is None or e.on is not None for e in (asked.start, *asked.through, asked.end)):
        raise ValueError(
            "expected events at given times and places, found one that gives none, or a surface: "
            "the mesh of the path stands at times that were found; `solution.action_function()` "
            "is the action there"
        )


def _integral(system: System, law: ca.SX, tr: Transcription, Q: ca.MX, p: ca.MX | ca.DM) -> ca.MX:
    """Return the integral of expressions (c, 1) along the path, (c, 1)."""
    s, (at, rates) = system.symbols, _samples(tr)
    function = ca.Function("law", [s.q, s.v, s.t, s.p], [law])
    return function.map(tr.times.size)(Q @ at, Q @ rates, tr.times.T, p) @ ca.DM(tr.weight)


def _samples(tr: Transcription) -> tuple[ca.DM, ca.DM]:
    """Return the matrices (K, evaluations) that map Q (n, K) to q and v where L is evaluated."""
    row: list[Array] = []
    col: list[Array] = []
    slopes: list[Array] = []
    for g in tr.layout.groups:
        E, size = g.nodes.shape
        into = np.arange(g.span.start, g.span.stop).reshape(E, size)
        D = g.rule.derivative[None] * (2 / tr.mesh.lengths[g.elements])[:, None, None]
        row.append(np.broadcast_to(g.nodes[:, None, :], D.shape).ravel())
        col.append(np.broadcast_to(into[:, :, None], D.shape).ravel())
        slopes.append(D.ravel())
    shape = tr.layout.node_count, tr.times.size
    rates = ca.DM.triplet(
        np.concatenate(row).tolist(), np.concatenate(col).tolist(), np.concatenate(slopes), *shape
    )
    each = np.arange(tr.times.size).tolist()
    return ca.DM.triplet(tr.layout.node_of.tolist(), each, np.ones(len(each)), *shape), rates
