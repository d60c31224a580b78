"""A test problem as a CasADi expression: the Lagrangian mapped over the nodes, in SX or MX.

Nothing of the transcription's derivatives enters: what is derived from the expression checks them.
"""

from __future__ import annotations

from typing import Any, Literal

import casadi as ca
import numpy as np

from actionopt.discrete.action.transcription import Transcription
from actionopt.suite.program import Program
from actionopt.tools.types import Array


def nlp(problem: Program, kind: Literal["SX", "MX"] = "MX") -> dict[str, Any]:
    """Return {"x", "f", "g"} for `casadi.nlpsol`: minimise f subject to g = 0.

    MX stays small at any size; SX is unrolled, and fast for small problems.

    Examples
    --------
    >>> from actionopt import suite
    >>> nlp(suite.get("oscillator", elements=2, degree=2))["x"].shape
    (3, 1)
    """
    x, f, g = problem.expression()
    symbol = ca.MX if kind == "MX" else ca.SX
    if not isinstance(x, symbol):
        function = ca.Function("nlp", [x], [f, g])
        x = symbol.sym("x", problem.n)
        f, g = (function if kind == "MX" else function.expand())(x)
    return {"x": x, "f": f, "g": g}


def action_expression(tr: Transcription, stretch: Array) -> tuple[ca.MX, ca.MX, ca.MX]:
    """Return x, in the scene's units times `stretch` (n,), the discrete action and the rows."""
    layout, asked = tr.layout, tr.problem
    system, n, count = asked.system, asked.system.n, layout.node_count
    unknowns = layout.unknowns
    x = ca.MX.sym("x", unknowns)
    place = ca.Sparsity.triplet(count * n, unknowns, layout.free.tolist(), list(range(unknowns)))
    pinned = tr.ends.copy()
    own = ca.DM(place, 1 / stretch) @ x  # in the scene's units
    Q = ca.reshape(ca.DM(pinned.ravel()) + own, n, count)
    p = ca.DM(asked.packed.ravel())
    s = system.symbols
    L = ca.Function("L", [s.q, s.v, s.t, s.p], [system.L])
    at = Q[:, layout.node_of.tolist()]
    E = layout.evaluations
    values = L.map(E)(at, Q @ _differentiation(tr), ca.DM(tr.times.T), ca.repmat(p, 1, E))
    f = ca.dot(ca.DM(tr.weight.T), values)
    if not layout.rows:
        return x, f, ca.MX(0, 1)
    rows = layout.row_nodes
    constraint = ca.Function("f", [s.q, s.t, s.p], [system.f])
    R = rows.size
    g = constraint.map(R)(Q[:, rows.tolist()], ca.DM(tr.row_times.T), ca.repmat(p, 1, R))
    weight = np.repeat(tr.row_weight.ravel(), system.m)
    return x, f, (ca.DM(weight) * ca.vec(g))[layout.row_select.tolist()]


def _differentiation(tr: Transcription) -> ca.DM:
    """Return the constant matrix from coordinates at nodes to velocities at evaluations."""
    layout = tr.layout
    row, col, value = [], [], []
    for g in layout.groups:
        E, size = g.nodes.shape
        shape = (E, size, size)  # element, evaluation k, node j
        k = np.arange(g.span.start, g.span.stop).reshape(E, size, 1)
        row.append(np.broadcast_to(g.nodes[:, None, :], shape).ravel())
        col.append(np.broadcast_to(k, shape).ravel())
        rate = 1 / tr.half[g.elements]
        value.append((rate[:, None, None] * g.rule.derivative).ravel())
    rows, cols, values = (np.concatenate(part) for part in (row, col, value))
    keep = values != 0
    return ca.DM.triplet(
        rows[keep].tolist(),
        cols[keep].tolist(),
        ca.DM(values[keep]),
        layout.node_count,
        layout.evaluations,
    )
