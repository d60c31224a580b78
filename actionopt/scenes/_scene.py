"""What a scene is, what can be known exactly about one, and how its file says both.

A scene's file has a docstring with a sketch, `TITLE` and `SOURCE` (one line each: what it is, and
the section, page or equation it is taken from), `WORDS` for its page, `lagrangian` or, of a
geodesic, `length`, `constraint`, `force`, `obstacle` and `integral` if it has them, `on` where
the end lies on a surface, and `scene`. The signature of `scene` has the names and defaults of all
parameters, those of the system among them; called with numbers, it returns a `Setup`.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import KW_ONLY, field, fields
from functools import cache, cached_property, wraps
from types import ModuleType
from typing import Any

import numpy as np

from actionopt.mechanics.question.events import RATES, Event, State
from actionopt.mechanics.question.problem import Problem
from actionopt.mechanics.system import System
from actionopt.scenes._shapes import Shape
from actionopt.tools.immutable import immutable
from actionopt.tools.shown import one_line
from actionopt.tools.types import Array

PANELS, GAUSS_POINTS = 64, 20  # Gauss-Legendre rule for `Scene.action`: exact to rounding here

Curve = Callable[[Any], Array]  # of t: (n, K) for K times, (n,) for one time
Along = Callable[[Array, Array, Any], Array]  # of q, v (n, K) and t


@immutable
class Facts(Mapping[str, Any]):
    """What is known exactly about a scene, from its source; None is what is not known.

    A mapping as well, of what is known by name: `facts["period"]` is one of the `numbers`.
    K times, n coordinates, m constraint rows.

    Parameters
    ----------
    velocity : callable, optional
        Of t: the velocity along `exact`, (n, K) or (n,).
    acceleration, multipliers : callable, optional
        Of (q, v, t): the equations of motion as the book has them, (n, K), and lambda, (m, K).
    action, energy : float, optional
        S between the events, along `exact` or the motion from `start`, and the energy function H.
    conjugate_times : row of times, optional
        The first ones conjugate to the start along `exact`, before the end or after it, each as
        often as its multiplicity.
    morse_index : int, optional
        Number of conjugate times before the end.
    conserved : mapping, optional
        From names to functions of (q, v, t) that are constant along every motion, (K,); `energy`
        among them is T + V, and equal to H.
    start : State, optional
        From which the motion through both events sets out.
    event_times, integral_multipliers : rows of numbers, optional
        When the events between the ends are passed, (k,), and kappa of given integrals, (c,).
    twin, gauge : str and callable, optional
        Name of a scene with the same path for the same parameters, and the F(q, t) with
        L = L(twin) + dF/dt, (K,).
    flat : callable, optional
        Of t: a variation (n, K) along which S does not change, where the end is conjugate.
    numbers : mapping
        Of this scene alone, explained in its file.
    """

    velocity: Curve | None = None
    acceleration: Along | None = None
    multipliers: Along | None = None
    action: float | None = None
    energy: float | None = None
    conjugate_times: Array | None = None
    morse_index: int | None = None
    conserved: Mapping[str, Along] | None = None
    start: State | None = None
    event_times: Sequence[float] | None = None
    integral_multipliers: Sequence[float] | None = None
    twin: str | None = None
    gauge: Callable[[Array, Any], Array] | None = None
    flat: Curve | None = None
    numbers: Mapping[str, float] = field(default_factory=dict)

    __repr__ = one_line

    @cached_property
    def _items(self) -> dict[str, Any]:
        named = {f.name: getattr(self, f.name) for f in fields(self) if f.name != "numbers"}
        return {name: x for name, x in named.items() if x is not None} | dict(self.numbers)

    def __getitem__(self, name: str) -> Any:
        return self._items[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._items)

    def __len__(self) -> int:
        return len(self._items)


@immutable
class Words:
    """What a page says of a scene in sentences, besides what it says of all.

    Parameters
    ----------
    question, answer : str
        To think about before the film, and what is found.
    look : str
        What to look at in it.
    captions : mapping
        From the names of figures ("motion", "path", "conserved", "energies", ...) to what is seen
        in this one.
    beside : row of str
        Names of scenes to compare with.
    """

    question: str = ""
    answer: str = ""
    look: str = ""
    captions: Mapping[str, str] = field(default_factory=dict)
    beside: tuple[str, ...] = ()


@immutable
class Measure:
    """What a scene measures whose Lagrangian is half a squared length: it is no mechanics.

    Along the path its integral is sqrt(2 S T), and in the `unit` of what it is called `factor`
    times that. `base` is the unit of the length itself.
    """

    name: str = "length"
    unit: str = "m"
    factor: float = 1.0
    base: str = "m"

    def of(self, action: float, duration: float) -> float:
        """Return it for the action of a path, in its unit."""
        return self.factor * float(np.sqrt(2 * action * duration))


@immutable
class Known:
    """A question, and what is known of its answer.

    Parameters
    ----------
    problem : Problem
        The question.
    exact : callable, optional
        The path in closed form: (n, K) for K times, (n,) for one time.
    guess : callable or array, optional
        A rough path, or rough places at all events, as `solve` takes it, where the straight line
        between the events leads elsewhere or nowhere.
    facts : Facts, optional
        What is known exactly.
    source : str
        The section, page or equation it is taken from, in one line.
    """

    problem: Problem
    exact: Curve | None = None
    guess: Any = None
    facts: Facts = field(default_factory=Facts)
    source: str = ""

    __repr__ = one_line

    @cached_property
    def action(self) -> float | None:
        """S along the path: from the facts if they have it, else by quadrature of `exact`.

        The quadrature is good to rounding. None if the path is not known either.
        """
        if "action" in self.facts:
            return float(self.facts["action"])
        if self.exact is None:
            return None
        problem = self.problem
        xi, w = np.polynomial.legendre.leggauss(GAUSS_POINTS)
        h = problem.duration / PANELS
        t = problem.start.t + h * (np.arange(PANELS)[:, None] + (xi + 1) / 2).ravel()
        L = problem.system.lagrangian(
            self.exact(t), self.facts["velocity"](t), t, parameters=problem.parameters
        )
        return float(h / 2 * np.tile(w, PANELS) @ L)


@immutable
class Scene(Known):
    """A named, documented example: what is `Known`, and how it is shown.

    Parameters
    ----------
    title : str
        What it is, in one line.
    draw : callable
        `draw(q, t)` for q of shape (n,): the shapes of the picture at one time, back to front.
    kinetic : callable, optional
        Of (q, v, t): the kinetic energy in a frame at rest, (K,).
    words : Words, optional
        For its page in the gallery.
    measure : Measure, optional
        Of one that is no mechanics.
    """

    _: KW_ONLY
    title: str
    draw: Callable[[Array, float], list[Shape]]
    kinetic: Along | None = None
    words: Words = field(default_factory=Words)
    measure: Measure | None = None

    @property
    def name(self) -> str:
        """The scene's name, which is its system's."""
        return self.problem.system.name

    def __repr__(self) -> str:
        """Show name and title."""
        return f"Scene({self.name}: {self.title})"


@immutable
class Setup:
    """What a scene's file returns for given numbers: a `Scene` but for its system and its words.

    The events are at the times 0 and `duration`, with the coordinates `ends`; those of `exact` if
    they are not given. With an `energy` (J) the end is to be reached with that, and `duration` (s)
    is what is known of how long it takes. `kinetic` is the part of L that the velocities make up,
    if it is not given, as it is where the coordinates do not move. `through` are the events between
    the ends, `media` the parameters that each leg has of its own, and `integral` the values of the
    file's integrals; then `exact` is given, and the facts have the times and the multipliers.
    `measure` is what a file with a `length` measures, if that is not a length. `rates` are the
    derivatives v, a, ... at the start and at the end, of a Lagrangian that contains higher ones.
    """

    coordinates: Sequence[str]
    duration: float
    draw: Callable[[Any, float], list[Shape]]
    exact: Curve | None = None
    ends: tuple[Any, Any] | None = None
    guess: Curve | Array | None = None
    kinetic: Along | None = None
    facts: Facts = field(default_factory=Facts)
    energy: float | None = None
    through: Sequence[Event] = ()
    media: Sequence[Mapping[str, float]] = ({},)
    integral: Sequence[float] | None = None
    measure: Measure | None = None
    rates: tuple[Sequence[Any], Sequence[Any]] = ((), ())


def build(file: ModuleType, numbers: Mapping[str, Any]) -> Scene:
    """Return the scene of a file for the values of all its parameters."""
    found: Setup = file.scene(**numbers)
    laws = [system(file, tuple(found.coordinates), tuple(own.items())) for own in found.media]
    times = (0.0, found.duration)
    ends = found.ends or [found.exact(t) for t in times]  # type: ignore[misc]
    start, end = (
        Event(t, q, **dict(zip(RATES, rates, strict=False)))
        for t, q, rates in zip(times, ends, found.rates, strict=True)
    )
    own = found.media[0]
    values = {name: numbers[name] for name in laws[0].parameters if name not in own}
    wanted = end if found.energy is None else end.at(None)
    if hasattr(file, "on"):  # it says where the end may lie
        wanted = Event(wanted.t, None, on=file.on)
        values |= {name: numbers[name] for name in parameters(file.on)}
    problem = Problem(
        laws if own else laws[0],  # type: ignore[arg-type]
        start,
        wanted,
        parameters=values,
        energy=found.energy,
        through=found.through,
        integral=found.integral,
    )
    if problem.is_joined:
        facts = found.facts
        assert found.exact is not None
        at = np.array([times[0], *(facts.event_times or ()), times[1]])
        kappa = facts.integral_multipliers
        problem = problem.found_at(
            at, found.exact(at).T, None if kappa is None else np.array(kappa)
        )
    elif wanted is not end:
        problem = problem.found_at(times, [start.q, end.q])

    law = problem.plain or problem.system
    given = {name: problem.parameters[name] for name in law.parameters}

    def kinetic(q: Array, v: Array, t: Any) -> Array:
        L, back, rest = (law.lagrangian(q, s * v, t, parameters=given) for s in (1, -1, 0))
        return (L + back) / 2 - rest

    return Scene(
        problem,
        found.exact,
        found.guess,
        found.facts,
        file.SOURCE,
        title=file.TITLE,
        draw=found.draw,
        kinetic=found.kinetic or (kinetic if law.order == 1 else None),
        words=file.WORDS,
        measure=found.measure or (Measure() if hasattr(file, "length") else None),
    )


@cache
def system(
    file: ModuleType, coordinates: tuple[str, ...], own: tuple[tuple[str, float], ...] = ()
) -> System:
    """Return the system of a scene's file, derived once for each set of coordinates.

    `own` are values of parameters of one leg's law.
    """
    roles = ("lagrangian", "constraint", "force", "obstacle", "integral")
    laws = {role: getattr(file, role) for role in roles if hasattr(file, role)}
    measure = getattr(file, "length", None)
    everything = [*laws.values(), *([measure] if measure else [])]
    named = {name for law in everything for name in inspect.signature(law).parameters}
    values = {name: x for name, x in parameters(file.scene).items() if name in named}
    values |= dict(own)
    name = file.__name__.rpartition(".")[2]
    if measure:
        return System.geodesic(measure, coordinates, parameters=values, name=name, **laws)
    return System(coordinates=coordinates, parameters=values, name=name, **laws)


def parameters(scene: Callable[..., Setup]) -> dict[str, Any]:
    """Return the names and defaults in the signature of a file's `scene`."""
    named = inspect.signature(scene).parameters.values()
    return {p.name: p.default for p in named if p.kind is p.KEYWORD_ONLY}


def like(file: ModuleType) -> Callable[[Callable[..., Setup]], Callable[..., Setup]]:
    """Give a scene the parameters of another file's, and the setup of that as first argument.

    Of the other's parameters the signature names those that are used, without a default.
    """

    def decorate(scene: Callable[..., Setup]) -> Callable[..., Setup]:
        theirs, ours = parameters(file.scene), parameters(scene)
        merged = theirs | ours | theirs  # its names first, and its defaults

        @wraps(scene)
        def with_twin(**numbers: Any) -> Setup:
            twin = file.scene(**{name: numbers[name] for name in theirs})
            return scene(twin, **{name: numbers[name] for name in ours})

        kind = inspect.Parameter.KEYWORD_ONLY
        named = [inspect.Parameter(name, kind, default=x) for name, x in merged.items()]
        with_twin.__signature__ = inspect.Signature(named)  # type: ignore[attr-defined]
        return with_twin

    return decorate


def curve(formula: Callable[[Array], Sequence[Any]]) -> Curve:
    """Make n formulas in t a curve: (n, K) for K times, (n,) for one time."""

    def evaluate(t: Any) -> Array:
        times = np.asarray(t, dtype=float)
        return np.stack([np.broadcast_to(x, times.shape) for x in formula(times)])

    return evaluate


def conjugates(w: float, duration: float, multiplicity: int = 1) -> dict[str, Any]:
    """Return the facts `conjugate_times`, the multiples of pi / w, and `morse_index`.

    Raises ValueError if the duration is such a multiple: then no path or infinitely many join
    the events.
    """
    if abs(np.sin(w * duration)) < 1e-12:
        raise ValueError(
            f"expected a duration that is no multiple of pi / {w}, found {duration}: there the "
            "end is conjugate to the start; choose a slightly different duration"
        )
    times = np.repeat(np.pi / w * np.arange(1, 4 + int(w * duration / np.pi)), multiplicity)
    return {"conjugate_times": times, "morse_index": int(np.sum(times < duration))}


def unit_sine(w: float, t: Any) -> Array:
    """Return sin(w t) / w, and t at w = 0: the s(t) with s'' = -w^2 s, s(0) = 0, s'(0) = 1."""
    return np.sin(w * t) / w if w else np.asarray(t, dtype=float)
