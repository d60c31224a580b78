"""Forward integration of the equations of motion, with CVODES from SUNDIALS through CasADi.

This is the other way to the path: it knows nothing of the action, only of the Euler-Lagrange
equations, and so it can contradict a solution. The integrator works on s in [0, 1] with
t = t0 + s T and with every coordinate and velocity in units of its own size, so that one
tolerance means the same for atoms and for planets.
"""

from __future__ import annotations

import contextlib
import io
from collections.abc import Mapping
from dataclasses import dataclass
from weakref import WeakKeyDictionary

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from actionopt.path import Mesh, Path
from actionopt.problem import SURFACE_TOLERANCE, State
from actionopt.quadrature import Array
from actionopt.system import System

DEGREE = 12  # of the elements of the path
ROUNDS = 12  # of splitting elements before giving up
LOCAL = 1e-3  # CVODES bounds the error of one step; some hundred of them add up
FINEST = 1e-15  # below this local tolerance CVODES gains nothing
ROUGH = 1e-8  # local tolerance of the run that finds the sizes
CONDITION = 1e13  # of the equilibrated equations: accelerations beyond it are round-off


class IntegrationError(RuntimeError):
    """The forward integration could not be continued; the message says at what time."""


@dataclass(frozen=True, eq=False)
class Units:
    """What the integrator measures in: sizes of q and v, shape (n,), and of the equations.

    `rows` (n + m,) equilibrates the matrix of the index-1 equations, whose entries have as
    many units as there are pairs of coordinates.
    """

    q: Array
    v: Array
    rows: Array


def sizes(values: Array, least: float = 1e-14) -> Array:
    """Return the largest magnitude of each row of (n, K), shape (n,): always positive.

    A row that is zero up to round-off is given the size of the largest row, or 1.
    """
    size = np.max(np.abs(values), axis=1)
    largest = float(np.max(size))
    return np.where(size > least * largest, size, largest if largest > 0 else 1.0)


class Flow:
    """The equations of motion of a system at given parameters, ready for CVODES.

    Unconstrained they are M a = bias. With constraints the index-1 form is integrated,

        M a - G' lam = bias,      G a + gamma + 2 c (G v + f_t) + c^2 f = 0,

    in which Baumgarte's two terms, zero on every exact motion, make drift off the surface decay
    at the rate c.

    References
    ----------
    Baumgarte, Computer Methods in Applied Mechanics and Engineering 1 (1972) 1-16.
    """

    def __init__(self, system: System, parameters: Mapping[str, ArrayLike] | None = None) -> None:
        self.system = system
        self.parameters = system.table.values(parameters)
        self._packed = system.table.pack(self.parameters)[0]
        self._dae = _dae(system)

    def solver(self, s: Array, tolerance: float) -> ca.Function:
        """Return the integrator from s = 0 with output at the K increasing times `s` <= 1."""
        options = {
            "abstol": tolerance,
            "reltol": tolerance,
            "linear_multistep_method": "adams",
            "nonlinear_solver_iteration": "functional",
            "max_num_steps": 200_000,
            "disable_internal_warnings": True,
            "show_eval_warnings": False,
        }
        return ca.integrator("forward", "cvodes", self._dae, 0.0, s, options)

    def run(
        self, solver: ca.Function, state: State, span: float, units: Units, rate: float = 10.0
    ) -> tuple[Array, Array]:
        """Integrate over the times t0 + s `span`; return q and v at the outputs, each (n, K).

        `rate` is c in units of 1 / span. Raises IntegrationError if CVODES gives up.
        """
        start = np.concatenate([state.q / units.q, state.v / units.v])
        values = np.concatenate(
            [self._packed, [state.t, span, rate / span], units.q, units.v, units.rows]
        )
        said = io.StringIO()
        try:
            with contextlib.redirect_stderr(said):
                out = solver(x0=start, p=values)["xf"].full()
        except RuntimeError as error:
            if "KeyboardInterrupt" in said.getvalue():
                raise KeyboardInterrupt from None
            raise IntegrationError(_where(solver, start, values, state.t, span)) from error
        n = self.system.n
        return out[:n] * units.q[:, None], out[n:] * units.v[:, None]

    def first_units(self, state: State, span: float) -> Units:
        """Return sizes as far as the start tells: from q, else from v and T, else from a and T.

        Raises ValueError if the equations of motion cannot be solved there.
        """
        rows = self._equilibrate(state)
        a = np.abs(self.system.acceleration(state.q, state.v, state.t, parameters=self.parameters))
        q, v, T = np.abs(state.q), np.abs(state.v), abs(span)
        v = np.where(v > 0, v, a * T)
        return Units(
            sizes(np.where(q > 0, q, v * T)[:, None], 0.0), sizes(v[:, None], 0.0), rows
        )

    def _equilibrate(self, state: State) -> Array:
        """Return r so that diag(r) K diag(r) has rows of size one, K the index-1 matrix."""
        n, m = self.system.n, self.system.m
        M = self.system.mass_matrix(state.q, state.v, state.t, parameters=self.parameters)
        G = self.system.constraint_jacobian(state.q, state.t, parameters=self.parameters)
        K = np.block([[M, -G.T], [G, np.zeros((m, m))]])
        where = f"at the start, t = {state.t}, q = {state.q}, v = {state.v}"
        if not np.all(np.isfinite(K)):
            raise ValueError(f"expected finite equations of motion {where}, found NaN or infinity")
        r = np.ones(n + m)
        if np.all(np.any(K != 0, axis=1)):
            for _ in range(5):  # Ruiz scaling
                r /= np.sqrt(np.max(np.abs(K * r * r[:, None]), axis=1))
            if np.linalg.cond(K * r * r[:, None]) < CONDITION:
                return r
        raise ValueError(
            f"expected equations of motion that can be solved for the accelerations {where}, "
            "found a singular mass matrix (or dependent constraints); a coordinate without "
            "kinetic energy, or one constraint too many, has to go"
        )


_cache: WeakKeyDictionary[System, ca.Function] = WeakKeyDictionary()


def _dae(system: System) -> ca.Function:
    """Return the scaled equations of motion in CasADi's form for integrators, compiled once."""
    if system in _cache:
        return _cache[system]
    sym, n, m = system.symbols, system.n, system.m
    M, bias, G, gamma = system.motion
    s, x = ca.SX.sym("s"), ca.SX.sym("x", 2 * n)
    t0, T, rate = ca.SX.sym("t0"), ca.SX.sym("T"), ca.SX.sym("c")
    units = ca.SX.sym("units", 3 * n + m)
    r = units[2 * n :]
    drift = ca.jacobian(system.f, sym.t) + G @ sym.v
    K = ca.blockcat([[M, -G.T], [G, ca.SX(m, m)]])
    right = ca.vertcat(bias, -gamma - 2 * rate * drift - rate**2 * system.f)
    K, right = ca.substitute(
        [ca.diag(r) @ K @ ca.diag(r), r * right],
        [sym.q, sym.v, sym.t],
        [units[:n] * x[:n], units[n : 2 * n] * x[n:], t0 + s * T],
    )
    p = ca.vertcat(sym.p, t0, T, rate, units)
    equations = ca.Function("equations", [s, x, p], [K, right])

    # The linear system is solved by a node of sparse QR: closed formulas of more than a few
    # coordinates are slower to build and to evaluate.
    S, X, P = ca.MX.sym("s"), ca.MX.sym("x", 2 * n), ca.MX.sym("p", p.numel())
    K, right = equations(S, X, P)
    a = ca.solve(K, right, "qr", {"eps": 0.0})[:n]
    k = system.symbols.p.numel()
    T, U, r = P[k + 1], P[k + 3 : k + 3 + 2 * n], P[k + 3 + 2 * n :]
    ode = T * ca.vertcat(U[n:] * X[n:], r[:n] * a) / U
    none = ca.MX(0, 1)
    inputs = {"t": S, "x": X, "z": none, "p": P, "u": none}
    outputs = {"ode": ode, "alg": none, "quad": none, "zero": none}
    _cache[system] = ca.Function("motion", inputs | outputs, list(inputs), list(outputs))
    return _cache[system]


def _where(solver: ca.Function, start: Array, values: Array, t0: float, span: float) -> str:
    """Return a sentence that says how far the integrator came: the outputs before it are kept."""
    s = np.array(solver.info()["grid"]) if False else None
    raise NotImplementedError


def integrate(
    system: System,
    state: State,
    t_end: float,
    *,
    tol: float = 1e-12,
    parameters: Mapping[str, ArrayLike] | None = None,
    mesh: Mesh | None = None,
) -> Path:
    """doc."""
    span = t_end - state.t
    flow = Flow(system, parameters)
    units = flow.first_units(state, span)
    s = np.linspace(0.0, 1.0, 65)[1:]
    solver = flow.solver(s, ROUGH)
    q, v = flow.run(solver, state, span, units)
    units = Units(sizes(q), sizes(v), units.rows)
    steps = solver.stats()["nsteps"]
    if mesh is None:
        mesh = Mesh.uniform(0.0, 1.0, max(4, steps // 16), DEGREE)
    tight, goal = max(LOCAL * tol, FINEST), max(tol, 100 * FINEST)
    for round in range(ROUNDS):
        solver = flow.solver(mesh.nodes[1:], tight)
        q, v = flow.run(solver, state, span, units, mesh.elements)
        q = np.hstack([state.q[:, None], q])
        v = np.hstack([state.v[:, None], v])
        last, units = units, Units(sizes(q), sizes(v), units.rows)
        change = np.concatenate([units.q / last.q, units.v / last.v])
        tails = _tails(mesh, np.vstack([q / units.q[:, None], v / units.v[:, None]]))
        pieces = np.clip(np.ceil((tails / goal) ** (1 / DEGREE)), 1, 8).astype(int)
        print(round, mesh.elements, steps, solver.stats()["nsteps"], pieces.max(), change.min(), change.max(), tails.max())
        if pieces.max() == 1:
            break
        mesh = _split(mesh, pieces)
    b = state.t + span * mesh.boundaries
    b[-1] = t_end
    return Path(Mesh(b, mesh.degrees), q, v)


def _tails(mesh: Mesh, table: Array) -> Array:
    """Return the larger of each element's last two Legendre coefficients in magnitude, (N,)."""
    tails = np.empty(mesh.elements)
    for rule, which, index in mesh.groups:
        last = table[:, index] @ rule.to_legendre[-2:].T
        tails[which] = np.max(np.abs(last), axis=(0, 2))
    return tails


def _split(mesh: Mesh, pieces: Array) -> Mesh:
    """Return the mesh with element e cut into pieces[e] equal ones of the same degree."""
    b = mesh.boundaries
    parts = [np.linspace(b[e], b[e + 1], k, endpoint=False) for e, k in enumerate(pieces)]
    return Mesh(np.concatenate([*parts, b[-1:]]), np.repeat(mesh.degrees, pieces))
