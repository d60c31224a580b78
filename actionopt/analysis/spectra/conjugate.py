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

from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np

from actionopt.analysis.quadratic.assembled import AssembledForm, assemble, on_mesh
from actionopt.analysis.quadratic.index import NEAR_ZERO, POLISHED, tolerance_of
from actionopt.analysis.quadratic.jacobi import fields, resolve
from actionopt.analysis.quadratic.regular import index_of, regular_index
from actionopt.analysis.quadratic.second_variation import (
    Form,
    check_legendre,
    coefficient_entries,
    tangent,
)
from actionopt.analysis.quadratic.second_variation import form as form_of
from actionopt.analysis.solution import Solution, question
from actionopt.analysis.spectra.full_form import FORM_ROUNDS, form_until
from actionopt.analysis.spectra.passage import begin, carry, count_pinned
from actionopt.discrete.matrices.blocks import in_parts
from actionopt.mechanics.question.problem import Periodic, Problem
from actionopt.tools.blas import one_thread
from actionopt.tools.lobatto import RESTING, Sampling, lgl
from actionopt.tools.types import EPS, Array, NDInt

# Of Jacobi fields and path. Measured: of 39 systems times are off by 9e-11 of the duration at most;
# of two chains under constraints by 3e-8, as with 1e-9.
CONJUGATE_RESOLUTION = 1e-7
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
# Jacobi fields from which on roots are sought as zeros of single fields. Measured, of chains: of 20
# fields the roots take as long as by phases, of 40 two thirds, of 100 a quarter.
MANY_FIELDS = 32
# How far zeros are sought, in parts of half the interval; steps to the time at which a field is
# nearest to zero, and of inverse iteration, most. All ad hoc.
ZERO_REACH, NEAREST_STEPS, ZERO_STEPS = 1.5, 2, 3
# How far the phase moves of a field that has settled: what is left is the fourth power. Derived.
SETTLED_FIELD = 1e-3
DIFFERENT = 0.1  # least eigenvalue of the products of directions that differ; ad hoc
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
        turned, other, W, basis = self._frames(t)
        theta = TURNED + np.arctan(np.linalg.eigvalsh(_quotient(turned, other)))
        return np.sort(np.mod(theta, np.pi), axis=1), W, basis

    def _frames(self, t: Array) -> tuple[Array, Array, Array, Array]:
        """Return matrices C and S (K, r, r) of columns cos and sin of phases less `TURNED`.

        And what `_some` does.
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
        _, (i, j, mixed), inertia = coefficient_entries(problem, q, v, times)
        basis = tangent(problem, q, times, self.units)
        Z = basis.swapaxes(1, 2)
        C = self._mass(inertia)
        mass = _times(Z, C) if problem.system.m or C.shape[1] < n else C
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
        c, s = np.cos(TURNED), np.sin(TURNED)
        return c * P + s * J, c * J - s * P, W, basis

    def _mass(self, entries: tuple[NDInt, NDInt, Array]) -> Array:
        """Return L_vv in the units of the coordinates, (K, n, n), or its diagonal, (K, 1, n)."""
        (k, l, inertia), n = entries, self.units.size
        if (k == l).all():
            diagonal = np.zeros((len(inertia), 1, n))
            diagonal[:, 0, k] = inertia * self.units[k] ** 2
            return diagonal
        C = np.zeros((len(inertia), n, n))
        C[:, k, l] = C[:, l, k] = inertia * (self.units[k] * self.units[l])
        return C

    def zeros(self, low: Array, high: Array) -> Iterator[tuple[Array, Array, Array]]:
        """Yield times from `low` to `high` (A,), inside an element each, at which a field vanishes.

        Of each of these parts those that are found from its middle, (c,), the fields' directions
        there, (c, n), of length one, and the momenta of these.
        """
        _, n, r = self.fields[0].shape
        elements = np.searchsorted(self.mesh.boundaries, (low + high) / 2, side="left") - 1
        for some in in_parts(low.size, AT_A_TIME * n * r):
            middle, half = (low[some] + high[some]) / 2, (high[some] - low[some]) / 2
            turned, other, _, _ = self._frames(middle)
            values, vectors = np.linalg.eigh(_quotient(turned, other))
            ahead = np.mod(-TURNED - np.arctan(values) + np.pi / 2, np.pi) - np.pi / 2
            ahead /= self.frequency
            for k, e in enumerate(elements[some].tolist()):
                near = np.abs(ahead[k]) < ZERO_REACH * half[k]
                X = np.linalg.solve(turned[k], vectors[k][:, near])
                t, directions, momenta = self._settle(e, middle[k] + ahead[k, near], X)
                inside = (low[some][k] < t) & (t <= high[some][k])
                yield t[inside], directions[inside], momenta[inside]

    def _settle(self, e: int, t: Array, X: Array) -> tuple[Array, Array, Array]:
        """Return what `zeros` does of an element, from times (c,) and fields X (r, c) there.

        A time at which a field is nearest to zero, by the inertia, is off by the square of what the
        field is, and the field that is nearest to zero then by the square of that: those that do
        not vanish, or not soon, are left out.
        """
        at, mesh, fields = self.at, self.mesh, self.fields[e]
        g = next(g for g in mesh.groups if e in g.elements)
        begin, end, h = mesh.boundaries[e], mesh.boundaries[e + 1], mesh.lengths[e]
        Q = at.Q[g.nodes[g.elements == e][0]]

        def weights(t: Array) -> tuple[Array, Array]:
            xi = np.clip(((t - begin) - (end - t)) / h, -1.0, 1.0)
            near = g.rule.interpolation(xi)
            return near, near @ g.rule.derivative * (2 / h)

        near, slopes = weights(t)
        for k in range(1 + ZERO_STEPS):
            entries = coefficient_entries(at.problem, near @ Q, slopes @ Q, t[:, None])
            mass, before = self._mass(entries[2]), t
            if k:  # inverse iteration
                J = np.tensordot(near, fields, 1)
                gram = _times(J.swapaxes(1, 2), mass) @ J
                own = np.einsum("caa->ca", gram)  # a view
                own += EPS * own.max(axis=1, keepdims=True)
                X = np.linalg.solve(gram, X.T[:, :, None])[:, :, 0].T
            one = fields @ (X / np.linalg.norm(X, axis=0))  # (d + 1, n, c)
            for _ in range(NEAREST_STEPS):
                J, rate = (np.einsum("cd,dnc->cn", x, one) for x in (near, slopes))
                momentum = _times(rate[:, None], mass)[:, 0]
                square = (rate * momentum).sum(axis=1)
                t = np.clip(t - (J * momentum).sum(axis=1) / square, begin, end)
                near, slopes = weights(t)
            settled = np.abs(t - before) * self.frequency < SETTLED_FIELD
            if k and settled.all():
                break
        J = np.einsum("cd,dnc->cn", near, one)
        size = np.sqrt(square)
        left = np.sqrt((J * _times(J[:, None], mass)[:, 0]).sum(axis=1)) * self.frequency / size
        good = settled & (left < SETTLED_FIELD**2)
        return t[good], (rate / size[:, None])[good], (momentum / size[:, None])[good]


def _times(rows: Array, mass: Array) -> Array:
    """Return rows (K, c, n) times L_vv, (K, n, n) or its diagonal (K, 1, n)."""
    return rows * mass if mass.shape[1] == 1 else rows @ mass


def _quotient(turned: Array, other: Array) -> Array:
    """Return the symmetric matrices whose eigenvalues are the tangents of phases, less an angle."""
    found = np.linalg.solve(turned.swapaxes(1, 2), other.swapaxes(1, 2))
    return (found + found.swapaxes(1, 2)) / 2


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
    found = _settled_roots(phases, t, passed) if theta.shape[1] >= MANY_FIELDS else {}
    # Which phase from the last one on, in which interval, passes next.
    left = passed.copy()
    left[list(found)] = 0
    interval = np.repeat(np.arange(left.size), left)
    order = np.arange(interval.size) - np.repeat(np.cumsum(left) - left, left) + 1
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
    roots += [x for some in found.values() for x in some]
    # A root at the very end may fall behind it by rounding.
    late = (np.pi - theta[-1]) / speed < close
    return roots + [float(t[-1])] * int(np.sum(late & phases.regular[1]))


def _settled_roots(phases: Phases, t: Array, passed: NDInt) -> dict[int, list[float]]:
    """Return the roots between times t (K,), by the interval, where all that pass are found.

    There fields vanish, in as many directions that differ.
    """
    b = phases.mesh.boundaries
    which = np.flatnonzero(passed)
    low, high = t[which], t[which + 1]
    cut = np.searchsorted(b, low, side="right")
    ends = np.minimum(b[np.minimum(cut, b.size - 1)], high)
    two = ends < high
    part = np.r_[which, which[two]]
    low, high = np.r_[low, ends[two]], np.r_[ends, high[two]]
    found: dict[int, list] = {}
    for k, some in zip(part.tolist(), phases.zeros(low, high), strict=True):
        found.setdefault(k, []).append(some)
    roots = {}
    for k, parts in found.items():
        times, one, other = (np.concatenate(x) for x in zip(*parts, strict=True))
        if times.size == passed[k] and np.linalg.eigvalsh(one @ other.T)[0] > DIFFERENT:
            roots[k] = times.tolist()
    return roots


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
