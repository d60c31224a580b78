"""Forward integration of the equations of motion.

This is the other way to a path: it knows nothing of the action, only of the Euler-Lagrange
equations (`flow`), and so it can contradict a solution.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike

from actionopt.checks import number, tolerance
from actionopt.flow import LONGEST, Flow, IntegrationError, Units
from actionopt.path import ROUNDOFF, Mesh, NDInt, Path
from actionopt.problem import SURFACE_TOLERANCE, State
from actionopt.quadrature import Array
from actionopt.system import System

DEGREE = 12  # of the elements of the path
ROUNDS = 12  # of splitting elements before giving up
ENOUGH = 8.0  # times finer than predicted: a round costs more than some elements
NUMBERS = 30_000_000  # coordinates and velocities at all nodes: more do not fit into memory
NARROWEST = 1e-4  # of the duration: no element given asks for steps shorter than that
LOCAL = 1e-3  # CVODES bounds the error of one step; some hundred of them add up
FINEST = 5e-16  # below this local tolerance CVODES gains nothing
ROUGH = 1e-8  # local tolerance of the run that finds the sizes


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
