"""One style for all pictures: colours, labels, units, axes.

Colours are Okabe and Ito's, which colour-blind readers can tell apart, the two palest darker: each
line has a contrast of at least 3 on white and on black. What has a sign runs from blue through grey
to vermilion, what has not along the part of cividis that is seen on the paper. The reader's own
style is kept: dark paper has light ink, sizes of words and figures and the dpi of files stay. A
figure whose size the reader does not give grows with its words.
"""

from __future__ import annotations

from collections.abc import Generator, Sequence
from contextlib import contextmanager
from textwrap import fill
from typing import Any

import numpy as np
from matplotlib import (
    colormaps,
    interactive,
    is_interactive,
    rc_context,
    rcParams,
    rcParamsDefault,
)
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import (
    FuncNorm,
    LinearSegmentedColormap,
    ListedColormap,
    Normalize,
    to_rgb,
)
from matplotlib.lines import Line2D
from matplotlib.rcsetup import cycler
from matplotlib.ticker import MaxNLocator

from actionopt.analysis.solution import Solution
from actionopt.mechanics.question.events import Bounce
from actionopt.mechanics.question.problem import Problem
from actionopt.plot._names import NO_UNITS, UnitNames, label, planar, symbol
from actionopt.tools.types import Array
from actionopt.tools.words import say

BLUE, VERMILION, GREEN, PURPLE, ORANGE, SKY = (
    *("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#BD8200", "#2E93CC"),
)
COLOURS = (BLUE, VERMILION, GREEN, PURPLE, ORANGE, SKY)
GREY = "#757575"  # of words: 4.6 on white and on black
PALE = "#8c8c8c"  # what lies behind
DASHES: Any = ("-", (0, (5, 2)), (0, (1.5, 1.5)))  # six colours each, then the next kind of line
STYLE: Any = {
    "axes.prop_cycle": cycler(color=list(COLOURS)),
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.formatter.use_mathtext": True,
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.titlesize": "medium",
    "font.size": 11,
    "legend.edgecolor": "none",
    "legend.fancybox": False,
    "legend.fontsize": "small",
    "lines.solid_capstyle": "round",
    "figure.figsize": (6.4, 4.4),
    "savefig.dpi": 150,
    "svg.hashsalt": "actionopt",  # the same picture is the same file
}
READERS = ("font.size", "figure.figsize", "savefig.dpi")  # the reader's, where they are not usual


@contextmanager
def styled_figures() -> Generator[None, None, None]:
    """Draw in the style. A notebook's backend, if loaded meanwhile, stays interactive."""
    on = is_interactive()
    try:
        kept = {key for key in READERS if rcParams[key] != rcParamsDefault[key]}
        with rc_context({k: x for k, x in STYLE.items() if k not in kept}):
            if "figure.figsize" not in kept:
                rcParams["figure.figsize"] = reader_sizes(*STYLE["figure.figsize"])
            rcParams["grid.color"] = "#333333" if dark() else "#e6e6e6"
            try:
                yield
            finally:
                on = is_interactive()
    finally:
        interactive(on)


styled = styled_figures()  # the decorator of whatever draws
SIGNED = LinearSegmentedColormap.from_list(
    "signed", [BLUE, "#4a94c4", "#8e8e8e", "#b5760a", "#b84a00"]
)
AREAS = LinearSegmentedColormap.from_list(  # the same for areas, which are seen where they are pale
    "areas", [BLUE, "#6fb1d8", "#b5b5b5", "#e69f00", "#b84a00"]
)
UNSIGNED, UNSIGNED_DARK = (
    ListedColormap(colormaps["cividis"](np.linspace(*part, 256)), "unsigned")
    for part in ((0.0, 0.6), (0.4, 1.0))
)
# Colours of what turns round, in Oklab (B. Ottosson 2020): lightnesses from 0.48 to 0.64 have a
# contrast of 3 and more on white and on black.
MIDDLE, SWING, SATURATION = 0.56, 0.08, 0.11
OKLAB_TO_LMS = np.array(
    [
        [1, 1, 1],
        [0.3963377774, -0.1055613458, -0.0894841775],
        [0.2158037573, -0.0638541728, -1.2914855480],
    ]
)
LMS_TO_RGB = np.array(
    [
        [4.0767416621, -1.2684380046, -0.0041960863],
        [-3.3077115913, 2.6097574011, -0.7034186147],
        [0.2309699292, -0.3413193965, 1.7076147010],
    ]
)
PATH: Any = {"linewidth": 4.5}  # broad: the forward integration lies within it
POTENTIAL: Any = {"color": VERMILION, "linewidth": 2.2, "linestyle": (0, (6, 2))}
SHORT_BAR = 0.06  # of a bar of colours
IF_ROOM = "_if there is room"  # the label of words that a small picture can do without
LETTER_WIDTH = 0.5  # of the size of letters, small as those of a title are; ad hoc
MOST_ENTRIES = 5  # entries of a legend: more stand beside the picture


def dark() -> bool:
    """Return whether the paper is nearer to black than to white."""
    return sum(to_rgb(rcParams["axes.facecolor"])) < 1.5


def ink() -> str:
    """Return the colour of what must be seen first."""
    return "white" if dark() else "black"


def paper() -> str:
    """Return the colour of what is hollow."""
    return rcParams["axes.facecolor"]


def unsigned_colours() -> ListedColormap:
    """Return the colours of what has no sign."""
    return UNSIGNED_DARK if dark() else UNSIGNED


def circle() -> ListedColormap:
    """Return the colours of a phase: blue against ochre a quarter on, dark against light between.

    So a colour-blind reader tells all phases apart, and so does one in grey two of four. What has
    none stands out.
    """
    turn = 2 * np.pi * np.arange(256) / 256
    lightness = MIDDLE + (SWING if dark() else -SWING) * np.cos(turn)
    bright = np.stack([lightness, 0 * turn, SATURATION * np.sin(turn)], axis=1)
    linear = np.clip((bright @ OKLAB_TO_LMS) ** 3 @ LMS_TO_RGB, 0, 1)
    light = 1.055 * linear ** (1 / 2.4) - 0.055
    return ListedColormap(np.clip(np.where(linear > 0.0031308, light, 12.92 * linear), 0, 1))


def reader_sizes(*sizes: float) -> list[float]:
    """Return sizes of this style in the reader's, whose words may be larger."""
    return [size * rcParams["font.size"] / STYLE["font.size"] for size in sizes]


def figure_size(width: float, height: float) -> tuple[float, float]:
    """Return the reader's size of a figure (inches), or this one, grown with the reader's words."""
    own = list(rcParams["figure.figsize"])
    if own == reader_sizes(*STYLE["figure.figsize"]):  # not the reader's
        own = reader_sizes(width, height)
    return own[0], own[1]


def true() -> dict[str, Any]:
    """Return the look of the stationary path, among others."""
    return {"color": ink(), "linewidth": 2.2, "zorder": 4}


def forward() -> dict[str, Any]:
    """Return the look of the forward integration."""
    return {"color": ink(), "linewidth": 1.0, "linestyle": (0, (5, 3))}


def event() -> dict[str, Any]:
    """Return the look of the end, or of a point."""
    dot = {"marker": "o", "markersize": 6, "linestyle": "none", "zorder": 5}
    return {"color": ink(), **dot}


def middle() -> dict[str, Any]:
    """Return the look of an event between the ends."""
    return {**event(), "marker": "D", "markersize": 5.5, "markerfacecolor": GREY}


def start() -> dict[str, Any]:
    """Return the look of the start."""
    return {**event(), "markerfacecolor": paper()}


def traces(
    names: Sequence[str], t: Array, q: Array, coordinate: int | None = None
) -> list[tuple[Array, Array, str]]:
    """Return what to draw against what, and its label: orbits, else coordinates against time.

    `coordinate` is the one drawn against time; by default orbits are, or if there are none all.
    """
    pairs = planar(names)
    if pairs and coordinate is None:
        return [(q[i], q[j], f"({symbol(names[i])}, {symbol(names[j])})") for i, j in pairs]
    chosen = range(len(names)) if coordinate is None else [coordinate]
    return [(t, q[i], symbol(names[i])) for i in chosen]


def draw(
    ax: Axes,
    names: Sequence[str],
    t: Array,
    q: Array,
    at: int | None = None,
    text: str | None = None,
    **look: Any,
) -> list[Line2D]:
    """Draw paths q, (n, K) or (B, n, K), as `traces`; one entry in the legend stands for all."""
    paths = q.reshape(-1, *q.shape[-2:])
    lines = [ax.plot(x, y, **look)[0] for path in paths for x, y, _ in traces(names, t, path, at)]
    for line in lines[:1]:
        line.set_label(text)
    return lines


def coordinate_to_show(solution: Solution, coordinate: int | None) -> int | None:
    """Return the coordinate that tells neighbouring paths apart against time; None for orbits.

    Orbits do not where a constraint leaves a single curve. Raises ValueError if there is no such
    coordinate.
    """
    system = solution.problem.system
    if coordinate is None:
        return None if planar(system.coordinates) and system.degrees_of_freedom > 1 else 0
    if not 0 <= coordinate < system.n:
        raise ValueError(f"expected a coordinate from 0 to {system.n - 1}, found {coordinate}")
    return coordinate


def frame(
    ax: Axes, solution: Solution, units: UnitNames = NO_UNITS, coordinate: int | None = None
) -> None:
    """Label the axes of `traces` and mark the events."""
    problem = solution.problem
    names = problem.system.coordinates
    for at_end, text, look in (
        (problem.start, say("start"), start()),
        (problem.end, say("end"), event()),
    ):
        given = np.array([at_end.q], dtype=float).T  # NaN, not drawn, where it is free
        draw(ax, names, np.array([at_end.t]), given, coordinate, text, **look)
    if problem.through:
        bounces = all(isinstance(e, Bounce) for e in problem.joints[1:-1])
        text, t = say("reflection") if bounces else say("event"), joint_times(solution)
        draw(ax, names, t, solution(t), coordinate, text, **middle())
    if planar(names) and coordinate is None:
        plane(ax, names, units)
        return
    chosen = names if coordinate is None else [names[coordinate]]
    words = ", ".join(label(symbol(name), units.coordinate(name)) for name in chosen)
    ax.set(xlabel=label(units.clock, units.time), ylabel=words)


def joint_times(solution: Solution) -> Array:
    """Return the times of the events between the ends, (k,)."""
    return np.array([event.t for event in solution.problem.through])


def break_at_events(t: Array, values: Array, solution: Solution) -> tuple[Array, Array]:
    """Return curves (..., K) against t (K,), interrupted where they may jump: at the events."""
    inner = joint_times(solution)
    at = np.searchsorted(t, inner)
    return np.insert(t, at, inner), np.insert(values, at, np.nan, axis=-1)


def mark_events(ax: Axes, solution: Solution) -> None:
    """Draw a line at the time of each event between the ends."""
    for t in joint_times(solution):
        ax.axvline(t, color=GREY, linewidth=1.0, linestyle=(0, (1.5, 2)), zorder=1)


def plane(ax: Axes, names: Sequence[str], units: UnitNames) -> None:
    """Label the axes of orbits, lengths the same in both directions."""
    x, y = (label(f"${names[i][0]}$", units.length) for i in planar(names)[0])
    ax.set(xlabel=x, ylabel=y)
    ax.set_aspect("equal", adjustable="datalim")


def heading(of: Solution | Problem) -> str:
    """Return the problem's name in words, in the reader's language."""
    problem = of if isinstance(of, Problem) else of.problem
    return say(problem.name.replace("_", " "))


def kind(solution: Solution) -> str:
    """Return whether a solution is a minimum or a saddle, in words."""
    return say("{kind}, index {index}", kind=say(solution.kind), index=solution.morse_index)


def signed_norm(reach: float) -> Normalize:
    """Return the norm of colours `SIGNED` from -reach to reach: zero is grey, and roots are even.

    What grows as the square of a displacement is then as strong in colour as the displacement.
    """
    roots = (lambda x: np.sign(x) * np.sqrt(np.abs(x)), lambda y: y * np.abs(y))
    return FuncNorm(roots, -reach, reach)


def colour_bar(
    ax: Axes, values: Array, norm: Normalize, colours: Any, text: str, *, high: bool = False
) -> None:
    """Draw the part of a bar of colours that occurs in `values`, labelled.

    With `high` it is as high as axes of a fixed shape, which need not be as high as their place.
    """
    place: dict[str, Any] = {"cax": ax.inset_axes((1.05, 0, 0.05, 1))} if high else {"ax": ax}
    bar = ax.figure.colorbar(ScalarMappable(norm, colours), **place)
    low, top = (float(np.clip(f(values), norm.vmin, norm.vmax)) for f in (np.nanmin, np.nanmax))
    if low < top:
        bar.ax.set_ylim(low, top)
    if isinstance(norm, FuncNorm) and low < 0 < top:
        # Either side has ticks of its own, unless it is short.
        sides = [(low, 0.0), (0.0, top)]
        long = [s for s in sides if norm(s[1]) - norm(s[0]) > SHORT_BAR]
        ticks = np.unique(np.concatenate([MaxNLocator(3).tick_values(*s) for s in long]))
        bar.set_ticks(ticks[(low <= ticks) & (ticks <= top)].tolist())
    bar.set_label(text)


def colour(i: int) -> str:
    """Return the colour of the i-th of many things."""
    return COLOURS[i % len(COLOURS)]


def strand(i: int) -> dict[str, Any]:
    """Return colour and dashes of the i-th of many lines."""
    return {"color": colour(i), "linestyle": DASHES[i // len(COLOURS) % len(DASHES)]}


def set_title(ax: Axes, of: Solution | Problem, words: str) -> None:
    """Say whose picture this is, and what it shows; in a row of axes, in lines as wide as one."""
    if has_neighbours(ax):
        width = ax.get_window_extent().width * 72 / ax.figure.dpi  # type: ignore[union-attr]
        letters = max(12, int(width / (LETTER_WIDTH * rcParams["font.size"])))
        ax.set_title(words if "$" in words else fill(words, letters), fontsize="small")
    else:
        ax.set_title(f"{heading(of)}: {words}")


def has_neighbours(ax: Axes) -> bool:
    """Return whether axes stand beside others, and have no room for words to their side."""
    place = ax.get_subplotspec()
    return place is not None and place.get_gridspec().ncols > 1


def entries(ax: Axes) -> tuple[list[Any], list[str]]:
    """Return what a legend explains, each name once: axes may be drawn on again."""
    named = {text: line for line, text in zip(*ax.get_legend_handles_labels(), strict=True)}
    return list(named.values()), list(named)


def legend(ax: Axes, *, beside: bool = False) -> None:
    """Explain the lines where there is room: in the picture if they are few, else beside it."""
    lines, names = entries(ax)
    if (beside or len(names) > MOST_ENTRIES) and not has_neighbours(ax):
        ax.legend(lines, names, loc="upper left", bbox_to_anchor=(1.02, 1.0), borderaxespad=0.0)
    elif lines:
        ax.legend(lines, names)


def legend_above(ax: Axes, columns: int) -> None:
    """Explain the lines in a row above them, for which room is made; among axes where it is."""
    if has_neighbours(ax):
        return legend(ax)
    low, high = ax.transData.transform([(1, y) for y in ax.get_ylim()])[:, 1]
    top = ax.transData.inverted().transform((0, high + 0.16 * (high - low)))[1]
    ax.set_ylim(top=top)
    ax.legend(*entries(ax), loc="upper left", ncols=columns, columnspacing=1.2, handlelength=1.8)


def legend_below(ax: Axes, columns: int) -> None:
    """Explain the lines in rows below the picture, where there is no room in it."""
    if has_neighbours(ax):
        legend(ax)
    else:
        place: dict[str, Any] = {"loc": "upper center", "bbox_to_anchor": (0.5, -0.13)}
        ax.legend(*entries(ax), ncols=columns, **place)


def new_figure(
    size: tuple[float, float] = STYLE["figure.figsize"], layout: Any = "constrained"
) -> Any:
    """Return a new figure of pyplot of this size (inches), if the reader wants no other."""
    from matplotlib import pyplot  # a second of import, for interactive use only

    return pyplot.figure(figsize=figure_size(*size), layout=layout)


def on(ax: Axes | None, size: tuple[float, float] = STYLE["figure.figsize"]) -> Axes:
    """Return `ax`, or the axes of a new figure."""
    return new_figure(size).subplots() if ax is None else ax


def unpack(axes: Any, count: int) -> list[Axes]:
    """Return so many axes. Raises ValueError for another number of them."""
    found = list(np.ravel(np.array(axes, dtype=object)))
    if len(found) != count:
        raise ValueError(
            f"expected {count} axes for this figure, found {len(found)}; "
            f"`figure.subplots({count})` makes them"
        )
    return found


def freeze_layout(figure: Any) -> None:
    """Lay out a figure once, so that nothing in it shifts from frame to frame."""
    figure.draw_without_rendering()
    figure.set_layout_engine("none")
