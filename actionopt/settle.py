"""Refine: carry a path from mesh to mesh until its estimated error meets the tolerance.

Each round asks the last path where it is not resolved, and follows it to a mesh that would resolve
it. What does not settle is either no path of the continuous problem, or not determined by its ends.
"""

from __future__ import annotations

import numpy as np

from actionopt.path import MAX_DEGREE, Mesh
from actionopt.refine import refined
from actionopt.status import Status
from actionopt.walk import MEASURABLE, SAFETY, Walk

ROUNDS = 20
STALLED = 8  # rounds that bring nothing: a layer of 1e-6 is closed in on in six
SHARE, PARTS = 0.1, 4  # of the worst element's misses that an element is cut for, and in how many
UNKNOWN = 0.3  # a change from a given mesh to a finer one that says nothing of the error
SENSITIVE = 1e-10  # amplified round-off at which a path that does not settle is held to be that
UNDETERMINED = 1e-6  # amplified round-off above which the end points do not determine a path


def settle(walk: Walk, tol: float, *, least: bool) -> Status:
    """Carry the path from mesh to mesh until the tolerance is met or cannot be."""
    stalled, missed = 0, np.inf
    while len(walk.rounds) <= ROUNDS:
        before = walk.resolution()
        if walk.error <= tol:
            last, missed = missed, walk.missed()
            walk.error = max(walk.error, SAFETY * missed)
            if walk.error <= tol:
                return Status.UNRESOLVED if walk.torn() else Status.SOLVED
            stalled = stalled + 1 if missed > last / 2 else 0
            if stalled == STALLED or not walk.carry(_split(walk), least=least):
                return _lost(walk)
            continue
        if not walk.carry(refined(before, tol / (2 * SAFETY * walk.gain)), least=least):
            return _lost(walk)
        worst = walk.resolution().worst
        resolved = worst < MEASURABLE or walk.gain * worst < walk.noise
        if resolved and SAFETY * walk.noise > tol:
            return Status.DEGENERATE if walk.noise > UNDETERMINED else Status.FLOOR
        stalled = stalled + 1 if worst > before.worst / 2 else 0
        if stalled == STALLED:
            return _lost(walk)
    return Status.SOLVED if walk.error <= tol else _lost(walk)


def settle_on(walk: Walk, mesh: Mesh, *, least: bool) -> Status:
    """Solve on the user's mesh; a finer one tells the error."""
    if walk.tr.mesh is not mesh and not walk.carry(mesh, least=least):
        return Status.UNRESOLVED
    tr, z = walk.tr, walk.z
    finer = _finer(mesh)
    path = walk.path()
    ok = walk.carry(finer, least=least)
    change = np.max(np.abs(walk.path()(finer.nodes) - path(finer.nodes)).T / walk.sizes)
    walk.tr, walk.z = tr, z
    # What is left on the finer mesh is less than half of what it changed, where that is little.
    known = ok and change < UNKNOWN
    walk.error = 2 * float(change) + SAFETY * walk.noise if known else np.inf
    return Status.ON_MESH


def _split(walk: Walk) -> Mesh:
    """Return the mesh with those elements cut in parts whose forces are missed."""
    mesh, shares = walk.tr.mesh, walk.tr.uneven(walk.z)
    parts = np.where(shares > SHARE * shares.max(), PARTS, 1)
    step = np.repeat(mesh.lengths / parts, parts)
    first = np.repeat(np.cumsum(parts) - parts, parts)
    starts = np.repeat(mesh.boundaries[:-1], parts) + (np.arange(step.size) - first) * step
    return Mesh(np.append(starts, mesh.boundaries[-1]), np.repeat(mesh.degrees, parts))


def _finer(mesh: Mesh) -> Mesh:
    """Return the mesh with two degrees more on each element, or the element in halves."""
    degrees, b = np.array(mesh.degrees) + 2, mesh.boundaries
    halved = degrees > MAX_DEGREE
    starts = np.sort(np.concatenate([b[:-1], (b[:-1] + mesh.lengths / 2)[halved]]))
    degrees = np.repeat(np.where(halved, MAX_DEGREE, degrees), np.where(halved, 2, 1))
    return Mesh(np.concatenate([starts, b[-1:]]), degrees)


def _lost(walk: Walk) -> Status:
    """Say why a path does not settle: it is not determined, or it was none."""
    return Status.DEGENERATE if walk.noise > SENSITIVE else Status.UNRESOLVED
