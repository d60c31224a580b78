"""Refine: carry a path from mesh to mesh until its estimated error meets the tolerance.

Each round asks the last path where it is not resolved, and follows it to a mesh that would resolve
it. What does not settle is either no path of the continuous problem, or not determined by its ends.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from actionopt.analysis.status import Status
from actionopt.discrete.boundaries import bounded
from actionopt.discrete.mesh import MAX_DEGREE, Mesh
from actionopt.discrete.resolution import SHORTEST, refined
from actionopt.solver.iterate import SAFETY
from actionopt.solver.workspace import MEASURABLE, Workspace

ROUNDS = 20
STALLED = 8  # rounds that bring nothing: a layer of 1e-6 is closed in on in six
EXPLAINED = 10.0  # times the effect of round-off in times and coordinates: that may be all
AVERAGING = 50_000  # unknowns and multipliers with which to average it
GROWTH = 20  # times the mesh of the last round that brought something, in vain
MOST = 1_000_000  # unknowns and multipliers: two kB each, a few seconds a round
UNKNOWN = 0.3  # a change from a given mesh to a finer one that says nothing of the error
SENSITIVE = 1e-10  # amplified round-off at which a path that does not settle is held to be that
UNDETERMINED = 1e-6  # amplified round-off above which the end points do not determine a path


def settle(ws: Workspace, tol: float, *, least: bool) -> Status:
    """Carry the path from mesh to mesh until the tolerance is met or cannot be."""
    stalled, missed, most = 0, np.inf, MOST
    for _ in range(ROUNDS):
        before = ws.here.resolution
        resolved = ws.here.error <= tol
        if resolved:
            last, missed = missed, ws.missed()
            here = ws.here
            error = max(here.error, SAFETY * missed) + (here.misread() if here.late else 0.0)
            here = ws.here = replace(here, error=error)
            if error <= tol:
                return Status.UNRESOLVED if here.torn else Status.SOLVED
            stalled = stalled + 1 if missed > last / 2 else 0
            mesh = _split(ws)
            # What is left may be the round-off of times or coordinates; many average it out.
            if stalled or _size(ws, mesh) > AVERAGING:
                misread = here.misread()
                if missed <= EXPLAINED * misread:
                    ws.hint = _misread(ws, misread) if here.late else ""
                    return Status.FLOOR
            if stalled == STALLED:
                return _lost(ws)
        else:
            mesh = refined(before, tol / (2 * SAFETY * ws.here.gain))
        if stalled == 0:
            most = min(GROWTH * _size(ws, mesh), MOST)
        if MOST > _size(ws, mesh) > most:  # more elements and nothing gained
            return _lost(ws)
        if _size(ws, mesh) > MOST:
            ws.hint = (
                f"the next mesh, of {mesh.elements} elements, would have more than {MOST:,} "
                "unknowns; give a Mesh of your own if it is worth that"
            )
            return _lost(ws)
        if not ws.carry(mesh, least=least, missed=missed if resolved else 0.0):
            return _lost(ws)
        if resolved:
            continue
        here, worst = ws.here, ws.here.resolution.worst
        rounded = worst < MEASURABLE or here.gain * worst < here.noise
        if rounded and SAFETY * here.noise > tol:
            return Status.DEGENERATE if here.noise > UNDETERMINED else Status.FLOOR
        stalled = stalled + 1 if worst > before.worst / 2 else 0
        if stalled == STALLED:
            return _lost(ws)
    return _lost(ws)


def _size(ws: Workspace, mesh: Mesh) -> int:
    """Return the number of coordinates and multipliers at the nodes of `mesh`."""
    system = ws.problem.system
    return int(mesh.offsets[-1] + 1) * (system.n + system.m)


def _misread(ws: Workspace, misread: float) -> str:
    t = max(abs(ws.problem.start.t), abs(ws.problem.end.t))
    return (
        f"times near {t:.6g} are known to {np.spacing(t):.1g} only, which alone moves the path by "
        f"about {misread:.1g}; measure time from the start"
    )


def settle_on(ws: Workspace, mesh: Mesh, *, least: bool) -> Status:
    """Solve on the user's mesh; a finer one tells the error."""
    if ws.here.mesh is not mesh and not ws.carry(mesh, least=least):
        return Status.UNRESOLVED
    if not np.isfinite(ws.here.error):  # Ipopt's, which is less accurate
        ws.follow()
    missed, finer = ws.missed(), bounded(_finer(mesh), ws.problem.instants)
    kept = ws.here
    ok = ws.carry(finer, least=least)
    there = ws.here
    change = np.max(np.abs(there.path(finer.nodes) - kept.path(finer.nodes)).T / there.sizes)
    # What is left on the finer mesh is less than half of what it changed, where that is little.
    known = ok and change < UNKNOWN
    error = 2 * float(change) + SAFETY * (there.noise + missed) if known else np.inf
    ws.here = replace(kept, gain=there.gain, noise=there.noise, error=error)
    return Status.ON_MESH


def _split(ws: Workspace) -> Mesh:
    """Return the mesh with those elements cut whose forces are missed."""
    mesh, cuts = ws.here.mesh, ws.here.tr.cuts(ws.here.z)
    long = mesh.lengths > SHORTEST * mesh.duration
    cuts = [inner if enough else inner[:0] for inner, enough in zip(cuts, long, strict=True)]
    parts = [np.append(b, inner) for b, inner in zip(mesh.since, cuts, strict=False)]
    degrees = np.repeat(mesh.degrees, [part.size for part in parts])
    return mesh.cut(np.concatenate([*parts, mesh.since[-1:]]), degrees)


def _finer(mesh: Mesh) -> Mesh:
    """Return the mesh with two degrees more on each element, or the element in halves."""
    degrees, b = np.array(mesh.degrees) + 2, mesh.since
    halved = degrees > MAX_DEGREE
    starts = np.sort(np.concatenate([b[:-1], (b[:-1] + mesh.lengths / 2)[halved]]))
    degrees = np.repeat(np.where(halved, MAX_DEGREE, degrees), np.where(halved, 2, 1))
    return mesh.cut(np.concatenate([starts, b[-1:]]), degrees)


def _lost(ws: Workspace) -> Status:
    """Say why a path does not settle: it is not determined, or it was none."""
    return Status.DEGENERATE if ws.here.noise > SENSITIVE else Status.UNRESOLVED
