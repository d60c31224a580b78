"""The Morse indices of many paths of a family at once: `index` for stacks."""

from __future__ import annotations

import numpy as np

from actionopt.analysis.quadratic.index import (
    ERROR_GAIN,
    INDEX_RESOLUTION,
    INDEX_TOLERANCE,
    LOOSEST,
)
from actionopt.analysis.quadratic.jacobi import COEFFICIENT_NOISE, COEFFICIENT_SAMPLES
from actionopt.discrete.matrices.elimination import least_pivots
from actionopt.discrete.meshes.mesh import MAX_DEGREE
from actionopt.discrete.stacks import Factored, Stack, StackShape
from actionopt.tools.lobatto import lgl
from actionopt.tools.types import RANK, Array


def indices(shape: StackShape, times: Array, packed: Array, Q: Array, error: float) -> Array:
    """Return the indices of stationary paths Q (C, K, n) known to `error`, (C,) of int.

    As `index.inertia`: where two counts agree, on a mesh that resolves all solutions of the
    linearised equations on its elements, and what these are made of (`jacobi.finer`); else -1.
    """
    found = np.full(len(Q), -1)
    with np.errstate(all="ignore"):
        for here in shape.parts(len(Q)):
            stack = Stack(shape, times[here], packed[here])
            found[here] = _count(stack, shape.local(Q[here]), error)
    return found


def _count(stack: Stack, Q: Array, error: float) -> Array:
    """Return the indices (C,) of paths Q (P, n, E, C), -1 where the mesh leaves them open."""
    shape = stack.shape
    second, C = stack.second(Q), len(stack.times)
    tolerance = np.full(C, np.clip(ERROR_GAIN * error, INDEX_TOLERANCE, LOOSEST))
    low = Factored(shape, stack.coefficients(second, -tolerance), counted=True).negative
    factored = Factored(shape, stack.coefficients(second, tolerance), counted=True)
    fields = factored.responses()[shape.rows].reshape(shape.P, -1)
    fields = np.abs(shape.rule.to_legendre @ fields).reshape(shape.P, -1, shape.E, C)
    size = np.abs(fields).max(axis=(0, 1))
    resolved = (fields[-2:].max(axis=(0, 1)) <= INDEX_RESOLUTION * size).all(axis=0)
    # The coefficients of d2S, at more points: at the nodes alone what varies faster is smooth.
    degree = shape.P - 1
    fine = lgl(min(max(2 * degree + 2, -(-COEFFICIENT_SAMPLES // shape.E)), 2 * MAX_DEGREE + 2))
    points = fine.degree + 1
    sampled = stack.second(Q, fine.nodes)
    rows, cols = shape.system.pointwise("second").sparsity(2)
    own = rows == cols
    mass = np.zeros((shape.n, shape.E, C))
    mass[rows[own]] = np.abs(sampled[2][:, own]).max(axis=0)
    mass = np.sqrt(np.maximum(mass, COEFFICIENT_NOISE * mass.max(axis=0)))
    for k, power in ((0, 2), (1, 1), (2, 0)):
        i, j = shape.system.pointwise("second").sparsity(k)
        for a, b, x in zip(i, j, sampled[k].swapaxes(0, 1), strict=True):
            unit = mass[a] * mass[b] / (2 * stack.half) ** power
            tail = np.abs(fine.to_legendre[degree - 1 :] @ x.reshape(points, -1)).max(axis=0)
            noise = COEFFICIENT_NOISE * np.abs(x).max(axis=0)
            tail = tail.reshape(shape.E, C)
            resolved &= ((tail <= noise) | (tail <= INDEX_RESOLUTION * unit)).all(axis=0)
    least = least_pivots(shape.n, rows, cols, second[2])  # Legendre's condition
    convex = (least > RANK * np.abs(second[2][:, own]).max(axis=1)).all(axis=(0, 1))
    return np.where(resolved & convex & (low == factored.negative), low, -1)
