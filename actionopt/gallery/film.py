"""The film of a motion: frames as data for the player in the page, and a small picture of it."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any

from actionopt.gallery.page import escape
from actionopt.gallery.subject import Subject
from actionopt.plot import motion, motion_data, svg

FRAMES = 121
GHOSTS = 6  # times in the small picture
LEAST_SHAPE = 0.42  # of the longer side: a motion along a line gets some air


def film(subject: Subject) -> str:
    """Return the player of a motion: HTML, the frames in it as JSON."""
    data = motion_data(subject.solution, subject.scene.draw, FRAMES, force=subject.arrows).plain()
    data["box"] = padded(data["box"])
    data["t"] = [round(t, 6) for t in data["t"]]
    text = json.dumps(data, separators=(",", ":")).replace("</", "<\\/")
    forces = ", with the forces of constraint as arrows" if subject.arrows else ""
    caption = "<figcaption>Arrows are forces of constraint.</figcaption>" if subject.arrows else ""
    what = f"Film: {subject.scene.title}, {subject.motion}{forces}."
    return f"""<figure class="film" data-film>
<svg role="img" aria-label="{escape(what)}"></svg>
<div class="controls">
<button type="button">Play</button>
<input type="range" min="0" max="{FRAMES - 1}" step="any" value="0" aria-label="Time of the film">
<output>t = 0.00 s</output>
</div>
<script type="application/json">{text}</script>
<noscript><img src="motion.svg" alt="{escape(what)}"></noscript>
{caption}</figure>"""


def thumbnail(subject: Subject) -> str:
    """Return the motion at a few times as SVG, without words."""

    def draw(figure: Any) -> None:
        ax = figure.subplots()
        motion(subject.solution, subject.scene.draw, ax, count=GHOSTS)
        ax.set(title="", xticks=[], yticks=[], xlabel="", ylabel="")
        scales = [line for line in ax.lines if line.get_marker() == "|"]
        for words in [ax.get_legend(), *ax.texts, *scales]:
            words.remove()

    return svg(draw, (2.9, 2.1))


def padded(box: Sequence[float]) -> list[float]:
    """Return the box with a margin, and not too narrow."""
    left, right, bottom, top = box
    longer = max(right - left, top - bottom) or 1.0
    result = []
    for low, high in ((left, right), (bottom, top)):
        side = max(high - low, LEAST_SHAPE * longer) + 0.14 * longer
        middle = (low + high) / 2
        result += [middle - side / 2, middle + side / 2]
    return [round(x, 6) for x in result]
