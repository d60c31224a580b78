"""Pictures of a solution: its path, the forward integration over it, and how far they are apart.

Every function takes axes or makes them, returns them, and shows nothing. What is drawn can be had
as arrays from `curves`. Colours are Okabe and Ito's, which colour-blind readers can tell apart.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path as FilePath
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.rcsetup import cycler

from actionopt.quadrature import Array
from actionopt.solution import Solution

STYLE: Any = {
    "axes.prop_cycle": cycler(
        color=["#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9"]
    ),
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": "#e6e6e6",
    "legend.frameon": False,
    "lines.solid_capstyle": "round",
    "figure.figsize": (6.4, 6.4),
    "savefig.dpi": 150,
}
PATH: Any = {
    "linewidth": 4.5,
    "alpha": 0.5,
}  # broad, so that the forward integration lies within it
FORWARD: Any = {"linewidth": 1.0, "color": "black", "linestyle": (0, (5, 3))}
EVENT: Any = {"marker": "o", "color": "black", "markersize": 6, "linestyle": "none", "zorder": 3}
START = {**EVENT, "markerfacecolor": "white", "label": "start"}
END = {**EVENT, "label": "end"}
BOUND: Any = {"color": "#555555", "linewidth": 1.0}
BESIDE: Any = {
    "xycoords": ("axes fraction", "data"),
    "textcoords": "offset points",
    "horizontalalignment": "right",
    "verticalalignment": "bottom",
    "bbox": {"facecolor": "white", "edgecolor": "none", "alpha": 0.8, "pad": 1.0},
    "zorder": 3,
}

GREEK = (
    "alpha beta gamma delta epsilon zeta eta theta iota kappa lambda mu nu xi pi rho sigma tau "
    "upsilon phi chi psi omega"
).split()
COUNT = 600  # times at which a curve is drawn: more than a picture has columns for


@dataclass(frozen=True, eq=False)
class Curves:
    """What the pictures show, at K times.

    Attributes
    ----------
    t : (K,) array
        Times, both events' included.
    q, forward : (n, K) arrays
        The solution, and the forward integration from its start.
    deviation : (K,) array
        Largest |forward - q| of all coordinates, each in units of the largest |q| it reaches.
    """

    t: Array
    q: Array
    forward: Array
    deviation: Array


def curves(solution: Solution, count: int = COUNT) -> Curves:
    """Return the arrays behind the pictures at `count` equal times; the comparison is made."""
    t = _times(solution, count)
    q, forward = solution(t), solution.compare().path(t)
    size = np.max(np.abs(q), axis=1, keepdims=True)
    size[size <= 1e-12 * np.max(size)] = np.max(size) or 1.0  # zero but for round-off
    return Curves(t, q, forward, np.max(np.abs(forward - q) / size, axis=0))


def overview(solution: Solution, axes: Sequence[Axes] | None = None) -> tuple[Axes, Axes]:
    """Draw `paths` above `deviation`, on two axes or in a figure of their own."""
    with rc_context(STYLE):
        pair = _figure().subplots(2, height_ratios=(3, 2)) if axes is None else axes
        above, below = pair
        return paths(solution, above), deviation(solution, below)


def paths(solution: Solution, ax: Axes | None = None, *, compare: bool = True) -> Axes:
    """Draw the path, and unless `compare` is False the forward integration over it.

    Cartesian coordinates, pairs named x and y with the same ending, are drawn as orbits in the
    plane; any others against time.
    """
    names = solution.problem.system.coordinates
    t = _times(solution, COUNT)
    with rc_context(STYLE):
        ax = _axes(ax)
        for x, y, label in _traces(names, t, solution(t)):
            ax.plot(x, y, **PATH, label=label)
        if compare:
            label = "forward integration"
            for x, y, _ in _traces(names, t, solution.compare().path(t)):
                ax.plot(x, y, **FORWARD, label=label)
                label = None  # one entry in the legend stands for all
        for event, look in ((solution.problem.start, START), (solution.problem.end, END)):
            given = np.array([event.q], dtype=float).T  # NaN, not drawn, where it is free
            for x, y, _ in _traces(names, np.array([event.t]), given):
                ax.plot(x, y, **look)
                look = {**look, "label": None}
        if planar(names):
            i, j = planar(names)[0]
            ax.set(xlabel=f"${names[i][0]}$", ylabel=f"${names[j][0]}$")
            ax.set_aspect("equal", adjustable="datalim")
        else:
            ax.set(xlabel="time $t$", ylabel=", ".join(symbol(name) for name in names))
        name = solution.problem.system.name.replace("_", " ")
        ax.set_title(f"{name}  $S$ = {solution.action:.8g}", loc="left")
        ax.legend()
    return ax


def deviation(solution: Solution, ax: Axes | None = None) -> Axes:
    """Draw the deviation of the forward integration against time, on a logarithmic axis.

    With it the solution's error estimate and the uncertainty of the integration itself: below
    the latter the deviation means nothing.
    """
    data = curves(solution)
    seen = np.where(data.deviation > 0, data.deviation, np.nan)
    with rc_context(STYLE):
        ax = _axes(ax)
        ax.semilogy(data.t, seen, color="black", linewidth=1.2)
        for value, look, text in (
            (solution.error, "--", "error estimate of the path"),
            (solution.compare().reference_error, ":", "uncertainty of the integration"),
        ):
            if np.isfinite(value) and value > 0:
                ax.axhline(value, **BOUND, linestyle=look)
                ax.annotate(text, (0.99, value), (0, 2), **BESIDE, color=BOUND["color"])
        ax.set(xlabel="time $t$", ylabel="deviation / size of coordinate")
        low, high = ax.get_ylim()
        ax.set_ylim(low, 10 * high)  # room for the words
    return ax


def save(solution: Solution, file: str | FilePath, *, compare: bool = True) -> None:
    """Write `overview`, or `paths` alone if `compare` is False, to a picture file.

    Raises ValueError for an ending that matplotlib does not know, OSError if it cannot write.
    """
    with rc_context(STYLE):
        figure = Figure(layout="constrained")  # not pyplot's: it needs no display
        if compare:
            overview(solution, figure.subplots(2, height_ratios=(3, 2)))
        else:
            paths(solution, figure.subplots(), compare=False)
        figure.savefig(file)


def symbol(name: str) -> str:
    r"""Return a coordinate's name as mathematics: theta1 becomes theta with index 1.

    >>> symbol("theta1"), symbol("x"), symbol("speed")
    ('$\\theta_{1}$', '$x$', '$\\mathrm{speed}$')
    """
    word, index = re.fullmatch(r"(.*?)_?(\d*)", name, re.DOTALL).groups()  # type: ignore[union-attr]
    if word in GREEK:
        word = f"\\{word}"
    elif len(word) > 1:
        word = f"\\mathrm{{{word}}}".replace("_", r"\_")
    return f"${word}_{{{index}}}$" if index else f"${word}$"


def planar(names: Sequence[str]) -> list[tuple[int, int]]:
    """Return the indices of the pairs (x, y) if all coordinates are Cartesian, else nothing.

    >>> planar(["x1", "y1", "x2", "y2"]), planar(["x", "s"])
    ([(0, 1), (2, 3)], [])
    """
    partner = {"x": "y", "X": "Y"}
    pairs = [
        (i, names.index(partner[name[0]] + name[1:]))
        for i, name in enumerate(names)
        if name[0] in partner and partner[name[0]] + name[1:] in names
    ]
    return pairs if 2 * len(pairs) == len(names) else []


def _traces(names: Sequence[str], t: Array, q: Array) -> list[tuple[Array, Array, str]]:
    """Return what to draw against what, and its label."""
    pairs = planar(names)
    if pairs:
        return [(q[i], q[j], f"({symbol(names[i])}, {symbol(names[j])})") for i, j in pairs]
    return [(t, row, symbol(name)) for name, row in zip(names, q, strict=True)]


def _times(solution: Solution, count: int) -> Array:
    return np.linspace(solution.problem.start.t, solution.problem.end.t, count)


def _figure() -> Any:
    from matplotlib import pyplot  # a second of import, for interactive use only

    return pyplot.figure(layout="constrained")


def _axes(ax: Axes | None) -> Axes:
    return _figure().subplots() if ax is None else ax
