"""Conjugate points: where neighbouring paths with the same start meet the path again.

The r Jacobi fields J(t) that vanish at the start and their momenta P(t) span a Lagrangian plane.
The eigenvalues of the unitary matrix (P + iJ)(P - iJ)^-1 are exp(2 i theta_k), and J(t) is
singular, with multiplicity m, exactly where m of the phases theta_k are multiples of pi. With L
convex in the velocities a phase passes a multiple of pi only upwards: roots of even multiplicity
are counted like any other, and none is missed once the phases are followed closely enough. For
one coordinate theta is Pruefer's angle.

Where L contains accelerations, or integrals are given, they are the times at which the index of
the part up to t grows: eigenvalues of d2S on variations that vanish from t on only fall with t.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from actionopt.analysis.full_form import FORM_ROUNDS, form_until
from actionopt.analysis.index import NEAR_ZERO, tolerance_of
from actionopt.analysis.jacobi import fields, resolve
from actionopt.analysis.passage import begin, carry, count_pinned
from actionopt.analysis.regular import regular_index
from actionopt.analysis.second_variation import Form, check_legendre, coefficients, tangent
from actionopt.analysis.second_variation import form as form_of
from actionopt.analysis.solution import Solution, question
from actionopt.mechanics.problem import Periodic, Problem
from actionopt.tools.blas import one_thread
from actionopt.tools.lobatto import RESTING
from actionopt.tools.types import Array, NDInt

CONJUGATE_RESOLUTION = 1e-10  # of Jacobi fields and path; ad hoc, below `SAME_ROOT`
# Phases that move by less between two times are surely matched: derived, they are known modulo pi,
# and one that moved by more than pi / 2 may as well have moved the other way; half of that.
MATCHED_PHASE = np.pi / 4
# Ad hoc, between round-off and the next root; in parts of the duration where it is a time.
CLOSEST_TIMES = 1e-9  # no closer ones are compared
BACKWARDS = 1e-6  # phases seem to pass a root backwards by rounding, and by no more
SAME_ROOT = 1e-8  # roots this close are one, of higher multiplicity
# How far times move that have settled; and under constraints, whose multipliers have fewer digits.
SETTLED_TIMES, SETTLED_HELD = 1e-9, 1e-5
# Phases from which they may be taken for one another, fewest: of 9 springs none were. And how often
# the times between nodes are halved, most. Ad hoc.
MANY_PHASES, PHASE_HALVINGS = 8, 8
ILLINOIS_STEPS = 100  # never reached: superlinear, ten are many


class ConjugatePoint(NamedTuple):
    """A time conjugate to the start, and how many independent fields vanish there."""

    t: float
    multiplicity: int


@one_thread
def conjugate_points(solution: Solution) -> tuple[ConjugatePoint, ...]:
    """Return all times t* in (t0, t1] conjugate to the start along a solution.

    By Morse's theorem the number of those before t1, each counted with its multiplicity, is the
    index of a path whose ends are pinned. Where the start is free in a coordinate they are focal
    points: the neighbours start with that momentum zero. A free end plays no part in them. Along a
    path through events the neighbours satisfy their conditions: they pass where and when these let
    them.

    Where integrals are given the neighbours keep them from the start to t*. Where L contains
    accelerations neighbours meet the path with its velocity.

    Raises ValueError for a closed path, for non-conservative forces, where L is not convex in the
    velocities, where the inertia is infinite at an end, or where the constraints are not
    independent.

    References
    ----------
    Gelfand and Fomin, *Calculus of Variations* (1963), sections 26-29; V. I. Arnold, *Funct.
    Anal. Appl.* 1 (1967), p. 1, for the phases.
    """
    if isinstance(question(solution).end, Periodic):
        raise ValueError(
            "expected a path from one event to another, found one that closes: its start varies "
            "with its end, and no times conjugate to it number the index (`morse_index` counts "
            "that); pin both ends, guess=solution, for those of the motion between them"
        )
    if solution.problem.system.order > 1 or solution.problem.integral is not None:
        return _merge_roots(_falls(solution), solution.problem)
    at, error = solution.discrete, solution.error
    whole = len(at.problem.end.pinned) == at.problem.system.n and not solution.problem.through
    # As many as the index, and none at the end, where an eigenvalue would vanish.
    count = regular_index(at, error, max(tolerance_of(error), NEAR_ZERO)) if whole else None
    if count == 0:
        return ()
    if RESTING in solution.mesh.singular_ends:
        raise ValueError(
            "expected a path whose inertia is finite at its ends, found an infinite one: "
            "neighbours have no momentum there to leave with; `morse_index` counts without them"
        )
    roots: list[float] = []
    plane: Array | None = None
    before: Form | None = None
    for k, part in enumerate(solution.parts if solution.problem.through else (solution,)):
        form = resolve(part.discrete, error, CONJUGATE_RESOLUTION, polish=True)
        if any(term.phase for term in form.tr.nodal):  # no part of how neighbours move
            form = form_of(form.at, phase=False)
        if not form.freedom:
            return ()
        check_legendre(form)
        if before is not None and plane is not None:
            plane = carry(solution, k, plane, before, form)
        elif part is not solution:
            plane = begin(solution, form)
        phases, before = Phases(form, plane), form
        roots += _counted_roots(phases, count)
        plane = phases.last
    return _merge_roots(roots, solution.problem)


def _merge_roots(roots: list[float], problem: Problem) -> tuple[ConjugatePoint, ...]:
    """Return the conjugate points at roots, of which nearly equal ones are one point."""
    close = SAME_ROOT * (problem.end.t - problem.start.t)
    groups: list[list[float]] = []
    for t in sorted(roots):
        if groups and t - groups[-1][-1] <= close:
            groups[-1].append(t)
        else:
            groups.append([t])
    return tuple(ConjugatePoint(float(np.mean(g)), len(g)) for g in groups)


def _falls(solution: Solution) -> list[float]:
    """Return each time up to which one more eigenvalue of d2S has fallen to zero.

    Elements are halved until the times stay where they are.
    """
    start, end = solution.problem.start.t, solution.problem.end.t
    settled = SETTLED_HELD if solution.problem.system.m else SETTLED_TIMES
    tolerance, near = solution.inertia.tolerance, settled * (end - start)
    found: list[float] = []
    for rounds in range(FORM_ROUNDS):
        known: dict[float, Array] = {}

        def miss(t: float, k: int, rounds: int = rounds, known: dict = known) -> float:
            if t not in known:
                known[t] = form_until(solution, t, rounds).relative()
            return -float(known[t][k]) if k < known[t].size else -1.0

        count = int(miss(end, 0) >= -tolerance) and int(np.sum(known[end] <= tolerance))
        if rounds and count == len(found):
            inside = [(k, t) for k, t in enumerate(found) if t < end - near]
            if all(miss(t - near, k) < 0 <= miss(t + near, k) for k, t in inside):
                break
        found = [end] * count
        for k in range(count):
            if miss(end, k) > tolerance:
                a = max((t for t in known if miss(t, k) < 0), default=start)
                b = min(t for t in known if miss(t, k) >= 0)
                at_a = miss(a, k) if a > start else -1.0  # on short times rates are all there is
                ends = (np.array([x]) for x in (a, at_a, b, miss(b, k)))
                found[k] = float(
                    _zeros(lambda _, t, k=k: np.array([miss(float(t[0]), k)]), *ends)[0]
                )
    return found


class Phases:
    """The phases theta_1 <= ... <= theta_r in [0, pi) of the Jacobi fields at any time."""

    def __init__(self, form: Form, plane: Array | None = None) -> None:
        self.form, self.mesh = form, form.tr.mesh
        self.held = form.pinned[0] if plane is None else count_pinned(plane)
        self.jacobi, self.last = fields(form, plane)

    def __call__(self, t: Array) -> Array:
        """Return the phases at the times t (K,), shape (K, r)."""
        form, mesh, tr = self.form, self.mesh, self.form.tr
        b, n, r = mesh.boundaries, len(form.units), form.freedom
        e = np.clip(np.searchsorted(b, t, side="left") - 1, 0, mesh.elements - 1)
        q, v = np.empty((t.size, n)), np.empty((t.size, n))
        J, rate = np.empty((t.size, n, r)), np.empty((t.size, n, r))
        for g in mesh.groups:
            at = np.full(mesh.elements, -1)
            at[g.elements] = np.arange(g.elements.size)
            mine = np.flatnonzero(at[e] >= 0)
            if not mine.size:
                continue
            own = e[mine]
            h = mesh.lengths[own]
            xi = np.clip(((t[mine] - b[own]) - (b[own + 1] - t[mine])) / h, -1.0, 1.0)
            weights = g.rule.interpolation(xi)
            slopes = g.rule.slopes(xi) * (2 / h)[:, None]
            node = g.nodes[at[own]]
            q[mine] = np.einsum("tk,tkn->tn", weights, form.at.Q[node])
            v[mine] = np.einsum("tk,tkn->tn", slopes, form.at.Q[node])
            for i in np.unique(own).tolist():
                here = own == i
                eta = form.basis[g.nodes[at[i]]] @ self.jacobi[i]
                J[mine[here]] = np.tensordot(weights[here], eta, 1)
                rate[mine[here]] = np.tensordot(slopes[here], eta, 1)
        times = t[:, None]
        _, B, C, _ = coefficients(tr.problem, q, v, times)
        scale = form.units[:, None] * form.units
        P = (C * scale) @ rate + np.swapaxes(B * scale, 1, 2) @ J
        basis = tangent(tr.problem, q, times, form.units)
        Z = np.swapaxes(basis, 1, 2)
        # In units of mass and frequency all phases pass a root equally fast, and turn evenly.
        try:
            root = np.linalg.cholesky(Z @ (C * scale) @ basis * form.frequency)
        except np.linalg.LinAlgError:
            raise ValueError(
                "expected d2L/dv2 positive definite on the motions allowed along the path, found "
                f"that it is not between t = {t.min():.6g} and {t.max():.6g}, and the neighbours "
                "not determined there"
            ) from None
        J, P = np.swapaxes(root, 1, 2) @ (Z @ J), np.linalg.solve(root, Z @ P)
        # (P + iJ)(P - iJ)^-1 is similar to (P - iJ)^-1 (P + iJ).
        values = np.linalg.eigvals(np.linalg.solve(P - 1j * J, P + 1j * J))
        theta = np.mod(np.angle(values) / 2, np.pi)
        return np.sort(theta, axis=1)


def _lift(before: Array, now: Array) -> tuple[Array, Array]:
    """Return the phases `now` (A, r) continued from `before`, and the largest moves (A,) to them.

    Sorted phases on a circle keep their order: only how many have passed pi is to be found. None
    passes it backwards but by rounding, at a root, however near that seems.
    """
    back = np.concatenate([now[:, -1:] - np.pi, now[:, :-1]], axis=1)
    ahead = np.concatenate([now, now + np.pi], axis=1)
    windows = sliding_window_view(ahead, before.shape[1], axis=1)
    lifted = np.concatenate([back[:, None], windows], axis=1)
    moves = np.abs(lifted - before[:, None]).max(axis=2)
    moves[now[:, -1] < np.pi - BACKWARDS, 0] = np.inf
    each, least = np.arange(len(now)), np.argmin(moves, axis=1)
    return lifted[each, least], moves[each, least]


def _counted_roots(phases: Phases, count: int | None) -> list[float]:
    """Return the roots of phases, of which there are `count`, if that is known.

    Many phases that turn by what they are apart between two times look as if none had turned. Times
    are halved until all are there, or until as many are found again.
    """
    found = _roots(phases, 1)
    for halvings in range(1, PHASE_HALVINGS):
        if len(found) == count or (count is None and phases.form.freedom < MANY_PHASES):
            break
        finer = _roots(phases, 2**halvings)
        if count is None and len(finer) == len(found):
            break
        found = finer
    return found


def _roots(phases: Phases, parts: int) -> list[float]:
    """Return each time at which a phase passes a multiple of pi, as often as phases do.

    They are followed from node to node of the mesh, in so many `parts`.
    """
    mesh = phases.mesh
    share, nodes = np.arange(parts) / parts, mesh.nodes
    times = np.append((nodes[:-1, None] + np.diff(nodes)[:, None] * share).ravel(), nodes[-1])
    t0, t1 = times[0], times[-1]
    # Where L_vv vanishes at an end no phase is determined: from the centre of a radial problem
    # none turns far before the first node.
    singular = [phases.form.tr.times[k, 0] for k in phases.form.singular]
    times = times[~np.isin(times, singular)]
    values = list(phases(times))
    if t0 not in singular:
        # As many phases are zero as directions are pinned; rounding may show them as pi.
        held = phases.held
        near = np.argsort(np.sin(values[0]))
        values[0] = np.r_[np.zeros(held), np.sort(values[0][near[held:]])]
    shortest = CLOSEST_TIMES * (t1 - t0)
    brackets: list[tuple] = []
    for k in range(times.size - 1):
        stack = [(times[k], values[k], times[k + 1], values[k + 1])]
        while stack:
            a, at_a, b, at_b = stack.pop()
            (lifted,), (move,) = _lift(at_a[None], at_b[None])
            if move > MATCHED_PHASE and b - a > shortest:
                middle = (a + b) / 2
                at_middle = phases(np.array([middle]))[0]
                stack += [(middle, at_middle, b, at_b), (a, at_a, middle, at_middle)]
                continue
            for i in np.flatnonzero(lifted >= np.pi):
                brackets.append((at_a, i, a, at_a[i] - np.pi, b, lifted[i] - np.pi))

    def miss(which: NDInt, t: Array) -> Array:
        """Return by how much phases are above pi at times (A,), of these brackets."""
        lifted, _ = _lift(np.array([brackets[k][0] for k in which]), phases(t))
        return lifted[np.arange(t.size), [brackets[k][1] for k in which]] - np.pi

    ends = np.array([bracket[2:] for bracket in brackets], dtype=float).reshape(-1, 4).T
    roots = _zeros(miss, *ends).tolist()
    if t1 in singular:
        return roots
    # A root at the very end may fall behind it by rounding.
    late = np.pi - values[-1]
    before = phases(np.array([t1 - 1e-3 * (t1 - times[-2])]))[0]
    speed = (values[-1] - before) / (1e-3 * (t1 - times[-2]))
    beyond = (late > 0) & (speed > 0) & (late < SAME_ROOT * (t1 - t0) * np.maximum(speed, 1e-300))
    return roots + [float(t1)] * int(np.sum(beyond))


def _zeros(
    miss: Callable[[NDInt, Array], Array], low: Array, below: Array, high: Array, above: Array
) -> Array:
    """Return times (K,) at which functions pass zero upwards (Illinois method), all together.

    They have the values `below` and `above` (K,) at the times `low` and `high`; `miss(which, t)`
    returns those of some, (A,), at the times t (A,).
    """
    side, live = np.zeros(low.size), np.arange(low.size)
    low, below, high, above = (np.array(x, dtype=float) for x in (low, below, high, above))
    for _ in range(ILLINOIS_STEPS):
        a, b = low[live], high[live]
        live = live[(b - a > 4e-16 * np.maximum(np.abs(a), np.abs(b))) & (above[live] != 0)]
        if not live.size:
            break
        a, b = low[live], high[live]
        t = (a * above[live] - b * below[live]) / (above[live] - below[live])
        t = np.where((a < t) & (t < b), t, (a + b) / 2)
        now = miss(live, t)
        for passed, sign, end, value, other in (
            (now >= 0, 1, high, above, below),
            (now < 0, -1, low, below, above),
        ):
            k = live[passed]
            end[k], value[k] = t[passed], now[passed]
            other[k] /= np.where(side[k] == sign, 2.0, 1.0)
            side[k] = sign
        there = np.abs(now) < 1e-14
        high[live[there]] = t[there]
        live = live[~there]
    return high
