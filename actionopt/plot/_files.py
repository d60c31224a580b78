"""Pictures as files, and as SVG for pages: the same picture the same text."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Sequence
from io import StringIO
from pathlib import Path
from textwrap import fill
from typing import Any

import numpy as np
from matplotlib import rcParams
from matplotlib.backend_bases import FigureCanvasBase
from matplotlib.backends.backend_mixed import MixedModeRenderer
from matplotlib.backends.backend_svg import RendererSVG
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.textpath import text_to_path

from actionopt.analysis.solution import Solution, question
from actionopt.families.sweeps.runs import Runs
from actionopt.plot._paths import overview, paths
from actionopt.plot._runs import runs
from actionopt.plot._style import IF_ROOM, figure_size, styled
from actionopt.plot.data.arguments import check_arguments
from actionopt.tools.checks import numbers
from actionopt.tools.files import ready, whole
from actionopt.tools.words import numerals, together

LINES = re.compile(r' d="[^"]*"')
UNBROKEN = re.compile(r"\$[^$]*\$|\s\([^()]{1,8}\)")  # mathematics; a unit after its quantity
SPARE = 0.75  # of the width: what is left beside labels, ad hoc
# letters of a legend's entry that leaves room for another, and of a line
SHORT_ENTRY, LONG_LINE = 16, 40
FULL_WIDTH = 5.0  # inches: what explains the lines stands below a narrower picture
LINE_HEIGHT = 0.18  # inches of one
LETTER = 0.58  # measured: width of one, in parts of its size
LAYOUTS, EDGE = 4, 0.02  # at most; inches over the edge that are not seen
SIMPLIFIED = 0.25  # points: what a line may be off for fewer of them
LONG_DECIMALS = re.compile(r"(\.\d\d)\d+")  # beyond a hundredth of a point


def svg(draw: Callable[[Figure], Any], size: tuple[float, float] = (6.4, 4.4)) -> str:
    """Return what `draw` puts on an empty figure of this `size` (inches), no background, as SVG."""
    return svgs(draw, size)[0]


@styled
def svgs(draw: Callable[[Figure], Any], *sizes: tuple[float, float]) -> list[str]:
    """Return the same drawing as SVG at several sizes, words of the same size in each.

    What is wider than a picture, titles and legends, is broken into lines.
    """
    for size in sizes:
        if not (numbers(size, "a size (width, height)").shape == (2,) and min(size) > 0):
            raise ValueError(f"expected a size (width, height) in inches, found {size!r}")
    if not callable(draw) or not sizes:
        raise ValueError(
            f"expected svgs(draw, size, ...), draw a callable, found {draw!r}, {sizes}"
        )
    rcParams["path.simplify_threshold"] = SIMPLIFIED
    figure, found = Figure(sizes[0], layout="constrained"), []  # not pyplot's: it needs no display
    draw(figure)
    if not figure.axes:
        raise ValueError("expected draw(figure) to put axes on the figure, found none on it")
    for size in sizes:
        figure.set_size_inches(size)
        if size[0] < FULL_WIDTH:
            _break_lines(figure)
        found.append(LINES.sub(lambda line: LONG_DECIMALS.sub(r"\1", line[0]), _svg_of(figure)))
    return found


class _Renderer(RendererSVG):
    """One that writes numbers as the reader's language has them."""

    def draw_text(self, gc: Any, x: Any, y: Any, s: str, *rest: Any, **more: Any) -> None:
        super().draw_text(gc, x, y, numerals(s), *rest, **more)


def _svg_of(figure: Figure) -> str:
    """Return a figure as SVG, laid out once: `savefig` draws everything twice.

    One renderer lays it out and draws it, so that each word is measured once; formulas are parsed
    once for all cuts.
    """
    figure.dpi = 72  # as in the file
    text, (width, height) = StringIO(), figure.get_size_inches()
    renderer: Any = _Renderer(72 * width, 72 * height, text, metadata={"Date": None})
    renderer._text2path = text_to_path
    figure._get_renderer = lambda: renderer  # type: ignore[attr-defined]
    engine = figure.get_layout_engine()
    assert isinstance(engine, ConstrainedLayoutEngine)
    room = np.array([0.0, 0.0, width, height])
    for _ in range(LAYOUTS):  # smaller axes have other ticks, which may need more room
        engine.set(rect=tuple(np.r_[room[:2], room[2:] - room[:2]] / np.array(2 * [width, height])))
        engine.execute(figure)
        over = np.array(figure.get_tightbbox(renderer).extents) - (0, 0, width, height)
        over *= (-1, -1, 1, 1)
        if over.max() < EDGE:
            break
        room -= np.maximum(over, 0.0) * (-1, -1, 1, 1)
    figure.patch.set_alpha(0)
    for ax in figure.axes:
        for one in (ax, *ax.child_axes):
            _sparse(one)
        ax.patch.set_alpha(0)
    figure.set_layout_engine("none")
    mixed: Any = MixedModeRenderer(
        figure, width, height, figure.dpi, renderer
    )  # bars of colours: images
    figure.draw(mixed)
    mixed.finalize()
    figure.set_layout_engine(engine)
    return text.getvalue()


def _break_lines(figure: Figure) -> None:
    """Break the words of a figure into lines that are no longer than it is wide.

    What explains the lines stands below the picture, which grows by as much.
    """
    width, height = figure.get_size_inches()
    named: dict[str, Any] = {}
    barred = any(ax.get_label() == "<colorbar>" or ax.child_axes for ax in figure.axes)
    spare = SPARE * 72 * width * (SPARE if barred else 1)
    for ax in figure.axes:
        for words in (ax.title, ax._left_title, ax._right_title):  # type: ignore[attr-defined]
            _wrap(words, spare)
        _wrap(ax.xaxis.label, SPARE * spare)
        _wrap(ax.yaxis.label, SPARE * 72 * ax.get_position().height * height)
        legend = ax.get_legend()
        if legend is not None:
            texts = [words.get_text() for words in legend.get_texts()]
            texts = [fill(text, LONG_LINE) if "$" not in text else text for text in texts]
            named |= dict(zip(texts, legend.legend_handles, strict=True))
            legend.remove()
    if not named:
        return
    columns = 2 if max(map(len, named)) < SHORT_ENTRY else 1
    figure.legend(
        list(named.values()), list(named), loc="outside lower left", ncols=columns, frameon=False
    )
    lines = sum(1 + text.count("\n") for text in named) / columns
    figure.set_size_inches(width, height + LINE_HEIGHT * (lines + 1))


def _sparse(ax: Any) -> None:
    """Leave out words that would touch one another, or an upright line, and can be done without.

    These are marked; numbers along the axis are such words too.
    """
    upright = (line for line in ax.lines if np.unique(line.get_xdata()).size == 1)
    lines = [line.get_window_extent().x0 for line in upright]
    _hide_overlaps((words for words in ax.texts if words.get_label() == IF_ROOM), lines)
    _hide_overlaps(ax.get_xticklabels(), ())
    # Zero is the last of a column to go.
    column = sorted(ax.get_yticklabels(), key=lambda words: abs(words.get_position()[1]))
    _hide_overlaps(column, (), up=True)


def _hide_overlaps(row: Iterable[Any], lines: Sequence[float], *, up: bool = False) -> None:
    """Hide words of a row, or of a column, that touch those before, or a line."""
    taken: list[tuple[float, float]] = []
    for words in row:
        words.set_visible(True)  # what is not seen has no extent
        box = words.get_window_extent()
        low, high = (box.y0, box.y1) if up else (box.x0, box.x1)
        touched = any(a <= high and low <= b for a, b in taken)
        free = not touched and not any(low < x < high for x in lines)
        words.set_visible(free)
        if free:
            taken.append((low, high))


def _wrap(words: Any, width: float) -> None:
    letters = int(width / (LETTER * words.get_fontsize()))
    whole = UNBROKEN.sub(lambda m: m[0].replace(" ", "\xa0"), together(words.get_text()))
    words.set_text(fill(whole, letters, break_long_words=False).replace("\xa0", " "))


@styled
@check_arguments
def save(
    solution: Solution, file: str | Path, *, compare: bool = True, dpi: float | None = None
) -> None:
    """Write `overview`, or `paths` alone if `compare` is False, to a picture file.

    Its size is matplotlib's `rcParams["figure.figsize"]` if you have set that, else one that goes
    with your `font.size`; `dpi` (dots an inch) is `savefig.dpi`, or 150 if you have not set it.

    Raises ValueError for what is no solution or an ending that matplotlib does not know, OSError
    if it cannot write. Maps of a sweep are written by `save_runs`.
    """
    question(solution)
    picture(file)
    figure = Figure(figure_size(6.4, 6.4), layout="constrained")
    if compare:
        overview(solution, figure.subplots(2, height_ratios=(3, 2)))
    else:
        paths(solution, figure.subplots(), compare=False)
    with whole(file) as part:
        figure.savefig(part, dpi=dpi)


@styled
@check_arguments
def save_runs(
    found: Runs, file: str | Path, quantity: str = "action", *, dpi: float | None = None
) -> None:
    """Write the picture of a sweep, `runs`, to a file; size, dpi and what it raises as `save`'s."""
    picture(file)
    figure = Figure(figure_size(7.6, 4.8), layout="constrained")
    runs(found, quantity, figure.subplots())
    with whole(file) as part:
        figure.savefig(part, dpi=dpi)


def picture(file: str | Path) -> Path:
    """Return where a picture goes. Raises as `save`, and before anything is drawn."""
    endings = sorted(FigureCanvasBase.get_supported_filetypes())
    return ready(file, *(f".{ending}" for ending in endings))
