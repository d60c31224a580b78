"""What the names of coordinates tell, and nothing else does: symbols, units, pairs x and y.

A Greek name is an angle's, x and y with the same ending are Cartesian. Any other picture of
coordinates so named is one `coordinate=` or `UnitNames()` away.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from actionopt.scenes import Scene
from actionopt.tools.checks import items
from actionopt.tools.greek import GREEK, split
from actionopt.tools.words import say


@dataclass(frozen=True)
class UnitNames:
    """Words for the units in labels; an empty word writes none. Greek coordinates are angles.

    >>> SI.coordinate("theta1"), SI.coordinate("x"), SI.momentum("theta1"), SI.action
    ('rad', 'm', 'J s', 'J s')
    >>> SI.generalized_force("theta1"), SI.generalized_force("x")
    ('N m', 'N')
    >>> UnitNames().action
    ''
    """

    time: str = ""
    length: str = ""
    energy: str = ""
    force: str = ""
    clock: str = "time $t$"

    @property
    def action(self) -> str:
        """Energy times time."""
        return f"{self.energy} {self.time}".strip() if self.energy else ""

    def coordinate(self, name: str) -> str:
        """Return the unit of a coordinate."""
        return ("rad" if _angle(name) else self.length) if self.length else ""

    def momentum(self, name: str) -> str:
        """Return the unit of a coordinate's momentum: action per unit of the coordinate."""
        if _angle(name):
            return self.action
        return f"{self.force} {self.time}".strip() if self.force else ""

    def generalized_force(self, name: str) -> str:
        """Return the unit of the force along a coordinate: a torque along an angle."""
        length = f" {self.length}" if _angle(name) else ""
        return f"{self.force}{length}" if self.force else ""


NO_UNITS = UnitNames()
SI = UnitNames("s", "m", "J", "N")
PATH_CLOCK = "along the path, $t$"


def units_of(scene: Scene) -> UnitNames:
    """Return the units of a scene: SI's, or of half a squared length, which runs along the path.

    None where it measures nothing that has a name.
    """
    if scene.measure is None:
        return SI
    if not scene.measure.name:
        return UnitNames(clock="parameter $t$")
    base = scene.measure.base
    return UnitNames("", "m", f"{base}\N{SUPERSCRIPT TWO}", base, PATH_CLOCK)


def _angle(name: str) -> bool:
    if not isinstance(name, str):
        raise ValueError(f"expected the name of a coordinate, found {name!r}")
    return split(name)[0] in GREEK


def label(text: str, *units: str) -> str:
    """Return an axis label in the reader's language, the units in brackets, each once.

    >>> label("time $t$", "s"), label("time $t$", ""), label("momenta", "N s", "J s", "N s")
    ('time $t$ (s)', 'time $t$', 'momenta (J s, N s)')
    """
    words = ", ".join(sorted({*units} - {""}))
    return f"{say(text)} ({words})" if words else say(text)


def symbol(name: str) -> str:
    r"""Return a coordinate's name as mathematics: theta1 becomes theta with index 1.

    >>> symbol("theta1"), symbol("x"), symbol("speed")
    ('$\\theta_{1}$', '$x$', '$\\mathrm{speed}$')
    """
    if not isinstance(name, str):
        raise ValueError(f"expected the name of a coordinate, found {name!r}")
    word, index = split(name)
    if word in GREEK:
        word = f"\\{word}"
    elif len(word) > 1:
        word = f"\\mathrm{{{word}}}".replace("_", r"\_")
    return f"${word}_{{{index}}}$" if index else f"${word}$"


def planar(names: Sequence[str]) -> list[tuple[int, int]]:
    """Return the indices of the pairs (x, y) if all coordinates are Cartesian, else nothing.

    >>> planar(["x1", "y1", "x2", "y2"]), planar(["x", "s"])
    ([(0, 1), (2, 3)], [])
    """
    names = items(names, "the names of coordinates")
    if not all(isinstance(name, str) and name for name in names):
        raise ValueError(f"expected names of coordinates, found {names}")
    partner = {"x": "y", "X": "Y"}
    pairs = [
        (i, names.index(partner[name[0]] + name[1:]))
        for i, name in enumerate(names)
        if name[0] in partner and partner[name[0]] + name[1:] in names
    ]
    return pairs if 2 * len(pairs) == len(names) else []
