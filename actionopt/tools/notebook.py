"""What a notebook shows of an object: a table, and curves as a small picture."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from html import escape

import numpy as np

from actionopt.tools.types import Array

PICTURE_WIDTH, PICTURE_HEIGHT, PICTURE_MARGIN = 320, 180, 12  # pixels of a picture
PALETTE = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#BD8200", "#2E93CC")


def table(caption: str, rows: Iterable[Sequence[str]]) -> str:
    """Return a table of plain text, the first of each row its heading."""
    body = "".join(
        f'<tr><th scope="row" style="text-align:left">{escape(first)}</th>'
        + "".join(f'<td style="text-align:left">{escape(cell)}</td>' for cell in cells)
        + "</tr>"
        for first, *cells in rows
    )
    return f"<table><caption>{escape(caption)}</caption><tbody>{body}</tbody></table>"


def picture(t: Array, curves: Sequence[tuple[str, Array]]) -> str:
    """Return curves (K,) over t as SVG, each in units of its own range, with their names."""
    parts = []
    across = PICTURE_MARGIN + (PICTURE_WIDTH - 2 * PICTURE_MARGIN) * (t - t[0]) / (
        (t[-1] - t[0]) or 1.0
    )
    for k, (name, values) in enumerate(curves):
        low, high = float(np.min(values)), float(np.max(values))
        share = (values - low) / (high - low) if high > low else np.full(t.size, 0.5)
        down = PICTURE_HEIGHT - PICTURE_MARGIN - (PICTURE_HEIGHT - 3 * PICTURE_MARGIN) * share
        points = " ".join(f"{x:.1f},{y:.1f}" for x, y in zip(across, down, strict=True))
        colour = PALETTE[k % len(PALETTE)]
        said = f"{escape(name)}: {low:.4g} ... {high:.4g}"
        parts.append(
            f'<polyline fill="none" stroke="{colour}" stroke-width="2" points="{points}">'
            f"<title>{said}</title></polyline>"
            f'<text x="{PICTURE_MARGIN + 60 * k}" y="14" fill="{colour}" font-size="12">'
            f"{escape(name)}</text>"
        )
    return (
        f'<svg role="img" width="{PICTURE_WIDTH}" height="{PICTURE_HEIGHT}" '
        f'viewBox="0 0 {PICTURE_WIDTH} {PICTURE_HEIGHT}">'
        f"<title>{escape(', '.join(name for name, _ in curves))}</title>{''.join(parts)}</svg>"
    )
