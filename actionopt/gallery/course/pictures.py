"""Figures of the lessons that have some: the ray of a mirage, and two films between two rings."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from actionopt.analysis.solution import Solution
from actionopt.gallery.figures import Figure, one, pair
from actionopt.mechanics.question.problem import Event, Problem
from actionopt.mechanics.system import System
from actionopt.plot import _style as style
from actionopt.plot._names import label
from actionopt.solver.solve import solve
from actionopt.tools.types import Array
from actionopt.tools.words import number, say

PICTURE_SIZE = (6.8, 4.4)  # inches, of two side by side in a narrow column
EYE, CAR_DISTANCE = 1.5, 700.0  # m: its height, and how far away the car is
CAR = (1.0, 1.5)  # m: from its bonnet to its roof
AIR_LAYER, COOL, HOT = 0.3, 300.0, 25.0  # m and K: of the hot air, 325 K at the road
REFRACTION = 0.0798  # K: (n - 1) times the temperature, of air at the sea's pressure
RING_RADIUS = 1.0  # m, of two rings as far apart
GOLDSCHMIDT, LAST = 1.0554, 1.3255  # radii apart: from where discs have less area; no film beyond


def pictures(name: str) -> list[Figure]:
    """Return the figures of a lesson."""
    return [draw() for draw in OF.get(name, ())]


def index(y: Any) -> Any:
    """Return the refractive index at the height y (m) above the road."""
    return 1 + REFRACTION / (COOL + HOT * np.exp(-y / AIR_LAYER))


def rays(height: float) -> tuple[Solution, Solution]:
    """Return the two rays from the eye to a point of the car: nearly straight, and dipping."""
    air = System(lambda q, v, t: index(q[0]) * np.sqrt(1 + v[0] ** 2), ["y"], name="mirage")
    problem = Problem(air, Event(0.0, [EYE]), Event(CAR_DISTANCE, [height]))
    low = CAR_DISTANCE * EYE / (EYE + height)  # where it would be reflected
    dips = solve(
        problem,
        guess=lambda t: [np.interp(t, [0, low, CAR_DISTANCE], [EYE, AIR_LAYER / 2, height])],
    )
    return solve(problem), dips


def films() -> tuple[Solution, Solution]:
    """Return the wide film between two rings, and the narrow one."""
    soap = System(lambda q, v, x: 2 * np.pi * q[0] * np.sqrt(1 + v[0] ** 2), ["y"], name="soap")
    problem = Problem(soap, Event(0.0, [RING_RADIUS]), Event(RING_RADIUS, [RING_RADIUS]))
    narrow = solve(
        problem, guess=lambda x: [RING_RADIUS * (1 - 0.75 * np.sin(np.pi * x / RING_RADIUS))]
    )
    return solve(problem), narrow


def areas(u: Array) -> tuple[Array, Array]:
    """Return distances of the rings in radii, and areas of the film y = c cosh(x / c) in R^2.

    `u` is half the distance over c.
    """
    return 2 * u / np.cosh(u), np.pi * (2 * u + np.sinh(2 * u)) / np.cosh(u) ** 2


def _mirage() -> Figure:
    found = {height: rays(height) for height in CAR}
    x = np.linspace(0, CAR_DISTANCE, 201)

    def draw(ax: Any) -> None:
        looks = (style.BLUE, say("straight on")), (style.VERMILION, say("by the hot air"))
        for height, both in found.items():
            for ray, (colour, text) in zip(both, looks, strict=True):
                named = text if height == CAR[0] else None
                ax.plot(x, ray(x)[0], color=colour, linewidth=2.2, label=named)
            seen = EYE + both[1].velocity(0.0)[0] * x
            named = say("where it seems to come from") if height == CAR[0] else None
            ax.plot(x, seen, color=style.VERMILION, linestyle=":", linewidth=1.2, label=named)
        seems = [EYE + both[1].velocity(0.0)[0] * CAR_DISTANCE for both in found.values()]
        thick = {"solid_capstyle": "butt", "linewidth": 7}
        ax.plot([CAR_DISTANCE, CAR_DISTANCE], CAR, color=style.ink(), **thick)
        ax.plot([CAR_DISTANCE, CAR_DISTANCE], seems, color=style.PALE, **thick)
        ax.plot([CAR_DISTANCE], CAR[1:], "^", color=style.ink(), markersize=9)
        ax.plot([CAR_DISTANCE], seems[1:], "v", color=style.PALE, markersize=9)
        ax.plot([0], [EYE], **style.start())
        ax.axhspan(-2.6, 0, color=style.PALE, alpha=0.2, linewidth=0)
        ax.axhline(0, color=style.GREY, linewidth=1.4)
        ax.set(xlabel=label("along the road $x$", "m"), ylabel=label("height $y$", "m"))
        ax.set(ylim=(-2.6, 1.9), title=say("a mirage: one car, two rays from each point"))
        ax.margins(x=0.03)
        style.legend_below(ax, 3)

    straight, dips = found[CAR[1]]
    low = float(dips(x)[0].min())
    values = {
        "low": number(low, 2),
        "more": number(1e3 * (dips.action - straight.action), 3),
        "index": dips.morse_index,
    }
    return one(
        "mirage",
        draw,
        say(
            "Two rays from each of two points of a car to the eye: one nearly straight, one that "
            "dips to {low} m above the hot road and rises again. Drawn on along its last "
            "direction it comes from below the road, where the car is seen upside down.",
            low=number(low, 2),
        ),
        say(
            "The road is at 325 K, the air above at 300 K; heights are stretched. The ray that "
            "dips comes down to {low} m, and its optical way is {more} mm longer: it is a saddle, "
            "of index {index}. What is higher seems lower, and the image stands on its head.",
            **values,
        ),
    )


def _soap() -> Figure:
    wide, narrow = films()
    x, u = np.linspace(0, RING_RADIUS, 201), np.linspace(0.02, 5.0, 400)

    def draw(axes: Sequence[Any]) -> None:
        left, right = axes
        kinds = (
            (wide, style.BLUE, "-", say("least")),
            (narrow, style.VERMILION, "--", say("saddle")),
        )
        for film, colour, dashes, text in kinds:
            y = film(x)[0]
            look = {"color": colour, "linestyle": dashes, "linewidth": 2.2}
            left.plot(x, y, **look, label=text)
            left.plot(x, -y, **look)
            left.fill_between(x, -y, y, color=colour, alpha=0.1, linewidth=0)
        for at in (0, RING_RADIUS):
            left.plot([at, at], [-RING_RADIUS, RING_RADIUS], color=style.ink(), linewidth=3)
        left.set(xlabel=label("axis $x$", "m"), ylabel=label("radius $y$", "m"), aspect="equal")
        left.set(xticks=(0, 0.5, 1), title=say("two films, one pair of rings"))
        distance, area = areas(u)
        turn = int(np.argmax(distance))
        right.plot(distance[: turn + 1], area[: turn + 1], color=style.BLUE, linewidth=2.2)
        right.plot(
            distance[turn:], area[turn:], color=style.VERMILION, linestyle="--", linewidth=2.2
        )
        right.axhline(2 * np.pi, color=style.GREY, linestyle=":", label=say("two discs"))
        for film, colour in ((wide, style.BLUE), (narrow, style.VERMILION)):
            right.plot([1.0], [film.action / RING_RADIUS**2], **{**style.event(), "color": colour})
        right.set(xlabel=label("distance over $R$"), ylabel=label("area over $R^2$"))
        right.set(title=say("they meet, and end"))
        for ax in (left, right):
            style.legend_below(ax, 2)

    return pair(
        "soap",
        draw,
        say(
            "Left, two profiles between the same two rings: a wide film of {wide} m\u00b2 and a "
            "narrow one of {narrow} m\u00b2. Right, the areas against the distance of the rings, "
            "two branches that meet in a cusp.",
            wide=number(wide.action, 3), narrow=number(narrow.action, 3),
        ),
        say(
            "Rings of 1 m radius, 1 m apart. The wide film, of {wide} m\u00b2, is least; the "
            "narrow one, of {narrow} m\u00b2, is stationary too, a saddle of index {index}. "
            "Farther apart than {last} radii there is neither: the film breaks. Two flat discs "
            "have less area from {discs} radii on.",
            wide=number(wide.action, 4), narrow=number(narrow.action, 4),
            index=narrow.morse_index, last=number(LAST, 5), discs=number(GOLDSCHMIDT, 5),
        ),
        PICTURE_SIZE,
    )  # fmt: skip


OF = {"light": (_mirage, _soap)}
