"""Compare a solution with forward integration, to see whether a motion goes its way.

A discrete problem can have solutions that are no paths at all, and its own residual does not
tell. The equations of motion do: they know nothing of the mesh or of the second event. Followed
from the solution's start they must stay on it and arrive. Where motions amplify small errors
nothing stays on anything for long, so the solution is also asked piece by piece; and how much they
amplify is told by motions with slightly other velocities.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import casadi as ca
import numpy as np

from actionopt.flow import LONGEST, Flow, IntegrationError, Units
from actionopt.forward import FINEST, LOCAL, integrate, steps_within
from actionopt.path import Path
from actionopt.pointwise import Pointwise
from actionopt.problem import Problem, State
from actionopt.quadratic_form import tangent
from actionopt.quadrature import Array

if TYPE_CHECKING:
    from actionopt.solution import Solution

PIECES = 100  # at most; more say no more
PIECEWISE = 1e-14  # local tolerance there
CUTS = 2000  # at most, of pieces too unstable to say anything
CUT = 0.38  # not in halves: a kink is where elements meet, and would hide between the parts
UNSTABLE = 100.0  # amplification within a piece that is cut
LOOSER = 10.0  # the second tolerance, relative to the first
SHORTER = 0.6  # the second run's longest step, relative to the first's
MARGIN = 100.0  # from an estimated error to a deviation that contradicts it
EXCUSE = 10.0  # from what a motion makes of a small change to what needs none
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
        kink where elements meet shows. What is more than `allowed` is looked at in shorter
        pieces if these amplify errors, and divided by what is left of that beyond ten times.
    energy_drift : float
        Largest violation of the energy balance H(t) - H(t0) = work done since t0, at element
        boundaries, along the solution, in units of the largest |v . p|. The work is zero and
        H is conserved unless time or forces enter.
    reference_error : float
        Uncertainty of the forward integration: how far `path` is, in position, from an
        integration with ten times its tolerance and other steps.
    allowed : float
        The deviation that is compatible with the solution's own estimate of its error.
    amplified : float
        What a relative change of the start's velocity by `allowed` makes of the position on the
        way; zero where `position` is allowed anyway.
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
    amplified: float
    path: Path

    @property
    def agrees(self) -> bool:
        """Whether the solution is a motion: as a whole, or piece by piece with an excuse for it.

        The excuse is that the motion amplifies a change that is allowed to what is found, or
        to so much that the whole tells nothing, or that its integration is as uncertain.
        """
        excuse = max(self.amplified, self.reference_error)
        excused = excuse >= CERTAIN or self.position <= EXCUSE * excuse
        return self.position <= self.allowed or (self.local <= self.allowed and excused)


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
    allowed = min(MARGIN * max(solution.error, tol), CERTAIN)
    local, longest = max(LOCAL * tol, FINEST), steps_within(solution.mesh)
    own = Units.of(path.values, path.velocities, rows)
    s = (t[1:] - start.t) / span

    def again(state: State, tolerance: float, longest: float) -> float:
        """Return the largest deviation of another integration from the first."""
        try:
            other, _ = flow.integrator(s, tolerance, longest)(state, span, own, path.mesh.elements)
        except IntegrationError:  # so near a singularity that nothing is certain
            return np.inf
        return float(_deviation(other, path.values[:, 1:], units.q).max())

    changed = position.max() > allowed
    return Comparison(
        position=float(position.max()),
        velocity=float(_deviation(v, path.velocities, units.v).max()),
        arrival=float(position[-1]),
        local=_piece_by_piece(solution, flow, units, allowed),
        energy_drift=_energy_drift(problem, path, q, v),
        reference_error=again(start, LOOSER * local, SHORTER * longest),
        allowed=allowed,
        amplified=again(_changed(problem, start, units, allowed), local, longest) if changed else 0,
        path=path,
    )


def _deviation(values: Array, others: Array, size: Array) -> Array:
    """Return the largest difference of a row in units of its size, at each of K times, (K,)."""
    return np.max(np.abs(values - others) / size[:, None], axis=0)


def _changed(problem: Problem, state: State, units: Units, part: float) -> State:
    """Return the state with the velocity changed by `part` of its size, as constraints allow."""
    ones = np.ones(state.q.size)
    basis = tangent(problem, state.q[None], np.array([[state.t]]), ones)[0]
    # In no special direction: those of symmetry may be the stable ones.
    change = part * units.v * np.cos(1.0 + np.arange(state.q.size))
    return State(state.t, state.q, state.v + basis @ (basis.T @ change))


def _piece_by_piece(solution: Solution, flow: Flow, units: Units, allowed: float) -> float:
    """Return the largest deviation of motions from the middle of a piece to that of the next.

    In the middle of an element the velocity of a polynomial is far better than at its ends.
    """
    b = solution.mesh.boundaries
    count = min(b.size - 1, PIECES)
    b = b[np.linspace(0, b.size - 1, count + 1).round().astype(int)]
    times = np.concatenate([b[:1], (b[:-1] + b[1:]) / 2, b[-1:]])
    s = np.array([0.25, 0.5, 0.75, 1.0])
    follow = flow.integrator(s, PIECEWISE, min(LONGEST * count, s[0]))
    pieces, cuts, worst = list(pairwise(times)), 0, 0.0
    while pieces:
        a, end = pieces.pop()
        state = State(a, solution(a), solution.velocity(a)) if a > b[0] else solution.start
        there, _ = follow(state, end - a, units)
        found = _deviation(solution(a + s * (end - a)), there, units.q).max()
        if found > allowed:
            changed = _changed(solution.problem, state, units, allowed)
            other, _ = follow(changed, end - a, units)
            gain = _deviation(other, there, units.q).max() / allowed
            if gain > UNSTABLE and cuts < CUTS:
                cuts += 1
                cut = a + CUT * (end - a)
                pieces += [(a, cut), (cut, end)]
                continue
            found /= max(1.0, gain / EXCUSE)
        worst = max(worst, found)
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
