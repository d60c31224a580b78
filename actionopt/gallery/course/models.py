"""Five systems to model oneself: T and V are typed in, and the page checks the equations.

A page differentiates what was typed, and compares accelerations with those that the package
computes from laws of its own, at places and velocities drawn at random.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from actionopt.gallery.course.spoken import translate
from actionopt.gallery.page import escape, frame
from actionopt.mechanics.system import System
from actionopt.tools.formula import formula
from actionopt.tools.greek import GREEK
from actionopt.tools.mathml import mathml, symbol
from actionopt.tools.words import number, say

Energy = Callable[[Any, Any, Any], Any]
CHECKED_PLACES = 8  # at which accelerations are compared; two wrong laws do not agree at so many
CHECKED_FROM, CHECKED_TO = 0.4, 1.3  # of the coordinates there: clear of zero, within a right angle
CHECKED_SPEED = 1.5  # of the velocities


@dataclass(frozen=True)
class Assignment:
    """A system in words, its numbers, its energies (of q, v and parameters), and one answer."""

    name: str
    text: str
    coordinates: tuple[str, ...]
    parameters: Mapping[str, float]
    kinetic: Energy
    potential: Energy
    answer: tuple[str, str]


ASSIGNMENTS = (
    Assignment(
        "hanging",
        "A mass m hangs on a spring of stiffness k. The coordinate x is measured downwards, from "
        "where the spring is not stretched.",
        ("x",),
        {"m": 1.3, "k": 7.0, "g": 9.81},
        lambda q, v, p: p["m"] * v[0] ** 2 / 2,
        lambda q, v, p: p["k"] * q[0] ** 2 / 2 - p["m"] * p["g"] * q[0],
        ("m x'^2 / 2", "k x^2 / 2 - m g x"),
    ),
    Assignment(
        "pendulum",
        "A mass m swings on a rod of length l without weight. The angle theta is measured from "
        "straight down.",
        ("theta",),
        {"m": 1.3, "l": 0.8, "g": 9.81},
        lambda q, v, p: p["m"] * (p["l"] * v[0]) ** 2 / 2,
        lambda q, v, p: -p["m"] * p["g"] * p["l"] * np.cos(q[0]),
        ("m (l theta')^2 / 2", "-m g l cos theta"),
    ),
    Assignment(
        "planet",
        "A planet of mass m moves round a sun that rests. The force is k / r^2, towards the sun; "
        "the coordinates are the distance r and the angle phi.",
        ("r", "phi"),
        {"m": 1.3, "k": 3.1},
        lambda q, v, p: p["m"] * (v[0] ** 2 + q[0] ** 2 * v[1] ** 2) / 2,
        lambda q, v, p: -p["k"] / q[0],
        ("m (r'^2 + r^2 phi'^2) / 2", "-k / r"),
    ),
    Assignment(
        "hoop",
        "A bead of mass m slides on a hoop of radius R, which is upright and turns with the "
        "angular velocity w round its upright diameter. The angle theta is measured from straight "
        "down.",
        ("theta",),
        {"m": 1.3, "R": 0.7, "w": 2.4, "g": 9.81},
        lambda q, v, p: (
            p["m"] * p["R"] ** 2 * (v[0] ** 2 + (p["w"] * np.sin(q[0])) ** 2) / 2
        ),
        lambda q, v, p: -p["m"] * p["g"] * p["R"] * np.cos(q[0]),
        ("m R^2 (theta'^2 + w^2 sin theta^2) / 2", "-m g R cos theta"),
    ),
    Assignment(
        "cart",
        "A cart of mass M rolls along x without friction. From it hangs a pendulum of mass m and "
        "length l, at the angle theta from straight down, positive towards larger x.",
        ("x", "theta"),
        {"M": 2.1, "m": 1.3, "l": 0.8, "g": 9.81},
        lambda q, v, p: (
            p["M"] * v[0] ** 2 / 2
            + p["m"]
            * ((v[0] + p["l"] * v[1] * np.cos(q[1])) ** 2 + (p["l"] * v[1] * np.sin(q[1])) ** 2)
            / 2
        ),
        lambda q, v, p: -p["m"] * p["g"] * p["l"] * np.cos(q[1]),
        (
            "(M + m) x'^2 / 2 + m l x' theta' cos theta + m l^2 theta'^2 / 2",
            "-m g l cos theta",
        ),
    ),
)  # fmt: skip
SAID = {  # of what was typed, by the keys that the script knows
    "right": "Right: at {n} places and velocities your equations of motion are those of the "
    "system.",
    "other": "Right, with another Lagrangian: T - V differs from the usual one, and the equations "
    "of motion do not.",
    "unread": "{side} cannot be read from \u201c{part}\u201d on.",
    "unknown": "{side} contains {part}, which is not given. Given are {names}.",
    "valueless": "{side} has no value at {place}.",
    "singular": "No accelerations follow: T has to contain each velocity, {names}.",
    "kinetic_factor": "T is {x} times the kinetic energy.",
    "potential_factor": "V is {x} times the potential energy.",
    "sign": "V has the wrong sign: forces would lead uphill.",
    "potential": "T is right, V is not: where does it rise, and how steeply?",
    "kinetic": "V is right, T is not: how fast is each mass, and how fast is it carried along?",
    "neither": "Neither is right yet. At {place} your {name} is {mine}, that of the system "
    "{known}.",
}


def samples(model: Assignment) -> list[dict[str, Any]]:
    """Return places and velocities, with accelerations (of the package), T and V there."""
    p, n = model.parameters, len(model.coordinates)

    def lagrangian(q: Any, v: Any, t: Any) -> Any:
        return model.kinetic(q, v, p) - model.potential(q, v, p)

    system = System(lagrangian, list(model.coordinates))
    rng = np.random.default_rng(0)
    q = rng.uniform(CHECKED_FROM, CHECKED_TO, (n, CHECKED_PLACES))
    v = rng.uniform(-CHECKED_SPEED, CHECKED_SPEED, (n, CHECKED_PLACES))
    a = system.acceleration(q, v, np.zeros(CHECKED_PLACES))
    rows = zip(q.T, v.T, a.T, strict=True)
    return [
        {
            "q": at.tolist(),
            "v": fast.tolist(),
            "a": known.tolist(),
            "T": float(model.kinetic(at, fast, p)),
            "V": float(model.potential(at, fast, p)),
        }
        for at, fast, known in rows
    ]


def page(title: str) -> str:
    """Return the systems as a page; it needs models.js."""
    lead = say("Write T and V as formulas. The page checks the equations of motion.")
    help_ = say(
        "A blank or * multiplies, / divides by the next factor, ^ raises, a prime is the time "
        "derivative: x'. sin, cos, tan, sqrt, exp and log take the next name or bracket."
    )
    rows = "".join(map(_model, ASSIGNMENTS))
    main = f"""<article class="lesson"><header class="title">
<p class="crumb"><a href="../course.html">{say("The course")}</a></p>
<h1>{say(title)}</h1><p class="lead">{lead}</p><p>{help_}</p></header>
<ol class="models">{rows}</ol></article>"""
    scripts = ("address.js", "panel.js", "models.js")
    return frame(say(title), main, root="../", description=lead, scripts=scripts)


def _model(model: Assignment) -> str:
    data = {
        "coordinates": model.coordinates,
        "parameters": model.parameters,
        "letters": {x: GREEK[x] for x in model.coordinates if x in GREEK},
        "samples": samples(model),
        "words": {key: say(text) for key, text in SAID.items()},
    }
    text = json.dumps(data, separators=(",", ":")).replace("</", "<\\/")
    given = ", ".join(f"{symbol(x)} = {number(value)}" for x, value in model.parameters.items())
    fields = "".join(
        f'<label>{side} = <input type="text" name="{side}" autocomplete="off" '
        'autocapitalize="off" spellcheck="false"></label>'
        for side in "TV"
    )
    names = ", ".join(f"<code>{escape(x)}</code>" for x in (*model.coordinates, *model.parameters))
    answer = "".join(
        mathml(formula(f"{side} = {x}"), ("r",)) for side, x in zip("TV", model.answer, strict=True)
    )
    return f"""<li id="{model.name}"><p>{translate(model.text)}</p>
<p class="remark">{say("With {values}, in SI units. Names: {names}", values=given, names=names)}</p>
<form class="guess model" id="model-{model.name}" hidden>
<script type="application/json">{text}</script>{fields}
<button>{say("Check")}</button><output></output></form>
<noscript><p>{say("Scripts are off: nothing can be moved here.")}</p></noscript>
<details class="answer"><summary>{say("One answer")}</summary>{answer}</details></li>"""
