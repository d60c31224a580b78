"""T and V against time: the action is the area under T less the area under V; H and momenta."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from actionopt.analysis.solution import Solution
from actionopt.plot import _style as style
from actionopt.plot._names import NO_UNITS, UnitNames, label, symbol
from actionopt.plot.data.along import Kinetic, conserved_data, energies_data
from actionopt.plot.data.arguments import check_arguments
from actionopt.tools.words import number, say


@style.styled
@check_arguments
def energies(
    solution: Solution,
    ax: Axes | None = None,
    *,
    kinetic: Kinetic | None = None,
    units: UnitNames = NO_UNITS,
) -> Axes:
    """Draw T and V, and between them the areas whose difference is S.

    `kinetic(q, v, t)` is T in a frame at rest, as a scene's `kinetic` is. L alone does not tell
    it: without, its part quadratic in the velocities is drawn, and the effective potential.
    """
    data = energies_data(solution, kinetic=kinetic)
    T_name, V_name = "T", "U(\\dot q)" if data.moving else "V"
    T_text, V_text = "$T$", f"${V_name}$"
    fixed = not solution.problem.system.structure.depends_on_time
    if not (data.told or (data.quadratic and fixed and not data.moving)):
        subscript = "2" if data.quadratic else "+"
        T_name, V_name = f"T_{subscript}", V_name.replace(V_name[0], f"{V_name[0]}_\\mathrm{{eff}}")
        T_text = f"${T_name}$, " + say(
            "part of $L$ quadratic in $\\dot q$"
            if data.quadratic
            else "part of $L$ even in $\\dot q$"
        )
        V_text = f"${V_name}$, " + say("effective potential")
    elif not data.told:
        V_text += ", " + say("if $L = T - V$")
    t, T, V = data.t, data.kinetic, data.potential
    ax = style.on(ax)
    for where, colour, text in (
        (T >= V, style.BLUE, say("adds to $S$")),
        (V > T, style.VERMILION, say("takes from $S$")),
    ):
        if where.any():
            look: Any = {"color": colour, "alpha": 0.22, "linewidth": 0, "label": text}
            ax.fill_between(t, T, V, where=where, interpolate=True, **look)
    for values, look, text in (
        (T, {"color": style.BLUE, "linewidth": 2.2}, T_text),
        (V, style.POTENTIAL, V_text),
    ):
        ax.plot(*style.break_at_events(t, values, solution), **look, label=text)
    style.mark_events(ax, solution)
    ax.set(xlabel=label(units.clock, units.time), ylabel=label("energy", units.energy))
    S = f"{number(solution.action)} {units.action}".rstrip()
    style.set_title(ax, solution, f"$S = \\int ({T_name} - {V_name})\\,dt$ = {S}")
    ax.margins(x=0)
    style.legend_above(ax, 4 if data.told else 2)
    return ax


@style.styled
@check_arguments
def conserved(
    solution: Solution, axes: Sequence[Axes] | None = None, *, units: UnitNames = NO_UNITS
) -> tuple[Axes, Axes]:
    """Draw the energy above the momenta; what stays the same is a broad straight line.

    Conserved is what a symmetry keeps, along every motion; else it is constant on this path. Where
    the plane of x and y may be turned, the angular momentum is drawn with the momenta.
    """
    data, names = conserved_data(solution), solution.problem.system.coordinates
    if axes is None:
        axes = style.new_figure((6.4, 5.4)).subplots(2, sharex=True)
    above, below = style.unpack(axes, 2)
    # An index of an index would be too small to read.
    dashes = ["'" * k for k in range(solution.problem.system.order)]
    indices = [symbol(name)[1:-1].replace("_", "") + dash for dash in dashes for name in names]
    whats = ["$H$", *(f"$p_{{{index}}}$" for index in indices)]
    rows = zip(whats, [data.energy, *data.momentum], data.flat, data.kept, strict=True)
    for i, (what, values, flat, kept) in enumerate(rows):
        if flat:
            what = say("{p}, conserved" if kept else "{p}, constant\non this path", p=what)
        look = {**style.strand(i), "linewidth": 3.2 if flat else 1.6}
        ax = below if i else above
        ax.plot(*style.break_at_events(data.t, values, solution), **look, label=what)
    if data.angular is not None:
        what = say("{p}, conserved", p=say("angular momentum"))
        below.plot(data.t, data.angular, color=style.GREY, linewidth=3.2, label=what)
    above.set_ylabel(label("energy function $H$", units.energy))
    turned = [] if data.angular is None else [units.action]
    below.set_ylabel(label("momenta $p$", *map(units.momentum, names), *turned))
    below.set_xlabel(label(units.clock, units.time))
    above.set_title(say("{name}: energy and momenta along the path", name=style.heading(solution)))
    rates = np.concatenate(solution.derivatives(data.t)[1 : len(dashes) + 1])
    work = float(np.max(np.abs(data.momentum * rates)))
    for ax, least in ((above, work * data.flat[0]), (below, 0.0)):
        ax.margins(x=0)
        _no_magnified_rounding(ax, least)
        style.mark_events(ax, solution)
        style.legend(ax, beside=True)
    return above, below


def _no_magnified_rounding(ax: Axes, least: float = 0.0) -> None:
    """Leave room around lines that are all but constant, of a size of `least` or more."""
    low, high = ax.get_ylim()
    size = max(abs(low), abs(high), least) or 1.0
    if high - low < 0.2 * size:
        middle = (low + high) / 2
        ax.set_ylim(middle - 0.25 * size, middle + 0.25 * size)
