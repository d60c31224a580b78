"""Which figures a scene gets, by what it is: a rule each, and a reason where one is left out."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from actionopt import plot
from actionopt.gallery.page import escape, letter, rounded
from actionopt.gallery.subject import Subject, span
from actionopt.plot import SI
from actionopt.plot.data.fan import aligned

Rule = tuple[Callable[[Subject], bool], str]


@dataclass(frozen=True)
class Figure:
    """A figure drawn: its file's name, SVG and size (inches), and its words."""

    name: str
    svg: str
    size: tuple[float, float]
    alt: str
    caption: str
    title: str = ""

    def html(self, folder: str = "") -> str:
        """Return the picture in `folder` and its caption as HTML, the end of a <figure>."""
        width, height = (round(100 * side) for side in self.size)
        return (
            f'<img src="{folder}{self.name}.svg" alt="{escape(self.alt)}" width="{width}" '
            f'height="{height}" loading="lazy">\n<figcaption>{self.caption}</figcaption></figure>'
        )


def figures(subject: Subject) -> tuple[list[Figure], list[tuple[str, str]]]:
    """Return the figures of a subject, and the titles of those it has not, each with the reason."""
    drawn, without = [], []
    for title, unless, made in KINDS:
        reason = next((why for holds, why in unless if holds(subject)), "")
        if not reason:
            try:
                drawn.append(made(subject))
                continue
            except ValueError as error:
                reason = f"{str(error)[0].upper()}{str(error)[1:]}."
        without.append((title, reason))
    return drawn, without


# -- rules: what keeps a subject from having a figure, and why ---------------------------------

FORCED: Rule = (lambda s: s.forced, "A force that no potential gives leaves no action to compare.")
DRAG: Rule = (
    lambda s: s.forced,
    "A force takes energy from the motion: H falls, as the energy function shows.",
)
MOVING: Rule = (
    lambda s: plot.energies_data(s.solution, kinetic=s.scene.kinetic).moving,
    "What is taken from T here depends on the velocities, and so is no potential energy.",
)
SEVERAL: Rule = (
    lambda s: s.freedom > 1,
    "With several degrees of freedom the landscape tells more.",
)
CROWDED: Rule = (
    lambda s: not s.plane,
    "Neighbouring paths of several coordinates do not fit in one plane.",
)
HELD: Rule = (
    lambda s: bool(s.solution.problem.system.m),
    "Fronts need places all around the path, and a constraint leaves only a surface.",
)


# -- figures ---------------------------------------------------------------------------------

Draw = Callable[[Subject, Any], str]
KINDS: list[tuple[str, tuple[Rule, ...], Callable[[Subject], Figure]]] = []


def _kind(
    title: str,
    caption: str | Callable[[Subject], str],
    *unless: Rule,
    size: tuple[float, float] = (6.4, 4.4),
) -> Callable[[Draw], None]:
    """Make the decorated function a kind of figure, the file of its own name.

    It draws a subject on an empty matplotlib figure of `size` (inches), and says what is to be
    seen in this one, with numbers; `caption`, what in any such figure, or in one of such a
    subject. A subject that is what the rules `unless` say has none.
    """

    def add(draw: Draw) -> None:
        def made(subject: Subject) -> Figure:
            said: list[str] = []
            svg = plot.svg(lambda figure: said.append(draw(subject, figure)), size)
            words = caption if isinstance(caption, str) else caption(subject)
            return Figure(draw.__name__.strip("_"), svg, size, said[0], words, title)

        KINDS.append((title, unless, made))

    return add


@_kind(
    "The motion, as a strobe would show it",
    "What stands where at equal times, earlier ones fainter; arrows, where there are any, are "
    "forces of constraint.",
)
def _motion(s: Subject, figure: Any) -> str:
    plot.motion(s.solution, s.scene.draw, figure.subplots(), force=s.arrows, units=SI)
    return f"{s.scene.title}, at nine equal times {s.motion}."


@_kind(
    "The path, and the motion integrated forward",
    lambda s: (
        "Where the two agree, the path found between the events is the motion that the equations "
        "of Lagrange and d\N{RIGHT SINGLE QUOTATION MARK}Alembert, drag included, give from its "
        "own start. No action is stationary on it."
        if s.forced
        else "Where the two agree, the path that makes the action stationary is the motion that "
        "Newton\N{RIGHT SINGLE QUOTATION MARK}s equations give from its own start."
    ),
    size=(6.4, 6.0),
)
def _path(s: Subject, figure: Any) -> str:
    plot.overview(s.solution, figure.subplots(2, height_ratios=(3, 2)), units=SI)
    found = s.solution.compare()
    most = found.reason or f"at most {rounded(found.position, 2)}"
    return (
        f"Above, the path {s.motion}, action {s.solution.action:.8g} J s, with the forward "
        f"integration over it; below, their deviation on a logarithmic axis, {most}, beside an "
        f"error estimate of {rounded(s.solution.error, 2)}."
    )


@_kind(
    "Kinetic and potential energy",
    "The action is the area under T less the area under V.",
    DRAG,
    MOVING,
)
def _energies(s: Subject, figure: Any) -> str:
    plot.energies(s.solution, figure.subplots(), kinetic=s.scene.kinetic, units=SI)
    data = plot.energies_data(s.solution, kinetic=s.scene.kinetic)
    return (
        f"Kinetic energy {span(data.kinetic, 'J')} and potential energy "
        f"{span(data.potential, 'J')} against time; the area between them, counted negative where "
        f"V is larger, is the action {s.solution.action:.6g} J s."
    )


@_kind(
    "Energy function and momenta",
    "What stays the same is a broad straight line. Conserved is what a symmetry keeps on every "
    "motion: H if nothing depends on time, the momentum of a coordinate that appears nowhere.",
    size=(6.4, 5.4),
)
def _conserved(s: Subject, figure: Any) -> str:
    plot.conserved(s.solution, figure.subplots(2, sharex=True), units=SI)
    data = plot.conserved_data(s.solution)
    names = ["H", *(f"p of {letter(name)}" for name in s.solution.problem.system.coordinates)]
    rows = list(zip(names, data.flat, data.kept, strict=True))
    kept = ", ".join(name for name, _, kept in rows if kept) or "none of them"
    only = ", ".join(name for name, flat, kept in rows if flat and not kept)
    said = f"conserved: {kept}" + f"; constant on this path alone: {only}" * bool(only)
    return f"Energy function H, {span(data.energy, 'J')}, and momenta against time; {said}."


@_kind(
    "The path among its neighbours",
    "Varied paths between the same two events: vermilion where the action is higher, blue "
    "where it is lower.",
    FORCED,
    CROWDED,
)
def _bundle(s: Subject, figure: Any) -> str:
    plot.bundle(s.solution, figure.subplots(), units=SI)
    rise = plot.bundle_data(s.solution).rise
    return (
        f"The path {s.motion} in black among {rise.size} neighbours between the same events; "
        f"{(rise > 0).sum()} of them cost more action and {(rise < 0).sum()} less."
    )


@_kind(
    "The action along two variations",
    "At a stationary path the slope vanishes; whether it is least, the curvature tells.",
    FORCED,
    SEVERAL,
)
def _slices(s: Subject, figure: Any) -> str:
    plot.slices(s.solution, figure.subplots(), units=SI)
    how = "both rise like bowls" if s.solution.kind == "minimum" else "the first falls both ways"
    return f"The action along two variations of the path: {how}. {_index(s)}"


@_kind(
    "The action as a landscape",
    "The two variations that tell most: a bowl at a minimum, a pass at a saddle.",
    FORCED,
)
def _landscape(s: Subject, figure: Any) -> str:
    plot.landscape(s.solution, figure.subplots(), units=SI)
    how = "the bottom of a bowl" if s.solution.kind == "minimum" else "a pass between two valleys"
    contours = "Contours of the action over two variations; the path, in the middle, is at"
    return f"{contours} {how}. {_index(s)}"


def _index(s: Subject) -> str:
    return f"The path is a {s.solution.kind} of Morse index {s.solution.morse_index}."


@_kind(
    "Paths from one event",
    "Where neighbouring motions meet the path again, it ceases to be least.",
    FORCED,
    CROWDED,
)
def _fan(s: Subject, figure: Any) -> str:
    plot.fan(s.solution, figure.subplots(), units=SI)
    return f"Motions that leave the start with slightly different velocities, {s.motion}; {s.foci}."


@_kind(
    "The second variation as the path grows",
    "An eigenvalue below zero is a variation that lowers the action.",
    FORCED,
)
def _spectrum(s: Subject, figure: Any) -> str:
    plot.spectrum(s.solution, figure.subplots(), units=SI)
    return (
        f"The three lowest eigenvalues of the second variation against the duration; {s.foci}. "
        f"{s.solution.morse_index} of all are negative at the full duration."
    )


_FRONTS = {
    "time": "Lines of equal action over time and place, where dS = p dx &minus; H dt. A path "
    "climbs from line to line where L is positive, falls where it is negative, and runs along one "
    "where L = 0.",
    "along": "Fronts of the action at the end, over the places where the motions then are. The "
    "momentum is its gradient, and here along the velocity: motions arrive across the fronts, as "
    "rays do across waves.",
    "askew": "Fronts of the action at the end, over the places where the motions then are. The "
    "momentum, its gradient, stands across them; the velocity does not, for here p is more than "
    "m v.",
}


def fronts_caption(s: Subject) -> str:
    """Return what fronts are: over time, or in space, the velocity across them or askew."""
    if s.freedom == 1:
        return _FRONTS["time"]
    return _FRONTS["along" if aligned(s.solution.momentum(s.t), s.v) else "askew"]


@_kind(
    "Fronts of equal action",
    fronts_caption,
    FORCED,
    CROWDED,
    HELD,
)
def _fronts(s: Subject, figure: Any) -> str:
    plot.wavefronts(s.solution, figure.subplots(), units=SI)
    return (
        "Lines of equal action from the start, and motions that leave it in other directions; the "
        f"path goes {s.motion}."
    )


@_kind(
    "How it was computed",
    "Polynomials on elements in time; their degrees follow the motion.",
    size=(6.4, 5.2),
)
def _mesh(s: Subject, figure: Any) -> str:
    plot.mesh(s.solution, figure.subplots(2, sharex=True, height_ratios=(3, 2)), units=SI)
    mesh = s.solution.mesh
    low, high = min(mesh.degrees), max(mesh.degrees)
    degrees = f"of degree {low}" if low == high else f"of degrees {low} to {high}"
    return (
        f"The coordinates with the nodes on them, {mesh.elements} elements {degrees}; estimated "
        f"error {rounded(s.solution.error, 2)}."
    )
