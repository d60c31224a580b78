"""What a symmetry of the action conserves (Noether's theorem).

The transformation q -> q + xi(q, t) d, t -> t + tau(t) d changes the action to first order by
the integral of

    R = L_q . xi + L_v . (xi' - v tau') + L_t tau + L tau' + Q . (xi - v tau),

Q being non-conservative forces. It is a symmetry if R is a total derivative dF/dt with F(q, t),
and if it keeps the constraints, G xi + f_t tau = 0 where f = 0. Along every motion then

    I = p . xi - H tau - F

is constant. With accelerations in L, and so on, both have a term for each derivative of q,

    R = sum_k L_k . xi_k + L_t tau + L tau' + Q . (xi - v tau),
    xi_k = d(xi_(k - 1))/dt - q^(k) tau',    xi_0 = xi,
    I = sum_k p_k . (xi - v tau)^(k - 1) + L tau - F,

with Ostrogradsky's momenta p_1, p_2, ... (`canonical`).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from itertools import chain
from typing import Any, Protocol

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from actionopt.mechanics.canonical import jet_of, momenta_by, rate_of
from actionopt.mechanics.laws.compiled import Pointwise
from actionopt.mechanics.laws.expressions import Expressions
from actionopt.mechanics.laws.identity import (
    CANCELLED,
    GENERIC,
    general_points,
    general_states,
    mismatch,
    vanishes,
)
from actionopt.mechanics.laws.tracing import MULTIPLIERS, call, column
from actionopt.mechanics.question.problem import Problem
from actionopt.mechanics.system import System, check_system
from actionopt.tools.checks import numbers, whole
from actionopt.tools.immutable import immutable
from actionopt.tools.types import Array

Generator = Callable[..., Any] | Sequence[float] | Array

# Points of the Gauss-Legendre rule that integrates F: exact for polynomials to t^31, q^31. Ad hoc.
GAUGE_POINTS = 16
SURFACE_STEPS = 60  # Newton's method onto the constraints, from far away; ad hoc
FINITE = 4  # points at which an expression must be finite to be judged; ad hoc


class HasMotion(Protocol):
    """A solution, as far as `Conserved.drift` asks for one."""

    @property
    def problem(self) -> Problem: ...  # noqa: D102
    def __call__(self, t: ArrayLike) -> Array: ...  # noqa: D102
    def derivatives(self, t: ArrayLike) -> Array: ...  # noqa: D102


@immutable
class Conserved:
    """A quantity I(q, v, t) that is constant along every motion; call it with them.

    Where L contains accelerations it depends on higher derivatives as well, (a, j) and so on.

    Attributes
    ----------
    system : System
    terms : SX, (1, k)
        I is the sum of these expressions in the symbols of the system's `jet` and its others.
    """

    system: System
    terms: ca.SX

    @cached_property
    def _sum(self) -> Pointwise:
        """The terms as a function of q, v and so on, t and the parameters."""
        arguments = _arguments(self.system)
        return Pointwise(ca.Function("conserved", arguments, [ca.densify(self.terms)]))

    def __reduce__(self) -> tuple:
        """Carry the expressions as a function: the system has other symbols there."""
        return _restore, (self.system, self._sum.function)

    def __repr__(self) -> str:
        """Show of what it is, not the expressions."""
        of = "q, v, t" if self.system.order == 1 else "q, v, t, higher="
        return f"Conserved(I({of}) of {self.terms.numel()} terms, {self.system})"

    def __call__(
        self,
        q: ArrayLike,
        v: ArrayLike,
        t: ArrayLike,
        *,
        higher: Sequence[ArrayLike] = (),
        parameters: Mapping[str, ArrayLike] | None = None,
    ) -> Array:
        """Return I, shape (K,) for q, v of shape (n, K), a 0-d array for (n,).

        Where L contains accelerations, `higher` are a and j, with the jerk four of them, and so on:
        `q, v, *higher = solution.derivatives(t)`. Raises ValueError for others, and other shapes.
        """
        return np.sum(self._each((q, v, *higher), t, parameters), axis=-1)

    def drift(self, solution: HasMotion, count: int = 201) -> float:
        """Return max over time of |I(t) - I(t0)| along a solution, over the size of I's terms.

        As large as the velocity's error; more means that I is not conserved with the
        parameters of the solution's problem.
        """
        if not hasattr(solution, "problem") or not callable(solution):
            raise ValueError(f"expected a Solution along which to look, found {solution!r}")
        problem, count = solution.problem, whole(count, "the number of times", 1)
        if MULTIPLIERS in problem.parameters and MULTIPLIERS not in self.system.table.shapes:
            raise ValueError(
                "expected what a path of given integrals conserves, found what it does without "
                "them; ask for that of solution.problem.system, whose L contains their multipliers"
            )
        t = np.linspace(problem.start.t, problem.end.t, count)
        terms = self._each(solution.derivatives(t), t, problem.parameters)
        size = float(np.max(np.sum(np.abs(terms), axis=1)))
        value = np.sum(terms, axis=1)
        return float(np.max(np.abs(value - value[0]))) / size if size else 0.0

    def _each(self, state: Sequence[ArrayLike] | Array, t: ArrayLike, parameters) -> Array:
        """Return the terms of I, (K, terms) or (terms,), of q, v and so on, and the time."""
        wanted = 2 * self.system.order
        if len(state) != wanted:
            raise ValueError(
                f"expected q, v and {wanted - 2} higher derivatives, found {len(state) - 2} of "
                "these; along a path they are q, v, *higher = solution.derivatives(t)"
            )
        pairs = [
            self.system.arguments(state[k], state[k + 1], t, parameters)
            for k in range(0, wanted, 2)
        ]
        arguments, single = pairs[0]
        rows = [row for pair, _ in pairs for row in pair[:2]]
        values = self._sum(np.hstack(rows[:-1]), rows[-1], *arguments[2:])[0].copy()
        return values[0] if single else values


def _arguments(system: System) -> list[ca.SX]:
    """Return what a conserved quantity depends on: derivatives below the highest, it, t and p."""
    *below, highest = jet_of(system)[:-1]
    return [ca.vertcat(*below), highest, system.symbols.t, system.symbols.p]


def _restore(system: System, terms: ca.Function) -> Conserved:
    """Return the conserved quantity whose terms a function of `_arguments` gives."""
    return Conserved(system, terms(*_arguments(system)))


def noether(
    system: System,
    generator: Generator,
    *,
    time: float | Callable[..., Any] = 0.0,
    gauge: Callable[..., Any] | None = None,
    parameters: Mapping[str, ArrayLike] | None = None,
) -> Conserved:
    """Return what a symmetry conserves, I = p . xi - H tau - F.

    With accelerations in L it is Ostrogradsky's, I = sum_k p_k . (xi - v tau)^(k - 1) + L tau - F.

    Parameters
    ----------
    system : System
    generator : callable or sequence of n numbers
        `generator(q, t, *, ...)` returns the n rates xi of q -> q + xi d; numbers are a
        translation. It names the system's parameters it uses.
    time : float or callable
        The rate tau of t -> t + tau d: 1 for a translation in time, or `tau(t, *, ...)`.
    gauge : callable, optional
        F(q, t) where the Lagrangian changes by dF/dt. Without it F is found by integration
        along straight lines from the origin, t first, by Gauss's rule with 16 points.
    parameters : mapping, optional
        The numbers for which the symmetry is checked, in place of the defaults: two springs
        may have to be equal.

    Raises
    ------
    ValueError
        If the action changes, or the constraints are not kept; or for a generator of the wrong
        shape.

    References
    ----------
    *Competitive Physics: Mechanics and Waves* (2018), section 12.5.4; Arnold, *Mathematical
    Methods of Classical Mechanics* (2nd ed. 1989), section 20.

    Examples
    --------
    >>> def lagrangian(q, v, t):
    ...     return (v @ v - q @ q) / 2
    >>> oscillator = System(lagrangian, ["x", "y"])
    >>> momentum = noether(oscillator, lambda q, t: [-q[1], q[0]])
    >>> float(momentum([1.0, 2.0], [3.0, 5.0], 0.0))  # x y' - y x'
    -1.0
    """
    check_system(system).check_free("what is conserved without it may change in contact")
    if system.m:
        system.check_order("what a symmetry conserves under constraints")
    s, n, jet = system.symbols, system.n, jet_of(system)
    xi = _trace(system, generator, "generator", n)
    tau = _trace(system, time, "time", 1)
    if ca.depends_on(tau, ca.vertcat(*jet)):
        raise ValueError("expected a rate of time tau(t) that depends on t alone")
    packed = system.table.pack(system.table.values(parameters))
    points = [*points_of(system, packed), packed]
    arguments = [s.q, s.v, s.t, s.p]
    if system.m:
        G = system.derivatives.G
        kept = ca.horzcat(*[G[:, i] * xi[i] for i in range(n)], ca.jacobian(system.f, s.t) * tau)
        worst = _worst(kept, arguments, points)
        if not worst <= CANCELLED:
            raise ValueError(
                "expected a generator that keeps the constraints, G xi + f_t tau = 0, found that "
                f"it leads off their surface (by {worst:.1e} of its terms)"
            )
    R = change(system, xi, tau)
    if not np.isfinite(_worst(R, arguments, points)):
        raise ValueError(
            "expected a Lagrangian and a generator that are finite at some points in general "
            "position, found none; give the system in units in which coordinates are of size one"
        )
    if gauge is not None:
        candidates = iter([_trace(system, gauge, "gauge", 1)])
    else:
        integrals = (_integral(system, R, base) for base in (0.0, 1.0))  # if zero does not serve
        candidates = chain([ca.SX(1, 1)], integrals)
    moderate = [points[0][:GENERIC], points[1][:GENERIC], points[2][:GENERIC], packed]
    found = np.inf
    for k, F in enumerate(candidates):
        rates = [-ca.jacobian(F, s.t), -(ca.jacobian(F, jet[0]) * jet[1].T)]
        # A numerical F is good at coordinates of size one only: at other sizes that there is
        # an F is enough.
        miss = _worst(ca.horzcat(R, *rates), arguments, moderate if k else points)
        if k and miss <= CANCELLED:
            miss = _worst_curl(system, R, points)
        found = min(found, miss)
        if found <= CANCELLED:
            terms, by_space, by_time = [tau * system.L, -F], xi, jet[1] * tau
            for p in momenta_by(system, jet)[1:]:
                terms += [(p * by_space).T, -(p * by_time).T]
                by_space, by_time = rate_of(system, by_space), rate_of(system, by_time)
            return Conserved(system, ca.horzcat(*terms))
    raise ValueError(
        "expected a symmetry, found that the Lagrangian's change is no total derivative "
        f"dF(q, t)/dt (by {found:.1e} of its terms); correct the generator, set `time` if it "
        "moves events in time, or pass the parameters for which it is a symmetry"
    )


def cyclic(system: System) -> dict[str, Conserved]:
    """Return the momenta of the cyclic coordinates, by the names of the coordinates.

    They are found by themselves: those that neither L, nor the constraints, nor the forces
    contain, and along which no force acts. Section 12.5.2.
    """
    result = {}
    for name in system.structure.cyclic:
        k = system.coordinates.index(name)
        if not system.Q.numel() or ca.sparsify(system.Q[k]).nnz() == 0:
            result[name] = noether(system, np.eye(system.n)[k])
    return result


def is_mechanical(system: System, kinetic: Callable[..., Any]) -> bool:
    """Return whether H = T + V for the kinetic energy `kinetic(q, v, t, *, ...)`.

    By Euler's theorem that is so where v . dT/dv = 2 T and V = T - L does not depend on v; not
    with coordinates that move, or with magnetic fields. Checked symbolically; section 12.5.1.
    """
    system.check_order("a kinetic energy")
    s, packed = system.symbols, system.table.pack(system.parameters)
    T = _trace(system, kinetic, "kinetic", 1)
    points = [*points_of(system, packed), packed]
    degree = ca.horzcat(ca.jacobian(T, s.v) * s.v.T, -2 * T)
    rest = ca.horzcat(ca.gradient(T, s.v), -system.derivatives.Lv)
    return all(vanishes(terms, [s.q, s.v, s.t, s.p], points) for terms in (degree, rest))


def _trace(system: System, given: Any, role: str, rows: int) -> ca.SX:
    """Return a user's function (or numbers) in the system's symbols, as a column."""
    if not callable(given):
        return ca.SX(column(np.atleast_1d(numbers(given, f"the {role}")).tolist(), role, rows))
    s = system.symbols
    fresh = system.table.symbols()
    named = system.table.by_name(fresh)
    arguments = {
        "q": Expressions(system.place, 1),
        "v": Expressions(s.v, 1),
        "t": Expressions(s.t, 0),
    }
    for name in {"time": "qv", "kinetic": ""}.get(role, "v"):
        del arguments[name]
    result, _ = call(given, role, arguments, named)
    traced = column(result, role, rows)
    return ca.substitute(traced, fresh, s.p) if fresh.numel() else traced


def change(system: System, xi: ca.SX, tau: ca.SX) -> ca.SX:
    """Return the terms of R, one row."""
    s, d, L, jet = system.symbols, system.derivatives, system.L, jet_of(system)
    slower, moved = ca.jacobian(tau, s.t), [xi]
    for y in jet[1 : system.order + 1]:
        moved.append(rate_of(system, moved[-1]) - y * slower)
    slopes = [*(ca.vertsplit(d.Lq, system.n) if system.order > 1 else [d.Lq]), d.Lv]
    terms = [(slope * rate).T for slope, rate in zip(slopes, moved, strict=True)]
    terms += [ca.jacobian(L, s.t) * tau, L * slower]
    if system.Q.numel():
        terms += [(system.Q * xi).T, -(system.Q * jet[1] * tau).T]
    return ca.horzcat(*terms)


def euler(system: System, R: ca.SX) -> list[ca.SX]:
    """Return columns (-d/dt)^k dR/dq^(k) that add up to nothing where R is a total derivative."""
    found = []
    for k, y in enumerate(jet_of(system)[: system.order + 1]):
        slope = ca.gradient(R, y)
        for _ in range(k):
            slope = -rate_of(system, slope)
        found.append(slope)
    return found


def beyond(system: System, q: Array, v: Array) -> Array:
    """Return derivatives above those that L contains, in general position, (K, order n).

    As large as on a circle: each as much larger than the one below as v is than that below it.
    """
    n, r = system.n, system.order
    rate = np.linalg.norm(v, axis=1) / np.linalg.norm(q[:, -n:], axis=1)
    size = np.linalg.norm(v, axis=1)[:, None] * rate[:, None] ** np.arange(1, r + 1)
    return general_points(r * n, len(q)) * np.repeat(size, n, axis=1)


def _integral(system: System, R: ca.SX, base: float) -> ca.SX:
    """Return the F with dF/dt = R if there is one, from F = 0 at q = base, t = 0."""
    s, jet = system.symbols, jet_of(system)
    q, rates = jet[0], ca.vertcat(*jet[1 : system.order + 1])
    whole = ca.sum2(R)
    at_rest = ca.substitute(whole, rates, ca.SX.zeros(rates.numel()))
    slope = ca.substitute(ca.jacobian(whole, jet[1]), rates, ca.SX.zeros(rates.numel()))
    x, w = np.polynomial.legendre.leggauss(GAUGE_POINTS)
    F = ca.SX(1, 1)
    for at, weight in zip((x + 1) / 2, w / 2, strict=True):
        along = ca.substitute(slope, q, base + at * (q - base)) @ (q - base)
        start = ca.SX(ca.DM.ones(system.n) * base)
        before = ca.substitute([at_rest], [q, s.t], [start, at * s.t])[0]
        F += weight * (along + before * s.t)
    return F


def points_of(system: System, packed: Array, count: int = GENERIC) -> tuple[Array, Array, Array]:
    """Return q, v (K, n) and t (K, 1) in general position, on the constraints and their rates.

    As the system's functions take them: of L with accelerations q is (q, v), and v these.

    The first `count` of them are of size one, or nearly.
    """
    n, m = system.n, system.m
    q, v, t = general_states(n, count, system.order)
    if not m:
        return q, v, t
    q = general_points(n, len(q))  # surfaces have their own size
    s, G = system.symbols, system.derivatives.G
    functions = [system.f, G.T, G @ s.v + ca.jacobian(system.f, s.t)]
    evaluate = ca.Function("surface", [s.q, s.v, s.t, s.p], [ca.densify(x) for x in functions])
    good = []
    for k in range(len(q)):
        for _ in range(SURFACE_STEPS):
            f, GT, rate = (np.asarray(x) for x in evaluate(q[k], v[k], t[k], packed))
            if not np.isfinite(GT).all():
                break
            inverse = np.linalg.pinv(GT.T)
            step = (inverse @ f).ravel()
            q[k] -= step / max(1.0, float(np.max(np.abs(step))) / (10 * np.max(np.abs(q[k]))))
            v[k] -= (inverse @ rate).ravel()
            if np.max(np.abs(step)) < 1e-15 * np.max(np.abs(q[k])):  # five spacings of floats
                break
        if np.max(np.abs(step)) < 1e-13 * np.max(np.abs(q[k])):  # on it, but for round-off
            good.append(k)
    if not good:
        raise ValueError(
            "expected constraints that coordinates in general position can be moved onto, found "
            "none; give the system in units in which they are of size one"
        )
    return q[good], v[good], t[good]


def _worst_curl(system: System, R: ca.SX, points) -> float:
    """Return how far d/dt R_v - R_q is from zero, which R = dF/dt makes it identically."""
    s, higher = system.symbols, ca.vertcat(*jet_of(system)[system.order + 1 :])
    columns = [side for term in ca.horzsplit(R) for side in euler(system, term)]
    q, v, t, packed = points
    arguments = [s.q, s.v, higher, s.t, s.p]
    return _worst(ca.horzcat(*columns), arguments, [q, v, beyond(system, q, v), t, packed])


def _worst(terms: ca.SX, arguments, points) -> float:
    """Return the largest `mismatch`, infinity where too few points are finite."""
    found = mismatch(terms, arguments, points)
    known = np.isfinite(found).all(axis=0)
    return float(np.max(found[:, known])) if np.sum(known) >= FINITE else np.inf
