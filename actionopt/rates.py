"""The first mesh for linear equations, from the rates at which their solutions turn and decay.

Along one coordinate M a = L_qq q: solutions turn at the rate sqrt(-L_qq / M) where that is real,
and decay from either end at the rate sqrt(L_qq / M) elsewhere. A mesh on which turns are lost, or
layers at the ends, would have to be refined from nothing.
"""

from __future__ import annotations

import numpy as np

from actionopt.path import Mesh
from actionopt.quadrature import Array
from actionopt.transcription import Transcription, sparsity_of

SHOWN = 2.5  # radians, or e-foldings, on an element of some ten degrees: a dozen digits
LAYER = SHOWN * np.array([0, 1, 2, 3, 4, 6, 9, 14])  # e-foldings from an end; rounded away then
MOST = 64  # elements for turns
ROUNDOFF = 1e3 * np.finfo(float).eps


def paced(tr: Transcription, z: Array) -> Mesh | None:
    """Return a mesh that shows turns and layers that the mesh of `tr` does not, if there are any.

    Uniform but for the ends, where the elements lengthen with their distance from a layer.
    """
    mesh = tr.mesh
    turns, folds = _rates(tr, z)
    start, duration = mesh.boundaries[0], mesh.boundaries[-1] - mesh.boundaries[0]
    if max(turns, folds) <= SHOWN * mesh.elements:
        return None
    middle = int(np.clip(np.ceil(turns / SHOWN), mesh.elements, MOST))
    layer = np.zeros(1)
    if folds > SHOWN * mesh.elements:
        layer = LAYER[0.4 * folds > LAYER] / folds  # something is left between
    last = layer[-1]
    parts = np.concatenate(
        [layer[:-1], np.linspace(last, 1.0 - last, middle + 1), 1.0 - layer[-2::-1]]
    )
    times = start + duration * parts
    times[-1] = mesh.boundaries[-1]
    if np.diff(times).min() < ROUNDOFF * np.abs(times).max():
        return None  # a layer as thin as that is left to refinement
    return Mesh(times, max(mesh.degrees))


def _rates(tr: Transcription, z: Array) -> tuple[float, float]:
    """Return the fastest turning, in radians, and decay, in e-foldings, over the whole time."""
    system, second = tr.problem.system, tr.second(z[: tr.layout.unknowns])
    squares, mass = np.zeros((2, len(second[0]), system.n))
    for output, target in ((0, squares), (2, mass)):
        rows, cols = sparsity_of(system, "second", output)
        on = rows == cols
        target[:, rows[on]] = second[output][:, on]
    with np.errstate(all="ignore"):
        squares = squares / mass * tr.problem.duration**2
    squares = squares[np.isfinite(squares)]
    slow, fast = squares.min(initial=0.0), squares.max(initial=0.0)
    return float(np.sqrt(-slow)), float(np.sqrt(fast))
