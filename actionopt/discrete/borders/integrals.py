"""Integrals of given expressions along a path, int g(q, v, t) dt, and how they change with it."""

from __future__ import annotations

import casadi as ca
import numpy as np

from actionopt.discrete.borders.stretch import Stretch, by_joints
from actionopt.discrete.matrices.factors import full
from actionopt.discrete.newton.discrete_path import DiscretePath
from actionopt.mechanics.laws.compiled import Pointwise
from actionopt.mechanics.laws.laws import keep
from actionopt.mechanics.system import System
from actionopt.tools.types import EPS, Array


def integrals(at: DiscretePath) -> tuple[Array, Array]:
    """Return the integrals of the system's `integral`, (c,), and their slopes, (c, unknowns)."""
    tr = at.tr
    g, by_q, by_v, _ = integrands(at)
    slopes = np.zeros((g.shape[1], tr.layout.unknowns))
    for i, slope in enumerate(slopes):
        slope[:] = tr.at_unknowns(tr.pull_back(by_q[:, i], by_v[:, i])) * tr.action_unit
    return tr.weight[:, 0] @ g, slopes


def are_dependent(at: DiscretePath) -> bool:
    """Whether integrals change together near a path, so that multipliers lose half their digits.

    Of moves that the constraints allow: others tell of q . q on a sphere that it changes.
    """
    slopes = integrals(at)[1]
    if at.tr.layout.rows:
        unknowns = at.tr.layout.unknowns
        rows = full(at.tr.layout, at.tr.kkt(at.z))[unknowns:, :unknowns]
        size = np.linalg.norm(slopes, axis=1, keepdims=True)
        slopes = slopes - np.linalg.lstsq(rows.T, slopes.T, rcond=None)[0].T @ rows
        slopes[np.linalg.norm(slopes, axis=1) < np.sqrt(EPS) * size[:, 0]] = 0.0
    if at.problem.free_time:
        slopes = np.hstack([slopes, integrals_by_times(at)])
    size = np.linalg.norm(slopes, axis=1, keepdims=True)
    ratios = np.linalg.svd(slopes / np.where(size > 0, size, 1.0), compute_uv=False)
    return bool(ratios[-1] <= np.sqrt(EPS) * ratios[0])


def integrals_by_times(at: DiscretePath) -> Array:
    """Return how they change with the times of the events, (c, k + 2), as the action does."""
    return integrals_by(by_joints(at))


def integrals_by(stretch: Stretch) -> Array:
    """Return how they change with times by which boundaries of elements move, (c, J)."""
    g, by_q, by_v, by_t = integrands(stretch.at)
    of_each = zip(g.T, by_q.swapaxes(0, 1), by_v.swapaxes(0, 1), by_t.T, strict=True)
    return np.array([stretch.sums(*parts) for parts in of_each])


def integrands(at: DiscretePath) -> tuple[Array, Array, Array, Array]:
    """Return g (K, c) and its derivatives by q and v, (K, c, n), and by t, (K, c), at the nodes."""
    system, point = at.problem.system, at.tr.place(at.x)
    g, by_q, by_v, by_t = _function_of(system)(point.at, point.v, at.tr.times, at.problem.packed)
    shape = len(point.at), system.g.numel(), -1
    return g.copy(), by_q.reshape(shape).copy(), by_v.reshape(shape).copy(), by_t.copy()


@keep
def _function_of(system: System) -> Pointwise:
    """Return the function of g and its derivatives."""
    s, g = system.symbols, system.g
    outputs = [g, *(ca.vec(ca.jacobian(g, x).T) for x in (s.q, s.v)), ca.jacobian(g, s.t)]
    function = ca.Function("integrals", [s.q, s.v, s.t, s.p], [ca.densify(x) for x in outputs])
    return Pointwise(function)
