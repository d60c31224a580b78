"""Paths with accelerations along an obstacle: where they touch it, and where they lie on it.

Velocities are continuous, so that a path touches an obstacle tangentially: at a moment, where the
obstacle gives an impulse to the momentum of q alone, or along an arc, at whose ends it gives
impulses and between them a force nu(t) >= 0 (a beam on a floor). Where a moment or the end of an
arc is, df/dt = 0 tells: the acceleration is continuous as the momentum of v is. (A. E. Bryson,
W. F. Denham and S. E. Dreyfus, "Optimal programming problems with inequality constraints I",
*AIAA Journal* 1 (1963) 2544, section 5, have it for L = a^2 / 2.)

On a coarse mesh Ipopt minimises S with f >= 0 at the nodes; its multipliers tell moments from arcs.
What is in contact is held, its times are found, and the conditions looked at between the nodes, as
for other obstacles (`obstacle`).
"""

from __future__ import annotations

from collections.abc import Callable
from copy import copy
from dataclasses import dataclass
from time import perf_counter
from typing import NamedTuple

import casadi as ca
import numpy as np

from actionopt.analysis.status import Status
from actionopt.discrete.action.transcription import Transcription
from actionopt.discrete.borders.borders import times_of
from actionopt.discrete.meshes.boundaries import with_boundaries
from actionopt.discrete.meshes.mesh import Mesh
from actionopt.discrete.meshes.path import Path
from actionopt.discrete.newton.discrete_path import DiscretePath
from actionopt.mechanics.laws.switches import is_smooth
from actionopt.mechanics.question.held import Held, contacts_of
from actionopt.mechanics.question.obstacle import Arc
from actionopt.mechanics.question.problem import Problem
from actionopt.solver.contact.first_contacts import WEAK, lines, runs, sample_rows
from actionopt.solver.contact.least_along import SOUGHT, refine_contact
from actionopt.solver.contact.obstacle import FAMILY, INSIDE, KINKED, PULLING, Along
from actionopt.solver.input.preflight import check
from actionopt.solver.refinement.ipopt import minimize
from actionopt.solver.refinement.iterate import UnfixedPath
from actionopt.tools.types import EPS, Array

TOUCHED_DEGREE = 5  # of the elements on which contact is sought first; ad hoc
# Nodes between two that press, and what f is there in units of the rows: it is contact, too.
# What of all presses between the ends of an arc. Ad hoc.
FEW, CLOSE, INNER = 4, 1e-3, 1e-2
MISSED = 100.0  # weight in S, in its unit, of the squares of what integrals miss, in parts; ad hoc
TWO_PATHS = 1e-3  # in the coordinates' lengths: first paths that differ by more are two; ad hoc
NOT_TOUCHED = (
    "no path was found that touches the obstacle as a first one on a coarse mesh does: give a "
    "guess near the path, and as obstacle a function that grows as the distance from it"
)


@dataclass(eq=False)
class Touching(Along):
    """The workspace of a search for a path with accelerations along an obstacle."""

    # whether parts that would have to pull were let go: they are not held again for being near
    cut: bool = False

    def why(self) -> str:
        """Return why a path may not be found by Newton's method."""
        smooth = is_smooth(self.contact_problem.system.operations(self.question.system.outside))
        if not smooth:
            return KINKED
        return f"{NOT_TOUCHED}; {FAMILY}" if self.question.system.n > 1 else NOT_TOUCHED

    def answer(self) -> tuple[Problem, DiscretePath]:
        """Return what was asked, and the path at hand, with its derivatives as they are."""
        question, here = self.question, self.here
        if not isinstance(here, UnfixedPath):
            return super().answer()
        at = here.bordered.discrete(here.z)
        held = Held(question, self.contact_problem.arcs)
        tr = Transcription(held, here.mesh, here.tr.lengths, like=here.tr)
        return question, DiscretePath(tr, tr.unknowns_of(at.tr.place(at.x).places))

    def _convert_multipliers(self, old: DiscretePath, path: Path) -> Array:
        """Return zeros (K, r): the multipliers follow from the path, which is not to be moved."""
        return np.zeros((path.mesh.nodes.size, self.contact_problem.system.m))

    def next_contacts(self, allowed: float) -> tuple[Arc, ...] | None:
        """Return other parts to hold, if the path violates a condition somewhere; else None.

        As `Along` has it: f >= 0 everywhere, and what presses does not pull.
        """
        here, held = self.here, self.contact_problem
        t, depth = depths(here, here.sizes)
        known = max(here.error if np.isfinite(here.error) else 0.0, here.resolution.worst)
        self.inside = float(depth.max(initial=0.0))
        inside = depth > max(INSIDE * known, allowed)
        pressing = pressing_parts(here)
        arcs = list(pressing)
        self.cut = self.cut or pressing != held.arcs
        for i in range(held.system.m):
            deep = [
                (k, l, float(t[k + np.argmax(depth[i, k : l + 1])])) for k, l in runs(inside[i])
            ]
            arcs, deep = _part_moments(arcs, i, t, deep)
            for k, l, deepest in deep:
                begin, end = t[max(k - 1, 0)], t[min(l + 1, t.size - 1)]
                near = [x for x in arcs if x.row == i and begin <= x.end and x.begin <= end]
                if not near:
                    arcs.append(Arc(i, deepest, deepest))
                    continue
                arcs = [x for x in arcs if x not in near]
                first, last = min(t[k], *(x.begin for x in near)), max(t[l], *(x.end for x in near))
                arcs.append(Arc(i, float(first), float(last)))
        if not (self.cut or inside.any()):
            arcs = self._join_moments(t, np.abs(depth) <= allowed, arcs)
        found = tuple(sorted(arcs, key=lambda arc: (arc.begin, arc.row)))
        return None if found == held.arcs else found

    def _join_moments(self, t: Array, close: Array, arcs: list[Arc]) -> list[Arc]:
        """Return arcs in place of two moments between which the path lies on the obstacle."""
        found: list[Arc] = []
        for arc in sorted(arcs, key=lambda arc: (arc.row, arc.begin)):
            before = found[-1] if found else None
            if before is not None and before.row == arc.row:
                between = close[arc.row, (before.end < t) & (t < arc.begin)]
                if between.size and between.all():
                    arc = Arc(arc.row, found.pop().begin, arc.end)
            found.append(arc)
        return found


def _part_moments(
    arcs: list[Arc], row: int, t: Array, deep: list[tuple[int, int, float]]
) -> tuple[list[Arc], list[tuple[int, int, float]]]:
    """Return parts with two moments in place of one on both sides of which a path is inside.

    And the runs of times at which it is inside that are left, (first, last, deepest) each. Between
    two moments the path shows whether, and where, an arc begins and ends.
    """
    for arc in [x for x in arcs if x.row == row and x.point]:
        last = [x for x in deep if t[x[0]] < arc.begin <= t[min(x[1] + 1, t.size - 1)]]
        next_ = [x for x in deep if t[max(x[0] - 1, 0)] <= arc.begin < t[x[1]]]
        if last and next_ and last[0] != next_[0]:
            both = last[0], next_[0]
            arcs = [x for x in arcs if x is not arc] + [Arc(row, x[2], x[2]) for x in both]
            deep = [x for x in deep if x not in both]
    return arcs, deep


def depths(at: DiscretePath, sizes: Array) -> tuple[Array, Array]:
    """Return times (K,), and how deep a path is inside of rows that are not held, (r, K).

    In its sizes (n,).
    """
    held = contacts_of(at.problem)
    t, q, _, f = sample_rows(held, at.path)
    G = held.system.constraint_jacobian(q.T, t, parameters=held.parameters)
    depth = np.where(held.active(t), 0.0, -f)
    return t, depth / np.einsum("rnk,n->rk", np.abs(G), sizes)


def pressing_parts(here: DiscretePath) -> tuple[Arc, ...]:
    """Return what is in contact along a path, without what would have to pull."""
    held, found = contacts_of(here.problem), []
    tr, b = here.tr, here.mesh.boundaries
    impulses = -tr.row_multipliers(here.z)[tr.layout.offsets, : held.system.m]
    density = -tr.contact_density(tr.row_multipliers(here.z))
    unit = max(float(impulses.max(initial=0.0)), PULLING * tr.action_unit / tr.row_units.max())
    for arc in held.arcs or ():
        first, last = (int(np.argmin(np.abs(b - x))) for x in (arc.begin, arc.end))
        push = impulses[:, arc.row]
        if arc.point:
            if push[first] > PULLING * unit:
                found.append(arc)
            continue
        elements = tr.layout.element_of
        at = np.flatnonzero((first <= elements) & (elements < last))
        order = at[np.argsort(tr.times[at, 0], kind="stable")]
        nu, times = density[order, arc.row], tr.times[order, 0]
        least = PULLING * max(unit / (arc.end - arc.begin), float(nu.max(initial=0.0)))
        pulled = nu < -least
        if min(push[first], push[last]) < -PULLING * unit:
            share = np.append(np.maximum(nu, 0.0) * tr.weight[order, 0], push[[first, last]])
            if share.sum() > PULLING * unit:  # what is left is a moment
                middle = np.append(times, [arc.begin, arc.end]) @ share / share.sum()
                middle = float(np.clip(middle, arc.begin, arc.end))
                found.append(Arc(arc.row, middle, middle))
        elif pulled.any():
            # An end that presses is one of what presses beside it, or a moment.
            ends = ((arc.begin, first, pulled[0]), (arc.end, last, pulled[-1]))
            ends = [x for x, k, alone in ends if alone and push[k] > PULLING * unit]
            found += [Arc(arc.row, x, x) for x in ends]
            for k, l in runs(nu > least):
                if times[k] < times[l]:
                    found.append(Arc(arc.row, float(times[k]), float(times[l])))
        else:
            found.append(arc)
    return tuple(found)


def find_touching(
    ws: Touching, tol: float, curve_of: Callable[[Mesh], Path] | None
) -> tuple[Touching, Status]:
    """Find the path along the obstacle that is least near a guess or, without one, near lines.

    Return the search that has it, and the verdict, as `least_along.find_least_along`.
    """
    problem = ws.question
    since = np.linspace(0.0, problem.duration, SOUGHT + 1)
    mesh = Mesh.over(problem.start.t, problem.end.t, since, TOUCHED_DEGREE)
    mesh = with_boundaries(mesh, problem.boundaries)
    tr = Transcription(Held(problem, ()), mesh, problem.lengths)
    check(tr, tr.straight())
    ws.checked = True
    guesses = lines(problem, mesh) if curve_of is None else [curve_of(mesh)]
    first: list[First] = []
    for eased in (False, True) if problem.integral else (False,):
        if first:
            break
        for guess in guesses:
            found = touch(ws, mesh, guess, eased)
            if found and all(_differ(found.path, other.path, problem) for other in first):
                first.append(found)
    kept: tuple[Touching, Status] | None = None
    status, none = Status.NOT_FOUND, np.zeros((mesh.nodes.size, problem.system.r))
    for found in sorted(first, key=lambda found: found.action):
        for arcs in found.parts:
            ws.restart()
            asked = problem.original
            if problem.integral is not None:
                asked = asked.found_at(times_of(asked), kappa=found.kappa)
            ws.problem = Held(asked, ())
            ws.transcribe(mesh, found.path, none)
            status = refine_contact(ws, tol, arcs)
            if status.success and not ws.here.index:
                return ws, status
            if kept is None and (status.success or status in (Status.FLOOR, Status.DEGENERATE)):
                kept = copy(ws), status
    if not first:
        ws.problem = Held(problem, ())
        ws.transcribe(mesh, None, none)
        ws.hint = NOT_TOUCHED
    return kept or (ws, status)


def _differ(path: Path, other: Path, problem: Problem) -> bool:
    """Whether two paths on one mesh are two."""
    return bool(
        (np.abs(path.values - other.values).max(axis=1) / problem.lengths).max() > TWO_PATHS
    )


class First(NamedTuple):
    """A first path: its action, in its unit, what may be in contact, and multipliers (c,)."""

    action: float
    path: Path
    parts: list[tuple[Arc, ...]]
    kappa: Array


def touch(ws: Touching, mesh: Mesh, guess: Path | None, eased: bool) -> First | None:
    """Return a least path with f >= 0 at the nodes, or None where Ipopt finds none.

    Integrals that are given may be `eased` at first, with the square of what they miss in S: Ipopt
    accepts steps towards their values that lead far up in S, to where L is all but infinite.
    """
    started, problem = perf_counter(), ws.question
    held = Held(problem, ())
    tr = Transcription(held, mesh, problem.lengths)
    Q = tr.straight() if guess is None else guess.on(mesh).values.T
    x0, layout, system = tr.pack(Q)[: tr.layout.unknowns], tr.layout, held.system
    with ws.record.clock("solve"):
        origin = np.hstack(tr.state(tr.places(0 * x0)))
        columns = [np.hstack(tr.state(tr.places(e))) - origin for e in np.eye(x0.size)]
        M = np.stack([c.ravel() for c in columns], axis=1)
        x, p, count = ca.MX.sym("x", x0.size), problem.packed.T, layout.evaluations
        state = ca.reshape(ca.sparsify(ca.DM(M)) @ x + origin.ravel(), -1, count)
        at, v, times = state[: layout.width, :], state[layout.width :, :], tr.times.T
        L = system.pointwise("value").function.map(count)(at, v, times, ca.repmat(p, 1, count))
        node, where = np.unique(layout.node_of, return_index=True)
        rows = system.pointwise("constraint").function.map(node.size)
        f = rows(at[: system.n, where.tolist()], times[:, where], ca.repmat(p, 1, node.size))
        unit = np.tile(tr.row_units[: system.m, None], (1, node.size))
        S, g = (L @ tr.weight) / tr.action_unit, [ca.vec(f / unit)]
        above, count_g = np.full(unit.size, np.inf), 0
        if problem.integral is not None:
            integrand = ca.Function("g", system._arguments, [system.g]).map(count)
            values = integrand(at, v, times, ca.repmat(p, 1, count)) @ tr.weight
            count_g = system.g.numel()
            g.append(values - np.array(problem.integral))
            above = np.append(above, np.zeros(count_g))
        if eased:
            miss = ca.sumsqr(g[1] / np.maximum(np.abs(np.array(problem.integral)), EPS))
            x0 = minimize(x, S + MISSED * miss, g[0], x0, above[: unit.size])[0].z
        attempt, forces, rows = minimize(x, S, ca.vertcat(*g), x0, above)
    ws.record.iterations["ipopt"] += attempt.iterations
    if not attempt.converged:
        return None
    z = np.zeros(layout.size)
    z[: x0.size] = attempt.z
    push = -forces[: unit.size].reshape(node.size, -1).T
    f = rows[: unit.size].reshape(node.size, -1).T
    kappa = forces[unit.size :] * tr.action_unit + problem.kappa
    ws.record.round(tr, perf_counter() - started)
    path = Path(mesh, tr.coordinates(z).T)
    return First(tr.action(attempt.z), path, contact_parts(mesh.nodes, f, push), kappa)


def contact_parts(t: Array, f: Array, push: Array) -> list[tuple[Arc, ...]]:
    """Return what may be in contact, the likeliest first: of rows f, and of what pushes, (r, K).

    At nodes impulses are shared out among neighbours, and what an arc presses with is uneven.
    Where f is all but zero between two that press there may be an arc, or two moments.
    """
    likely: list[Arc] = []
    hulls: list[Arc] = []
    apart: list[Arc] = []
    for i, row in enumerate(push):
        pressing = (row > 0) & (row > np.maximum(f[i], WEAK * push.max()))
        close = pressing.copy()
        for k, l in runs(~pressing):
            between = k > 0 and l < t.size - 1
            close[k : l + 1] |= between and (l - k < FEW or f[i, k : l + 1].max() < CLOSE)
        for k, l in runs(close):
            if l - k < 2:
                moments = [_moment(i, t, row, k, l)]
                for found in (likely, hulls, apart):
                    found += moments
                continue
            arc = Arc(i, float(t[k]), float(t[l]))
            ends = [_moment(i, t, row, k, k + 1), _moment(i, t, row, l - 1, l)]
            hulls.append(arc)
            apart += ends
            inner = float(row[k + 2 : l - 1].sum())
            likely += [arc] if inner > INNER * float(row[k : l + 1].sum()) else ends
    each = (tuple(sorted(x, key=lambda arc: (arc.begin, arc.row))) for x in (likely, hulls, apart))
    return list(dict.fromkeys(each))


def _moment(row: int, t: Array, push: Array, k: int, l: int) -> Arc:
    """Return the moment between neighbouring nodes that press."""
    share = push[k : l + 1] / push[k : l + 1].sum()
    middle = float(t[k : l + 1] @ share)
    return Arc(row, middle, middle)
