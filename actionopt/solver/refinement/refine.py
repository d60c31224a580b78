"""Refine: transfer a path from mesh to mesh until its estimated error meets the tolerance.

Each round asks the last path where it is not resolved, and follows it to a mesh that would resolve
it. What cannot be refined is no path of the continuous problem, or not determined by its ends.
"""

from __future__ import annotations

from contextlib import suppress
from typing import TYPE_CHECKING

import numpy as np

from actionopt.analysis.status import Status
from actionopt.discrete.action.transcription import Transcription
from actionopt.discrete.meshes.boundaries import with_boundaries
from actionopt.discrete.meshes.mesh import MAX_DEGREE, Mesh
from actionopt.discrete.meshes.path import Path
from actionopt.discrete.meshes.resolution import SHORTEST, cheapest_mesh
from actionopt.solver.refinement.iterate import SAFETY, amplification
from actionopt.solver.refinement.workspace import MEASURABLE, Workspace
from actionopt.tools.types import Array

if TYPE_CHECKING:
    from actionopt.discrete.between_nodes.energy_balance import Imbalance

# Ad hoc, where nothing else is said.
ROUNDS = 20
# Times the square of what a mesh leaves out, for the next one; measured on pendulums of 30 to 100
# links: a tenth takes a third more time, and the tolerance at once twice as much.
NEXT_OMITTED = 10.0
STALLED = 8  # rounds that bring nothing: a layer of 1e-6 is closed in on in six
EXPLAINED_BY_ROUNDOFF = 10.0  # times the effect of that in times and coordinates: it may be all
# Times the round-off that one sample shows: tolerances that it may still forbid. Measured on
# oscillators near a conjugate time: one sample in a hundred is 100 times smaller than the error.
NOTICEABLE = 1e3
AVERAGING_SIZE = 50_000  # unknowns and multipliers with which to average it
# Largest growth of the mesh since the last round that reduced the error; meshes of up to FRUITLESS
# unknowns are always tried, as they take a tenth of a second.
FRUITLESS_GROWTH, FRUITLESS = 20, 10_000
# Largest inertia over the smallest one on an element, up to which its round-off is that of all.
# Measured on exp(a t) (v^2 - q^2), a = 120 to 300: from 20 to 6e7 all are solved.
MOST_VARIED = 20.0
MAX_UNKNOWNS = 1_000_000  # and multipliers: two kB each, a few seconds a round
CREDIBLE_CHANGE = 0.3  # from a given mesh to a finer one; a larger one says nothing of the error
# Amplified round-off, in a path's own size: at which a path that cannot be refined is held to be
# ill-conditioned, and above which the end points are held not to determine it.
ILL_CONDITIONED, UNDETERMINED = 1e-10, 1e-6
# Growth of a variation in a step of inverse iteration, below which the action bends in all
# directions. Measured: 0.3 to 9 on the scenes, 1 where forces have a pole in time; ad hoc.
BENDING = 100.0


def refine(ws: Workspace, tol: float, *, least: bool) -> Status:
    """Transfer the path from mesh to mesh until the tolerance is met or cannot be."""
    ws.unbalance = None
    status = _refine_once(ws, tol, least=least)
    if status is Status.FLOOR:
        ws.find_imbalance()
    elif status is Status.UNRESOLVED and np.isfinite(ws.here.error):
        # What the mesh leaves out may be little beside what the sums of its forces miss.
        missed = np.nan
        with suppress(np.linalg.LinAlgError):
            missed = SAFETY * ws.quadrature_shift()
        error = max(ws.here.error, missed) if missed < np.inf else np.inf
        ws.here = ws.here.with_values(error=error)
    if ws.unbalance is not None:
        ws.here = ws.here.with_values(error=np.inf)
        return Status.JUMP if ws.unbalance.is_jump else Status.UNRESOLVED
    return status


def _refine_once(ws: Workspace, tol: float, *, least: bool) -> Status:
    """Refine as `refine` does, but for a last look at the balance of energy."""
    stalled, missed, most = 0, np.inf, MAX_UNKNOWNS
    for _ in range(ROUNDS):
        here = ws.here
        before = here.resolution
        if here.error <= tol < NOTICEABLE * here.noise and amplification(here.noise) > 1:
            here = ws.here = here.with_larger_noise()
        resolved = here.error <= tol
        if resolved:
            last, missed = missed, ws.quadrature_shift()
            here = ws.here
            error = max(here.error, SAFETY * missed) + (here.misread() if here.is_misread else 0.0)
            if error != here.error:
                here = ws.here = here.with_values(error=error)
            if error <= tol:
                status, mesh = _judge_between(ws, tol)
                if mesh is None:
                    return status
                stalled += 1
            else:
                mesh = split(here.tr, here.z)
                stalled = stalled + 1 if missed > last / 2 else 0
                averaged = stalled or _size(ws, mesh) > AVERAGING_SIZE
                if averaged and _is_misread(ws, missed):
                    return Status.FLOOR
            if stalled == STALLED:
                return _failure(ws)
        else:
            target = tol / (2 * SAFETY * here.gain)
            if ws.many_coordinates:  # the path settles on a cheaper mesh first
                target = max(target, NEXT_OMITTED * before.worst**2)
            mesh = cheapest_mesh(before, target, sparse=ws.many_coordinates and ws.sparse)
        size = _size(ws, mesh)
        if stalled == 0:
            most = min(max(FRUITLESS_GROWTH * size, FRUITLESS), MAX_UNKNOWNS)
        if size > MAX_UNKNOWNS:
            ws.hint = (
                f"the next mesh, of {mesh.elements} elements, would have more than "
                f"{MAX_UNKNOWNS:,} unknowns; give a Mesh of your own if it is worth that"
            )
        if size > most:  # more elements and nothing gained
            return _failure(ws)
        here = None  # frees its factors before others are made
        if not ws.transfer(mesh, least=least, missed=missed if resolved else 0.0):
            even = even_mesh(ws) if ws.linear else None
            if even is None or not ws.transfer(even, least=least):
                return _failure(ws)
        if resolved:
            continue
        if _is_noisy(ws, tol) and not _even_out(ws, tol, least=least):
            return _judge_noisy(ws)
        stalled = stalled + 1 if ws.here.resolution.worst > before.worst / 2 else 0
        if stalled == STALLED or ws.has_kink:
            return _failure(ws)
    return _failure(ws)


def _judge_between(ws: Workspace, tol: float) -> tuple[Status, Mesh | None]:
    """Return the verdict on a path within the tolerance by what lies between its samples.

    And a mesh that sees what does, if there is something.
    """
    if ws.here.singular:
        return Status.UNRESOLVED, None
    off = ws.find_imbalance()
    if off is None and ws.here.error <= tol:
        return Status.SOLVED, None
    if off is None:
        return Status.UNRESOLVED, split(ws.here.tr, ws.here.z)
    if off.is_jump is True:
        return Status.JUMP, None
    return Status.UNRESOLVED, _cut(ws.here.mesh, off)


def _is_misread(ws: Workspace, missed: float) -> bool:
    """Whether what is missed may be the round-off of times or coordinates; many average it out."""
    misread = ws.here.misread()
    if missed > EXPLAINED_BY_ROUNDOFF * misread:
        return False
    ws.hint = _misread(ws, misread) if ws.here.is_misread else ""
    return True


def _is_noisy(ws: Workspace, tol: float) -> bool:
    """Whether round-off, and not the mesh, keeps a path that was just moved from the tolerance."""
    here, expected = ws.here, ws.here.resolution.by_rate
    rounded = expected < MEASURABLE or here.gain * expected < here.noise
    return rounded and SAFETY * here.noise > tol


def _even_out(ws: Workspace, tol: float, *, least: bool) -> bool:
    """Cut elements along which the inertia varies much; return whether the round-off was theirs."""
    here, mesh = ws.here, even_mesh(ws)
    if mesh is None:
        return False
    if ws.transfer(mesh, least=least):
        return not _is_noisy(ws, tol)
    ws.here = here
    return False


def even_mesh(ws: Workspace) -> Mesh | None:
    """Return a mesh with those elements cut along which the inertia varies much; None if none does.

    In the matrix of such an element what is light is no more than round-off of what is heavy.
    """
    tr, structure = ws.here.tr, ws.problem.system.structure
    if tr.order > 1 or (structure.constant_mass and not structure.depends_on_time):
        return None
    nonzeros, parts = tr.second(ws.here.x)[2], np.ones(tr.mesh.elements, dtype=int)
    for g in tr.layout.groups:
        mass = np.abs(nonzeros[g.span].reshape(*g.nodes.shape, -1)).max(axis=2)
        known = (mass > 0).all(axis=1)
        varied = np.log(mass[known].max(axis=1) / mass[known].min(axis=1)) / np.log(MOST_VARIED)
        parts[g.elements[known]] = np.maximum(np.ceil(varied), 1)
    return tr.mesh.divide(parts) if parts.max() > 1 else None


def _judge_noisy(ws: Workspace) -> Status:
    """Return the verdict on a path of which no mesh says more, as round-off hides the rest."""
    ws.here = ws.here.with_larger_noise()
    if ws.here.noise <= UNDETERMINED:
        return Status.FLOOR
    status = _failure(ws)
    # Linear equations that bend in all directions have a path, known as far as it is.
    return Status.FLOOR if ws.linear and status is Status.UNRESOLVED else status


def _size(ws: Workspace, mesh: Mesh) -> int:
    """Return the number of coordinates and multipliers at the nodes of `mesh`."""
    system = ws.problem.system
    return int(mesh.offsets[-1] + 1) * (system.n + system.m)


def _misread(ws: Workspace, misread: float) -> str:
    """Return a hint: the round-off of times, or of integrals, moves the path by so much."""
    if not ws.here.late:
        return (
            "integrals are given, and summed, to 16 digits only, which alone moves the path by "
            f"about {misread:.1g}: they hardly change with it"
        )
    t = float(np.abs(ws.here.mesh.boundaries[[0, -1]]).max())
    return (
        f"times near {t:.6g} are known to {np.spacing(t):.1g} only, which alone moves the path by "
        f"about {misread:.1g}; measure time from the start"
    )


def settle_on(ws: Workspace, status: Status, mesh: Mesh | None, *, least: bool) -> Status:
    """Take a path that is refined to the user's mesh, stretched over the times that were found."""
    if mesh is None or not status.stationary:
        return status
    ws.refines = False
    return solve_on(ws, ws.with_boundaries(mesh.moved(*_ends(ws.here.mesh))), least=least)


def _ends(mesh: Mesh) -> list[float]:
    return mesh.boundaries[[0, -1]].tolist()


def solve_on(ws: Workspace, mesh: Mesh, *, least: bool) -> Status:
    """Solve on the user's mesh; a finer one tells the error."""
    if ws.here.mesh is not mesh and not ws.transfer(mesh, least=least):
        return Status.UNRESOLVED
    if not np.isfinite(ws.here.error):  # Ipopt's, which is less accurate
        ws.follow()
    missed, kept = ws.quadrature_shift(), ws.here
    finer = with_boundaries(_finer(kept.mesh), kept.problem.boundaries)
    ok = ws.transfer(finer, least=least)
    there = ws.here
    before = Path(kept.mesh.moved(*_ends(there.mesh)), kept.Q.T).on(there.mesh)
    change = np.max(np.abs(there.Q - before.values.T) / there.sizes)
    change += there.reach * abs(there.mesh.duration / kept.mesh.duration - 1)
    # What is left on the finer mesh is less than half of what it changed, where that is little.
    known = ok and change < CREDIBLE_CHANGE
    error = 2 * (float(change) + ws.inside) + SAFETY * (there.noise + missed) if known else np.inf
    ws.here = kept.with_values(gain=there.gain, noise=there.noise, error=error)
    off = ws.find_imbalance()
    if off is not None:
        ws.here = ws.here.with_values(error=np.inf)
    return Status.JUMP if off is not None and off.is_jump else Status.ON_MESH


def _cut(mesh: Mesh, off: Imbalance) -> Mesh:
    """Return the mesh with boundaries round where the balance of energy does not hold."""
    b, apart = mesh.since, SHORTEST * mesh.duration
    new = np.unique(np.concatenate([off.low, off.high]))
    new = new[np.abs(new[:, None] - b).min(axis=1) > apart]
    new = new[np.diff(new, prepend=-np.inf) > apart]
    since = np.sort(np.concatenate([b, new]))
    return mesh.cut(since)


def split(tr: Transcription, z: Array) -> Mesh:
    """Return the mesh with those elements cut whose forces are missed."""
    mesh, cuts = tr.mesh, tr.cuts(z)
    long = mesh.lengths > SHORTEST * mesh.duration
    cuts = [inner if enough else inner[:0] for inner, enough in zip(cuts, long, strict=True)]
    parts = [np.append(b, inner) for b, inner in zip(mesh.since, cuts, strict=False)]
    return mesh.cut(np.concatenate([*parts, mesh.since[-1:]]))


def _finer(mesh: Mesh) -> Mesh:
    """Return the mesh with two degrees more on each element, or the element in halves."""
    degrees = np.array(mesh.degrees) + 2
    return mesh.divide(np.where(degrees > MAX_DEGREE, 2, 1), np.minimum(degrees, MAX_DEGREE))


def _failure(ws: Workspace) -> Status:
    """Return why a path cannot be refined: it is not determined, or was no path.

    It is not determined where round-off is amplified since the action hardly bends in a direction.
    Otherwise the forces are rounded coarsely, as near a pole in time, or it is one of no family.
    The matrix tells nothing of a path at which Newton's method has not been, unless the equations
    are linear; nor does one that is not finite, as where a node lies on a kink of L that is written
    as arccos(cos(q)).
    """
    from actionopt.solver.refinement.family import is_alone

    known = ws.linear or np.isfinite(ws.here.error)
    if not (known and ws.here.noise > ILL_CONDITIONED) or is_alone(ws.problem):
        return Status.UNRESOLVED
    try:
        bends = ws.here.with_probed(ws.many).growth < BENDING
    except np.linalg.LinAlgError:
        bends = not np.isfinite(ws.here.equations.kkt(ws.here.z)).all()
    return Status.UNRESOLVED if bends else Status.DEGENERATE
