"""The film of a motion: frames as data for the player in the page, and one picture of all of it."""

from __future__ import annotations

import json
from collections.abc import Sequence
from contextlib import suppress
from typing import Any

from actionopt.gallery.page import escape
from actionopt.gallery.subject import Subject
from actionopt.plot import Motion, motion_data

FRAMES = 121
GHOSTS = 7  # places shown in the picture
BODIES = ("#0072B2", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")
LEAST_SHAPE = 0.42  # of the longer side: a motion along a line gets some air


def film(subject: Subject) -> str:
    """Return the player of a motion: HTML, the frames in it as JSON."""
    data = _motion(subject, FRAMES).plain()
    data["box"] = padded(data["box"])
    data["t"] = [round(t, 6) for t in data["t"]]
    text = json.dumps(data, separators=(",", ":")).replace("</", "<\\/")
    forces = ", with the forces of constraint as arrows" if "arrows" in data else ""
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
</figure>"""


def _motion(subject: Subject, count: int) -> Motion:
    """Return the motion, with the forces of constraint where the picture can show them."""
    solution, draw = subject.solution, subject.scene.draw
    if solution.problem.system.m:
        with suppress(ValueError):
            return motion_data(solution, draw, count, force=True)
    return motion_data(solution, draw, count)


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


def thumbnail(subject: Subject) -> str:
    """Return the motion in one picture, as SVG: trails, and the shapes at a few times."""
    data = motion_data(subject.solution, subject.scene.draw, GHOSTS).plain()
    left, right, bottom, top = padded(data["box"])
    width, height = right - left, top - bottom
    size = max(width, height)
    drawn = [_line(trail, f"t c{b % len(BODIES)}") for b, trail in enumerate(data["trails"])]
    for k in range(GHOSTS):
        shapes, body = [], 0
        for shape in data["shapes"]:
            if k == 0 or not shape["still"]:
                points = shape["points"][0 if shape["still"] else k]
                shapes.append(_shape(shape["kind"], points, size, body))
            body += shape["kind"] == "body"
        opacity = 1.0 if k == GHOSTS - 1 else 0.2 + 0.35 * k / GHOSTS
        drawn.append(f'<g opacity="{opacity:.2f}">{"".join(shapes)}</g>')
    stroke = 0.008 * size
    style = (
        "polyline{fill:none;stroke-linecap:round;stroke-linejoin:round}"
        f".t{{stroke-width:{stroke:.4g};opacity:.5}}"
        f".r{{stroke:#333;stroke-width:{1.6 * stroke:.4g}}}"
        f".s{{stroke:#555;stroke-width:{stroke:.4g}}}"
        f".g{{stroke:#8a8a8a;stroke-width:{stroke:.4g}}}.p{{fill:#8a8a8a}}"
        + "".join(f".c{b}{{stroke:{hue}}}.b{b}{{fill:{hue}}}" for b, hue in enumerate(BODIES))
    )
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="{left:.6g} {-top:.6g} {width:.6g} '
        f'{height:.6g}"><style>{style}</style>{"".join(drawn)}</svg>\n'
    )


def _shape(kind: str, points: Any, size: float, body: int) -> str:
    if kind == "body":
        return _dot(points[0], 0.022 * size, f"b{body % len(BODIES)}")
    if kind == "ground" and len(points) == 1:
        return _dot(points[0], 0.01 * size, "p")
    if kind == "spring":
        points = zigzag(points[0], points[1], 0.03 * size)
    return _line(points, kind[0])


def zigzag(a: Sequence[float], b: Sequence[float], width: float, turns: int = 9) -> list[Any]:
    """Return the points of a spring drawn from a to b."""
    (x, y), dx, dy = a, b[0] - a[0], b[1] - a[1]
    length = (dx * dx + dy * dy) ** 0.5 or 1.0
    rows = [a]
    for k in range(2 * turns):
        along, side = 0.1 + 0.8 * (k + 0.5) / (2 * turns), (-1) ** k * width / length
        rows.append([x + along * dx - side * dy, y + along * dy + side * dx])
    return [*rows, b]


def _line(points: Any, look: str) -> str:
    row = " ".join(f"{x:.5g},{-y:.5g}" for x, y in points)
    return f'<polyline class="{look}" points="{row}"/>'


def _dot(point: Sequence[float], radius: float, look: str) -> str:
    return f'<circle class="{look}" cx="{point[0]:.5g}" cy="{-point[1]:.5g}" r="{radius:.4g}"/>'
