"""Ten links swinging, in angles and in Cartesian coordinates with one constraint a link."""

from __future__ import annotations

from functools import cache

import numpy as np

from actionopt.scenes import chain
from benchmarks.arithmetic import NUMPY
from benchmarks.problems._case import Case, Ends
from benchmarks.problems._stored import stored

NAME = "chain_angles"
LINKS, L, G = 10, 0.1, 9.81  # unit masses
_MODE = 0.5 * chain.slowest(LINKS)[1]
DURATION = 0.5
RELEASES = ((_MODE, 0 * _MODE), (_MODE, 0.2 * _MODE))  # angles and rates at time 0

i = np.arange(LINKS)


@cache
def masses(links: int) -> tuple[np.ndarray, np.ndarray]:
    """Return C_ij, the masses below both joints, and W_i, their weights, on links of 1 m together.

    In angles, divided by m l^2, with M_ij = C_ij cos(th_i - th_j):
    sum_j M_ij th_j'' = -sum_j C_ij sin(th_i - th_j) th_j'^2 - W_i sin th_i.
    """
    i = np.arange(links)
    return links - np.maximum.outer(i, i), (links - i) * G * links


CARRIED, WEIGHT = masses(LINKS)


def lagrangian(q, v, t, *, l, g):
    """L of unit masses: M_ij th_i' th_j' / 2 with the masses below, and their weight."""
    kinetic = 0
    for a in range(LINKS):
        for b in range(LINKS):
            kinetic = kinetic + CARRIED[a, b] * v[a] * v[b] * np.cos(q[a] - q[b])
    potential = 0
    for a in range(LINKS):
        potential = potential - (LINKS - a) * np.cos(q[a])
    return l**2 * kinetic / 2 - g * l * potential


def acceleration(q, v, t, x):
    """Solve for the angular accelerations."""
    apart = q[:, None] - q[None]
    carried, weight = masses(len(q))
    carried = carried.reshape(*carried.shape, *[1] * (q.ndim - 1))
    weight = weight.reshape(-1, *[1] * (q.ndim - 1))
    M = carried * x.cos(apart)
    swirl = (carried * x.sin(apart) * (v * v)[None]).sum(axis=1)
    return x.solve(M, -swirl - weight * x.sin(q))


def partials(q, v, t):
    """Differentiate M acc = f: M dacc = df - dM acc."""
    apart = q[:, None] - q[None]
    C, S = CARRIED[:, :, None] * np.cos(apart), CARRIED[:, :, None] * np.sin(apart)
    acc = acceleration(q, v, t, NUMPY)
    # Of row i, through q_j: + C v_j^2 + (-S) acc_j, and minus the row's sum through q_i.
    Fq = C * (v * v)[None] - S * acc[None]
    Fq[i, i] -= Fq.sum(axis=1) + WEIGHT[:, None] * np.cos(q)
    Fv = -2 * S * v[None]
    both = np.moveaxis(np.concatenate([Fq, Fv], axis=1), -1, 0)
    solved = np.moveaxis(np.linalg.solve(np.moveaxis(C, -1, 0), both), 0, -1)
    return solved[:, :LINKS], solved[:, LINKS:]


# In x and y, unit masses, d_k the links: a = -g + sum of +-lam_k d_k, d_k . d_k'' = -|d_k'|^2.


B = np.eye(LINKS) - np.eye(LINKS, k=-1)  # links = B positions
BB = B @ B.T


def _links(q):
    places = q.reshape(LINKS, 2, *q.shape[1:])
    return np.concatenate([places[:1], places[1:] - places[:-1]])


def cartesian_acceleration(q, v, t, x):
    """Eliminate the tensions: (B B')_kl d_k . d_l lam_l = -|d_k'|^2 - d_k . (B g)_k."""
    d, rate = _links(q), _links(v)
    inner = d[:, None, 0] * d[None, :, 0] + d[:, None, 1] * d[None, :, 1]
    K = BB.astype(int).reshape(LINKS, LINKS, *[1] * (q.ndim - 1)) * inner
    right = -(rate[:, 0] ** 2 + rate[:, 1] ** 2)
    right[0] = right[0] + G * d[0, 1]  # only the first link's foot does not fall freely
    lam = x.solve(K, right)
    pull = lam[:, None] * d
    pull[:-1] = pull[:-1] - pull[1:]
    pull = pull.reshape(q.shape)
    pull[1::2] = pull[1::2] - G
    return pull


def cartesian_partials(q, v, t):
    """Differentiate the equations for the tensions and then a = -g + B' (lam d)."""
    d, rate = _links(q), _links(v)  # (N, 2, K)
    K = BB[:, :, None] * np.einsum("kcm,lcm->klm", d, d)
    right = -np.sum(rate**2, axis=1)
    right[0] += G * d[0, 1]
    Kt = np.moveaxis(K, -1, 0)
    lam = np.linalg.solve(Kt, np.moveaxis(right, -1, 0)[..., None])[..., 0].T
    N, count = LINKS, q.shape[1]
    # Derivatives in the links d_j (component c) and their rates.
    pull = np.einsum("kl,lm,lcm->kcm", BB, lam, d)
    Fd = np.zeros((N, N, 2, count))
    Fd[i, i] -= pull
    Fd -= BB[:, :, None, None] * lam[None, :, None] * d[:, None]
    Fd[0, 0, 1] += G
    Fr = np.zeros((N, N, 2, count))
    Fr[i, i] = -2 * rate
    both = np.concatenate([Fd, Fr], axis=1).reshape(N, -1, count)
    dlam = np.moveaxis(np.linalg.solve(Kt, np.moveaxis(both, -1, 0)), 0, -1)
    dlam = dlam.reshape(N, 2, N, 2, count)
    T = dlam[:, :, :, None] * d[:, None, None, :, None]  # (k, kind, j, component of pull, c)
    T[i, 0, i, 0, 0] += lam
    T[i, 0, i, 1, 1] += lam
    # a = B' (lam d), d = B q
    A = np.einsum("ka,ksjecm,jb->saebcm", B, T, B, optimize=True)
    A = A.reshape(2, 2 * N, 2 * N, count)
    return A[0], A[1]


def normals(q):
    """Return d_k . (change of d_k) for every link, (LINKS, 2 LINKS)."""
    return (B[:, :, None] * _links(q)[:, None, :]).reshape(LINKS, -1)


def _cartesian_ends() -> tuple[Ends, Ends]:
    def convert(e: Ends) -> Ends:
        q = chain.positions(L, e.exact)
        return Ends(q[:, 0].copy(), q[:, -1].copy(), q)

    first, other = stored(NAME)
    return convert(first), convert(other)


def cases() -> list[Case]:
    """Return the two cases of this file."""
    angles = Case(
        name=NAME,
        title="10-link chain, angles",
        lagrangian=lagrangian,
        coordinates=[f"theta{k}" for k in range(LINKS)],
        parameters={"l": L, "g": G},
        acceleration=acceleration,
        partials=partials,
        duration=DURATION,
        ends=lambda: stored(NAME),
        size="large",
    )
    cartesian = Case(
        name="chain_cartesian",
        title="10-link chain, x and y",
        lagrangian=chain.lagrangian,
        constraint=chain.constraint,
        coordinates=[f"{axis}{k}" for k in range(1, LINKS + 1) for axis in "xy"],
        parameters={"m": 1.0, "l": L, "g": G},
        acceleration=cartesian_acceleration,
        partials=cartesian_partials,
        normals=normals,
        duration=DURATION,
        ends=_cartesian_ends,
        # Without a guess a least path is sought, and is another one. The line as a guess leads to
        # the reference. The polyline is as near to a third path (0.050) as to it (0.048).
        starts=("line", "straight", "bent"),
        size="large",
    )
    return [angles, cartesian]
