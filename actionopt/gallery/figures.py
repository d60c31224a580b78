"""Which figures a scene gets, by what it is: a rule each, and a reason where one is left out."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from actionopt import plot
from actionopt.gallery.page import rounded
from actionopt.gallery.subject import Subject, span
from actionopt.plot import SI

NO_FUNCTIONAL = "A force that no potential gives leaves no action to compare."


@dataclass(frozen=True)
class Kind:
    """A kind of figure.

    Attributes
    ----------
    name, title, caption : str
        The file's name, the heading, and what there is to see in any such figure.
    draw : callable
        Draws a subject on an empty matplotlib figure.
    alt : callable
        Says what is to be seen in this one, with numbers.
    unless : callable
        Says why a subject has no such figure, or nothing.
    size : (float, float)
        Inches.
    """

    name: str
    title: str
    caption: str
    draw: Callable[[Subject, Any], Any]
    alt: Callable[[Subject], str]
    unless: Callable[[Subject], str] = lambda s: ""
    size: tuple[float, float] = (6.4, 4.4)


@dataclass(frozen=True)
class Figure:
    """A figure drawn."""

    kind: Kind
    alt: str
    svg: str


def figures(subject: Subject) -> tuple[list[Figure], list[tuple[Kind, str]]]:
    """Return the figures of a subject, and the kinds it has not, each with the reason."""
    drawn, without = [], []
    for kind in KINDS:
        reason = kind.unless(subject)
        if not reason:
            try:
                svg = plot.svg(lambda figure, k=kind: k.draw(subject, figure), kind.size)
                drawn.append(Figure(kind, kind.alt(subject), svg))
                continue
            except ValueError as error:
                reason = f"{str(error)[0].upper()}{str(error)[1:]}."
        without.append((kind, reason))
    return drawn, without


# -- rules -----------------------------------------------------------------------------------


def _forced(s: Subject) -> str:
    return NO_FUNCTIONAL if s.forced else ""


def _not_mechanical(s: Subject) -> str:
    if s.forced:
        return "A force takes energy from the motion: H falls, as the energy function shows."
    if not s.solution.problem.system.energy_is_mechanical:
        return "The energy function is not T + V here, so that T and V do not share it out."
    return ""


def _several(s: Subject) -> str:
    several = "With several degrees of freedom the landscape tells more."
    return _forced(s) or (several if s.freedom > 1 else "")


def _no_plane(s: Subject) -> str:
    crowded = "Neighbouring paths of several coordinates do not fit in one plane."
    return _forced(s) or ("" if s.plane else crowded)


def _no_fronts(s: Subject) -> str:
    held = "Fronts need places all around the path, and a constraint leaves only a surface."
    return _no_plane(s) or (held if s.solution.problem.system.m else "")


# -- what is to be seen ----------------------------------------------------------------------


def _paths_alt(s: Subject) -> str:
    found = s.solution.compare()
    most = found.reason or f"at most {rounded(found.position, 2)}"
    return (
        f"Above, the path {s.motion}, action {s.solution.action:.8g} J s, with the forward "
        f"integration over it; below, their deviation on a logarithmic axis, {most}, beside an "
        "error estimate of "
        f"{rounded(s.solution.error, 2)}."
    )


def _energies_alt(s: Subject) -> str:
    data = plot.energies_data(s.solution)
    return (
        f"Kinetic energy {span(data.kinetic, 'J')} and potential energy "
        f"{span(data.potential, 'J')} against time; the area between them, counted negative where "
        f"V is larger, is the action {s.solution.action:.6g} J s."
    )


def _conserved_alt(s: Subject) -> str:
    data = plot.conserved_data(s.solution)
    names = ["H", *(f"p of {name}" for name in s.solution.problem.system.coordinates)]
    flat = [name for name, same in zip(names, data.flat, strict=True) if same]
    kept = f"constant are {', '.join(flat)}" if flat else "none of them is constant"
    return f"Energy function H, {span(data.energy, 'J')}, and momenta against time; {kept}."


def _kind(s: Subject) -> str:
    return f"The path is a {s.solution.kind} of Morse index {s.solution.morse_index}."


def _slices_alt(s: Subject) -> str:
    how = "both rise like bowls" if s.solution.kind == "minimum" else "the first falls both ways"
    return f"The action along two variations of the path: {how}. {_kind(s)}"


def _landscape_alt(s: Subject) -> str:
    how = "the bottom of a bowl" if s.solution.kind == "minimum" else "a pass between two valleys"
    return (
        f"Contours of the action over two variations; the path, in the middle, is at {how}. "
        f"{_kind(s)}"
    )


def _bundle_alt(s: Subject) -> str:
    rise = plot.bundle_data(s.solution).rise
    return (
        f"The path {s.motion} in black among {rise.size} neighbours between the same events; "
        f"{(rise > 0).sum()} of them cost more action and {(rise < 0).sum()} less."
    )


def _fan_alt(s: Subject) -> str:
    return f"Motions that leave the start with slightly different velocities, {s.motion}; {s.foci}."


def _spectrum_alt(s: Subject) -> str:
    return (
        f"The three lowest eigenvalues of the second variation against the duration; {s.foci}. "
        f"{s.solution.morse_index} of all are negative at the full duration."
    )


def _fronts_alt(s: Subject) -> str:
    return (
        "Lines of equal action from the start, crossed by the motions that leave it in other "
        f"directions; the path goes {s.motion}."
    )


def _mesh_alt(s: Subject) -> str:
    mesh = s.solution.mesh
    low, high = min(mesh.degrees), max(mesh.degrees)
    degrees = f"of degree {low}" if low == high else f"of degrees {low} to {high}"
    return (
        f"The coordinates with the nodes on them, {mesh.elements} elements {degrees}; estimated "
        f"error {rounded(s.solution.error, 2)}."
    )


KINDS = (
    Kind(
        "motion",
        "The motion, as a strobe would show it",
        "What stands where at equal times, earlier ones fainter; arrows, where there are any, are "
        "forces of constraint.",
        lambda s, f: plot.motion(s.solution, s.scene.draw, f.subplots(), force=s.arrows, units=SI),
        lambda s: f"{s.scene.title}, at nine equal times {s.motion}.",
    ),
    Kind(
        "path",
        "The path, and the motion integrated forward",
        "Where the two agree, the path that makes the action stationary is the motion that "
        "Newton's equations give from its own start.",
        lambda s, f: plot.overview(s.solution, f.subplots(2, height_ratios=(3, 2)), units=SI),
        _paths_alt,
        size=(6.4, 6.0),
    ),
    Kind(
        "energies",
        "Kinetic and potential energy",
        "The action is the area under T less the area under V.",
        lambda s, f: plot.energies(s.solution, f.subplots(), units=SI),
        _energies_alt,
        _not_mechanical,
    ),
    Kind(
        "conserved",
        "Energy function and momenta",
        "What is conserved is a broad straight line.",
        lambda s, f: plot.conserved(s.solution, f.subplots(2, sharex=True), units=SI),
        _conserved_alt,
        size=(6.4, 5.4),
    ),
    Kind(
        "bundle",
        "The path among its neighbours",
        "Varied paths between the same two events: vermilion where the action is higher, blue "
        "where it is lower.",
        lambda s, f: plot.bundle(s.solution, f.subplots(), units=SI),
        _bundle_alt,
        _no_plane,
    ),
    Kind(
        "slices",
        "The action along two variations",
        "At a stationary path the slope vanishes; whether it is least, the curvature tells.",
        lambda s, f: plot.slices(s.solution, f.subplots(), units=SI),
        _slices_alt,
        _several,
    ),
    Kind(
        "landscape",
        "The action as a landscape",
        "The two variations that tell most: a bowl at a minimum, a pass at a saddle.",
        lambda s, f: plot.landscape(s.solution, f.subplots(), units=SI),
        _landscape_alt,
        _forced,
    ),
    Kind(
        "fan",
        "Paths from one event",
        "Where neighbouring motions meet the path again, it ceases to be least.",
        lambda s, f: plot.fan(s.solution, f.subplots(), units=SI),
        _fan_alt,
        _no_plane,
    ),
    Kind(
        "spectrum",
        "The second variation as the path grows",
        "An eigenvalue below zero is a variation that lowers the action.",
        lambda s, f: plot.spectrum(s.solution, f.subplots(), units=SI),
        _spectrum_alt,
        _forced,
    ),
    Kind(
        "fronts",
        "Fronts of equal action",
        "The momentum is the gradient of the action: paths cross its fronts as rays cross waves.",
        lambda s, f: plot.wavefronts(s.solution, f.subplots(), units=SI),
        _fronts_alt,
        _no_fronts,
    ),
    Kind(
        "mesh",
        "How it was computed",
        "Polynomials on elements in time; their degrees follow the motion.",
        lambda s, f: plot.mesh(
            s.solution, f.subplots(2, sharex=True, height_ratios=(3, 2)), units=SI
        ),
        _mesh_alt,
        size=(6.4, 5.2),
    ),
)
