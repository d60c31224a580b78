"""Paths that leave one event together, refocus at its conjugate points, and carry fronts of S.

A path is least as far as the first focus; past each focus one more variation lowers the action.
Crossing the paths are the fronts on which S from the event is constant; in the plane the paths
meet them in the direction p = dS/dq.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize

from actionopt.conjugate import ConjugatePoint, conjugate_points
from actionopt.fan import motions
from actionopt.path import Path
from actionopt.plot._style import (
    COLOURS,
    COUNT,
    NONE,
    UNSIGNED,
    Units,
    frame,
    heading,
    label,
    on,
    planar,
    styled,
    traces,
)
from actionopt.problem import Event, Problem
from actionopt.quadrature import Array
from actionopt.solution import Solution

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
    coordinate: int = 0,
    units: Units = NONE,
    count: int = 12,
    spread: float = 0.15,
) -> Axes:
    """Draw the fan of motions from the start event, the path coloured by its index on each arc."""
    data = fan_data(solution, count, spread)
    names = solution.problem.system.coordinates
    with styled():
        ax = on(ax)
        what = "neighbouring motions"
        for q in data.neighbours:
            for x, y, _ in traces(names, data.t, q, coordinate):
                ax.plot(x, y, color="#8a8a8a", linewidth=0.8, label=what)
                what = None
        for arc in np.unique(data.index):
            part = np.flatnonzero(data.index == arc)
            part = np.r_[max(part[0] - 1, 0), part]
            what = f"index {arc}"
            for x, y, _ in traces(names, data.t[part], data.q[:, part], coordinate):
                ax.plot(x, y, color=COLOURS[arc % len(COLOURS)], linewidth=3.4, label=what)
                what = None
        what = "kinetic focus"
        for point in data.conjugate:
            at = solution(np.array([point.t]))
            for x, y, _ in traces(names, np.array([point.t]), at, coordinate):
                ax.plot(
                    x, y, "D", color="white", markeredgecolor="black", markersize=7, zorder=6,
                    label=what,
                )  # fmt: skip
                what = None
        frame(ax, solution, units, None if planar(names) else coordinate)
        found = "no focus before the end" if not data.conjugate else "refocusing"
        ax.set_title(f"{heading(solution)}: paths from one event, {found}")
        ax.legend()
    return ax


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
    """

    t: Array
    q: Array
    action: Array


def fronts_data(
    solution: Solution, count: int = 41, spread: float = 1.0, until: float | None = None
) -> Fronts:
    """Return motions from the start event in all directions, and S along them.

    One coordinate: first velocities within `spread` of the solution's largest on either side of
    its first, up to the time `until` (by default the first conjugate time, or the end). Two:
    a disc of velocities about the solution's.
    """
    problem, start = solution.problem, solution.start
    points = conjugate_points(solution) if not problem.system.structure.forced else ()
    end = until or min([p.t for p in points] + [problem.end.t])
    t = np.linspace(start.t, end, 121)
    speed = spread * float(np.max(np.linalg.norm(solution.velocity(t), axis=0)))
    if len(start.q) == 1:
        offsets = np.linspace(-speed, speed, count)[None]
    else:
        k = np.arange(4 * count) + 0.5  # evenly over a disc, by the golden section
        turn, radius = 2 * np.pi * 0.6180339887498949 * k, speed * np.sqrt(k / k[-1])
        offsets = np.zeros((len(start.q), k.size))
        offsets[:2] = radius * np.cos(turn), radius * np.sin(turn)
    paths = [p for p in motions(_until(solution, end), start.v[:, None] + offsets) if p is not None]
    q = np.array([path(t) for path in paths])
    return Fronts(t, q, np.array([action_along(problem, path, t) for path in paths]))


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

    Raises ValueError for any other system.
    """
    names = solution.problem.system.coordinates
    if len(names) > 1 and (len(names) > 2 or not planar(names)):
        raise ValueError(f"expected one coordinate or x and y, found {', '.join(names)}")
    data = fronts_data(solution, until=until)
    with styled():
        ax = on(ax)
        if len(names) == 1:
            keep = data.t > data.t[0] + 0.06 * (data.t[-1] - data.t[0])  # S is singular at t0
            x, y = np.broadcast_to(data.t[keep], data.q[:, 0, keep].shape), data.q[:, 0, keep]
            S = data.action[:, keep]
        else:
            x, y, S = data.q[:, 0, -1], data.q[:, 1, -1], data.action[:, -1]
        ordered = np.sort(S.ravel())
        levels = np.unique(
            np.linspace(ordered[len(ordered) // 50], ordered[-len(ordered) // 50], 17)
        )
        norm = Normalize(levels[0], levels[-1])
        ax.tricontour(x.ravel(), y.ravel(), S.ravel(), levels, cmap=UNSIGNED, linewidths=1.6)
        bar = ax.figure.colorbar(ScalarMappable(norm, UNSIGNED), ax=ax)
        bar.set_label(label("$S$ from the start", units.action))
        if len(names) == 1:
            for q in data.q[::2]:
                ax.plot(data.t, q[0], color="#6a6a6a", linewidth=0.7)
            frame(ax, solution, units)
            ax.plot(data.t, solution(data.t)[0], color="black", linewidth=2)
            ax.set_xlim(data.t[0], data.t[-1])
        else:
            _momenta(ax, solution, data)
            frame(ax, solution, units)
        ax.set_title(f"{heading(solution)}: fronts of $S$ and the paths across them")
    return ax


def action_along(problem: Problem, path: Path, t: Array) -> Array:
    """Return the action of `path` from t[0] to each time of t, by Gauss's rule between them."""
    xi, w = GAUSS
    h = np.diff(t)
    at = (t[:-1, None] + h[:, None] * (xi + 1) / 2).ravel()
    L = problem.system.lagrangian(path(at), path.velocity(at), at, parameters=problem.parameters)
    return np.r_[0.0, np.cumsum(h / 2 * (L.reshape(h.size, xi.size) @ w))]


def _momenta(ax: Axes, solution: Solution, data: Fronts) -> None:
    """Draw every sixth path, and its momentum where it ends."""
    problem, n = solution.problem, data.q.shape[1]
    h = data.t[-1] - data.t[-2]
    chosen = data.q[::6]
    for q in chosen:
        ax.plot(q[0], q[1], color="#b9b9b9", linewidth=0.6)
    at = chosen[:, :, -1].T
    v = (3 * chosen[:, :, -1] - 4 * chosen[:, :, -2] + chosen[:, :, -3]).T / (2 * h)
    p = problem.system.momentum(at, v, data.t[-1], parameters=problem.parameters)
    assert p.shape[0] == n
    ax.quiver(at[0], at[1], p[0], p[1], width=0.004, color="black", zorder=3)
    ax.plot(
        [], [], color="black", marker=r"$\rightarrow$", linestyle="none", label="$p$ at the end"
    )
    ax.legend()


def _until(solution: Solution, end: float) -> Problem:
    """Return the problem with the solution's start and nothing asked of the end."""
    problem, start = solution.problem, solution.start
    free = Event(end, [None] * len(start.q))
    return Problem(problem.system, Event(start.t, start.q), free, parameters=problem.parameters)


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
