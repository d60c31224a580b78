"""The film of a motion: frames as data for the player in the page, and a small picture of it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from actionopt.analysis.solution import Solution
from actionopt.gallery.compact import compact
from actionopt.gallery.subject import Subject
from actionopt.plot import Motion, landscape_data, motion, motion_data, svg
from actionopt.plot._variations import level_lines
from actionopt.plot.data.relaxation import relaxation_data
from actionopt.plot.data.variations import over_modes, telling
from actionopt.plot.live.drawing import FRAMES
from actionopt.plot.live.film import frames, player
from actionopt.tools.greek import letter
from actionopt.tools.types import Array
from actionopt.tools.words import number, say, together

FEWEST_OF_A_FILM = 10  # steps; ad hoc: fewer show no way down
FILM_WIDTH = 1.5  # of the height, for one coordinate against time
GHOSTS = 6  # times in the small picture
FILM_GAP = 0.3  # between films on one clock
START = (0.12, 1.2)  # of the modes: where a path on a map begins
MAPPED = 1.5  # of the modes, to either side on their maps
MAP_LINES = 8  # lines of a map, on either side of the motion's
# An arrow that shows which way a coordinate grows, in the picture's size; one of many.
ARROW, SHORT_ARROW = 0.16, 0.1
ARROW_STEP = 1e-5  # of a coordinate's size, to see which way that is
CURVES = 4  # coordinates in a graph
SMALLEST_MOVE = 1e-3  # of the picture's size: a coordinate that moves nothing by more has no arrow


def film(subject: Subject) -> str:
    """Return the player of a motion, with its coordinates and energies against the same time."""
    s = subject
    motion = motion_data(s.solution, s.scene.draw, FRAMES, force=s.arrows)
    data = {**frames(motion), "unit": s.units.time}
    data["graphs"] = [*_coordinates(s, motion.t), *_energies(s, motion.t)]
    data["labels_at_start"] = growing(s, motion)
    what = say("Film: {title}, {motion}.", title=say(s.scene.title), motion=s.motion)
    words = [
        f"{s.motion[0].upper()}{s.motion[1:]}.",
        say("At the start, arrows show which way coordinates grow."),
    ]
    if s.arrows:
        what += " " + say("Arrows are forces of constraint.")
        words.append(say("Arrows on the bodies are forces of constraint."))
    if motion.space:
        words.append(say("Drag the picture, or use the arrow keys, to turn it."))
    return player(data, what, " ".join(words), clock=bool(s.units.time))


def growing(s: Subject, motion: Motion) -> list[dict[str, Any]]:
    """Return for each coordinate where an arrow starts and ends that shows the way it grows.

    It stands at the point of the picture that the coordinate moves most, a body's if it moves one.
    """
    q, t, names = s.solution.start.q, motion.t[0], s.solution.problem.system.coordinates
    size, found = motion.size, []
    reach = (ARROW if len(names) <= CURVES else SHORT_ARROW) * size
    for k, name in enumerate(names[: 2 * CURVES]):
        h = ARROW_STEP * max(1.0, abs(float(q[k])))
        step = h * np.eye(len(names))[k]
        ahead, behind = s.scene.draw(q + step, t), s.scene.draw(q - step, t)
        points = [
            (a.kind != "body", (a.points - b.points) / (2 * h), (a.points + b.points) / 2)
            for a, b in zip(ahead, behind, strict=True)
        ]
        for bodies in (True, False):
            rows = [(d[:, j], p[:, j]) for other, d, p in points if not (bodies and other)
                    for j in range(p.shape[1])]  # fmt: skip
            way, place = max(rows, key=lambda row: float(np.linalg.norm(row[0])))
            long = float(np.linalg.norm(way))
            if long > SMALLEST_MOVE * size:
                tip = place + reach / long * way
                found.append({"name": letter(name), "from": _row(place), "to": _row(tip)})
                break
    return found


def _row(place: Array) -> list[float]:
    return [float(f"{x:.4g}") + 0.0 for x in place]


def _coordinates(s: Subject, t: Array) -> list[dict[str, Any]]:
    """Return a graph of the coordinates for each unit they have."""
    names, q = s.solution.problem.system.coordinates, s.solution(t)
    graphs = []
    for unit in dict.fromkeys(map(s.units.coordinate, names)):
        rows = [
            {"name": letter(name), "values": _thin(q[k])}
            for k, name in enumerate(names)
            if s.units.coordinate(name) == unit
        ]
        graphs.append({"unit": unit, "rows": rows[:CURVES]})
    return graphs


def _energies(s: Subject, t: Array) -> list[dict[str, Any]]:
    """Return the graph of T and V, or of L where that is no difference of the two, and S so far.

    Of L without the integrals that are given: with these, times their multipliers, S is another.
    """
    q, v, problem = s.solution(t), s.solution.velocity(t), s.solution.problem
    law = problem.plain or problem.system
    given = {name: problem.parameters[name] for name in law.parameters}
    *below, highest = s.solution.derivatives(t)[: law.order + 1]
    state = np.concatenate(below).T, highest.T, t[:, None], law.table.pack(law.table.values(given))
    L = law.pointwise("value")(*state)[0][:, 0].copy()
    far = np.diff(t) * (L[1:] + L[:-1]) / 2
    S = np.r_[0.0, np.cumsum(far)]
    S += (s.solution.action - S[-1]) * np.linspace(0, 1, t.size)  # of trapezes, which miss a little
    graph: dict[str, Any] = {"unit": s.units.energy, "sum": s.units.action}
    if s.scene.measure is None and (s.has_forces or not s.energies.moving):
        T = (
            s.scene.kinetic(q, v, t)
            if s.scene.kinetic
            else L - law.lagrangian(q, 0 * q, t, parameters=given)
        )
        graph["rows"] = [{"name": "T", "values": _thin(T)}, {"name": "V", "values": _thin(T - L)}]
    else:
        graph["rows"] = [{"name": "L", "values": _thin(L)}]
    if not s.has_forces:
        graph["area"] = _thin(S)
    return [graph]


def _thin(values: Array) -> list[float]:
    """Return values rounded to what a graph shows."""
    size = float(np.max(np.abs(values))) or 1.0
    digits = max(0, 4 - int(np.floor(np.log10(size))))
    return [x + 0.0 for x in np.round(values, digits).tolist()]


def relaxing(subject: Subject) -> str:
    """Return the player of a wild path that goes downhill in action, step by step.

    Nothing where the way is short, comes to no end, leaves what the scene's law is for, or would
    not keep integrals that are given. Raises ValueError as `relaxation_data` does.
    """
    if subject.solution.problem.integral is not None:
        return ""
    found, solution = relaxation_data(subject.solution), subject.solution
    below = subject.solution.morse_index > 0 and found.action[-1] < found.target_action
    if len(found.action) <= FEWEST_OF_A_FILM or not (found.arrived or below):
        return ""
    every, unit = slice(None, None, 4), subject.units.action
    t, paths = found.t[every], [q[:, every] for q in (found.target, *found.paths)]
    if solution.problem.system.n == 1:  # against time, in a picture of a fixed shape
        low, high = np.min(paths), np.max(paths)
        across = FILM_WIDTH * (t - t[0]) / (t[-1] - t[0])
        paths = [np.stack([across, (q[0] - low) / (high - low)]) for q in paths]
    rows = [np.round(q.T, 4).tolist() for q in paths]
    points = np.concatenate(paths, axis=1)
    shapes = [
        {"kind": "motion", "still": True, "points": rows[:1]},
        {"kind": "trial", "still": False, "points": rows[1:]},
        *({"kind": "event", "still": True, "points": [[rows[0][k]]]} for k in (0, -1)),
    ]
    data = {
        "labels": [together(f"S = {S:.4f} {unit}") for S in found.action],
        "box": [*(points[0].min(), points[0].max()), *(points[1].min(), points[1].max())],
        "shapes": shapes,
        "trails": [],
    }
    values = {
        "title": say(subject.scene.title),
        "first": number(found.action[0], 3),
        "last": number(found.action[-1], 5),
        "steps": len(found.action) - 1,
        "action": number(found.target_action, 5),
        "unit": unit,
    }
    reaches = (
        "Film: a wild path between the events of {title} goes downhill in action, from "
        "{first} {unit} to {last} {unit} in {steps} steps, and reaches the motion, dashed."
    )
    leaves = (
        "Film: a wild path between the events of {title} goes downhill in action, from "
        "{first} {unit} to {last} {unit} in {steps} steps, and runs away from the motion, dashed."
    )
    there = (
        "A wild path goes downhill in action, in {steps} steps from {first} to {last} {unit}, and "
        "reaches the motion (dashed), whose action is {action} {unit}."
    )
    away = (
        "A wild path goes downhill in action, in {steps} steps from {first} to {last} {unit}, and "
        "runs away from the motion (dashed), whose action is {action} {unit}."
    )
    film, words = (reaches, there) if found.arrived else (leaves, away)
    return player(data, say(film, **values), say(words, **values))


def beside(*subjects: Subject) -> str:
    """Return an animation of random paths that descend to motions, side by side on one clock.

    Above, the path of one coordinate against time; below, where it stands on the map of the action
    over two modes.
    """
    found = [relaxation_data(s.solution, _high_up(s.solution)) for s in subjects]
    steps = max(len(f.action) for f in found)
    shapes: list[dict[str, Any]] = []
    trails, labels = [], []
    for k, (s, f) in enumerate(zip(subjects, found, strict=True)):
        still, places = k * (FILM_WIDTH + FILM_GAP), np.minimum(np.arange(steps), len(f.action) - 1)
        low, high = np.min([f.target, *f.paths]), np.max([f.target, *f.paths])
        across = still + FILM_WIDTH * (f.t - f.t[0]) / (f.t[-1] - f.t[0])
        up = 1 + FILM_GAP / 2 + (np.stack([f.target, *f.paths])[:, 0] - low) / (high - low)
        rows = [np.round(np.stack([across, y], axis=1)[::4], 4).tolist() for y in up]
        # The map, two units of the modes to either side of the path.
        map_, half = landscape_data(s.solution, MAPPED), 0.5 / MAPPED
        middle = np.array([still + FILM_WIDTH / 2, 0.5])
        dots = np.clip(over_modes(s.solution, f.t, f.paths), -MAPPED, MAPPED)
        dots = np.round(middle + half * dots, 4)
        largest = float(np.max(np.abs(map_.rise)))
        for level in largest * np.linspace(-1, 1, 2 * MAP_LINES + 1):
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
        said = (f"{say(s.solution.kind)}: S = {f.action[i]:.3f} J s" for i in places)
        labels.append([*map(together, said)])
    wide = len(subjects) * (FILM_WIDTH + FILM_GAP) - FILM_GAP
    data = {
        "labels": [" \u00b7 ".join(words) for words in zip(*labels, strict=True)],
        "box": [0.0, wide, 0.0, 2 + FILM_GAP / 2],
        "shapes": shapes,
        "trails": trails,
        "points": 0.6,
    }
    ends = [
        say(
            "{kind}: from {first} to {last} J s",
            kind=say(s.solution.kind),
            first=number(f.action[0], 3),
            last=number(f.action[-1], 3),
        )
        for s, f in zip(subjects, found, strict=True)
    ]
    what = say(
        "Film: wild paths go downhill in action ({ends}); below each, a dot on the map of the "
        "action over the two modes, which the one enters and the other leaves.",
        ends="; ".join(ends),
    )
    caption = say(
        "Left the short motion, dashed, right the long one. Below each path the map of its action: "
        "vermilion lines are higher than the motion, which is the dot in the middle, blue ones "
        "lower. The two films have one clock."
    )
    return player(data, what, caption)


def _high_up(solution: Solution) -> Callable[[Array], Array]:
    """Return a path that stands high on the map: off along the mode that rises most."""
    chosen, modes = telling(solution)
    first, second = (modes[k] for k in chosen)
    return lambda t: solution(t) + START[0] * first(t) + START[1] * second(t)


def thumbnail(subject: Subject) -> str:
    """Return the motion at a few times as SVG, without words."""

    def draw(figure: Any) -> None:
        ax = figure.subplots()
        motion(subject.solution, subject.scene.draw, ax, count=GHOSTS)
        ax.set(title="", xticks=[], yticks=[], xlabel="", ylabel="")
        scales = [line for line in ax.lines if line.get_marker() == "|"]
        for words in [ax.get_legend(), *ax.texts, *scales]:
            words.remove()

    return compact(svg(draw, (2.9, 2.1)))
