"""The player of a film in a page: frames as data, and a small picture of the first of them."""

from __future__ import annotations

import json
from collections.abc import Sequence
from html import escape
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from actionopt.plot.data.motion import SPRING_BREADTH, SPRING_TURNS, Motion
from actionopt.tools.document import document
from actionopt.tools.texts import read
from actionopt.tools.types import Array
from actionopt.tools.words import say

STATIC = Path(__file__).parent / "static"
RISE = 0.36  # radians that space is seen from above, the sine about that of `scenes.project`
BOX_MARGIN = 0.14  # of the longer side, ad hoc
LEAST_SHAPE = 0.42  # of the longer side: a motion along a line gets some air
NAME, NAMED = 0.045, 1.45  # of the size, from an arrow's tip to its name; of the arrow, to its end
LARGEST_FILM = 1e4  # of one unit: browsers know no type above 10,000, nor names in it
LIMB_POINTS = np.linspace(0, 1, 9)[:, None]


def player(data: dict[str, Any], what: str, caption: str, *, clock: bool = False) -> str:
    """Return a film as HTML: its frames as JSON, and the first as a picture for who has no scripts.

    With `clock` it has the motion's own time: speeds, steps and the whole screen.
    """
    data["box"] = padded(_holding(data))
    text = json.dumps(data, separators=(",", ":")).replace("</", "<\\/")
    count = len(data.get("labels") or data["t"])
    words = f"\n<figcaption>{caption}</figcaption>" if caption else ""
    said = {key: say(word) for key, word in CONTROL_WORDS.items()}
    graphs = "".join('<svg class="graph" aria-hidden="true"></svg>' for _ in data.get("graphs", []))
    speeds = "".join(
        f'<option value="{x}"{" selected" if x == "fit" else ""}>{say(name)}</option>'
        for x, name in SPEEDS.items()
    )
    steps = (
        f'<button type="button" class="step" data-step="-1" aria-label="{say("A step back")}">'
        "&#x2212;</button>"
        f'<button type="button" class="step" data-step="1" aria-label="{say("A step on")}">+'
        "</button>"
    )
    more = (
        f'<label class="speed">{say("Speed")} <select>{speeds}</select></label>'
        f'<button type="button" data-full>{say("Full screen")}</button>'
    )
    turned = f' tabindex="0" aria-label="{escape(what)}" data-turn' if data.get("space") else ""
    return f"""<figure class="film" data-film data-words="{escape(json.dumps(said))}">
<svg role="img" class="stage" aria-label="{escape(what)}" viewBox="{viewbox(data["box"])}"{turned}>
{first(data)}</svg>
{f'<div class="graphs">{graphs}</div>' if graphs else ""}
<div class="controls">
<button type="button" data-play>{said["play"]}</button>{steps if clock else ""}
<input type="range" min="0" max="{count - 1}" step="any" value="0"
aria-label="{say("Place in the film")}">
<span class="clock"></span>{more if clock else ""}
</div>
<script type="application/json">{text}</script>
<noscript><p>{say("Scripts are off: the picture is the first of the film.")}</p></noscript>{words}
</figure>"""


CONTROL_WORDS = {
    "play": "Play",
    "pause": "Pause",
    "slower": "{x} times slower than life",
    "faster": "{x} times faster than life",
    "life": "as fast as life",
    "so_far": "S so far",
}
SPEEDS = {
    "fit": "5 s long",
    "0.1": "a tenth of life",
    "0.25": "a quarter of life",
    "0.5": "half of life",
    "1": "as in life",
    "2": "twice life",
}


def film_page(motion: Motion, title: str, time: str) -> str:
    """Return a page of one file with the player of a motion, times in the unit `time`."""
    style, script = (read(STATIC / name) for name in ("style.css", "film.js"))
    body = f"""<main><h1>{escape(title)}</h1>
{player({**frames(motion), "unit": time}, title, "", clock=bool(time))}
</main>
<script>
{script}</script>"""
    return document(title, f"<style>\n{style}</style>\n", body)


def frames(motion: Motion) -> dict[str, Any]:
    """Return the frames of a motion as the player takes them, turned about its middle in space."""
    data = motion.plain()
    data["t"] = [round(t, 6) for t in data["t"]]
    if motion.space:
        points = np.concatenate([np.moveaxis(p, 1, 0).reshape(3, -1) for p in motion.points], 1)
        middle = (points.min(axis=1) + points.max(axis=1)) / 2
        radius = float(np.max(np.linalg.norm(points - middle[:, None], axis=0)))
        data["space"] = {"middle": middle.round(6).tolist(), "rise": RISE}
        data["box"] = [-radius, radius, -radius, radius]
    return data


def viewbox(box: Sequence[float]) -> str:
    """Return a box as SVG has it, y down."""
    left, right, bottom, top = box
    return f"{left:g} {-top:g} {right - left:g} {top - bottom:g}"


def first(data: dict[str, Any]) -> str:
    """Return the first frame as SVG, each coordinate with an arrow the way it grows."""
    left, right, bottom, top = data["box"]
    size = max(right - left, top - bottom)
    space = data.get("space")

    def on_screen(point: Sequence[float]) -> tuple[float, float]:
        x, y = _project(point, space)
        return x, -y

    def line(points: Sequence[Sequence[float]], look: str) -> str:
        text = " ".join(f"{x:.5g},{y:.5g}" for x, y in map(on_screen, points))
        return f'<polyline class="{look}" points="{text}"/>'

    parts = [line(trail, "path") for trail in data["trails"]]
    bodies = 0
    for shape in data["shapes"]:
        kind, points = shape["kind"], shape["points"][0]
        look = kind
        if kind == "body":
            look, bodies = f"body b{bodies % 5}", bodies + 1
        if len(points) == 1:
            (x, y), r = on_screen(points[0]), {"body": 0.022, "event": 0.014}.get(kind, 0.01) * size
            parts.append(f'<circle class="{look}" cx="{x:.5g}" cy="{y:.5g}" r="{r:.4g}"/>')
        elif kind == "spring" and not space:
            parts.append(line(zigzag(points, SPRING_BREADTH * size), look))
        else:
            parts.append(line(points, look))
    labels = data.get("labels_at_start", [])
    arrows = [np.array([on_screen(label["from"]), on_screen(label["to"])]) for label in labels]
    lines = [np.array([*map(on_screen, shape["points"][0])]) for shape in data["shapes"]]
    taken = (
        np.concatenate([_between(line) for line in [*lines, *arrows]])
        if labels
        else np.empty((0, 2))
    )
    for label, ((x, y), (u, v)) in zip(labels, arrows, strict=True):
        long = float(np.hypot(u - x, v - y)) or 1.0
        h, (c, s) = min(0.03 * size, long / 2), ((u - x) / long, (v - y) / long)
        barbs = [(u - h * c + k * h * s / 2, v - h * s - k * h * c / 2) for k in (1, -1)]
        tips = "L".join(f"{a:.5g},{b:.5g}" for a, b in (barbs[0], (u, v), barbs[1]))
        parts.append(f'<path class="grows" d="M{x:.5g},{y:.5g}L{u:.5g},{v:.5g}M{tips}"/>')
        # Its name stands beyond the tip, or beside it where something else is.
        places = [(u + NAME * size * a, v + NAME * size * b) for a, b in ((c, s), (-s, c), (s, -c))]
        rooms = [np.min(np.hypot(*(taken - place).T)) for place in places]
        place = np.array(places[0 if rooms[0] > 0.9 * NAME * size else int(np.argmax(rooms))])
        taken = np.vstack([taken, place])
        unit = max(size / LARGEST_FILM, 1.0)
        x, y = place / unit
        scale = f' transform="scale({unit:.6g})"' if unit > 1 else ""
        parts.append(
            f'<text class="name" x="{x:.5g}" y="{y:.5g}" font-size="{0.055 * size / unit:.4g}"'
            f"{scale}>{label['name']}</text>"
        )
    return "".join(parts)


def _between(points: Array) -> Array:
    """Return the points of a line, some of them between the given ones, (K, 2)."""
    if len(points) == 1:
        return points
    return np.concatenate([a + LIMB_POINTS * (b - a) for a, b in pairwise(points)])


def _project(point: Sequence[float], space: dict[str, Any] | None) -> tuple[float, float]:
    """Return where a point is in the first picture, y up."""
    if not space:
        return point[0], point[1]
    x, y, z = np.subtract(point, space["middle"])
    return float(x), float(z * np.cos(RISE) + y * np.sin(RISE))


def _holding(data: dict[str, Any]) -> Sequence[float]:
    """Return the box of a film, larger if the name of an arrow is outside."""
    labels = data.get("labels_at_start", [])
    if not labels:
        return data["box"]
    tails, tips = (
        np.array([_project(label[end], data.get("space")) for label in labels])
        for end in ("from", "to")
    )
    x, y = (tails + NAMED * (tips - tails)).T
    left, right, bottom, top = data["box"]
    return min(left, *x), max(right, *x), min(bottom, *y), max(top, *y)


def zigzag(ends: Sequence[Sequence[float]], width: float) -> list[list[float]]:
    """Return the points of a spring between two."""
    (x, y), (u, v) = ends
    side = width / (float(np.hypot(u - x, v - y)) or 1.0)
    rows = [[x, y]]
    for k in range(2 * SPRING_TURNS):
        along, way = 0.1 + 0.8 * (k + 0.5) / (2 * SPRING_TURNS), side * (-1) ** k
        rows.append([x + along * (u - x) + way * (y - v), y + along * (v - y) + way * (u - x)])
    return [*rows, [u, v]]


def padded(box: Sequence[float]) -> list[float]:
    """Return the box with a margin, and not too narrow."""
    left, right, bottom, top = box
    longer = max(right - left, top - bottom) or 1.0
    result = []
    for low, high in ((left, right), (bottom, top)):
        side = max(high - low, LEAST_SHAPE * longer) + BOX_MARGIN * longer
        middle = (low + high) / 2
        result += [middle - side / 2, middle + side / 2]
    return [round(x, 6) for x in result]
