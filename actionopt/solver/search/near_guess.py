"""Find the path near a guess: follow it, settle next to it, or continue from what became of it."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np

from actionopt.analysis.solution import Solution
from actionopt.analysis.status import Status
from actionopt.discrete.matrices.factors import Factors
from actionopt.discrete.meshes.mesh import Mesh
from actionopt.discrete.meshes.path import Path
from actionopt.discrete.meshes.resolution import Resolution, cheapest_mesh, resolution
from actionopt.mechanics.question.problem import Problem
from actionopt.solver.input.arguments import Sampled
from actionopt.solver.refinement.first_mesh import COARSE_DEGREE, COARSE_ELEMENTS, LINEAR
from actionopt.solver.refinement.iterate import sizes
from actionopt.solver.refinement.signals import HALVINGS
from actionopt.solver.refinement.workspace import FOLLOWED_REACH, PATIENT, ROUGHLY, Workspace
from actionopt.solver.search.search import REACHED, Search, Strategy
from actionopt.solver.search.strategies import CHEAP, GUESS_ONLY, IPOPT
from actionopt.tools.lobatto import lgl
from actionopt.tools.types import Array

GUESS_MESHES = (16, 32, 64)  # elements: a guess has features that coarser meshes would miss
# Elements tried before. Measured on chains, bodies and lattices: half the time, at any tolerance.
COARSE_GUESS = LINEAR, COARSE_ELEMENTS
GUESS_RESOLUTION = 1e-3  # omitted coefficients of a guess that a mesh resolves; flat
# Those of meshes that show a turn far shorter than the way, and the forces in it; and their nodes,
# in those of the largest other at most. Measured on 174 motions past near collisions (1 - e from
# .001 to .1), as their own guess: without the second one in six leads elsewhere, with it none;
# beyond, to 1 - e = 1e-4, 3 of 15. A thousandth off, 5 of 30 for 9; a hundredth off, 10 for 12.
SHORT_TURN, SHARP = (1e-7, 4), (1e-10, 4)


def follow_neighbour(search: Search, neighbour: Solution) -> Status:
    """Follow a path of the system as its ends move to these, where nothing else differs."""
    ws, problem, old = search.ws, search.ws.problem, neighbour.problem
    same = (
        _pins(old) == _pins(problem)
        and old.advance is None is problem.advance
        and search.given in (None, neighbour.mesh)
    )
    search.begin("linear" if ws.linear else "guess")
    if not same or not ws.continue_from(neighbour.discrete):
        return Status.NOT_FOUND
    near = (not ws.astray and ws.follow()) or ws.approach(PATIENT)
    return search.refine() if near else Status.NOT_FOUND


def _pins(problem: Problem) -> list[tuple[float | None, tuple[int, ...]]]:
    """Return the time of each event, and which coordinates and derivatives are given there."""
    events, order = (problem.start, *problem.through, problem.end), problem.system.order
    return [(event.t, event.pinned_places(order)) for event in events]


def follow_expected(search: Search, expected: Solution, curve_of: Callable[[Mesh], Path]) -> Status:
    """Follow a path that is expected near others, on their mesh and with multipliers like theirs.

    A neighbour is given with that path and these multipliers in place of its own.
    """
    curve = curve_of(expected.mesh)
    search.begin("linear" if search.ws.linear else "guess")
    lam = np.nan_to_num(expected.lam.T) if expected.lam.size else expected.lam.T
    search.ws.transcribe(curve.mesh, curve, lam, like=curve)
    return search.refine() if search.ws.follow(FOLLOWED_REACH) else Status.NOT_FOUND


def follow_guess(
    search: Search, curve_of: Callable[[Mesh], Path], seen: Mesh | None = None
) -> Status:
    """Follow the guess, or find the stationary path near it, or continue from it.

    If `seen` is given, the guess is known at its nodes only.
    """
    search.begin("guess")
    status, missed = _from_few(search, curve_of, sparse=seen is not None)
    if status not in (Status.NOT_FOUND, Status.UNRESOLVED):
        return status
    if seen is not None and (missed := missed or _is_far(search, curve_of)):
        # Were the action convex along the line, Newton's method would not have led astray.
        found = _quickly_past(search, curve_of(seen), CHEAP[1:])
        if found in REACHED:
            return found
    meshes = _fine_enough(search, curve_of)
    made = meshes[: -len(GUESS_MESHES)]
    if (sharp := _show_turns(search, curve_of)) is not None:
        search.ws.transcribe(sharp.mesh, sharp, like=sharp)
        status = search.refine() if search.ws.follow(FOLLOWED_REACH) else status
        if status not in (Status.NOT_FOUND, Status.UNRESOLVED):
            return status
    settled: Path | None = None  # what became of the guess on a mesh that may be too coarse
    for coarse in meshes:
        curve = curve_of(coarse) if settled is None or coarse in made else settled
        own = curve.mesh is not coarse and coarse.elements == GUESS_MESHES[0]
        mesh = search.given or (curve.mesh if own else coarse)
        search.ws.transcribe(mesh, curve, like=curve)
        near = _near(search)
        if not near and search.strategies is not IPOPT:
            settled = search.ws.here.path
        if not near and coarse is meshes[0] and not missed:
            found = _quickly_past(search, curve_of(seen or coarse))
            if found in REACHED:
                return found
        near = near or _continue(search, far=coarse in (meshes[0], meshes[-1]))
        if near:
            status = search.refine()
            if status is not Status.UNRESOLVED:
                break
    return status


def _is_far(search: Search, curve_of: Callable[[Mesh], Path]) -> bool:
    """Whether a guess is so far from all paths that Newton's method leads nowhere from it."""
    if search.given is not None or search.ws.problem.system.m:
        return False
    few = curve_of(search.uniform(COARSE_GUESS[0], search.fine_degree()))
    search.ws.transcribe(few.mesh, few, like=few)
    here = search.ws.here
    with np.errstate(all="ignore"):
        try:
            step = Factors(here.tr.layout, here.tr.kkt(here.z)).solve(here.tr.residual(here.z))
        except np.linalg.LinAlgError:
            return False
        return _is_long(here.tr.relative_step(step))


def _is_long(first_step: float) -> bool:
    """Whether Newton's first step from a guess of few points is as long as coordinates are large.

    So it is where they miss the turns of a motion. Measured, in the coordinates' sizes: 3e-4 to
    0.13 from nine points that show the motion, 2.6 from nine that do not.
    """
    return not first_step < 1.0


def _quickly_past(search: Search, seen: Path, ways: tuple[Strategy, ...] = CHEAP) -> Status:
    """Seek a path by quick ways from nothing, if it passes near the nodes of the guess `seen`.

    A guess of few points that misses the turns of a motion leads nowhere by itself.
    """
    if search.strategies in (IPOPT, GUESS_ONLY) or search.given is not None:
        return Status.NOT_FOUND
    other = Search(search.ws.again(), search.tol, search.principle, None, ways)
    other.may_be_least = search.wants_least
    status = other.try_each(ways)
    if status in REACHED:
        here = other.ws.here
        away = np.abs(here.path(seen.mesh.nodes) - seen.values).max(axis=1)
        if np.any(away > FOLLOWED_REACH * here.sizes):
            return Status.NOT_FOUND
        search.take(other)
    return status


def _from_few(
    search: Search, curve_of: Callable[[Mesh], Path], *, sparse: bool
) -> tuple[Status, bool]:
    """Follow the guess on few elements that show all of it; a `sparse` one unless it is far.

    And whether it is one that is.
    """
    ws = search.ws
    if search.given is not None or search.strategies is IPOPT or not isinstance(curve_of, Sampled):
        return Status.NOT_FOUND, False
    for elements in COARSE_GUESS:
        mesh = search.uniform(elements, search.fine_degree())
        few = _if_shown(mesh, curve_of, ws.problem.scales)
        if few is not None:
            ws.transcribe(mesh, few, like=few)
            near = ws.follow()
            if not near and sparse and not ws.problem.system.m and _is_long(ws.first_step):
                return Status.NOT_FOUND, True
            near = (near or _comes_near(ws)) and ws.here.rough < ROUGHLY
            return search.refine() if near else Status.NOT_FOUND, False
    return Status.NOT_FOUND, False


def _if_shown(mesh: Mesh, guess: Sampled, scales: Array) -> Path | None:
    """Return the guess on a mesh of few elements if these show all of it, else None.

    That is asked at the nodes of as many elements as the first of `GUESS_MESHES`.
    """
    parts, t0 = GUESS_MESHES[0] // mesh.elements, mesh.boundaries[0]
    between = [_between(g.rule.degree, parts) for g in mesh.groups]
    times = [mesh.nodes]
    for g, (xi, _) in zip(mesh.groups, between, strict=True):
        middle = (mesh.since[g.elements] + mesh.since[g.elements + 1]) / 2
        times.append((middle[:, None] + mesh.lengths[g.elements, None] / 2 * xi).ravel() + t0)
    values = guess.at(np.concatenate(times))
    few = Path.through(mesh, values[:, : times[0].size].copy())
    shown = [
        (few.values[:, g.nodes] @ matrix).reshape(len(values), -1)
        for g, (_, matrix) in zip(mesh.groups, between, strict=True)
    ]
    missed = np.abs(values[:, times[0].size :] - np.concatenate(shown, axis=1)).max(axis=1)
    return few if (missed <= GUESS_RESOLUTION * sizes(values.T, scales)).all() else None


@cache
def _between(degree: int, parts: int) -> tuple[Array, Array]:
    """Return the nodes (P,) between the ends of an element of so many parts, of a coarse degree.

    And the matrix (d + 1, P) that maps nodal values to values there.
    """
    middles = (2 * np.arange(parts)[:, None] + 1) / parts - 1
    xi = (middles + lgl(COARSE_DEGREE).nodes[:-1] / parts).ravel()[1:]
    return xi, lgl(degree).interpolation(xi).T


def _near(search: Search) -> bool:
    """Move the iterate at hand to the stationary path near it."""
    ws, first = search.ws, search.ws.here
    if search.strategies is IPOPT:
        return ws.root()
    if ws.follow() or _comes_near(ws):
        return True
    settled = ws.here
    if ws.problem.system.m:  # damped steps may leave the surface, and come to another path
        for here in (settled, first):
            ws.here = here
            if ws.approach(PATIENT):
                return True
        ws.here = settled
    return False


def _continue(search: Search, *, far: bool) -> bool:
    """Continue from the iterate at hand; `far` by what takes longest, too.

    That is worth it on the first mesh, and on the one that shows most of the guess.
    """
    ws = search.ws
    if search.strategies in (IPOPT, GUESS_ONLY):
        return False
    if ws.root():
        return True
    from actionopt.solver.search.homotopy import newton_homotopy

    return far and not ws.large and ws.go("continuation", newton_homotopy)


def _comes_near(ws: Workspace) -> bool:
    """Move an iterate that is not near to the stationary path next to it, as far as is quick."""
    return (ws.problem.system.m == 0 and ws.approach(PATIENT)) or ws.settle()


def _fine_enough(search: Search, curve_of: Callable[[Mesh], Path]) -> list[Mesh]:
    """Return the meshes to try: uniform ones that resolve the guess, or first those made for it.

    A motion of many turns is lost on a mesh that misses them; a kink is resolved by none.
    """
    meshes = [search.uniform(elements, COARSE_DEGREE) for elements in GUESS_MESHES]
    for k, mesh in enumerate(meshes):
        curve = curve_of(mesh)
        shown = _resolution_of(search, curve)
        if curve.mesh is not mesh or shown.worst < GUESS_RESOLUTION:
            return meshes[k:]
    found = _refine_guess(search, curve_of, curve, (GUESS_RESOLUTION, 1))
    if found is None:
        return meshes
    finer = _refine_guess(search, curve_of, found, SHORT_TURN)
    return [found.mesh, *([] if finer is None else [finer.mesh]), *meshes]


def _show_turns(search: Search, curve_of: Callable[[Mesh], Path]) -> Path | None:
    """Return a guess with turns far shorter than the way on a mesh that shows the forces there.

    Where it is the path, Newton's method finds it from there, and another one from a coarser mesh.
    """
    few, *_, many = (search.uniform(elements, COARSE_DEGREE) for elements in GUESS_MESHES)
    curve = curve_of(few)
    if curve.mesh is not few or _resolution_of(search, curve).worst < GUESS_RESOLUTION:
        return None
    return _refine_guess(search, curve_of, curve_of(many), SHARP)


def _refine_guess(
    search: Search, curve_of: Callable[[Mesh], Path], curve: Path, wanted: tuple[float, int]
) -> Path | None:
    """Return the guess on a mesh that leaves out little of it, from a `curve` on a coarser one.

    Coefficients below the first of what is `wanted`, with nodes at most as often as the second says
    those of the largest other mesh; None if that is not enough.
    """
    target, most = wanted
    for _ in range(HALVINGS):  # a mesh does not show all that it leaves out of a short turn
        mesh = cheapest_mesh(_resolution_of(search, curve), target / 2)
        if mesh.nodes.size > most * (GUESS_MESHES[-1] * COARSE_DEGREE + 1):
            return None
        curve = curve_of(mesh)
        if _resolution_of(search, curve).worst < target:
            return curve
    return None


def _resolution_of(search: Search, curve: Path) -> Resolution:
    """Return what the mesh of a curve resolves of it."""
    values = curve.values.T
    return resolution(curve.mesh, values, sizes(values, search.ws.problem.scales))
