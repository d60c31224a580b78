"""Conjugate points: where neighbouring paths with the same start meet the path again.

The r Jacobi fields J(t) that vanish at the start and their momenta P(t) span a Lagrangian plane.
The eigenvalues of the unitary matrix (P + iJ)(P - iJ)^-1 are exp(2 i theta_k), and J(t) is
singular, with multiplicity m, exactly where m of the phases theta_k are multiples of pi. With L
convex in the velocities a phase passes a multiple of pi only upwards: roots of even multiplicity
are counted like any other. Sorted phases do not tell how many passed one another; their sum does,
which turns by the integral of its rate. For one coordinate theta is Pruefer's angle.

Where L contains accelerations, or integrals are given, they are the times at which the index of
the part up to t grows: eigenvalues of d2S on variations that vanish from t on only fall with t.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from actionopt.analysis.assembled import AssembledForm, assemble, on_mesh
from actionopt.analysis.full_form import FORM_ROUNDS, form_until
from actionopt.analysis.index import NEAR_ZERO, POLISHED, tolerance_of
from actionopt.analysis.jacobi import fields, resolve
from actionopt.analysis.passage import begin, carry, count_pinned
from actionopt.analysis.regular import index_of, regular_index
from actionopt.analysis.second_variation import Form, check_legendre, coefficient_entries, tangent
from actionopt.analysis.second_variation import form as form_of
from actionopt.analysis.solution import Solution, question
from actionopt.discrete.blocks import in_parts
from actionopt.mechanics.problem import Periodic, Problem
from actionopt.tools.blas import one_thread
from actionopt.tools.lobatto import RESTING, Sampling, lgl
from actionopt.tools.types import EPS, Array, NDInt

CONJUGATE_RESOLUTION = 1e-9  # of Jacobi fields and path; ad hoc, below `SAME_ROOT`
# How far the number of phases that passed pi may be from whole, of what surely tells it; the degree
# whose integrals tell it; the angle that tangents are of, in no ratio to pi: where some phases are
# at a right angle to it they lose digits. All ad hoc.
SURE_COUNT, GAUSS_DEGREE, TURNED = 0.1, 8, 1.0
# Ad hoc, between round-off and the next root; in parts of the duration where it is a time.
COUNT_HALVINGS = 8  # of parts of the time, most
AT_A_TIME = 10  # arrays of Jacobi fields that phases take at each time
CLOSEST_TIMES = 1e-9  # no shorter parts of the time are halved
SAME_ROOT = 1e-8  # roots this close are one, of higher multiplicity
# How far times move that have settled; and under constraints, whose multipliers have fewer digits.
SETTLED_TIMES, SETTLED_HELD = 1e-9, 1e-5
# Where the slope is known, a value whose square, a round-off, is left (derived); where it is not,
# what is left itself.
SETTLED_VALUE, SETTLED_ALONE = 1e-6, 1e-14
PASS_STEPS = 100  # never reached: superlinear, four are many


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
    own = on_mesh(at, error) if whole else None
    count = None if own is None else index_of(own)
    known = max(tolerance_of(error), NEAR_ZERO)
    if whole and not count and regular_index(at, error, known) == 0:
        return ()
    if RESTING in solution.mesh.singular_ends:
        raise ValueError(
            "expected a path whose inertia is finite at its ends, found an infinite one: "
            "neighbours have no momentum there to leave with; `morse_index` counts without them"
        )
    if whole and len(at.problem.start.pinned) == at.problem.system.n:
        better = not error <= POLISHED
        assembled = assemble(at, error, CONJUGATE_RESOLUTION, polish=better, form=own)
        if assembled is not None and count is not None:
            r = at.problem.system.n - at.problem.system.m
            phases = Phases(assembled, assembled.jacobi_fields(), r)
            return _merge_roots(_counted_roots(phases, count), solution.problem)
    return _merge_roots(_roots_of_parts(solution), solution.problem)


def _roots_of_parts(solution: Solution) -> list[float]:
    """Return the conjugate times of a path, part by part between its events."""
    roots: list[float] = []
    plane: Array | None = None
    before: Form | None = None
    for k, part in enumerate(solution.parts if solution.problem.through else (solution,)):
        form = resolve(part.discrete, solution.error, CONJUGATE_RESOLUTION, polish=True)
        if any(term.phase for term in form.tr.nodal):  # no part of how neighbours move
            form = form_of(form.at, phase=False)
        if not form.freedom:
            return []
        check_legendre(form)
        if before is not None and plane is not None:
            plane = carry(solution, k, plane, before, form)
        elif part is not solution:
            plane = begin(solution, form)
        held = form.pinned[0] if plane is None else count_pinned(plane)
        found, plane = fields(form, plane)
        found = [
            form.basis[form.tr.mesh.offsets[e] : form.tr.mesh.offsets[e + 1] + 1] @ x
            for e, x in enumerate(found)
        ]
        before = form
        roots += _roots(Phases(form, found, held))
    return roots


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
                a, at_a, b, at_b = (np.array([x]) for x in (a, at_a, b, miss(b, k)))
                found[k] = _passes(lambda _, t, k=k: np.array([miss(t[0], k)]), a, at_a, b, at_b)[0]
    return found


class Phases:
    """The phases 0 <= theta_1 <= ... <= theta_r < pi of the Jacobi fields at any time."""

    def __init__(self, form: Form | AssembledForm, fields: list[Array], held: int) -> None:
        self.at, self.mesh = form.at, form.at.tr.mesh
        self.frequency, self.fields, self.held = form.frequency, fields, held
        self.units = form.units
        # Where L_vv vanishes at an end no phase is determined: from the centre of a radial problem
        # none turns far before the first node.
        t, singular = self.mesh.nodes, [form.at.tr.times[k, 0] for k in form.singular]
        self.regular = tuple(~np.isin(t[[0, -1]], singular))
        self.span = t[0 if self.regular[0] else 1], t[-1 if self.regular[1] else -2]

    def __call__(self, t: Array) -> Array:
        """Return the phases at the times t (K,), shape (K, r)."""
        _, n, r = self.fields[0].shape
        parts = in_parts(t.size, AT_A_TIME * n * r)
        return np.concatenate([self._some(t[some])[0] for some in parts])

    def turning(self, middles: Array, halves: Array, gauss: Sampling) -> tuple[Array, Array]:
        """Return the phases at points of parts of the time, (C, points, r), and their sum's rate.

        That is (C, points): the sum is the argument of det(P + iJ), in any basis, up to pi.
        """
        (_, n, r), points = self.fields[0].shape, gauss.nodes.size
        theta, rate = np.empty((middles.size, points, r)), np.empty((middles.size, points))
        for some in in_parts(middles.size, AT_A_TIME * points * n * r):
            t = middles[some, None] + halves[some, None] * gauss.nodes
            theta[some].reshape(-1, r)[:], W, Z = self._some(t.ravel())
            still = (Z @ W).reshape(len(t), points, -1)  # in directions that do not turn
            later = Z.swapaxes(1, 2) @ gauss.rates(still).reshape(-1, n, r)
            trace = np.trace(np.linalg.solve(W, later), axis1=1, axis2=2)
            rate[some] = trace.imag.reshape(t.shape) / halves[some, None]
        return theta, rate

    def _some(self, t: Array) -> tuple[Array, Array, Array]:
        """Return the phases at a few times, P + iJ there, (K, r, r), and in what basis, (K, n, r).

        J is in units of P.
        """
        at, mesh, problem = self.at, self.mesh, self.at.problem
        b, (_, n, r) = mesh.boundaries, self.fields[0].shape
        e = np.clip(np.searchsorted(b, t, side="left") - 1, 0, mesh.elements - 1)
        q, v = np.empty((t.size, n)), np.empty((t.size, n))
        J, rate = np.empty((t.size, n, r)), np.empty((t.size, n, r))
        for g in mesh.groups:
            place = np.full(mesh.elements, -1)
            place[g.elements] = np.arange(g.elements.size)
            mine = np.flatnonzero(place[e] >= 0)
            if not mine.size:
                continue
            own = e[mine]
            h = mesh.lengths[own]
            xi = np.clip(((t[mine] - b[own]) - (b[own + 1] - t[mine])) / h, -1.0, 1.0)
            weights = g.rule.interpolation(xi)
            slopes = g.rule.slopes(xi) * (2 / h)[:, None]
            node = g.nodes[place[own]]
            q[mine] = np.einsum("tk,tkn->tn", weights, at.Q[node])
            v[mine] = np.einsum("tk,tkn->tn", slopes, at.Q[node])
            for i in np.unique(own).tolist():
                here = own == i
                J[mine[here]] = np.tensordot(weights[here], self.fields[i], 1)
                rate[mine[here]] = np.tensordot(slopes[here], self.fields[i], 1)
        times = t[:, None]
        _, (i, j, mixed), (k, l, inertia) = coefficient_entries(problem, q, v, times)
        basis = tangent(problem, q, times, self.units)
        Z = basis.swapaxes(1, 2)
        if (k == l).all():
            diagonal = np.zeros((t.size, 1, n))
            diagonal[:, 0, k] = inertia * self.units[k] ** 2
            mass = Z * diagonal
        else:
            C = np.zeros((t.size, n, n))
            C[:, k, l] = C[:, l, k] = inertia * (self.units[k] * self.units[l])
            mass = Z @ C if problem.system.m else C
        P = mass @ rate
        if mixed.any():
            B = np.zeros((t.size, n, n))
            B[:, j, i] = mixed * (self.units[i] * self.units[j])
            P += Z @ (B @ J)
        # In units of mass and frequency all phases pass a root equally fast, and turn evenly.
        try:
            root = np.linalg.cholesky(self.frequency * (mass @ basis))
        except np.linalg.LinAlgError:
            raise ValueError(
                "expected d2L/dv2 positive definite on the motions allowed along the path, found "
                f"that it is not between t = {t.min():.6g} and {t.max():.6g}, and the neighbours "
                "not determined there"
            ) from None
        J = self.frequency * (mass @ J)
        W = P + 1j * J
        P, J = np.split(np.linalg.solve(root, np.concatenate([P, J], axis=2)), 2, axis=2)
        # Tangents of phases, less an angle: eigenvalues of a symmetric matrix.
        c, s = np.cos(TURNED), np.sin(TURNED)
        found = np.linalg.solve((c * P + s * J).swapaxes(1, 2), (c * J - s * P).swapaxes(1, 2))
        theta = TURNED + np.arctan(np.linalg.eigvalsh((found + found.swapaxes(1, 2)) / 2))
        return np.sort(np.mod(theta, np.pi), axis=1), W, basis


def _counted_roots(phases: Phases, count: int) -> list[float]:
    """Return the roots of phases, of which there should be `count`.

    Phases that turn by pi between two times and rest at both look as if none had turned. Parts of
    the time are halved until all are there, or as many are found again.
    """
    found = _roots(phases)
    for halvings in range(1, COUNT_HALVINGS):
        if len(found) == count:
            break
        before, found = found, _roots(phases, 2**halvings)
        if len(found) == len(before):
            break
    return found


def _roots(phases: Phases, parts: int = 1) -> list[float]:
    """Return each time at which a phase passes a multiple of pi, as often as phases do.

    They are followed along so many `parts` of each element.
    """
    t, theta, rate, passed = _follow(phases, parts)
    speed, close = phases.frequency, SAME_ROOT * (t[-1] - t[0])
    # Which phase from the last one on, in which interval, passes next.
    interval = np.repeat(np.arange(passed.size), passed)
    order = np.arange(interval.size) - np.repeat(np.cumsum(passed) - passed, passed) + 1
    total, width = theta.sum(axis=1), np.diff(t)
    turned = np.pi * passed + np.diff(total)

    def miss(which: NDInt, t_at: Array) -> Array:
        """Return by how much phases are above pi at times (A,), of these roots."""
        k, now = interval[which], phases(t_at)
        x, h = (t_at - t[k]) / width[k], width[k]
        # The sum of all phases, by its values and rates at both ends, tells how many passed pi.
        bent = (1 - x) * (h * rate[k] - turned[k]) - x * (h * rate[k + 1] - turned[k])
        whole = total[k] + turned[k] * x + x * (1 - x) * bent
        return _beyond(now, np.rint((whole - now.sum(axis=1)) / np.pi).astype(int) - order[which])

    below, above = (
        _beyond(theta[interval], -order),
        _beyond(theta[interval + 1], passed[interval] - order),
    )
    roots = _passes(miss, t[interval], below, t[interval + 1], above, speed).tolist()
    # A root at the very end may fall behind it by rounding.
    late = (np.pi - theta[-1]) / speed < close
    return roots + [float(t[-1])] * int(np.sum(late & phases.regular[1]))


def _beyond(theta: Array, after: NDInt) -> Array:
    """Return by how much a phase is above pi, if as many as `after` (A,) passed pi after it did.

    The phases of its time (A, r), sorted, follow one another on the circle.
    """
    r = theta.shape[1]
    return theta[np.arange(after.size), after % r] + np.pi * (after // r)


def _follow(phases: Phases, parts: int) -> tuple[Array, Array, Array, NDInt]:
    """Return times (K,), phases (K, r) there, the rate of their sum (K,), and how many pass pi.

    From each time to the next, (K - 1,): the sum, known modulo pi, turned by the integral of its
    rate. Where that leaves open by how many times pi, parts of the time are halved.
    """
    start, end = phases.span
    b = phases.mesh.boundaries
    share = np.arange(parts * (b.size - 1) + 1) / parts
    cuts = np.clip(np.interp(share, np.arange(b.size), b), start, end)
    gauss = lgl(GAUSS_DEGREE).dense(1)
    count = gauss.nodes.size
    first, last = phases(np.array([start, end]))
    if phases.regular[0]:
        # As many phases are zero as directions are pinned; rounding may show them as pi.
        near = np.argsort(np.sin(first))
        first = np.r_[np.zeros(phases.held), np.sort(first[near[phases.held :]])]
    known: dict[float, tuple[Array, ...]] = {}  # by the middle of a part
    while True:
        middles, lengths = (cuts[:-1] + cuts[1:]) / 2, np.diff(cuts)
        new = np.array([k for k, t in enumerate(middles.tolist()) if t not in known], dtype=int)
        theta, rate = phases.turning(middles[new], lengths[new] / 2, gauss)
        turned = gauss.increments(rate) * lengths[new, None] / 2
        known |= zip(middles[new].tolist(), zip(theta, rate, turned, strict=True), strict=True)
        theta, rate, pieces = (
            np.array(x) for x in zip(*(known[x] for x in middles.tolist()), strict=True)
        )
        turned = np.zeros(rate.size + 1)
        turned[:-1] += pieces[:, :-1].ravel()
        turned[count::count] += pieces[:, -1]
        theta = np.vstack([first, theta.reshape(rate.size, -1), last])
        left = (turned - np.diff(theta.sum(axis=1))) / np.pi
        passed = np.rint(left).astype(int)
        unsure = np.flatnonzero((np.abs(left - passed) > SURE_COUNT) | (passed < 0))
        halved = np.unique(np.clip([unsure // count, (unsure - 1) // count], 0, len(rate) - 1))
        halved = halved[lengths[halved] > CLOSEST_TIMES * (end - start)]
        if not halved.size:
            t = (middles[:, None] + lengths[:, None] / 2 * gauss.nodes).ravel()
            rate = np.pad(rate.ravel(), 1, mode="edge")
            return np.r_[start, t, end], theta, rate, np.maximum(passed, 0)
        cuts = np.sort(np.r_[cuts, middles[halved]])


def _passes(
    miss: Callable[[NDInt, Array], Array],
    low: Array,
    below: Array,
    high: Array,
    above: Array,
    speed: float | None = None,
) -> Array:
    """Return times (A,) at which functions pass zero upwards, with the slope `speed` if known.

    They have the values `below` and `above` (A,) at the times `low` and `high`; `miss(which, t)`
    returns those of some, (B,), at the times t (B,). The time is interpolated as a function of the
    value: by a parabola through three, or through two with the slope, which leaves its square.
    """
    settled = SETTLED_ALONE if speed is None else SETTLED_VALUE
    t, value = np.stack([low, high]), np.stack([below, above])
    low, high, slow, guess = low.copy(), high.copy(), np.zeros(low.size, dtype=bool), low
    for _ in range(PASS_STEPS):
        best = np.argsort(np.abs(value), axis=0)[: 3 if speed is None else 2]
        t, value = np.take_along_axis(t, best, 0), np.take_along_axis(value, best, 0)
        guess = _at_zero(value, t) if speed is None else _at_zero(value**2, t - value / speed)
        wide = high - low > 4 * EPS * np.maximum(np.abs(low), np.abs(high))
        live = np.flatnonzero((np.abs(value[0]) > settled) & wide)
        if not live.size:
            break
        a, b, near = low[live], high[live], guess[live]
        near = np.where((a < near) & (near < b) & ~slow[live], near, (a + b) / 2)
        now = miss(live, near)
        slow[live] = ~slow[live] & (now**2 > value[0, live] ** 2 / 4)
        low[live], high[live] = np.where(now < 0, near, a), np.where(now < 0, b, near)
        t, value = np.vstack([t, low]), np.vstack([value, np.full(low.size, 1 / EPS)])
        t[-1, live], value[-1, live] = near, now
    return np.clip(guess, low, high)


def _at_zero(x: Array, y: Array) -> Array:
    """Return polynomials through the points x, y (k, A) at zero, (A,); the first y where none is.

    A point with a huge x plays no part.
    """
    found = np.zeros_like(y[0])
    with np.errstate(all="ignore"):
        for j in range(len(x)):
            others = np.delete(x, j, axis=0)
            found += y[j] * np.prod(others / (others - x[j]), axis=0)
    return np.where(np.isfinite(found), found, y[0])
