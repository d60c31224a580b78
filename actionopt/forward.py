"""Forward integration of the equations of motion, with CVODES from SUNDIALS through CasADi.

This is the other way to a path: it knows nothing of the action, only of the Euler-Lagrange
equations, and so it can contradict a solution. The integrator works on s in [0, 1] with
t = t0 + s T, and with every coordinate and velocity in units of its own size, so that one
tolerance means the same for atoms and for planets.
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

from actionopt.checks import number, tolerance
from actionopt.path import ROUNDOFF, Mesh, NDInt, Path
from actionopt.problem import SURFACE_TOLERANCE, State
from actionopt.quadrature import Array
from actionopt.system import System

DEGREE = 12  # of the elements of the path
ROUNDS = 12  # of splitting elements before giving up
ENOUGH = 8.0  # times finer than predicted: a round costs more than some elements
NUMBERS = 30_000_000  # coordinates and velocities at all nodes: more do not fit into memory
LONGEST = 1 / 200  # of the duration: a longer step might pass over a force that acts for a moment
NARROWEST = 1e-4  # of the duration: no element given asks for steps shorter than that
STEPS = 50_000  # of CVODES between two outputs; a regular motion needs some tens
LOCAL = 1e-3  # CVODES bounds the error of one step; some hundred of them add up
FINEST = 5e-16  # below this local tolerance CVODES gains nothing
ROUGH = 1e-8  # local tolerance of the run that finds the sizes
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


def integrate(
    system: System,
    state: State,
    t_end: float,
    *,
    tol: float = 1e-12,
    parameters: Mapping[str, ArrayLike] | None = None,
    mesh: Mesh | None = None,
) -> Path:
    """Integrate the Euler-Lagrange equations from `state` to `t_end`, forwards or backwards.

    Parameters
    ----------
    system : System
        The physics, constraints and forces included.
    state : State
        Time, coordinates and velocities to begin with.
    t_end : float
        Where to end; before `state.t`, the motion is followed backwards.
    tol : float
        What the path resolves, from 1e-14 to 0.1, in units of the size of each coordinate along
        the path, and of each velocity. CVODES is asked for a thousandth of it a step, so that
        this is also the order of the error of motions that do not amplify errors; 1e-13 is
        the least that is of use.
    parameters : mapping, optional
        Overrides the system's defaults by name; nothing is derived again.
    mesh : Mesh, optional
        Elements to begin with, over the same times; those that do not resolve the motion
        are split, and CVODES takes no step longer than the shortest of them. By default chosen
        from the number of steps that CVODES takes, of which there are two hundred at least: a
        force that acts for a thousandth of the time is noticed, one for much less may not be.

    Returns
    -------
    Path
        With the velocities stored.

    Raises
    ------
    ValueError
        If an argument does not fit, the state lies off the constraint surface or moves off it,
        or the equations of motion cannot be solved for the accelerations.
    IntegrationError
        If the motion cannot be followed to `t_end`.

    References
    ----------
    Hindmarsh et al., *SUNDIALS*, ACM Transactions on Mathematical Software 31 (2005) 363-396:
    variable-order Adams methods.

    Examples
    --------
    >>> fall = System(lambda q, v, t: v[0] ** 2 / 2 - q[0], ["z"])
    >>> path = integrate(fall, State(0.0, [1.0], [0.0]), 1.0)
    >>> bool(abs(path(1.0)[0] - 0.5) < 1e-12)
    True
    """
    span = _check(system, state, t_end, tol)
    flow = Flow(system, parameters)
    units = flow.first_units(state, span)
    _check_on_surface(flow, state, span)
    units, steps = _look_ahead(flow, state, span, units)
    if mesh is None:
        scaled = Mesh.uniform(0.0, 1.0, max(4, steps // DEGREE), DEGREE)
    else:
        scaled = _scaled(mesh, state.t, t_end)
    scaled, q, v = _resolve(flow, state, span, units, scaled, tol)
    times = state.t + span * scaled.boundaries
    times[-1] = t_end
    if span > 0:
        return Path(Mesh(times, scaled.degrees), q, v)
    return Path(Mesh(times[::-1], scaled.degrees[::-1]), q[:, ::-1], v[:, ::-1])


def _look_ahead(flow: Flow, state: State, span: float, units: Units) -> tuple[Units, int]:
    """Return the units of the motion, and the number of steps, from rough integrations."""
    rough = flow.integrator(np.linspace(0.0, 1.0, 65)[1:], ROUGH)
    for _ in range(ROUNDS):
        last = units
        q, v = rough(state, span, units)
        units = Units.of(np.column_stack([state.q, q]), np.column_stack([state.v, v]), units.rows)
        if units.agree(last):
            break
    return units, rough.steps


def _resolve(
    flow: Flow, state: State, span: float, units: Units, mesh: Mesh, tol: float
) -> tuple[Mesh, Array, Array]:
    """Integrate and split elements until q and v (n, K) are resolved; mesh of scaled times."""
    local, goal = max(LOCAL * tol, FINEST), max(tol, 200 * FINEST)
    longest = steps_within(mesh)
    for _ in range(ROUNDS):
        follow = flow.integrator(mesh.nodes[1:], local, longest)
        q, v = follow(state, span, units, mesh.elements)
        q, v = np.column_stack([state.q, q]), np.column_stack([state.v, v])
        tails = _tails(mesh, np.vstack([q / units.q[:, None], v / units.v[:, None]]))
        # A coefficient of degree d goes with the d-th power of the length; not yet quite so
        # where the motion is far from resolved.
        power = 1 / np.maximum(np.array(mesh.degrees) - 2, 1)
        pieces = np.clip(np.ceil((ENOUGH * tails / goal) ** power), 1, 8).astype(int)
        pieces[tails <= goal] = 1
        if np.all(pieces == 1):
            return mesh, q, v
        mesh, unresolved = _split(mesh, pieces), mesh.boundaries[:-1][pieces > 1]
        if 2 * q.shape[0] * mesh.nodes.size > NUMBERS:
            break
    worst = state.t + span * unresolved[0]
    raise IntegrationError(
        f"the motion from t = {worst:.6g} on is not resolved by {mesh.elements} elements: it runs "
        "into a singularity there, such as a collision, or is not smooth, or takes too long; end "
        "before that time, or ask for a larger tol"
    )


def steps_within(mesh: Mesh) -> float:
    """Return the longest step, of the duration, that passes over no element of the mesh."""
    shortest = float(mesh.lengths.min() / (mesh.boundaries[-1] - mesh.boundaries[0]))
    return min(max(shortest, NARROWEST), LONGEST)


def _tails(mesh: Mesh, table: Array) -> Array:
    """Return the larger of each element's last two Legendre coefficients in magnitude, (N,).

    Less the round-off of time, which the rates amplify.
    """
    tails = np.empty(mesh.elements)
    for rule, which, index in mesh.groups:
        values = table[:, index]
        last = np.max(np.abs(values @ rule.to_legendre[-2:].T), axis=2)
        rates = np.max(np.abs(values @ rule.derivative.T), axis=2) * (2 / mesh.lengths[which])
        tails[which] = np.max(last - ROUNDOFF * rates, axis=0, initial=0.0)
    return tails


def _split(mesh: Mesh, pieces: NDInt) -> Mesh:
    """Return the mesh with element e cut into pieces[e] equal ones of the same degree."""
    b = mesh.boundaries
    parts = [np.linspace(b[e], b[e + 1], k, endpoint=False) for e, k in enumerate(pieces)]
    return Mesh(np.concatenate([*parts, b[-1:]]), np.repeat(mesh.degrees, pieces))


def _scaled(mesh: Mesh, t0: float, t1: float) -> Mesh:
    """Return the mesh over scaled times 0 to 1, with elements of at least degree `DEGREE`."""
    if not isinstance(mesh, Mesh):
        raise ValueError(f"expected a Mesh(boundaries, degrees) or None, found {mesh!r}")
    ends = sorted([t0, t1])
    if not np.allclose(mesh.boundaries[[0, -1]], ends, rtol=0, atol=1e-9 * (ends[1] - ends[0])):
        raise ValueError(
            f"expected a mesh over the times {ends[0]} to {ends[1]}, found one from "
            f"{mesh.boundaries[0]} to {mesh.boundaries[-1]}; use mesh.moved"
        )
    s = (mesh.moved(*ends).boundaries - t0) / (t1 - t0)
    degrees = np.maximum(mesh.degrees, DEGREE)
    return Mesh(s, degrees) if t1 > t0 else Mesh(s[::-1], degrees[::-1])


def _check(system: System, state: State, t_end: float, tol: float) -> float:
    """Return the time span, or raise ValueError for arguments that do not fit."""
    if not isinstance(system, System):
        raise ValueError(f"expected a System(lagrangian, coordinates), found {system!r}")
    if not isinstance(state, State):
        raise ValueError(f"expected a State(t, q, v) to begin with, found {state!r}")
    if state.q.size != system.n:
        raise ValueError(
            f"expected a state of {system.n} coordinates ({', '.join(system.coordinates)}), "
            f"found {state.q.size}"
        )
    tolerance(tol)
    end = number(t_end, "t_end")
    if end == state.t:
        raise ValueError(f"expected a t_end other than the start {state.t}, found {end}")
    return end - state.t


def _check_on_surface(flow: Flow, state: State, span: float) -> None:
    """Raise ValueError if the state is off the constraints, or about to leave them."""
    system, parameters = flow.system, flow.parameters
    if not system.m:
        return
    packed = system.table.pack(system.table.values(parameters))
    q, t = state.q[None, :], np.array([[state.t]])
    f = system.constraint(state.q, state.t, parameters=parameters)
    G = system.constraint_jacobian(state.q, state.t, parameters=parameters)
    f_t = system.pointwise("constraint_rate")(q, t, packed)[0][0].copy()
    # What f changes by when q and t change by their own size: |f| alone has no scale. A rate is
    # as bad as what it does to f over the whole time.
    length = np.where(state.q != 0, np.abs(state.q), np.max(np.abs(state.q)))
    scale = np.abs(G) @ length + np.abs(f_t * span)
    rate = G @ state.v + f_t
    rate_scale = np.abs(G) @ np.abs(state.v) + np.abs(f_t) + scale / abs(span)
    for what, found, size, remedy in (
        ("on the constraint surface", f, scale, "move it onto f(q, t) = 0"),
        ("moving along it", rate, rate_scale, "choose v with G v = -df/dt"),
    ):
        bad = np.abs(found) > SURFACE_TOLERANCE * np.maximum(size, np.finfo(float).tiny)
        if np.any(bad):
            i = int(np.flatnonzero(bad)[0])
            raise ValueError(
                f"expected a state {what}, found {'f' if found is f else 'df/dt'} = "
                f"{found[i]:.6g} in constraint row {i}; {remedy}"
            )
