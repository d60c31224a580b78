"""Dials: one parameter of a family from easy to hard, with one mesh and one starting point.

What a solver does along a dial tells more than one problem does.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from actionopt import suite
from actionopt.suite.member import Member

__all__ = ["DIALS", "Dial"]


@dataclass(frozen=True)
class Dial:
    """A parameter of a family, and the values it is set to.

    Parameters
    ----------
    name, family, parameter : str
        What it is called, whose it is, and the parameter's name.
    values : tuple
        From easy to hard.
    elements, degree : int or None
        One mesh for all of them; None of a model, which has its own.
    start : str
        One starting point.
    shows : str
        What grows with it.
    """

    name: str
    family: str
    parameter: str
    values: tuple[float, ...]
    elements: int | None
    degree: int | None
    start: str
    shows: str

    def members(self) -> Iterator[tuple[float, Member]]:
        """Yield each value and its member."""
        for value in self.values:
            mesh = self.elements, self.degree
            yield value, suite.member(self.family, *mesh, **{self.parameter: value})

    def value(self, record: Mapping[str, Any]) -> float | None:
        """Return the value a record of the runner is at; None if it is of no member."""
        mine = (self.family, self.elements, self.degree, self.start)
        if tuple(record.get(k) for k in ("problem", "elements", "degree", "start")) != mine:
            return None
        settings = record.get("parameters", {})
        found = settings.get(self.parameter)
        return found if found in self.values and len(settings) == 1 else None


DIALS = {
    dial.name: dial
    for dial in (
        Dial(
            "eccentricity",
            "kepler",
            "eccentricity",
            (0.0, 0.2, 0.4, 0.6, 0.7, 0.8, 0.85, 0.9, 0.95),
            48,
            8,
            "perturbed",
            "how near the path comes to where the force is infinite",
        ),
        Dial(
            "links",
            "chain",
            "links",
            (1, 2, 3, 4, 6, 8, 12, 16),
            6,
            6,
            "perturbed",
            "constraints, and the number of stationary points",
        ),
        Dial(
            "duration",
            "pendulum",
            "duration",
            (1.0, 2.0, 4.0, 6.0, 8.0, 10.0, 12.0, 14.0, 16.0, 18.0),
            48,
            8,
            "straight",
            "the number of stationary points, and of negative eigenvalues",
        ),
        Dial(
            "precession",
            "heavy_top",
            "duration",
            (0.1, 0.2, 0.3, 0.4, 0.6, 0.8),
            16,
            6,
            "perturbed",
            "how far f falls along directions that are nearly flat",
        ),
        Dial(
            "stiffness",
            "oscillator_stiff",
            "k",
            (1e-2, 1.0, 1e1, 1e2, 1e3, 1e4),
            64,
            8,
            "straight",
            "frequency over that of the mesh's first mode; from 10 on f is unbounded below",
        ),
        Dial(
            "negative curvature",
            "oscillator",
            "duration",
            (1.0, 3.0, 4.0, 7.0, 10.0, 13.0, 19.0),
            16,
            8,
            "straight",
            "the share of negative eigenvalues; beyond pi f is unbounded below",
        ),
        Dial(
            "layer",
            "turning_wire_radial",
            "w",
            (1.0, 4.0, 8.0, 16.0, 32.0, 60.0),
            32,
            8,
            "straight",
            "how thin a layer the path has, and the condition of the Hessian",
        ),
        Dial(
            "units",
            "pendulum",
            "decades",
            (0.0, 1.0, 2.0, 4.0, 6.0, 8.0),
            16,
            4,
            "straight",
            "powers of ten over which units range: the condition of the Hessian, and nothing else",
        ),
        Dial(
            "contacts",
            "string_waves",
            "waves",
            (1.0, 2.0, 4.0, 6.0, 8.0, 12.0),
            48,
            4,
            "straight",
            "how many parts of the path are in contact: from one to nine",
        ),
        Dial(
            "pegs",
            "pegs",
            "pegs",
            (1, 2, 3, 4, 5, 6),
            48,
            4,
            "straight",
            "how many discs are in the way; each may be passed on either side",
        ),
        *(
            Dial(name, model, parameter, values, None, None, "own", shows)
            for name, model, parameter, values, shows in (
                (
                    "missing",
                    "chain_too_short",
                    "missing",
                    (0.5, 0.2, 0.1, 0.05, 0.02, 0.01, 0.001),
                    "by how much it is infeasible: the less, the harder to see",
                ),
                (
                    "residual",
                    "decaying_oscillations",
                    "residual",
                    (0.0, 0.1, 1.0, 5.0, 20.0, 30.0, 35.0),
                    "the term of the Hessian that Gauss leaves out; at 36.1 x* is no minimum",
                ),
                (
                    "twist",
                    "torsion",
                    "twist",
                    (1.0, 1.5, 2.0, 3.0, 5.0, 10.0),
                    "how much of the bar yields: none up to 1.48",
                ),
                (
                    "cells",
                    "membrane",
                    "cells",
                    (8, 16, 32, 64, 128),
                    "unknowns, its square, and how much the factors of the matrix fill in",
                ),
                (
                    "thrust",
                    "goddard_rocket",
                    "most",
                    (10.0, 7.0, 5.0, 4.0, 3.5, 3.2),
                    "how near its bound the thrust on the singular arc is",
                ),
                (
                    "noise",
                    "shooting",
                    "tolerance",
                    (1e-12, 1e-10, 1e-8, 1e-6, 1e-4, 1e-3),
                    "the tolerance of the integrator, below which f is not smooth",
                ),
            )
        ),
    )
}
