"""The equations of motion as a flow, integrated with CVODES from SUNDIALS through CasADi.

The integrator works on s in [0, 1] with t = t0 + s T, and with every coordinate and velocity in
units of its own size, so that one tolerance means the same for atoms and for planets.
"""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from actionopt.mechanics.question.events import State
from actionopt.mechanics.system import System
from actionopt.tools.immutable import immutable
from actionopt.tools.interrupts import raised_later
from actionopt.tools.types import Array

# Ad hoc. A longer step, in parts of the duration, might pass over a force that acts for a moment;
# between two outputs a regular motion needs some tens of steps.
CVODES_LONGEST, CVODES_STEPS = 1 / 200, 50_000
# A coordinate this much smaller than the others is zero; ad hoc: a motion integrated roughly
# leaves more than round-off (`scales.NEGLIGIBLE`) in it.
ZERO_SIZE = 1e-10
NOISE_STATES, NOISE_QUANTILE = 16, 0.9  # states that tell the round-off, and which; ad hoc
STEP_NOISE = 0.1  # of the noise of a step is what CVODES sees of it at high orders; ad hoc
ROUGH_LOCAL = 1e-8  # local tolerance of the run that finds the sizes
# Condition of the equilibrated equations; derived: accelerations are then good to 1e13 eps = 0.2%.
MAX_CONDITION = 1e13


class IntegrationError(RuntimeError):
    """The forward integration could not be continued; the message says at what time.

    Attributes
    ----------
    t : float
        Up to here it was possible; NaN if that is not known.
    """

    def __init__(self, message: str, t: float = np.nan) -> None:
        super().__init__(message)
        self.t = t


@immutable
class FlowUnits:
    """The units of an integrator: sizes of q and of v, shape (n,), and of the equations.

    `rows` (n + m,) equilibrates the matrix of the index-1 equations, whose entries have as
    many units as there are pairs of coordinates. Its first n go with the inverse root of each
    coordinate's inertia.
    """

    q: Array
    v: Array
    rows: Array

    @classmethod
    def of(cls, q: Array, v: Array, rows: Array) -> FlowUnits:
        """Return the units in which the coordinates and velocities (n, K) have size one."""
        metric = rows[: len(q)]
        return cls(sizes(q, metric), sizes(v, metric), rows)

    def above(self, noise: Array, step: float, tolerance: float) -> tuple[FlowUnits, float]:
        """Return units and a tolerance that round-off allows: neither is smaller than it was.

        Accelerations uncertain by `noise` (n,) make velocities uncertain by noise * step and
        coordinates by noise * step^2 in a step. Where CVODES is asked for much less, it takes
        ever shorter steps in vain.
        """
        noise = noise * STEP_NOISE
        tolerance = max(tolerance, float(np.max(noise * step**2 / self.q)))
        v = np.maximum(self.v, noise * step / tolerance)
        return FlowUnits(self.q, v, self.rows), tolerance

    def agree(self, other: FlowUnits) -> bool:
        """Whether the two differ by less than a factor of two."""
        ratio = np.concatenate([self.q / other.q, self.v / other.v])
        return bool(np.all((ratio > 0.5) & (ratio < 2.0)))


def sizes(values: Array, metric: Array) -> Array:
    """Return the largest magnitude of each row of (n, K), shape (n,): always positive.

    A row that is zero up to `ZERO_SIZE` is given the size of the largest row instead, or 1.
    Coordinates may differ in unit and in mass, so it must be that small both as it stands and
    divided by the `metric` (n,), the inverse root of the inertias.
    """
    size = np.max(np.abs(values), axis=1)
    natural = size / metric
    zero = (size <= ZERO_SIZE * size.max()) & (natural <= ZERO_SIZE * natural.max())
    return np.where(zero, size.max() if size.max() > 0 else 1.0, size)


@immutable
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

    def rough(self, local: float) -> float:
        """Return the tolerance of the run that finds the sizes, before one to `local`."""
        return max(ROUGH_LOCAL, local)

    def integrator(self, s: Array, tolerance: float, longest: float = CVODES_LONGEST) -> Integrator:
        """Return the integrator from s = 0 with output at the K increasing times `s` <= 1.

        It takes no steps longer than `longest`.
        """
        options = {
            "abstol": tolerance,
            "reltol": tolerance,
            "linear_multistep_method": "adams",
            "nonlinear_solver_iteration": "functional",
            "max_num_steps": CVODES_STEPS,
            "max_step_size": longest,
            "disable_internal_warnings": True,
            "show_eval_warnings": False,
        }
        with self.system.lock:
            motion = self.system.memoize("flow", lambda: scaled_motion(self.system))
            function = ca.integrator("forward", "cvodes", motion, 0.0, s, options)
        table = self.system.table
        return Integrator(function, s, table.pack(table.values(self.parameters))[0])

    def first_units(self, state: State, span: float) -> FlowUnits:
        """Return sizes as far as the start tells: they err on the large side.

        Raises ValueError if the equations of motion cannot be solved there.
        """
        rows = self.equilibrate(state)
        a = self.system.acceleration(state.q, state.v, state.t, parameters=self.parameters)
        if not np.all(np.isfinite(a)):
            raise ValueError(
                f"expected finite accelerations {_of(state)}, found {a}; begin where the "
                "Lagrangian and its derivatives are finite"
            )
        v = np.abs(state.v) + np.abs(a * span)
        return FlowUnits.of((np.abs(state.q) + v * abs(span))[:, None], v[:, None], rows)

    def round_off(self, q: Array, v: Array, t: Array) -> Array:
        """Return what the last digits of q, v (n, K) and t (K,) do to the accelerations, (n,).

        A high quantile over states along the motion tells: at a few a force may be about to jump.
        """
        some = slice(None, None, max(1, q.shape[1] // NOISE_STATES))
        q, v, t = q[:, some], v[:, some], t[some]
        both = [np.concatenate([x, x + np.spacing(x)], axis=-1) for x in (q, v, t)]
        try:
            a = self.system.acceleration(*both, parameters=self.parameters)
        except (ValueError, np.linalg.LinAlgError):  # not finite or singular: CVODES will tell
            return np.zeros(len(q))
        change = np.sort(np.nan_to_num(np.abs(a[:, t.size :] - a[:, : t.size]), posinf=0.0))
        return change[:, int(NOISE_QUANTILE * (t.size - 1))]

    def equilibrate(self, state: State) -> Array:
        """Return r so that diag(r) K diag(r) has rows of size one, K the index-1 matrix."""
        n, m = self.system.n, self.system.m
        M = self.system.mass_matrix(state.q, state.v, state.t, parameters=self.parameters)
        G = self.system.constraint_jacobian(state.q, state.t, parameters=self.parameters)
        K = np.block([[M, -G.T], [G, np.zeros((m, m))]])
        r = np.ones(n + m)
        if np.all(np.isfinite(K)) and np.all(np.any(K != 0, axis=1)):
            # Ruiz's scaling stops where each row has one large entry, be M ever so small in it.
            r[n:] = (np.max(np.abs(M)) or 1.0) / np.max(np.abs(G), axis=1)
            for _ in range(5):
                r /= np.sqrt(np.max(np.abs(K * r * r[:, None]), axis=1))
            K = K * r * r[:, None]
            own = np.abs(K.diagonal())  # all there is without constraints, often
            coupled = np.count_nonzero(K) > np.count_nonzero(own)
            if (np.linalg.cond(K) if coupled else own.max() / own.min()) < MAX_CONDITION:
                return r
        raise ValueError(
            f"expected equations of motion that give the accelerations {_of(state)}, found a "
            "singular mass matrix (or dependent constraints); drop the coordinate without "
            "kinetic energy, or the constraint that follows from the others"
        )


@immutable
class Integrator:
    """CVODES for one system, one tolerance and output at the scaled times `s` (K,)."""

    function: ca.Function
    s: Array
    packed: Array

    def __call__(
        self, state: State, span: float, units: FlowUnits, rate: float = 10.0
    ) -> tuple[Array, Array]:
        """Integrate from `state` over times t0 + s span; return q and v there, each (n, K).

        `rate` is Baumgarte's c in units of 1 / span. Raises IntegrationError if CVODES gives up,
        and what a signal handler raises meanwhile.
        """
        start = np.concatenate([state.q / units.q, state.v / units.v])
        times = [state.t, span, rate / span]
        values = np.concatenate([self.packed, times, units.q, units.v, units.rows])
        failure = None
        with raised_later([], stop=True):
            try:
                out = self.function(x0=start, p=values)["xf"].full()
            except RuntimeError as error:
                failure = error
        if failure is not None:
            a, b = state.t + span * self._last_times(start, values)
            raise IntegrationError(
                f"the forward integration stopped between t = {a:.6g} and t = {b:.6g}: the "
                "motion runs into a singularity there, such as a collision, is not smooth, "
                "or leaves the domain of the Lagrangian; end before that time or begin elsewhere",
                a,
            ) from failure
        n = state.q.size
        return out[:n] * units.q[:, None], out[n:] * units.v[:, None]

    @property
    def steps(self) -> int:
        """Number of steps of the last run."""
        return self.function.stats()["nsteps"]

    def _last_times(self, start: Array, values: Array) -> Array:
        """Return the scaled times of the last output before a failure and the next, shape (2,).

        Repeats the run in memory of our own, where what was written before the failure stays.
        """
        out = np.full((self.s.size, start.size), np.nan)
        buffer: Any
        buffer, trigger = self.function.buffer()
        buffer.set_arg(self.function.index_in("x0"), memoryview(start))
        buffer.set_arg(self.function.index_in("p"), memoryview(values))
        buffer.set_res(self.function.index_out("xf"), memoryview(out))
        with raised_later([], stop=True), suppress(RuntimeError):
            trigger()
        done = int(np.sum(np.all(np.isfinite(out), axis=1)))
        return np.concatenate([[0.0], self.s, self.s[-1:]])[[done, done + 1]]


def span_within(start: float, end: float) -> float:
    """Return the largest span for which no t = start + s span is rounded to beyond the end."""
    span = end - start
    while abs(start + span - start) > abs(end - start):
        span = np.nextafter(span, 0.0)
    return float(span)


def scaled_motion(system: System) -> ca.Function:
    """Return the scaled equations of motion in CasADi's form for integrators.

    They are dx/ds for x = (q / units, v / units), with parameters (p, t0, T, c, units).
    """
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

    # A sparse QR node solves for accelerations that are coupled: closed formulas for more than a
    # few coordinates are slower to build and slower to evaluate. The equations are equilibrated,
    # and its own threshold, which would be absolute, is off.
    S, X, P = ca.MX.sym("s"), ca.MX.sym("x", 2 * n), ca.MX.sym("p", p.numel())
    K, right, v, factor, r = equations(S, X, P)
    if system.has_diagonal_mass and not m:
        a = r * right / ca.diag(K)
    else:
        a = r * ca.solve(K, right, "qr", {"eps": 0.0})[:n]
    none = ca.MX(0, 1)
    inputs = {"t": S, "x": X, "z": none, "p": P, "u": none}
    ode = ca.densify(factor * ca.vertcat(v, a))
    outputs = {"ode": ode, "alg": none, "quad": none, "zero": none}
    return ca.Function("motion", inputs | outputs, list(inputs), list(outputs))


def _of(state: State) -> str:
    return f"at t = {state.t}, q = {state.q}, v = {state.v}"
