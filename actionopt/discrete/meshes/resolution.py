"""Where a path is resolved and where not, and the mesh that would resolve it.

A polynomial of degree d represents a smooth curve with Legendre coefficients that fall like
rho^-k, where rho > 1 says how far the curve is analytic around the element (Bernstein's ellipse;
Trefethen, *Approximation Theory and Approximation Practice*, chapter 8). The last coefficients
tell the error that is left, and the rate tells the degree, or the shorter element, that removes
it.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from actionopt.discrete.meshes.mesh import Mesh
from actionopt.mechanics.laws.instants import SHORTEST
from actionopt.tools.cached import cached_property
from actionopt.tools.immutable import immutable
from actionopt.tools.lobatto import Rule
from actionopt.tools.types import Array, NDInt

# Ad hoc, but flat: on the scenes no iteration depends on `LAYER` from 0.4 to 0.8, nor on a third
# of `TOO_FINE` and `DECAYING` or three times as much; `MORE_NODES` = 1 saves 4 % of the unknowns
# for more kinds of elements, and 2 is as 1.3.
DEGREES = np.array([4, 5, 6, 8, 10, 12, 14, 17, 20, 24])  # few, as each kind costs some time
SPLITS = np.array([1, 2, 3, 4, 6, 8])
LAYER = 0.6  # share of an element's movement between two nodes that makes it a layer
TOO_FINE = 1e-3  # coefficients this far below their target need not be there
DECAYING = 0.2  # a slower rate says nothing but that the element is far too long
FINITE_RATE = 0.05  # rate that is reckoned with, so that predictions are finite
UNKNOWN_DEGREES, UNKNOWN_PARTS = (6, 12), 4  # of an element in which nothing decays
# Degree at which sparse factors of many coordinates take twice as long for the same nodes as those
# of low degree. Measured on chains, 4 to 24: nothing at 100 links, twice the nonzeros at 20.
SPARSE_DEGREE = 16.0
MORE_NODES = 1.3  # times the nodes is little for fewer kinds of elements
COEFFICIENT_FLOOR = 2e-16  # about a spacing of floats: nothing smaller is seen
LOWEST_TARGET = 5e-16  # round-off in the coefficients themselves


@immutable
class Resolution:
    """How well each element of a mesh represents a path."""

    mesh: Mesh
    scaled: Array  # (K, n): nodal coordinates in units of their sizes
    # (N,): size of the first Legendre coefficient left out, in the same units; rather too large.
    omitted: Array
    rate: Array  # (N,): natural logarithm of rho, the decay per degree

    @cached_property
    def worst(self) -> float:
        """The largest coefficient left out."""
        return float(self.omitted.max())

    @cached_property
    def by_rate(self) -> float:
        """What the mesh omits, to estimate errors: above degree five by the rate of decay alone.

        `omitted`, by which meshes are made, is larger where degrees are below ten: what few
        coefficients tell of another mesh is worth less.
        """
        d = np.array(self.mesh.degrees)
        farther = np.minimum(2.0, (d - 2) / 2) - np.minimum(2.0, (d - 2) / 4)
        return float((self.omitted * np.exp(-np.maximum(farther, 0.0) * self.rate)).max())

    def steep(self) -> Array:
        """Return where a layer or a kink sits that an element does not resolve, (2, N).

        The times, since the start, of the two neighbouring nodes between which the path moves
        most, or NaN where it moves elsewhere as well.
        """
        steep = np.empty((2, self.mesh.elements))
        for g in self.mesh.groups:
            moves = np.abs(np.diff(self.scaled[g.nodes], axis=1)).max(axis=2)
            left = g.nodes[np.arange(g.elements.size), np.argmax(moves, axis=1)]
            steepest = moves.max(axis=1) > LAYER * moves.sum(axis=1)
            nodes = self.mesh.nodes_since
            steep[:, g.elements] = np.where(steepest, [nodes[left], nodes[left + 1]], np.nan)
        return steep


def resolution(mesh: Mesh, Q: Array, sizes: Array) -> Resolution:
    """Return how `mesh` resolves the nodal coordinates Q (K, n), in units of `sizes` (n,)."""
    omitted, rate = np.empty(mesh.elements), np.empty(mesh.elements)
    scaled = Q / sizes
    for g in mesh.groups:
        omitted[g.elements], rate[g.elements] = left_out(g.rule, scaled[g.nodes])
    return Resolution(mesh, scaled, omitted, rate)


def left_out(rule: Rule, scaled: Array) -> tuple[Array, Array]:
    """Return `omitted` and `rate` of elements, (E,) each, from their nodes (E, d + 1, n)."""
    d = rule.degree
    last, early = max(d - 1, 0), (d - 1) // 2
    # Coefficients before `early` say how large the path is, not how fast they decay.
    coefficients = np.abs(rule.to_legendre[early:] @ scaled)  # (E, d + 1 - early, n)
    # The largest coefficient from k on: even and odd curves have every other one zero.
    final = np.maximum(coefficients[:, last - early :].max(axis=(1, 2)), COEFFICIENT_FLOOR)
    largest = np.maximum(coefficients.max(axis=(1, 2)), COEFFICIENT_FLOOR)
    rate = np.log(largest / final) / max(last - early, 1)
    # From the last pair to the first coefficient left out it is two degrees; few
    # coefficients do not tell a rate well enough to go that far.
    return final * np.exp(-min(2.0, max(d - 2, 0) / 4) * rate), rate


def cheapest_mesh(found: Resolution, target: float, *, sparse: bool = False) -> Mesh:
    """Return the cheapest mesh predicted to leave out no coefficient above `target`.

    Each element may keep its place with another degree, or be split. What it costs depends on
    whether blocks or `sparse` factors are to solve for many coordinates.
    """
    mesh, n = found.mesh, found.scaled.shape[1]
    degrees, steep = np.array(mesh.degrees), found.steep()
    parts, degree = _cheapest(degrees, found, steep, target, n, sparse)
    count = np.maximum(parts, 1)
    of, ends = np.repeat(np.arange(mesh.elements), count), np.cumsum(count)
    k = np.arange(of.size) - (ends - count)[of] + 1
    since = mesh.since[of] + k * (mesh.lengths / count)[of]
    since[ends - 1] = mesh.since[1:]
    for e in (parts == 0).nonzero()[0]:
        cuts = _around(float(mesh.since[e]), float(mesh.since[e + 1]), steep[:, e])[:-1]
        since, of = np.append(since, cuts), np.append(of, np.full(cuts.size, e))
    order = np.argsort(since)
    return mesh.cut(np.append(mesh.since[0], since[order]), _alike(degree[of[order]]))


def _alike(degrees: NDInt) -> NDInt:
    """Return degrees of two kinds at most, none lower, where that does not take many nodes more.

    Elements of one degree are computed together: on a small mesh each kind costs more than nodes.
    """
    kinds, counts = np.unique(degrees, return_counts=True)
    if kinds.size < 3:
        return degrees
    up_to = np.cumsum(counts[:-1])
    nodes = up_to * kinds[:-1] + (degrees.size - up_to) * kinds[-1]
    best = int(np.argmin(nodes))
    if nodes[best] > MORE_NODES * degrees.sum():
        return degrees
    return np.where(degrees <= kinds[best], kinds[best], kinds[-1])


def _around(left: float, right: float, steep: Array) -> Array:
    """Return the ends of the parts that cut out the layer between the two times `steep`.

    What is left of the element is cut in three where it is long: it may hold more than the layer.
    """
    cuts = [left, *[t for t in steep if left < t < right], right]
    parts = [
        np.linspace(a, b, 4)[1:] if b - a > (right - left) / 2 else np.array([b])
        for a, b in pairwise(cuts)
    ]
    return np.concatenate(parts)


def _cheapest(
    degrees: NDInt, found: Resolution, steep: Array, target: float, n: int, sparse: bool
) -> tuple[NDInt, NDInt]:
    """Return for each element the number of equal parts and their degree, both (N,).

    No parts at all stand for an element in which nothing decays: it is cut where it is steepest.
    """
    rate = np.maximum(found.rate, FINITE_RATE)[:, None]
    # Splitting in s parts brings the nearest singularity s times as far away, in units of the
    # part's length; for a singularity beside the element that is rho_s = s b + sqrt((s b)^2 + 1)
    # with b = (rho - 1 / rho) / 2.
    b = np.sinh(rate)
    faster = np.arcsinh(SPLITS * b)
    # |c_k| ~ amplitude exp(-rate k), known at k = d + 1.
    target = max(target, LOWEST_TARGET)
    amplitude = np.log(found.omitted / target)[:, None] + rate * (degrees[:, None] + 1)
    # What has overflowed no degree resolves.
    need = np.ceil(np.fmin(amplitude / faster, DEGREES[-1] + 1.0)).astype(int)
    # A prediction downwards is extrapolated far: give back at most a third of the degree, and
    # only where it is plainly too high.
    least = np.where(found.omitted < TOO_FINE * target, np.ceil(degrees * (2 / 3)), degrees)
    need[:, 0] = np.maximum(need[:, 0], least)
    usable = need <= DEGREES[-1]
    usable[found.mesh.lengths < SHORTEST * found.mesh.duration, 1:] = False  # hardly a time in it
    need = DEGREES[np.minimum(np.searchsorted(DEGREES, need), DEGREES.size - 1)]
    # Per node. Measured on 2 to 20 coordinates: 10 + need; derived: the square of an element's
    # matrix, for more. The rest is ad hoc: few coordinates cost little beside another mesh, and
    # low degrees are predicted from nearer.
    cost = SPLITS * need * (10.0 + need + (need / n) ** 2 + (need * n / 100.0) ** 2)
    if sparse:
        cost = SPLITS * (need * (need + SPARSE_DEGREE))
    cost = np.where(usable, cost, np.inf)
    cost[found.omitted <= target, 1:] = np.inf
    choice = np.argmin(cost, axis=1)
    each = np.arange(degrees.size)
    short = found.mesh.lengths < SHORTEST * found.mesh.duration
    unresolved = ~usable.any(axis=1)
    layer = (found.rate < DECAYING) & np.isfinite(steep[0])
    parts = np.where(
        unresolved, np.where(short, 1, np.where(layer, 0, UNKNOWN_PARTS)), SPLITS[choice]
    )
    return parts, np.where(unresolved, np.clip(degrees, *UNKNOWN_DEGREES), need[each, choice])
