"""What a path does near an equilibrium from which it comes, or to which it tends.

Near a saddle of the Hamiltonian flow the motions that tend to it are a Lagrangian manifold, tangent
to the stable subspace of the linearised flow

    eta' = C^-1 (pi - B' eta),    pi' = A eta + B eta',    A = L_qq, B = L_qv, C = L_vv at rest,

pi = K eta with a symmetric K; those that come from it, to the unstable one. A path that stays on it
from a time on has there v = W eta, W = C^-1 (K - B'), and its action above rest on the way is
-(p.eta + eta.K eta / 2), the opposite where it comes from: a term that depends on where it is then.
Under constraints f(q) = 0 that is so on their tangent plane, with A + sum lam f_qq for A.
Non-conservative forces Q(q, v) add Q_q to A and Q_v to B in pi', K is not symmetric, and the action
beyond is no potential of the momentum: with W' M + M W = -(A + B W + W'B' + W'C W) it is

    int L dt = -(p + W^-T L_q).eta + eta.M eta / 2.

References: Lentini and Keller, *SIAM J. Numer. Anal.* 17 (1980) 577-604; Beyn, *IMA J. Numer.
Anal.* 10 (1990) 379-405.
"""

from __future__ import annotations

import casadi as ca
import numpy as np

from actionopt.mechanics.system import System
from actionopt.tools.immutable import immutable
from actionopt.tools.tape import Node, Tape
from actionopt.tools.types import EPS, Array

# Ad hoc, where nothing else is said.
SLOWEST_DECAY = 1e-7  # rate of decay, relative to the fastest: slower ones count as zero
GRAPH = 1e-10  # singular values of the subspace's coordinates, at least: else it is no graph over q
ROUNDED_ZERO = 16 * EPS  # of what others are as large as: a coordinate that stands for zero
NEAR_REST = 1e-6  # of the coordinates' size: how far from an equilibrium one may be given
REST_STEPS = 8
RESTS_KEPT = 16  # of a system
SIGN_STEPS, SIGN_CHANGE = 60, 1e-14
SERIES_TERMS = 18  # of exp(x) for |x| < 1/2: 2^-18 / 18! = 6e-22


@immutable
class Rest:
    """An equilibrium, and the linear manifold of the motions that come from it or tend to it."""

    side: int  # -1 for motions that come from it, 1 for those that tend to it
    # q, p (n,): coordinates and momenta at rest.
    q: Array
    p: Array
    # slope, rates (n, n): p = self.p + slope eta, v = rates eta, eta = q - self.q.
    slope: Array
    rates: Array
    # (n,), (n, n): what lies beyond is action[0].eta + eta.action[1] eta / 2 above rest.
    action: tuple[Array, Array]
    mass: Array  # (n, n): L_vv at rest
    slow: float  # the least rate of decay
    lagrangian: float  # L at rest
    lam: Array  # (m,): the multipliers of constraints there

    def beyond(self, eta: Array, since: Array) -> Array:
        """Return eta (n, K) at times `since` (K,) from where it was (n,): exp(rates since) eta."""
        found = np.zeros((eta.size, since.size))
        # Beyond so many of the slowest e-foldings nothing is left, infinite times included.
        some = np.abs(since) * self.slow < -np.log(np.finfo(float).tiny)
        if not some.any():
            return found
        x = self.rates * since[some, None, None]
        halvings = max(0, int(np.ceil(np.log2(2 * np.abs(x).sum(axis=2).max() + 1e-300))))
        x = x / 2**halvings
        total = power = np.broadcast_to(np.eye(eta.size), x.shape)
        for k in range(1, SERIES_TERMS + 1):
            power = power @ x / k
            total = total + power
        for _ in range(halvings):
            total = total @ total
        found[:, some] = (total @ eta).T
        return found


def rest(system: System, packed: Array, q: Array, t: float, side: int) -> Rest:
    """Return the equilibrium near q (n,) and its manifold as it is at the time t.

    The last ones are kept. Raises ValueError if there is no equilibrium, or it is no saddle.
    """
    kept: dict[tuple, Rest] = system.memoize("rests", dict)
    key = packed.tobytes(), q.tobytes(), t if system.structure.depends_on_time else 0.0, side
    found = kept.pop(key, None) or _rest(system, packed, q, t, side)
    kept[key] = found
    for old in list(kept)[:-RESTS_KEPT]:
        kept.pop(old, None)  # another thread may have done so
    return found


def _rest(system: System, packed: Array, q: Array, t: float, side: int) -> Rest:
    """Return the equilibrium at q (n,) at the time t, found anew."""
    given, now = q, np.array([[t]])
    if system.m and system.pointwise("constraint_rate")(q[None], now, packed)[0].any():
        raise ValueError(
            "expected constraints at rest where a path comes from or tends to in infinite time, "
            "found that they move there: nothing rests on what moves; give a finite time"
        )
    first = at = _Linearization.of(system, packed, q, t, given)
    for k in range(REST_STEPS):
        at = _Linearization.of(system, packed, q, t, given) if k else first
        step = at.step()
        q = q - step
        if np.abs(step).max() <= 1e-15 * max(np.abs(q).max(), 1e-300):
            break
    size = np.maximum(np.abs(given), np.abs(q)) + first.unseen(np.abs(given))
    size = np.where(size > 0, size, 1.0)
    off = np.abs(at.force) > NEAR_REST * (np.abs(at.by_q) @ size)
    lost = off.any()
    off |= np.abs(q - given) > NEAR_REST * size
    if off.any() and bool(
        (np.abs(first.force) <= _round_off(system, packed, given, t, first.lam)).all()
    ):
        q, off = given, np.zeros(1)
    if off.any():
        near = "" if lost else f"; one is near {q.tolist()}"
        raise ValueError(
            "expected an equilibrium where a path comes from or tends to in infinite time, found "
            f"the generalized forces {first.push.tolist()} at rest at q = {given.tolist()}{near}"
        )
    known = system.pointwise("first")(q[None], np.zeros((1, system.n)), now, packed)
    momentum, L = (x[0].copy() for x in known[1:])
    plane = np.linalg.svd(at.G)[2][system.m :].T  # of the motions that the constraints allow
    A, whole, B, drag, C = (plane.T @ x @ plane for x in (at.A, at.by_q, at.B, at.drag, at.C))
    slope, rates, decay = _subspace(whole, B, drag, C, side, system.coordinates)
    action = -side * momentum, -side * (plane @ slope @ plane.T)
    if system.structure.forced:
        line, M = _action(plane.T @ at.pull, (A, B, C), rates, side)
        action = -side * momentum + plane @ line, plane @ M @ plane.T
    found = plane @ slope @ plane.T, plane @ rates @ plane.T, action, at.C
    return Rest(side, q, momentum, *found, decay.min(), float(L[0]), at.lam)


@immutable
class _Linearization:
    """The forces on a system at rest, and how they change with q and v."""

    # pull, push, force (n,): L_q, with the forces Q, and with those of constraints, lam . G.
    pull: Array
    push: Array
    force: Array
    # A, B, C (n, n): L_qq with the curvature lam . f_qq of constraints, L_qv and L_vv.
    A: Array
    B: Array
    C: Array
    # by_q, drag (n, n): the derivatives of `force` by q, and of Q by v.
    by_q: Array
    drag: Array
    # f, lam (m,), G (m, n): the constraints, the multipliers that leave the least force, and f_q.
    f: Array
    lam: Array
    G: Array

    @classmethod
    def of(cls, system: System, packed: Array, q: Array, t: float, given: Array) -> _Linearization:
        """Return that at q (n,). Raises ValueError, which names `given`, where it is not finite."""
        at = q[None], np.zeros((1, system.n)), np.array([[t]]), packed
        pull = push = system.pointwise("first")(*at)[0][0].copy()
        second = system.pointwise("second")
        values = [x.copy() for x in second(*at)]
        A, B, C = (second.full(i, values[i], symmetric=i != 1)[0] for i in range(3))
        work = np.zeros((2, system.n, system.n))  # Q_q and Q_v
        if system.structure.forced:
            by = system.pointwise("force_jacobian")
            work = np.stack([by.full(i, x)[0] for i, x in enumerate(by(*at))])
            push = pull + system.pointwise("force")(*at)[0][0]
        by_q = A + work[0]
        if not all(np.isfinite(x).all() for x in (push, by_q, B + work[1], C)):
            raise ValueError(
                "expected a Lagrangian that is finite, with its derivatives, where the path comes "
                f"from or tends to in infinite time, found NaN or infinity at rest at q = {given}; "
                "give a finite time by which it is all but at rest, and there coordinates a little "
                "beside it, such as Event(t, q + 1e-9), and a guess"
            )
        if not system.m:
            none = np.zeros(0)
            G = np.zeros((0, system.n))
            return cls(pull, push, push, A, B, C, by_q, work[1], none, none, G)
        jacobian, curvature = map(system.pointwise, ("constraint_jacobian", "constraint_curvature"))
        nonzeros, rows = jacobian(at[0], at[2], packed)
        G, f = jacobian.full(0, nonzeros)[0], rows[0].copy()
        lam = -np.linalg.lstsq(G.T, push, rcond=None)[0]
        bent = curvature.full(0, curvature(at[0], lam[None], at[2], packed)[0], symmetric=True)[0]
        force = push + lam @ G
        return cls(pull, push, force, A + bent, B, C, by_q + bent, work[1], f, lam, G)

    def _matrix(self) -> Array:
        """Return how force and constraints change with q and multipliers, (n + m, n + m)."""
        m = self.f.size
        return np.block([[self.by_q, self.G.T], [self.G, np.zeros((m, m))]])

    def step(self) -> Array:
        """Return how far from the equilibrium q is, to first order, (n,)."""
        both = np.r_[self.force, self.f]
        return np.linalg.lstsq(self._matrix(), both, rcond=None)[0][: self.force.size]

    def unseen(self, size: Array) -> Array:
        """Return sizes (n,) of coordinates that stand for zero, whose own `size` tells nothing.

        They go with the others, each of which may be off by a part of its size; or they are of
        round-off, in the units that the mass matrix has in common for all.
        """
        unit = np.sqrt(np.abs(np.diagonal(self.C)))
        rounded = ROUNDED_ZERO * (unit @ size) / np.where(unit > 0, unit, np.inf)
        bare = size <= rounded
        found = np.zeros(size.size)
        if bare.any() and not bare.all():
            free = np.r_[bare, np.ones(self.f.size, bool)]
            rows = self._matrix()[free]
            by = np.linalg.lstsq(rows[:, free], rows[:, ~free], rcond=None)[0][: bare.sum()]
            found[bare] = np.abs(by) @ size[~bare] + rounded[bare] / NEAR_REST
        return found


def _round_off(system: System, packed: Array, q: Array, t: float, lam: Array) -> Array:
    """Return how coarsely the force at rest at q is rounded, (n,): zero may be as much.

    Each number and each result of an operation is off by an eps of itself; to first order in that
    (N. J. Higham, *Accuracy and Stability of Numerical Algorithms* (2nd ed. 2002), section 3.3).
    """
    s, d = system.symbols, system.derivatives
    inputs = s.q, s.v, s.t, s.p, ca.SX.sym("lam", system.m)
    total = d.Lq + d.G.T @ inputs[-1] + (system.Q if system.structure.forced else 0)
    tape = Tape(inputs, [ca.densify(total)])
    off = ca.SX.sym("off", len(tape.nodes))
    count = iter(range(len(tape.nodes)))

    def with_rounding(node: Node, x: list[ca.SX]) -> ca.SX:
        if node.kind == "input":
            exact = inputs[node.entry[0]][node.entry[1]]
        else:
            exact = node.of(x) if x else ca.SX(node.value)
        return exact * (1 + off[next(count)])

    made = tape.fold(with_rounding)
    force = ca.vertcat(*[made[k] for k in tape.results[0]])
    by = ca.Function("by", [*inputs, off], [ca.jacobian(force, off)])
    found = np.array(by(q, np.zeros(system.n), t, packed.ravel(), lam, 0).full())
    return EPS * np.abs(found).sum(axis=1)


def _action(pull: Array, second: tuple[Array, ...], rates: Array, side: int) -> tuple[Array, Array]:
    """Return the action beyond but for momenta, of motions at the `rates` W, L_q = `pull`."""
    (A, B, C), W, one = second, rates, np.eye(pull.size)
    bent = A + B @ W + (B @ W).T + W.T @ C @ W
    both = np.kron(W.T, one) + np.kron(one, W.T)
    M = np.linalg.solve(both, -side * bent.ravel()).reshape(bent.shape)
    return -side * np.linalg.solve(W.T, pull), M


def _subspace(
    A: Array, B: Array, drag: Array, C: Array, side: int, names: tuple[str, ...]
) -> tuple[Array, Array, Array]:
    """Return slope and rates (n, n) of the stable (side 1) or unstable subspace.

    And how fast its motions decay, (n,). Forces change with q in A, and with v by `drag` (n, n).
    """
    n = len(A)
    try:
        inverse = np.linalg.inv(C)
    except np.linalg.LinAlgError:
        inverse = np.full((n, n), np.inf)
    if not np.isfinite(inverse).all():
        raise ValueError(
            "expected a regular mass matrix d2L/dv2 at the equilibrium, found it singular"
        )
    # In units in which both parts of the matrix are of one size.
    unit = np.sqrt(np.abs(np.diagonal(C)))
    unit = np.where(unit > 0, unit, 1.0)
    turned = (B + drag) @ inverse
    H = np.block([[-inverse @ B.T, inverse], [A - turned @ B.T, turned]])
    rate = np.sqrt(np.abs(H[n:, :n]).max() * np.abs(inverse).max()) or 1.0
    scale = np.r_[1 / unit, unit * rate]
    H = H * scale / scale[:, None]
    values = np.linalg.eigvals(H)
    fastest = np.abs(values).max()
    if (
        np.sum(values.real > SLOWEST_DECAY * fastest) != n
        or np.sum(-values.real > SLOWEST_DECAY * fastest) != n
    ):
        slow = ", ".join(f"{x:.4g}" for x in sorted(values, key=lambda x: abs(x.real)))
        raise ValueError(
            "expected a saddle of the equations of motion where a path comes from or tends to in "
            f"infinite time, found motions near q that grow or decay at the rates {slow}: those "
            "with no real part turn, or come closer more slowly than any exponential; is the sign "
            "of the potential right (L = T - V rests where V is greatest)? A path that comes "
            "closer as a power of the time: give a late finite time, the coordinates it has there, "
            "or those at rest, and a guess"
        )
    # The matrix sign function by Newton's method: no eigenvectors, which may be dependent.
    Z = H
    for _ in range(SIGN_STEPS):
        other = np.linalg.inv(Z)
        factor = np.sqrt(np.linalg.norm(other) / np.linalg.norm(Z))
        new = (factor * Z + other / factor) / 2
        done = np.linalg.norm(new - Z) <= SIGN_CHANGE * np.linalg.norm(new)
        Z = new
        if done:
            break
    basis = np.linalg.svd(np.eye(2 * n) - side * Z)[0][:, :n] * scale[:, None]
    upper = basis[:n] * unit[:, None]  # in units of size one
    if np.linalg.svd(upper, compute_uv=False).min() <= GRAPH * np.linalg.norm(upper):
        raise ValueError(
            "expected an equilibrium near which the motions that tend to it, or come from it, are "
            f"told apart by {', '.join(names)}, found that they are not; give a finite time"
        )
    slope = basis[n:] @ np.linalg.inv(basis[:n])
    slope = slope if drag.any() else (slope + slope.T) / 2
    rates = inverse @ (slope - B.T)
    decay = -side * np.real(values)
    return slope, rates, decay[decay > 0]
