"""Jacobi's elliptic functions by the arithmetic-geometric mean, to rounding.

Abramowitz and Stegun, *Handbook of Mathematical Functions* (1964), 16.4, 17.3 and 17.6.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from actionopt.tools.types import Array


def _means(k: float) -> list[tuple[float, float]]:
    """Return the rows (a_j, c_j) of the descending scale that starts from a = 1, c = k."""
    if not 0.0 < k < 1.0:
        raise ValueError(f"expected an elliptic modulus k between 0 and 1, found {k}")
    a, b, c = 1.0, float(np.sqrt((1.0 - k) * (1.0 + k))), float(k)
    rows = [(a, c)]
    while c > 1e-17:
        a, b = (a + b) / 2, float(np.sqrt(a * b))
        c = c * c / (4 * a)  # half the difference of the last a and b, free of cancellation
        rows.append((a, c))
    return rows


def complete(k: float) -> float:
    """Return the complete elliptic integral of the first kind K, k the modulus. A&S 17.6.3."""
    return float(np.pi / 2 / _means(k)[-1][0])


def jacobi(u: ArrayLike, k: float) -> tuple[Array, Array, Array, Array]:
    """Return sn u, cn u, dn u and the integral of dn^2 from 0 to u, each of the shape of u.

    u is real and k, the modulus, between 0 and 1 (ValueError otherwise). A&S 16.4.2-4 for the
    functions; E(u) = (E / K) u + sum c_j sin(phi_j) for the integral, 17.6.4 and 17.6.10.
    """
    rows = _means(k)
    last = rows[-1][0]
    phi = 2.0 ** (len(rows) - 1) * last * np.asarray(u, dtype=float)
    defect = sum(2.0 ** (j - 1) * c * c for j, (_, c) in enumerate(rows))  # 1 - E / K
    integral = (1.0 - defect) * np.asarray(u, dtype=float)
    for a, c in reversed(rows[1:]):
        integral = integral + c * np.sin(phi)
        phi = (phi + np.arcsin(c / a * np.sin(phi))) / 2
    sn, cn = np.sin(phi), np.cos(phi)
    return sn, cn, np.sqrt(cn**2 + (1.0 - k) * (1.0 + k) * sn**2), integral
