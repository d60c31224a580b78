"""What becomes of a path's neighbours where it passes an event.

A neighbour passes at its own time and place: with dq = delta q + v dt and dp = delta p + p' dt on
either side it satisfies the conditions of the event (`mechanics.question.course`) to first order,

    dq+ = dq-,    dp+ - dp- = d(mu on_q) + jumps in the coordinates that are given,
    d on = 0,     dH+ - dH- = -d(mu on_t), or dt = 0 where the time is given,

with dH = v.delta p - p'.delta q + H_t dt. The fields that can be continued, of a plane of Jacobi
fields that is Lagrangian before the event, make one after it.
"""

from __future__ import annotations

import numpy as np

from actionopt.analysis.quadratic.second_variation import Form, curvature
from actionopt.analysis.solution import Solution
from actionopt.discrete.borders.surfaces import event_at, surface_at
from actionopt.tools.types import Array

# Singular values below which conditions depend on each other, and planes are pinned, in units in
# which all are of order one; ad hoc, between the path's error and what a neighbour's variation is.
INDEPENDENT = 1e-9
PINNED = 1e-7


class Side:
    """The state of a path on one side of an event: v, p, p' = L_q and H_t = -L_t."""

    def __init__(self, form: Form, node: int) -> None:
        at, system, packed = form.at, form.at.problem.system, form.at.problem.packed
        t = at.mesh.boundaries[[node]]
        self.v = at.path.velocity(t)[:, 0]
        state = at.Q[[node]], self.v[None], t[:, None], packed
        self.rate, self.p = (x[0].copy() for x in system.pointwise("first")(*state)[:2])
        self.by_t = -float(system.pointwise("rate")(*state)[0][0, 0])


def begin(solution: Solution, form: Form) -> Array:
    """Return the plane (2r, r) of the neighbours that leave the start at its time.

    As if they came to it from any place, without momentum.
    """
    frame = form.units[:, None] * form.basis[0]
    still = np.concatenate([frame, 0 * frame])
    return _into(form, _meet(solution, 0, still, None, Side(form, 0)))


def carry(solution: Solution, k: int, plane: Array, before: Form, after: Form) -> Array:
    """Return the plane (2r, r) after event k, the start being 0, of one before it, (2r, r)."""
    r, basis = before.freedom, before.basis[-1]
    unit = before.momentum_unit
    fields = np.concatenate(
        [
            before.units[:, None] * (basis @ plane[:r]),
            unit / before.units[:, None] * (basis @ plane[r:]),
        ]
    )
    return _into(after, _meet(solution, k, fields, Side(before, -1), Side(after, 0)))


def count_pinned(plane: Array) -> int:
    """Return in how many directions the fields of a plane (2r, r) vanish."""
    r = plane.shape[1]
    return r - int(np.sum(np.linalg.svd(plane[:r], compute_uv=False) > PINNED))


def _into(form: Form, fields: Array) -> Array:
    """Return the plane (2r, r), orthonormal, of fields (2n, c) at the start of a leg."""
    n, basis = form.units.size, form.basis[0]
    q = basis.T @ (fields[:n] / form.units[:, None])
    p = basis.T @ (fields[n:] * form.units[:, None]) / form.momentum_unit
    left, _, _ = np.linalg.svd(np.concatenate([q, p]), full_matrices=False)
    return left[:, : form.freedom]


def _meet(solution: Solution, k: int, fields: Array, before: Side | None, after: Side) -> Array:
    """Return the fields (2n, c) after event k that continue some of those before it, (2n, r).

    Where there is nothing before, the time is that of the path.
    """
    at = solution.discrete
    n = at.problem.system.n
    event, _ = event_at(at, k)
    timed = before is not None and event.t is None
    if timed and at.problem.system.m and at.problem.system.structure.depends_on_time:
        raise ValueError(
            "expected constraints that do not depend on the time where the times of events are "
            "found, found some that do: what their neighbours' energy is there is not known; give "
            "the time at which the event is passed"
        )
    given, count = list(event.pinned), fields.shape[1]
    rows, by_t, bent = _surfaces(solution, k, after.p - (0 if before is None else before.p))
    s, g = len(rows), len(given)
    # Unknown: how much of each field, dt, d mu, and the jumps in the coordinates that are given.
    unknown = np.split(np.eye(count + 1 + s + g), [count, count + 1, count + 1 + s])
    parts, dt, d_mu, jumps = unknown
    q, p = fields[:n] @ parts, fields[n:] @ parts
    dq = q if before is None else q + before.v[:, None] * dt
    kick = rows.T @ d_mu + bent[:n, :n] @ dq + bent[:n, n:] * dt
    kick[given] += jumps
    conditions, q_after, p_after = [dq[given], rows @ dq + by_t[:, None] * dt], q, p + kick
    if before is None or not timed:
        conditions.append(dt)
    else:
        q_after = dq - after.v[:, None] * dt
        p_after = p_after + (before.rate - after.rate)[:, None] * dt
        energies = [
            side.v @ dp - side.rate @ moved + side.by_t * dt
            for side, moved, dp in ((before, q, p), (after, q_after, p_after))
        ]
        own = by_t @ d_mu + bent[n:, :n] @ dq + bent[n, n] * dt
        conditions.append(energies[1] - energies[0] + own)
    return np.concatenate([q_after, p_after]) @ _null_space(np.concatenate(conditions))


def _surfaces(solution: Solution, k: int, jump: Array) -> tuple[Array, Array, Array]:
    """Return on_q (s, n) and on_t (s,) at event k, and the second derivatives of mu.on + nu.f.

    The multipliers, of surfaces and of constraints, balance the jump (n,) of the momentum.
    """
    at = solution.discrete
    problem, system, n = at.problem, at.problem.system, at.problem.system.n
    event, t = event_at(at, k)
    q, free = at.Q[at.tr.joints[k]], [i for i, x in enumerate(event.q) if x is None]
    rows, by_t, bent = np.zeros((0, n)), np.zeros(0), np.zeros((n + 1, n + 1))
    if event.on is not None:
        _, rows, by_t, _ = surface_at(at, k)
    normals = rows
    if system.m:
        G = system.constraint_jacobian(q, t, parameters=problem.parameters)
        normals = np.concatenate([rows, G])
    if not (len(normals) and free):
        return rows, by_t, bent
    unit = at.tr.lengths[free, None]
    found = np.linalg.lstsq(unit * normals[:, free].T, unit[:, 0] * jump[free], rcond=None)[0]
    if event.on is not None:
        bent = event.on.bending(q, t, problem.packed, found[: len(rows)])
    if system.m:
        nu = found[None, len(rows) :]
        bent[:n, :n] += curvature(problem, q[None], nu, np.array([[t]]))[0]
    return rows, by_t, bent


def _null_space(rows: Array) -> Array:
    """Return a basis of what satisfies conditions, whatever the units of these and of unknowns."""
    for _ in range(2):
        size = np.abs(rows).max(axis=1, keepdims=True)
        rows = rows / np.where(size > 0, size, 1.0)
    unit = np.abs(rows).max(axis=0)
    unit = np.where(unit > 0, unit, 1.0)
    _, values, right = np.linalg.svd(rows / unit)
    return right[int(np.sum(values > INDEPENDENT * values.max(initial=0))) :].T / unit[:, None]
