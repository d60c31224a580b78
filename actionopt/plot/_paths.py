"""Pictures of a solution: its path, the forward integration over it, and how far they are apart.

Then all the paths between two events, and the mesh of one. Every function takes axes or makes
them, returns them, and shows nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import Normalize
from matplotlib.ticker import MaxNLocator

from actionopt.analysis.solution import Solution, question
from actionopt.mechanics.question.events import Bounce, Event
from actionopt.plot import _style as style
from actionopt.plot._names import NO_UNITS, UnitNames, label, planar, symbol
from actionopt.plot.data.along import curves, family_data, forward_values, mesh_data, times
from actionopt.plot.data.arguments import check_arguments
from actionopt.tools.types import Array
from actionopt.tools.words import number, say

BADGE: Any = {"boxstyle": "circle,pad=0.2", "edgecolor": style.GREY}
# Parts of the longer range of two axes of equal scales: either may reach so far. Ad hoc.
AXES_REACH = np.array([-0.8, 0.8])
OBSTACLE = 200  # points along each axis where an obstacle is asked: half a line's width apart
LARGEST_IMPULSE = 0.15  # of the picture's size, the largest impulse; ad hoc
TALLEST_IMPULSE = 1.25  # of the largest contact force, and of the axis over that; ad hoc
BOUND: Any = {"color": style.GREY, "linewidth": 1.2}


@style.styled
@check_arguments
def overview(
    solution: Solution, axes: Sequence[Axes] | None = None, *, units: UnitNames = NO_UNITS
) -> tuple[Axes, Axes]:
    """Draw `paths` above `deviation`, on two axes or in a figure of their own.

    A path in contact with an obstacle has `contact` in place of the deviation.
    """
    if axes is None:
        axes = style.new_figure((6.4, 6.4)).subplots(2, height_ratios=(3, 2))
    above, below = style.unpack(axes, 2)
    touches = solution.problem.system.r and solution.contacts
    second = contact if touches else deviation
    return paths(solution, above, units=units), second(solution, below, units=units)


@style.styled
@check_arguments
def paths(
    solution: Solution, ax: Axes | None = None, *, compare: bool = True, units: UnitNames = NO_UNITS
) -> Axes:
    """Draw the path, and unless `compare` is False the forward integration over it.

    Cartesian coordinates, pairs named x and y with the same ending, are drawn as orbits in the
    plane; any others against time. An obstacle is drawn where f = 0: in the plane of a path of two
    coordinates that is an orbit, at the start, or over the time of a path of one coordinate. So
    are the surfaces of events, at their times; where a path bounces their other side is grey. The
    impulses at events between the ends are arrows, in the plane of an orbit. There
    is no forward integration of a path in contact. Several solutions are drawn by `family`.
    """
    names, t = question(solution).system.coordinates, times(solution)
    t, ax = np.union1d(t, style.joint_times(solution)), style.on(ax)
    for x, y, what in style.traces(names, t, solution(t)):
        ax.plot(x, y, **style.PATH, label=what)
    touches = solution.problem.system.r and solution.contacts
    if compare and not touches:
        forward = forward_values(solution, t)
        style.draw(ax, names, t, forward, None, say("forward integration"), **style.forward())
    style.frame(ax, solution, units)
    _impulses(ax, solution)
    _surfaces(ax, solution, t)
    S = f"{number(solution.action, 8)} {units.action}".rstrip()
    style.set_title(ax, solution, f"$S$ = {S}")
    style.legend(ax)
    return ax


def _impulses(ax: Axes, solution: Solution) -> None:
    """Draw the jumps of the momentum as arrows, the largest of a part of the picture's size."""
    problem, jumps = solution.problem, solution.impulses
    pairs = planar(problem.system.coordinates)
    if not pairs or not jumps.any():
        return
    places = solution(style.joint_times(solution)).T
    size = max(np.ptp(solution.path.values[list(pair)], axis=1).max() for pair in pairs)
    scale = np.abs(jumps).max() / (LARGEST_IMPULSE * size)
    for k, pair in enumerate(pairs):
        at, by = places[:, list(pair)].T, jumps[:, list(pair)].T / scale
        ends = at + by
        ax.update_datalim(ends.T)
        look: Any = {"color": style.VERMILION, "width": 0.007, "zorder": 4}
        text = None if k else say("impulse")
        ax.quiver(*at, *by, angles="xy", scale_units="xy", scale=1, label=text, **look)
    ax.autoscale_view()


def _surfaces(ax: Axes, solution: Solution, t: Array) -> None:
    """Draw where obstacles and what events lie on vanish, as far as the axes reach.

    The side of an obstacle, or of what a path bounces off, on which no path is, is grey.
    """
    problem = solution.problem
    system, n = problem.system, problem.system.n
    surfaces = _surfaces_of(solution)
    if system.r:

        def obstacle(q: Array, t: Array) -> Array:
            return system.obstacle(q, t, parameters=problem.parameters)

        surfaces.append((obstacle, t[0], True))
    rows = style.traces(system.coordinates, t, solution(t))
    if not surfaces or n > 2 or len(rows) > 1:
        return
    limits = np.array([ax.get_xlim(), ax.get_ylim()])
    reach = limits
    if n == 2:  # of equal scales, an axis may reach farther than its limits say yet
        reach = limits.mean(axis=1, keepdims=True) + np.ptp(limits, axis=1).max() * AXES_REACH
    (left, right), (low, high) = reach
    x, y = np.meshgrid(np.linspace(left, right, OBSTACLE), np.linspace(low, high, OBSTACLE))
    seen = ax.dataLim.frozen()  # the axes are those of the path
    for function, time, one_sided in surfaces:
        q = y.reshape(1, -1) if n == 1 else np.stack([x.ravel(), y.ravel()])
        f = function(q, x.ravel() if n == 1 else np.full(x.size, time))
        for row in f.reshape(-1, OBSTACLE, OBSTACLE):
            if one_sided:
                ax.contourf(x, y, row, [-np.inf, 0.0], colors=style.PALE, alpha=0.4, zorder=0)
            ax.contour(x, y, row, [0.0], colors=style.GREY, linewidths=1.2, zorder=1)
    ax.dataLim.set(seen)
    ax.autoscale_view()


def _surfaces_of(solution: Solution) -> list[tuple[Callable[[Array, Array], Array], float, bool]]:
    """Return what the events lie on: on(q, t), the time, and whether paths stay on one side.

    Each surface once, or as often as it has moved.
    """
    problem, found = solution.problem, {}
    for event, at in zip(problem.joints, problem.joints_found, strict=True):
        if event.on is None:
            continue

        def on(q: Array, t: Array, event: Event = event) -> Array:
            return event.on.along(q.T, t, problem.packed)[0].T

        moves = event.on.depends_on_time and problem.system.n > 1
        key = event.on.law.serialize(), at.t if moves else None, isinstance(event, Bounce)
        found[key] = on, at.t, isinstance(event, Bounce)
    return list(found.values())


@style.styled
@check_arguments
def contact(solution: Solution, ax: Axes | None = None, *, units: UnitNames = NO_UNITS) -> Axes:
    """Draw the contact force nu of each row of an obstacle against time.

    Arrows are impulses, with their values; the largest is a little taller than the largest force.
    Raises ValueError for a system without an obstacle.
    """
    t = times(solution)
    ends = [x for arc in solution.contacts if not arc.point for x in (arc.begin, arc.end)]
    t = np.sort(np.concatenate([t, ends, np.nextafter(ends, -np.inf), np.nextafter(ends, np.inf)]))
    t = t[(t >= solution.problem.start.t) & (t <= solution.problem.end.t)]
    force, ax = solution.contact_force(t), style.on(ax)
    for i, row in enumerate(force):
        what = r"$\nu$" if len(force) == 1 else rf"$\nu_{{{i}}}$"
        ax.plot(t, row, **{**style.PATH, "linewidth": 2.0}, **style.strand(i), label=what)
    _draw_contact_impulses(ax, solution, TALLEST_IMPULSE * (force.max() or 1.0))
    if solution.contacts and not force.any():  # impulses alone, whose height has no unit
        ax.set_yticks([0.0])
    ax.set(xlabel=label(units.clock, units.time), ylabel=label(r"contact force $\nu$"))
    ax.margins(x=0)
    if len(force) > 1:
        style.legend(ax)
    return ax


def _draw_contact_impulses(ax: Axes, solution: Solution, height: float) -> None:
    """Draw the impulses of an obstacle as arrows, the largest of a height, with their values."""
    impulses, arrow = solution.contact_impulses, {"arrowstyle": "-|>", "color": style.ink()}
    largest = impulses.max(initial=0.0)
    for arc, pair in zip(solution.contacts, impulses, strict=True):
        beside = ("center", "center") if arc.point else ("right", "left")
        for x, impulse, place in zip((arc.begin, arc.end), pair, beside, strict=True):
            if impulse > 0:
                top = height * impulse / largest
                ax.annotate("", (x, top), (x, 0.0), arrowprops={**arrow, "shrinkA": 0})
                ax.text(x, top, f" {number(float(impulse), 3)} ", ha=place, va="bottom")
    if largest:
        ax.set_ylim(top=TALLEST_IMPULSE * height)


@style.styled
@check_arguments
def deviation(solution: Solution, ax: Axes | None = None, *, units: UnitNames = NO_UNITS) -> Axes:
    """Draw the deviation of the forward integration against time, on a logarithmic axis.

    With it the solution's error estimate and the uncertainty of the integration itself: below
    the latter the deviation means nothing.
    """
    data, ax = curves(solution), style.on(ax)
    seen = np.where(data.deviation > 0, data.deviation, np.nan)
    ax.semilogy(data.t, seen, color=style.ink(), linewidth=1.2, label=say("deviation"))
    for value, look, text in (
        (solution.error, "--", say("error estimate")),
        (solution.compare().reference_error, ":", say("uncertainty of integration")),
    ):
        if np.isfinite(value) and value > 0:
            ax.axhline(value, **BOUND, linestyle=look, label=text)
    ax.set(xlabel=label(units.clock, units.time), ylabel=label("relative deviation"))
    style.legend_above(ax, 3)
    return ax


@style.styled
@check_arguments
def family(
    solutions: Iterable[Solution],
    ax: Axes | None = None,
    *,
    coordinate: int | None = None,
    units: UnitNames = NO_UNITS,
) -> Axes:
    """Draw all the paths between two events, coloured by action and labelled by index.

    `solutions` is what `solve_all` returns, or any solutions between the same events. Orbits for
    Cartesian coordinates, else one `coordinate` against time. Obstacles and what events lie on are
    drawn as by `paths`.
    """
    found = list(solutions)
    t, paths, actions = family_data(found)
    system = found[0].problem.system
    names, forced = system.coordinates, system.structure.forced
    place = style.coordinate_to_show(found[0], coordinate)
    norm = Normalize(actions.min(), actions.max() if np.ptp(actions) else actions.min() + 1.0)
    ax = style.on(ax)
    for k, (solution, q, S) in enumerate(zip(found, paths, actions, strict=True)):
        style.draw(ax, names, t, q, place, color=style.unsigned_colours()(norm(S)), linewidth=2.4)
        style.frame(ax, solution, units, place)  # a path with windings has an end of its own
        if forced:
            continue
        rows = style.traces(names, t, q, place)
        x, y, _ = max(rows, key=lambda row: np.hypot(np.ptp(row[0]), np.ptp(row[1])))
        # Labels stand at different times, so that they do not lie on one another.
        at = int(t.size * (0.3 + 0.4 * (k + 0.5) / len(found)))
        ax.annotate(
            str(solution.morse_index), (x[at], y[at]), ha="center", va="center", zorder=6,
            fontsize="small",
            bbox={**BADGE, "facecolor": style.paper()},
        )  # fmt: skip
    if place is None or system.n == 1:
        _surfaces(ax, found[0], t)
    if len(found) > 1:
        text = label("action $S$", units.action)
        style.colour_bar(ax, actions, norm, style.unsigned_colours(), text)
    many = say("1 path") if len(found) == 1 else say("{count} paths", count=len(found))
    numbered = "" if forced else say(", numbered by index")
    style.set_title(ax, found[0], f"{many}{numbered}")
    return ax


@style.styled
@check_arguments
def mesh(
    solution: Solution, axes: Sequence[Axes] | None = None, *, units: UnitNames = NO_UNITS
) -> tuple[Axes, Axes]:
    """Draw the path with its nodes, and below it the degree of each element."""
    boundaries, degrees = mesh_data(solution)
    names = solution.problem.system.coordinates
    t, nodes = times(solution), solution.mesh.nodes
    if axes is None:
        figure = style.new_figure((6.4, 5.2))
        axes = figure.subplots(2, sharex=True, height_ratios=(3, 2))
    above, below = style.unpack(axes, 2)
    for i, (name, q, dots) in enumerate(zip(names, solution(t), solution(nodes), strict=True)):
        look = style.strand(i)
        above.plot(t, q, **{**style.PATH, "linewidth": 2.5}, **look, label=symbol(name))
        above.plot(nodes, dots, ".", color=look["color"], markersize=4)
    below.stairs(degrees, boundaries, fill=True, color=style.BLUE, alpha=0.25)
    below.stairs(degrees, boundaries, color=style.BLUE, linewidth=1.5)
    for ax in (above, below):
        for b in boundaries:
            ax.axvline(b, color=style.PALE, linewidth=0.6, zorder=1)
        ax.margins(x=0)
        ax.grid(visible=False, axis="x")
    below.set_ylim(0, 1.15 * degrees.max())
    below.yaxis.set_major_locator(MaxNLocator(5, integer=True))
    below.set(xlabel=label(units.clock, units.time), ylabel=label("degree"))
    above.set_ylabel(label("coordinates", *map(units.coordinate, names)))
    style.legend(above, beside=True)
    values = {"count": degrees.size, "error": number(solution.error, 1)}
    words = say("{count} elements, error about {error}", **values)
    style.set_title(above, solution, words)
    return above, below
