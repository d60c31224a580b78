"""The physics: a Lagrangian, its parameters, constraints and forces; nothing of endpoints.

Every quantity of Lagrangian mechanics is a short formula in L(q, v, t) and its derivatives
(`laws`); here the laws are traced from callables, and numbers are put in.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import cached_property
from typing import Any, Never

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from actionopt.mechanics.expressions import Expressions
from actionopt.mechanics.identity import general_states, vanishes
from actionopt.mechanics.laws import Laws
from actionopt.mechanics.tracing import ParameterTable, Symbols, call, column, scalar, suggestion
from actionopt.tools.checks import numbers
from actionopt.tools.types import Array

# Of Newton's method in `velocity`; ad hoc.
NEWTON_STEPS = 50
DAMPED_STEP = 1e-8  # of the velocity: a longer one is shortened where it leads away
LAST_STEP = 1e-15  # of the velocity: some spacings of floats
STALLED_STEP = 1e-10  # in the velocity's own unit: one that stops contracting is round-off


class System(Laws):
    """A mechanical system given by its Lagrangian L(q, v, t).

    Parameters
    ----------
    lagrangian : callable
        `lagrangian(q, v, t, *, ...)` with q and v of shape (n,), written with arithmetic and
        numpy or CasADi functions; `x, y = q` unpacks. Parameters are named keyword-only.
    coordinates : sequence of str
        Names of the n generalized coordinates.
    parameters : mapping of str to number or array, optional
        Default values. Arrays keep their shape.
    constraint : callable, optional
        `constraint(q, t, *, ...)`: one expression f or a sequence of m of them; holonomic,
        f(q, t) = 0.
    force : callable, optional
        `force(q, v, t, *, ...)`: the n generalized non-conservative forces Q.
    name : str, optional
        Shown in messages and files.

    Raises
    ------
    ValueError
        If a callable has the wrong signature, cannot be traced or returns the wrong shape, or
        a parameter is missing, unused or not finite.

    Notes
    -----
    Functions are derived once and used again by every problem of a system, in any number of
    threads: the memory they work in is each thread's own, and goes with it. The numbers are those
    of one thread, to the last bit.

    References
    ----------
    *Competitive Physics: Mechanics and Waves* (2018), chapter 12: action (12.1), equations of
    motion (12.3), constraints (12.7)-(12.9).

    Examples
    --------
    >>> import numpy as np
    >>> def lagrangian(q, v, t, *, l, g):
    ...     return (l * v[0]) ** 2 / 2 + g * l * np.cos(q[0])
    >>> pendulum = System(lagrangian, ["theta"], parameters={"l": 1.0, "g": 9.81})
    >>> round(float(pendulum.energy([0.0], [1.0], 0.0)), 3)
    -9.31
    """

    def __init__(
        self,
        lagrangian: Callable[..., Any],
        coordinates: Sequence[str],
        *,
        parameters: Mapping[str, ArrayLike] | None = None,
        constraint: Callable[..., Any] | None = None,
        force: Callable[..., Any] | None = None,
        name: str = "",
    ) -> None:
        if not isinstance(name, str):
            raise ValueError(f"expected the name of a system as text, found {name!r}")
        self.coordinates = _names(coordinates)
        self.name = name
        self.table = ParameterTable(parameters)
        n = len(self.coordinates)
        q, v, t, p = ca.SX.sym("q", n), ca.SX.sym("v", n), ca.SX.sym("t"), self.table.symbols()
        Q, V, T = Expressions(q, 1), Expressions(v, 1), Expressions(t, 0)
        named = self.table.named(p)
        given, used = call(lagrangian, "lagrangian", {"q": Q, "v": V, "t": T}, named)
        L = scalar(given, "lagrangian")
        constraints = forces = ca.SX(0, 1)
        if constraint is not None:
            given, names = call(constraint, "constraint", {"q": Q, "t": T}, named)
            constraints, used = column(given, "constraint"), used | names
        if force is not None:
            given, names = call(force, "force", {"q": Q, "v": V, "t": T}, named)
            forces, used = column(given, "force", n), used | names
        unused = [key for key in self.table.defaults if key not in used]
        if unused:
            raise ValueError(
                f"parameter {unused[0]!r} is used by none of the callables, which name "
                f"{', '.join(sorted(used)) or 'no parameters'}{suggestion(unused[0], sorted(used))}"
            )
        super().__init__(Symbols(q, v, t, p), L, constraints, forces, self.coordinates)
        self.layouts: dict[Any, Any] = {}  # of its discrete problems; they live as long as it does

    def __repr__(self) -> str:
        """Show the name and the coordinates."""
        return f"System({self.name or 'unnamed'}: {', '.join(self.coordinates)})"

    def __copy__(self) -> System:
        """Return the same: nothing of it changes."""
        return self

    def __deepcopy__(self, memo: dict[int, Any]) -> System:
        """Return the same: nothing of it changes."""
        return self

    def __reduce__(self) -> Never:
        """Refuse to be pickled, and so do problems and solutions: a system is code."""
        raise TypeError(
            f"expected something other than a {self!r} to pickle: a system is code; make it where "
            "it is needed, and send a solution as a file, by solution.save(file) and "
            "actionopt.load(file, system)"
        )

    # -- what is known without numbers ---------------------------------------------------

    @cached_property
    def energy_is_mechanical(self) -> bool:
        """Whether H = T + V with V = -L at rest: T = L + V is homogeneous of degree 2 in v.

        Euler's theorem, in the form v . d2T/dv2 = dT/dv; checked symbolically (section 12.5).
        What moving coordinates leave of T at rest cannot be told from a potential in L alone:
        `symmetry.is_mechanical` takes T itself.
        """
        s, d = self.symbols, self.derivatives
        M = d.Lvv + ca.triu(d.Lvv, False).T
        euler = ca.horzcat(*[M[:, i] * s.v[i] for i in range(self.n)], -d.Lv)
        packed = self.table.pack(self.parameters)
        return vanishes(euler, self._arguments, [*general_states(self.n), packed])

    @property
    def parameters(self) -> dict[str, Array]:
        """Default parameter values by name."""
        return dict(self.table.defaults)

    # -- pointwise numbers -----------------------------------------------------------------

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
            return np.zeros(np.broadcast_shapes(np.shape(q), np.shape(v)))
        return self._at("force", q, v, t, parameters)[0]

    def energy(self, q: ArrayLike, v: ArrayLike, t: ArrayLike, *, parameters=None) -> Array:
        """Return the energy function H = v . dL/dv - L, shape (K,) or a 0-d array. Section 12.5."""
        return self._at("energy", q, v, t, parameters)[0][0]

    def mass_matrix(self, q: ArrayLike, v: ArrayLike, t: ArrayLike, *, parameters=None) -> Array:
        """Return M = d2L/dv dv, shape (n, n, K) or (n, n)."""
        M = self._at("motion", q, v, t, parameters)[0]
        return M.reshape(self.n, self.n, *M.shape[1:])

    def constraint(self, q: ArrayLike, t: ArrayLike, *, parameters=None) -> Array:
        """Return f(q, t), shape (m, K) or (m,)."""
        return self._at("constraint", q, None, t, parameters)[0]

    def constraint_jacobian(self, q: ArrayLike, t: ArrayLike, *, parameters=None) -> Array:
        """Return G = df/dq, shape (m, n, K) or (m, n)."""
        columns, _ = _as_columns(q, self.n, "q")
        G = self._at("motion", q, np.zeros_like(columns).reshape(np.shape(q)), t, parameters)[2]
        return np.swapaxes(G.reshape(self.n, self.m, *G.shape[1:]), 0, 1)

    def acceleration(self, q: ArrayLike, v: ArrayLike, t: ArrayLike, *, parameters=None) -> Array:
        """Return the accelerations of the Euler-Lagrange equations, shape (n, K) or (n,).

        With constraints the index-1 form is solved, for (q, v) on the constraint and its rate;
        equation (12.8) with f differentiated twice. Raises numpy.linalg.LinAlgError where the
        mass matrix is singular on the motions the constraints allow.
        """
        return self._dynamics(q, v, t, parameters)[0]

    def multipliers(self, q: ArrayLike, v: ArrayLike, t: ArrayLike, *, parameters=None) -> Array:
        """Return lambda of L' = L + sum lambda f, shape (m, K) or (m,). Equation (12.7)."""
        return self._dynamics(q, v, t, parameters)[1]

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
        G = self.constraint_jacobian(q, t, parameters=parameters)
        rate = self._at("constraint_rate", q, None, t, parameters)[0] if m else np.zeros(0)

        def mismatch(v: Array) -> Array:
            return np.concatenate(
                [target - self.momentum(q, v, t, parameters=parameters), -rate - G @ v]
            )

        miss, last = mismatch(v), np.inf
        for _ in range(NEWTON_STEPS):
            M = self.mass_matrix(q, v, t, parameters=parameters)
            K = np.block([[M, -G.T], [G, np.zeros((m, m))]])
            step = np.linalg.solve(K, miss)[:n]
            size = float(np.max(np.abs(step)))
            if not np.isfinite(size):
                raise ValueError(
                    f"expected a finite momentum {target} and a Lagrangian with finite derivatives "
                    f"at q = {q}, t = {t}, v = {v}, found NaN or infinity; move away from there"
                )
            # Away from the answer a full step may leave the domain of L (|v| < c, say).
            while size > DAMPED_STEP * np.max(np.abs(v)):
                ahead = mismatch(v + step)
                if m or np.linalg.norm(ahead) < np.linalg.norm(miss):
                    break
                step, size = step / 2, size / 2
            v = v + step
            miss = mismatch(v)
            if size <= LAST_STEP * np.max(np.abs(v)) or (size >= last / 2 and size < STALLED_STEP):
                return v
            last = size
        raise ValueError(
            f"no velocity with the momentum {target} was found at q = {q}: expected the "
            "Lagrangian to be convex in the velocities near there"
        )

    def _dynamics(self, q, v, t, parameters) -> tuple[Array, Array]:
        """Return accelerations (n, ...) and multipliers (m, ...) of the index-1 equations."""
        n, m = self.n, self.m
        M, bias, G, gamma = self._at("motion", q, v, t, parameters)
        shape = bias.shape[1:]
        count = bias[0].size
        M = M.reshape(n, n, count)
        G = G.reshape(n, m, count)
        K = np.zeros((count, n + m, n + m))
        K[:, :n, :n] = np.moveaxis(M, -1, 0)
        K[:, :n, n:] = -np.moveaxis(G, -1, 0)
        K[:, n:, :n] = np.moveaxis(G, -1, 0).transpose(0, 2, 1)
        right = np.concatenate([bias.reshape(n, count), -gamma.reshape(m, count)]).T
        solved = np.linalg.solve(K, right[..., None])[..., 0].T
        return solved[:n].reshape(n, *shape), solved[n:].reshape(m, *shape)

    def _at(self, name: str, q, v, t, parameters) -> list[Array]:
        """Evaluate a compiled function at arguments of the user's shape: (rows, K) or (rows,)."""
        columns, single = _as_columns(q, self.n, "q")
        arguments = [columns.T]
        if v is not None:
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
        results = self.pointwise(name)(*arguments)
        return [r[0].copy() if single else r.T.copy() for r in results]


def _names(coordinates: Sequence[str]) -> tuple[str, ...]:
    sequence = isinstance(coordinates, Iterable) and not isinstance(coordinates, str)
    names = tuple(coordinates) if sequence else ()
    if not sequence or not all(isinstance(name, str) for name in names):
        raise ValueError(
            f"expected a sequence of coordinate names, such as ['x', 'y'], found {coordinates!r}"
        )
    if not names or len(set(names)) != len(names):
        raise ValueError(f"expected at least one coordinate and distinct names, found {names}")
    return names


def _as_columns(values: ArrayLike, n: int, what: str) -> tuple[Array, bool]:
    """Return values of shape (n, K) and whether they were given as (n,)."""
    array = numbers(values, what)
    if array.ndim not in (1, 2) or array.shape[0] != n:
        raise ValueError(
            f"expected {what} of shape ({n},) or ({n}, K), one row a coordinate, "
            f"found {array.shape}"
        )
    return array.reshape(n, -1), array.ndim == 1
