"""The fan of paths that leave one event together, and the fronts of S across them."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import Normalize
from matplotlib.tri import Triangulation

from actionopt.analysis.solution import Solution
from actionopt.plot import _style as style
from actionopt.plot._names import NO_UNITS, UnitNames, label, planar
from actionopt.plot.data.arguments import check_arguments
from actionopt.plot.data.fan import FRONTS, Fronts, fan_data, fronts_data, over_plane, over_time
from actionopt.tools.types import Array
from actionopt.tools.words import number, say

SAME_TIMES = 8
EVERY = 12  # motions, one is drawn
FOCUS: Any = {
    "marker": "D", "linestyle": "none", "markersize": 7, "zorder": 6,
}  # fmt: skip


@style.styled
@check_arguments
def fan(
    solution: Solution,
    ax: Axes | None = None,
    *,
    coordinate: int | None = None,
    units: UnitNames = NO_UNITS,
    count: int = 12,
    spread: float = 0.15,
) -> Axes:
    """Draw the fan of motions from the start event, the path coloured by its index on each arc.

    Orbits for Cartesian coordinates, and dotted lines through the places of the same time: orbits
    may cross without meeting. Else one `coordinate` against time.
    """
    at = style.coordinate_to_show(solution, coordinate)
    data, names = fan_data(solution, count, spread), solution.problem.system.coordinates
    ax, q = style.on(ax), data.neighbours
    look = {"color": style.PALE, "linewidth": 0.8}
    style.draw(ax, names, data.t, q, at, say("neighbouring motions"), **look)
    if at is None:
        some = np.linspace(0, data.t.size - 1, SAME_TIMES + 1).astype(int)[1:]
        look = {"color": style.GREY, "linewidth": 1.0, "linestyle": ":", "zorder": 3}
        text = say("the same time (orbits may cross at different ones)")
        style.draw(ax, names, data.t, q[:, :, some].transpose(2, 1, 0), None, text, **look)
    last = int(data.index[-1])
    few = last < len(style.COLOURS)
    colours = style.COLOURS if few else style.unsigned_colours()(np.linspace(0, 1, last + 1))
    for arc in np.unique(data.index):
        part = np.flatnonzero(data.index == arc)
        part = np.r_[max(part[0] - 1, 0), part]
        look = {"color": colours[arc], "linewidth": 3.4}
        style.draw(ax, names, data.t[part], data.q[:, part], at, say("index {k}", k=arc), **look)
    foci = np.array([point.t for point in data.conjugate])
    if foci.size:
        hollow = {"color": style.paper(), "markeredgecolor": style.ink()}
        style.draw(ax, names, foci, solution(foci), at, say("kinetic focus"), **FOCUS, **hollow)
    style.frame(ax, solution, units, at)
    words = say(
        "paths from one event, refocusing"
        if foci.size
        else "paths from one event, no focus before the end"
    )
    style.set_title(ax, solution, words)
    style.legend(ax)
    return ax


@style.styled
@check_arguments
def wavefronts(
    solution: Solution,
    ax: Axes | None = None,
    *,
    units: UnitNames = NO_UNITS,
    until: float | None = None,
) -> Axes:
    """Draw the fronts of S(q, t) from the start event, and paths from there.

    One coordinate: fronts in the plane of time and coordinate, where dS = p dq - H dt; a path runs
    along one where L = 0. Two Cartesian coordinates: fronts over the places reached at the last
    time, and there the momenta, which are dS/dq, and the velocities where they point elsewhere.

    Raises ValueError for any other system, and as `fronts_data` does.
    """
    names = solution.problem.system.coordinates
    if len(names) > 1 and (len(names) > 2 or not planar(names)):
        raise ValueError(f"expected one coordinate or x and y, found {', '.join(names)}; try `fan`")
    data, ax = fronts_data(solution, until=until), style.on(ax)
    words = say("fronts of $S$ in time, and paths from the event")
    if len(names) == 1:
        _fronts(ax, *over_time(data), units)
        _paths(ax, data.t, data.q[::2, 0].T, 0.7)
    else:
        _plane(ax, solution, data, units)
        time = f"{number(data.t[-1], 3)} {units.time}".rstrip()
        words = say("fronts of $S$ at $t$ = {time}", time=time)
    for x, y, _ in style.traces(names, data.t, solution(data.t)):
        ax.plot(x, y, **style.true(), label=say("stationary path"))
    style.frame(ax, solution, units)
    if len(names) == 1:
        margin = 0.02 * (data.t[-1] - data.t[0])
        ax.set_xlim(data.t[0] - margin, data.t[-1] + margin)
    style.set_title(ax, solution, words)
    style.legend_below(ax, 3)
    return ax


def _plane(ax: Axes, solution: Solution, data: Fronts, units: UnitNames) -> None:
    """Draw fronts over the places reached at the last time, the paths there, and momenta."""
    sheet = over_plane(solution, data)
    _fronts(ax, *sheet.fine(), units)
    some = np.unique(sheet.triangles.get_masked_triangles())[::EVERY]
    _paths(ax, data.q[some, 0].T, data.q[some, 1].T, 0.6)
    arrows = [(sheet.momentum, style.ink(), say(r"momentum $p = \partial S/\partial q$"))]
    if not sheet.is_aligned:
        arrows.append((sheet.velocity, style.VERMILION, say(r"velocity $\dot q$")))
    for values, colour, text in arrows:
        at = data.q[some, :, -1].T
        ax.quiver(*at, *values[:, some], width=0.004, color=colour, zorder=3)
        ax.plot(
            [], [], color=colour, marker=r"$\rightarrow$", markersize=12, linestyle="none",
            label=text,
        )  # fmt: skip
    ax.margins(0.1)  # for the arrows
    ax.use_sticky_edges = False


def _paths(ax: Axes, x: Array, y: Array, width: float) -> None:
    """Draw y against x, columns of them, under one entry in the legend."""
    lines = ax.plot(x, y, color=style.PALE, linewidth=width, zorder=1)
    lines[0].set_label(say("paths from the event"))


def _fronts(ax: Axes, sheet: Triangulation, S: Array, units: UnitNames) -> None:
    """Draw lines of equal S over the triangles that are not masked."""
    seen = np.sort(S[np.unique(sheet.get_masked_triangles())])
    levels = np.unique(np.linspace(seen[len(seen) // 50], seen[-1 - len(seen) // 50], FRONTS))
    norm = Normalize(levels[0], levels[-1])
    ax.tricontour(
        sheet, S, levels, cmap=style.unsigned_colours(), norm=norm, linewidths=1.6, zorder=2
    )
    text = label("$S$ from the start", units.action)
    style.colour_bar(ax, levels, norm, style.unsigned_colours(), text)
