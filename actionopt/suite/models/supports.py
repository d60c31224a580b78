"""Where to put supports under a beam: the largest contact force is to be least."""

from __future__ import annotations

import casadi as ca
import numpy as np

from actionopt.suite.models.model import KnownAnswer, WrittenModel

NEAREST_SUPPORT = 0.1  # of an outer support to the middle
MOST_LOAD = 10.0  # with which a is 0.17: beyond 19 it would be nearer than that


def beam_on_supports(*, load: float = 0.0) -> WrittenModel:
    """Return where to support a beam so that the largest of three contact forces is least.

    It is from -1 to 1, elastic, and its weight 2; a `load` lies on the middle, over the second
    support. The others are at distances a to the left, b to the right, of its height. Unknowns are
    a, b, the forces and the largest of them. By Clapeyron's theorem of three moments, which are
    M1 = -(1 - a)^2/2, M3 = -(1 - b)^2/2 from the beam's ends, and M2 = b F3 - 1/2,

        a M1 + 2 (a + b) M2 + b M3 = -(a^3 + b^3)/4.

    The largest of the forces is not less than their mean. All are the same only if a = b, with
    3 a^2 - (28 + 8 load) a + 18 = 0, which has one solution up to 1.

    Source: B. P. E. Clapeyron, C. R. Acad. Sci. Paris 45 (1857), 1076-1080.
    """
    if not 0 <= load <= MOST_LOAD:
        raise ValueError(f"expected a load of 0 to {MOST_LOAD}, found {load!r}")
    a, b, most, F = ca.SX.sym("a"), ca.SX.sym("b"), ca.SX.sym("most"), ca.SX.sym("F", 3)
    first, middle, last = -((1 - a) ** 2) / 2, b * F[2] - 0.5, -((1 - b) ** 2) / 2
    moments = a * first + 2 * (a + b) * middle + b * last + (a**3 + b**3) / 4
    rows = ca.vertcat(ca.sum1(F) - 2 - load, b * F[2] - a * F[0], moments, F - most)
    half, mean = 14 + 4 * load, (2 + load) / 3

    def equal_forces() -> KnownAnswer:
        place = 18 / (half + np.sqrt(half**2 - 54))
        x = np.array([place, place, *np.full(4, mean)])
        lam = np.array([-1, 0, 0, 1, 1, 1]) / 3
        return KnownAnswer(x, lam, "closed form: no largest force is below the mean")

    none = np.full(4, np.inf)
    return WrittenModel(
        "beam_on_supports",
        ca.vertcat(a, b, F, most),
        most,
        rows,
        bounds=(np.append([NEAREST_SUPPORT, NEAREST_SUPPORT], -none), np.append([1.0, 1.0], none)),
        rows=(np.append(np.zeros(3), -none[:3]), 0.0),
        unit=np.append([1.0, 1.0], np.full(4, mean)),
        names=("a", "b", "F1", "F2", "F3", "most"),
        start=np.array([0.9, 0.9, *np.full(3, mean), 2 * mean]),
        answer=equal_forces,
        tags=("min-max",),
    )
