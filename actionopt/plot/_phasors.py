"""The sum over paths: neighbours coloured by their phase, and their arrows end to end."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize

from actionopt.analysis.solution import Solution
from actionopt.plot import _style as style
from actionopt.plot._names import NO_UNITS, UnitNames, label
from actionopt.plot.data.arguments import check_arguments
from actionopt.plot.data.phasors import WHOLE_ARROWS, phasors_data
from actionopt.tools.words import say

PHASOR_SIZE = (12.6, 4.2)


@style.styled
@check_arguments
def phasors(
    solution: Solution,
    hbar: float,
    axes: Sequence[Axes] | None = None,
    *,
    mode: int = 0,
    coordinate: int | None = None,
    units: UnitNames = NO_UNITS,
) -> list[Axes]:
    """Draw the sum over neighbouring paths, an arrow exp(i S / hbar) for each, in three panels.

    The path among its neighbours along a mode of d2S, coloured by their phase; the real part of
    the arrows against the size of the variation; and the arrows laid end to end, with their sum
    and sqrt(2 pi i hbar / S''), which it tends to for small hbar. Raises ValueError as
    `phasors_data` does.
    """
    data, names = phasors_data(solution, hbar, mode=mode), solution.problem.system.coordinates
    at = style.coordinate_to_show(solution, coordinate)
    if axes is None:
        figure = style.new_figure(PHASOR_SIZE)
        axes = list(figure.subplots(1, 3, width_ratios=(1.25, 1, 1)))
    near, along, spiral = style.unpack(axes, 3)
    circle = style.circle()
    for q, phase in zip(data.varied, data.phase, strict=True):
        style.draw(near, names, data.t, q, at, color=circle(phase / (2 * np.pi) % 1), linewidth=1.4)
    style.draw(near, names, data.t, data.q, at, say("stationary path"), **style.true())
    style.frame(near, solution, units, at)
    turn = ScalarMappable(Normalize(0, 360), circle)
    bar = near.figure.colorbar(turn, ax=near, ticks=[0, 90, 180, 270, 360])
    bar.set_label(label(r"phase $(S - S^*)/\hbar$ (degrees)"))
    style.set_title(near, solution, style.kind(solution))

    step = data.alpha[1] - data.alpha[0]
    along.plot(data.alpha, np.real(data.arrows) / step, color=style.BLUE, linewidth=1.2)
    alike = np.sqrt(np.pi * hbar / (2 * abs(data.second)))  # where the phase is a quarter of pi
    along.axvspan(-alike, alike, color=style.ORANGE, alpha=0.25, linewidth=0)
    along.set_xlabel(label(r"variation $\alpha$ (of the path's size)"))
    along.set_ylabel(label(r"$\cos((S - S^*)/\hbar)$, shorter at the ends"))
    along.set_title(say("near the stationary path\nthey agree"))
    along.set_xlim(*(1.6 * WHOLE_ARROWS * data.alpha[[0, -1]]))

    spiral.plot(np.real(data.ends), np.imag(data.ends), color=style.BLUE, linewidth=1.1)
    for value, look in ((data.sum, style.VERMILION), (data.expected, style.ink())):
        first = look == style.VERMILION
        spiral.annotate(
            "", (value.real, value.imag), (0.0, 0.0),
            arrowprops={"arrowstyle": "-|>", "color": look, "linewidth": 3 if first else 1.2,
                        "linestyle": "-" if first else "--", "shrinkA": 0, "shrinkB": 0},
        )  # fmt: skip
    spiral.plot([], [], color=style.VERMILION, linewidth=3, label=say("sum"))
    text = r"$\sqrt{2\pi i\hbar/S''}$"
    spiral.plot([], [], color=style.ink(), linestyle="--", linewidth=1.2, label=text)
    spiral.set(aspect="equal", adjustable="datalim")
    spiral.set_xlabel(label("real part"))
    spiral.set_ylabel(label("imaginary part"))
    turned = f"{np.degrees(np.angle(data.sum)):+.0f}".replace("-", "\N{MINUS SIGN}")
    spiral.set_title(say("end to end: turned by {angle}", angle=f"{turned}\N{DEGREE SIGN}"))
    style.legend(spiral)
    return list(axes)
