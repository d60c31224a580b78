"""Many discrete actions at once: members of one family on one mesh, relative to their durations.

What differs from member to member is the last axis of every array, so that one call of numpy does
one operation for all of them: inside the blocks of the elements, too, which LAPACK would be called
for one by one. Elimination is symmetric and without pivoting, L D L': the signs of its pivots are
the inertia (Sylvester), and where one is too small the steps do not contract, which `follow` says.

Coordinates at the nodes are (P, n, E, C): P = d + 1 nodes of each of E elements, all of one degree,
for C members. Nodes between elements stand there twice.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import casadi as ca
import numpy as np

from actionopt.discrete.action.second_quadrature import NO_DEPARTURE, PANEL_COUNTS, inverses
from actionopt.discrete.between_nodes.energy_balance import (
    AMPLIFIED,
    CORNER,
    FEW_ELEMENTS,
    ROUNDOFF,
    displacement,
    may_step,
    steps_between,
)
from actionopt.discrete.matrices.elimination import (
    Band,
    Inverses,
    RowElimination,
    invert,
    multiply,
)
from actionopt.discrete.meshes.mesh import Mesh
from actionopt.mechanics.laws.columns import Columns
from actionopt.mechanics.system import System
from actionopt.tools.lobatto import Rule, Sampling, lgl
from actionopt.tools.tape import parameter_gradient
from actionopt.tools.types import Array, NDInt
from actionopt.tools.watch import check_time

PROGRAMS = "value", "gradient", "second", "slopes", "balance"

# Numbers in the matrices, and in what is evaluated at once, of members that are worked on at a
# time: so little memory, that is used again. Measured: half or twice as many take a tenth longer.
MATRICES, VALUES = 2**20, 2**17
WHOLE_MATRICES = 2**23  # numbers in the matrices with those that are never touched; ad hoc, 64 MB
# Members from where on, one more for so many unknowns inside an element, and multiplications for
# each unknown up to which, this is faster than `solve` for each. Measured: in lattices of 1, 4, 10,
# 20 and 40 masses, of 16 to 360 unknowns, from 13, 16, 23, 38 and 61 members on; pendulums of 12
# links take as long either way, those of 10 links a tenth less together.
FEWEST, UNKNOWNS_A_MEMBER, WORK = 12, 7, 3000
MOST_AT_ONCE, LEAST_AT_ONCE = 256, 8  # members
# Rows of all matrices up to which LAPACK inverts them faster than they are eliminated row by row.
# Measured: it takes as long either way for 64 matrices of 26 rows, 14 of 90 and 5 of 180.
FEW_ROWS = 1000


class StackShape:
    """A mesh over [0, 1] whose elements are of one degree, for the problems of one system.

    Parameters
    ----------
    system : System
        Without constraints and non-conservative forces.
    mesh : Mesh
    free : pair of tuples of int
        The coordinates that are free at the start, and at the end.
    units : (n,) array
        Of the coordinates.
    action_unit : float
    closed : bool
        Whether the last node is the first one again, of which nothing is given.
    """

    def __init__(
        self,
        system: System,
        mesh: Mesh,
        free: tuple[tuple[int, ...], tuple[int, ...]],
        units: Array,
        action_unit: float,
        *,
        closed: bool = False,
    ) -> None:
        self.system, self.mesh, self.free, self.closed = system, mesh, free, closed
        self.units, self.action_unit = units, action_unit
        self.rule: Rule = lgl(mesh.degrees[0])
        self.E, self.P, self.n = mesh.elements, mesh.degrees[0] + 1, system.n
        self.rows = _rows(self.P, self.n)
        self.ordered = np.argsort(self.rows.ravel())
        self.stiffness = self.rule.stiffness.reshape(self.P, self.P, self.P)[
            np.triu_indices(self.P)
        ]
        self._entries: dict[tuple[int, int], tuple[NDInt, NDInt]] = {}
        self._memory = np.empty(0)

    def on(self, mesh: Mesh) -> StackShape:
        """Return the shape of the same members on another mesh."""
        units = self.units, self.action_unit
        return StackShape(self.system, mesh, self.free, *units, closed=self.closed)

    def pinned_coordinates(self, node: int) -> list[int]:
        """Return the coordinates that are given at a node between elements."""
        if 0 < node < self.E:
            return []
        return [i for i in range(self.n) if i not in self.free[node > 0]]

    @property
    def places(self) -> int:
        """Rows of an element's matrix."""
        return self.P * self.n

    @property
    def inner(self) -> int:
        """The unknowns of the nodes inside."""
        return (self.P - 2) * self.n

    @cached_property
    def since(self) -> Array:
        """Relative times of the nodes, (P, E)."""
        return self.times_of(self.rule.nodes, slice(None))

    def times_of(self, nodes: Array, which: NDInt | slice) -> Array:
        """Return the relative times (points, E) of points (points,) of each element."""
        b, h = self.mesh.since, self.mesh.lengths
        return (b[:-1] + h / 2)[which] + h[which] / 2 * nodes[:, None]

    @cached_property
    def sampling(self) -> list[tuple[NDInt | slice, Sampling]]:
        """The points of a second quadrature, by kinds of elements: see `second_quadrature`.

        Elements and rule of each kind.
        """
        samples = self.system.structure.samples
        if not samples:
            return [(slice(None), self.rule.other)]
        count = self.mesh.lengths * (samples / self.rule.panel)
        panels = PANEL_COUNTS[
            np.minimum(np.searchsorted(PANEL_COUNTS, count), PANEL_COUNTS.size - 1)
        ]
        return [
            (np.flatnonzero(panels == p), self.rule.dense(p) if p > 1 else self.rule.other)
            for p in np.unique(panels).tolist()
        ]

    @cached_property
    def points(self) -> int:
        """The most times of one member at which functions are evaluated at once."""
        other = (rule.nodes.size * np.arange(self.E)[which].size for which, rule in self.sampling)
        return max(self.P * self.E, *other)

    @cached_property
    def band(self) -> Band:
        """Where the elements' matrices have entries."""
        return Band.of(self.system, self.P - 2, ends=not self.has_given_ends)

    @property
    def has_given_ends(self) -> bool:
        """Whether there are no nodes but those inside one element, and ends that are given."""
        return self.E == 1 and not (any(self.free) or self.closed)

    def pays(self, members: float) -> bool:
        """Whether so many members take less time together than one by one."""
        fewest = FEWEST + self.inner // UNKNOWNS_A_MEMBER
        fit = self.E * self.places**2 * fewest <= WHOLE_MATRICES
        return members >= fewest and fit and self.band.work <= WORK * self.inner

    def assemble(self, M: Array, coefficients: list[Array]) -> None:
        """Put the elements' second derivatives of S into M, (places, places, B), the upper rows."""
        A, B, C = coefficients
        pointwise = self.system.pointwise("second")
        j, k = np.triu_indices(self.P)
        weighted = self.rule.weighted_derivative[j, k][:, None]
        mirrored = self.rule.weighted_derivative[k, j][:, None]
        for here in self.band.empty:
            M[here] = 0.0
        for a, b, c in zip(*pointwise.sparsity(2), C, strict=True):
            part = self.stiffness @ c
            M[self._pair(a, b)] = part
            if a != b:
                M[self._pair(b, a)] = part
        for a, b, x in zip(*pointwise.sparsity(1), B, strict=True):
            part, other = weighted * x[j], mirrored * x[k]
            if a == b:
                M[self._pair(a, a)] += part + other
            else:
                other[j == k] = 0.0  # once
                M[self._pair(a, b)] += part
                M[self._pair(b, a)] += other
        for a, b, x in zip(*pointwise.sparsity(0), A, strict=True):
            at = self.rows[:, a], self.rows[:, b]
            M[np.minimum(*at), np.maximum(*at)] += x

    def _pair(self, a: int, b: int) -> tuple[NDInt, NDInt]:
        """Return where a coordinate at nodes meets another at later ones, in the upper rows."""
        if (a, b) not in self._entries:
            j, k = np.triu_indices(self.P)
            at = self.rows[j, a], self.rows[k, b]
            self._entries[a, b] = np.minimum(*at), np.maximum(*at)
        return self._entries[a, b]

    def parts(self, count: int) -> list[NDInt]:
        """Return so many members in parts that are worked on at a time."""
        most = min(
            MATRICES // (self.E * self.band.size),
            WHOLE_MATRICES // (self.E * self.places**2),
            VALUES // (self.points * self.n),
            MOST_AT_ONCE,
        )
        return np.array_split(np.arange(count), -(-count // max(most, LEAST_AT_ONCE)))

    def matrix(self, count: int) -> Array:
        """Return memory for so many matrices, (places, places, count): the same every time."""
        size = self.places**2 * count
        if self._memory.size < size:
            self._memory = np.empty(size)
        return self._memory[:size].reshape(self.places, self.places, count)

    def local(self, Q: Array) -> Array:
        """Return coordinates (members, K, n) node by node, element by element: (P, n, E, C)."""
        nodes = self.mesh.offsets[:-1] + np.arange(self.P)[:, None]
        return np.ascontiguousarray(Q[:, nodes].transpose(1, 3, 2, 0))

    def whole(self, Q: Array) -> Array:
        """Return them back again, (members, K, n)."""
        found = np.empty((Q.shape[3], self.mesh.offsets[-1] + 1, self.n))
        nodes = self.mesh.offsets[:-1] + np.arange(self.P)[:, None]
        found[:, nodes] = Q.transpose(3, 0, 2, 1)
        return found


class Samples(NamedTuple):
    """What is known of paths at the points of another quadrature, on elements of one kind."""

    which: NDInt | slice  # (E,)
    rule: Sampling
    half: Array  # (E, C): half the elements' durations
    # q, v (points, n, E, C)
    q: Array
    v: Array
    at: tuple[Array, Array]  # times and parameters, as functions take them
    values: list[Array]  # (points, rows, E, C): L_q and L_v; also L and dL/dt where L may jump


@dataclass(eq=False)
class Stack:
    """The discrete actions of C members."""

    shape: StackShape
    times: Array  # (C, 2): of the events
    packed: Array  # (C, p): parameters

    def __post_init__(self) -> None:
        s = self.shape
        self.duration = self.times[:, 1] - self.times[:, 0]
        self.half = s.mesh.lengths[:, None] / 2 * self.duration  # (E, C)
        self.weight = s.rule.weights[:, None, None] * self.half  # (P, E, C)
        self._at = self._arguments(s.since)

    def _arguments(self, since: Array) -> tuple[Array, Array]:
        """Return times and parameters at relative times (points, E): (points, rows, E C)."""
        t, p = self.times[:1, 0].reshape(1, 1, 1), self.packed[:1, :, None]
        if self.shape.system.structure.depends_on_time:
            t = (self.times[:, 0] + since[:, :, None] * self.duration).reshape(len(since), 1, -1)
        if not (self.packed == self.packed[:1]).all():
            p = np.tile(self.packed.T, since.shape[1])[None]
        return t, p

    def velocities(self, Q: Array) -> Array:
        """Return the velocities at the nodes."""
        local = Q - Q[:1]  # a constant has no velocity, nor the round-off of one
        v = self.shape.rule.derivative @ local.reshape(len(Q), -1)
        return v.reshape(Q.shape) / self.half

    def action(self, Q: Array) -> Array:
        """Return S, (C,), in the user's units."""
        L = self._evaluate("value", Q, self.velocities(Q), self._at)[0]
        return (self.weight * L[:, 0]).sum(axis=(0, 1))

    def gradient(self, Q: Array) -> Array:
        """Return the elements' parts of dS/dq, (P, n, E, C), in the user's units."""
        force, momentum = self._evaluate("gradient", Q, self.velocities(Q), self._at)
        force *= self.weight[:, None]
        force += _work(self.shape.rule.weighted_derivative.T, momentum)
        return force

    def slopes(self, Q: Array) -> dict[str, Array]:
        """Return dS by the times of the events, "t0" and "t1" (C,), and by "parameters" (C, p).

        As in `end_times`: nodes keep their relative times.
        """
        s, v = self.shape, self.velocities(Q)
        L, p, by_time, by_parameters = self._evaluate("slopes", Q, v, self._at)
        energy = (v * p).sum(axis=1) - L[:, 0]
        stretch = -(self.weight * energy).sum(axis=(0, 1)) / self.duration
        share, later = s.since[:, :, None], self.weight * by_time[:, 0]
        by_t0, by_t1 = (  # an infinite L_t matters where times move alone
            (np.where(part, later, 0.0) * part).sum(axis=(0, 1)) for part in (1 - share, share)
        )
        return {
            "t0": by_t0 - stretch,
            "t1": by_t1 + stretch,
            "parameters": (self.weight[:, None] * by_parameters).sum(axis=(0, 2)).T,
        }

    def second(self, Q: Array, nodes: Array | None = None) -> list[Array]:
        """Return the nonzeros of L_qq, L_qv and L_vv, (P, nonzeros, E, C), in units of unknowns.

        Or at other points of each element, `nodes` (points,).
        """
        check_time()
        s = self.shape
        if nodes is None:
            found = self._evaluate("second", Q, self.velocities(Q), self._at)
        else:
            there = s.rule.interpolation(nodes)
            q, v = self._sample(Q, there, there @ s.rule.derivative, self.half)
            at = self._arguments(s.times_of(nodes, slice(None)))
            found = self._evaluate("second", q, v, at)
        for k, x in enumerate(found):
            row, col = s.system.pointwise("second").sparsity(k)
            x *= (s.units[row] * s.units[col] / s.action_unit)[:, None, None]
        return found

    def _sample(self, Q: Array, values: Array, slopes: Array, half: Array) -> tuple[Array, Array]:
        """Return coordinates and velocities at other points, (points, n, E, C) each."""
        shape = (len(values), *Q.shape[1:])
        q = (values @ Q.reshape(len(Q), -1)).reshape(shape)
        return q, (slopes @ ((Q - Q[:1]) / half).reshape(len(Q), -1)).reshape(shape)

    def samples(self, Q: Array) -> list[Samples]:
        """Return values at the points of another quadrature, by kinds of elements."""
        s, found = self.shape, []
        name = "gradient" if s.system.structure.jumpless else "balance"
        for which, rule in s.sampling:
            half = self.half[which]
            q, v = self._sample(Q[:, :, which], rule.values, rule.slopes, half)
            at = self._arguments(s.times_of(rule.nodes, which))
            found.append(Samples(which, rule, half, q, v, at, self._evaluate(name, q, v, at)))
        return found

    def quadrature_defect(
        self, samples: list[Samples], part: Array, second: list[Array], followed: NDInt
    ) -> Array:
        """Return dS/dq by another quadrature less the `part` by this one.

        Where the forces lead between the nodes of elements that are `followed`, (E,) of bool: see
        `second_quadrature`.
        """
        s, found = self.shape, -part
        for here in samples:
            which, rule, (force, momentum, *_) = here.which, here.rule, here.values
            if followed[which].any():
                inertia = self._inertia(second[2][(s.P - 1) // 2][:, which])
                force, momentum = self._follow(here, inertia)
            work = rule.weighted_values @ force.reshape(len(force), -1)
            work = work.reshape(s.P, *force.shape[1:]) * here.half
            found[:, :, which] += work + _work(rule.weighted_slopes, momentum)
        return found

    def missed_action(self, Q: Array, samples: list[Samples]) -> Array:
        """Return by how much another quadrature changes S, (C,), as in `second_quadrature`."""
        s, structure = self.shape, self.shape.system.structure
        if not (structure.adds_time and structure.samples):
            return np.zeros(len(self.times))
        L = self._evaluate("value", Q, self.velocities(Q), self._at)[0][:, 0]
        whole = (np.tensordot(s.rule.weights, np.abs(L), 1) * self.half).sum(axis=0)
        missed = np.tensordot(s.rule.weights, L, 1) * self.half
        for which, rule, half, q, v, at, _ in samples:
            L = self._evaluate("value", q, v, at)[0]
            missed[which] -= (rule.weights @ L.reshape(len(L), -1)).reshape(half.shape) * half
        return np.abs(missed).sum(axis=0) / np.where(whole > 0, whole, 1.0)

    def drift(self, Q: Array, samples: list[Samples], second: list[Array]) -> Array:
        """Return the `energy_balance.plain_drift` of each member, (C,); nan where L may step.

        By `samples` and `second` derivatives along them, or next to them.
        """
        s, structure, count = self.shape, self.shape.system.structure, len(self.times)
        if structure.jumpless and not s.system.may_turn_corners:
            return np.zeros(count)
        v = self.velocities(Q)
        L, p, _, _ = self._evaluate("slopes", Q, v, self._at)
        read = np.abs(L).max(axis=(0, 1, 2))
        allowed = AMPLIFIED * ROUNDOFF * ((v * p).sum(axis=1).max(axis=(0, 1)) + read)
        speeds, momenta = (y[[0, -1]].transpose(1, 3, 2, 0) for y in (v, p))  # (n, C, E, 2)
        outer = L[[0, -1], 0].T  # (C, E, 2)
        between = np.abs(steps_between(speeds, momenta, outer))
        if structure.jumpless:  # but it may turn a corner
            power = np.abs(speeds * momenta).sum(axis=0).max(axis=(1, 2))
            known = between <= np.maximum(CORNER * power, allowed)[:, None]
            return np.where(known.all(axis=1), 0.0, np.nan)
        plain = (between <= allowed[:, None]).all(axis=1)
        # The means of the energy over elements, or over the panels of a few.
        parts = s.sampling[0][1].panels if s.E < FEW_ELEMENTS and len(s.sampling) == 1 else 1
        energy, gained, reach = np.zeros((3, s.E, parts, count))
        inertia = np.abs(self._inertia(second[2][(s.P - 1) // 2])).reshape(s.E, count, s.n, s.n)
        weighted = np.einsum("ecij,ic->jec", inertia, np.abs(Q).max(axis=(0, 2)))
        for which, rule, half, _, v, _, (force, p, L, explicit) in samples:
            e = np.arange(s.E)[which]

            def of_rows(
                odd: NDInt, e: NDInt = e, known: tuple[Array, ...] = (p, v, force, explicit)
            ) -> tuple[Array, ...]:
                c, k = np.divmod(odd, e.size)
                *found, timed = (y[:, :, k, c].transpose(1, 2, 0) for y in known)
                return *found, timed[0], speeds[:, c, e[k]]

            rows = half.T.reshape(-1, 1), L[:, 0].T.reshape(-1, len(L))
            ends = outer[:, e].reshape(-1, 2), np.repeat(allowed, e.size)
            plain[may_step(rule, *rows, *ends, of_rows) // e.size] = False
            weights, nodes = (y.reshape(parts, 1, -1) for y in (rule.weights, rule.nodes))

            def over(weights: Array, y: Array, half: Array) -> Array:
                found = weights @ y.reshape(parts, -1, half.size)
                return found.reshape(parts, *half.shape).swapaxes(0, 1) * half[:, None]

            energy[which] = over(weights, (v * p).sum(axis=1) - L[:, 0], half)
            for row, u in zip(weighted, v.swapaxes(0, 1), strict=True):
                mean = over(weights / 2, u**2, np.full_like(half, parts))
                reach[which] += row[which][:, None] * np.sqrt(mean)
            if structure.depends_on_time:
                later = np.linspace(-1, 1, parts + 1)[1:, None, None] - nodes
                gained[which] = over(weights, explicit, half)
                energy[which] += over(weights * later, explicit, half) * half[:, None]
        lengths = np.repeat(2 * self.half / parts, parts, axis=0)
        energy, gained, reach = (x.reshape(lengths.shape) for x in (energy, gained, reach))
        found = displacement(energy, lengths, reach, ROUNDOFF * read, gained)
        return np.where(plain & (len(lengths) >= FEW_ELEMENTS), found, np.nan)

    def _inertia(self, nonzeros: Array) -> Array:
        """Return mass matrices (E C, n, n) of their nonzeros (nonzeros, E, C) as in `second`."""
        s = self.shape
        flat = nonzeros.reshape(len(nonzeros), -1).T * s.action_unit
        known = s.system.pointwise("second").full(2, flat, symmetric=True)
        return known / np.outer(s.units, s.units)

    def _follow(self, here: Samples, inertia: Array) -> tuple[Array, Array]:
        """Return forces and momenta as `second_quadrature` follows them.

        As `departure` and what is around it do, with the points first.
        """
        rule, half, (force, momentum, *_) = here.rule, here.half, here.values
        inverse, inertia = (
            np.moveaxis(x, 0, 2).reshape(*x.shape[1:], *half.shape).copy()
            for x in (inverses(inertia, self.shape.units), inertia)
        )
        gained, _ = rule.integrals_in_rows(half * force)
        gained -= momentum
        v = _multiply(inverse, gained)
        q, mean = rule.integrals_in_rows(v)
        mean /= 2
        v -= mean
        q -= (rule.nodes[:, None, None, None] + 1) * mean
        for points in (slice(1), slice(None)):  # mostly the first one tells
            size = _multiply(np.abs(inverse), np.abs(momentum[points]))
            moves = (np.abs(v[points]) > NO_DEPARTURE * size).any(axis=(0, 1))
            if moves.all():
                break
        else:  # what departs there is round-off
            q, v = q * moves, v * moves
        q *= half
        q += here.q
        moved = self._evaluate("gradient", q, here.v + v, here.at)
        moved[1] -= _multiply(inertia, v)
        if not np.isfinite(sum(x.sum() for x in moved)):  # nothing is known beyond the laws
            good = np.isfinite(moved).all(axis=(0, 1, 2))
            return np.where(good, moved[0], force), np.where(good, moved[1], momentum)
        return moved[0], moved[1]

    def _evaluate(self, name: str, q: Array, v: Array, at: tuple[Array, Array]) -> list[Array]:
        """Return a function's values at points (points, n, E, C), (points, numbers, E, C)."""
        points, n, elements, members = q.shape
        count = elements * members
        inputs = q.reshape(points, n, count), v.reshape(points, n, count), *at
        found = compile_function(self.shape.system, name)(points, count, inputs)
        return [x.reshape(points, -1, elements, members) for x in found]

    def coefficients(self, second: list[Array], shift: Array | None = None) -> list[Array]:
        """Return the nonzeros of `second` times weights and lengths, (nonzeros, P, E C).

        `assemble` takes them in this form. L_vv is multiplied by 1 - `shift` (C,).
        """
        A, B, C = (x.swapaxes(0, 1) for x in second)
        C = C / self.half if shift is None else C * ((1 - shift) / self.half)
        return [x.reshape(*x.shape[:2], self.half.size) for x in (A * self.weight, B, C)]

    def rows(self, part: Array) -> Array:
        """Return dS/dq in units of the unknowns, (places, E, C), as right-hand sides have it."""
        s = self.shape
        unit = (s.units / s.action_unit)[:, None, None]
        return (part * unit).reshape(s.places, *part.shape[2:])[s.ordered]

    def step(self, x: Array) -> Array:
        """Return the change of coordinates (P, n, E, C) that unknowns (places, E, C) stand for."""
        s = self.shape
        return x[s.rows] * s.units[:, None, None]


class Factored:
    """Matrices of C members, factorized in place: their elements are eliminated from the inside.

    What is left of an element is a matrix of its two end nodes, and all of them are block
    tridiagonal: the nodes between elements are eliminated one after the other, without pivoting.

    The matrices are made of `Stack.coefficients`. All of one shape share memory: another matrix
    takes the place of the last one. `largest` (C,) are the largest numbers on the diagonals and,
    if they are `counted`, `negative` (C,) the numbers of negative pivots, and so of eigenvalues.
    """

    def __init__(
        self, shape: StackShape, coefficients: list[Array], *, counted: bool = False
    ) -> None:
        s, n = shape, shape.n
        self.shape = shape
        self.M = M = s.matrix(coefficients[2].shape[2])
        few = not counted and M.shape[2] * s.inner <= FEW_ROWS
        if few:  # there are entries beyond the band, too
            M[...] = 0.0
        s.assemble(M, coefficients)
        at = np.arange(s.places)
        self.largest = np.abs(M[at, at]).reshape(s.places * s.E, -1).max(axis=0)
        self.inside = Inverses(M, s.inner) if few else RowElimination(M, s.inner, s.band)
        self.negative = np.zeros(M.shape[2] // s.E, dtype=int)
        if counted:
            pivots = self.inside.inverse.reshape(s.inner * s.E, -1)
            self.negative += (pivots < 0).sum(axis=0)
        # Nothing is beyond ends that are given.
        levels = range(0 if s.has_given_ends else s.E + 1)
        ends = M[s.inner :, s.inner :].reshape(2 * n, 2 * n, s.E, -1)
        # The nodes between elements in turn: inverse pivots, and these times what is beside them.
        self.levels: list[tuple[Array, Array]] = []
        carry = np.zeros((n, n, ends.shape[3]))
        for e in levels:
            pinned = s.pinned_coordinates(e)
            D, beside = carry, np.zeros_like(carry)
            if e < s.E:
                D = carry + ends[:n, :n, e]
                beside = ends[:n, n:, e].copy()
            for i in range(1, n):  # only the upper rows are there
                D[i, :i] = D[:i, i]
            for i in pinned:
                D[i], D[:, i], beside[i] = 0.0, 0.0, 0.0
                D[i, i] = 1.0
            inverse, negative = invert(D)
            self.negative = self.negative + negative
            response = multiply(inverse, beside)
            if e < s.E:
                carry = ends[n:, n:, e] - np.einsum("iab,icb->acb", beside, response)
            self.levels.append((inverse, response))
        if s.closed:
            self._close(ends)

    def _close(self, ends: Array) -> None:
        """Find how all nodes between elements move with the one where the path closes.

        That one is held at the start and at the end of `ends`, the elements' matrices.
        """
        n = self.shape.n
        rows = np.triu_indices(n, 1)
        for here in (ends[:n, :n], ends[n:, n:]):  # only the upper rows are there
            here[rows[::-1]] = here[rows]
        ends[n:, :n] = ends[:n, n:].swapaxes(0, 1)
        fields = np.zeros((2 * n, n, *ends.shape[2:]))
        fields[:n, :, 0] = fields[n:, :, -1] = np.eye(n)[..., None]
        pull = np.einsum("ijec,jkec->ikec", ends, fields)
        self._between(moved := -pull)
        self.fields = fields = moved + fields
        joint = np.einsum("ijec,ikec->jkc", fields, np.einsum("ijec,jkec->ikec", ends, fields))
        self.joint, negative = invert(joint)
        self.negative = self.negative + negative

    def solve(self, right: Array) -> Array:
        """Return the solution for elements' right-hand sides, in their memory.

        One or several, (places, ..., E, C).
        """
        s = self.shape
        inner = right.reshape(*right.shape[:-2], -1)
        self.inside.forward(inner)
        ends = right[s.inner :]  # (2 n, ..., E, C)
        if s.has_given_ends:
            ends[...] = 0.0
            self.inside.backward(inner)
            return right
        if s.closed:
            joint = np.einsum("ijec,i...ec->j...c", self.fields, ends)
            self._between(ends)
            ends += np.einsum("ijec,j...c->i...ec", self.fields, multiply(self.joint, joint))
        else:
            self._between(ends)
        self.inside.backward(inner)
        return right

    def _between(self, ends: Array) -> None:
        """Solve for the nodes between elements in place, (2 n, ..., E, C)."""
        s, n, kept = self.shape, self.shape.n, []
        beyond = np.zeros_like(ends[:n, ..., 0, :])
        for e, (inverse, response) in enumerate(self.levels):
            r = beyond + ends[:n, ..., e, :] if e < s.E else beyond
            pinned = s.pinned_coordinates(e)
            if pinned:
                r[pinned] = 0.0
            kept.append(multiply(inverse, r))
            if e < s.E:
                beyond = ends[n:, ..., e, :] - np.einsum("icb,i...b->c...b", response, r)
        later = kept[-1]
        for e in range(s.E - 1, -1, -1):
            ends[n:, ..., e, :] = later
            later = kept[e] - multiply(self.levels[e][1], later)
            ends[:n, ..., e, :] = later

    def responses(self) -> Array:
        """Return how nodes move with one end coordinate of their element, (places, 2 n, E C)."""
        s = self.shape
        found = np.zeros((s.places, 2 * s.n, self.M.shape[2]))
        found[s.inner + np.arange(2 * s.n), np.arange(2 * s.n)] = 1.0
        if s.has_given_ends:
            for rows, cols in s.band.beside:
                found[rows, slice(cols.start - s.inner, cols.stop - s.inner)] = -self.M[rows, cols]
            self.inside.forward(found)
        self.inside.backward(found)
        return found


def compile_function(system: System, name: str) -> Columns:
    """Return a function of a system: L, its gradient, its second derivatives, or slopes.

    These are L, its momenta, and its derivatives by the time and the parameters. Or its gradient
    with what the balance of energy needs. Raises ValueError as `Columns` does.
    """

    def build() -> Columns:
        s, d = system.symbols, system.derivatives
        if name == "value":
            found = [system.L]
        elif name == "gradient":
            found = [ca.densify(d.Lq), ca.densify(d.Lv)]
        elif name == "second":
            found = [d.Lqq, d.Lqv, d.Lvv]
        elif name == "balance":
            by_time = ca.jacobian(system.L, s.t)
            found = [ca.densify(d.Lq), ca.densify(d.Lv), system.L, ca.densify(by_time)]
        else:
            by = ca.densify(ca.jacobian(system.L, s.t)), parameter_gradient(system.L, s.p)
            found = [system.L, ca.densify(d.Lv), *by]
        return Columns(ca.Function(name, [s.q, s.v, s.t, s.p], ca.cse(found)))

    return system.memoize(f"program {name}", build)


def _rows(P: int, n: int) -> NDInt:
    """Return the rows (P, n) of coordinates at nodes in the elements' matrices.

    The nodes inside come first, coordinate by coordinate, then the start, then the end.
    """
    found = np.empty((P, n), dtype=int)
    found[1:-1] = np.arange((P - 2) * n).reshape(n, P - 2).T
    found[[0, -1]] = (P - 2) * n + np.arange(2 * n).reshape(2, n)
    return found


def _multiply(A: Array, x: Array) -> Array:
    """Return the products of matrices (n, n, E, C) and x (points, n, E, C)."""
    return np.einsum("ijec,pjec->piec", A, x)


def _work(slopes: Array, momentum: Array) -> Array:
    """Return the work (P, n, E, C) of momenta (points, n, E, C) on the rates of the nodes."""
    constant = momentum[0]  # its work is done at the element's ends alone
    work = slopes @ (momentum - constant).reshape(len(momentum), -1)
    work = work.reshape(len(slopes), *momentum.shape[1:])
    work[0] -= constant
    work[-1] += constant
    return work
