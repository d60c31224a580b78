"""Compare a solution with forward integration, to see whether a motion goes its way.

A discrete problem can have solutions that are no paths at all, and its own residual does not
tell. The equations of motion do: they know nothing of the mesh or of the second event. Followed
from the solution's start they must stay on it and arrive. Where motions amplify small errors
nothing stays on anything for long, so the solution is also asked piece by piece.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import casadi as ca
import numpy as np

from actionopt.forward import FINEST, LOCAL, Flow, Units, integrate
from actionopt.path import Path
from actionopt.pointwise import Pointwise
from actionopt.problem import Problem, State
from actionopt.quadrature import Array

if TYPE_CHECKING:
    from actionopt.solution import Solution

PIECES = 100  # at most; more say no more
PIECEWISE = 1e-14  # local tolerance there
LOOSER = 10.0  # the second tolerance, relative to the first
MARGIN = 100.0  # from an estimated error to a deviation that contradicts it
CERTAIN = 5e-2  # a deviation that no estimated error excuses


@dataclass(frozen=True, eq=False)
class Comparison:
    """The distance between a solution and forward integration.

    Positions are in units of each coordinate's own size, the largest |q| it reaches along the
    path (as `tol` is), velocities in units of the largest |v|.

    Attributes
    ----------
    position, velocity : float
        Largest deviation over the whole time, of the motion from the solution's start.
    arrival : float
        Deviation of that motion's position at the end event.
    local : float
        Largest deviation of position from motions that begin anew, on the solution, in the
        middle of each element (or of each of a hundred groups of elements) and end in the
        middle of the next. Unlike `position` it is not amplified by unstable motions, and a
        kink where elements meet shows.
    energy_drift : float
        Largest violation of the energy balance H(t) - H(t0) = work done since t0, at element
        boundaries, along the solution, in units of the largest |v . p|. The work is zero and
        H is conserved unless time or forces enter.
    reference_error : float
        Uncertainty of the forward integration: how far `path` is, in position, from an
        integration with ten times its tolerance.
    allowed : float
        The deviation that is compatible with the solution's own estimate of its error.
    path : Path
        The forward integration, velocities included.
    """

    position: float
    velocity: float
    arrival: float
    local: float
    energy_drift: float
    reference_error: float
    allowed: float
    path: Path

    @property
    def agrees(self) -> bool:
        """Whether the solution is a motion, as a whole or at least piece by piece."""
        return min(self.position, self.local) <= self.allowed


def compare(solution: Solution, *, tol: float = 1e-12) -> Comparison:
    """Compare a solution with forward integrations from its own states.

    Parameters
    ----------
    solution : Solution
        The path to be judged.
    tol : float
        Of the forward integration; see `integrate`.

    Raises
    ------
    IntegrationError
        If the motion from the solution's start cannot be followed to the end event: it runs
        into a singularity on the way, and is not the solution.
    ValueError
        If the state at the start is not one the constraints allow.
    """
    problem, start = solution.problem, solution.start
    span, options = problem.duration, {"parameters": problem.parameters}
    path = integrate(problem.system, start, problem.end.t, tol=tol, mesh=solution.mesh, **options)
    flow = Flow(problem.system, problem.parameters)
    rows = flow.first_units(start, span).rows
    t = path.mesh.nodes
    q, v = solution(t), solution.velocity(t)
    units = Units.of(q, v, rows)
    assert path.velocities is not None
    position = _deviation(q, path.values, units.q)
    looser = flow.integrator((t[1:] - start.t) / span, LOOSER * max(LOCAL * tol, FINEST))
    other, _ = looser(start, span, Units.of(path.values, path.velocities, rows), path.mesh.elements)
    return Comparison(
        position=float(position.max()),
        velocity=float(_deviation(v, path.velocities, units.v).max()),
        arrival=float(position[-1]),
        local=_piece_by_piece(solution, flow, units),
        energy_drift=_energy_drift(problem, path, q, v),
        reference_error=float(_deviation(other, path.values[:, 1:], units.q).max()),
        allowed=min(MARGIN * max(solution.error, tol), CERTAIN),
        path=path,
    )


def _deviation(values: Array, others: Array, size: Array) -> Array:
    """Return the largest difference of a row in units of its size, at each of K times, (K,)."""
    return np.max(np.abs(values - others) / size[:, None], axis=0)


def _piece_by_piece(solution: Solution, flow: Flow, units: Units) -> float:
    """Return the largest deviation of motions from the middle of a piece to that of the next.

    In the middle of an element the velocity of a polynomial is far better than at its ends.
    """
    b = solution.mesh.boundaries
    count = min(b.size - 1, PIECES)
    b = b[np.linspace(0, b.size - 1, count + 1).round().astype(int)]
    times = np.concatenate([b[:1], (b[:-1] + b[1:]) / 2, b[-1:]])
    q, v = solution(times), solution.velocity(times)
    s = np.array([0.25, 0.5, 0.75, 1.0])
    follow = flow.integrator(s, PIECEWISE)
    worst = 0.0
    for k, span in enumerate(np.diff(times)):
        state = State(times[k], q[:, k], v[:, k]) if k else solution.start
        there, _ = follow(state, span, units)
        worst = max(worst, _deviation(solution(times[k] + s * span), there, units.q).max())
    return float(worst)


def _energy_drift(problem: Problem, path: Path, q: Array, v: Array) -> float:
    """Return the largest violation of H(t) - H(t0) = work, at the path's element boundaries.

    The work is the integral of dH/dt = -L_t + Q . v - lam . f_t: the Lagrangian's own change,
    non-conservative forces, and constraints that move.
    """
    system, parameters, mesh = problem.system, problem.parameters, path.mesh
    t, ends = mesh.nodes, mesh.offsets
    gained = system.energy(q[:, ends], v[:, ends], t[ends], parameters=parameters)
    gained = gained - gained[0]
    if system.structure.depends_on_time or system.structure.forced:
        power, work = _power(problem, q, v, t), np.empty(mesh.elements)
        for rule, which, index in mesh.groups:
            work[which] = mesh.lengths[which] / 2 * (power[index] @ rule.weights)
        gained[1:] -= np.cumsum(work)
    kinetic = np.sum(v * system.momentum(q, v, t, parameters=parameters), axis=0)
    size = float(np.max(np.abs(kinetic)))
    return float(np.max(np.abs(gained))) / (size if size > 0 else 1.0)


def _power(problem: Problem, q: Array, v: Array, t: Array) -> Array:
    """Return dH/dt of the equations of motion at K states, shape (K,)."""
    system, sym = problem.system, problem.system.symbols
    lam = ca.SX.sym("lam", system.m)
    power = -ca.jacobian(system.L, sym.t) - ca.dot(lam, ca.jacobian(system.f, sym.t))
    if system.structure.forced:
        power += ca.dot(system.Q, sym.v)
    function = Pointwise(
        ca.Function("power", [sym.q, sym.v, sym.t, sym.p, lam], [ca.densify(power)])
    )
    forces = system.multipliers(q, v, t, parameters=problem.parameters)
    return function(q.T, v.T, t[:, None], problem.packed, forces.T)[0][:, 0].copy()
