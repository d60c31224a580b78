r"""The sum over neighbouring paths: an arrow exp(i S / hbar) for each, laid end to end.

Along one variation, q + alpha eta, the sum of arrows is the integral

    I = int exp(i (S(alpha) - S*) / hbar) dalpha  ->  sqrt(2 pi i hbar / S''),    hbar -> 0

with S'' the second variation: paths within about sqrt(hbar / |S''|) of the stationary one have
nearly its phase and add up, those farther away turn and cancel. Where S'' > 0 the sum is turned by
+45 degrees, where S'' < 0 by -45: by a quarter turn less for each unit of the index. Arrows get
shorter towards both ends of the range, smoothly, so that no end is seen in the sum.

References: Feynman and Hibbs, *Quantum Mechanics and Path Integrals* (1965), section 2-3; Gelfand
and Yaglom, J. Math. Phys. 1 (1960), p. 48; Schulman, *Techniques and Applications of Path
Integration* (1981), chapter 17, for the index.
"""

from __future__ import annotations

import numpy as np

from actionopt.analysis.solution import Solution
from actionopt.analysis.spectra.variation import variation
from actionopt.plot.data.along import CURVE_TIMES, times
from actionopt.plot.data.arguments import check_arguments
from actionopt.plot.data.variations import directions
from actionopt.tools.checks import number
from actionopt.tools.immutable import immutable
from actionopt.tools.shown import one_line
from actionopt.tools.types import Array

# Ad hoc: the sum for a quadratic S is then sqrt(2 pi i hbar / S'') to 4e-3. More turns come nearer,
# but reach farther, where other actions are no parabolas: the pendulum's is seen at hbar = 0.03.
END_TURNS = 6.0  # of the arrow at either end of the range
WHOLE_ARROWS = 0.3  # of the range, in which arrows have their whole length
COUNT_ARROWS = 481  # twenty a turn where they turn fastest
ARROWS_DRAWN = 41


@immutable
class Phasors:
    """Arrows along a mode of the second variation, K of them.

    Attributes
    ----------
    alpha : (K,) array
        Size of the variation, in units of how far the coordinates range.
    rise : (K,) array
        S(alpha) - S*.
    arrows : (K,) complex array
        exp(i rise / hbar) dalpha, shorter towards the ends.
    second : float
        S'', the second variation of the mode.
    expected : complex
        sqrt(2 pi i hbar / S''), what the sum tends to.
    index : int
        Of the path.
    t : (M,) array
    q : (n, M) array
        The stationary path.
    varied : (B, n, M) array
        Neighbours, at equal steps of alpha where arrows are whole.
    phase : (B,) array
        Their (S - S*) / hbar.
    """

    alpha: Array
    rise: Array
    arrows: Array
    second: float
    expected: complex
    index: int
    t: Array
    q: Array
    varied: Array
    phase: Array

    __repr__ = one_line

    @property
    def sum(self) -> complex:
        """All arrows, end to end."""
        return complex(np.sum(self.arrows))

    @property
    def ends(self) -> Array:
        """Where each arrow ends when they are laid end to end from zero, (K + 1,), complex."""
        return np.concatenate([[0.0], np.cumsum(self.arrows)])


@check_arguments
def phasors_data(solution: Solution, hbar: float, *, mode: int = 0) -> Phasors:
    """Return the arrows of neighbours along a mode of d2S, by default the lowest.

    `hbar` is in the unit of S. Raises ValueError unless it is positive and finite, for
    non-conservative forces, for a mode along which S does not change to second order, or where
    the neighbours reach where there are none: then a smaller hbar will do.
    """
    h = number(hbar, "hbar")
    if h <= 0:
        raise ValueError(f"expected hbar > 0, found {h:g}; it is measured in the unit of S")
    _, modes = directions(solution, mode + 1)
    if not 0 <= mode < len(modes):
        raise ValueError(f"expected one of {len(modes)} modes, counted from 0, found {mode}")
    S = variation(solution, modes[mode])
    second, index = S.second, solution.morse_index
    if solution.kind == "degenerate" or second == 0:
        raise ValueError(
            "expected an end that is not conjugate to the start, found that S does not change to "
            "second order; move the end time"
        )
    reach = float(np.sqrt(4 * np.pi * END_TURNS * h / abs(second)))
    alpha = np.linspace(-reach, reach, COUNT_ARROWS)
    rise = S(alpha) - float(S(0.0))
    if not np.all(np.isfinite(rise)):
        raise ValueError(
            f"expected an action for variations up to {reach:.3g} times the path's size, found "
            "none; try a smaller hbar"
        )
    arrows = np.exp(1j * rise / h) * _whole(alpha / reach) * (alpha[1] - alpha[0])
    t = times(solution, CURVE_TIMES // 2)
    near = reach * WHOLE_ARROWS * np.linspace(-1, 1, ARROWS_DRAWN)
    varied = np.array([S.path(a)(t) for a in near])
    expected = complex(np.sqrt(2j * np.pi * h / second))
    phase = (S(near) - float(S(0.0))) / h
    return Phasors(alpha, rise, arrows, second, expected, index, t, solution(t), varied, phase)


def _whole(x: Array) -> Array:
    """Return 1 for |x| <= WHOLE, falling smoothly to 0 at 1: with all derivatives."""
    s = np.clip((np.abs(x) - WHOLE_ARROWS) / (1 - WHOLE_ARROWS), 0.0, 1.0)
    with np.errstate(divide="ignore", over="ignore"):
        return 1 / (1 + np.exp(1 / (1 - s) - 1 / s)) * (s < 1)
