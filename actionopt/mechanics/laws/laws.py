"""Laws as expressions, and all that is derived from them.

Everything is derived once, symbolically and at one point in time, on first use, with the
parameters left as symbols, and compiled to functions that are evaluated at many times at once.
One thread at a time derives; the others wait for it.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from functools import wraps
from typing import TYPE_CHECKING, Any, TypeVar

import casadi as ca
import numpy as np

from actionopt.mechanics.laws.compiled import Pointwise
from actionopt.mechanics.laws.instants import CLOCKED, ClockSwitches, clock
from actionopt.mechanics.laws.separable import hessian
from actionopt.mechanics.laws.switches import (
    STEPPED,
    Switches,
    adds_time,
    is_jumpless,
    is_smooth,
    is_smooth_in_path,
    narrowness,
    switches,
)
from actionopt.mechanics.laws.tables import refuse_lost_derivatives
from actionopt.mechanics.laws.tracing import SAMPLES, TAILED_SAMPLES, Symbols, deriving, stack
from actionopt.tools.cached import cached_property
from actionopt.tools.immutable import immutable
from actionopt.tools.tape import LINEAR_TABLE, Tape

if TYPE_CHECKING:
    from actionopt.mechanics.laws.pulses import StepArguments

T = TypeVar("T")
NO_OPERATIONS = Tape((), ())
# Constraints, most, whose multipliers are eliminated in formulas. Measured on chains of 2, 5 and 10
# links at 1 to 1,000 times: a third of the time of numpy's solutions; there are none of more.
MOST_ELIMINATED = 10


class Once(cached_property[T]):
    """An attribute of laws that is derived on first use, by one thread.

    With the lock of the laws: two locks could be taken in either order.
    """

    def __init__(self, build: Callable[[Any], T]) -> None:
        @wraps(build)
        def derive(laws: Laws) -> T:
            with laws.lock:
                kept = vars(laws)
                if self.name not in kept:
                    kept[self.name] = build(laws)
                return kept[self.name]

        super().__init__(derive)


def keep(build: Callable[[Any], T]) -> Callable[[Any], T]:
    """Return a function of laws that derives something from them once: they keep it."""
    name = f"{build.__module__}.{build.__qualname__}"

    @wraps(build)
    def find(laws: Laws) -> T:
        return laws.memoize(name, lambda: build(laws))

    return find


@immutable
class Structure:
    """The dependences of a system's derivatives, read off their expressions once.

    What is absent here is not built, evaluated or stored by the solver.
    """

    depends_on_time: bool
    adds_time: bool  # a term of the time alone is added in L
    constant_mass: bool  # the mass matrix does not depend on q or v; so below: for smooth laws
    constant_coupling: bool  # nor does the mixed derivative of L
    constant_stiffness: bool  # nor does the second derivative of L in q
    affine_constraint: bool  # f is affine in q
    affine_force: bool  # Q is affine in (q, v)
    constraints: int
    forced: bool
    cyclic: tuple[str, ...]  # coordinates that neither L, f nor Q contain
    narrow: int  # how narrow a feature L can have: 0, 1 or 2 (`switches.narrowness`)
    smooth: bool  # neither L nor Q have a kink or a jump in q or v
    jumpless: bool  # it is plain that L cannot step
    hides: bool  # L may have steps along a path that no sample shows
    pushes: bool  # Q may have such steps
    operations: frozenset[int]  # CasADi's numbers of those in L, f and Q
    samples: int  # times over the whole duration at which the forces are sampled, at least

    @cached_property
    def linear(self) -> bool:
        """Whether the equations of motion, and so the discrete ones, are linear."""
        return self._linear_forces and self.affine_constraint

    @cached_property
    def steady(self) -> bool:
        """Whether they are linear with coefficients that are constant in time."""
        return self.steady_forces and self.affine_constraint

    @cached_property
    def steady_forces(self) -> bool:
        """Whether what L and Q have in them is so, whatever constraints are."""
        return self._linear_forces and not self.depends_on_time

    @property
    def _linear_forces(self) -> bool:
        quadratic = self.constant_mass and self.constant_coupling and self.constant_stiffness
        return quadratic and self.affine_force


@immutable
class Derivatives:
    """Symbolic derivatives of L at one time; the symmetric ones as upper triangles."""

    Lq: ca.SX
    Lv: ca.SX
    Lqq: ca.SX
    Lqv: ca.SX
    Lvv: ca.SX
    G: ca.SX


class Laws:
    """A Lagrangian, holonomic constraints and non-conservative forces, as expressions.

    Parameters
    ----------
    symbols : Symbols
        What they are written in.
    L, f, Q : casadi.SX
        The Lagrangian; m constraints; n forces, or none.
    coordinates : tuple of str
        Names of the n coordinates.
    """

    def __init__(
        self, symbols: Symbols, L: ca.SX, f: ca.SX, Q: ca.SX, coordinates: tuple[str, ...]
    ) -> None:
        self.symbols, self.coordinates = symbols, coordinates
        self.L, self.f, self.Q = L, f, Q
        self.n, self.m = len(coordinates), f.numel()  # of coordinates, and of constraint rows
        self.order = symbols.q.numel() // self.n  # of the highest derivative in L
        self.place = symbols.q[: self.n] if self.order > 1 else symbols.q  # where it is
        self.F: ca.SX | None = None  # the length whose square is 2 L, of geodesics
        self.lock = threading.RLock()  # of all that is derived and kept
        self._pointwise: dict[str, Pointwise] = {}
        self._made: dict[str, Any] = {}

    @property
    def degrees_of_freedom(self) -> int:
        """Number of coordinates less the number of holonomic constraints (section 12.4)."""
        return self.n - self.m

    @property
    def derived(self) -> tuple[str, ...]:
        """Names of the functions derived so far; a re-solve adds none."""
        return tuple(self._pointwise)

    @Once
    def structure(self) -> Structure:
        """Return on what the derivatives of L depend, by the sparsity of their own derivatives."""
        forced = self.Q.numel() > 0
        moved = (
            self._depends("second", 2, (0, 1)),
            self._depends("second", 1, (0, 1)),
            self._depends("second", 0, (0, 1)),
            self.m > 0 and self._depends("constraint_jacobian", 0, (0,)),
            forced and any(self._depends("force_jacobian", k, (0, 1)) for k in (0, 1)),
        )
        L, f, Q = self.lagrangian_tape, self.operations(self.f), self.operations(self.Q)
        for tape in (L, f, Q):
            refuse_lost_derivatives(tape)
        narrow = narrowness(L)
        jumpless = narrow == 0 or (narrow == 1 and is_jumpless(L))
        jumpless &= ca.OP_CALL not in L.operations  # a table ends with a step
        # Kinks matter only in second derivatives that would be taken for constant.
        smooth = not narrow or all(moved[:3]) or is_smooth_in_path(L)
        timed, cyclic = self._absent_arguments()
        either = max(narrow, narrowness(Q))
        unseen, tailed = either == 2 or (either and timed), either or timed
        return Structure(
            depends_on_time=timed,
            adds_time=timed and adds_time(L),
            constant_mass=smooth and not moved[0],
            constant_coupling=smooth and not moved[1],
            constant_stiffness=smooth and not moved[2],
            affine_constraint=not moved[3] and is_smooth(f),
            affine_force=not moved[4] and is_smooth_in_path(Q),
            constraints=self.m,
            forced=forced,
            cyclic=cyclic,
            narrow=narrow,
            smooth=either < 2 or (is_smooth_in_path(L) and is_smooth_in_path(Q)),
            jumpless=jumpless,
            hides=not jumpless and self.order == 1 and _may_hide(L),
            pushes=forced and self.order == 1 and _may_hide(Q),
            operations=L.operations | f.operations | Q.operations,
            samples=SAMPLES if unseen else TAILED_SAMPLES if tailed else 0,
        )

    def _absent_arguments(self) -> tuple[bool, tuple[str, ...]]:
        """Return whether the time is in the equations of motion, and which coordinates are not."""
        laws = [("first", 2, 2)]  # function, output, the input t; q is the first of all
        if self.m:
            laws.append(("constraint_jacobian", 1, 1))
        if self.Q.numel():
            laws.append(("force", 0, 2))
        seen: set[int] = set()
        for name, output, _ in laws:
            seen.update(self.pointwise(name).function.jac_sparsity(output, 0).get_col())
        timed = any(self._depends(name, output, (t,)) for name, output, t in laws)
        return timed, tuple(c for i, c in enumerate(self.coordinates) if i not in seen)

    @Once
    def lagrangian_tape(self) -> Tape:
        """Return the operations of L."""
        return self.operations(self.L)

    def operations(self, law: ca.SX) -> Tape:
        """Return the operations of an expression of (q, v, t) and the parameters."""
        if not law.numel():
            return NO_OPERATIONS
        return Tape(self._arguments, [law])

    @Once
    def fill_ratio(self) -> float:
        """Return the cost of eliminating one node's coordinates and multipliers, 1 if all couple.

        Coordinates couple as second derivatives of L have them, multipliers as their constraints.
        """
        f = self.n + self.m
        pattern = ca.Sparsity.diag(f)
        parts = [("second", k, 0) for k in range(3)]  # with rates those of one coordinate are one
        if self.Q.numel():
            parts += [("force_jacobian", k, 0) for k in range(2)]
        if self.m:
            parts.append(("constraint_jacobian", 0, self.n))
            if not self.structure.affine_constraint:
                parts.append(("constraint_curvature", 0, 0))
        for name, output, first in parts:
            row, col = self.pointwise(name).sparsity(output)
            rows, cols = (row % self.n + first).tolist(), (col % self.n).tolist()
            pattern += ca.Sparsity.triplet(f, f, rows + cols, cols + rows)
        lower = pattern.ldl()[0]
        return float(np.sum((np.diff(lower.colind()) + 1) ** 2)) * 6 / (f * (f + 1) * (2 * f + 1))

    @Once
    def quadratic_constraint(self) -> bool:
        """Whether f is quadratic in q."""
        bends = self.m > 0 and self._depends("constraint_curvature", 0, (0,))
        return not bends and is_smooth(self.operations(self.f))

    @Once
    def switches(self) -> Switches | None:
        """Return the branches of L, where they depend on q or v; None where there are none."""
        if not self.structure.samples or STEPPED.isdisjoint(self.structure.operations):
            return None
        return switches(self.symbols, self.lagrangian_tape, self.coordinates)

    @Once
    def clock(self) -> ClockSwitches | None:
        """Return what switches with the time alone; None where nothing does."""
        if not self.structure.depends_on_time or CLOCKED.isdisjoint(self.structure.operations):
            return None
        return clock(self.symbols, self.L, self.f, self.Q)

    @Once
    def pulses(self) -> Pointwise | None:
        """Return what tells of pulses in the time alone; None where there can be none."""
        if not self.structure.depends_on_time:
            return None
        from actionopt.mechanics.laws.pulses import PULSES, pulses

        if PULSES.isdisjoint(self.structure.operations):
            return None
        others = self.operations(self.f), self.operations(self.Q)
        return pulses(self.symbols, self.lagrangian_tape, *others)

    @Once
    def step_arguments(self) -> StepArguments | None:
        """Return the arguments of what may be narrow along a path; None where nothing can be."""
        if not self.structure.hides:
            return None
        from actionopt.mechanics.laws.pulses import StepArguments

        return StepArguments(self.lagrangian_tape)

    @Once
    def steps_along(self) -> Pointwise | None:
        """Return what tells of narrow steps of L along a path; None where there can be none."""
        if not self.structure.hides:
            return None
        from actionopt.mechanics.laws.pulses import steps_along

        return steps_along(self.symbols, self.lagrangian_tape)

    @Once
    def pushes_along(self) -> tuple[StepArguments, Pointwise] | None:
        """Return the arguments of narrow steps of Q, and what tells of them; None without any."""
        if not self.structure.pushes:
            return None
        from actionopt.mechanics.laws.pulses import StepArguments, steps_along

        force = self.operations(self.Q)
        along = steps_along(self.symbols, force)
        return None if along is None else (StepArguments(force), along)

    def _depends(self, name: str, output: int, inputs: tuple[int, ...]) -> bool:
        """Whether an output of a compiled function depends on any of these inputs."""
        function = self.pointwise(name).function
        return any([function.jac_sparsity(output, i).nnz() for i in inputs])

    @Once
    def may_turn_corners(self) -> bool:
        """Whether two velocities may have one momentum, as L is not quadratic in v."""
        if self.structure.constant_mass or self.order > 1:
            return False
        return self._depends("second", 2, (1,))

    @Once
    def derivatives(self) -> Derivatives:
        """Symbolic first and second derivatives of L and the constraint Jacobian."""
        s = self.symbols
        n = s.q.numel()
        with deriving("laws that CasADi differentiates, the Lagrangian twice"):
            H, g = hessian(self.L, stack(s.q, s.v), self._arguments, lambda: self.lagrangian_tape)
            G = ca.jacobian(self.f, self.place) if self.m else ca.SX(0, self.n)
        H = ca.triu(H) if H.numel() > 4 else H
        return Derivatives(g[:n], g[n:], H[:n, :n], H[:n, n:], H[n:, n:], G)

    def pointwise(self, name: str) -> Pointwise:
        """Return the compiled function `name` of one time, deriving it on first use."""
        found = self._pointwise.get(name)
        if found is None:
            with self.lock:
                if name not in self._pointwise:
                    with deriving("laws that CasADi differentiates"):
                        inputs, outputs = self._build(name)
                    self._pointwise[name] = self._evaluator(name, inputs, outputs)
                found = self._pointwise[name]
        return found

    def _evaluator(self, name: str, inputs: list[ca.SX], outputs: list[ca.SX]) -> Pointwise:
        if LINEAR_TABLE not in self.lagrangian_tape.operations:
            return Pointwise(ca.Function(name, inputs, outputs))
        from actionopt.mechanics.laws.lookups import evaluator, tables_in

        tables = self.memoize("tables", lambda: tables_in(self.lagrangian_tape))
        return evaluator(name, inputs, outputs, self.symbols.t, self.symbols.p, tables)

    def forget(self) -> None:
        """Free what tells where functions were evaluated last."""
        for function in list(self._pointwise.values()):
            function.forget()

    def memoize(self, name: str, build: Callable[[], T]) -> T:
        """Return what `build` makes of these laws, made once and kept as long as they are."""
        with self.lock:
            if name not in self._made:
                self._made[name] = build()
            return self._made[name]

    @property
    def _arguments(self) -> list[ca.SX]:
        s = self.symbols
        return [s.q, s.v, s.t, s.p]

    def _build(self, name: str) -> tuple[list[ca.SX], list[ca.SX]]:
        """Return the arguments and the outputs of a function."""
        if name in STATE_OUTPUTS:
            return self._arguments, STATE_OUTPUTS[name](self)
        if name in PLACE_OUTPUTS:
            return [self.place, self.symbols.t, self.symbols.p], PLACE_OUTPUTS[name](self)
        return getattr(self, f"_build_{name}")()

    def _build_normal_rate(self):
        s = self.symbols
        lam = ca.SX.sym("lam", self.m)
        return [self.place, lam, s.t, s.p], [_dense(ca.jtimes(self.derivatives.G.T @ lam, s.t, 1))]

    def _build_meeting(self):
        s = self.symbols
        a, w, lam = (ca.SX.sym(x, k) for x, k in (("a", self.n), ("w", self.m), ("lam", self.m)))
        G, rate = self.derivatives.G, ca.jacobian(self.f, s.t)
        slip = ca.dot(w, G @ s.v + rate) + ca.dot(a, G.T @ lam - self.derivatives.Lv)
        by = [_dense(ca.gradient(slip, x)) for x in (s.q, s.t)]
        return [s.q, s.v, s.t, s.p, a, w, lam], by

    def _build_constraint_curvature(self):
        s = self.symbols
        lam = ca.SX.sym("lam", self.m)
        curvature, _ = ca.hessian(ca.dot(lam, self.f), self.place)
        return [self.place, lam, s.t, s.p], [ca.triu(curvature)]

    def _build_constrained_motion(self):
        M, bias, G, gamma = self.motion
        free = ca.solve(M, ca.horzcat(bias, G.T))
        a, pulls = free[:, 0], free[:, 1:]
        return self._arguments, [_dense(a - pulls @ ca.solve(G @ pulls, gamma + G @ a))]

    @Once
    def has_constrained_motion(self) -> bool:
        """Whether accelerations under the constraints have a short formula."""
        return 0 < self.m <= MOST_ELIMINATED and self.motion[0].sparsity().is_diag()

    @Once
    def has_diagonal_mass(self) -> bool:
        """Whether no two velocities multiply each other in L."""
        rows, cols = self.pointwise("second").sparsity(2)
        return bool((rows == cols).all())

    @Once
    def motion(self) -> tuple[ca.SX, ca.SX, ca.SX, ca.SX]:
        """Index-1 equations of motion as expressions: M a - G' lam = bias, G a = -gamma.

        bias = L_q + Q - L_vq v - L_vt and gamma = d/dt (G v + f_t), the time derivatives of L_v and
        twice of f less their acceleration terms.
        """
        if self.order > 1:
            raise ValueError(
                "expected a Lagrangian of coordinates and velocities where accelerations follow "
                "from these, found one that contains accelerations itself; solve a problem of it, "
                "and compare its solution with motion"
            )
        s, d = self.symbols, self.derivatives
        place, rate = stack(s.q, s.t), stack(s.v, ca.SX(1))

        def changing(of: ca.SX) -> ca.SX:
            """Return the time derivative along a motion, at constant v."""
            return ca.jtimes(of, place, rate)

        bias = d.Lq - changing(d.Lv)
        if self.Q.numel():
            bias += self.Q
        gamma = changing(changing(self.f)) if self.m else self.f
        return ca.triu2symm(d.Lvv), bias, d.G, gamma


def _may_hide(law: Tape) -> bool:
    from actionopt.mechanics.laws.pulses import may_hide

    return may_hide(law)


def _dense(expression: ca.SX) -> ca.SX:
    return expression if expression.is_dense() else ca.densify(expression)


# Outputs of functions of (q, v, t, p), and of (q, t, p).
STATE_OUTPUTS: dict[str, Callable[[Any], list[ca.SX]]] = {
    "value": lambda x: [x.L],
    "length": lambda x: [x.F],
    "first": lambda x: [_dense(x.derivatives.Lq), _dense(x.derivatives.Lv), x.L],
    "slopes": lambda x: [_dense(x.derivatives.Lq), _dense(x.derivatives.Lv)],
    "rate": lambda x: [_dense(ca.jacobian(x.L, x.symbols.t))],
    "balance": lambda x: [*STATE_OUTPUTS["first"](x), *STATE_OUTPUTS["rate"](x)],
    "second": lambda x: [x.derivatives.Lqq, x.derivatives.Lqv, x.derivatives.Lvv],
    "force": lambda x: [x.Q],
    "force_jacobian": lambda x: [ca.jacobian(x.Q, y) for y in (x.symbols.q, x.symbols.v)],
    "energy": lambda x: [ca.dot(x.symbols.v, x.derivatives.Lv) - x.L],
    "motion": lambda x: [_dense(y) for y in x.motion],
    "even_motion": lambda x: [_dense(ca.diag(x.motion[0])), _dense(x.motion[1])],
}
PLACE_OUTPUTS: dict[str, Callable[[Any], list[ca.SX]]] = {
    "constraint": lambda x: [x.f],
    "constraint_jacobian": lambda x: [x.derivatives.G, x.f],  # as a rule both are wanted
    "constraint_rate": lambda x: [_dense(ca.jacobian(x.f, x.symbols.t))],
}
