"""Paths that leave one event together, refocus at its conjugate points, and carry fronts of S.

A path is least as far as the first focus; past each focus one more variation lowers the action.
Crossing the paths are the fronts on which S from the event is constant; in the plane the paths
meet them in the direction p = dS/dq.
"""

from __future__ import annotations

import numpy as np
from matplotlib.tri import Triangulation

from actionopt.analysis.quadratic.shooting import motions
from actionopt.analysis.solution import Solution
from actionopt.analysis.spectra.conjugate import ConjugatePoint, conjugate_points
from actionopt.discrete.meshes.path import Path
from actionopt.mechanics.question.course import check_whole
from actionopt.mechanics.question.problem import Event, Problem
from actionopt.plot.data.along import CURVE_TIMES, times
from actionopt.plot.data.arguments import check_arguments
from actionopt.plot.data.latest import latest
from actionopt.tools.immutable import immutable
from actionopt.tools.shown import one_line
from actionopt.tools.types import Array

SPEED_SPREAD = 0.8  # of the largest speed: how far velocities of fronts differ
# of the motions: where more run away, fronts have gaps; ad hoc
ENOUGH_MOTIONS, SPREAD_HALVINGS = 0.75, 8
BEFORE = 0.8  # of the way to the first focus, where all fronts of a plane meet in a point
FRONTS = 17  # fronts drawn
# of a level: dS = p dq fails by more on a triangle too large to draw fronts on
COARSE_TRIANGLE = 0.05
SIDE_HALVINGS = 2  # halvings of a triangle's sides: lines across it are then smooth
ALIGNED = 1e-6  # sine of an angle that counts as zero
FIRST_FRONT = 6  # of 121 times: motions are too near each other before
RAGGED = 4  # times that triangles which hang on by one edge are taken away
GAUSS = np.polynomial.legendre.leggauss(3)


@immutable
class Fan:
    """Motions from one event at K times.

    Attributes
    ----------
    t : (K,) array
    q : (n, K) array
        The solution.
    neighbours : (B, n, K) array
        Motions from the same event with other velocities, NaN where one ends early.
    conjugate : tuple of ConjugatePoint
        Times conjugate to the event along the solution.
    index : (K,) array of int
        Index of the solution up to each time: the number of conjugate times before it.
    """

    t: Array
    q: Array
    neighbours: Array
    conjugate: tuple[ConjugatePoint, ...]
    index: Array

    __repr__ = one_line


@check_arguments
@latest
def fan_data(solution: Solution, count: int = 12, spread: float = 0.15) -> Fan:
    """Return motions whose first velocities differ from the solution's by up to `spread` of it.

    They differ in the direction that refocuses at the first conjugate point, or where there is
    none most slowly leaves the path. Raises ValueError for non-conservative forces, and for a path
    through events, which these motions would not pass.
    """
    check_whole(solution.problem, "a fan of neighbours")
    points = conjugate_points(solution)
    problem, start = solution.problem, solution.start
    t = times(solution, CURVE_TIMES // 2)
    speed = float(np.linalg.norm(start.v)) or float(np.linalg.norm(problem.scales))
    if len(start.q) == 1:
        # Velocities of one coordinate: relative to the largest, as the first may be small.
        speed = float(np.max(np.abs(solution.velocity(t))))
        direction = np.ones(1)
    else:
        focus = points[0].t if points else problem.end.t
        direction = _refocusing(solution, focus, 1e-3 * speed)
    offsets = np.linspace(-spread, spread, count + count % 2) * speed
    v0 = start.v[:, None] + direction[:, None] * offsets
    nowhere = np.full((len(start.q), t.size), np.nan)
    found = motions(_until(solution, problem.end.t), v0)
    q = np.array([nowhere if path is None else path(t) for path in found])
    index = np.zeros(t.size, dtype=int)
    for point in points:
        index += point.multiplicity * (t > point.t)
    return Fan(t, solution(t), q, points, index)


@immutable
class Fronts:
    """The action of motions from one event.

    Attributes
    ----------
    t : (K,) array
    q : (B, n, K) array
        B motions.
    action : (B, K) array
        S along each from the event to the time t.
    velocity : (B, n) array
        The first velocity of each.
    """

    t: Array
    q: Array
    action: Array
    velocity: Array

    __repr__ = one_line


@check_arguments
def fronts_data(
    solution: Solution, count: int = 41, spread: float = SPEED_SPREAD, until: float | None = None
) -> Fronts:
    """Return motions from the start event in all directions, and S along them.

    One coordinate: first velocities within `spread` of the solution's largest on either side of
    its first, up to the time `until` (by default the first conjugate time, or the end). Two:
    a disc of velocities about the solution's, of half that radius, and by default a time well
    before the conjugate one. Half as far from the solution's, and again, where many run away.

    Raises ValueError for non-conservative forces and for constraints: S is no function then of
    all the places around the path. And for a path through events, as `fan_data`.
    """
    problem, start = solution.problem, solution.start
    check_whole(problem, "the wave front")
    if problem.system.m:
        raise ValueError(
            "expected a system without constraints, found one that has some; try `fan`"
        )
    first = min((p.t for p in conjugate_points(solution)), default=None)
    end = until or problem.end.t
    if until is None and first is not None:
        end = first if len(start.q) == 1 else start.t + BEFORE * (first - start.t)
    t = np.linspace(start.t, end, 121)
    speed = spread * float(np.max(np.linalg.norm(solution.velocity(t), axis=0)))
    if len(start.q) == 1:
        offsets = np.linspace(-1, 1, count)[None]
    else:
        k = np.arange(6 * count) + 0.5  # evenly over a disc, by the golden section
        turn, radius = 2 * np.pi * 0.6180339887498949 * k, np.sqrt(k / k[-1]) / 2
        offsets = np.zeros((len(start.q), k.size))
        offsets[:2] = radius * np.cos(turn), radius * np.sin(turn)
    found, halvings = [], 0
    while len(found) < ENOUGH_MOTIONS * offsets.shape[1] and halvings < SPREAD_HALVINGS:
        v0 = start.v[:, None] + speed / 2**halvings * offsets
        both = zip(motions(_until(solution, end), v0), v0.T, strict=True)
        found = [(p, v) for p, v in both if p is not None]
        halvings += 1
    q = np.array([path(t) for path, _ in found])
    action = np.array([action_along(problem, path, t) for path, _ in found])
    return Fronts(t, q, action, np.array([v for _, v in found]))


def over_time(data: Fronts) -> tuple[Triangulation, Array]:
    """Return triangles over time and one coordinate, masked where S is not unique, and S there."""
    keep = np.flatnonzero(data.t > data.t[0] + 0.06 * (data.t[-1] - data.t[0]))  # singular at t0
    t, v = (x.ravel() for x in np.meshgrid(data.t[keep], data.velocity[:, 0]))
    q, corners = data.q[:, 0, keep].ravel(), Triangulation(t, v).triangles
    return Triangulation(t, q, corners, _turns_over(t, q, corners)), data.action[:, keep].ravel()


@immutable
class Sheet:
    """S over the places that B motions have reached at one time.

    Attributes
    ----------
    triangles : Triangulation
        Of the places; masked are those that have passed a focus, and those too large to tell S
        between its values at the corners.
    action : (B,) array
    momentum, velocity : (2, B) arrays
        There; the momentum is dS/dq.
    """

    triangles: Triangulation
    action: Array
    momentum: Array
    velocity: Array

    __repr__ = one_line

    @property
    def is_aligned(self) -> bool:
        """Whether p is along v everywhere."""
        return is_aligned(self.momentum, self.velocity)

    def fine(self) -> tuple[Triangulation, Array]:
        """Return smaller triangles, and S there: its second differences are those of dS/dq = p."""
        places, S, p = np.array([self.triangles.x, self.triangles.y]), self.action, self.momentum
        corners = self.triangles.get_masked_triangles()
        for _ in range(SIDE_HALVINGS):
            sides = np.concatenate([corners[:, pair] for pair in ([1, 2], [2, 0], [0, 1])])
            (a, b), number = _distinct(np.sort(sides))
            bend = np.sum((p[:, b] - p[:, a]) * (places[:, b] - places[:, a]), axis=0) / 8
            middle = S.size + number.reshape(3, -1)
            S = np.r_[S, (S[a] + S[b]) / 2 - bend]
            places, p = (np.c_[x, (x[:, a] + x[:, b]) / 2] for x in (places, p))
            (i, j, k), (jk, ki, ij) = corners.T, middle
            parts = [(i, ij, ki), (ij, j, jk), (ki, jk, k), (ij, jk, ki)]
            corners = np.concatenate([np.stack(part, axis=1) for part in parts])
        return Triangulation(places[0], places[1], corners), S


def is_aligned(p: Array, v: Array) -> bool:
    """Return whether p is along v, both (2, K): not in a magnetic field or a frame that turns."""
    across = np.abs(p[0] * v[1] - p[1] * v[0])
    return bool(np.all(across <= ALIGNED * np.hypot(*p) * np.hypot(*v)))


NO_FRONTS = (
    "neighbouring motions cross or part too far for fronts to be drawn here; a shorter duration, "
    "or a smaller spread, may leave some"
)


def _distinct(sides: Array) -> tuple[Array, Array]:
    """Return the ends of the distinct sides, (2, E), and which of them each is."""
    found, number = np.unique(sides, axis=0, return_inverse=True)
    return found.T, number.ravel()


def over_plane(solution: Solution, data: Fronts) -> Sheet:
    """Return S over the places reached last."""
    problem, h = solution.problem, data.t[-1] - data.t[-2]
    x, y = data.q.transpose(1, 2, 0)
    q, S = data.q[:, :, -1].T, data.action[:, -1]
    v = (3 * data.q[:, :, -1] - 4 * data.q[:, :, -2] + data.q[:, :, -3]).T / (2 * h)
    p = problem.system.momentum(q, v, data.t[-1], parameters=problem.parameters)
    disc = Triangulation(*data.velocity.T)
    corners = disc.triangles
    a, b = corners, np.roll(corners, 1, axis=1)
    rise = np.sum((p[:, a] + p[:, b]) / 2 * (q[:, b] - q[:, a]), axis=0)
    level = np.subtract(*np.percentile(S, (98, 2))) / FRONTS
    coarse = np.max(np.abs(S[b] - S[a] - rise), axis=1) > COARSE_TRIANGLE * level
    mask = coarse | np.any(_turns_over(x, y, corners)[FIRST_FRONT:], axis=0)
    mask = _lone(disc.neighbors, mask | _overlaps(q, corners, mask))
    if mask.all():
        raise ValueError(NO_FRONTS)
    return Sheet(Triangulation(q[0], q[1], corners, mask), S, p, v)


def _turns_over(x: Array, y: Array, corners: Array) -> Array:
    """Return which triangles of neighbouring motions are turned over, (..., T).

    Such a triangle has passed a focus: there S has one value no more.
    """
    a, b, c = np.moveaxis(corners, -1, 0)
    across = (x[..., b] - x[..., a]) * (y[..., c] - y[..., a])
    return across <= (y[..., b] - y[..., a]) * (x[..., c] - x[..., a])


def _overlaps(q: Array, corners: Array, mask: Array) -> Array:
    """Return which triangles share places (2, B) with another that is not masked: S is not unique.

    They do if one has the other's centre in it.
    """
    left, shown = np.flatnonzero(~mask), q[:, corners[~mask]]  # (2, T, 3)
    centre = shown.mean(axis=2)
    ahead = np.roll(shown, -1, axis=2) - shown
    away = centre[:, None, :, None] - shown[:, :, None, :]  # of each centre from each triangle's
    side = ahead[0][:, None] * away[1] - ahead[1][:, None] * away[0]
    inside = np.all(side > 0, axis=2) & ~np.eye(left.size, dtype=bool)
    found = np.zeros(mask.size, dtype=bool)
    found[left] = inside.any(axis=0) | inside.any(axis=1)
    return found


def _lone(neighbours: Array, mask: Array) -> Array:
    """Return the mask with all triangles masked as well that do not hang together with most.

    `neighbours`, (T, 3), share an edge with each, -1 where there is none. Such hang together; one
    with two masked neighbours is ragged.
    """
    for _ in range(RAGGED):
        mask = mask | (np.sum((neighbours >= 0) & ~mask[neighbours], axis=1) < 2)
    beside = (neighbours >= 0) & ~mask[neighbours]
    piece = np.arange(len(mask))
    while True:  # every triangle takes the least number around it
        least = np.where(beside, piece[neighbours], len(mask)).min(axis=1)
        now = np.where(mask, piece, np.minimum(piece, least))
        if (now == piece).all():
            break
        piece = now
    counts = np.bincount(piece[~mask], minlength=1)
    return mask | (piece != np.argmax(counts))


def action_along(problem: Problem, path: Path, t: Array) -> Array:
    """Return the action of `path` from t[0] to each time of t, by Gauss's rule between them."""
    xi, w = GAUSS
    h = np.diff(t)
    at = (t[:-1, None] + h[:, None] * (xi + 1) / 2).ravel()
    L = problem.system.lagrangian(path(at), path.velocity(at), at, parameters=problem.parameters)
    return np.r_[0.0, np.cumsum(h / 2 * (L.reshape(h.size, xi.size) @ w))]


def _until(solution: Solution, end: float) -> Problem:
    """Return the problem with the solution's start and nothing asked of the end."""
    problem, start = solution.problem, solution.start
    free = Event(end, [None] * len(start.q))
    return problem.replace(start=Event(start.t, start.q), end=free)


def _refocusing(solution: Solution, t: float, step: float) -> Array:
    """Return the direction of first velocity, (n,), that moves the path least at time t."""
    start, n = solution.start, len(solution.start.q)
    basis = np.eye(n)
    if solution.problem.system.m:
        G = solution.problem.system.constraint_jacobian(
            start.q, start.t, parameters=solution.problem.parameters
        )
        basis = np.linalg.svd(G)[2][G.shape[0] :].T
    if basis.shape[1] == 1:
        return basis[:, 0]
    if t <= start.t:
        return basis[:, -1]
    v0 = start.v[:, None] + step * np.c_[np.zeros(n), basis]
    ends = [None if p is None else p(t) for p in motions(_until(solution, t), v0)]
    known = [e for e in ends if e is not None]
    if len(known) < len(ends):
        return basis[:, -1]
    change = np.array([e - known[0] for e in known[1:]]).T
    return basis @ np.linalg.svd(change)[2][-1]
