"""The equations of motion as a flow, integrated with CVODES from SUNDIALS through CasADi.

The integrator works on s in [0, 1] with t = t0 + s T, and with every coordinate and velocity in
units of its own size, so that one tolerance means the same for atoms and for planets.
"""

from __future__ import annotations

import contextlib
import io
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any
from weakref import WeakKeyDictionary

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from actionopt.problem import State
from actionopt.quadrature import Array
from actionopt.system import System

LONGEST = 1 / 200  # of the duration: a longer step might pass over a force that acts for a moment
STEPS = 50_000  # of CVODES between two outputs; a regular motion needs some tens
NOISE = 1e-10  # a coordinate this much smaller than the others is zero
CONDITION = 1e13  # of the equilibrated equations: accelerations beyond it are round-off


class IntegrationError(RuntimeError):
    """The forward integration could not be continued; the message says at what time."""


@dataclass(frozen=True, eq=False)
class Units:
    """What the integrator measures in: sizes of q and of v, shape (n,), and of the equations.

    `rows` (n + m,) equilibrates the matrix of the index-1 equations, whose entries have as
    many units as there are pairs of coordinates. Its first n go with the inverse root of each
    coordinate's inertia.
    """

    q: Array
    v: Array
    rows: Array

    @classmethod
    def of(cls, q: Array, v: Array, rows: Array) -> Units:
        """Return the units in which the coordinates and velocities (n, K) have size one."""
        metric = rows[: len(q)]
        return cls(sizes(q, metric), sizes(v, metric), rows)

    def agree(self, other: Units) -> bool:
        """Whether the two differ by less than a factor of two."""
        ratio = np.concatenate([self.q / other.q, self.v / other.v])
        return bool(np.all((ratio > 0.5) & (ratio < 2.0)))


def sizes(values: Array, metric: Array) -> Array:
    """Return the largest magnitude of each row of (n, K), shape (n,): always positive.

    A row that is zero up to `NOISE` is given the size of the largest row instead, or 1.
    Coordinates may differ in unit and in mass, so it must be that small both as it stands and
    divided by the `metric` (n,), the inverse root of the inertias.
    """
    size = np.max(np.abs(values), axis=1)
    natural = size / metric
    zero = (size <= NOISE * size.max()) & (natural <= NOISE * natural.max())
    return np.where(zero, size.max() if size.max() > 0 else 1.0, size)


@dataclass(frozen=True, eq=False)
class Flow:
    """The equations of motion of a system at given parameters.

    Unconstrained they are M a = bias. With constraints the index-1 form is integrated,

        M a - G' lam = bias,      G a + gamma + 2 c (G v + f_t) + c^2 f = 0,

    in which Baumgarte's two terms, zero on every exact motion, make drift off the surface decay
    at the rate c.

    References
    ----------
    Baumgarte, Computer Methods in Applied Mechanics and Engineering 1 (1972) 1-16.
    """

    system: System
    parameters: Mapping[str, ArrayLike] | None = None

    def integrator(self, s: Array, tolerance: float, longest: float = LONGEST) -> Integrator:
        """Return the integrator from s = 0 with output at the K increasing times `s` <= 1.

        It takes no steps longer than `longest`.
        """
        options = {
            "abstol": tolerance,
            "reltol": tolerance,
            "linear_multistep_method": "adams",
            "nonlinear_solver_iteration": "functional",
            "max_num_steps": STEPS,
            "max_step_size": longest,
            "disable_internal_warnings": True,
            "show_eval_warnings": False,
        }
        function = ca.integrator("forward", "cvodes", _motion(self.system), 0.0, s, options)
        table = self.system.table
        return Integrator(function, s, table.pack(table.values(self.parameters))[0])

    def first_units(self, state: State, span: float) -> Units:
        """Return sizes as far as the start tells: they err on the large side.

        Raises ValueError if the equations of motion cannot be solved there.
        """
        rows = self._equilibrate(state)
        a = self.system.acceleration(state.q, state.v, state.t, parameters=self.parameters)
        if not np.all(np.isfinite(a)):
            raise ValueError(
                f"expected finite accelerations {_of(state)}, found {a}; begin where the "
                "Lagrangian and its derivatives are finite"
            )
        v = np.abs(state.v) + np.abs(a * span)
        return Units.of((np.abs(state.q) + v * abs(span))[:, None], v[:, None], rows)

    def _equilibrate(self, state: State) -> Array:
        """Return r so that diag(r) K diag(r) has rows of size one, K the index-1 matrix."""
        n, m = self.system.n, self.system.m
        M = self.system.mass_matrix(state.q, state.v, state.t, parameters=self.parameters)
        G = self.system.constraint_jacobian(state.q, state.t, parameters=self.parameters)
        K = np.block([[M, -G.T], [G, np.zeros((m, m))]])
        r = np.ones(n + m)
        if np.all(np.isfinite(K)) and np.all(np.any(K != 0, axis=1)):
            for _ in range(5):  # Ruiz scaling
                r /= np.sqrt(np.max(np.abs(K * r * r[:, None]), axis=1))
            if np.linalg.cond(K * r * r[:, None]) < CONDITION:
                return r
        raise ValueError(
            f"expected equations of motion that give the accelerations {_of(state)}, found a "
            "singular mass matrix (or dependent constraints); drop the coordinate without "
            "kinetic energy, or the constraint that follows from the others"
        )


@dataclass(frozen=True, eq=False)
class Integrator:
    """CVODES for one system, one tolerance and output at the scaled times `s` (K,)."""

    function: ca.Function
    s: Array
    packed: Array

    def __call__(
        self, state: State, span: float, units: Units, rate: float = 10.0
    ) -> tuple[Array, Array]:
        """Integrate from `state` over times t0 + s span; return q and v there, each (n, K).

        `rate` is Baumgarte's c in units of 1 / span. Raises IntegrationError if CVODES gives up.
        """
        start = np.concatenate([state.q / units.q, state.v / units.v])
        times = [state.t, span, rate / span]
        values = np.concatenate([self.packed, times, units.q, units.v, units.rows])
        said = io.StringIO()
        try:
            with contextlib.redirect_stderr(said):
                out = self.function(x0=start, p=values)["xf"].full()
        except RuntimeError as error:
            if "KeyboardInterrupt" in said.getvalue():
                raise KeyboardInterrupt from None
            a, b = state.t + span * self._reached(start, values)
            raise IntegrationError(
                f"the forward integration stopped between t = {a:.6g} and t = {b:.6g}: the "
                "motion runs into a singularity there, such as a collision, is not smooth, "
                "or leaves the domain of the Lagrangian; end before that time or begin elsewhere"
            ) from error
        n = state.q.size
        return out[:n] * units.q[:, None], out[n:] * units.v[:, None]

    @property
    def steps(self) -> int:
        """Number of steps of the last run."""
        return self.function.stats()["nsteps"]

    def _reached(self, start: Array, values: Array) -> Array:
        """Return the scaled times of the last output before a failure and the next, shape (2,).

        Repeats the run in memory of our own, where what was written before the failure stays.
        """
        out = np.full((self.s.size, start.size), np.nan)
        buffer: Any
        buffer, trigger = self.function.buffer()
        buffer.set_arg(self.function.index_in("x0"), memoryview(start))
        buffer.set_arg(self.function.index_in("p"), memoryview(values))
        buffer.set_res(self.function.index_out("xf"), memoryview(out))
        with contextlib.suppress(RuntimeError), contextlib.redirect_stderr(io.StringIO()):
            trigger()
        done = int(np.sum(np.all(np.isfinite(out), axis=1)))
        return np.concatenate([[0.0], self.s, self.s[-1:]])[[done, done + 1]]


_compiled: WeakKeyDictionary[System, ca.Function] = WeakKeyDictionary()


def _motion(system: System) -> ca.Function:
    """Return the scaled equations of motion in CasADi's form for integrators, derived once."""
    if system not in _compiled:
        _compiled[system] = _derive(system)
    return _compiled[system]


def _derive(system: System) -> ca.Function:
    """Derive dx/ds for x = (q / units, v / units), with parameters (p, t0, T, c, units)."""
    sym, n, m = system.symbols, system.n, system.m
    M, bias, G, gamma = system.motion
    s, x = ca.SX.sym("s"), ca.SX.sym("x", 2 * n)
    t0, T, c = ca.SX.sym("t0"), ca.SX.sym("T"), ca.SX.sym("c")
    units, rows = ca.SX.sym("units", 2 * n), ca.SX.sym("rows", n + m)
    drift = G @ sym.v + ca.jacobian(system.f, sym.t)
    K = ca.blockcat([[M, -G.T], [G, ca.SX(m, m)]])
    right = ca.vertcat(bias, -gamma - 2 * c * drift - c**2 * system.f)
    here = units * x
    K, right, v = ca.substitute(
        [ca.diag(rows) @ K @ ca.diag(rows), rows * right, sym.v],
        [sym.q, sym.v, sym.t],
        [here[:n], here[n:], t0 + s * T],
    )
    p = ca.vertcat(sym.p, t0, T, c, units, rows)
    equations = ca.Function("equations", [s, x, p], [K, right, v, T / units, rows[:n]])

    # A sparse QR node solves for the accelerations: closed formulas for more than a few
    # coordinates are slower to build and slower to evaluate. The equations are equilibrated,
    # and its own threshold, which would be absolute, is off.
    S, X, P = ca.MX.sym("s"), ca.MX.sym("x", 2 * n), ca.MX.sym("p", p.numel())
    K, right, v, factor, r = equations(S, X, P)
    a = r * ca.solve(K, right, "qr", {"eps": 0.0})[:n]
    none = ca.MX(0, 1)
    inputs = {"t": S, "x": X, "z": none, "p": P, "u": none}
    ode = ca.densify(factor * ca.vertcat(v, a))
    outputs = {"ode": ode, "alg": none, "quad": none, "zero": none}
    return ca.Function("motion", inputs | outputs, list(inputs), list(outputs))


def _of(state: State) -> str:
    return f"at t = {state.t}, q = {state.q}, v = {state.v}"
