"""Numbers of a law at places, velocities and times: arguments in the user's shapes, checked.

Momenta, energy, forces and accelerations, and the velocity that has a momentum.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from actionopt.mechanics.laws.compiled import AT_ONCE
from actionopt.mechanics.laws.laws import Laws
from actionopt.mechanics.laws.tracing import ParameterTable
from actionopt.tools.blas import solve_each
from actionopt.tools.checks import numbers
from actionopt.tools.types import Array

# Newton's method in `velocity`; ad hoc.
NO_VELOCITY: Any = object()  # in place of v, for functions of q and t alone
NEWTON_STEPS = 50
DAMPED_STEP = 1e-8  # of the velocity: a longer one is shortened where it leads away
LAST_STEP = 1e-15  # of the velocity: some spacings of floats
STALLED_STEP = 1e-10  # in the velocity's own unit: one that stops contracting is round-off


class NumericLaws(Laws):
    """Laws whose quantities are asked for at points, with parameters by name."""

    table: ParameterTable

    def check_order(self, what: str) -> None:
        """Raise ValueError if L contains accelerations, saying `what` does not know them."""
        if self.order > 1:
            raise ValueError(
                "expected a Lagrangian of coordinates and velocities, found one that contains "
                f"{'accelerations' if self.order == 2 else 'higher derivatives'}: {what} is not "
                "known of it; see solution.momentum, energy, morse_index, sensitivity and compare, "
                "and `ao.second_variation`"
            )

    @property
    def parameters(self) -> dict[str, Array]:
        """Default parameter values by name."""
        return dict(self.table.defaults)

    def lagrangian(self, q: ArrayLike, v: ArrayLike, t: ArrayLike, *, parameters=None) -> Array:
        """Return L(q, v, t): shape (K,) for q, v of shape (n, K), a 0-d array for (n,).

        `t` is one time or (K,) times; `parameters` overrides defaults by name. So for the
        methods below, which raise ValueError for shapes that do not fit.
        """
        return self._at("value", q, v, t, parameters)[0][0]

    def momentum(self, q: ArrayLike, v: ArrayLike, t: ArrayLike, *, parameters=None) -> Array:
        """Return the canonical momenta p = dL/dv, shape (n, K) or (n,). Section 12.3."""
        return self._at("first", q, v, t, parameters)[1]

    def generalized_force(
        self, q: ArrayLike, v: ArrayLike, t: ArrayLike, *, parameters=None
    ) -> Array:
        """Return dL/dq, shape (n, K) or (n,). Section 12.3."""
        return self._at("first", q, v, t, parameters)[0]

    def force(self, q: ArrayLike, v: ArrayLike, t: ArrayLike, *, parameters=None) -> Array:
        """Return the non-conservative forces Q, shape (n, K) or (n,); zero where there are none."""
        if self.Q.numel() == 0:
            return 0.0 * self._at("first", q, v, t, parameters)[0]
        return self._at("force", q, v, t, parameters)[0]

    def energy(self, q: ArrayLike, v: ArrayLike, t: ArrayLike, *, parameters=None) -> Array:
        """Return the energy function H = v . dL/dv - L, shape (K,) or a 0-d array. Section 12.5."""
        return self._at("energy", q, v, t, parameters)[0][0]

    def mass_matrix(self, q: ArrayLike, v: ArrayLike, t: ArrayLike, *, parameters=None) -> Array:
        """Return M = d2L/dv dv, shape (n, n, K) or (n, n)."""
        if self.has_diagonal_mass and not self.m:
            mass, own = self._at("even_motion", q, v, t, parameters)[0], np.arange(self.n)
            M = np.zeros((self.n, *mass.shape))
            M[own, own] = mass
            return M
        M = self._at("motion", q, v, t, parameters)[0]
        return M.reshape(self.n, self.n, *M.shape[1:])

    def constraint(self, q: ArrayLike, t: ArrayLike, *, parameters=None) -> Array:
        """Return f(q, t), shape (m, K) or (m,)."""
        return self._at("constraint", q, NO_VELOCITY, t, parameters)[0]

    def constraint_jacobian(self, q: ArrayLike, t: ArrayLike, *, parameters=None) -> Array:
        """Return G = df/dq, shape (m, n, K) or (m, n)."""
        if self.order > 1 or not self.m:
            arguments, single = self.arguments(q, NO_VELOCITY, t, parameters)
            jacobian = self.pointwise("constraint_jacobian")
            G = jacobian.full(0, jacobian(*arguments)[0])
            return G[0] if single else np.moveaxis(G, 0, -1)
        columns, _ = _as_columns(q, self.n, "q")
        G = self._at("motion", q, np.zeros_like(columns).reshape(np.shape(q)), t, parameters)[2]
        return np.swapaxes(G.reshape(self.n, self.m, *G.shape[1:]), 0, 1)

    def acceleration(self, q: ArrayLike, v: ArrayLike, t: ArrayLike, *, parameters=None) -> Array:
        """Return the accelerations of the Euler-Lagrange equations, shape (n, K) or (n,).

        With constraints the index-1 form is solved, for (q, v) on the constraint and its rate;
        equation (12.8) with f differentiated twice. Raises numpy.linalg.LinAlgError where the
        mass matrix is singular on the motions the constraints allow.
        """
        return self.dynamics(q, v, t, parameters)[0]

    def multipliers(self, q: ArrayLike, v: ArrayLike, t: ArrayLike, *, parameters=None) -> Array:
        """Return lambda of L' = L + sum lambda f, shape (m, K) or (m,). Equation (12.7)."""
        return self.dynamics(q, v, t, parameters)[1]

    def constraint_force(
        self, q: ArrayLike, v: ArrayLike, t: ArrayLike, *, parameters=None
    ) -> Array:
        """Return the generalized forces of constraint G' lambda, shape (n, K) or (n,). (12.9)."""
        G = self.constraint_jacobian(q, t, parameters=parameters)
        return np.einsum("mn...,m...->n...", G, self.multipliers(q, v, t, parameters=parameters))

    def velocity(
        self,
        q: ArrayLike,
        p: ArrayLike,
        t: float,
        guess: ArrayLike,
        *,
        parameters=None,
    ) -> Array:
        """Return the velocity with momentum `p`, the inverse of `momentum`, at one time: (n,).

        With constraints, p counts only on the motions they allow: v satisfies
        G v = -df/dt and dL/dv = p + G' mu. Newton's method from `guess` (n,), one step where
        L is quadratic in v. Raises ValueError if it does not converge, or anything is not finite.
        """
        n, m = self.n, self.m
        v, target = numbers(guess, "the guess of v"), numbers(p, "p")
        if not v.shape == target.shape == (n,):
            raise ValueError(
                f"expected p and the guess of v of shape ({n},), found {target.shape} and {v.shape}"
            )
        G = self.constraint_jacobian(q, t, parameters=parameters)
        rate = self._at("constraint_rate", q, NO_VELOCITY, t, parameters)[0] if m else np.zeros(0)

        def mismatch(v: Array) -> Array:
            return np.concatenate(
                [target - self.momentum(q, v, t, parameters=parameters), -rate - G @ v]
            )

        with np.errstate(all="ignore"):  # what is not finite is refused
            miss, last = mismatch(v), np.inf
            for _ in range(NEWTON_STEPS):
                M = self.mass_matrix(q, v, t, parameters=parameters)
                try:
                    if self.has_diagonal_mass and not m and M.diagonal().all():
                        step = miss / M.diagonal()
                    else:
                        K = np.block([[M, -G.T], [G, np.zeros((m, m))]])
                        step = np.linalg.solve(K, miss)[:n]
                except np.linalg.LinAlgError:
                    raise ValueError(
                        f"expected a mass matrix that can be inverted, found {M.tolist()} at "
                        f"q = {q}, t = {t}, v = {v}; no velocity near it may have the momentum "
                        f"{target}: try another guess"
                    ) from None
                size = float(np.max(np.abs(step)))
                if not np.isfinite(size):
                    raise ValueError(
                        f"expected a finite momentum {target} and a Lagrangian with finite "
                        f"derivatives at q = {q}, t = {t}, v = {v}, found NaN or infinity; move "
                        "away from there"
                    )
                # Away from the answer a full step may leave the domain of L (|v| < c, say).
                while size > DAMPED_STEP * np.max(np.abs(v)):
                    ahead = mismatch(v + step)
                    if m or np.linalg.norm(ahead) < np.linalg.norm(miss):
                        break
                    step, size = step / 2, size / 2
                v = v + step
                miss = mismatch(v)
                if size <= LAST_STEP * np.max(np.abs(v)) or (
                    size >= last / 2 and size < STALLED_STEP
                ):
                    return v
                last = size
        raise ValueError(
            f"expected a velocity with the momentum {target} at q = {q}, found none: the "
            "Lagrangian is to be convex in the velocities near there"
        )

    def dynamics(
        self, q, v, t, parameters, active: NDArray[np.bool_] | None = None
    ) -> tuple[Array, Array]:
        """Return accelerations (n, ...) and multipliers (m, ...) of the index-1 equations.

        Where `active` (m, ...) is given, of the constraints it names; others have no multiplier.
        """
        n, m = self.n, self.m
        if not m and self.has_diagonal_mass:
            mass, bias = self._at("even_motion", q, v, t, parameters)
            if not mass.all():
                raise np.linalg.LinAlgError("Singular matrix")
            return bias / mass, np.zeros((0, *bias.shape[1:]))
        self.check_order("a value at one q, v and t")
        arguments, single = self.arguments(q, v, t, parameters)
        shape = () if single else arguments[0].shape[:1]
        held = None if active is None else active.reshape(m, -1).T
        M, bias, G, gamma = self.pointwise("motion")(*arguments)
        solved = solve_motion(M, bias, G, gamma, held).T
        return solved[:n].reshape(n, *shape), solved[n:].reshape(m, *shape)

    def _at(self, name: str, q, v, t, parameters) -> list[Array]:
        """Evaluate a compiled function at arguments of the user's shape: (rows, K) or (rows,)."""
        if v is not NO_VELOCITY:
            self.check_order("a value at one q, v and t")
        arguments, single = self.arguments(q, v, t, parameters)
        results = self.pointwise(name)(*arguments)
        return [r[0].copy() if single else r.T.copy() for r in results]

    def arguments(self, q, v, t, parameters) -> tuple[list[Array], bool]:
        """Return q and v as (K, n), t as (K, 1) and packed parameters; whether q is one place (n,).

        Without v where it is `NO_VELOCITY`. Raises ValueError for shapes that do not fit.
        """
        columns, single = _as_columns(q, self.n, "q")
        arguments = [columns.T]
        if v is not NO_VELOCITY:
            rates, v_single = _as_columns(v, self.n, "v")
            if rates.shape != columns.shape or v_single != single:
                raise ValueError(
                    f"expected q and v of one shape, found {np.shape(q)} and {np.shape(v)}"
                )
            arguments.append(rates.T)
        times = numbers(t, "t")
        if times.shape not in ((), (1,), columns.shape[1:]):
            raise ValueError(
                f"expected one time or {columns.shape[1]} times, found shape {times.shape}"
            )
        arguments += [times.reshape(-1, 1), self.table.pack(self.table.values(parameters))]
        return arguments, single


def solve_motion(
    M: Array, bias: Array, G: Array, gamma: Array, active: NDArray[np.bool_] | None = None
) -> Array:
    """Return accelerations and multipliers (K, n + m) of M a = bias + G' lambda, G a = -gamma.

    M (K, n n), bias (K, n), G' (K, n m), gamma (K, m); `active` (K, m) as in `dynamics`.
    """
    (count, n), m = bias.shape, gamma.shape[1]
    few = max(AT_ONCE // (n + m) ** 2, 1)
    if count > few:
        found = np.empty((count, n + m))
        for some in (slice(k, k + few) for k in range(0, count, few)):
            held = None if active is None else active[some]
            found[some] = solve_motion(M[some], bias[some], G[some], gamma[some], held)
        return found
    if not m:
        return solve_each(M.reshape(count, n, n), bias)
    K = np.zeros((count, n + m, n + m))
    K[:, :n, :n] = M.reshape(count, n, n)
    K[:, n:, :n] = G.reshape(count, n, m).transpose(0, 2, 1)
    K[:, :n, n:] = -G.reshape(count, n, m)
    right = np.concatenate([bias, -gamma], axis=1)
    if active is not None:
        k, i = np.nonzero(~active)
        K[k, n + i, :] = K[k, :, n + i] = 0.0
        K[k, n + i, n + i], right[k, n + i] = 1.0, 0.0
    return solve_each(K, right)


def _as_columns(values: ArrayLike, n: int, what: str) -> tuple[Array, bool]:
    """Return values of shape (n, K) and whether they were given as (n,)."""
    array = numbers(values, what)
    if array.ndim not in (1, 2) or array.shape[0] != n:
        raise ValueError(
            f"expected {what} of shape ({n},) or ({n}, K), one row a coordinate, "
            f"found {array.shape}"
        )
    return array.reshape(n, -1), array.ndim == 1
