"""The film of a motion: frames as data for the player in the page, and a small picture of it."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from actionopt.analysis.solution import Solution
from actionopt.gallery.page import escape, number, rounded
from actionopt.gallery.subject import Subject
from actionopt.plot import landscape_data, motion, motion_data, svg
from actionopt.plot._variations import level_lines
from actionopt.plot.data.relaxation import relaxation_data
from actionopt.plot.data.variations import over_modes, telling
from actionopt.tools.types import Array

FRAMES = 121
WIDE = 1.5  # of the height, for one coordinate against time
GHOSTS = 6  # times in the small picture
APART = 0.3  # between films on one clock
START = (0.12, 1.2)  # of the modes: where a path on a map begins
MAPPED = 1.5  # of the modes, to either side on their maps
LEVELS = 8  # lines of a map, on either side of the motion's
LEAST_SHAPE = 0.42  # of the longer side: a motion along a line gets some air


def film(subject: Subject) -> str:
    """Return the player of a motion."""
    data = motion_data(subject.solution, subject.scene.draw, FRAMES, force=subject.arrows).plain()
    data["t"] = [round(t, 6) for t in data["t"]]
    forces = ", with the forces of constraint as arrows" if subject.arrows else ""
    what = f"Film: {subject.scene.title}, {subject.motion}{forces}."
    return player(data, what, "Arrows are forces of constraint." if subject.arrows else "")


def relaxing(subject: Subject) -> str:
    """Return the player of a wild path that goes downhill in action, step by step.

    Raises ValueError as `relaxation_data` does.
    """
    found, solution = relaxation_data(subject.solution), subject.solution
    every = slice(None, None, 4)
    t, paths = found.t[every], [q[:, every] for q in (found.target, *found.paths)]
    if solution.problem.system.n == 1:  # against time, in a picture of a fixed shape
        low, high = np.min(paths), np.max(paths)
        across = WIDE * (t - t[0]) / (t[-1] - t[0])
        paths = [np.stack([across, (q[0] - low) / (high - low)]) for q in paths]
    rows = [np.round(q.T, 4).tolist() for q in paths]
    points = np.concatenate(paths, axis=1)
    end = "reaches the motion" if found.arrived else "runs away from it"
    shapes = [
        {"kind": "motion", "still": True, "points": rows[:1]},
        {"kind": "trial", "still": False, "points": rows[1:]},
        *({"kind": "event", "still": True, "points": [[rows[0][k]]]} for k in (0, -1)),
    ]
    data = {
        "labels": [f"S = {S:.4f} J s" for S in found.action],
        "box": [*(points[0].min(), points[0].max()), *(points[1].min(), points[1].max())],
        "shapes": shapes,
        "trails": [],
    }
    what = (
        f"Film: a wild path between the events of {subject.scene.title} goes downhill in action, "
        f"from {rounded(found.action[0])} J s to {rounded(found.action[-1])} J s in "
        f"{len(found.action) - 1} steps, and {end}, dashed."
    )
    return player(
        data,
        what,
        f"A wild path goes downhill in action, and {end} (dashed), whose action is "
        f"{number(found.target_action, 5)} J s.",
    )


def beside(*subjects: Subject) -> str:
    """Return the player of wild paths that go downhill side by side, on one clock.

    Above, the path of one coordinate against time; below, where it stands on the map of the action
    over two modes.
    """
    found = [relaxation_data(s.solution, _high_up(s.solution)) for s in subjects]
    steps = max(len(f.action) for f in found)
    shapes: list[dict[str, Any]] = []
    trails, labels = [], []
    for k, (s, f) in enumerate(zip(subjects, found, strict=True)):
        still, places = k * (WIDE + APART), np.minimum(np.arange(steps), len(f.action) - 1)
        low, high = np.min([f.target, *f.paths]), np.max([f.target, *f.paths])
        across = still + WIDE * (f.t - f.t[0]) / (f.t[-1] - f.t[0])
        up = 1 + APART / 2 + (np.stack([f.target, *f.paths])[:, 0] - low) / (high - low)
        rows = [np.round(np.stack([across, y], axis=1)[::4], 4).tolist() for y in up]
        # The map, two units of the modes to either side of the path.
        map_, half = landscape_data(s.solution, MAPPED), 0.5 / MAPPED
        middle = np.array([still + WIDE / 2, 0.5])
        dots = np.clip(over_modes(s.solution, f.t, f.paths), -MAPPED, MAPPED)
        dots = np.round(middle + half * dots, 4)
        largest = float(np.max(np.abs(map_.rise)))
        for level in largest * np.linspace(-1, 1, 2 * LEVELS + 1):
            kind = "higher" if level > 0 else "lower" if level < 0 else "level"
            for line in level_lines(map_, level * abs(level) / largest):
                points = np.round(middle + half * line, 4).tolist()
                shapes.append({"kind": kind, "still": True, "points": [points]})
        shapes += [
            {"kind": "motion", "still": True, "points": rows[:1]},
            {"kind": "trial", "still": False, "points": [rows[1 + i] for i in places]},
            *({"kind": "event", "still": True, "points": [[rows[0][i]]]} for i in (0, -1)),
            {"kind": "event", "still": True, "points": [[middle.tolist()]]},
            {"kind": "dot", "still": False, "points": [[dots[i].tolist()] for i in places]},
        ]
        trails.append(dots[places].tolist())
        labels.append([f"{s.solution.kind}: S = {f.action[i]:.3f} J s" for i in places])
    wide = len(subjects) * (WIDE + APART) - APART
    data = {
        "labels": [" \u00b7 ".join(words) for words in zip(*labels, strict=True)],
        "box": [0.0, wide, 0.0, 2 + APART / 2],
        "shapes": shapes,
        "trails": trails,
        "points": 0.6,
    }
    ends = [
        f"of the {s.solution.kind} from {rounded(f.action[0])} to {rounded(f.action[-1])} J s"
        for s, f in zip(subjects, found, strict=True)
    ]
    return player(
        data,
        f"Film: wild paths go downhill in action, {' and '.join(ends)}; below each, a dot on the "
        "map of the action over the two modes, which the one enters and the other leaves.",
        "Left the short motion, dashed, right the long one. Below each path the map of its action: "
        "vermilion lines are higher than the motion, which is the dot in the middle, blue ones "
        "lower. The two films have one clock.",
    )


def _high_up(solution: Solution) -> Callable[[Array], Array]:
    """Return a path that stands high on the map: off along the mode that rises most."""
    chosen, modes = telling(solution)
    first, second = (modes[k] for k in chosen)
    return lambda t: solution(t) + START[0] * first(t) + START[1] * second(t)


def player(data: dict[str, Any], what: str, caption: str) -> str:
    """Return a film as HTML, its frames in it as JSON."""
    data["box"] = padded(data["box"])
    text = json.dumps(data, separators=(",", ":")).replace("</", "<\\/")
    count = len(data.get("labels") or data["t"])
    words = f"\n<figcaption>{caption}</figcaption>" if caption else ""
    return f"""<figure class="film" data-film>
<svg role="img" aria-label="{escape(what)}"></svg>
<div class="controls">
<button type="button">Play</button>
<input type="range" min="0" max="{count - 1}" step="any" value="0" aria-label="Place in the film">
<span class="clock"></span>
</div>
<script type="application/json">{text}</script>
<noscript><p>Scripts are off: no films.</p></noscript>{words}
</figure>"""


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
