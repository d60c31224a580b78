"""Search for paths of least action along an obstacle: where to begin, and which is the least.

Round one body, of linear equations, strings drawn taut round it tell what is in contact
(`taut_strings`). Otherwise Ipopt's paths from lines past the obstacle do (`first_contacts`); where
nodes do not see it, as at an edge that is sharper than they are apart, strings again, and finer
meshes. What is in contact is held there (`obstacle`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import suppress
from copy import copy

import numpy as np

from actionopt.analysis.solution import Solution
from actionopt.analysis.status import Status
from actionopt.discrete.action.transcription import Transcription
from actionopt.discrete.borders.borders import times_of
from actionopt.discrete.borders.integrals import integrals
from actionopt.discrete.matrices.factors import Factors
from actionopt.discrete.meshes.boundaries import with_boundaries
from actionopt.discrete.meshes.mesh import Mesh
from actionopt.discrete.meshes.path import Path
from actionopt.discrete.newton.discrete_path import DiscretePath
from actionopt.mechanics.question.held import Held, contacts_of
from actionopt.mechanics.question.obstacle import Arc
from actionopt.mechanics.question.problem import Problem
from actionopt.solver.contact.first_contacts import (
    NO_ROOM,
    contact_parts,
    hidden_contact_times,
    is_of_higher_order,
    lines,
    narrow_contact_times,
    other_sides,
    sideways,
    touch,
)
from actionopt.solver.contact.obstacle import (
    DEPENDENT,
    FAMILY,
    FLAT,
    KINKED,
    ORDER,
    VANISHING,
    Along,
    ContactChange,
)
from actionopt.solver.contact.taut_strings import Strings, WayOut
from actionopt.solver.refinement.family import is_soft
from actionopt.solver.refinement.first_mesh import (
    FIRST_TOL,
    LINEAR,
    is_free,
    plan_mesh,
    steady_rates,
    straight_line,
)
from actionopt.solver.refinement.iterate import Iterate
from actionopt.solver.refinement.refine import refine
from actionopt.tools.types import EPS, Array
from actionopt.tools.watch import OutOfTime, Spent, Watch

# Ad hoc, all of them.
SOUGHT, SOUGHT_DEGREE = 16, 4  # elements on which contact is sought first, and their degree
SOUGHT_ON_LEG = 8  # of them, at least between two events
CONTACT_MESHES, CONTACT_ELEMENTS = 7, 200  # meshes on which it is sought, and elements of one
# What finer meshes may cost that find no path, in second derivatives on one element: those that did
# took 2,500 to 24,000 (four of 120 random obstacles), one round two thin walls 245,000 for nothing.
FINER = 40_000
CHANGES = 8  # of what is in contact, before it is given up
SMALL_OBSTACLE = (
    "round something small or sharp contact is short: below about a thousandth of the path it may "
    "not be found; give a guess that goes round it, or make it larger or rounder"
)
# Parts of what integrals differ by from those of straight lines, and first paths and steps there.
EASED, MOST_EASED, LED = (0.8, 0.5, 0.2), 2, 80
# To which they are resolved (with a thousandth the next ones were lost), and steps given up at.
LED_TOL, SHORTEST_LED = 1e-5, 1e-3
OTHER_VALUES = "no path outside of the obstacle was found whose integrals have the values given"
HOPELESS = (NO_ROOM, KINKED, ORDER, DEPENDENT)  # what finer meshes do not mend


def find_least_along(
    ws: Along, tol: float, curve_of: Callable[[Mesh], Path] | None
) -> tuple[Along, Status]:
    """Find the path along the obstacle that is least near a guess or, without one, near lines.

    Return the search that has it, and the verdict.

    That is the straight one and, against symmetries that would hold the path there, curved ones to
    either side, and then the other side of each part that touches; of what Ipopt finds from them,
    the least action first. Where that is lost another is kept, and contact sought more finely.
    """
    kept: tuple[Along, Status] | None = None
    last = ws, Status.NOT_FOUND
    try:
        for found, status, least in _search(ws, tol, curve_of):
            last = found, status
            if status is Status.NOT_FOUND or status is Status.UNRESOLVED:
                continue
            if kept is None or found.here.action < kept[0].here.action:
                kept = last
            if least:
                break
    except OutOfTime:
        if kept is None:
            raise
    except Spent:
        pass
    return kept or last


def _search(
    ws: Along, tol: float, curve_of: Callable[[Mesh], Path] | None
) -> Iterator[tuple[Along, Status, bool]]:
    """Yield what is found on finer and finer meshes: see `_least`."""
    problem, done = ws.question, False
    since = _first_boundaries(problem)
    for k in range(CONTACT_MESHES):
        if k == 1:
            ws.watch = ws.watch or Watch(None, None)
            if ws.watch.has_costs:
                ws.watch.most = ws.watch.evaluated + FINER
        mesh = Mesh.over(problem.start.t, problem.end.t, since, SOUGHT_DEGREE)
        if problem.through:
            mesh = with_boundaries(mesh, problem.boundaries)
        if k == 0 and curve_of is None:
            if drawn := _round_one_body(ws, tol, mesh):
                yield drawn
            ws.units = None  # of the rows themselves
        guesses = lines(problem, mesh) if curve_of is None else [curve_of(mesh)]
        # The straight line may be a trap, in which Ipopt goes about for long.
        principle = "patient least" if k or len(guesses) == 1 else "least"
        first: list[Iterate] = []
        for guess in guesses:
            ws.restart()
            if touch(ws, mesh, guess, principle):
                first.append(ws.here)
            elif ws.unbounded and guess is None:
                yield ws, Status.UNBOUNDED, True
        windows: list[Array] = []
        if first:
            if curve_of is None:
                first = _both_sides(ws, mesh, first)
            first.sort(key=lambda found: found.action)
            windows = hidden_contact_times(first[0])
            if not windows:
                windows = narrow_contact_times(first[0])
                found = _least(ws, tol, first)
                done = found[1].success
                yield found
            ws.take_up(first[0])
        elif problem.integral is not None:
            ws.hint = OTHER_VALUES
        if k == 0 and problem.integral is not None and curve_of is None and not done:
            led = _lead(ws, tol, mesh)
            if led is not None:
                yield led
        if k == 0 and (drawn := _draw_strings(ws, tol, mesh, guesses[0])):
            yield drawn
        since = np.unique(np.concatenate([since, *(windows or [(since[:-1] + since[1:]) / 2])]))
        if since.size > CONTACT_ELEMENTS or ws.hint in HOPELESS:
            return


def _first_boundaries(problem: Problem) -> Array:
    """Return times since the start at which elements end on which contact is sought first."""
    if not problem.through:
        return np.linspace(0.0, problem.duration, SOUGHT + 1)
    times = np.array([e.t for e in problem.joints_found]) - problem.start.t
    parts = np.maximum(SOUGHT_ON_LEG, np.ceil(SOUGHT * np.diff(times) / times[-1]).astype(int))
    legs = zip(times[:-1], times[1:], parts, strict=True)
    return np.unique(np.concatenate([np.linspace(a, b, k + 1) for a, b, k in legs]))


def _draw_strings(
    ws: Along, tol: float, mesh: Mesh, guess: Path | None
) -> tuple[Along, Status, bool] | None:
    """Return what is found from strings drawn taut round the obstacle, on a guess's side or both.

    Nodes see neither a wall that is thinner than they are apart nor an edge that is sharper, and
    Ipopt's path goes through.
    """
    problem, best = ws.question, None
    if problem.system.n == 1 or problem.system.m or problem.is_course:
        return None
    sizes, free = problem.measures, _free_path(ws, mesh)
    strings = Strings.round(contacts_of(free.problem), free.path)
    across = sideways(problem, free.path)
    for sign in (1.0, -1.0) if guess is None else (1.0,):
        ws.restart()
        ws.take_up(free)

        def side(t: float, sign: float = sign) -> Array:
            away = sign * across if guess is None else (guess(t) - free.path(t)) / sizes
            return away / max(float(np.linalg.norm(away)), EPS)

        string = strings.draw(side, ws.first_degree(True), ws.free_elements(True))
        if string is None:
            continue
        status = refine_contact(ws, tol, string[1], string[0])
        if status is not Status.NOT_FOUND and (not best or ws.here.action < best[0].here.action):
            best = copy(ws), status, True
    return best


def _free_path(ws: Along, mesh: Mesh) -> Iterate:
    """Return the path that sees no obstacle; the straight line where there is none."""
    _stand_free(ws, mesh, sought=True)
    ws.follow()
    return ws.here


def _least_linear(ws: Along, mesh: Mesh) -> Iterate | None:
    """Return the path of linear equations that sees no obstacle; None if it is not least.

    On the mesh on which it would be found without one, or on a given one if that has less nodes.
    """
    problem = ws.question
    if problem.system.structure.steady and not any(problem.singular_ends):
        ws.phases = max(steady_rates(problem))
        planned = plan_mesh(problem, ws.tol, LINEAR)
        mesh = min(mesh, planned, key=lambda x: x.offsets[-1])
    _stand_free(ws, mesh, sought=False)
    tr, z = ws.here.tr, ws.here.z
    with ws.record.clock("solve"), suppress(np.linalg.LinAlgError):
        factors = Factors(tr.layout, tr.kkt(z))
        if factors.definite():
            ws.here = ws.here.moved(z - factors.solve(tr.residual(z)))
            return ws.here
    return None


def _stand_free(ws: Along, mesh: Mesh, *, sought: bool) -> None:
    """Stand on the straight line, where nothing sees the obstacle."""
    ws.restart()
    ws.units = None
    ws.problem = held = Held(ws.question, (), sought=sought)
    ws.transcribe(mesh, None, np.zeros((mesh.nodes.size, held.system.m)))


def _round_one_body(ws: Along, tol: float, mesh: Mesh) -> tuple[Along, Status, bool] | None:
    """Return the least of what is found from strings round the one body that a free path meets.

    Where equations are linear, that path is the only one, and it is least where it meets no body.
    Round a convex body in two coordinates one path passes on either side: what Ipopt would look for
    is known. In more coordinates it is known where the nearest way is by far the nearest. None if
    there is no such string, or the path found from it is in contact elsewhere as well, or not
    least.
    """
    problem, best, far = ws.question, None, np.inf
    n, m = problem.system.n, problem.system.m
    beside = problem.advance is not None or problem.is_course
    if n == 1 or m or beside or not problem.system.structure.linear:
        return None
    if is_free(problem):
        first, path, ws.phases = None, straight_line(problem, mesh), 0.0
    else:
        first = _least_linear(ws, mesh)
        if first is None:
            return None
        path = first.path.on(mesh)
    out = WayOut.of(Held(problem, ()), path, straight=first is None)
    if out is None:
        if first is None and _least_linear(ws, mesh) is None:
            return None
        status = refine_contact(ws, tol, ())
        least = status.success and not ws.contact_problem.arcs and not ws.here.index
        return (ws, status, True) if least else None
    other = out.beside(out.other_sides(sideways(problem, path)))
    if other is not None:
        far = _action_of(problem, *other)
    for side in (out.normal, -out.normal) if n == 2 else (out.normal,):
        if best and far > best[0].here.action:
            return best
        count = ws.free_elements(True)
        string = out.strings.draw(lambda _, side=side: side, ws.first_degree(True), count)
        if string is None or len(string[1]) != 1 or _meets_another(problem, *string):
            return best and (*best[:2], False)
        if n > 2 and far < _action_of(problem, string[0].mesh.nodes_since, string[0].values.T):
            return None
        ws.restart()
        if first is None:
            ws.checked = True  # of such an L nothing can be wrong
            moves = problem.system.with_contact.structure.depends_on_time
            ws.convex = out.body.ellipsoid is not None and problem.system.r == 1 and not moves
        else:
            ws.take_up(first)
        status, arcs = refine_contact(ws, tol, string[1], string[0]), ws.contact_problem.arcs or ()
        if not status.success or ws.here.index or {x.row for x in arcs} != {string[1][0].row}:
            return best and (*best[:2], False)
        if best is None or ws.here.action < best[0].here.action:
            best = copy(ws), status, True
    return best and (*best[:2], n == 2 or far > best[0].here.action)


def _meets_another(problem: Problem, string: Path, arcs: tuple[Arc, ...]) -> bool:
    """Whether a string passes through other rows of the obstacle than those it lies on."""
    if problem.system.r == 1:
        return False
    f = problem.system.with_contact.constraint(
        string.values, string.mesh.nodes, parameters=problem.parameters
    )[problem.system.m :]
    return bool((np.delete(f, [arc.row for arc in arcs], axis=0) < 0).any())


def _action_of(problem: Problem, since: Array, q: Array) -> float:
    """Return about the action along straight lines between places (K, n) at times since the start.

    The times are (K,).
    """
    apart, middle = since[1:] - since[:-1], (since[1:] + since[:-1]) / 2
    state = (q[1:] + q[:-1]) / 2, (q[1:] - q[:-1]) / apart[:, None], problem.start.t + middle
    L = problem.system.pointwise("value")(*state[:2], state[2][:, None], problem.packed)[0]
    return float(L[:, 0] @ apart)


def _both_sides(ws: Along, mesh: Mesh, first: list[Iterate]) -> list[Iterate]:
    """Return first paths, and those on the other side of each part of the least that touches."""
    compared: list[Iterate] = []
    while _another(least := min(first, key=lambda found: found.action), compared):
        compared.append(least)
        for guess in other_sides(least, contact_parts(least)):
            ws.restart()
            if touch(ws, mesh, guess, "least"):
                first.append(ws.here)
    return first


def _least(ws: Along, tol: float, first: list[Iterate]) -> tuple[Along, Status, bool]:
    """Refine first paths, in order of their action.

    Return the search that has the least, the verdict, and whether none of less action was lost.

    To keep only the nodes outside the obstacle is a relaxation: a path whose action is then above
    that of a refined path is not the least.
    """
    best: Along | None = None
    status = Status.NOT_FOUND
    tried: list[Iterate] = []
    least = True
    for found in first:
        if best and not (found.action < best.here.action and _another(found, tried)):
            continue
        tried.append(found)
        ws.restart()
        ws.take_up(found)
        try:
            last = refine_contact(ws, tol, contact_parts(ws.here))
        except (OutOfTime, Spent):
            if best is None:
                raise
            break
        if last.success or last in (Status.FLOOR, Status.DEGENERATE):
            if best is None or ws.here.action < best.here.action:
                best, status = copy(ws), last
        elif best is None:
            status, least = last, False
    return best or ws, status, least


def _another(found: Iterate, tried: list[Iterate]) -> bool:
    """Whether a path differs from all of these, on one mesh."""
    apart = [np.abs(found.Q - other.Q) / found.tr.lengths for other in tried]
    return all(difference.max() > FLAT for difference in apart)


def _lead(ws: Along, tol: float, mesh: Mesh) -> tuple[Along, Status, bool] | None:
    """Return what a continuation in the values of integrals leads to, from nearer to straight.

    A rope that nearly hangs straight down turns within less than elements are long, and the tension
    that is left changes by orders with a little of the length.
    """
    asked = ws.question.original
    times, values = times_of(asked), np.array(asked.integral)
    tr = Transcription(asked, mesh, asked.lengths)
    first = integrals(DiscretePath(tr, tr.pack(tr.straight())))[0]

    def slack(share: float) -> Problem:
        return asked.replace(integral=first + share * (values - first))

    for share in EASED:
        near = _first_led(ws, mesh, slack(share))
        if near is not None:
            break
    else:
        return None
    step = 1.0 - share
    for _ in range(LED):
        further = min(share + step, 1.0)
        last, status = tol if further == 1.0 else LED_TOL, Status.NOT_FOUND
        known = slack(further).found_at(times, kappa=near.here.problem.kappa)
        there = Along(Held(known), tol=ws.tol, watch=ws.watch, checked=True)
        there.problem = Held(known, near.contact_problem.arcs)
        there.transcribe(near.here.mesh, near.here.path, near.here.rows, like=near.here.path)
        with suppress(ContactChange, np.linalg.LinAlgError):
            if there.follow() or there.approach():
                status = refine(there, last, least=True)
                changed = there.next_contacts(last / 4) if status.success else None
                if changed is not None:
                    status = refine_contact(there, last, changed, resolved=True)
                elif status.success and further == 1.0:
                    status = _judge(there, tol, status)
        if not status.success:
            step /= 2
            if step < SHORTEST_LED:
                return None
            continue
        if further == 1.0:
            return there, status, True
        near, share, step = there, further, 2 * step
    return None


def _first_led(ws: Along, mesh: Mesh, problem: Problem) -> Along | None:
    """Return a search that found a path of other values of integrals, or None."""
    other = Along(Held(problem), tol=ws.tol, watch=ws.watch, checked=True)
    for guess in lines(problem, mesh)[:MOST_EASED]:
        other.restart()
        if touch(other, mesh, guess, "patient least"):
            arcs = contact_parts(other.here)
            if refine_contact(other, FIRST_TOL, arcs, resolved=True).success:
                return other
    return None


def release_contacts(ws: Along, tol: float, near: Solution) -> Status:
    """Go from a path between given events to one whose ends or duration are to be found.

    With its parts in contact or, where that fails, with none at first: they may be about to vanish.
    """
    question, status = ws.question, Status.NOT_FOUND
    for arcs in dict.fromkeys((near.contacts, ())):
        ws.restart()
        ws.problem = Held(question, arcs)
        ws.transcribe(near.mesh, near.path, near.lam.T if arcs else None, like=near.path)
        status = refine_contact(ws, tol, arcs)
        if status.success:
            break
    return status


def refine_contact(
    ws: Along,
    tol: float,
    arcs: tuple[Arc, ...],
    curve: Path | None = None,
    *,
    resolved: bool = False,
) -> Status:
    """Hold what is in contact and refine the path, until all conditions are satisfied.

    That are the `arcs` along the path at hand, which may be `resolved`, or along a `curve`, which
    is.
    """
    allowed, ws.freed = tol / 4, False
    coarse = 2 * float(np.diff((ws.here if curve is None else curve).mesh.nodes).max())
    for k in range(CHANGES):
        if k == CHANGES - 1:  # what comes and goes is shorter than times can be told apart
            allowed = max(tol, VANISHING[1])
        ws.hold(arcs, curve, resolved=resolved or curve is not None)
        held = ws.here
        try:
            eased, curve = curve is not None, None
            lost = eased and (ws.flat or not ws.ease())
            if lost or not ws.follow(joined=eased):
                ws.hint = ws.why()
                if ws.hint == FAMILY and ws.question.integral and ws.question.advance is None:
                    ws.hint = OTHER_VALUES
                elif (
                    ws.hint == FAMILY
                    and min((x.end - x.begin for x in arcs), default=coarse) < coarse
                ):
                    ws.hint = SMALL_OBSTACLE
                return Status.NOT_FOUND
            ws.hint = ""
            other = ws.next_contacts(allowed)
            if other is None:
                if not ws.as_given():
                    ws.hint = ws.why()
                    return Status.DEGENERATE if is_soft(ws.here) else Status.NOT_FOUND
                looked_at = ws.here.z
                status = refine(ws, tol, least=True)
                resolved = True
                if status.success and ws.here.z is not looked_at:
                    other = ws.next_contacts(allowed)
                if other is None:
                    return _judge(ws, tol, status)
            arcs = other
        except ContactChange as change:
            arcs = change.arcs
        except np.linalg.LinAlgError:
            given = ws.question.integral is not None
            ws.hint = ORDER if is_of_higher_order(held) else OTHER_VALUES if given else DEPENDENT
            return Status.NOT_FOUND
    if ws.inside > allowed:
        ws.hint = SMALL_OBSTACLE
        return Status.NOT_FOUND
    return Status.UNRESOLVED


def _judge(ws: Along, tol: float, status: Status) -> Status:
    """Return the verdict on a path that may be inside of the obstacle by a part of the tolerance.

    Where it is held at last it moves by as much.
    """
    depth = 2 * ws.inside
    if status.success and ws.here.error + depth > tol:
        status = refine(ws, max(tol - depth, tol / 2), least=True)
    error = ws.here.error + depth
    ws.here = ws.here.with_values(error=error)
    return Status.FLOOR if status.success and error > tol else status
