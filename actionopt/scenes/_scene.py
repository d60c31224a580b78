"""What a scene is, and what can be known exactly about one.

A scene's facts are a mapping from names to what is known, in closed form, from its source.
These names mean the same in every scene; K times, n coordinates, m constraint rows:

=================  ===============================================================================
`velocity`         function of t: the velocity along `exact`, (n, K) or (n,)
`action`           number: S between the events, along `exact` or the motion from `start`
`energy`           number: the energy function H along the same
`conjugate_times`  row of times: the first ones conjugate to the start along `exact`, before the
                   end or after it, each as often as its multiplicity
`morse_index`      integer: number of conjugate times before the end
`conserved`        mapping from names to functions of (q, v, t) that are constant along every
                   motion, (K,); `energy` among them is T + V, and equal to H
`acceleration`     function of (q, v, t): the equations of motion as the book has them, (n, K)
`multipliers`      function of (q, v, t): lambda as the book has it, (m, K)
`start`            the State from which the motion through both events sets out
`twin`, `gauge`    name of a scene with the same path for the same parameters, and the F(q, t)
                   with L = L(twin) + dF/dt, a function of q and t, (K,)
=================  ===============================================================================

A name not in `MEANINGS` is a number, explained in the file of its scene.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from actionopt.mechanics.problem import Problem
from actionopt.scenes._shapes import Shape
from actionopt.tools.types import Array

MEANINGS = (
    "velocity",
    "action",
    "energy",
    "conjugate_times",
    "morse_index",
    "conserved",
    "acceleration",
    "multipliers",
    "start",
    "twin",
    "gauge",
)

PANELS, POINTS = 64, 20  # Gauss-Legendre rule for `Scene.action`: exact to rounding here


@dataclass(frozen=True, eq=False)
class Scene:
    """A named, documented example.

    Parameters
    ----------
    problem : Problem
        The question.
    title, source : str
        One line each: what it is, and the section, page or equation it is taken from.
    draw : callable
        `draw(q, t)` for q of shape (n,): the shapes of the picture at one time, back to front.
    exact : callable, optional
        The path in closed form: (n, K) for K times, (n,) for one time.
    facts : mapping, optional
        What is known exactly; names as in this module's docstring.
    guess : callable, optional
        A rough path of the same shapes as `exact`, where the straight line between the events
        leads elsewhere or nowhere.
    """

    problem: Problem
    title: str
    source: str
    draw: Callable[[Array, float], list[Shape]]
    exact: Callable[[Any], Array] | None = None
    facts: Mapping[str, Any] = field(default_factory=dict)
    guess: Callable[[Any], Array] | None = None

    @property
    def name(self) -> str:
        """The scene's name, which is its system's."""
        return self.problem.system.name

    def __repr__(self) -> str:
        """Show name and title."""
        return f"Scene({self.name}: {self.title})"

    @cached_property
    def action(self) -> float | None:
        """S along the path: from the facts if they have it, else by quadrature of `exact`.

        The quadrature is good to rounding. None if the path is not known either.
        """
        if "action" in self.facts:
            return float(self.facts["action"])
        if self.exact is None:
            return None
        problem = self.problem
        xi, w = np.polynomial.legendre.leggauss(POINTS)
        h = problem.duration / PANELS
        t = problem.start.t + h * (np.arange(PANELS)[:, None] + (xi + 1) / 2).ravel()
        L = problem.system.lagrangian(
            self.exact(t), self.facts["velocity"](t), t, parameters=problem.parameters
        )
        return float(h / 2 * np.tile(w, PANELS) @ L)


def curve(formula: Callable[[Array], Sequence[Any]]) -> Callable[[Any], Array]:
    """Make n formulas in t a curve: (n, K) for K times, (n,) for one time."""

    def evaluate(t: Any) -> Array:
        times = np.asarray(t, dtype=float)
        return np.stack([np.broadcast_to(x, times.shape) for x in formula(times)])

    return evaluate


def defaults(scene: Callable[..., Scene], *names: str) -> dict[str, float]:
    """Return the default values of a scene's parameters `names`, for its system."""
    signature = inspect.signature(scene).parameters
    return {name: signature[name].default for name in names}


def unit_sine(w: float, t: Any) -> Array:
    """Return sin(w t) / w, and t at w = 0: the s(t) with s'' = -w^2 s, s(0) = 0, s'(0) = 1."""
    return np.sin(w * t) / w if w else np.asarray(t, dtype=float)
