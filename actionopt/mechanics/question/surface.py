"""Surfaces on which an event lies, on(q, t) = 0: where on them, the action decides.

With S + E (t1 - t0) + mu.on stationary the momentum is normal to the surface, p1 = -mu on_q and
p0 = mu on_q, and where the time is free H - E = mu on_t at the end: p.dq - (H - E) dt = 0 for all
moves along the surface. (Transversality: Gelfand and Fomin, *Calculus of Variations* (1963),
section 14; and Bolza, *Lectures on the Calculus of Variations* (1904), for the focal points of
curves.)
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np

from actionopt.mechanics.laws.compiled import Pointwise
from actionopt.mechanics.laws.expressions import Expressions
from actionopt.mechanics.laws.tracing import call, deriving, parameter_names, surface
from actionopt.mechanics.question.events import Event
from actionopt.mechanics.system import System
from actionopt.tools.checks import by_name
from actionopt.tools.immutable import immutable
from actionopt.tools.types import Array

# How far, relative to the surface's own scale, an event may lie off it: numbers that a user writes
# with nine digits lie on it. Ad hoc.
SURFACE_TOLERANCE = 1e-8


@immutable
class Surface:
    """The s expressions on(q, t) that vanish at an event, traced."""

    law: ca.Function  # on(q, t, p) with the parameters p packed in one column
    shapes: dict[str, tuple[int, ...]]  # those of the parameters in it, by name

    def __call__(self, q: ca.SX, t: ca.SX, p: ca.SX) -> ca.SX:
        """Return the expressions, (s, 1), of symbols."""
        return self.law(q, t, p)

    @classmethod
    def trace(cls, on: Callable[..., Any], system: System) -> Surface:
        """Return the surface that a user wrote, in the parameters of a system.

        Raises ValueError if it cannot be traced, or returns nothing.
        """
        s = system.symbols
        state = {"q": Expressions(system.place, 1), "t": Expressions(s.t, 0)}
        rows = surface(call(on, "on", state, system.table.by_name(s.p))[0], "on")
        if not rows.numel():
            raise ValueError("expected on to return an expression or a sequence of them, found []")
        return cls(ca.Function("on", [system.place, s.t, s.p], [rows]), dict(system.table.shapes))

    def __reduce__(self) -> tuple:
        """Carry the law; its derivatives are made where they are needed."""
        return Surface, (self.law, self.shapes)

    @cached_property
    def count(self) -> int:
        """How many expressions there are, s."""
        return self.law.numel_out(0)

    @cached_property
    def depends_on_time(self) -> bool:
        """Whether the surface moves."""
        return bool(self.law.jac_sparsity(0, 1).nnz())

    @property
    def _symbols(self) -> list[ca.SX]:
        return [ca.SX.sym(name, self.law.numel_in(i)) for i, name in enumerate("qtp")]

    @cached_property
    def _value(self) -> Pointwise:
        symbols = self._symbols
        return Pointwise(ca.Function("on_value", symbols, [self(*symbols)]))

    @cached_property
    def _first(self) -> Pointwise:
        symbols = self._symbols
        rows = self(*symbols)
        with deriving("surfaces that CasADi differentiates twice"):
            parts = [ca.densify(ca.jacobian(rows, x)) for x in symbols]
        return Pointwise(ca.Function("on_first", symbols, [rows, *parts]))

    @cached_property
    def _second(self) -> Pointwise:
        symbols, mu = self._symbols, ca.SX.sym("mu", self.count)
        with deriving("surfaces that CasADi differentiates twice"):
            curvature, _ = ca.hessian(ca.dot(mu, self(*symbols)), ca.vertcat(*symbols[:2]))
        return Pointwise(ca.Function("on_second", [*symbols, mu], [ca.densify(curvature)]))

    def at(self, q: Array, t: float, packed: Array) -> tuple[Array, Array, Array, Array]:
        """Return on (s,) and its derivatives by q (s, n), t (s,) and the parameters (s, P)."""
        found = self._first(q[None], np.array([[t]]), packed)
        rows, by_q, by_t, by_p = (x[0].reshape(-1, self.count).T for x in found)
        return rows[:, 0].copy(), by_q.copy(), by_t[:, 0].copy(), by_p.copy()

    def along(self, q: Array, t: Array, packed: Array) -> tuple[Array, Array, Array]:
        """Return on (K, s) and its derivatives by q (K, s, n) and t (K, s) at q (K, n), t (K,)."""
        on, by_q, by_t, _ = self._first(q, t[:, None], packed)
        by_q = by_q.reshape(len(t), -1, self.count).transpose(0, 2, 1)
        return on.copy(), by_q.copy(), by_t.copy()

    def values(self, q: Array, t: Array, packed: Array) -> Array:
        """Return on (K, s) at q (K, n), t (K,)."""
        return self._value(q, t[:, None], packed)[0].copy()

    def curvature(self, q: Array, t: float, packed: Array, mu: Array) -> Array:
        """Return the second derivatives of mu.on by q, (n, n)."""
        return self.bending(q, t, packed, mu)[:-1, :-1]

    def bending(self, q: Array, t: float, packed: Array, mu: Array) -> Array:
        """Return the second derivatives of mu.on by q and t, (n + 1, n + 1)."""
        found = self._second(q[None], np.array([[t]]), packed, mu[None])[0]
        return found[0].reshape(q.size + 1, q.size + 1).copy()


def with_parameters(
    system: System, events: tuple[Any, ...], parameters: Mapping[str, Any]
) -> System:
    """Return the system with those of the parameters that only the surfaces of events contain.

    Raises ValueError if `parameters` does not give one.
    """
    more, given = {}, by_name(parameters, "parameters")
    for event in events:
        on = getattr(event, "on", None)
        if on is None:
            continue
        names = on.shapes if isinstance(on, Surface) else parameter_names(on, "on", ["q", "t"])
        more |= {k: given[k] for k in names if k in given and k not in system.table.shapes}
    return system.with_parameters(more) if more else system


def with_surface(event: Event, system: System) -> Event:
    """Return the event with its surface traced.

    Raises ValueError as `Surface.trace`, and for the surface of another system.
    """
    on = event.on
    if not isinstance(on, Surface):
        return event._replace(on=Surface.trace(on, system))
    if on.shapes != system.table.shapes or on.law.numel_in(0) != system.n:
        raise ValueError(
            "expected the surface of an event of the same system, found one in the parameters "
            f"{', '.join(on.shapes) or 'none'} of {on.law.numel_in(0)} coordinates; give the "
            "callable again: Event(t, q, on=...)"
        )
    return event
