"""Maps of a sweep: the action over a grid, and where the kind of path changes."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap, Normalize, to_rgb

from actionopt.families.sweeps.runs import Runs
from actionopt.families.vary import Name
from actionopt.plot import _style as style
from actionopt.plot._names import NO_UNITS, UnitNames, label, symbol
from actionopt.plot.data.arguments import check_arguments
from actionopt.tools.types import Array
from actionopt.tools.words import say

RUNS_CONTOURS = 15
TINT = 0.35  # of the colours of areas, the rest is white
FACES = (style.SKY, style.ORANGE, style.GREEN, style.PURPLE, style.BLUE, style.VERMILION)
QUANTITIES = {
    "action": "action $S$",
    "error": "estimated error",
    "index": "Morse index",
    "branch": "branch",
}


@style.styled
@check_arguments
def runs(
    runs: Runs, quantity: str = "action", ax: Axes | None = None, *, units: UnitNames = NO_UNITS
) -> Axes:
    """Draw a quantity of a sweep over one or two axes: "action", "error", "index" or "branch".

    One axis: a line for each branch. Two: contours, on areas shaded by the index or, where it was
    not recorded, by the branch. Members that failed are crosses.

    Raises ValueError for another quantity, or more axes.
    """
    if not isinstance(runs, Runs):
        raise ValueError(f"expected what `sweep` returns, found {runs!r}")
    values = {name: getattr(runs, name) for name in QUANTITIES}.get(quantity)
    if values is None:
        known = [name for name in QUANTITIES if getattr(runs, name) is not None]
        raise ValueError(f"expected one of {', '.join(known)} to draw, found {quantity!r}")
    if len(runs.shape) > 2 or (runs.grid.zipped and len(runs.grid.names) > 1):
        raise ValueError(
            f"expected a sweep over one or two axes to draw, found {len(runs.grid.names)} "
            f"quantities{' zipped' if runs.grid.zipped else ''}; draw its arrays by hand"
        )
    ax = style.on(ax)
    branch, values = runs.branch, np.where(runs.success, values, np.nan)
    kinds = branch if runs.index is None else np.where(runs.success, runs.index, -1)
    what = say("branch" if runs.index is None else "index")
    text = label(QUANTITIES[quantity], units.action if quantity == "action" else "")
    names = [_axis(name, units) for name in runs.grid.names]
    if len(runs.shape) == 1:
        _lines(ax, runs.grid.values[0], values, branch, kinds, what)
        ax.set(xlabel=names[0], ylabel=text)
        failed = runs.grid.values[0][runs.failed]
        places = failed, np.zeros(failed.size)
    else:
        _areas(ax, runs, kinds, what)
        _contours(ax, runs, values, branch, text)
        ax.set(xlabel=names[0], ylabel=names[1])
        places = tuple(
            row[k] for row, k in zip(runs.grid.values, np.nonzero(runs.failed), strict=True)
        )
    if places[0].size:
        across = ax.get_xaxis_transform() if len(runs.shape) == 1 else ax.transData
        ax.plot(
            *places,
            "x",
            color=style.GREY,
            markersize=4,
            transform=across,
            label=say("failed"),
            linestyle="none",
        )
    style.set_title(ax, runs.problem, f"{say(QUANTITIES[quantity])}, {_count_text(runs)}")
    if ax.get_legend_handles_labels()[1]:
        style.legend(ax, beside=len(runs.shape) == 2)
    return ax


def _count_text(runs: Runs) -> str:
    """Return how many members there are, and how many failed."""
    failed, count = int(runs.failed.sum()), runs.grid.size
    if failed:
        return say("{count} paths, {failed} of them failed", count=count, failed=failed)
    return say("{count} paths", count=count)


def _axis(name: Name, units: UnitNames) -> str:
    """Return the label of the axis of what varies."""
    if isinstance(name, tuple) and name[0] == "integral":
        return say("integral {k}", k=name[1])
    if isinstance(name, tuple) and name[0] == "through":
        what, unit = (name[2], units.coordinate(name[2])) if name[2] != "t" else ("t", units.time)
        return label(say("{x} at event {k}", x=symbol(what), k=name[1]), unit)
    if isinstance(name, tuple):
        there = say(
            "{x} at the start" if name[0] == "start" else "{x} at the end", x=symbol(name[1])
        )
        return label(there, units.coordinate(name[1]))
    if name in ("t0", "t1"):
        which = say("start time {x}" if name == "t0" else "end time {x}", x=symbol(name))
        return label(which, units.time)
    return symbol(name)


def _lines(ax: Axes, x: Array, values: Array, branch: Array, kinds: Array, what: str) -> None:
    """Draw a line for each branch, of the colour of its kind."""
    named = set()
    for b in range(branch.max(initial=-1) + 1):
        here = branch == b
        kind = int(kinds[here][0])
        y = np.where(here, values, np.nan)
        text = (
            f"{what} {kind}" if kind not in named and what == say("index") and kind >= 0 else None
        )
        named.add(kind)
        alone = "." if here.sum() == 1 else None
        ax.plot(x, y, color=style.colour(max(kind, 0)), linewidth=2.2, marker=alone, label=text)


def _areas(ax: Axes, runs: Runs, kinds: Array, what: str) -> None:
    """Shade each member by its kind."""
    found = np.unique(kinds[kinds >= 0])
    faces = [_tint(FACES[k % len(FACES)]) for k in found]
    if not found.size:
        return
    places = np.where(kinds >= 0, np.searchsorted(found, kinds), np.nan)
    x, y = (_edges(row) for row in runs.grid.values)
    look = {"cmap": ListedColormap(faces), "norm": Normalize(-0.5, found.size - 0.5)}
    ax.pcolormesh(x, y, np.ma.masked_invalid(places).T, **look, zorder=0.5, rasterized=True)
    ax.grid(False)
    if found.size <= len(FACES):
        for face, k in zip(faces, found.tolist(), strict=True):
            ax.fill([], [], color=face, label=f"{what} {k}")


def _contours(ax: Axes, runs: Runs, values: Array, branch: Array, text: str) -> None:
    """Draw lines of equal values on each branch: none leads from one to another."""
    x, y = runs.grid.values
    finite = values[np.isfinite(values)]
    if not finite.size or not np.ptp(finite):
        return
    low, high = np.quantile(finite, [0.01, 0.99])  # one member beside a pole is not to decide
    levels = np.linspace(low, high, RUNS_CONTOURS) if low < high else np.array([low])
    norm = Normalize(levels[0], levels[-1])
    for b in range(branch.max(initial=-1) + 1):
        here = branch == b
        quads = here[1:, 1:] & here[1:, :-1] & here[:-1, 1:] & here[:-1, :-1]
        if quads.any():
            sheet = np.ma.masked_where(~here | ~np.isfinite(values), values)
            ax.contour(x, y, sheet.T, levels, cmap=style.UNSIGNED, norm=norm, linewidths=1.4)
    style.colour_bar(ax, levels, norm, style.UNSIGNED, text)


def _edges(row: Array) -> Array:
    """Return the boundaries (k + 1,) of cells around k values."""
    if row.size == 1:
        return row[0] + np.array([-0.5, 0.5])
    middle = (row[1:] + row[:-1]) / 2
    return np.concatenate([[2 * row[0] - middle[0]], middle, [2 * row[-1] - middle[-1]]])


def _tint(colour: str) -> tuple[float, ...]:
    return tuple(1 - TINT * (1 - x) for x in to_rgb(colour))
