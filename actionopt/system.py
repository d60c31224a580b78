"""The physics: a Lagrangian, its parameters, constraints and forces; nothing of endpoints.

Every quantity of Lagrangian mechanics is a short formula in L(q, v, t) and its derivatives. They
are derived once, symbolically and at one point in time, on first use, with the parameters left
as symbols; numbers are put in afterwards.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from actionopt.checks import numbers
from actionopt.identity import general_states, vanishes
from actionopt.pointwise import Pointwise
from actionopt.quadrature import Array
from actionopt.symbolic import Expressions
from actionopt.tracing import ParameterTable, Symbols, call, column, is_smooth, suggestion


@dataclass(frozen=True)
class Structure:
    """What a system's derivatives depend on, read off their expressions once.

    What is absent here is not built, evaluated or stored by the solver.
    """

    depends_on_time: bool
    constant_mass: bool  # the mass matrix does not depend on q or v; so below: for smooth laws
    constant_coupling: bool  # nor does the mixed derivative of L
    constant_stiffness: bool  # nor does the second derivative of L in q
    affine_constraint: bool  # f is affine in q
    affine_force: bool  # Q is affine in (q, v)
    constraints: int
    forced: bool
    cyclic: tuple[str, ...]  # coordinates that neither L, f nor Q contain

    @property
    def linear(self) -> bool:
        """Whether the equations of motion, and so the discrete ones, are linear."""
        quadratic = self.constant_mass and self.constant_coupling and self.constant_stiffness
        return quadratic and self.affine_constraint and self.affine_force

    @property
    def steady(self) -> bool:
        """Whether they are linear with coefficients that are constant in time."""
        return self.linear and not self.depends_on_time


class System:
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
    Functions and memory are derived once and used again by every problem of a system. So they
    serve one thread at a time: give each thread a System of its own.

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
        self.symbols = Symbols(q, v, t, p)
        Q, V, T = Expressions(q, 1), Expressions(v, 1), Expressions(t, 0)
        named = self.table.named(p)
        given, used = call(lagrangian, "lagrangian", {"q": Q, "v": V, "t": T}, named)
        self.L = column(given, "lagrangian", 1)
        self.f = ca.SX(0, 1)
        if constraint is not None:
            given, names = call(constraint, "constraint", {"q": Q, "t": T}, named)
            self.f, used = column(given, "constraint"), used | names
        self.Q = ca.SX(0, 1)
        if force is not None:
            given, names = call(force, "force", {"q": Q, "v": V, "t": T}, named)
            self.Q, used = column(given, "force", n), used | names
        unused = [key for key in self.table.defaults if key not in used]
        if unused:
            raise ValueError(
                f"parameter {unused[0]!r} is used by none of the callables, which name "
                f"{', '.join(sorted(used)) or 'no parameters'}{suggestion(unused[0], sorted(used))}"
            )
        self._pointwise: dict[str, Pointwise] = {}
        self.layouts: dict[Any, Any] = {}  # of its discrete problems; they live as long as it does

    def __repr__(self) -> str:
        """Show the name and the coordinates."""
        return f"System({self.name or 'unnamed'}: {', '.join(self.coordinates)})"

    def __deepcopy__(self, memo: dict[int, Any]) -> System:
        """Return the same: nothing of it changes."""
        return self

    # -- what is known without numbers ---------------------------------------------------

    @property
    def n(self) -> int:
        """Number of coordinates."""
        return len(self.coordinates)

    @property
    def m(self) -> int:
        """Number of constraint rows."""
        return self.f.numel()

    @property
    def degrees_of_freedom(self) -> int:
        """Number of coordinates less the number of holonomic constraints (section 12.4)."""
        return self.n - self.m

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

    @property
    def derived(self) -> tuple[str, ...]:
        """Names of the functions derived so far; a re-solve adds none."""
        return tuple(self._pointwise)

    @cached_property
    def structure(self) -> Structure:
        """What the derivatives depend on, by the sparsity of their own derivatives."""
        moved = (
            self._depends("second", 2, (0, 1)),
            self._depends("second", 1, (0, 1)),
            self._depends("second", 0, (0, 1)),
            self.m > 0 and self._depends("constraint_jacobian", 0, (0,)),
            any(self._depends("force_jacobian", k, (0, 1)) for k in (0, 1) if self.Q.numel()),
        )
        smooth = all(moved[:3]) or is_smooth(self.L)  # if all move, it does not matter
        laws = [("first", 2, 0, 2)]  # function, output, inputs of q and of t
        if self.m:
            laws.append(("constraint", 0, 0, 1))
        if self.Q.numel():
            laws.append(("force", 0, 0, 2))
        seen: set[int] = set()
        for name, output, q, _ in laws:
            seen.update(self.pointwise(name).function.jac_sparsity(output, q).get_col())
        return Structure(
            depends_on_time=any(self._depends(name, k, (t,)) for name, k, _, t in laws),
            constant_mass=smooth and not moved[0],
            constant_coupling=smooth and not moved[1],
            constant_stiffness=smooth and not moved[2],
            affine_constraint=not moved[3] and is_smooth(self.f),
            affine_force=not moved[4] and is_smooth(self.Q),
            constraints=self.m,
            forced=self.Q.numel() > 0,
            cyclic=tuple(c for i, c in enumerate(self.coordinates) if i not in seen),
        )

    def _depends(self, name: str, output: int, inputs: tuple[int, ...]) -> bool:
        """Whether an output of a compiled function depends on any of these inputs."""
        function = self.pointwise(name).function
        return any(function.jac_sparsity(output, i).nnz() for i in inputs)

    @cached_property
    def derivatives(self) -> Derivatives:
        """Symbolic first and second derivatives of L and the constraint Jacobian."""
        s = self.symbols
        n = self.n
        hessian, gradient = ca.hessian(self.L, ca.vertcat(s.q, s.v))
        return Derivatives(
            Lq=gradient[:n],
            Lv=gradient[n:],
            Lqq=ca.triu(hessian[:n, :n]),
            Lqv=hessian[:n, n:],
            Lvv=ca.triu(hessian[n:, n:]),
            G=ca.jacobian(self.f, s.q) if self.m else ca.SX(0, n),
        )

    def pointwise(self, name: str) -> Pointwise:
        """Return the compiled function `name` of one time, deriving it on first use."""
        if name not in self._pointwise:
            inputs, outputs = getattr(self, f"_build_{name}")()
            function = ca.Function(name, inputs, outputs)
            self._pointwise[name] = Pointwise(function)
        return self._pointwise[name]

    @property
    def _arguments(self) -> list[ca.SX]:
        s = self.symbols
        return [s.q, s.v, s.t, s.p]

    def _build_value(self):
        return self._arguments, [self.L]

    def _build_first(self):
        d = self.derivatives
        return self._arguments, [_dense(d.Lq), _dense(d.Lv), self.L]

    def _build_second(self):
        d = self.derivatives
        return self._arguments, [d.Lqq, d.Lqv, d.Lvv]

    def _build_force(self):
        return self._arguments, [self.Q]

    def _build_force_jacobian(self):
        s = self.symbols
        return self._arguments, [ca.jacobian(self.Q, s.q), ca.jacobian(self.Q, s.v)]

    def _build_constraint(self):
        s = self.symbols
        return [s.q, s.t, s.p], [self.f]

    def _build_constraint_jacobian(self):
        s = self.symbols
        return [s.q, s.t, s.p], [self.derivatives.G]

    def _build_constraint_rate(self):
        s = self.symbols
        return [s.q, s.t, s.p], [_dense(ca.jacobian(self.f, s.t))]

    def _build_constraint_curvature(self):
        s = self.symbols
        lam = ca.SX.sym("lam", self.m)
        curvature, _ = ca.hessian(ca.dot(lam, self.f), s.q)
        return [s.q, lam, s.t, s.p], [ca.triu(curvature)]

    def _build_energy(self):
        return self._arguments, [ca.dot(self.symbols.v, self.derivatives.Lv) - self.L]

    def _build_motion(self):
        M, bias, G, gamma = self.motion
        return self._arguments, [_dense(x) for x in (M, bias, G, gamma)]

    @cached_property
    def motion(self) -> tuple[ca.SX, ca.SX, ca.SX, ca.SX]:
        """Index-1 equations of motion as expressions: M a - G' lam = bias, G a = -gamma.

        bias = L_q + Q - L_vq v - L_vt and gamma = d/dt (G v + f_t) at a = 0: twice the time
        derivative of f, less its acceleration term.
        """
        s, d = self.symbols, self.derivatives
        bias = d.Lq - ca.jtimes(d.Lv, s.q, s.v) - ca.jacobian(d.Lv, s.t)
        if self.Q.numel():
            bias += self.Q
        M = d.Lvv + ca.triu(d.Lvv, False).T
        rate = d.G @ s.v + ca.jacobian(self.f, s.t)
        gamma = ca.jacobian(rate, s.q) @ s.v + ca.jacobian(rate, s.t)
        return M, bias, d.G, gamma

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
        for _ in range(50):
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
            while size > 1e-8 * np.max(np.abs(v)):
                ahead = mismatch(v + step)
                if m or np.linalg.norm(ahead) < np.linalg.norm(miss):
                    break
                step, size = step / 2, size / 2
            v = v + step
            miss = mismatch(v)
            if size <= 1e-15 * np.max(np.abs(v)) or (size >= last / 2 and size < 1e-10):
                return v
            last = size
        raise ValueError(
            f"no velocity with the momentum {target} was found at q = {q}: expected the "
            "Lagrangian to be convex in the velocities near there"
        )

    def _dynamics(self, q, v, t, parameters) -> tuple[Array, Array]:
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


@dataclass(frozen=True, eq=False)
class Derivatives:
    """Symbolic derivatives of L at one time; the symmetric ones as upper triangles."""

    Lq: ca.SX
    Lv: ca.SX
    Lqq: ca.SX
    Lqv: ca.SX
    Lvv: ca.SX
    G: ca.SX


def _dense(expression: ca.SX) -> ca.SX:
    return expression if expression.is_dense() else ca.densify(expression)


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
    array = numbers(values, what)
    if array.ndim not in (1, 2) or array.shape[0] != n:
        raise ValueError(
            f"expected {what} of shape ({n},) or ({n}, K), one row a coordinate, "
            f"found {array.shape}"
        )
    return array.reshape(n, -1), array.ndim == 1
