"""Hamilton's principal function: how the action of a path changes with its ends and parameters.

    dS = p1.dq1 - p0.dq0 - H1 dt1 + H0 dt0 + int (dL/da) dt da

(Hamilton and Jacobi; the last term because S is stationary in all else). At events between the ends
momentum and energy jump by what S changes with their places and times, -[p].dq + [H] dt, and by the
values G of integrals it changes by -kappa dG. For a discrete path
these are exact derivatives of the discrete action (those by the times are in `end_times`), so that
no difference is taken, nothing is solved again, and the accuracy is that of the action.
"""

from __future__ import annotations

from dataclasses import replace

import casadi as ca
import numpy as np

from actionopt.analysis.quadratic.assembled import AssembledForm, assemble, some_columns
from actionopt.analysis.quadratic.jacobi import resolve
from actionopt.analysis.quadratic.second_variation import Form, ends_hessian, form, tangent
from actionopt.discrete.borders.bordered import equations_of
from actionopt.discrete.borders.contact_times import bend_of_contacts
from actionopt.discrete.borders.end_times import jumps_of
from actionopt.discrete.borders.stretch import explicit
from actionopt.discrete.borders.surfaces import reactions, surface_at
from actionopt.discrete.matrices.factors import Factors, product
from actionopt.discrete.matrices.layout import BorderedLayout, border_matrix
from actionopt.discrete.newton.discrete_path import DiscretePath
from actionopt.mechanics.laws.laws import keep
from actionopt.mechanics.laws.tracing import MULTIPLIERS, SWITCHES
from actionopt.mechanics.question.course import jet_normals
from actionopt.mechanics.question.events import RATES
from actionopt.mechanics.question.held import Held
from actionopt.mechanics.question.problem import Problem
from actionopt.mechanics.question.rest import Rest
from actionopt.mechanics.system import System
from actionopt.tools.blas import one_thread
from actionopt.tools.immutable import immutable
from actionopt.tools.shown import one_line
from actionopt.tools.types import EPS, RANK, Array

# What the mesh leaves out of Jacobi fields; derived: second derivatives converge twice as fast, to
# 1e-10. Measured: along paths known to 1e-8, some at rest, off by 4e-11 at most, as with 1e-8 here.
SENSITIVITY_RESOLUTION = 1e-5
# Coordinates from which on columns may be grouped, how many times fewer these are to be, and what
# they may have in common, of the largest: some round-off. Ad hoc.
GROUPED, FEWER, FELT = 80, 2, 16 * EPS


@immutable
class Sensitivity:
    """First and second derivatives of the action S(q0, t0, q1, t1; parameters).

    A coordinate that an event leaves free is determined by the others: derivatives by it are
    zero; where it lies on a surface it moves with that, at its `parameters`, too. With
    constraints, events may move only along the surface, and first derivatives are to be combined
    with motions that do. Where L contains accelerations, velocities at the events stand behind the
    coordinates in all of them: q0 (2 n,), q0q0 (2 n, 2 n), and so on for higher derivatives;
    under constraints all have about half of the path's digits.

    Attributes
    ----------
    q0, q1 : (n,) arrays
        dS/dq0 = -p0 and dS/dq1 = p1; more where constraints move what is free with what is given.
    t0, t1 : float
        dS/dt0 = H0 and dS/dt1 = -H1, at fixed coordinates.
    parameters : dict
        dS/da by name, in the parameter's shape, at fixed events.
    q0q0, q0q1, q1q1 : (n, n) arrays
        Second derivatives by the ends; minus `q0q1` is Van Vleck's matrix. With constraints
        they are reduced to the tangent planes at the events: along a curve q(s) on the surface
        add dS/dq . q''. Infinite or huge where the ends are conjugate, NaN where S has none, by a
        coordinate at an end where L is infinite. Times and places of events
        between the ends, and multipliers, follow the ends; the duration does not.
    through_q : (k, n) array
        dS/dq = -[p] at the events between the ends: minus the `impulses` in coordinates that are
        given.
    through_t : (k,) array
        dS/dt = [H] there, at fixed coordinates; zero for a time that was to be found.
    integral : (c,) array
        dS/dG = -kappa, by the values of integrals that are given.
    """

    q0: Array
    q1: Array
    t0: float
    t1: float
    parameters: dict[str, Array]
    q0q0: Array
    q0q1: Array
    q1q1: Array
    through_q: Array
    through_t: Array
    integral: Array

    __repr__ = one_line

    def where(self, first: Array, last: Array) -> Sensitivity:
        """Return a copy with second derivatives by the coordinates that are true alone, (n,) each.

        NaN in place of the others.
        """
        one, other = (np.where(known, 0.0, np.nan) for known in (first, last))
        return replace(
            self,
            q0q0=self.q0q0 + one[:, None] + one,
            q0q1=self.q0q1 + one[:, None] + other,
            q1q1=self.q1q1 + other[:, None] + other,
        )

    @property
    def van_vleck(self) -> float:
        """Van Vleck's determinant of -d2S/dq0 dq1; with constraints it is zero."""
        return float(np.linalg.det(-self.q0q1))


@one_thread
def sensitivity(
    at: DiscretePath, error: float, momenta: tuple[Array, Array], impulses: Array, times: Array
) -> Sensitivity:
    """Return the derivatives of the action of a path by its events and parameters.

    `error` is the path's, `momenta` those at its ends, (n,) each, `impulses` (k, n) what momenta
    jump by at the events between, and `times` dS/dt of all events, (k + 2,). Raises ValueError for
    a path in contact with an obstacle, and for non-conservative forces: S is then no function of
    the ends that the momenta would be derivatives of.

    References
    ----------
    Goldstein, *Classical Mechanics* (3rd ed. 2002), sections 8.6 and 10.1; J. H. Van Vleck,
    *Proc. Natl. Acad. Sci.* 14 (1928), p. 178.
    """
    problem = at.problem
    if isinstance(problem, Held):
        _check_contacts(problem)
    if problem.system.structure.forced:
        form(at)  # raises
    second = second_through(at) if problem.is_course else _second_alone(at, error)
    found = slopes(at, momenta, impulses, times)
    for row, k in ((found["q0"], 0), (found["q1"], -1)):
        places = problem.joints[k].places(problem.system.order)
        row[[i for i, x in enumerate(places) if x is None]] = 0.0
    parameters = _unpack(problem.system, found["parameters"])
    for name in (MULTIPLIERS, SWITCHES):
        parameters.pop(name, None)
    t0, *through_t, t1 = found["times"].tolist()
    inner = found["through_q"], np.array(through_t), found["integral"]
    return Sensitivity(found["q0"], found["q1"], t0, t1, parameters, *second, *inner)


def _check_contacts(held: Held) -> None:
    """Raise ValueError where an end that is given is in contact."""
    ends = (held.start, held.original.start), (held.end, held.original.end)
    for event, asked in ends:
        if asked.pinned and any(event.t in (arc.begin, arc.end) for arc in held.arcs or ()):
            raise ValueError(
                f"expected a path that is free of the obstacle at its ends, found contact at "
                f"t = {event.t:g}: an end moves from there to one side alone, and S has no second "
                "derivative; see `momenta` for the first"
            )


def slopes(
    at: DiscretePath, momenta: tuple[Array, Array], impulses: Array, times: Array
) -> dict[str, Array]:
    """Return the first derivatives of S: by "q0", "q1" (n,), "times" (k + 2,), "through_q" (k, n).

    And by "integral" (c,) and "parameters" (p,), packed. Only where no force is non-conservative.
    """
    tr, problem, node_of = at.tr, at.problem, at.tr.layout.node_of
    system, place = problem.system, tr.place(at.x)
    times = times.copy()
    contact = tr.order > 1 and problem.touches
    lam = tr.multipliers_between(at.z) if contact else at.lam[node_of]
    by_parameters = explicit(system)(place.at, place.v, tr.times, problem.packed, lam)[1]
    packed = np.sum(tr.weight * by_parameters, axis=0)
    inner, steps = jumps_of(at)
    if inner:  # moved by parameters
        assert system.clock is not None
        packed = packed + steps @ system.clock.moving(inner, problem.packed)
    joints = problem.joints
    by_place = np.concatenate([-momenta[0][None], -impulses, momenta[1][None]])
    for k, event in enumerate(joints):
        free = [i for i, x in enumerate(event.places(system.order)) if x is None]
        between = 0 < k < len(joints) - 1
        if event.on is not None:  # S + mu.on is what is stationary
            mu, _ = reactions(at, k)
            _, by_q, by_t, by_p = surface_at(at, k)
            by_place[k, : system.n] += mu @ by_q
            times[k] += float(mu @ by_t)
            packed = packed + mu @ by_p
        if system.m and free and system.order == 1 and (between or problem.advance is None):
            by_q, by_t, by_p = _reaction(at, k, by_place[k], free)
            found = np.isnan(at.rows[tr.joints[k]]).all()  # its place was: no rows
            times[k] += by_t if found or between else 0.0
            packed = packed + (by_p if found else 0.0)
            by_place[k] += by_q
        if between:
            by_place[k, free] = 0.0
    if problem.has_tails:
        packed, level = _with_rest(at, momenta, packed)
        times[0] = 0.0 if problem.start.side else times[0] + level[0]
        times[-1] = 0.0 if problem.end.side else times[-1] - level[1]
    return {
        "q0": by_place[0],
        "q1": by_place[-1],
        "through_q": by_place[1:-1],
        "times": times,
        "integral": -problem.kappa,
        "parameters": packed,
    }


def _with_rest(
    at: DiscretePath, momenta: tuple[Array, Array], packed: Array
) -> tuple[Array, Array]:
    """Return the derivatives of S by parameters (p,) with those of what is beyond a window's edges.

    That goes with the system, as the place of rest does. And L at rest at both edges, (2,).
    """
    tr, problem = at.tr, at.problem
    system = problem.system
    known = next(x for x in problem.rests if x is not None)
    ends = np.array([[problem.start.t], [problem.end.t]])
    at_rest = np.broadcast_to(known.q, (len(tr.times), known.q.size))
    still, held = np.zeros_like(at_rest), np.tile(known.lam, (len(tr.times), 1))
    level = explicit(system)(at_rest, still, tr.times, problem.packed, held)[1]
    packed = packed - np.sum(tr.weight * level, axis=0)
    for k, rest in ((0, problem.rests[0]), (-1, problem.rests[1])):
        if rest is not None:  # S beyond the edge is one of q less its place at rest
            by_q, by_p = _rest_by_parameters(problem, rest, float(ends[k, 0]))
            change = momenta[k] @ by_q - (at.Q[k] - rest.q) @ by_p
            packed = packed + (change if k else -change)
    L = system.pointwise("value")(at_rest[:2], still[:2], ends, problem.packed)[0][:, 0]
    return packed, L


def _rest_by_parameters(problem: Problem, rest: Rest, t: float) -> tuple[Array, Array]:
    """Return the derivatives of q and p at rest by the packed parameters, (n, p) each."""
    system = problem.system
    found = _rest_slopes(system)(rest.q, np.zeros(system.n), t, problem.packed.ravel(), rest.lam)
    K, loads, slopes, direct = (x.full() for x in found)
    change = -np.linalg.lstsq(K, loads)[0]
    return change[: system.n], slopes @ change + direct


@keep
def _rest_slopes(system: System) -> ca.Function:
    """Return the function of how forces, then momenta, change with (q, lam) and parameters."""
    s, lam = system.symbols, ca.SX.sym("lam", system.m)
    L = system.L + (ca.dot(lam, system.f) if system.m else 0)
    forces, momenta = ca.vertcat(ca.jacobian(L, s.q).T, system.f), ca.jacobian(L, s.v).T
    unknown = ca.vertcat(s.q, lam)
    by = [ca.jacobian(x, y) for x in (forces, momenta) for y in (unknown, s.p)]
    return ca.Function("rest", [s.q, s.v, s.t, s.p, lam], [ca.densify(x) for x in by])


def _reaction(
    at: DiscretePath, k: int, by_place: Array, free: list[int]
) -> tuple[Array, float, Array]:
    """Return the derivatives of nu.f at event k by q (n,), t and the packed parameters (p,).

    What is `free` there moves along the constraints: S + nu.f is stationary in it, where S has the
    derivatives `by_place` (n,).
    """
    problem, node = at.problem, at.tr.joints[k]
    system, q, t = problem.system, at.Q[node], at.mesh.nodes[node]
    G = system.constraint_jacobian(q, t, parameters=problem.parameters)
    if isinstance(problem, Held):  # rows of the obstacle push where they are touched
        G = G * problem.active(np.array([t]))
    nu = -np.linalg.lstsq(G[:, free].T, by_place[free])[0]
    state = np.tile(q, (2, 1)), np.tile(at.path.velocity(t), (2, 1)), np.full((2, 1), t)
    by_t, by_p = explicit(system)(*state, problem.packed, np.stack([nu, 0 * nu]))
    return nu @ G, float(by_t[0, 0] - by_t[1, 0]), by_p[0] - by_p[1]


def _second_alone(at: DiscretePath, error: float) -> tuple[Array, Array, Array]:
    """Return the second derivatives of a path between two events, each (n, n)."""
    problem = at.problem
    even = len(problem.start.pinned) == len(problem.end.pinned)
    if not any(at.mesh.singular_ends) and (not problem.system.m or even):
        form = assemble(at, error, SENSITIVITY_RESOLUTION)
        found = None if form is None else _second_assembled(form)
        if found is not None:
            return found
    return _second(resolve(at, error, SENSITIVITY_RESOLUTION))


def _second_assembled(form: AssembledForm) -> tuple[Array, Array, Array] | None:
    """Return the second derivatives, what is between the ends eliminated; None if that fails."""
    at, tr, problem = form.at, form.at.tr, form.at.problem
    if problem.system.m:
        ends = [0, tr.layout.node_count - 1]
        planes = tangent(problem, at.Q[ends], tr.mesh.nodes[ends, None], tr.lengths)
        first, last = moved = [np.linalg.qr(x * tr.lengths[:, None])[0] for x in planes]
    else:
        given = problem.start.pinned, problem.end.pinned
        first, last = moved = [np.eye(problem.system.n)[:, list(k)] for k in given]
    hessian = _by_groups(form, moved)
    hessian = _along(form, moved, moved) if hessian is None else hessian
    if hessian is None:
        return None
    cut = first.shape[1]
    own, across, other = hessian[:cut, :cut], hessian[:cut, cut:], hessian[cut:, cut:]
    if not problem.system.m and first.shape == last.shape:  # the coordinates themselves
        return own, across, other
    return first @ own @ first.T, first @ across @ last.T, last @ other @ last.T


def _by_groups(form: AssembledForm, moved: list[Array]) -> Array | None:
    """Return what `_along` does where a move of one coordinate is felt by those next to it alone.

    Columns that have nothing in common are found as one: A. R. Curtis, M. J. D. Powell and
    J. K. Reid, *J. Inst. Maths Applics* 13 (1974), p. 117. None where it is felt too far.
    """
    system = form.at.problem.system
    n, second, place = system.n, system.pointwise("second"), np.arange(system.n)
    width = max(int(np.abs(np.subtract(*second.sparsity(k))).max(initial=1)) for k in range(3))
    if system.m or n < GROUPED * width or moved[0].shape != moved[1].shape:
        return None

    def ask(columns: Array) -> Array | None:
        found = _along(form, [columns, columns], moved)
        return None if found is None else found.reshape(2, n, 2, -1)

    middle = n // 2
    one = ask(np.eye(n)[:, [middle]])
    if one is None:
        return None
    units = form.at.tr.lengths  # in which inertias are even
    size = np.abs(one).max(axis=(0, 2, 3)) * units
    reach = int(np.abs(place - middle)[size > EPS * size.max()].max()) + width
    apart = 2 * reach + 1
    if n < FEWER * apart or (found := ask(np.eye(apart)[place % apart])) is None:
        return None
    row, away = (x.ravel() for x in np.meshgrid(place, np.arange(-reach, reach + 1)))
    near = (row + away >= 0) & (row + away < n)
    row, col, away = row[near], (row + away)[near], np.abs(away[near])
    values = found[:, row, :, col % apart]  # (near, 2, 2)
    size = np.abs(values).max(axis=(1, 2)) * units[row] * units[col]
    # What is felt at the edges of what counts as near is felt beyond, too.
    if not size[away > reach - width].max() <= FELT * size.max():
        return None
    hessian = np.zeros((2, n, 2, n))
    hessian[:, row, :, col] = values
    return hessian.reshape(2 * n, 2 * n)


def _along(form: AssembledForm, moved: list[Array], by: list[Array]) -> Array | None:
    """Return d2S by moves of the ends, (n, c) each, and moves `by` which its rows are.

    None where what is between the ends is singular.
    """
    tr, layout, n = form.at.tr, form.at.tr.layout, form.units.size
    unknowns, missed, parts = layout.unknowns, [], []
    edges = np.full(layout.node_count * n, -1)
    edges[:n], edges[-n:] = np.arange(2 * n).reshape(2, n)
    inside = [x.part(layout.number.ravel(), tr.x_unit / tr.action_unit) for x in form.couplings]
    for k, plane in enumerate(moved):
        beside = form.couplings[k].part(edges)
        for some in some_columns(plane.shape[1], layout.size):
            move = plane[:, some]
            # All as wide as the first, for a solver of as many columns, and these in its order.
            loads = np.zeros((some.stop - some.start, layout.size)).T
            loads[:unknowns, : move.shape[1]] = inside[k].times(move, unknowns)
            try:
                between = form.factors.solve(loads)[:, : move.shape[1]]
            except np.linalg.LinAlgError:  # conjugate
                return None
            if not np.isfinite(between).all():
                return None
            by_ends = beside.times(move, 2 * n).reshape(2, n, -1)
            for change, coupling in zip(by_ends, inside, strict=True):
                change -= tr.action_unit * coupling.transpose.times(between[:unknowns], n)
            if layout.rows:
                for left, column in zip(loads.T, between.T, strict=False):
                    left -= product(layout, form.matrix, column)
                missed.append((between, loads[:, : move.shape[1]]))
            parts.append(np.concatenate([p.T @ x for p, x in zip(by, by_ends, strict=True)]))
    hessian = np.concatenate(parts, axis=1)
    if missed:  # the factors are off by 1e-10, and this by the square of it
        between, left = zip(*missed, strict=True)
        hessian -= tr.action_unit * np.block([[x.T @ y for y in left] for x in between])
    return hessian


def _second(form: Form) -> tuple[Array, Array, Array]:
    """Return the second derivatives by q0 twice, q0 and q1, q1 twice, each (n, n)."""
    hessian = ends_hessian(form)
    problem, n = form.tr.problem, form.units.size
    maps, first = [], 0
    for k, count in enumerate(form.pinned):
        # Directions a of the pinned coordinates: dq = units * basis a, and none off a surface.
        asked = problem.surfaces[k]
        pinned = list((asked or (problem.start, problem.end)[k]).pinned)
        basis = (form.units[:, None] * form.basis[-k])[:, :count]
        directions = basis[pinned]
        if asked is not None:
            directions = np.concatenate([directions, surface_at(form.at, -k)[1] @ basis])
        to_directions = np.zeros((hessian.shape[0], n))
        inverse = np.linalg.pinv(directions)
        to_directions[first : first + count, pinned] = inverse[:, : len(pinned)]
        maps.append(to_directions)
        first += count
    start, end = maps
    return start.T @ hessian @ start, start.T @ hessian @ end, end.T @ hessian @ end


def second_through(at: DiscretePath) -> tuple[Array, Array, Array]:
    """Return them for a path through events or with given integrals, on its mesh.

    The ends are free in the equations, and held by multipliers: d2S is what these change by as the
    ends are moved, along the tangent planes of constraints.
    """
    problem, n, order = at.problem, at.tr.layout.width, at.tr.order
    asked, ends = problem.original, (problem.start, problem.end)
    start, end = (
        e._replace(t=x.t, q=None, **dict.fromkeys(RATES))
        for e, x in zip((asked.start, asked.end), ends, strict=True)
    )
    loose = asked.free.replace(start=start, end=end)
    if isinstance(problem, Held):  # path and action depend on times of contact to second order
        loose = Held(loose, problem.arcs, span=problem.span)
    equations, y = equations_of(loose, at)
    planes = [np.eye(n)] * 2
    if order > 1 and problem.free.system.m:
        planes = _planes_of_rates(at)
    elif order == 1:
        planes = tangent(problem.free, at.Q[[0, -1]], at.mesh.nodes[[0, -1], None], np.ones(n))
    nonzeros, layout = equations.kkt(y), equations.layout
    rows = np.zeros((0, 0))
    if order > 1 and problem.touches:  # contacts move
        tr = equations.at(y)
        bend, rows = bend_of_contacts(DiscretePath(tr, y[: tr.layout.size]))
        nonzeros[: bend.size] += bend
    number = (layout.inner if isinstance(layout, BorderedLayout) else layout).number
    edges, maps = [], []
    for k, event in enumerate((asked.start, asked.end)):
        pinned = list(event.pinned_places(order))
        plane, sizes, _ = np.linalg.svd(planes[k][pinned])
        plane = plane[:, : np.sum(sizes > RANK)]
        edges.append(np.zeros((layout.size, plane.shape[1])))
        edges[k][number[-k, pinned]] = plane * at.tr.place_units[pinned, None]
        maps.append(np.zeros((plane.shape[1], n)))
        maps[k][:, pinned] = plane.T
    edge = np.hstack([*edges, np.pad(rows.T, ((0, layout.size - rows.shape[1]), (0, 0)))])
    count, cut = edge.shape[1], len(maps[0])
    corner = np.zeros((count, count))
    matrix = border_matrix(layout, nonzeros, edge, edge.T, corner)
    right = np.eye(count, layout.size + count, layout.size)
    try:
        factors = Factors(*matrix)
        forces = np.array([factors.solve(row)[layout.size :] for row in right])
        forces = forces.reshape(count, count)
    except np.linalg.LinAlgError:  # conjugate
        infinite = np.full((n, n), np.inf)
        return infinite, infinite, infinite
    first, last = maps
    both = cut + len(last)
    hessian = -at.tr.action_unit * forces[:both, :both]
    return (
        first.T @ hessian[:cut, :cut] @ first,
        first.T @ hessian[:cut, cut:] @ last,
        last.T @ hessian[cut:, cut:] @ last,
    )


def _planes_of_rates(at: DiscretePath) -> list[Array]:
    """Return bases (n r, k) of the changes of q and its rates that constraints allow at ends."""
    system, found = at.problem.system, []
    for k, t in ((0, at.mesh.boundaries[0]), (-1, at.mesh.boundaries[-1])):
        y = np.concatenate([at.Q[k], *(x[k] for x in at.rates[: system.order - 1])])
        normals = np.array(jet_normals(system)(y, t, at.problem.packed))
        found.append(np.linalg.svd(normals)[2][len(normals) :].T)
    return found


def _unpack(system: System, packed: Array) -> dict[str, Array]:
    """Return packed derivatives by name, each in its parameter's shape."""
    result, first = {}, 0
    for name, shape in system.table.shapes.items():
        size = int(np.prod(shape))
        result[name] = packed[first : first + size].reshape(shape)
        first += size
    return result
