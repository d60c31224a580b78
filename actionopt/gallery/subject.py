"""A scene, its solution, and what several parts of a page say of the two."""

from __future__ import annotations

from collections.abc import Iterable
from functools import cached_property

import numpy as np

from actionopt.analysis.solution import Solution
from actionopt.analysis.spectra.conjugate import ConjugatePoint, conjugate_points
from actionopt.mechanics.system import System
from actionopt.plot import Energies, UnitNames, energies_data, motion_data, planar
from actionopt.plot._names import units_of
from actionopt.scenes import Scene
from actionopt.tools.greek import letter
from actionopt.tools.immutable import immutable
from actionopt.tools.types import Array
from actionopt.tools.words import number, say

SUBJECT_TIMES = 201
ZERO_RANGE = 1e-9  # what is this small relative to the size counts as zero


@immutable
class Subject:
    """What a page is about."""

    scene: Scene
    solution: Solution

    @property
    def units(self) -> UnitNames:
        """Words for its units."""
        return units_of(self.scene)

    @property
    def has_forces(self) -> bool:
        """Whether a force stands beside L: the motion is not where its action is stationary."""
        return self.solution.problem.system.structure.forced

    @cached_property
    def dissipates(self) -> bool:
        """Whether the forces beside L take energy from the motion, Q . v <= 0 at all times."""
        if not self.has_forces:
            return False
        problem = self.solution.problem
        force = problem.system.force(self.q, self.v, self.t, parameters=problem.parameters)
        power = np.sum(force * self.v, axis=0)
        return bool(power.max() <= ZERO_RANGE * -power.min())

    @property
    def touches(self) -> bool:
        """Whether the path is in contact with an obstacle."""
        return bool(self.solution.contacts)

    @property
    def between(self) -> int:
        """How many events the path passes between its ends."""
        return len(self.solution.problem.through)

    @property
    def laws(self) -> tuple[System, ...]:
        """The law of each leg, or the one of all of them."""
        problem = self.solution.problem
        return problem.laws or (problem.system,)

    @property
    def freedom(self) -> int:
        """Degrees of freedom."""
        return self.solution.problem.system.degrees_of_freedom

    @property
    def plane(self) -> bool:
        """Whether one picture shows all coordinates: one against time, or x and y."""
        names = self.solution.problem.system.coordinates
        return len(names) == 1 or len(planar(names)) == 1

    @cached_property
    def arrows(self) -> bool:
        """Whether there are forces of constraint that arrows on the bodies can show."""
        if not self.solution.problem.system.m:
            return False
        try:
            motion_data(self.solution, self.scene.draw, force=True)
        except ValueError:
            return False
        return True

    @cached_property
    def energies(self) -> Energies:
        """T and V along the path."""
        return energies_data(self.solution, kinetic=self.scene.kinetic)

    @property
    def duration(self) -> float:
        """Time between the events."""
        return self.solution.problem.duration

    @cached_property
    def t(self) -> Array:
        """Equal times, both events' included."""
        problem = self.solution.problem
        return np.linspace(problem.start.t, problem.end.t, SUBJECT_TIMES)

    @cached_property
    def q(self) -> Array:
        """Coordinates at the times `t`, (n, K)."""
        return self.solution(self.t)

    @cached_property
    def v(self) -> Array:
        """Velocities at the times `t`, (n, K)."""
        return self.solution.velocity(self.t)

    @cached_property
    def conjugate(self) -> tuple[ConjugatePoint, ...]:
        """Times conjugate to the start, up to the end; none with a force beside L.

        Nor along an obstacle, whose neighbours lie to one side.
        """
        return () if self.has_forces or self.touches else conjugate_points(self.solution)

    @property
    def verdict(self) -> str:
        """What the action is at the path: a minimum, a saddle of some index."""
        if self.has_forces:
            return say("a force beside L")
        index, kind = self.solution.morse_index, say(self.solution.kind)
        return say("{kind}, index {index}", kind=kind, index=index) if index else kind

    def event(self, q: Iterable[float]) -> str:
        """Return coordinates in words, with units, the first four of them."""
        names, least = self.solution.problem.system.coordinates, ZERO_RANGE * np.max(np.abs(self.q))
        parts = [
            f"{letter(n)} = {number(x if abs(x) > least else 0.0, 3)} {self.units.coordinate(n)}"
            for n, x in zip(names, q, strict=True)
        ]
        parts = [part.rstrip() for part in parts]
        more = say(" and {count} more", count=len(parts) - 4) if len(parts) > 4 else ""
        return ", ".join(parts[:4]) + more

    @property
    def motion(self) -> str:
        """What moves from where to where, in words."""
        start, end = (self.event(e.q) for e in (self.solution.start, self.solution.end))
        if not self.units.time:
            return say("from {start} to {end}", start=start, end=end)
        return say(
            "from {start} to {end} in {T} s", start=start, end=end, T=number(self.duration, 3)
        )

    @property
    def foci(self) -> str:
        """When neighbouring paths meet the path again, in words."""
        times = [f"{number(p.t, 4)} {self.units.time}".rstrip() for p in self.conjugate]
        if not times:
            return say("no time before the end is conjugate to the start")
        return say("conjugate to the start: {times}", times=", ".join(times))


def span(values: Array, unit: str, size: float = 0.0) -> str:
    """Return the range of values in words; `size` is one beside which rounding is nothing."""
    low, high = float(np.min(values)), float(np.max(values))
    least = ZERO_RANGE * max(abs(low), abs(high), size, 1e-300)
    if high - low <= least:
        x = number(high if abs(high) > least else 0.0, 3)
        return say("constant, {x} {unit}", x=x, unit=unit)
    return say(
        "between {low} and {high} {unit}", low=number(low, 3), high=number(high, 3), unit=unit
    )
