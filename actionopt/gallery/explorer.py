"""Paths under the reader's hand: data for the explorer in the page, and its action computed here.

A path is the polynomial through its two events and the handles, which stand at the inner nodes of
a Legendre-Gauss-Lobatto rule; its action is summed on the nodes of a finer rule, which is exact
for these Lagrangians. The page computes with the same numbers.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from actionopt import scenes
from actionopt.gallery.page import escape
from actionopt.scenes import Scene
from actionopt.tools.lobatto import lgl
from actionopt.tools.types import Array

SUMMED = 12  # degree of the rule on which the action is summed
DRAWN = 81  # points of a curve


@dataclass(frozen=True)
class Explorer:
    """A scene whose path can be dragged: L = m |v|^2 / 2 - k |q|^2 / 2 - m g q_n.

    Attributes
    ----------
    name : str
        Name of the scene.
    degree : int
        Of the path; one handle less.
    longest : float
        Longest duration, in parts of the scene's own; the end slides along the motion.
    """

    name: str
    degree: int
    longest: float = 1.0

    @cached_property
    def scene(self) -> Scene:
        """The scene, with its own numbers."""
        return scenes.get(self.name)

    def motion(self, duration: float) -> Array:
        """Return where the motion is at the nodes, (n, degree + 1)."""
        assert self.scene.exact is not None
        return self.scene.exact(duration * (lgl(self.degree).nodes + 1) / 2)

    def action(self, nodes: Array, duration: float) -> float:
        """Return S of the path through places (n, degree + 1) at the nodes."""
        problem, fine = self.scene.problem, lgl(SUMMED)
        here, rate = _matrices(self.degree, fine.nodes)
        t = duration * (fine.nodes + 1) / 2
        q, v = nodes @ here.T, nodes @ rate.T * 2 / duration
        L = problem.system.lagrangian(q, v, t, parameters=problem.parameters)
        return float(duration / 2 * (fine.weights @ L))

    def plain(self) -> dict[str, Any]:
        """Return what the page needs, for JSON."""
        problem, rule, fine = self.scene.problem, lgl(self.degree), lgl(SUMMED)
        here, rate = _matrices(self.degree, fine.nodes)
        seen, seen_rate = _matrices(self.degree, np.linspace(-1.0, 1.0, DRAWN))
        values = problem.system.table.values(problem.parameters)
        start = self.motion(problem.duration)[:, 0]
        return {
            "name": self.name,
            "coordinates": list(problem.system.coordinates),
            "parameters": {name: float(values.get(name, 0.0)) for name in "mkg"},
            "duration": problem.duration,
            "longest": self.longest * problem.duration,
            "start": {"q": start.tolist(), "v": self.scene.facts["velocity"](0.0).tolist()},
            "nodes": ((rule.nodes + 1) / 2).tolist(),
            "weights": (fine.weights / 2).tolist(),
            "here": here.tolist(),
            "rate": (2 * rate).tolist(),
            "seen": seen.tolist(),
            "seenRate": (2 * seen_rate).tolist(),
        }

    def html(self, caption: str) -> str:
        """Return the explorer as HTML."""
        text = json.dumps(self.plain(), separators=(",", ":"))
        slider = (
            '<label>Duration <input type="range" step="any" data-duration> '
            '<span class="clock" data-time></span></label>'
            if self.longest > 1
            else ""
        )
        return f"""<figure class="explorer" data-explorer="{self.name}">
<div class="verdict"><output data-action></output></div>
<svg role="group" aria-label="A path of the {escape(self.name)} to be bent by its handles"></svg>
<div class="controls">
<button type="button" data-do="motion">True motion</button>
<button type="button" data-do="bend">Bend it</button>
<button type="button" data-do="wave">Make waves</button>
{slider}</div>
<noscript><p>Scripts are off: the paths cannot be dragged.</p></noscript>
<script type="application/json">{text}</script>
<figcaption>{caption}</figcaption>
</figure>"""


def _matrices(degree: int, xi: Array) -> tuple[Array, Array]:
    """Return the matrices from values at the nodes to values and slopes at the points `xi`."""
    rule = lgl(degree)
    here = rule.interpolation(xi)
    return here, here @ rule.derivative


PROJECTILE = Explorer("projectile", 6)
OSCILLATOR = Explorer("oscillator", 8, 2.0)
EXPLORERS = (PROJECTILE, OSCILLATOR)
