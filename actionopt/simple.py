"""The whole method once more, as a reader holds it: equal elements, full matrices, plain Newton.

Hamilton's principle: of all curves q(t) that join two events, a motion is one that makes the action

    S = int L(q, v, t) dt,    v = dq/dt,

stationary. To find it, time is cut into elements of equal length h. On each the curve is the
polynomial through its values q_k at d + 1 Legendre-Gauss-Lobatto nodes xi_k in [-1, 1], the first
and last of which are shared with the neighbours. Its velocities there are linear in the values, and
the action is summed with the weights w_k that belong to the nodes:

    S(Q) = sum_e h/2 sum_k w_k L(q_k, v_k, t_k),    v_k = 2/h sum_j D_kj q_j.

The curve is now a point Q with finitely many coordinates, and the principle a system of equations:
dS/dq = 0 for each of them that the events leave free. At an end that is free nothing more is said;
that the momentum vanishes there comes out by itself.

Constraints f(q, t) = 0 hold at the nodes. Their multipliers come with the same weights, and

    A(Q, lam) = S(Q) + C(Q, lam),    C = sum_e h/2 sum_k w_k lam_k . f(q_k, t_k),

is stationary in both, so that lam_k is lambda(t_k) of the equations of motion,
d/dt dL/dv - dL/dq = (df/dq)' lambda. Forces F(q, v, t) without a potential do the virtual work

    W = sum_e h/2 sum_k w_k F(q_k, v_k, t_k) . dq_k

in a displacement dq, and dS/dq + dC/dq + dW/d(dq) = 0 in place of dA/dq = 0 (d'Alembert).

`actionopt.solve` adds what makes this reliable and fast: it finds paths where Newton's method alone
does not, estimates the error, fits the elements to it, and has no use for full matrices. Nothing
of it is imported here, and on the same elements the two agree to rounding: that is a test.

References: Marsden and West, *Discrete mechanics and variational integrators*, Acta Numerica 10
(2001), sections 1.2, 2.2 and 3; Canuto, Hussaini, Quarteroni, Zang, *Spectral Methods: Fundamentals
in Single Domains* (2006), section 2.3.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import casadi as ca
import numpy as np
from numpy.polynomial import legendre

Law = Callable[..., Any]
Event = tuple[float, Sequence[float | None]]
STEPS = 50
SMALL = np.sqrt(np.finfo(float).eps)  # the square of such a step is lost in rounding


class Answer(NamedTuple):
    """A stationary path.

    Times `t` (K,) of the nodes, coordinates `q` (n, K), multipliers `lam` (m, K), NaN where a
    constraint has nothing to decide, and the action `S`. The Morse index `index` is the number of
    independent variations that lower the action; None where forces do work.
    """

    t: np.ndarray
    q: np.ndarray
    lam: np.ndarray
    S: float
    index: int | None


def lobatto(d: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return nodes xi (d + 1,), weights w (d + 1,) and differentiation matrix D (d + 1, d + 1).

    The nodes are -1, 1 and the roots of P'_d; w_k = 2 / (d (d + 1) P_d(xi_k)^2). The polynomial
    with values q at the nodes has Legendre coefficients V^-1 q, with V_kj = P_j(xi_k), and the
    slopes V' V^-1 q, with V'_kj = P'_j(xi_k).
    """
    P = np.eye(d + 1)  # column j has the Legendre coefficients of P_j
    xi = np.concatenate([[-1.0], legendre.legroots(legendre.legder(P[d])), [1.0]])
    V = legendre.legvander(xi, d)
    slopes = legendre.legval(xi, legendre.legder(P)).T
    return xi, 2 / (d * (d + 1) * V[:, d] ** 2), slopes @ np.linalg.inv(V)


def transcribe(
    lagrangian: Law, constraint: Law | None, force: Law | None, t: np.ndarray, degree: int, n: int
) -> ca.Function:
    """Return z -> (S, r, dr/dz), where z = (Q, lam), node by node, and r = 0 is to be solved.

    The times `t` are those of all K nodes; z and r are columns of length (n + m) K.
    """
    _, w, D = lobatto(degree)
    m = len(constraint(ca.array(ca.SX.sym("q", n))[:, 0], t[0])) if constraint else 0
    symbols = [ca.SX.sym(name, rows, t.size) for name, rows in (("q", n), ("lam", m), ("dq", n))]
    q, lam, dq = map(ca.array, symbols)  # with the manners of numpy's arrays
    S = C = W = 0
    for left in range(0, t.size - 1, degree):
        right = left + degree
        half = (t[right] - t[left]) / 2
        v = q[:, left : right + 1] @ D.T / half
        for k in range(left, right + 1):
            weight, here = half * w[k - left], (q[:, k], v[:, k - left], t[k])
            S += weight * lagrangian(*here)
            if constraint:
                C += weight * dot(lam[:, k], constraint(q[:, k], t[k]))
            if force:
                W += weight * dot(dq[:, k], force(*here))
    z = ca.veccat(*symbols[:2])
    virtual = ca.veccat(symbols[2], symbols[1])  # multipliers do no work
    r = ca.gradient(ca.SX(S + C), z) + ca.gradient(ca.SX(W), virtual)
    return ca.Function("equations", [z], [ca.SX(S), r, ca.jacobian(r, z)])


def dot(x: Any, y: Any) -> Any:
    """Return x . y."""
    return sum(a * b for a, b in zip(x, y, strict=True))


def solve(
    lagrangian: Law,
    start: Event,
    end: Event,
    *,
    elements: int = 8,
    degree: int = 6,
    constraint: Law | None = None,
    force: Law | None = None,
    guess: Callable[[np.ndarray], Any] | None = None,
) -> Answer:
    """Return the stationary path to which Newton's method leads.

    Parameters
    ----------
    lagrangian, constraint, force : callable
        L(q, v, t); f(q, t), a list; F(q, v, t), a list of length n. In arithmetic and functions of
        numpy: q and v are arrays (n,) of symbols.
    start, end : (t, q)
        Where the system is at one time and where at another. A coordinate None is free there.
    elements, degree : int
        Number of elements and degree d of the polynomials.
    guess : callable, optional
        A curve near the path: (n, K) at times (K,). The straight line if there is none.

    Raises
    ------
    RuntimeError
        If Newton's method does not converge.
    numpy.linalg.LinAlgError
        If its matrix is singular: there is a family of paths.

    Examples
    --------
    A stone is thrown up and caught two seconds later: g T^2 / 8 high, with S = -m g^2 T^3 / 24.

    >>> stone = solve(lambda q, v, t: v[0] ** 2 / 2 - 9.81 * q[0], (0.0, [0.0]), (2.0, [0.0]))
    >>> print(f"{stone.q.max():.6f} {stone.S:.6f} {stone.index}")
    4.905000 -32.078700 0
    """
    (t0, q0), (t1, q1) = start, end
    lefts = np.linspace(t0, t1, elements, endpoint=False)
    within = (t1 - t0) / elements * (1 + lobatto(degree)[0]) / 2
    t = np.append(np.add.outer(lefts, within[:-1]), t1)
    n, K = len(q0), t.size
    equations = transcribe(lagrangian, constraint, force, t, degree, n)

    # The first path: an end that is free is where the other end is. Multipliers begin with zero.
    a, b = np.array([q0, q1], dtype=float)  # None is NaN
    first, last = np.nan_to_num([np.where(np.isnan(a), b, a), np.where(np.isnan(b), a, b)])
    path = first + np.outer((t - t0) / (t1 - t0), last - first)
    free = np.ones((K, n), dtype=bool)
    free[0], free[-1] = np.isnan(a), np.isnan(b)
    if guess is not None:
        path = np.where(free, np.transpose(guess(t)), path)
    cut = n * K
    z = np.zeros(equations.size1_in(0))
    z[:cut] = path.ravel()

    # Unknowns: coordinates that are free, and multipliers of rows with any of these in them.
    unknown = np.append(free, np.zeros(z.size - cut, dtype=bool))
    depends = ca.DM(equations.sparsity_out(2), 1).full()
    unknown[cut:] = depends[cut:, unknown].any(axis=1)
    rows = np.count_nonzero(unknown[cut:])
    square = np.ix_(unknown, unknown)

    # Newton's method: near the path each step leaves about the square of the error before it.
    for _ in range(STEPS):
        _, r, derivative = map(ca.DM.full, equations(z))
        step = np.zeros(z.size)
        step[unknown] = -np.linalg.solve(derivative[square], r[unknown, 0])
        z += step
        if np.abs(step[:cut]).max() <= SMALL * np.abs(z[:cut]).max():
            break
    else:
        raise RuntimeError(
            f"expected Newton's method to converge, found no path in {STEPS} steps; "
            "try a guess nearer to one, or a shorter time"
        )

    # Without forces the derivative is the Hessian of A. Each row of constraints brings a negative
    # and a positive eigenvalue; the others are those of the variations that the rows allow.
    S, _, derivative = map(ca.DM.full, equations(z))
    index = None
    if force is None:
        index = int(np.sum(np.linalg.eigvalsh(derivative[square]) < 0)) - int(rows)
    z[cut:][~unknown[cut:]] = np.nan
    q, lam = z[:cut].reshape(K, n).T, z[cut:].reshape(K, -1).T
    return Answer(t, q, lam, S.item(), index)
