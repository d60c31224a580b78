"""How long a motion of given energy takes along a curve, before any path is known.

Along a curve q(s) the energy function H(q, u ds/dt) of the direction u = dq/ds is E at one rate
ds/dt, and the duration is the integral of ds over it. Where the potential is above E there is none:
no motion takes that curve, and a part of the largest rate is reckoned with there.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from actionopt.analysis.quadratic.shooting import hermite
from actionopt.discrete.meshes.mesh import Mesh
from actionopt.discrete.meshes.path import Path
from actionopt.mechanics.question.problem import Problem
from actionopt.mechanics.question.scales import diagonal
from actionopt.mechanics.system import System
from actionopt.solver.refinement.first_mesh import COARSE_DEGREE, COARSE_ELEMENTS
from actionopt.solver.refinement.iterate import ROUNDED
from actionopt.solver.refinement.workspace import PATIENT
from actionopt.tools.bisection import BISECTIONS, bisect
from actionopt.tools.types import Array

# How far from its start a well is looked for, of a coordinate's size, which at zero is not known:
# eight places a decade. Ad hoc, as are the next three: what comes of them is a guess.
SEEN = np.logspace(-30, 30, 481)
LEAST_RATE = 0.1  # of the largest rate: turning points are passed at a finite one
RATE_STEP = 1e6  # factor of a rate at once, at most, as its unit is unknown
LINE = 41  # points on the straight line; a guess that comes back has as many each way
# The quadrature of a duration, with one coordinate: the most points, and the part of the duration
# by which one more halving of an interval may change it.
QUADRATURE_POINTS, QUADRATURE_CHANGE = 4000, 1e-6
# Part of an energy within which a point may be a turning point, and two paths one; real part of a
# rate that is imaginary, of the largest. Derived: half the digits.
MERGED = 1e-7
# Part of the potential on a way within which its top is as high as a rest: round-off; ad hoc.
TOP_ROUNDOFF = 1e-12
# Part of a duration within which Newton's method takes over from steps towards it.
NEAR_DURATION = 0.03
FARTHEST_RETURN = 1e9  # sizes of a coordinate, beyond which the force here turns no motion; ad hoc


def rates(problem: Problem, q: Array, u: Array, t: Array) -> tuple[Array, Array]:
    """Return ds/dt (K,) at q with dq/ds = u, both (K, n), and E less the energy at rest, (K,).

    NaN where the motion cannot be; t (K, 1).
    """
    first, p = problem.system.pointwise("first"), problem.packed
    energy = problem.energy or 0.0

    def H(v: Array) -> Array:
        _, Lv, L = first(q, v, t, p)
        return np.sum(v * Lv, axis=1) - L[:, 0]

    with np.errstate(all="ignore"):
        rest = H(0 * u)
        left, rate, last, factor = energy - rest, np.ones(len(q)), None, np.ones(len(q))
        # The unit of rates is unknown: kinetic energies that are not finite are too large, and too
        # small where round-off of the potential leaves few digits of most.
        for _ in range(PATIENT):  # one where L is quadratic in v
            T = H(rate[:, None] * u) - rest
            if last is None and np.mean((MERGED * left > T) & (left < np.inf)) > 0.5:
                rate = RATE_STEP * rate
                continue
            power = 2.0 if last is None else np.log(T / last) / np.log(factor)  # of the rate
            last, ratio = T, np.abs(left / T)
            factor = np.sqrt(ratio)
            if not np.all(np.abs(factor - 1) < 1e-12):
                factor = np.where(power > 0, ratio ** (1 / power), factor)
            factor = np.where(
                np.isfinite(factor) & (factor > 0), np.clip(factor, 1 / RATE_STEP, RATE_STEP), 0.5
            )
            rate = rate * factor
            if np.all(np.abs(factor - 1) < 1e-12):
                break
    if last is None:  # there is no kinetic energy
        rate = np.ones(len(q))
    return np.where(left > 0, rate, np.nan), left


def times_along(problem: Problem, q: Array, t: float) -> tuple[Array, float] | None:
    """Return the times (K,) from zero at which a motion of the energy passes q (K, n).

    And the least of E less the energy at rest. None where it can be nowhere on the curve.
    """
    u = np.gradient(q, axis=0) * (len(q) - 1)
    found, left = rates(problem, q, u, np.full((len(q), 1), t))
    good = np.isfinite(found)
    if not good.any() or not np.any(u):
        return None
    largest = float(np.nanmax(found))
    rate = np.where(good, found, 0.0)
    mean = (rate[1:] + rate[:-1]) / 2  # exact at a constant force, from or to rest too
    steps = 1 / np.where(mean > 0, mean, LEAST_RATE * largest) / (len(q) - 1)
    return np.concatenate([[0.0], np.cumsum(steps)]), float(left.min())


def straight_passage(problem: Problem) -> tuple[Array, Array, Array] | None:
    """Return times from zero, coordinates and velocities (K,) of the motion straight to the end.

    This is for one coordinate, where all motions between two places take the same line: dt = dq / v
    by quadrature, its intervals halved until that changes the duration no more. None where the
    energy does not let it through, or does not give the velocity.
    """
    if problem.system.n > 1 or not (problem.start.pinned and problem.end.pinned):
        return None
    if not conserves_energy(problem.system) or problem.start.q == problem.end.q:
        return None
    return _passage(problem, float(problem.start.q[0]), float(problem.end.q[0]))  # type: ignore[arg-type]


def _passage(problem: Problem, a: float, b: float) -> tuple[Array, Array, Array] | None:
    """Return what `straight_passage` does, of the motion from a to b."""

    def speeds(s: Array) -> Array:
        """ds/dt where q = a + s (b - a); zero at rest, NaN where the motion cannot be."""
        q = (a + s * (b - a))[:, None]
        rate, left = rates(problem, q, np.full_like(q, b - a), np.zeros_like(q))
        return np.where(left == 0, 0.0, np.where(np.isfinite(left), rate, np.nan))

    s = np.linspace(0.0, 1.0, LINE)
    rate = speeds(s)
    for _ in range(BISECTIONS):
        middle = (s[1:] + s[:-1]) / 2
        between = speeds(middle)
        if not (np.isfinite(rate).all() and np.isfinite(between).all() and between.all()):
            return None
        # 2 ds / (v0 + v1) is exact at a constant force, from or to rest too.
        h, whole = np.diff(s), rate[1:] + rate[:-1]
        if not whole.all():
            return None
        halves = h / (rate[:-1] + between) + h / (between + rate[1:])
        change = halves - 2 * h / whole
        split = np.abs(change) > QUADRATURE_CHANGE * halves.sum()
        if not split.any() or s.size > QUADRATURE_POINTS:
            break
        at = 1 + np.flatnonzero(split)
        s, rate = np.insert(s, at, middle[split]), np.insert(rate, at, between[split])
    else:
        return None
    times = np.concatenate([[0.0], np.cumsum(halves + change / 3)])  # Richardson's extrapolation
    return times, a + s * (b - a), rate * (b - a)


def explain_barrier(problem: Problem) -> str:
    """Return why no motion has the energy, empty if one may have.

    The energy function is least at rest where L is quadratic in v with a positive mass matrix. Then
    it must not be above the energy at rest at an end, nor on the way between of one coordinate.
    """
    laws, ends = problem.laws or (problem.system,), (problem.start, problem.end)
    if not (problem.free_time and all(map(conserves_energy, laws))) or problem.closes:
        return ""
    if problem.has_moving_surface or problem.system.order > 1:  # another energy, of any size
        return ""
    n, energy = problem.system.n, float(problem.energy or 0.0)
    places = [np.array(e.q, dtype=float) if len(e.pinned) == n else None for e in ends]
    if problem.through:  # between, it may be another one
        told = [(law, q) for law, q in zip((laws[0], laws[-1]), places, strict=True)]
        found = [barrier(problem, law, q[None], energy) for law, q in told if q is not None]
        alike = all(e.t is None and not (e.on and e.on.depends_on_time) for e in problem.through)
        return next(filter(None, found), "") if alike else ""
    q = np.array([place for place in places if place is not None])
    if n == 1 and len(q) == 2:
        q = q[0] + np.linspace(0.0, 1.0, LINE)[:, None] * (q[1] - q[0])
    return barrier(problem, laws[0], q, energy) if len(q) else ""


def barrier(
    problem: Problem,
    law: System,
    q: Array,
    energy: float,
    what: str = "every motion has to pass",
) -> str:
    """Return that an energy is below the potential of the law at one of q (K, n), or nothing.

    And `what` that place is.
    """
    with np.errstate(all="ignore"):
        rest = potential(problem, q, law)
        k = int(np.argmax(np.where(np.isfinite(rest), rest, -np.inf)))
        above = MERGED * max(abs(energy), abs(rest[k])) + _roundoff(problem, law, q, energy)
        if not rest[k] - energy > above:
            return ""
    if not _is_least_at_rest(law, q[k], problem.packed_of(law)):
        return ""
    return (
        f"the energy {energy:.6g} is below the potential, {rest[k]:.6g}, at "
        f"{name_place(law, q[k])}, which {what}"
        + ("" if problem.energy is None else "; give a larger energy")
    )


def _roundoff(problem: Problem, law: System, q: Array, energy: float) -> float:
    """Return by how much a potential may be off that is as high as an energy, near q (K, n)."""
    near = q if len(q) > 1 else q + np.outer([0.0, -1.0, 1.0], problem.scales)
    with np.errstate(all="ignore"):
        rest = potential(problem, near, law)
        return TOP_ROUNDOFF * float(np.abs(rest - energy)[np.isfinite(rest)].max(initial=0.0))


def _is_least_at_rest(law: System, q: Array, packed: Array) -> bool:
    """Whether no motion has less energy at q (n,) than rest: L is quadratic in v, with a mass."""
    second = law.pointwise("second")
    v = np.stack([0 * q, *np.random.default_rng(0).normal(size=(2, law.n))])
    at = np.repeat(q[None], 3, axis=0), v, np.zeros((3, 1)), packed
    with np.errstate(all="ignore"):
        mass = second.full(2, second(*at)[2].copy(), symmetric=True)
    same = np.isfinite(mass).all() and (mass == mass[0]).all()
    return bool(same) and np.linalg.eigvalsh(mass[0])[0] > 0


def explain_rest(problem: Problem) -> str:
    """Return why no motion leads from rest, or to it, in infinite time; empty if one may.

    From a rest to the event beside it a motion has the energy of the rest, and the potential is
    above that nowhere on its way: not at the event, and with one coordinate, where it passes all
    places between, at none of these. Where the potential is as high and has no slope it would stay
    for ever.
    """
    law = problem.system
    for a, b, energy in legs_to_rest(problem):
        if law.n > 1:
            line = a + np.linspace(0.0, 1.0, LINE)[:, None] * (b - a)
            below = energy + MERGED * abs(energy) + _roundoff(problem, law, line, energy)
            places = b[None]
        else:
            places, below = _tops(problem, a, b, energy)
        height = potential(problem, places)
        k = int(np.argmax(np.where(np.isfinite(height), height, -np.inf)))
        if height[k] > below and _is_least_at_rest(law, places[k], problem.packed):
            end = "" if law.n > 1 else f" on its way to {b[0]:.6g}"
            return (
                f"a motion that rests at {name_place(law, a)} in infinite time has the energy "
                f"{energy:.6g} and does not pass {name_place(law, places[k])}{end}, where the "
                f"potential is {'as high' if law.n == 1 else f'{height[k]:.6g}'}"
            )
    return ""


def legs_to_rest(problem: Problem) -> Iterator[tuple[Array, Array, float]]:
    """Yield a rest (n,) of infinite time, the event beside it, (n,), and the energy of motions.

    Where that is kept, and both are given.
    """
    law, events = problem.system, problem.joints_found
    if law.order > 1 or problem.laws or problem.closes or not conserves_energy(law):
        return
    for rest, beside in ((events[0], events[1]), (events[-1], events[-2])):
        given = len(rest.pinned) == len(beside.pinned) == law.n
        if rest.t is None or np.isfinite(rest.t) or not given or rest.q == beside.q:
            continue
        a, b = np.array([rest.q, beside.q], dtype=float)
        yield a, b, float(potential(problem, a[None])[0]) + 0.0  # no -0.0, to be told


def potential(problem: Problem, q: Array, law: System | None = None) -> Array:
    """Return the energy at rest at places q (K, n), (K,), perhaps of the `law` of a leg."""
    law = problem.system if law is None else law
    with np.errstate(all="ignore"):
        at = q, 0 * q, np.zeros((len(q), 1)), problem.packed_of(law)
        return -law.pointwise("first")(*at)[2][:, 0]


def _tops(problem: Problem, a: Array, b: Array, energy: float) -> tuple[Array, float]:
    """Return places (K, 1) between two of one coordinate, tops among them, and what is as high."""
    first = problem.system.pointwise("first")

    def force(q: Array) -> Array:
        return first(q[:, None], 0 * q[:, None], 0 * q[:, None], problem.packed)[0][:, 0].copy()

    q = a[0] + np.linspace(0.0, 1.0, 10 * LINE)[1:-1] * (b[0] - a[0])
    known, height = np.sign(force(q)), potential(problem, q[:, None])
    turns = np.flatnonzero(np.diff(known))
    low, _ = bisect(q[turns], q[turns + 1], lambda x: np.sign(force(x)) == known[turns])
    below = energy - TOP_ROUNDOFF * float(np.abs(height - energy).max(initial=0.0))
    return np.concatenate([q, low])[:, None], below


def name_place(law: System, q: Array) -> str:
    """Return a place (n,) by the names of its coordinates."""
    return ", ".join(f"{name} = {x:.6g}" for name, x in zip(law.coordinates, q, strict=True))


def conserves_energy(system: System) -> bool:
    """Whether motions keep their energy, and nothing but their Lagrangian says where they go."""
    plain = not (system.m or system.r or system.structure.forced)
    return plain and system.structure.smooth and not system.structure.depends_on_time


def return_time(problem: Problem, q: Array, t: float) -> float:
    """Return about how long a motion of the energy takes from q (n,) back to it: 2 p / |force|.

    It is 1 where there is no force, or none that turns the motion within `FARTHEST_RETURN` sizes.
    """
    n = problem.system.n
    at = q[None], np.zeros((1, n)), np.array([[t]]), problem.packed
    force = np.abs(problem.system.pointwise("first")(*at)[0][0])
    inertia = diagonal(problem.system, 2, problem.system.pointwise("second")(*at)[2])[0]
    _, left = rates(problem, q[None], np.ones((1, n)), np.array([[t]]))
    with np.errstate(all="ignore"):
        found = 2 * np.sqrt(2 * np.abs(left) * inertia) / force
        away = np.abs(left) / force
    found = found[np.isfinite(found) & (found > 0) & (away < FARTHEST_RETURN * problem.scales)]
    return float(found.min()) if found.size else 1.0


def between_turning_points(problem: Problem) -> Path | Array | None:
    """Return the motion there and back between the turning points of the energy.

    A closed path of one coordinate stays in the well that is nearest to where it starts, or to
    zero; with an advance, it goes straight on over all of it. Waypoints (1, K) where it does not
    tell its times, None where no motion of the energy is seen.
    """
    system, t = problem.system, problem.start.t
    if system.n > 1 or system.m or problem.advance is None:
        return None

    def at_rest(x: Array) -> tuple[Array, Array]:
        """Return the force, and E less the energy."""
        q, at = x[:, None], np.full((x.size, 1), t)
        with np.errstate(all="ignore"):
            force, _, L = system.pointwise("first")(q, 0 * q, at, problem.packed)
        return force[:, 0].copy(), problem.energy + L[:, 0]  # type: ignore[operator]

    centre = problem.start.q[0] or 0.0
    if problem.advance.any():
        turn = centre + problem.advance * np.linspace(0, 1, 2 * LINE - 1)
        if not (at_rest(turn)[1] > 0).all():
            return None
        on = _passage(problem, turn[0], turn[-1]) if conserves_energy(system) else None
        return turn[None] if on is None else _motion(t, *on)
    x = centre + problem.scales[0] * np.concatenate([-SEEN[::-1], [0.0], SEEN])
    force, _ = at_rest(x)
    hills = np.flatnonzero((force[:-1] < 0) & (force[1:] >= 0))
    x = np.union1d(x, bisect(x[hills], x[hills + 1], lambda x: at_rest(x)[0] < 0)[0])
    inside = at_rest(x)[1] > 0
    if not inside.any():
        return None
    k = int(np.argmin(np.where(inside, np.abs(x - centre), np.inf)))
    walls = np.flatnonzero(~inside)
    if not (walls.size and walls[0] < k < walls[-1]):
        return None
    walls = np.array([walls[walls < k][-1], walls[walls > k][0]])
    a, b = bisect(x[walls + np.array([1, -1])], x[walls], lambda x: at_rest(x)[1] > 0)[0].tolist()
    if conserves_energy(system):
        forth, back = _passage(problem, a, b), _passage(problem, b, a)
        if forth and back:
            rest = forth[0][-1] + back[0], *back[1:]
            return _motion(t, *(np.append(x, y[1:]) for x, y in zip(forth, rest, strict=True)))
    turn = np.linspace(0, 2 * np.pi, 2 * LINE - 1)
    return (a + (b - a) * (1 - np.cos(turn)) / 2)[None]


def _motion(t: float, since: Array, q: Array, v: Array) -> Path:
    """Return the motion of one coordinate through q at the times `since` t, (K,)."""
    mesh = Mesh.over(t, t + since[-1], since, 3)
    return Path.interpolate(hermite(t + since, q[None], v[None]), mesh)


def oscillations(problem: Problem) -> list[Path]:
    """Return the small oscillations of the energy about the equilibrium near the start.

    There are several coordinates; for one `between_turning_points` knows more. Each lasts a period,
    the fastest comes first: with that at least a family of closed paths begins at the equilibrium,
    whose period is found from the energy (Lyapunov's centre theorem; Moser, *Comm. Pure Appl.
    Math.* 29 (1976) 727-747). None where there is no equilibrium, or nothing turns.
    """
    system, t = problem.system, problem.start.t
    plain = not (system.m or system.structure.forced or system.structure.depends_on_time)
    closes = problem.advance is not None and not problem.advance.any()
    if system.n == 1 or not plain or not closes or problem.order != tuple(range(system.n)):
        return []
    found = equilibrium(problem, np.array([x or 0.0 for x in problem.start.q]))
    if found is None:
        return []
    q, (A, _, C), rates, modes = found
    left = float(problem.energy or 0.0) - float(potential(problem, q[None])[0])
    growing, turning = np.real(rates), np.imag(rates)
    found = []
    for k in np.argsort(-turning):
        w, eta = float(turning[k]), modes[: system.n, k]
        if w <= 0 or abs(growing[k]) > MERGED * np.abs(rates).max():
            continue
        u, speed = np.real(eta), -w * np.imag(eta)
        energy = (speed @ C @ speed - u @ A @ u) / 2
        if not left / energy > 0:
            continue
        mesh = Mesh.uniform(t, t + 2 * np.pi / w, COARSE_ELEMENTS, COARSE_DEGREE)
        angle = w * mesh.nodes_since
        moved = np.outer(np.real(eta), np.cos(angle)) - np.outer(np.imag(eta), np.sin(angle))
        found.append(Path(mesh, q[:, None] + np.sqrt(left / energy) * moved))
    return found


def equilibrium(problem: Problem, q: Array) -> tuple[Array, list[Array], Array, Array] | None:
    """Return the equilibrium near q (n,), L_qq, L_qv, L_vv there, and rates and modes beside it.

    There are 2 n modes, columns of (dq, dp) that move as exp(rate t). None where none is found.
    """
    first, second = problem.system.pointwise("first"), problem.system.pointwise("second")
    state = np.zeros((1, q.size)), np.full((1, 1), problem.start.t), problem.packed
    with np.errstate(all="ignore"):
        for _ in range(PATIENT):
            force = first(q[None], *state)[0][0].copy()
            values = [x.copy() for x in second(q[None], *state)]
            A, B, C = known = [second.full(i, values[i], symmetric=i != 1)[0] for i in range(3)]
            if not all(np.isfinite(x).all() for x in (force, *known)):
                return None
            if np.abs(force).max() <= ROUNDED * np.abs(A).max() * problem.scales.max():
                break
            q = q - np.linalg.lstsq(A, force, rcond=None)[0]
        else:
            return None
    try:
        inverse = np.linalg.inv(C)
    except np.linalg.LinAlgError:
        return None
    H = np.block([[-inverse @ B.T, inverse], [A - B @ inverse @ B.T, B @ inverse]])
    rates, modes = np.linalg.eig(H)
    return q, known, rates, modes
