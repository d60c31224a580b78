"""Pictures as text, for pages: SVG without a background, the same picture the same text."""

from __future__ import annotations

import re
from collections.abc import Callable
from io import StringIO
from typing import Any

from matplotlib.figure import Figure

from actionopt.plot._style import styled

LINES = re.compile(r' d="[^"]*"')
DIGITS = re.compile(r"(\.\d\d)\d+")  # beyond a hundredth of a point


def svg(draw: Callable[[Figure], Any], size: tuple[float, float] = (6.4, 4.4)) -> str:
    """Return what `draw` puts on an empty figure of this `size` (inches) as SVG."""
    with styled():
        figure = Figure(size, layout="constrained")  # not pyplot's: it needs no display
        draw(figure)
        text = StringIO()
        figure.savefig(text, format="svg", transparent=True, metadata={"Date": None})
    return LINES.sub(lambda line: DIGITS.sub(r"\1", line[0]), text.getvalue())
