"""Questions of many coordinates, as actionopt is asked them and as its peers are."""

from __future__ import annotations

from collections.abc import Callable
from time import process_time

import numpy as np

import actionopt as ao
from actionopt import scenes
from benchmarks import peers
from benchmarks.problems import Case, Ends
from benchmarks.problems._case import no_partials
from benchmarks.problems.lattice import lagrangian as fput_lagrangian

GRAVITY = 9.81
SLOW, SWIFT = 0.3, 0.6  # deviation of a lattice's places and rates at the start
SEEDS = 5  # questions of a size, drawn at random
PEERS = {  # what they are asked for; where the line leads nowhere they have no other first guess
    "scipy_bvp": 1e-6,
    "casadi_collocation": (10, 6),
}


def pendulum(links: int) -> Case:
    """Return a small swing of a pendulum of so many links, unit masses and lengths, in angles."""
    below = links - np.maximum.outer(np.arange(links), np.arange(links))  # masses that both carry
    weight = GRAVITY * np.diag(below)[:, None]

    def lagrangian(q, v, t):
        x, y = np.cumsum(np.cos(q) * v), np.cumsum(np.sin(q) * v)
        return (x @ x + y @ y) / 2 + GRAVITY * np.sum(np.cumsum(np.cos(q)))

    def turned(q):  # (K, n, n)
        between = q.T[:, :, None] - q.T[:, None, :]
        return below * np.cos(between), below * np.sin(between)

    def acceleration(q, v, t, x):
        many = q if q.ndim == 2 else q[:, None]
        rates = v if q.ndim == 2 else v[:, None]
        mass, pull = turned(many)
        force = -np.einsum("kij,jk->ki", pull, rates**2) - (weight * np.sin(many)).T
        return np.linalg.solve(mass, force[..., None])[..., 0].T.reshape(q.shape)

    def partials(q, v, t):
        mass, pull = turned(q)
        a, square = acceleration(q, v, t, np).T[:, None, :], (v.T**2)[:, None, :]
        slope = pull * a - mass * square
        own = np.arange(links)
        slope[:, own, own] = 0.0
        slope[:, own, own] = -slope.sum(axis=2) + (weight * np.cos(q)).T
        both = np.linalg.solve(mass, -np.concatenate([slope, 2 * pull * v.T[:, None, :]], axis=2))
        return np.moveaxis(both[..., :links], 0, -1), np.moveaxis(both[..., links:], 0, -1)

    first = np.linspace(0.05, 0.15, links)
    return _case(lagrangian, acceleration, partials, first, -first / 2, 0.5)


def bodies(count: int, seed: int) -> Case:
    """Return so many bodies of equal mass that attract each other, past a third of their sizes."""

    def lagrangian(q, v, t):
        V = 0.0
        for i in range(count):
            for j in range(i):
                r = q[3 * i : 3 * i + 3] - q[3 * j : 3 * j + 3]
                V = V - 1 / (count * np.sqrt(r @ r))
        return (v @ v) / 2 - V

    def apart(q):  # r_i - r_j (i, j, 3, ...), and its length, infinite for i = j
        r = q.reshape(count, 3, *q.shape[1:])
        between = r[:, None] - r[None]
        far = np.sqrt(np.sum(between**2, axis=2))
        far[np.arange(count), np.arange(count)] = np.inf
        return between, far[:, :, None]

    def acceleration(q, v, t, x):
        between, far = apart(q)
        return -np.sum(between / far**3, axis=1).reshape(q.shape) / count

    def partials(q, v, t):
        between, far = apart(q)
        far = far[:, :, None]
        tide = np.eye(3)[..., None] / far**3
        tide = tide - 3 * between[:, :, :, None] * between[:, :, None] / far**5
        own = np.arange(count)
        tide[own, own] = -tide.sum(axis=1)
        return tide.swapaxes(1, 2).reshape(3 * count, 3 * count, -1) / count, no_partials(q)

    rng = np.random.default_rng(seed)
    at = rng.normal(size=(count, 3))
    at *= rng.uniform(0.3, 1, (count, 1)) * count ** (1 / 3) / np.linalg.norm(at, axis=1)[:, None]
    then = at + 0.3 * rng.normal(size=at.shape)
    return _case(lagrangian, acceleration, partials, at.ravel(), then.ravel(), 0.5)


def fput(masses: int, seed: int, spread: float = SLOW) -> Case:
    """Return a row of masses on stiffening springs, held by soft ones at both ends."""

    def lagrangian(q, v, t):
        d = q[1:] - q[:-1]
        return v @ v / 2 - np.sum(d**2) / 2 - np.sum(d**4) / 4 - q[0] ** 2 - q[-1] ** 2

    def acceleration(q, v, t, x):
        d = np.diff(q, axis=0)
        tension = np.concatenate([2 * q[:1], d + d**3, -2 * q[-1:]])
        return np.diff(tension, axis=0)

    def partials(q, v, t):
        k = 1 + 3 * np.diff(q, axis=0) ** 2
        soft = np.full_like(q[:1], 2.0)
        held = np.concatenate([soft, k, soft])
        A, i = no_partials(q), np.arange(masses)
        A[i, i] = -(held[1:] + held[:-1])
        A[i[1:], i[:-1]] = A[i[:-1], i[1:]] = k
        return A, no_partials(q)

    return _case(
        lagrangian, acceleration, partials, *ends_of_a_motion(lagrangian, masses, spread, seed), 1.0
    )


def toda(masses: int, seed: int) -> Case:
    """Return a row of masses that repel each other exponentially."""

    def lagrangian(q, v, t):
        return v @ v / 2 - np.sum(np.exp(q[:-1] - q[1:]))

    def force(q):
        push = np.exp(q[:-1] - q[1:])
        return np.concatenate([0 * q[:1], push, 0 * q[:1]])

    def acceleration(q, v, t, x):
        return -np.diff(force(q), axis=0)

    def partials(q, v, t):
        k, A, i = force(q), no_partials(q), np.arange(masses)
        A[i, i] = -(k[1:] + k[:-1])
        A[i[1:], i[:-1]] = A[i[:-1], i[1:]] = k[1:-1]
        return A, no_partials(q)

    return _case(
        lagrangian, acceleration, partials, *ends_of_a_motion(lagrangian, masses, SLOW, seed), 1.0
    )


def ends_of_a_motion(
    lagrangian: Callable, masses: int, spread: float, seed: int
) -> tuple[np.ndarray, np.ndarray]:
    """Return where a motion from random places at random rates is after a time of one, too.

    Between two random places there may be none near the line: scaled up from rest, the path of 16
    or 32 masses of `fput` turns back at 0.7 to 0.8 of ends of deviation 0.3.
    """
    q, v = np.random.default_rng((masses, seed)).normal(0.0, spread, (2, masses))
    system = ao.System(lagrangian, [f"q{j}" for j in range(masses)])
    return q, ao.integrate(system, ao.State(0.0, q, v), 1.0, tol=1e-8)(1.0)


def lattice(n: int, T: float = 1.0) -> dict:
    """Return the question of a row of masses, below its first conjugate time."""
    shape = np.sin(np.pi * np.arange(1, n + 1) / (n + 1))
    system = ao.System(fput_lagrangian, [f"u{j}" for j in range(n)], parameters={"beta": 1.0})
    return {"problem": ao.Problem(system, ao.Event(0.0, shape), ao.Event(T, 0.5 * shape))}


def chain(links: int) -> dict:
    """Return the question of a hanging chain, with its guess."""
    scene = scenes.get("chain", links=links, l=1.0 / links, amplitude=0.1)
    return {"problem": scene.problem, "guess": scene.guess}


def problem(case: Case) -> ao.Problem:
    """Return what actionopt is asked."""
    ends, _ = case.ends()
    system = ao.System(case.lagrangian, case.coordinates)
    return ao.Problem(system, ao.Event(0.0, ends.start), ao.Event(case.duration, ends.end))


def asked(peer: str, cases: list[Callable[[], Case]], seconds: float) -> dict:
    """Ask a peer, from the straight line; no more once `seconds` are over.

    Return the median time of what it solves, or of all if that is nothing, and how many those are.
    """
    times, failed, said = [], [], ""
    while len(times) + len(failed) < len(cases) and sum(times + failed) < seconds:
        case = cases[len(times) + len(failed)]()
        ends, _ = case.ends()
        clock = process_time()
        try:
            peers.get(peer).cold(case, ends, "line", PEERS[peer])
            times.append(process_time() - clock)
        except (peers.Failed, peers.Unable) as failure:
            failed.append(process_time() - clock)
            said = said or str(failure)
    middle = sorted(times or failed)[len(times or failed) // 2]
    solved = f"{len(times)} of {len(times) + len(failed)}"
    return {"time": middle, "solved": solved, "status": "" if times else said}


def _case(lagrangian, acceleration, partials, start, end, duration: float) -> Case:
    unknown = Ends(start, end, np.empty((start.size, 0)))
    return Case(
        name="many",
        title="many coordinates",
        lagrangian=lagrangian,
        coordinates=[f"q{j}" for j in range(start.size)],
        parameters={},
        acceleration=acceleration,
        partials=partials,
        duration=duration,
        ends=lambda: (unknown, unknown),
    )
