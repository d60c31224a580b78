"""Find the symmetries of a Lagrangian: all transformations affine in q and t that preserve S.

`noether` (in the module of that name) says what a symmetry conserves, `cyclic` finds those that
show in the coordinates, and `find_symmetries` those that do not.
"""

from __future__ import annotations

from collections.abc import Mapping

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from actionopt.mechanics.canonical import jet_of
from actionopt.mechanics.conservation.noether import (
    Conserved,
    beyond,
    change,
    cyclic,
    euler,
    is_mechanical,
    noether,
    points_of,
)
from actionopt.mechanics.laws.identity import GENERIC
from actionopt.mechanics.system import System, check_system
from actionopt.tools.immutable import immutable
from actionopt.tools.types import Array
from actionopt.tools.watch import check_time

__all__ = ["Conserved", "Symmetry", "cyclic", "find_symmetries", "is_mechanical", "noether"]

# Confessed. What is found is verified by `noether`: a wrong guess loses a symmetry, and makes none.
SYMMETRY_RANK = 1e-11  # singular values below this fraction of the largest are zero
# Seconds that a search takes, over the cube of its unknowns. Measured of 30 coordinates.
SYMMETRY_SECONDS = 2e-9
PIVOT = 1e-6  # entries below this are zero in vectors of size one
INTEGER = 1e-9  # entries this near to an integer are that integer


@immutable
class Symmetry:
    """A symmetry affine in q and t: xi = b + c t + A q and tau = time + rate t.

    Attributes
    ----------
    A : (n, n) array
        Rotations, scalings, shears.
    b, c : (n,) arrays
        Translations, and boosts.
    time, rate : float
        Translation and scaling of time.
    conserved : Conserved
        What it conserves.
    names : tuple of str
        Names of the coordinates.
    """

    A: Array
    b: Array
    c: Array
    time: float
    rate: float
    conserved: Conserved
    names: tuple[str, ...]

    def __call__(self, q: ArrayLike, t: float) -> Array:
        """Return xi at q (n,) and one time t."""
        return self.b + self.c * t + self.A @ np.asarray(q, dtype=float)

    def __repr__(self) -> str:
        """Show what moves."""
        return f"Symmetry({self})"

    def __str__(self) -> str:
        """Return what moves, as in "x: -y, y: x"."""
        rows = {
            name: [(b, ""), (c, "t"), *zip(row, self.names, strict=True)]
            for name, b, c, row in zip(self.names, self.b, self.c, self.A, strict=True)
        }
        rows["t"] = [(self.time, ""), (self.rate, "t")]
        moved = ((name, _sum(terms)) for name, terms in rows.items())
        return ", ".join(f"{name}: {terms}" for name, terms in moved if terms)


def find_symmetries(
    system: System, *, parameters: Mapping[str, ArrayLike] | None = None
) -> tuple[Symmetry, ...]:
    """Return a basis of all symmetries affine in q and t: translations, rotations, boosts, ...

    R is linear in the n^2 + 2 n + 2 coefficients of xi and tau. It is a total derivative where
    R_q - d/dt R_v + ... vanishes identically, so that the coefficients of symmetries are the common
    null space of that expression's values at points in general position. Each one found is
    verified as `noether` does, and has its conserved quantity. With constraints, the symmetries
    are those of L off their surface as well.

    Parameters
    ----------
    system : System
    parameters : mapping, optional
        Numbers in place of the defaults; there may be more symmetries for some than for others.

    References
    ----------
    Olver, *Applications of Lie Groups to Differential Equations* (2nd ed. 1993), section 4.4.
    """
    check_system(system).check_free("what is conserved without it may change in contact")
    if system.m:
        system.check_order("a search for symmetries under constraints")
    s, n, place = system.symbols, system.n, system.place
    c = ca.SX.sym("c", n * (n + 2) + 2)
    check_time(SYMMETRY_SECONDS * c.numel() ** 3)
    xi = c[:n] + c[n + 1 : 2 * n + 1] * s.t + ca.reshape(c[2 * n + 1 : -1], n, n) @ place
    tau = c[n] + c[-1] * s.t
    R = ca.sum2(change(system, xi, tau))
    rows = [sum(euler(system, R), ca.SX.zeros(n))]
    if system.m:
        rows.append(system.derivatives.G @ xi + ca.jacobian(system.f, s.t) * tau)
    # It does not depend on c, which stays an argument where the derivative of a function is called.
    matrix = ca.substitute(ca.jacobian(ca.vertcat(*rows), c), c, ca.SX.zeros(c.numel()))
    packed = system.table.pack(system.table.values(parameters))
    count = max(GENERIC, 3 * c.numel() // n)
    q, v, t = points_of(system, packed, count)
    higher = ca.vertcat(*jet_of(system)[system.order + 1 :])
    function = ca.Function("matrix", [s.q, s.v, higher, s.t, s.p], [ca.densify(matrix)]).map(len(q))
    p = np.broadcast_to(packed, (len(q), packed.size))
    values = np.asarray(function(q.T, v.T, beyond(system, q, v).T, t.T, p.T))
    equations = values.reshape(matrix.shape[0], len(q), -1).reshape(-1, c.numel())
    equations = equations[np.isfinite(equations).all(axis=1)]
    size = np.max(np.abs(equations), axis=1, initial=0.0, keepdims=True)
    equations = equations / np.where(size > 0, size, 1.0)
    result = []
    for x in _echelon(_null_space(equations)):
        b, boost, A = x[:n], x[n + 1 : 2 * n + 1], x[2 * n + 1 : -1].reshape(n, n, order="F")

        def generator(q, t, b=b, boost=boost, A=A):
            return [b[i] + boost[i] * t + ca.dot(A[i], q) for i in range(n)]

        try:
            conserved = noether(
                system,
                generator,
                time=lambda t, x=x: x[n] + x[-1] * t,
                parameters=parameters,
            )
        except ValueError:
            continue  # one that only holds to rounding of the null space
        result.append(
            Symmetry(A, b, boost, float(x[n]), float(x[-1]), conserved, system.coordinates)
        )
    return tuple(result)


def _null_space(equations: Array) -> Array:
    """Return an orthonormal basis of the null space, one row a vector."""
    if len(equations) > equations.shape[1]:  # which has the same one, and is smaller
        equations = np.asarray(np.linalg.qr(equations, mode="r"))
    _, values, right = np.linalg.svd(equations)
    rank = int(np.sum(values > SYMMETRY_RANK * max(values[0], np.finfo(float).tiny)))
    return right[rank:]


def _echelon(rows: Array) -> Array:
    """Return the reduced row echelon form: each vector has a one where all others have zero."""
    rows, done = rows.copy(), 0
    for k in range(rows.shape[1]):
        if done == len(rows):
            break
        pivot = done + int(np.argmax(np.abs(rows[done:, k])))
        if abs(rows[pivot, k]) < PIVOT * np.max(np.abs(rows[pivot])):
            continue
        rows[[done, pivot]] = rows[[pivot, done]]
        rows[done] /= rows[done, k]
        others = np.arange(len(rows)) != done
        rows[others] -= rows[others, k][:, None] * rows[done]
        done += 1
    whole = np.round(rows)
    return np.where(np.abs(rows - whole) < INTEGER, whole, rows) + 0.0


def _sum(terms) -> str:
    """Return a sum as text, as in "2 x - y"."""
    text = ""
    for factor, name in terms:
        if factor:
            size = f"{abs(factor):g}"
            body = " ".join(filter(None, ["" if size == "1" and name else size, name]))
            sign = " - " if factor < 0 else " + "
            text += sign + body if text else sign.strip(" +") + body
    return text
