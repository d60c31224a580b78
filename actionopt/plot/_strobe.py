"""The motion in space as one picture: what stands where at equal times, as a strobe would show it.

Below the picture stands its scale, for what is drawn has no axes of its own. A motion along a line
would cover its own traces: it becomes a strip, each time beside the one before, in which a body's
trail is its coordinate against time.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from matplotlib.lines import Line2D
from matplotlib.quiver import Quiver

from actionopt.analysis.solution import Solution
from actionopt.plot import _style as style
from actionopt.plot._names import NO_UNITS, UnitNames, label
from actionopt.plot.data.arguments import check_arguments
from actionopt.plot.data.motion import (
    SPRING_BREADTH,
    SPRING_TURNS,
    STILL,
    Draw,
    Motion,
    motion_data,
)
from actionopt.tools.types import Array
from actionopt.tools.words import say

BODIES = (style.BLUE, style.GREEN, style.PURPLE, style.ORANGE, style.SKY)  # vermilion is for forces
SCENERY = style.PALE
LOOKS: dict[str, Any] = {
    "ground": {"linewidth": 2.2},
    "rod": {"linewidth": 1.8},
    "spring": {"linewidth": 1.1, "solid_joinstyle": "round"},
    "body": {"marker": "o", "markersize": 9, "markeredgewidth": 1.4, "linestyle": "none"},
    "point": {"marker": "o", "markersize": 4.5, "linestyle": "none"},  # a ground of one point
}
ARROWS: Any = {
    "angles": "xy", "scale_units": "xy", "width": 0.006, "minlength": 0, "zorder": 3.5,
}  # fmt: skip
TRAIL: Any = {"linewidth": 1.5, "zorder": 3.2}
MOVING_WIDTH = 1.4  # a line of scenery that moves
FIRST_TIME_STRENGTH = 0.25  # how strong the first time is drawn, in parts of the last
TRAIL_STRENGTH = 0.45  # and how strong a trail is
VIEW_MARGIN = 0.06  # of the picture's size, on all sides, and between the scales
NARROWEST_VIEW = 0.7  # a view's width in parts of its height
STRIP = 0.09  # of the picture's size: least distance of a strip's pictures
MOST_TIMES = 6  # more times than these are not all written beside a strip
SCALES_ROW = 0.06  # of the view's height: where the row of scales is
SCALE = 0.17  # of the picture's width: the longest scale
BEGIN = (0.04, 0.4)  # of its width: where the scales of length and force begin
INCHES = 6.4  # the longer side of a picture of its own
WORDS_HEIGHT = 0.6  # inches above and below it


@style.styled
@check_arguments
def motion(
    solution: Solution,
    draw: Draw,
    ax: Axes | None = None,
    *,
    count: int = 9,
    force: bool = False,
    units: UnitNames = NO_UNITS,
) -> Axes:
    """Draw the motion at `count` equal times, earlier ones fainter, the bodies open at the start.

    With `force` the forces of constraint are arrows on the bodies. `draw` is `scene.draw` or one
    of your own; it, and what is raised, are explained at `motion_data`.
    """
    data = motion_data(solution, draw, count, force).flat
    strip = _strip(data)
    shares = np.linspace(0.0, 1.0, count)
    view = stage(data, strip)
    ax = style.on(ax, inches(view))
    prepare(ax, data, view, units)
    along = np.outer(strip, np.linspace(0.0, 1.0, data.trails.shape[2]))
    for b, trail in enumerate(data.trails):
        ax.plot(*(trail + along), color=faded(body_colour(b), TRAIL_STRENGTH), **TRAIL)
    for k, share in enumerate(shares):
        strength = FIRST_TIME_STRENGTH + (1 - FIRST_TIME_STRENGTH) * share
        for s, still in enumerate(data.still):
            if not still or strip.any() or k == count - 1:  # what stays is drawn once
                shape(ax, data, s, k, share * strip, strength, hollow=k == 0)
        if force:
            arrows(ax, data, k, share * strip, strength)
    if strip.any():
        _times(ax, data, strip, units)
    step = f"{(data.t[-1] - data.t[0]) / (count - 1):.3g} {units.time}".rstrip()
    first = ax.plot([], [], color=SCENERY, markerfacecolor=style.paper(), **LOOKS["body"])
    at = {"bbox_to_anchor": (1.0, _row(view)), "bbox_transform": ax.get_yaxis_transform()}
    at |= {"handletextpad": 0, "borderaxespad": 0, "frameon": False}  # it may touch the scales
    ax.legend(first, [say("start")], loc="center right", **at)
    words = say("{count} times, {step} apart", count=count, step=step)
    style.set_title(ax, solution, words)
    return ax


# -- what films draw too ---------------------------------------------------------------------


def stage(data: Motion, strip: Array | float = 0.0) -> Array:
    """Return left, right, bottom and top of the view: the whole motion, and a row for scales."""
    across, down = np.broadcast_to(strip, 2)
    left, right, bottom, top = data.box
    right, bottom = right + across, bottom + down
    margin = VIEW_MARGIN * (float(np.hypot(right - left, top - bottom)) or 1.0)  # one of a point
    spare = max(0.0, NARROWEST_VIEW * (top - bottom) - (right - left)) / 2
    left, right = left - spare - margin, right + spare + margin
    return np.array([left, right, bottom - 3 * margin, top + margin])


def inches(view: Array) -> tuple[float, float]:
    """Return the size of a figure for it."""
    width, height = view[1] - view[0], view[3] - view[2]
    inch = INCHES / max(width, height)
    return inch * width, inch * height + WORDS_HEIGHT


def prepare(ax: Axes, data: Motion, view: Array, units: UnitNames) -> None:
    """Make lengths true in both directions, and draw the scales."""
    left, right, bottom, top = view
    ax.set(xlim=(left, right), ylim=(bottom, top), xticks=[], yticks=[])
    ax.set_aspect("equal", adjustable="box")
    ax.spines[:].set_visible(False)
    y, length = _row(view), nice(SCALE * (right - left))
    x = left + BEGIN[0] * (right - left)
    ax.plot([x, x + length], [y, y], color=style.ink(), linewidth=1.6, marker="|", markersize=7)
    _words(ax, x + length, y, f"{length:g} {units.length}")
    if data.forces is not None and data.arrow:
        strongest = float(np.max(np.linalg.norm(data.forces, axis=1)))
        force = nice(min(strongest, SCALE * (right - left) / data.arrow))
        x = left + BEGIN[1] * (right - left)
        ax.quiver(x, y, force, 0.0, color=style.VERMILION, scale=1 / data.arrow, **ARROWS)
        _words(ax, x + data.arrow * force, y, say("force") + f" {force:g} {units.force}")


def shape(
    ax: Axes,
    data: Motion,
    s: int,
    k: int,
    shift: Array | float = 0.0,
    strength: float = 1.0,
    *,
    hollow: bool = False,
) -> Line2D:
    """Draw shape s at the time k, `shift` away; a body may be hollow."""
    kind = data.kinds[s]
    x, y = outline(data, s, k) + np.reshape(shift, (-1, 1))
    if kind == "body":
        colour = body_colour(data.kinds[:s].count("body"))
        edge = faded(colour, max(strength, TRAIL_STRENGTH)) if hollow else style.paper()
        face = style.paper() if hollow else faded(colour, strength)
        return ax.plot(x, y, markerfacecolor=face, markeredgecolor=edge, zorder=4, **LOOKS[kind])[0]
    look = LOOKS["point" if x.size == 1 else kind]
    colour = SCENERY if kind == "ground" else style.ink()
    line = ax.plot(x, y, color=faded(colour, strength), zorder=3, **look)[0]
    if not data.still[s] and kind == "ground":
        line.set_linewidth(MOVING_WIDTH)
    return line


def outline(data: Motion, s: int, k: int) -> Array:
    """Return the line to draw for shape s at the time k, (2, P): a spring's zigzag, else itself."""
    points = data.points[s][k]
    if data.kinds[s] != "spring":
        return points
    a, along = points[:, 0], points[:, 1] - points[:, 0]
    length = float(np.hypot(*along))
    if not length:
        return points
    across = np.array([-along[1], along[0]]) / length * SPRING_BREADTH * data.size
    at = np.r_[0.0, np.linspace(0.12, 0.88, 2 * SPRING_TURNS + 1), 1.0]
    side = np.r_[0.0, 0.0, np.tile([1.0, -1.0], SPRING_TURNS)[:-1] / 2, 0.0, 0.0]
    return a[:, None] + np.outer(along, at) + np.outer(across, side)


def arrows(
    ax: Axes, data: Motion, k: int, shift: Array | float = 0.0, strength: float = 1.0
) -> Quiver:
    """Draw the forces at the time k."""
    assert data.forces is not None
    x, y = data.bodies[:, :, k].T + np.reshape(shift, (-1, 1))
    scale = 1 / data.arrow if data.arrow else 1.0
    colour = faded(style.VERMILION, strength)
    return ax.quiver(x, y, *data.forces[:, :, k].T, color=colour, scale=scale, **ARROWS)


def faded(colour: str, strength: float) -> Any:
    """Return the colour on paper at a strength from 0 to 1, opaque."""
    paper = np.array(to_rgb(style.paper()))
    return tuple(paper + strength * (np.array(to_rgb(colour)) - paper))


def nice(most: float) -> float:
    """Return the largest of 1, 2, 5, 10, 20, ... and their decimal parts that is at most `most`.

    >>> nice(0.73), nice(2.0), nice(49.0)
    (0.5, 2.0, 20.0)
    """
    power = 10.0 ** np.floor(np.log10(most))
    return float(max(step for step in (power, 2 * power, 5 * power) if step <= most))


# -- parts -----------------------------------------------------------------------------------


def _row(view: Array) -> float:
    """Return the height of the row of scales."""
    return float(view[2] + SCALES_ROW * (view[3] - view[2]))


def body_colour(b: int) -> str:
    return BODIES[b % len(BODIES)]


def _words(ax: Axes, x: float, y: float, text: str) -> None:
    ax.annotate(
        text, (x, y), (6, 0), textcoords="offset points", va="center_baseline", fontsize="small"
    )


def _strip(data: Motion) -> Array:
    """Return how far the last time is drawn from the first, (2,): zero but for motions on a line.

    Down for a motion to the right and left, to the right for one up and down.
    """
    left, right, bottom, top = data.box
    spans = np.ptp(data.trails, axis=2).max(axis=0, initial=0.0)  # of a body, in x and y
    for i, direction, breadth in ((0, (0.0, -1.0), top - bottom), (1, (1.0, 0.0), right - left)):
        if spans[1 - i] <= STILL * data.size < spans[i]:
            apart = max(1.2 * breadth, STRIP * data.size)
            return apart * (data.t.size - 1) * np.array(direction)
    return np.zeros(2)


def _times(ax: Axes, data: Motion, strip: Array, units: UnitNames) -> None:
    """Write the times beside the pictures of a strip."""
    down = bool(strip[1])
    at = data.bodies[0, int(down), 0] + np.linspace(0.0, 1.0, data.t.size) * strip[int(down)]
    axis = ax.yaxis if down else ax.xaxis
    every = slice(None, None, 2 if at.size > MOST_TIMES else 1)
    axis.set_ticks(at[every], [f"{t:.3g}" for t in data.t[every]])
    axis.set_tick_params(length=0)
    axis.set_label_text(label(units.clock, units.time))
    ax.grid(False)
