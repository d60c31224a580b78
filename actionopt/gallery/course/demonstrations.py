"""Figures of lessons: what each says, and what the package computes for it.

What is seen stands in `lesson_figures.js`, and what is true of every figure in `lesson.js`.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from typing import Any

import numpy as np

from actionopt import scenes
from actionopt.analysis.solution import Solution
from actionopt.gallery.page import escape
from actionopt.mechanics.question.events import Event
from actionopt.mechanics.question.problem import Problem
from actionopt.mechanics.system import System
from actionopt.plot.live.law import law
from actionopt.solver.solve import solve
from actionopt.tools.lobatto import lgl
from actionopt.tools.types import Array
from actionopt.tools.words import say

FIGURE_SCRIPTS = ("lesson_figures.js", "lesson.js")
RAMP_SHARE = 0.12  # of a duration: each of the two steps from the ends to the shifted path
DEGREE = 24  # of the rule by which a page sums S over a segment: to round-off for smooth paths
ROD, LENGTHS, ROD_TIME = 1.0, 0.04 * np.arange(-13, 14), 0.9  # m, m beside it, s
ANGLES = (-1.2, 0.9)  # rad, of a pendulum at its start and its end
ROD_TIMES = 41  # at which its pull is shown


@dataclass(frozen=True)
class Demonstration:
    """What a figure says, by the keys that its script knows, and the numbers that it needs."""

    words: Mapping[str, str]
    data: Callable[[], dict[str, Any]]

    def html(self, name: str) -> str:
        """Return the figure; it needs `plot.live`'s scripts, `FIGURE_SCRIPTS`, and the style."""
        words = {key: say(text) for key, text in self.words.items()}
        words["restart"] = say("Start over")
        text = json.dumps({**self.data(), "words": words}, separators=(",", ":"))
        text = text.replace("</", "<\\/")
        return f"""<figure class="live lesson-figure" data-figure="{escape(name)}">
<script type="application/json">{text}</script>
<noscript><p>{say("Scripts are off: nothing can be moved here.")}</p></noscript>
</figure>"""


def _law_and_numbers(system: System) -> dict[str, Any]:
    """Return a law and the numbers of its parameters."""
    numbers = [float(x) for value in system.table.values().values() for x in np.ravel(value)]
    return {"law": law(system), "p": numbers}


def _rows(solution: Solution, first: float, last: float) -> dict[str, Any]:
    """Return times, weights, places and velocities by which a page sums S between two times."""
    rule, half = lgl(DEGREE), (last - first) / 2
    t = (first + last) / 2 + half * rule.nodes
    numbers = {"t": t, "w": half * rule.weights}
    curves = {"q": solution(t).T, "v": solution.velocity(t).T}
    return {key: _short(values) for key, values in {**numbers, **curves}.items()}


def _short(values: Array) -> list[Any]:
    """Return numbers as the page needs them: without the digits of round-off."""
    return np.round(values, 14).tolist()


def _unit_rule() -> dict[str, Any]:
    """Return a rule for the interval from 0 to 1."""
    rule = lgl(DEGREE)
    return {"nodes": ((1 + rule.nodes) / 2).tolist(), "weights": (rule.weights / 2).tolist()}


def noether() -> dict[str, Any]:
    """Return a ball, a planet and a particle in a groove, each with its motion in three pieces."""
    views = {
        # scene: first coordinate shifts by 1, share of the other that is a symmetry, e, c, axes
        "ball": ("projectile", True, 0.0, 0.4, 0.5, ("x (m)", "y (m)"), ("p_x", "p_y")),
        "planet": ("kepler_polar", False, 0.0, 0.5, 0.3, ("x (m)", "y (m)"), ("p_r", "p_\u03c6")),
        "screw": ("screw", False, 1.5, 0.3, 0.5, ("\u03c6 (rad)", "z (m)"), ("p_\u03c6", "p_z")),
    }
    found = {}
    for name, (scene_name, first, flat, e, c, axes, momenta) in views.items():
        scene = scenes.get(scene_name)
        solution = solve(scene.problem, tol=1e-11, guess=scene.guess)
        start, T = scene.problem.start.t, scene.problem.duration
        cuts = start + T * np.array([0, RAMP_SHARE, 1 - RAMP_SHARE, 1])
        segments = [_rows(solution, *ends) for ends in pairwise(cuts)]
        q = solution(start + T * np.linspace(0, 1, 61))
        low, high = q.min(axis=1), q.max(axis=1)
        view = [low.tolist(), high.tolist()]
        if name == "planet":  # corners of the plane, in polar coordinates
            r = high[0]
            view = [[r * 2**0.5, np.pi / 4], [r * 2**0.5, -3 * np.pi / 4]]
        else:
            around = 2 * e + 0.2
            view = [[x - around for x in low], [x + around for x in high]]
        a, b = momenta if first else momenta[::-1]
        rule = "{0} \u2192 {0} + \u03b5, {1} \u2192 {1} + c \u03b5".format(a[2:], b[2:])
        found[name] = {
            **_law_and_numbers(scene.problem.system), "segments": segments,
            "T": T, "step": RAMP_SHARE * T,
            "first": first, "flat": flat, "e": e, "c": c, "view": view, "polar": name == "planet",
            "axes": axes, "rule": rule, "names": [*momenta, f"{a} + c {b}"],
            "grooves": 1.5 if name == "screw" else 0,
        }  # fmt: skip
    return {"systems": found}


def gauge() -> dict[str, Any]:
    """Return a ball thrown straight up, with four expressions beside its Lagrangian."""
    added = {
        "linear": lambda q, v, t: v[0],
        "square": lambda q, v, t: 2 * q[0] * v[0] / 2,
        "clock": lambda q, v, t: q[0] + t * v[0],
        "none": lambda q, v, t: q[0],
    }

    def lagrangian(term: Any, q: Any, v: Any, t: Any, *, c: Any) -> Any:
        return v[0] ** 2 / 2 - 9.81 * q[0] + c * term(q, v, t)

    systems = {
        name: System(partial(lagrangian, term), ["y"], parameters={"c": 0.0}, name=name)
        for name, term in added.items()
    }
    problem = Problem(systems["linear"], Event(0.0, [0.0]), Event(1.0, [1.0]))
    path = _rows(solve(problem, tol=1e-12), 0.0, 1.0)
    return {"laws": {name: law(system) for name, system in systems.items()}, "path": path, "T": 1.0}


def legendre() -> dict[str, Any]:
    """Return L(v) of a slow body and of a fast one, in units of m = c = 1, with V = 0.4."""
    laws = {
        "slow": System(lambda q, v, t: v[0] ** 2 / 2 - 0.4, ["x"]),
        "fast": System(lambda q, v, t: -np.sqrt(1 - v[0] ** 2), ["x"]),
    }
    return {"laws": {name: law(system) for name, system in laws.items()}}


def phase() -> dict[str, Any]:
    """Return a mass on a spring and a pendulum, with a start and a spread of momenta; m = 1."""
    systems = {
        "spring": (System(lambda q, v, t: (v[0] ** 2 - q[0] ** 2) / 2, ["x"]), 1.0, 0.6, 0.9, 7.0),
        "pendulum": (
            System(lambda q, v, t: v[0] ** 2 / 2 + np.cos(q[0]), ["x"]),
            0.4,
            1.2,
            0.5,
            9.0,
        ),
    }
    return {
        "systems": {
            name: {**_law_and_numbers(system), "q0": q0, "p0": p0, "spread": spread, "T": T}
            for name, (system, q0, p0, spread, T) in systems.items()
        }
    }


def rod() -> dict[str, Any]:
    """Return motions of a pendulum in x and y for rods of several lengths, with their pull.

    The constraint is f = sqrt(x^2 + y^2) - l, so that the rod pulls with -lambda.
    """
    system = System(
        lambda q, v, t: v @ v / 2 - 9.81 * q[1],
        ["x", "y"],
        parameters={"l": ROD},
        constraint=lambda q, t, *, l: np.sqrt(q[0] ** 2 + q[1] ** 2) - l,
    )
    rule, t = lgl(DEGREE), np.linspace(0, ROD_TIME, ROD_TIMES)
    inner = ROD_TIME * (1 + rule.nodes) / 2
    found: dict[str, list[Any]] = {"actions": [], "areas": [], "pulls": [], "places": []}
    for length in ROD + LENGTHS:
        ends = [[length * np.sin(a), -length * np.cos(a)] for a in ANGLES]
        problem = Problem(
            system, Event(0.0, ends[0]), Event(ROD_TIME, ends[1]), parameters={"l": length}
        )

        def swing(s: Array, length: float = length) -> Array:
            angle = ANGLES[0] + (ANGLES[1] - ANGLES[0]) * s / ROD_TIME
            return length * np.stack([np.sin(angle), -np.cos(angle)])

        path = solve(problem, guess=swing, tol=1e-11)
        found["actions"].append(path.action)
        found["areas"].append(float(-ROD_TIME / 2 * rule.weights @ path.multipliers(inner)[0]))
        found["pulls"].append(np.round(-path.multipliers(t)[0], 6).tolist())
        found["places"].append(np.round(path(t).T, 5).tolist())
    return {**found, "lengths": (ROD + LENGTHS).tolist(), "l": ROD, "t": t.tolist()}


def spring() -> dict[str, Any]:
    """Return the law of a mass on a spring, m = k = 1, and a rule to sum it by."""
    system = System(lambda q, v, t: (v[0] ** 2 - q[0] ** 2) / 2, ["x"])
    return {**_law_and_numbers(system), **_unit_rule()}


DEMONSTRATIONS: dict[str, Demonstration] = {
    "three": Demonstration(
        {
            "h": "h",
            "x": "middle place",
            "last": "last place",
            "bend": "from T",
            "weight": "from V",
            "places": "Three places; arrows: both parts of the slope",
            "parabola": "S of the middle place: its slope",
            "level": "Both arrows cancel: S is level. The middle place is {x} cm above the line "
            "between its neighbours, which is g h\u00b2/2: Newton's law.",
            "lower": "Here S rises upwards, by {s}: lower the middle place.",
            "higher": "Here S falls upwards, by {s}: raise the middle place.",
        },
        dict,
    ),
    "noether": Demonstration(
        {
            "system": "What moves",
            "ball": "a ball",
            "planet": "a planet",
            "screw": "a particle in a groove",
            "middle": "shift only the middle",
            "e": "shift \u03b5",
            "c": "share c",
            "shifted": "The motion, dashed, and its ghost",
            "momenta": "Momenta along the motion",
            "changes": "How S changes, first order",
            "ghost": "of the ghost",
            "second_order": "of second order",
            "first_end": "start",
            "between": "between",
            "last_end": "end",
            "together": "together",
            "unmoved": "The ghost is the motion: slide \u03b5.",
            "symmetric": "The ghost has the same S: this shift is a symmetry, and the broad curve "
            "is flat.",
            "broken": "S changes by {x}: this shift is no symmetry, and the broad curve changes "
            "by {y} on the way.",
            "steps": "The step at the start adds {a}, the step at the end adds {c}, the middle "
            "nothing. Together they are zero, since this is a motion: so p is the same at both "
            "ends.",
            "pushed": "Start {a}, between {b}, end {c}: together zero, since this is a motion. "
            "What the middle adds is what p gains on the way.",
        },
        noether,
    ),
    "gauge": Demonstration(
        {
            "added": "What is added to L",
            "linear": "d/dt (c y)",
            "square": "d/dt (c y\u00b2/2)",
            "clock": "d/dt (c t y)",
            "none": "c y, which is no d/dt",
            "c": "c",
            "a": "bend",
            "bent": "The path",
            "lagrangians": "L along the path",
            "landscape": "S of all bends",
            "with": "with the addition",
            "nothing": "Nothing is added yet: slide c.",
            "rigid": "S of every path rises by the same {x}, which is F at the end less F at the "
            "start. The lowest place stays where it was.",
            "moves": "S rises by different amounts, and the lowest place moves to the bend "
            "{a} m: another motion.",
        },
        gauge,
    ),
    "legendre": Demonstration(
        {
            "kind": "Which body",
            "slow": "a slow body",
            "fast": "one nearly as fast as light",
            "v": "velocity",
            "lagrangian": "L of the velocity, and its tangent",
            "hamiltonian": "H of the momentum, and its tangent",
            "velocity": "slope v",
            "level": "At rest the tangent is level: p = 0, and H = \u2212L = {h}.",
            "twice": "p v is twice the energy of motion, as for every slow body: so H = T + V = "
            "{h}.",
            "more": "p v is not twice anything here, and yet H = p v \u2212 L = {h} is the energy, "
            "that of the mass included.",
        },
        legendre,
    ),
    "phase": Demonstration(
        {
            "system": "What moves",
            "spring": "a mass on a spring",
            "pendulum": "a pendulum",
            "t": "time",
            "plane": "Place and momentum: motions, and the line of their starts",
            "fan": "The same motions in time",
            "lean": "dq/dp\u2080",
            "begin": "All start at one place with different momenta: their line stands upright. "
            "Let time run.",
            "ahead": "Who started faster is ahead: the line leans to the right, and S is least so "
            "far.",
            "upright": "The line stands upright again: neighbours with different momenta are at "
            "one place. This is a focus, at t = {t} s.",
            "behind": "How often the line has stood upright since the start: {k}. So many foci "
            "there are, and so large is the index.",
        },
        phase,
    ),
    "optics": Demonstration(
        {
            "E": "energy E",
            "pieces": "pieces",
            "target": "target",
            "arc": "rise of the arc",
            "ground": "on the ground",
            "throws": "Throws, rays, and the safety parabola",
            "lengths": "W of arcs to the target",
            "two": "Two throws arrive, and two rays: W is level at both. The rays, in straight "
            "pieces, keep within {gap} cm of the stones.",
            "edge": "The target is on the safety parabola: both throws have become one. It is the "
            "caustic of the rays.",
            "none": "Beyond the safety parabola: no throw of this energy arrives, no ray either, "
            "and W is level nowhere.",
            "higher": "The second throw flies higher than the picture: lower E, or move the "
            "target.",
        },
        dict,
    ),
    "rod": Demonstration(
        {
            "e": "longer by \u03b5",
            "circle": "The swing, and the pull of the rod",
            "pull": "The pull: its area",
            "lifted": "S of rods of all lengths: its slope",
            "same": "Slope of S: {s}. Area under the pull: {a}. The same, for every length.",
            "differs": "Slope of S: {s}, area under the pull: {a}.",
        },
        rod,
    ),
    "bends": Demonstration(
        {
            "T": "duration",
            "hbar": "\u0127",
            "one": "First bend",
            "two": "Second bend",
            "both": "Both together",
            "up": "Both bends cost action: each turns the sum forwards by 45\u00b0, together "
            "{x}. Index 0.",
            "pass": "The first bend gains and the second costs: {a} and {b}, together {x}. "
            "Index 1.",
            "down": "Both bends gain: each turns the sum back by 45\u00b0, together {x}. A saddle "
            "of index 2.",
            "focus": "A focus: along one bend S does not change to second order, all its arrows "
            "agree, and the sum is as long as it gets.",
            "apart": "The sum over all pairs is turned by {x}, the product by {a} and {b}.",
        },
        spring,
    ),
    "slits": Demonstration(
        {
            "wall": "Slits",
            "two": "two slits",
            "one": "one slit",
            "open": "no wall",
            "hbar": "\u0127",
            "d": "distance",
            "w": "width",
            "place": "place on the screen",
            "room": "Source, wall and screen",
            "spirals": "The arrows for this place",
            "brightness": "brightness",
            "bright": "The sums of both slits agree: bright. Places that are {s} cm apart are "
            "alike.",
            "dark": "The sums of both slits are opposite: dark, though each slit alone would "
            "shine here.",
            "grey": "The sums of both slits enclose an angle: neither bright nor dark.",
            "alone": "One slit: without a partner there is no darkness between.",
            "free": "Without a wall the arrows of all places make one great spiral, and only the "
            "straight way is left of it: the brightness is {x} everywhere.",
        },
        dict,
    ),
    "string": Demonstration(
        {
            "mode": "Shape",
            "1": "first",
            "2": "second",
            "3": "third",
            "T": "duration",
            "a": "bend",
            "stiffness": "stiffness",
            "shape": "The bend, as a string; arrows: what pulls it outwards",
            "stiffnesses": "Stiffness of three shapes",
            "cost": "What this shape costs",
            "stiff": "The tension wins: this shape costs action. Index {n}.",
            "soft": "Tension and springs are in balance: this shape costs nothing. The end is a "
            "focus.",
            "gives": "The springs win: this shape leads downhill, and S changes by {x}. Index {n}.",
        },
        spring,
    ),
}
