"""Which figures a scene gets, by what it is: a rule each, and a reason where one is left out."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from actionopt import plot
from actionopt.analysis.solution import Solution
from actionopt.gallery.compact import compact
from actionopt.gallery.page import escape, typeset
from actionopt.gallery.subject import ZERO_RANGE, Subject, span
from actionopt.plot.data.fan import is_aligned
from actionopt.tools.greek import letter
from actionopt.tools.words import number, say

Rule = tuple[Callable[[Subject], bool], str | None]  # None for a figure nobody misses


ONE_SIZE, BOTH_SIZE = (6.4, 4.4), (10.4, 4.4)  # inches: of one figure, and of two side by side
SVG_SHAPE = re.compile(r' viewBox="0 0 ([\d.]+) ([\d.]+)"')
WIDEST_LANDSCAPE, LANDSCAPE_HALVINGS = (
    0.5,
    3,
)  # of a landscape, of the path's size; of that, at most
NARROW_WIDTH = 3.3  # inches: where a phone shows it, 11 points of letters are 15 pixels


def cut(size: tuple[float, float]) -> tuple[float, float]:
    """Return the size of a figure's cut for narrow screens (inches)."""
    return NARROW_WIDTH, NARROW_WIDTH * max(0.85, min(1.5, 1.35 * size[1] / size[0]))


@dataclass(frozen=True)
class Figure:
    """A figure drawn: its file's name, SVG and its words.

    `narrow` is its cut for narrow screens, if it has one.
    """

    name: str
    svg: str
    alt: str
    caption: str
    title: str = ""
    narrow: str = ""

    def html(self, folder: str = "") -> str:
        """Return the picture in `folder` and its caption as HTML, the end of a <figure>."""
        width, height = SVG_SHAPE.search(self.svg).groups()  # type: ignore[union-attr]
        cut = f'<source media="(max-width: 34rem)" srcset="{folder}{self.name}-narrow.svg">'
        return (
            f'<picture>{cut if self.narrow else ""}<img src="{folder}{self.name}.svg" '
            f'alt="{escape(self.alt)}" width="{width}" height="{height}" loading="lazy"></picture>'
            + f"\n<figcaption>{self.caption}</figcaption>" * bool(self.caption)
            + "</figure>"
        )

    def files(self, folder: str) -> dict[str, str]:
        """Return its files in `folder`."""
        cuts = {"": self.svg, "-narrow": self.narrow}
        return {f"{folder}{self.name}{cut}.svg": compact(svg) for cut, svg in cuts.items() if svg}


def one(name: str, draw: Callable[[Any], Any], alt: str, caption: str) -> Figure:
    """Return what `draw` puts on axes, with its narrow cut."""
    wide, narrow = plot.svgs(lambda f: draw(f.subplots()), ONE_SIZE, cut(ONE_SIZE))
    return Figure(name, wide, alt, caption, narrow=narrow)


def pair(
    name: str,
    draw: Callable[[Sequence[Any]], Any],
    alt: str,
    caption: str,
    size: tuple[float, float] = BOTH_SIZE,
) -> Figure:
    """Return what `draw` puts on two axes side by side; its narrow cut has the second below."""
    wide = plot.svg(lambda f: draw(list(f.subplots(1, 2))), size)
    narrow = plot.svg(lambda f: draw(list(f.subplots(2, 1))), (NARROW_WIDTH, 1.7 * NARROW_WIDTH))
    return Figure(name, wide, alt, caption, narrow=narrow)


def figures(subject: Subject) -> tuple[dict[str, list[Figure]], list[tuple[str, str]]]:
    """Return the figures of a subject in each part of its page.

    And the titles of those it has not, each with the reason.
    """
    drawn: dict[str, list[Figure]] = {part: [] for part in (IN_PRINCIPLE, IN_MOTION, IN_CHECK)}
    without = []
    for title, part, unless, made in FIGURE_KINDS:
        reason = next((why for holds, why in unless if holds(subject)), "")
        if reason is None:
            continue
        if not reason:
            try:
                drawn[part].append(made(subject))
                continue
            except ValueError as error:
                reason = f"{str(error)[0].upper()}{str(error)[1:]}."
        without.append((say(title), say(reason)))
    return drawn, without


# -- rules: what keeps a subject from having a figure, and why ---------------------------------

IF_FORCED: Rule = (
    lambda s: s.has_forces,
    "A force stands beside the Lagrangian: its motion is not where the action is stationary.",
)
IF_DRAGGED: Rule = (
    lambda s: s.dissipates,
    "A force takes energy from the motion: H falls, as the energy function shows.",
)
IF_DRIVEN: Rule = (
    lambda s: s.has_forces,
    "A force stands beside the Lagrangian, whose work is neither in T nor in V.",
)
IF_BENT: Rule = (
    lambda s: s.solution.problem.system.order > 1,
    "Neighbours of paths whose Lagrangian contains accelerations are not drawn yet.",
)
IF_HELD: Rule = (
    lambda s: bool(s.between) or s.solution.problem.integral is not None,
    "Neighbours of paths with events between their ends, or a given integral, are not drawn yet.",
)
IF_LENGTH: Rule = (
    lambda s: s.scene.measure is not None,
    "The Lagrangian is no kinetic energy less a potential one.",
)
IF_MOVING: Rule = (
    lambda s: s.energies.moving,
    "What is taken from T here depends on the velocities, and so is no potential energy.",
)
IF_SEVERAL: Rule = (
    lambda s: s.freedom > 1,
    "With several degrees of freedom the landscape tells more.",
)
IF_NOT_PLANE: Rule = (
    lambda s: not s.plane,
    "Neighbouring paths of several coordinates do not fit in one plane.",
)
IF_CONSTRAINED: Rule = (
    lambda s: bool(s.solution.problem.system.m),
    "Fronts need places all around the path, and a constraint leaves only a surface.",
)
IF_IN_CONTACT: Rule = (
    lambda s: s.touches,
    "Where a path touches an obstacle, there are neighbours on one side of it only.",
)
IF_TOUCHING: Rule = (
    lambda s: s.touches,
    "A motion from its start knows of no obstacle, and leaves the path where they meet.",
)
UNLESS_TOUCHING: Rule = (lambda s: not s.touches, None)
IF_ALONE = IF_FORCED, IF_BENT, IF_HELD, IF_IN_CONTACT  # no neighbours to be drawn


# -- figures ---------------------------------------------------------------------------------

Draw = Callable[[Subject, Any], tuple[str, str]]
FIGURE_KINDS: list[tuple[str, str, tuple[Rule, ...], Callable[[Subject], Figure]]] = []
IN_PRINCIPLE, IN_MOTION, IN_CHECK = "principle", "motion", "check"  # where a figure stands


def _kind(
    title: str, part: str, *unless: Rule, size: tuple[float, float] = ONE_SIZE
) -> Callable[[Draw], None]:
    """Make the decorated function a kind of figure, the file of its own name, in a part of pages.

    It draws a subject on an empty matplotlib figure of the shape of `size` (inches), as narrow as
    a phone or a column of three, and returns its alt text and a caption with its numbers, which the
    scene's own words on it precede. Its titles are left out: the page has its own. Subjects to
    which one of the rules `unless` applies have no such figure.
    """

    def add(draw: Draw) -> None:
        name = draw.__name__.strip("_")

        def make(subject: Subject) -> Figure:
            said: list[tuple[str, str]] = []

            def draw_untitled(figure: Any) -> None:
                said.append(draw(subject, figure))
                for ax in figure.axes:
                    ax.set_title("")

            svg = plot.svg(draw_untitled, cut(size))
            ((alt, caption),) = said
            own = typeset(say(subject.scene.words.captions.get(name, "")))
            words = " ".join(filter(None, (own, caption)))
            return Figure(name, svg, alt, words, say(title))

        FIGURE_KINDS.append((title, part, unless, make))

    return add


@_kind("The path among its neighbours", IN_PRINCIPLE, *IF_ALONE, IF_NOT_PLANE)
def _bundle(s: Subject, figure: Any) -> tuple[str, str]:
    plot.bundle(s.solution, figure.subplots(), units=s.units)
    rise = plot.bundle_data(s.solution).rise
    more, less = int((rise > 0).sum()), int((rise < 0).sum())
    alt = say(
        "The path {motion} in black among {count} neighbours between the same events; "
        "{more} of them cost more action and {less} less.",
        motion=s.motion, count=rise.size, more=more, less=less,
    )  # fmt: skip
    values = {
        "more": more,
        "less": less,
        "low": number(rise.min(), 3),
        "top": number(rise.max(), 3),
        "unit": s.units.action,
    }
    if not less:
        return alt, say(
            "All {more} neighbours cost more action than the path, by {low} to {top} {unit}.",
            **values,
        )
    return alt, say(
        "{more} neighbours cost more action than the path, up to {top} {unit} (vermilion); {less} "
        "cost less, down to {low} {unit} (blue): it is a saddle.",
        **values,
    )


@_kind("The action along two variations", IN_PRINCIPLE, *IF_ALONE, IF_SEVERAL)
def _slices(s: Subject, figure: Any) -> tuple[str, str]:
    plot.slices(s.solution, figure.subplots(), units=s.units)
    least = s.solution.kind == "minimum"
    alt = "The action along two variations of the path: both rise like bowls."
    other = "The action along two variations of the path: the first falls both ways."
    curvature = plot.spectrum_data(s.solution).eigenvalues[:2, -1]
    return (
        f"{say(alt if least else other)} {_index(s)}",
        say(
            "At the path, in the middle, both slopes are zero: that is all stationary means. "
            "The curvatures, {a} and {b} in units of a free particle's first, tell whether it "
            "is least.",
            a=number(curvature[0], 3), b=number(curvature[1], 3),
        ),
    )  # fmt: skip


def landscape_reach(solution: Solution) -> float:
    """Return how far a landscape goes that keeps from where L is infinite.

    It is halved where the range of S grows by more than the sixth power of the reach.
    """
    reach, low = WIDEST_LANDSCAPE, None
    for _ in range(LANDSCAPE_HALVINGS):
        far = low or float(np.nanmax(np.abs(plot.landscape_data(solution, reach, 9).rise)))
        low = float(np.nanmax(np.abs(plot.landscape_data(solution, reach / 2, 9).rise)))
        if far <= 2**6 * low:
            break
        reach /= 2
    return reach


@_kind("The action as a landscape", IN_PRINCIPLE, *IF_ALONE)
def _landscape(s: Subject, figure: Any) -> tuple[str, str]:
    reach = landscape_reach(s.solution)
    plot.landscape(s.solution, figure.subplots(), reach=reach, units=s.units)
    rise = plot.landscape_data(s.solution, reach).rise
    values = {"low": number(-rise.min(), 3), "top": number(rise.max(), 3), "unit": s.units.action}
    if s.solution.kind == "minimum":
        alt = "Contours of the action over two variations; the path is at the bottom of a bowl."
        words = "The path lies at the bottom of a bowl, whose rim here is up to {top} {unit} high."
    else:
        alt = "Contours of the action over two variations; the path is on a pass."
        words = (
            "The path lies on a pass: the action falls by up to {low} {unit} one way and rises by "
            "up to {top} {unit} the other."
        )
    return f"{say(alt)} {_index(s)}", say(words, **values)


def _index(s: Subject) -> str:
    kind, index = say(s.solution.kind), s.solution.morse_index
    return say("The path is a {kind} of Morse index {index}.", kind=kind, index=index)


@_kind("Paths from one event", IN_PRINCIPLE, *IF_ALONE, IF_NOT_PLANE)
def _fan(s: Subject, figure: Any) -> tuple[str, str]:
    plot.fan(s.solution, figure.subplots(), units=s.units)
    data = plot.fan_data(s.solution)
    ends = data.neighbours[:, :, -1]  # NaN of those that run away
    apart = float(np.nanmax(np.linalg.norm(ends - data.q[:, -1], axis=1)))
    unit = s.units.coordinate(s.solution.problem.system.coordinates[0])
    values = {"foci": s.foci, "apart": number(apart, 3), "unit": unit}
    words = (
        "Motions that set out a little differently, up to {apart} {unit} apart in the end; {foci}."
    )
    return (
        say(
            "Motions that leave the start with slightly different velocities, {motion}; {foci}.",
            motion=s.motion,
            foci=s.foci,
        ),
        say(words, **values),
    )


@_kind("The second variation as the path grows", IN_PRINCIPLE, *IF_ALONE)
def _spectrum(s: Subject, figure: Any) -> tuple[str, str]:
    plot.spectrum(s.solution, figure.subplots(), units=s.units)
    index = s.solution.morse_index
    last = float(plot.spectrum_data(s.solution).eigenvalues[0, -1])
    alt = say(
        "The three lowest eigenvalues of the second variation against the duration; {foci}. "
        "{index} of all are negative at the full duration.",
        foci=s.foci, index=index,
    )  # fmt: skip
    least = "The lowest eigenvalue is {last} at the full duration, and so all are above zero."
    pass_ = "One eigenvalue has passed zero by the full duration, down to {last}: one way down."
    saddle = (
        "{index} of the eigenvalues have passed zero by the full duration, the lowest down to "
        "{last}: as many independent ways down."
    )
    words = (least, pass_, saddle)[min(index, 2)]
    return alt, say(words, index=index, last=number(last, 3))


@_kind("The motion, as a strobe would show it", IN_MOTION)
def _motion(s: Subject, figure: Any) -> tuple[str, str]:
    plot.motion(s.solution, s.scene.draw, figure.subplots(), force=s.arrows, units=s.units)
    alt = say("{title}, at nine equal times {motion}.", title=say(s.scene.title), motion=s.motion)
    if not s.units.time:
        return alt, ""
    step = number(s.duration / 8, 3)
    return alt, say("{step} s from each picture to the next.", step=step)


@_kind("The obstacle, and what it presses with", IN_MOTION, UNLESS_TOUCHING, size=(6.4, 6.0))
def _contact(s: Subject, figure: Any) -> tuple[str, str]:
    plot.overview(s.solution, figure.subplots(2, height_ratios=(3, 2)), units=s.units)
    unit = f" {s.units.time}".rstrip()
    parts = ", ".join(
        say("from {a} to {b}", a=number(arc.begin, 3), b=f"{number(arc.end, 3)}{unit}")
        for arc in s.solution.contacts
    )
    most = number(float(s.solution.contact_force(s.t).max()), 3)
    alt = say(
        "Above, the path {motion}; below, the contact force against time, {most} at most; contact "
        "{parts}.",
        motion=s.motion, most=most, parts=parts,
    )  # fmt: skip
    return alt, say("Contact {parts}; elsewhere the force is zero.", parts=parts)


@_kind("Kinetic and potential energy", IN_MOTION, IF_DRAGGED, IF_DRIVEN, IF_LENGTH, IF_MOVING)
def _energies(s: Subject, figure: Any) -> tuple[str, str]:
    plot.energies(s.solution, figure.subplots(), kinetic=s.scene.kinetic, units=s.units)
    T, V, t = s.energies.kinetic, s.energies.potential, s.energies.t
    size = float(np.trapezoid(np.abs(T) + np.abs(V), t))
    under = [float(np.trapezoid(x, t)) for x in (T, V)]
    kinetic, potential = (number(x if abs(x) > ZERO_RANGE * size else 0.0, 4) for x in under)
    values = {
        "kinetic": kinetic,
        "potential": potential,
        "action": number(s.solution.action, 4),
    }
    return (
        say(
            "Kinetic energy {T} and potential energy {V} against time; the area between them, "
            "counted negative where V is larger, is the action {S} J s.",
            T=span(T, "J"), V=span(V, "J"), S=f"{s.solution.action:.6g}",
        ),
        say(
            "The area under T, {kinetic} J s, less the area under V, {potential} J s, is the "
            "action, {action} J s.",
            **values,
        ),
    )  # fmt: skip


@_kind("Energy function and momenta", IN_MOTION, size=(6.4, 5.4))
def _conserved(s: Subject, figure: Any) -> tuple[str, str]:
    plot.conserved(s.solution, figure.subplots(2, sharex=True), units=s.units)
    data = plot.conserved_data(s.solution)
    order, coordinates = s.solution.problem.system.order, s.solution.problem.system.coordinates
    dashes = ["'" * k for k in range(order)]
    names = ["H", *(letter(name) + dash for dash in dashes for name in coordinates)]
    rows = list(zip(names, data.flat, data.kept, strict=True))
    kept = ", ".join(name for name, _, kept in rows if kept) or say("none of them")
    only = ", ".join(name for name, flat, kept in rows if flat and not kept)
    said = say("conserved: {names}", names=kept)
    if only:
        said += "; " + say("constant on this path alone: {names}", names=only)
    rates = s.solution.derivatives(data.t)[1 : s.solution.problem.system.order + 1]
    size = float(np.max(np.abs(data.momentum * np.concatenate(rates)))) if data.flat[0] else 0
    H = span(data.energy, s.units.energy, size)
    alt = say("Energy function H, {H}, and momenta against time; {said}.", H=H, said=said)
    return alt, say("H {span}.", span=H)


@_kind("Fronts of equal action", IN_MOTION, *IF_ALONE, IF_NOT_PLANE, IF_CONSTRAINED)
def _fronts(s: Subject, figure: Any) -> tuple[str, str]:
    plot.wavefronts(s.solution, figure.subplots(), units=s.units)
    alt = say(
        "Lines of equal action from the start, and motions that leave it in other directions; the "
        "path goes {motion}.",
        motion=s.motion,
    )
    action = say(
        "On the path S is {action} {unit} in the end.",
        action=number(s.solution.action, 4),
        unit=s.units.action,
    )
    return alt, f"{fronts_caption(s)} {action}"


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
        return say(_FRONTS["time"])
    return say(_FRONTS["along" if is_aligned(s.solution.momentum(s.t), s.v) else "askew"])


@_kind("The path, and the motion integrated forward", IN_CHECK, IF_TOUCHING, size=(6.4, 6.0))
def _path(s: Subject, figure: Any) -> tuple[str, str]:
    plot.overview(s.solution, figure.subplots(2, height_ratios=(3, 2)), units=s.units)
    found = s.solution.compare()
    most = found.reason or say("at most {x}", x=number(found.position, 2))
    alt = say(
        "Above, the path {motion}, action {action} {unit}, with the forward integration over it; "
        "below, their deviation on a logarithmic axis, {most}, beside an error estimate of "
        "{error}.",
        motion=s.motion, action=f"{s.solution.action:.8g}", unit=s.units.action, most=most,
        error=number(s.solution.error, 2),
    )  # fmt: skip
    law = (
        "The equations of Lagrange and d'Alembert, with the force, integrated from its start, "
        "lead to the same events: they differ by {most} of its size."
        if s.has_forces
        else "The equations of motion, integrated from its start, lead the same way: they differ "
        "by {most} of its size."
    )
    difference = say("at most {x}", x=number(found.position, 2))
    return alt, say(law, most=escape(found.reason) or difference)


@_kind("How it was computed", IN_CHECK, size=(6.4, 5.2))
def _mesh(s: Subject, figure: Any) -> tuple[str, str]:
    plot.mesh(s.solution, figure.subplots(2, sharex=True, height_ratios=(3, 2)), units=s.units)
    mesh = s.solution.mesh
    low, high = min(mesh.degrees), max(mesh.degrees)
    degrees = (
        say("of degree {low}", low=low)
        if low == high
        else say("of degrees {low} to {high}", low=low, high=high)
    )
    values = {"elements": mesh.elements, "degrees": degrees}
    alt = say(
        "The coordinates with the nodes on them, {elements} elements {degrees}; estimated error "
        "{error}.",
        error=number(s.solution.error, 2), **values,
    )  # fmt: skip
    return alt, say(
        "One polynomial {degrees}, {nodes} nodes; the estimated error is {error}."
        if mesh.elements == 1
        else "{elements} polynomials {degrees}, {nodes} nodes; the estimated error is {error}.",
        nodes=mesh.nodes.size, error=number(s.solution.error, 2), **values,
    )  # fmt: skip
