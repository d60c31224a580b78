"""Pictures as files, and as SVG for pages: the same picture the same text."""

from __future__ import annotations

import re
from collections.abc import Callable
from io import StringIO
from pathlib import Path
from typing import Any

from matplotlib.backend_bases import FigureCanvasBase
from matplotlib.figure import Figure

from actionopt.analysis.solution import Solution
from actionopt.families.runs import Runs
from actionopt.plot._paths import overview, paths
from actionopt.plot._runs import runs
from actionopt.plot._style import styled
from actionopt.tools.files import ready, whole

LINES = re.compile(r' d="[^"]*"')
DIGITS = re.compile(r"(\.\d\d)\d+")  # beyond a hundredth of a point


@styled
def svg(draw: Callable[[Figure], Any], size: tuple[float, float] = (6.4, 4.4)) -> str:
    """Return what `draw` puts on an empty figure of this `size` (inches), no background, as SVG."""
    figure = Figure(size, layout="constrained")  # not pyplot's: it needs no display
    draw(figure)
    text = StringIO()
    figure.savefig(text, format="svg", transparent=True, metadata={"Date": None})
    return LINES.sub(lambda line: DIGITS.sub(r"\1", line[0]), text.getvalue())


@styled
def save(solution: Solution, file: str | Path, *, compare: bool = True) -> None:
    """Write `overview`, or `paths` alone if `compare` is False, to a picture file.

    Raises ValueError for an ending that matplotlib does not know, OSError if it cannot write.
    """
    picture(file)
    figure = Figure((6.4, 6.4), layout="constrained")
    if compare:
        overview(solution, figure.subplots(2, height_ratios=(3, 2)))
    else:
        paths(solution, figure.subplots(), compare=False)
    with whole(file) as part:
        figure.savefig(part)


@styled
def save_runs(found: Runs, file: str | Path, quantity: str = "action") -> None:
    """Write the picture of a sweep, `runs`, to a file. Raises as `save` and `runs` do."""
    picture(file)
    figure = Figure((7.6, 4.8), layout="constrained")
    runs(found, quantity, figure.subplots())
    with whole(file) as part:
        figure.savefig(part)


def picture(file: str | Path) -> Path:
    """Return where a picture goes. Raises as `save`, and before anything is drawn."""
    endings = sorted(FigureCanvasBase.get_supported_filetypes())
    return ready(file, *(f".{ending}" for ending in endings))
