"""Momenta and energy along a path whose Lagrangian contains accelerations (Ostrogradsky).

Each derivative q^(k) below the highest has a momentum of its own,

    p_r = dL/dq^(r),    d(p_k)/dt = dL/dq^(k - 1) - p_(k - 1),    p_0 = 0,

and H = sum p_k . q^(k) - L. Read from the highest derivatives of a polynomial they would lose
digits with every derivative. From what the action changes by with the start they follow by
integration (E. T. Whittaker, *A Treatise on the Analytical Dynamics* (4th ed. 1937), section 110).
"""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from actionopt.analysis.motion.compare import Comparison, compare
from actionopt.discrete.meshes.mesh import Mesh
from actionopt.discrete.meshes.path import Path
from actionopt.discrete.newton.discrete_path import DiscretePath
from actionopt.mechanics.canonical import held_motion_of, momenta_of, motion_of
from actionopt.mechanics.question.events import Event, State
from actionopt.mechanics.question.problem import Problem
from actionopt.tools.immutable import immutable
from actionopt.tools.types import EPS, Array

HELD_ROUNDS = 4  # of integrals along a motion under constraints: each gains digits; ad hoc
MOMENTA_STEPS = 20  # of Newton's method to the derivatives that belong to momenta; ad hoc


def momenta(at: DiscretePath) -> Path:
    """Return p_1, p_2, ... along a path without events between its ends, (order n, K) at nodes.

    p_1 is that of q, p_2 that of v, and so on.
    """
    tr, n = at.tr, at.problem.system.n
    if at.problem.system.m:
        known = derivatives(at)
        Y, W = (np.hstack(known[k::2]) for k in (0, 1))
        of_motion = momenta_of(at.problem.system)
        return Path(tr.mesh, of_motion(Y, W, tr.mesh.nodes[:, None], at.problem.packed)[0].T)
    place = tr.place(at.x)
    by_place = at.problem.system.pointwise("first")(place.at, place.v, tr.times, at.problem.packed)[
        0
    ].copy()
    if at.problem.system.structure.forced:
        by_place[:, :n] += at.problem.system.pointwise("force")(
            place.at, place.v, tr.times, at.problem.packed
        )[0]
    found = np.empty((tr.layout.node_count, tr.layout.width))
    parts = {}
    for k, g in enumerate(tr.layout.groups):
        local = by_place[g.span].reshape(*g.nodes.shape, -1)
        parts.update((e, (k, values)) for e, values in zip(g.elements.tolist(), local, strict=True))
    p = tr.momenta(at.z)[0]
    for e in range(tr.mesh.elements):
        k, force = parts[e]
        rule, nodes = tr.layout.groups[k].rule, slice(*tr.mesh.offsets[[e, e + 1]] + [0, 1])
        below = np.zeros_like(force[:, :n])
        for i in range(tr.order):
            row = slice(i * n, (i + 1) * n)
            rate = tr.half[e] * (force[:, row] - below)
            below = found[nodes, row] = p[row] + rule.same.integrals(rate[None])[0][0]
        p = found[nodes][-1]
    return Path(tr.mesh, found.T)


def derivatives(at: DiscretePath) -> list[Array]:
    """Return q, v, a, ... at the nodes of a path under constraints, (K, n) each, 2 order of them.

    Those from the order on are integrals of the next one, as the motion has it, which lead from
    what the path is at one end of an element to what it is at the other: read from polynomials
    they would lose digits with each. Where elements meet they are means.
    """
    layout = at.tr.layout
    count, found = np.bincount(layout.node_of)[:, None], []
    for rows in _in_elements(at):
        whole = np.zeros((layout.node_count, rows.shape[1]))
        np.add.at(whole, layout.node_of, rows)
        found.append(whole / count)
    return found


def _in_elements(at: DiscretePath) -> list[Array]:
    """Return q and its derivatives as each element has them at its nodes, (evaluations, n) each."""
    tr, layout, r = at.tr, at.tr.layout, at.tr.order
    place, motion = tr.place(at.x), held_motion_of(at.problem.system)
    known = np.split(np.concatenate([place.at, place.v], axis=1), r + 1, axis=1)
    while len(known) < 2 * r:
        known.append(tr.velocities(known[-1]))
    known = [rows.copy() for rows in known]
    for _ in range(HELD_ROUNDS):
        Y, W = (np.hstack(known[k::2]) for k in (0, 1))
        last = motion(Y, W, tr.times, at.problem.packed)[0]
        for k, g in enumerate(layout.groups):
            half, points = tr.halves[k][:, 0], g.nodes.shape[1]
            since = half * (1 + g.rule.nodes)  # (E, points)
            from_last, rows = [], last[g.span].reshape(len(g.nodes), points, -1)
            for _ in range(2 * r):  # integrals of it, once, twice, ...
                rows = half[:, :, None] * g.rule.same.integrals(rows)[0]
                from_last.insert(0, rows)
            local = [x[g.span].reshape(len(g.nodes), points, -1) for x in known]
            table = np.array([[_power(since, j - i) for j in range(2 * r)] for i in range(2 * r)])
            ends = table[:, :, :, -1].transpose(2, 0, 1)
            missed = [
                local[i][:, -1] - from_last[i][:, -1]
                - sum(ends[:, i, j, None] * local[j][:, 0] for j in range(r))
                for i in range(r)
            ]  # fmt: skip
            begun = np.linalg.solve(ends[:, :r, r:], np.stack(missed, axis=1))  # (E, r, n)
            for i in range(r, 2 * r):
                rows = from_last[i] + sum(
                    table[i, j][:, :, None] * begun[:, None, j - r] for j in range(i, 2 * r)
                )
                known[i][g.span] = rows.reshape(-1, rows.shape[2])
    return known


def _power(t: Array, k: int) -> Array:
    """Return t^k / k!, zero for k < 0."""
    return t**k / math.factorial(k) if k >= 0 else 0 * t


def multipliers(at: DiscretePath) -> Path:
    """Return the multipliers lam (m, K) at the nodes of the motion, as L + lam.f has them."""
    known, system = derivatives(at), at.problem.system
    Y, W = (np.hstack(known[k::2]) for k in (0, 1))
    lam = held_motion_of(system)(Y, W, at.mesh.nodes[:, None], at.problem.packed)[1]
    return Path(at.mesh, lam.T)


def energy(at: DiscretePath) -> Path:
    """Return H along a path without events between its ends, (1, K) at nodes."""
    place, layout, n = at.tr.place(at.x), at.tr.layout, at.problem.system.n
    L = at.problem.system.pointwise("value")(place.at, place.v, at.tr.times, at.problem.packed)[0]
    p = momenta(at).values.T[layout.node_of]
    rates = np.concatenate([place.at[:, n:], place.v], axis=1)
    found = np.empty(layout.node_count)
    found[layout.node_of] = np.sum(p * rates, axis=1) - L[:, 0]
    return Path(at.mesh, found[None])


@immutable
class CanonicalPath:
    """A path as one of the motion of order two (`mechanics.canonical`), to be compared with it.

    Its highest derivatives are those that belong to its momenta.
    """

    at: DiscretePath
    error: float

    @property
    def problem(self) -> Problem:
        """Between what the path is at its ends."""
        return self._problem

    @cached_property
    def _problem(self) -> Problem:
        b = self.mesh.boundaries[[0, -1]]
        ends = (Event(t, q) for t, q in zip(b, self(b).T, strict=True))
        known = self.at.problem
        return Problem(motion_of(known.system), *ends, parameters=known.parameters)

    @property
    def mesh(self) -> Mesh:
        """The mesh of the path."""
        return self.at.mesh

    @property
    def start(self) -> State:
        """The state in which the motion begins."""
        t = self.mesh.boundaries[0]
        return State(t, self(t), self.velocity(t))

    def __call__(self, t: ArrayLike) -> Array:
        """Return (q, a, ...), (order n, *t.shape)."""
        return self._states(t)[0]

    def velocity(self, t: ArrayLike) -> Array:
        """Return (v, j, ...), (order n, *t.shape)."""
        return self._states(t)[1]

    def derivatives(self, t: Array) -> Array:
        """Return (q, v, a, ...) at times t (K,), (2 order n, K)."""
        r, n = self.at.tr.order, self.at.problem.system.n
        below, rates = (x.reshape(r, n, t.size) for x in self._states(t))
        return np.stack([below, rates], axis=1).reshape(2 * r * n, t.size)

    @cached_property
    def _momenta(self) -> Path:
        return momenta(self.at)

    def _states(self, t: ArrayLike) -> tuple[Array, Array]:
        """Return both: the derivatives from that of the Lagrangian's order on, by the momenta.

        Newton's method, from those of the polynomials.
        """
        times = np.asarray(t, dtype=float)
        flat, system, path = times.ravel(), self.at.problem.system, self.at.path
        if system.m:  # momenta are known up to the constraints' normals
            known = [Path(self.mesh, x.T)(flat) for x in derivatives(self.at)]
            both = (np.concatenate(known[k::2]) for k in (0, 1))
            Y, W = (x.reshape(len(x), *times.shape) for x in both)
            return Y, W
        n, r = system.n, system.order
        rates = [x.T for x in self.at.rates]
        y = [path(flat), *(Path(self.mesh, x)(flat) for x in rates)]
        y += [np.zeros_like(y[0])] * (r - 1)
        known, wanted = np.array(y).transpose(2, 0, 1), self._momenta(flat).T  # (K, 2 r, n)
        function, last = momenta_of(system), np.inf
        for _ in range(MOMENTA_STEPS):
            Y, W = (known[:, k::2].reshape(flat.size, r * n) for k in (0, 1))
            p, by = function(Y, W, flat[:, None], self.at.problem.packed)
            by = by.reshape(flat.size, r * n, r * n).transpose(0, 2, 1)
            step = np.linalg.solve(by, (wanted - p)[:, :, None])[:, :, 0].reshape(flat.size, r, n)
            known[:, r:] += step
            size = float(
                (np.abs(step) / (np.abs(known[:, r:]).max(initial=0.0) or 1.0)).max(initial=0.0)
            )
            if size < EPS or size >= last / 2:
                break
            last = size
        shape = r * n, *times.shape
        Y, W = (known[:, k::2].reshape(flat.size, r * n).T.reshape(shape) for k in (0, 1))
        return Y, W


def _roughness(at: DiscretePath) -> float:
    """Return by how much derivatives that a motion begins with differ where elements meet."""
    tr, worst = at.tr, 0.0
    for rows in _in_elements(at)[tr.order :]:
        ends = rows[tr.layout.element_ends].reshape(-1, 2, rows.shape[1])
        jump = np.abs(ends[1:, 0] - ends[:-1, 1]).max(initial=0.0)
        worst = max(worst, float(jump / (np.abs(rows).max() or 1.0)))
    return worst


def compare_motion(at: DiscretePath, error: float) -> Comparison:
    """Compare a path without events between its ends with forward integrations.

    `error` is that of the path; the reference is of its coordinates alone. Its initial momenta are
    taken to be as accurate as those at its end, to which integration has led.
    """
    units = at.tr.place_units
    p = momenta(at).values.T * units
    miss = np.abs(p[-1] - at.tr.momenta(at.z)[1] * units).max() / (np.abs(p).max() or 1.0)
    if at.problem.system.m:
        miss = _roughness(at)
    n, path = at.problem.system.n, CanonicalPath(at, max(error, float(miss)))
    found = compare(path, count=n)
    if found.path is None:
        return found
    rates = found.path.velocities
    rates = None if rates is None else rates[:n]
    return replace(found, path=Path(found.path.mesh, found.path.values[:n], rates))
