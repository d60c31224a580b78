"""The physics: a Lagrangian, its parameters, constraints and forces; nothing of endpoints.

Every quantity of Lagrangian mechanics is a short formula in L(q, v, t) and its derivatives
(`laws`); here the laws are traced from callables, and numbers are put in.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, Any, Literal

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from actionopt.mechanics.laws.evaluation import NumericLaws
from actionopt.mechanics.laws.identity import general_states, vanishes
from actionopt.mechanics.laws.laws import Once
from actionopt.mechanics.laws.lengths import check_length, square
from actionopt.mechanics.laws.switches import KINKS, minimum_parts
from actionopt.mechanics.laws.tracing import (
    MULTIPLIERS,
    SWITCHES,
    ParameterTable,
    Symbols,
    call,
    column,
    order_of,
    refuse_foreign,
    refuse_nan,
    scalar,
    suggestion,
    surface,
)
from actionopt.tools.cached import cached_property
from actionopt.tools.checks import entries
from actionopt.tools.shown import row_of
from actionopt.tools.types import Array

if TYPE_CHECKING:
    from actionopt.mechanics.laws.branches import Branches

# Sizes of a motion that an obstacle counts as far away at most, and inside of it; ad hoc. What a
# slope's square may be without being zero.
DISTANT, LEAST_SLOPE = 100.0, 1e-300


class System(NumericLaws):
    """A mechanical system given by its Lagrangian L(q, v, t).

    Parameters
    ----------
    lagrangian : callable
        `lagrangian(q, v, t, *, ...)` with q and v of shape (n,), written with arithmetic and
        numpy or CasADi functions; `x, y = q` unpacks. Parameters are named keyword-only. With
        four arguments, `lagrangian(q, v, a, t, *, ...)`, it contains accelerations a (n,), with
        five also their rates, the jerk j, with six those of these (`order`).
    coordinates : sequence of str
        Names of the n generalized coordinates.
    parameters : mapping of str to number or array, optional
        Default values. Arrays keep their shape.
    constraint : callable, optional
        `constraint(q, t, *, ...)`: one expression f or a sequence of m of them; holonomic,
        f(q, t) = 0.
    force : callable, optional
        `force(q, v, t, *, ...)`: the n generalized non-conservative forces Q.
    obstacle : callable, optional
        `obstacle(q, t, *, ...)`: one expression f or a sequence of r of them; f(q, t) >= 0 along
        the path, whose action is least among those that satisfy it. A minimum of r' expressions,
        such as 1 - abs(x) of two, is r' rows. Not with `force`.
    integral : callable, optional
        `integral(q, v, t, *, ...)`: one expression g or a sequence of c of them, whose integrals
        along the path a `Problem` may give. With `force` L + kappa.g takes
        the place of L in the Lagrange-d'Alembert principle.
    name : str, optional
        Shown in messages and files.

    Raises
    ------
    ValueError
        If a callable has the wrong signature, cannot be traced or returns the wrong shape, or
        a parameter is missing, unused or not finite, or has a name of our own, leg_times or
        integral_multipliers.

    Notes
    -----
    Functions are derived once and used again by every problem of a system, in any number of
    threads: the memory they work in is each thread's own, and goes with it. The numbers are those
    of one thread, to the last bit.

    A system can be pickled, whatever it was written as: its law travels as an expression, with all
    that is derived by then. Loaded in a process that has the same law already, it is that one.
    `source` says where the law was written, and `repr` does so of one that was loaded.

    References
    ----------
    *Competitive Physics: Mechanics and Waves* (2018), chapter 12: action (12.1), equations of
    motion (12.3), constraints (12.7)-(12.9).

    Examples
    --------
    >>> import numpy as np
    >>> def lagrangian(q, v, t, *, l, g):
    ...     return (l * v[0]) ** 2 / 2 + g * l * np.cos(q[0])
    >>> pendulum = System(lagrangian, ["theta"], parameters={"l": 1.0, "g": 9.81})
    >>> round(float(pendulum.energy([0.0], [1.0], 0.0)), 3)
    -9.31
    """

    def __init__(
        self,
        lagrangian: Callable[..., Any],
        coordinates: Sequence[str],
        *,
        parameters: Mapping[str, ArrayLike] | None = None,
        constraint: Callable[..., Any] | None = None,
        force: Callable[..., Any] | None = None,
        obstacle: Callable[..., Any] | None = None,
        integral: Callable[..., Any] | None = None,
        name: str = "",
    ) -> None:
        others = constraint, force, obstacle, integral
        self._trace("lagrangian", lagrangian, others, coordinates, parameters, name)

    @classmethod
    def geodesic(
        cls,
        length: Callable[..., Any],
        coordinates: Sequence[str],
        *,
        parameters: Mapping[str, ArrayLike] | None = None,
        constraint: Callable[..., Any] | None = None,
        obstacle: Callable[..., Any] | None = None,
        integral: Callable[..., Any] | None = None,
        name: str = "",
    ) -> System:
        """Return the system whose paths make the length between their events stationary.

        Parameters
        ----------
        length : callable
            `length(q, v, *, ...)`: F, homogeneous of degree one in v, F(q, s v) = s F(q, v) for
            s > 0, and not negative: the length of a metric, np.sqrt(v @ G @ v); n(q) |v| of light
            in a medium (Fermat's principle; in a static spacetime, of which light takes the
            null geodesics, that of the optical metric, the coordinate time); the travel time in a
            wind; any Finsler metric.
        coordinates, parameters, constraint, obstacle, integral, name
            As for the class.

        Returns
        -------
        System
            With L = F^2 / 2: its paths are those of the length, run through at a constant rate F,
            so that the time of the events, from 0 to 1 say, is arclength up to a factor.
            `solution.length` is the length. Where F^2 is strictly convex in v, index and conjugate
            points are those of the length.

        Raises
        ------
        ValueError
            As the class does, and where F is not homogeneous of degree one in v, or is positive
            nowhere.

        References
        ----------
        Milnor, *Morse Theory* (1963), section 12, for energy in place of length; Bao, Chern and
        Shen, *An Introduction to Riemann-Finsler Geometry* (2000), section 5.1.

        Examples
        --------
        >>> import numpy as np
        >>> flat = System.geodesic(lambda q, v: np.sqrt(v @ v), ["x", "y"])
        >>> float(flat.lagrangian([0.0, 0.0], [3.0, 4.0], 0.0))
        12.5
        """
        system = object.__new__(cls)
        others = constraint, None, obstacle, integral
        system._trace("length", length, others, coordinates, parameters, name)
        return system

    @classmethod
    def from_sympy(
        cls,
        L: Any,
        q: Any,
        v: Any = None,
        t: Any = None,
        *,
        parameters: Mapping[Any, ArrayLike] | None = None,
        constraint: Any = None,
        force: Any = None,
        obstacle: Any = None,
        integral: Any = None,
        name: str = "",
    ) -> System:
        """Return the system of a Lagrangian that is an expression of sympy.

        Parameters
        ----------
        L : sympy.Expr
        q : n symbols, or functions of the time such as those of `dynamicsymbols`
            The coordinates, in their order; they are called as these are.
        v : n symbols or derivatives, optional
            The velocities; without them the derivatives of functions q. Both may stand in L.
        t : sympy.Symbol, optional
            The time; without it that of functions q.
        parameters : mapping of str or symbol to number, optional
            Default values. All other symbols are parameters, too: of those that have no value here,
            a `Problem` gives one.
        constraint, force, obstacle, integral : expression or sequence of them, optional
            As for the class.
        name : str, optional

        Raises
        ------
        ValueError
            As the class does, and for what is no expression of these, such as second derivatives.
        ImportError
            If sympy is not installed.

        Examples
        --------
        A doctest of it is in the guide, as sympy is no dependency: `System.from_sympy(m * v**2 / 2
        - m * g * x, x, v, t, parameters={m: 1.0, g: 9.81})`.
        """
        from actionopt.mechanics.laws.symbolic import Reading

        reading = Reading.of(q, v, t)
        others = {"constraint": constraint, "force": force, "obstacle": obstacle}
        others = {role: x for role, x in {**others, "integral": integral}.items() if x is not None}
        values = reading.values({"lagrangian": L, **others}, parameters)
        laws = {role: reading.law(x, role) for role, x in others.items()}
        L = reading.law(L, "lagrangian")
        return cls(L, reading.names, parameters=values, name=name, **laws)

    def to_sympy(self) -> Any:
        """Return the laws as expressions of sympy, which unpack as (L, q, v, t).

        The attributes of what is returned are `lagrangian`, `q`, `v`, `t`, `parameters` by name,
        `constraint`, `force` and `multipliers`; `equations`, the n equations of motion and the
        constraints, `sympy.Eq`; and `latex()`. Coordinates are functions of `t`.

        Raises
        ------
        ValueError
            Where an operation has no counterpart in sympy, such as a table that is interpolated.
        ImportError
            If sympy is not installed.
        """
        from actionopt.mechanics.laws.symbolic import formulas

        return formulas(self, self.table)

    def dynamics_function(self) -> ca.Function:
        """Return the equations of motion as a CasADi function.

        `f(q, v, t, ...)` takes q and v (n,), t and a parameter each, by order or by name, the
        default of one number being that of the system; it returns the accelerations `a` (n,) and
        the multipliers `lam` (m,) of L + lam.f, as `acceleration` and `multipliers` do. CasADi
        differentiates it, maps it and writes it as C.

        Examples
        --------
        >>> fall = System(lambda q, v, t: v[0] ** 2 / 2 - 2 * q[0], ["x"])
        >>> fall.dynamics_function()(q=0.0, v=1.0, t=0.0)["a"]
        DM(-2)
        """
        from actionopt.mechanics.laws.functions import dynamics_function

        return dynamics_function(self, self.table)

    def _trace(
        self,
        role: Literal["lagrangian", "length"],
        law: Callable[..., Any],
        others: tuple[Callable[..., Any] | None, ...],
        coordinates: Sequence[str],
        parameters: Mapping[str, ArrayLike] | None,
        name: str,
    ) -> None:
        """Call what the user wrote, with symbols. Raises ValueError as the class does."""
        constraint, force, obstacle, integral = others
        if not isinstance(name, str):
            raise ValueError(f"expected the name of a system as text, found {name!r}")
        names_of, table = _names(coordinates), ParameterTable(parameters)
        for own, what in (
            (MULTIPLIERS, "the multipliers of integrals"),
            (SWITCHES, "the times at which laws of legs take turns"),
        ):
            if own in table.shapes:
                raise ValueError(
                    f"expected parameters of other names than {own!r}, found it: a problem puts "
                    f"{what} there; choose another name"
                )
        order = order_of(law) if role == "lagrangian" else 1
        n, symbols = len(names_of), Symbols.of(len(names_of), table, order)
        state, named = symbols.state(), table.by_name(symbols.p)
        Q, V, T = state["q"], state["v"], state["t"]
        given, used = call(law, role, {"q": Q, "v": V} if role == "length" else state, named)
        L = scalar(given, role)
        if order > 1:
            _check_parts(order, obstacle, (constraint, force))
        constraints = forces = ca.SX(0, 1)
        if constraint is not None:
            given, names = call(constraint, "constraint", {"q": Q, "t": T}, named)
            constraints, used = surface(given, "constraint"), used | names
        if force is not None:
            given, names = call(force, "force", {"q": Q, "v": V, "t": T}, named)
            forces, used = column(given, "force", n), used | names
        outside = ca.SX(0, 1)
        if obstacle is not None:
            if force is not None:
                raise ValueError(
                    "expected an obstacle or non-conservative forces, found both: along an "
                    "obstacle the action is minimised, and with such forces no functional is"
                )
            given, names = call(obstacle, "obstacle", {"q": Q, "t": T}, named)
            outside, used = surface(given, "obstacle"), used | names
            rows = ca.vertsplit(outside)
            outside = ca.vertcat(*(x for row in rows for x in minimum_parts(row, symbols)))
        integrands = ca.SX(0, 1)
        if integral is not None:
            taken = {"q": Q, "v": V, "t": T} if order_of(integral) < order else state
            given, names = call(integral, "integral", taken, named)
            integrands, used = column(given, "integral"), used | names
        unused = [key for key in table.defaults if key not in used]
        if unused:
            raise ValueError(
                f"parameter {unused[0]!r} is used by none of the callables, which name "
                f"{', '.join(sorted(used)) or 'no parameters'}{suggestion(unused[0], sorted(used))}"
            )
        F = (L,) if role == "length" else ()
        laws = square(L) / 2 if F else L, constraints, forces, outside, integrands, *F
        self._set(symbols, laws, names_of, table, name, _place(law))
        if any([law.numel() for law in laws[1:5]]):
            refuse_foreign(ca.vertcat(*laws[1:5]), self._arguments, "laws beside the Lagrangian")
        try:
            refuse_nan(self.lagrangian_tape.constants, role)
        except RuntimeError:  # CasADi's own, of a symbol that is no argument
            refuse_foreign(L, self._arguments, role)
            raise
        if F:
            check_length(self)

    @classmethod
    def of_laws(cls, symbols: Symbols, laws: Sequence[ca.SX], *known: Any) -> System:
        """Return the system of laws that are traced, as `_set` takes them."""
        system = object.__new__(cls)
        system._set(symbols, laws, *known)
        return system

    def _set(
        self,
        symbols: Symbols,
        laws: Sequence[ca.SX],
        coordinates: tuple[str, ...],
        table: ParameterTable,
        name: str,
        source: str,
        loaded: bool = False,
    ) -> None:
        """Set what is known of a law that is traced; `laws` are L, f, Q, the obstacle, g and F."""
        L, f, Q, *more = laws
        self.outside = more[0] if more else ca.SX(0, 1)
        self.r = self.outside.numel()  # rows of the obstacle
        self.g = more[1] if len(more) > 1 else ca.SX(0, 1)  # what a problem may give integrals of
        super().__init__(symbols, L, f, Q, coordinates)
        self.F = more[2] if len(more) > 2 else None
        self.table, self.name, self.source, self.loaded = table, name, source, loaded
        self.layouts: dict[Any, Any] = {}  # of its discrete problems; they live as long as it does

    def __repr__(self) -> str:
        """Show the name and the coordinates, and where the law of a loaded one came from."""
        found = f"{self.name or 'unnamed'}: {row_of(self.coordinates, self.n)}"
        return f"System({found}{f'; loaded, its law {self.source}' if self.loaded else ''})"

    def _repr_html_(self) -> str:
        """Show the Lagrangian and the equations of motion that follow from it, as a notebook does.

        The `repr` where they are too long to be read, or hold no formula.
        """
        from html import escape

        from actionopt.mechanics.laws.written import equations, lagrangian
        from actionopt.tools.formula import formula
        from actionopt.tools.mathml import mathml

        try:
            said = [lagrangian(self, self.table), *equations(self, self.table)]
            scalars = {*self.coordinates, *self.table.defaults}
            rows = [mathml(formula(text), scalars) for text in said]
        except ValueError:
            return f"<code>{escape(repr(self))}</code>"
        return f"<p>{escape(self.name or 'System')}</p>{''.join(rows)}"

    def __copy__(self) -> System:
        """Return the system itself, which never changes."""
        return self

    def __deepcopy__(self, memo: dict[int, Any]) -> System:
        """Return the system itself, which never changes."""
        return self

    def __reduce__(self) -> tuple:
        """Carry the law as an expression, and what is derived; no code of the user's."""
        from actionopt.mechanics.laws.pickling import reduce

        return reduce(self)

    @property
    def _law(self) -> ca.Function:
        """The law as a function of (q, v, t, p), which can be written to a file."""
        laws = [self.L, self.f, self.Q]
        more = [self.outside, self.g, ca.SX(0, 1) if self.F is None else self.F]
        while more and not more[-1].numel():
            more.pop()
        return ca.Function("law", self._arguments, [*laws, *more])

    @Once
    def with_contact(self) -> System:
        """Return the system whose constraints are these and the rows of the obstacle behind them.

        A path along the obstacle is a motion of it, for as long as it is in contact. Without an
        obstacle it is the system itself.
        """
        return self._holding(self.outside) if self.r else self

    def with_obstacle_rows(self, rows: tuple[int, ...]) -> System:
        """Return the system with some rows of its obstacle alone."""

        def build() -> System:
            laws = self.L, self.f, self.Q, ca.vertcat(*(self.outside[i] for i in rows)), self.g
            return self._with_laws(laws)

        return self.memoize(f"with rows {rows}", build) if rows else self.without_obstacle

    @Once
    def without_obstacle(self) -> System:
        """Return the system without its obstacle."""
        return self._holding(ca.SX(0, 1))

    def obstacle(self, q: ArrayLike, t: ArrayLike, *, parameters=None) -> Array:
        """Return f(q, t) of the obstacle, shape (r, K) or (r,): not negative outside of it."""
        return self.with_contact.constraint(q, t, parameters=parameters)[self.m :]

    def with_contact_distance(self, sizes: tuple[float, ...]) -> System:
        """Return the system with rows of the obstacle that grow as the distance from it does.

        They are f / sqrt(f_q^2 - 2 min(f, 0) f_nn), f_nn being the second derivative along the
        slope, coordinates in units of `sizes`: the distance to first order, outside and inside.
        So a disc is found by q @ q - R**2 as it is by np.sqrt(q @ q) - R. Planes stay as they are.
        """

        def build() -> System:
            q, units = self.symbols.q, ca.DM(sizes)
            rows = []
            for f in ca.vertsplit(self.outside):
                slope = ca.gradient(f, q) * units
                steep = ca.sumsqr(slope)
                bent = ca.dot(slope, ca.jtimes(slope, q, slope * units)) / (steep + LEAST_SLOPE)
                inside = ca.fmax(-2 * f * bent, 0)
                level = ca.sqrt(steep + inside + (f / DISTANT) ** 2)  # never zero
                rows.append(f / level if ca.depends_on(slope, q) else f)
            return self._holding(ca.vertcat(*rows))

        return self.memoize(f"sought in {sizes}", build)

    def _holding(self, outside: ca.SX) -> System:
        """Return the system whose constraints are these and the rows of an obstacle."""
        return self._with_laws((self.L, ca.vertcat(self.f, outside), self.Q, ca.SX(0, 1), self.g))

    def _with_laws(self, laws: tuple[ca.SX, ...]) -> System:
        """Return the system with other laws beside this L, whose derivatives are kept."""
        known = self.coordinates, self.table, self.name, self.source
        system = System.of_laws(self.symbols, laws, *known)
        system._pointwise.update({name: self.pointwise(name) for name in ("first", "second")})
        return system

    @Once
    def branches(self) -> Branches | None:
        """Return where L has kinks in q, as far as these can be told; None where there are none."""
        from actionopt.mechanics.laws.branches import branches

        return None if KINKS.isdisjoint(self.structure.operations) else branches(self)

    def with_parameters(self, more: Mapping[str, ArrayLike]) -> System:
        """Return the system with further parameters, which its laws do not contain.

        It is the same one for the same names and shapes, and the default values those of the first.
        Raises ValueError if one is not finite.
        """
        table = ParameterTable({**self.table.defaults, **more})

        def build() -> System:
            symbols = Symbols.of(self.n, table, self.order)
            packed = symbols.p[: self.symbols.p.numel()]  # they come behind
            laws = self._law.call([symbols.q, symbols.v, symbols.t, packed])
            known = self.coordinates, table, self.name, self.source
            return System.of_laws(symbols, laws, *known, self.loaded)

        return self.memoize(f"with {table.shapes}", build)

    @Once
    def with_multipliers(self) -> System:
        """Return the system of L + kappa.g, whose last parameter is kappa (c,), zero by default.

        Without an integral it is the system itself.
        """
        if not self.g.numel():
            return self
        table = ParameterTable({**self.table.defaults, MULTIPLIERS: np.zeros(self.g.numel())})
        symbols = Symbols.of(self.n, table, self.order)
        packed = symbols.p[: self.symbols.p.numel()]
        L, f, Q, outside, g = self._law.call([symbols.q, symbols.v, symbols.t, packed])[:5]
        kappa = symbols.p[self.symbols.p.numel() :]
        laws = L + ca.dot(kappa, g), f, Q, outside, g
        known = self.coordinates, table, self.name, self.source
        return System.of_laws(symbols, laws, *known, self.loaded)

    def laws_of(self, q: ca.SX, v: ca.SX, t: ca.SX, packed: ca.SX) -> tuple[ca.SX, ...]:
        """Return L, f, Q, obstacle and g of expressions, the parameters packed in one column."""
        found = [ca.densify(x) for x in self._law.call([q, v, t, packed])[:5]]
        return *found, *[ca.SX(0, 1)] * (5 - len(found))

    @classmethod
    def assemble(
        cls,
        systems: Sequence[System],
        law: Callable[..., tuple[ca.SX, ...]],
        parameters: Mapping[str, ArrayLike],
    ) -> System:
        """Return a system of the same coordinates whose laws are law(symbols, named, last).

        `named` holds the parameters' columns by name but for that of the last one, `last`.
        """
        first, table = systems[0], ParameterTable(parameters)

        def build() -> System:
            symbols = Symbols.of(first.n, table, first.order)
            sizes = np.cumsum([0, *(math.prod(shape) for shape in table.shapes.values())])
            columns = [symbols.p[a:b] for a, b in pairwise(sizes.tolist())]
            named = dict(zip(table.shapes, columns, strict=True))
            laws = law(symbols, named, columns[-1])
            return System.of_laws(symbols, laws, first.coordinates, table, first.name, first.source)

        key = tuple(id(system) for system in systems)
        return first.memoize(f"in turn {key}", lambda: (build(), systems))[0]

    @Once
    def digest(self) -> str:
        """Return 64 hexadecimal digits, the same in every process for the same law.

        That is the expressions, the names and the parameters' default values.
        """
        import hashlib

        defaults = {name: (x.shape, x.tobytes()) for name, x in self.table.defaults.items()}
        said = (self.coordinates, self.name, defaults, self._law.serialize())
        return hashlib.sha256(repr(said).encode()).hexdigest()

    def check_free(self, what: str) -> None:
        """Raise ValueError if there is an obstacle, saying `what` does not know it."""
        if self.r:
            raise ValueError(
                f"expected a system without an obstacle, found one that has one: {what}; leave it "
                "out where nothing touches it, or have a constraint instead where something does"
            )

    # -- what is known without numbers ---------------------------------------------------

    @cached_property
    def energy_is_mechanical(self) -> bool:
        """Whether H = T + V with V = -L at rest: T = L + V is homogeneous of degree 2 in v.

        Euler's theorem, in the form v . d2T/dv2 = dT/dv; checked symbolically (section 12.5).
        What moving coordinates leave of T at rest cannot be told from a potential in L alone:
        `symmetry.is_mechanical` takes T itself.
        """
        s, d = self.symbols, self.derivatives
        if self.order > 1:
            return False
        M = d.Lvv + ca.triu(d.Lvv, False).T
        euler = ca.horzcat(*[M[:, i] * s.v[i] for i in range(self.n)], -d.Lv)
        packed = self.table.pack(self.parameters)
        return vanishes(euler, self._arguments, [*general_states(self.n), packed])


def _check_parts(order: int, obstacle: Any, others: Sequence[Any]) -> None:
    """Raise ValueError for an obstacle that a Lagrangian with accelerations cannot have.

    `order` is that of the highest derivative in the Lagrangian, and `others` are the constraint and
    the force of the system, None where there are none.
    """
    if obstacle is None:
        return
    if order > 2:
        raise ValueError(
            "expected no obstacle beside a Lagrangian with derivatives above accelerations, found "
            "one: along it contact comes and goes in infinitely many moments; give the places and "
            "velocities where a path touches it as events whose times are found, "
            "through=[ao.Event(None, q, v=v)]"
        )
    if any(part is not None for part in others):
        raise ValueError(
            "expected an obstacle alone beside a Lagrangian with accelerations, found a constraint "
            "or a force as well: what they do where the obstacle is touched is not known; use "
            "coordinates that need no constraint"
        )


def _place(law: Callable[..., Any]) -> str:
    """Return where a callable is written: "from pendulum.py, line 3 (lagrangian)"."""
    code = getattr(law, "__code__", None)
    if code is None:  # a partial, or an object that is called
        return f"from an object of the type {type(law).__qualname__}"
    return f"from {code.co_filename}, line {code.co_firstlineno} ({law.__qualname__})"


def _names(coordinates: Sequence[str]) -> tuple[str, ...]:
    names = entries(coordinates)
    if names is None or not all(isinstance(name, str) and name.strip() for name in names):
        raise ValueError(
            f"expected a sequence of coordinate names, such as ['x', 'y'], found {coordinates!r}"
        )
    if not names or len(set(names)) != len(names):
        raise ValueError(f"expected at least one coordinate and distinct names, found {names}")
    return tuple(names)


def check_system(system: System) -> System:
    """Return the system. Raises ValueError for anything else."""
    if not isinstance(system, System):
        raise ValueError(
            f"expected a System(lagrangian, coordinates), found {system!r}; a problem has one, "
            "and a solution a problem"
        )
    return system
