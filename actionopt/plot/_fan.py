"""Paths that leave one event together, refocus at its conjugate points, and carry fronts of S.

A path is least as far as the first focus; past each focus one more variation lowers the action.
Crossing the paths are the fronts on which S from the event is constant; in the plane the paths
meet them in the direction p = dS/dq.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import Normalize
from matplotlib.tri import Triangulation

from actionopt.analysis.conjugate import ConjugatePoint, conjugate_points
from actionopt.analysis.shooting import motions
from actionopt.analysis.solution import Solution
from actionopt.discrete.path import Path
from actionopt.mechanics.problem import Event, Problem
from actionopt.plot._style import (
    COLOURS,
    COUNT,
    GREY,
    NONE,
    PALE,
    TRUE,
    UNSIGNED,
    Units,
    colour_bar,
    frame,
    heading,
    label,
    legend,
    legend_below,
    number,
    on,
    planar,
    shown,
    styled,
    traces,
)
from actionopt.tools.types import Array

SAME_TIMES = 8
EVERY = 12  # motions, one is drawn
LEVELS = 17
COARSE = 0.25  # of a level: dS = p dq fails by more on a triangle too large to draw fronts on
FIRST = 6  # of 121 times: motions are too near each other before
SPREAD = 0.8  # of the largest speed: how far velocities of fronts differ
BEFORE = 0.8  # of the way to the first focus, where all fronts of a plane meet in a point
RAGGED = 4  # times that triangles which hang on by one edge are taken away
GAUSS = np.polynomial.legendre.leggauss(3)


@dataclass(frozen=True, eq=False)
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


def fan_data(solution: Solution, count: int = 12, spread: float = 0.15) -> Fan:
    """Return motions whose first velocities differ from the solution's by up to `spread` of it.

    They differ in the direction that refocuses at the first conjugate point, or where there is
    none most slowly leaves the path. Raises ValueError for non-conservative forces.
    """
    points = conjugate_points(solution)
    problem, start = solution.problem, solution.start
    t = np.linspace(start.t, problem.end.t, COUNT // 2)
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
    q = np.full((offsets.size, len(start.q), t.size), np.nan)
    for k, path in enumerate(motions(_until(solution, problem.end.t), v0)):
        if path is not None:
            q[k] = path(t)
    index = np.zeros(t.size, dtype=int)
    for point in points:
        index += point.multiplicity * (t > point.t)
    return Fan(t, solution(t), q, points, index)


def fan(
    solution: Solution,
    ax: Axes | None = None,
    *,
    coordinate: int | None = None,
    units: Units = NONE,
    count: int = 12,
    spread: float = 0.15,
) -> Axes:
    """Draw the fan of motions from the start event, the path coloured by its index on each arc.

    Orbits for Cartesian coordinates, and dotted lines through the places of the same time: orbits
    may cross without meeting. Else one `coordinate` against time.
    """
    place = shown(solution, coordinate)
    data = fan_data(solution, count, spread)
    names = solution.problem.system.coordinates
    with styled():
        ax = on(ax)
        what = "neighbouring motions"
        for q in data.neighbours:
            for x, y, _ in traces(names, data.t, q, place):
                ax.plot(x, y, color=PALE, linewidth=0.8, label=what)
                what = None
        if place is None:
            _same_times(ax, data, names)
        last = int(data.index[-1])
        few = last < len(COLOURS)
        colours = COLOURS if few else UNSIGNED(np.linspace(0, 1, last + 1))
        for arc in np.unique(data.index):
            part = np.flatnonzero(data.index == arc)
            part = np.r_[max(part[0] - 1, 0), part]
            what = f"index {arc}"
            for x, y, _ in traces(names, data.t[part], data.q[:, part], place):
                ax.plot(x, y, color=colours[arc], linewidth=3.4, label=what)
                what = None
        what = "kinetic focus"
        for point in data.conjugate:
            at = solution(np.array([point.t]))
            for x, y, _ in traces(names, np.array([point.t]), at, place):
                ax.plot(
                    x, y, "D", color="white", markeredgecolor="black", markersize=7, zorder=6,
                    label=what,
                )  # fmt: skip
                what = None
        frame(ax, solution, units, place)
        found = "no focus before the end" if not data.conjugate else "refocusing"
        ax.set_title(f"{heading(solution)}: paths from one event, {found}")
        legend(ax)
    return ax


def _same_times(ax: Axes, data: Fan, names: Sequence[str]) -> None:
    """Join the places that the motions of a fan reach at the same time, at a few times."""
    what = "the same time (orbits may cross at different ones)"
    for k in np.linspace(0, data.t.size - 1, SAME_TIMES + 1).astype(int)[1:]:
        for x, y, _ in traces(names, data.t, np.moveaxis(data.neighbours[:, :, k], 0, 1)):
            ax.plot(x, y, color=GREY, linewidth=1.0, linestyle=":", zorder=3, label=what)
            what = None


@dataclass(frozen=True, eq=False)
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


def fronts_data(
    solution: Solution, count: int = 41, spread: float = SPREAD, until: float | None = None
) -> Fronts:
    """Return motions from the start event in all directions, and S along them.

    One coordinate: first velocities within `spread` of the solution's largest on either side of
    its first, up to the time `until` (by default the first conjugate time, or the end). Two:
    a disc of velocities about the solution's, of half that radius, and by default a time well
    before the conjugate one.

    Raises ValueError for non-conservative forces and for constraints: S is no function then of
    all the places around the path.
    """
    problem, start = solution.problem, solution.start
    if problem.system.m:
        raise ValueError("expected a system without constraints, found one with; try `fan`")
    first = min((p.t for p in conjugate_points(solution)), default=None)
    end = until or problem.end.t
    if until is None and first is not None:
        end = first if len(start.q) == 1 else start.t + BEFORE * (first - start.t)
    t = np.linspace(start.t, end, 121)
    speed = spread * float(np.max(np.linalg.norm(solution.velocity(t), axis=0)))
    if len(start.q) == 1:
        offsets = np.linspace(-speed, speed, count)[None]
    else:
        k = np.arange(6 * count) + 0.5  # evenly over a disc, by the golden section
        turn, radius = 2 * np.pi * 0.6180339887498949 * k, speed / 2 * np.sqrt(k / k[-1])
        offsets = np.zeros((len(start.q), k.size))
        offsets[:2] = radius * np.cos(turn), radius * np.sin(turn)
    v0 = start.v[:, None] + offsets
    found = [
        (p, v)
        for p, v in zip(motions(_until(solution, end), v0), v0.T, strict=True)
        if p is not None
    ]
    q = np.array([path(t) for path, _ in found])
    action = np.array([action_along(problem, path, t) for path, _ in found])
    return Fronts(t, q, action, np.array([v for _, v in found]))


def wavefronts(
    solution: Solution,
    ax: Axes | None = None,
    *,
    units: Units = NONE,
    until: float | None = None,
) -> Axes:
    """Draw the fronts of S(q, t) from the start event and the paths that cross them.

    One coordinate: fronts in the plane of time and coordinate. Two Cartesian coordinates: fronts
    over the places reached at the last time, and there the momenta, which are dS/dq.

    Raises ValueError for any other system, and as `fronts_data` does.
    """
    names = solution.problem.system.coordinates
    if len(names) > 1 and (len(names) > 2 or not planar(names)):
        raise ValueError(f"expected one coordinate or x and y, found {', '.join(names)}; try `fan`")
    data = fronts_data(solution, until=until)
    with styled():
        ax = on(ax)
        if len(names) == 1:
            what = _over_time(ax, data, units)
        else:
            what = _over_plane(ax, solution, data, units)
        for x, y, _ in traces(names, data.t, solution(data.t)):
            ax.plot(x, y, **TRUE, label="stationary path")
        frame(ax, solution, units)
        if len(names) == 1:
            margin = 0.02 * (data.t[-1] - data.t[0])
            ax.set_xlim(data.t[0] - margin, data.t[-1] + margin)
        ax.set_title(f"{heading(solution)}: fronts of $S$ {what}")
        legend_below(ax, 3)
    return ax


def _over_time(ax: Axes, data: Fronts, units: Units) -> str:
    """Draw fronts over time and coordinate; return what they are."""
    keep = np.flatnonzero(data.t > data.t[0] + 0.06 * (data.t[-1] - data.t[0]))  # singular at t0
    t, v = (x.ravel() for x in np.meshgrid(data.t[keep], data.velocity[:, 0]))
    q = data.q[:, 0, keep].ravel()
    corners = Triangulation(t, v).triangles
    _fronts(ax, (t, q), corners, _turned(t, q, corners), data.action[:, keep].ravel(), units)
    what = "paths from the event"
    for path in data.q[::2]:
        ax.plot(data.t, path[0], color=PALE, linewidth=0.7, zorder=1, label=what)
        what = None
    return "and the paths across them"


def _over_plane(ax: Axes, solution: Solution, data: Fronts, units: Units) -> str:
    """Draw fronts over the places reached at the last time, and momenta; return what they are."""
    problem, h = solution.problem, data.t[-1] - data.t[-2]
    x, y = data.q.transpose(1, 2, 0)
    q, S = data.q[:, :, -1].T, data.action[:, -1]
    v = (3 * data.q[:, :, -1] - 4 * data.q[:, :, -2] + data.q[:, :, -3]).T / (2 * h)
    p = problem.system.momentum(q, v, data.t[-1], parameters=problem.parameters)
    corners = Triangulation(*data.velocity.T).triangles
    a, b = corners, np.roll(corners, 1, axis=1)
    rise = np.sum((p[:, a] + p[:, b]) / 2 * (q[:, b] - q[:, a]), axis=0)
    coarse = np.max(np.abs(S[b] - S[a] - rise), axis=1) > COARSE * np.ptp(S) / LEVELS
    mask = _lone(corners, coarse | np.any(_turned(x, y, corners)[FIRST:], axis=0))
    _fronts(ax, (x[-1], y[-1]), corners, mask, S, units)
    what, some = "paths from the event", np.unique(corners[~mask])[::EVERY]
    for path in data.q[some]:
        ax.plot(path[0], path[1], color=PALE, linewidth=0.6, zorder=1, label=what)
        what = None
    ax.quiver(*q[:, some], *p[:, some], width=0.004, color="black", zorder=3)
    ax.plot(
        [], [], color="black", marker=r"$\rightarrow$", markersize=12, linestyle="none",
        label=r"momentum $p = \partial S/\partial q$",
    )  # fmt: skip
    ax.margins(0.1)  # for the arrows
    ax.use_sticky_edges = False
    return f"at $t$ = {number(data.t[-1], 3)} {units.time}".rstrip()


def _turned(x: Array, y: Array, corners: Array) -> Array:
    """Return which triangles of neighbouring motions are turned over, (..., T).

    Such a triangle has passed a focus: there S has one value no more.
    """
    a, b, c = np.moveaxis(corners, -1, 0)
    across = (x[..., b] - x[..., a]) * (y[..., c] - y[..., a])
    return across <= (y[..., b] - y[..., a]) * (x[..., c] - x[..., a])


def _lone(corners: Array, mask: Array) -> Array:
    """Return the mask with all triangles masked as well that do not hang together with most.

    Triangles that share an edge hang together; one with two masked neighbours is ragged.
    """
    edges = np.sort(np.stack([corners, np.roll(corners, 1, axis=1)], axis=-1), axis=-1)
    _, edge = np.unique(edges.reshape(-1, 2), axis=0, return_inverse=True)
    edge = edge.reshape(-1, 3)
    for _ in range(RAGGED):
        shared = np.bincount(edge[~mask].ravel(), minlength=edge.max() + 1)
        mask = mask | (np.sum(shared[edge] > 1, axis=1) < 2)
    piece = np.arange(len(corners))
    while True:  # every triangle takes the least number around it
        least = np.full(edge.max() + 1, len(corners))
        np.minimum.at(least, edge[~mask], piece[~mask, None])
        now = np.where(mask, piece, least[edge].min(axis=1))
        if np.array_equal(now, piece):
            break
        piece = now
    counts = np.bincount(piece[~mask], minlength=1)
    return mask | (piece != np.argmax(counts))


def _fronts(
    ax: Axes, place: tuple[Array, Array], corners: Array, mask: Array, S: Array, units: Units
) -> None:
    """Draw lines of equal S over the triangles that are not masked."""
    seen = np.sort(S[np.unique(corners[~mask])])
    levels = np.unique(np.linspace(seen[len(seen) // 50], seen[-1 - len(seen) // 50], LEVELS))
    norm = Normalize(levels[0], levels[-1])
    sheet = Triangulation(*place, corners, mask)
    ax.tricontour(sheet, S, levels, cmap=UNSIGNED, norm=norm, linewidths=1.6, zorder=2)
    colour_bar(ax, levels, norm, UNSIGNED, label("$S$ from the start", units.action))


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
