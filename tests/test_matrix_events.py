"""Every pair of an event between the ends with another kind of question: an answer, or a reason.

Answers are closed forms, written here with none of the package's own numbers.
"""

from itertools import combinations

import numpy as np
import pytest
import systems
from pairs import KNOWN, Pairs, ask, check
from test_matrix import FEATURES, beam, clamped, cubic, double_well, dragged, ring, round_disc

import actionopt as ao

EVENTS = ("waypoints", "bounces", "several systems")
TABLE = Pairs((*FEATURES, *EVENTS))
solves, refuses = TABLE.solves, TABLE.refuses
MESH = ao.Mesh([0, 0.25, 0.5, 1], 8)
INF = np.inf


def way(t, *q):
    return [ao.Event(t, list(q))]


def through(*points):
    """Return the curve straight between points (t, x)."""
    return lambda t: np.interp(t, *zip(*points, strict=True))


def bent(system=None, x=1.0, end=0.0, **more):
    """From 0 by way of x, half way, to `end`."""
    return ask(system or systems.particle(), [0], [end], through=way(0.5, x), **more)


TENT = through((0, 0), (0.5, 1), (1, 0))
FLOOR = ao.Bounce(lambda q, t: q[1])


def reflected(system=None, T=1.0, **more):
    """From (0, 1) to (2, 1), off the floor half way."""
    given = {"through": [FLOOR]} | more
    return ask(system or systems.particle("x y"), [0, 1], [2, 1], T, **given)


def vee(t):
    return np.abs(1 - 2 * t)


def double(t):
    return 2 * t


def heavy(m, names="x", **more):
    return ao.System(lambda q, v, t: m * (v @ v) / 2, names.split(), **more)


def slower(*masses, end=1.0, T=1.0, names="x", t=0.5, **more):
    """From 0 to `end`; from half of the time on the mass is another one, and p is the same."""
    n, laws = len(names.split()), [heavy(m, names) for m in masses or (1.0, 4.0)]
    return ask(laws, [0] * n, [end] * n, T, **{"through": way(t, *[None] * n)} | more)


SLOWED = through((0, 0), (0.5, 0.8), (1, 1))

# -- waypoints -------------------------------------------------------------------------------------


@solves("given times", "waypoints")
def _():
    check(bent(), TENT, action=2.0)


@solves("free time", "waypoints")
def _():
    """At the speed one, as long as it is."""
    ends = ao.Event(0, [0.0]), ao.Event(None, [0.0])
    turned = ao.Problem(systems.particle(), *ends, energy=0.5, through=way(None, 1.0))
    check(turned, through((0, 0), (1, 1), (2, 0)), T=2.0)


@solves("infinite time", "waypoints")
def _():
    """From -1 and back: tanh t on both sides of an impulse."""
    there = ao.Event(-INF, [-1.0]), ao.Event(INF, [-1.0])
    sol = ao.solve(ao.Problem(double_well(), *there, through=way(0, 0.5)))
    t = np.linspace(-4, 4, 21)
    assert sol(t)[0] == pytest.approx(np.tanh(np.arctanh(0.5) - np.abs(t)), abs=KNOWN)
    assert sol.impulses == pytest.approx(np.array([[-1.5]]), abs=1e-6)
    assert sol.action == pytest.approx(2 * (0.5 + 1 - (0.5**3 + 1) / 3), rel=KNOWN)


@solves("closed", "waypoints")
def _():
    stops = [ao.Event(0.25, [1.0]), ao.Event(0.75, [-1.0])]
    ends = ao.Event(0, [None]), ao.Periodic(1.0)
    zigzag = ao.Problem(systems.particle(), *ends, through=stops)
    check(zigzag, through((0, 0), (0.25, 1), (0.75, -1), (1, 0)), action=8.0)


@solves("surface", "waypoints")
def _():
    """To the line x = 1, the shortest way."""
    end = ao.Event(1, None, on=lambda q, t: q[0] - 1)
    start = ao.Event(0, [0.0, 0.0])
    problem = ao.Problem(systems.particle("x y"), start, end, through=way(0.5, 0.5, 1.0))
    check(problem, lambda t: t, lambda t: np.minimum(2 * t, 1))


@solves("obstacle", "waypoints")
def _():
    """Round a disc and by a nail behind it."""
    system = systems.particle("x y", obstacle=lambda q, t: q @ q - 1)
    nail = way(None, 2.0, 0.5)
    sol = ao.solve(ask(system, [-2, 0.3], [2.0, -0.5], through=nail))
    assert np.sqrt(2 * sol.action) == pytest.approx(round_disc(0.3, 0.5) + 1.0, rel=KNOWN)


@solves("constraint", "waypoints")
def _():
    """Angles grow evenly on each leg."""
    a = np.pi / 3
    angle = through((0, 0), (0.5, a), (1, np.pi / 2))
    known = [lambda t, f=f: f(angle(t)) for f in (np.cos, np.sin)]
    check(ask(ring(), [1, 0], [0, 1], through=way(0.5, np.cos(a), np.sin(a))), *known)


@solves("clock", "waypoints")
def _():
    """x'' = t: a cubic on each leg."""
    law = ao.System(lambda q, v, t: v @ v / 2 + q[0] * t, ["x"])

    def known(t):
        bend = lambda t: t**3 / 6  # noqa: E731
        return TENT(t) + bend(t) - through((0, 0), (0.5, bend(0.5)), (1, bend(1)))(t)

    check(bent(law), known)


@solves("force", "waypoints")
def _():
    """Dragged: a + b exp(-t) on each leg."""

    def known(t):
        u = lambda t: 1 - np.exp(-t)  # noqa: E731
        return through((0, 0), (u(0.5), 1), (u(1), 0))(u(t))

    check(bent(dragged()), known)


@solves("mesh", "waypoints")
def _():
    assert check(bent(), TENT, mesh=MESH).mesh.elements == MESH.elements


@solves("ipopt", "waypoints")
def _():
    check(bent(), TENT, method="ipopt")


@solves("integral", "waypoints")
def _():
    """Parabolas of one curvature beside the tent, whose area is 1/2."""
    law = systems.particle(integral=lambda q, v, t: q[0])
    bend = lambda t: 8 * (t % 0.5) * (0.5 - t % 0.5)  # noqa: E731, area 1/3 in all
    check(bent(law, integral=0.5 + 1 / 3), lambda t: TENT(t) + 2 * bend(t) / 2)


@solves("accelerations", "waypoints")
def _():
    """There and back, each leg from rest to rest by symmetry."""
    known = lambda t: cubic(np.minimum(2 * t, 2 - 2 * t))  # noqa: E731
    check(clamped(beam(), [0], [0], through=way(0.5, 1.0)), known, action=96.0)


# -- bounces ---------------------------------------------------------------------------------------


@solves("given times", "bounces")
def _():
    check(reflected(), double, vee, action=4.0)


@solves("free time", "bounces")
def _():
    T = np.sqrt(8)
    check(reflected(T=None, energy=0.5), lambda t: 2 * t / T, lambda t: vee(t / T), T=T)


@refuses(
    "infinite time",
    "bounces",
    says="events between the ends at given times and places",
    because="what comes from rest may be reflected at any time",
)
def _():
    ends = ao.Event(-INF, [-1.0]), ao.Event(INF, [-1.0])
    ao.Problem(double_well(), *ends, through=[ao.Bounce(lambda q, t: 0.5 - q[0])])


@solves("closed", "bounces")
def _():
    """Up and down the short axis of an ellipse."""
    wall = ao.Bounce(lambda q, t: 1 - (q[0] / 2) ** 2 - q[1] ** 2)
    ends = ao.Event(0, [None, 0.0]), ao.Periodic(1.0)
    sol = ao.solve(ao.Problem(systems.particle("x y"), *ends, through=[wall] * 2))
    t = np.linspace(0, 1, 41)
    assert sol(t)[0] == pytest.approx(0, abs=KNOWN)
    assert np.abs(sol(t)[1]) == pytest.approx(np.abs(1 - np.abs(1 - 4 * t % 2)), abs=KNOWN)


@solves("surface", "bounces")
def _():
    """Down and up again, to the line it meets at right angles."""
    end = ao.Event(1, None, on=lambda q, t: q[1] - 1)
    start = ao.Event(0, [0.5, 1.0])
    check(
        ao.Problem(systems.particle("x y"), start, end, through=[FLOOR]),
        *(lambda t: 0 * t + 0.5, vee),
        action=2.0,
    )


@refuses(
    "obstacle",
    "bounces",
    says="a path that is reflected could be shortened",
    because="what an obstacle holds is a least path",
)
def _():
    reflected(systems.particle("x y", obstacle=lambda q, t: q @ q - 0.01))


@solves("constraint", "bounces")
def _():
    """On a plane in space."""
    plane = systems.particle("x y z", constraint=lambda q, t: q[2] - q[0])
    wall = ao.Bounce(lambda q, t: q[1])
    check(ask(plane, [0, 1, 0], [2, 1, 2], through=[wall]), double, vee, double)


@solves("clock", "bounces")
def _():
    """Off a wall at 1 + t, the speed of which is the mean of those before and after."""
    wall = ao.Bounce(lambda q, t: 1 + t - q[0])
    known = through((0, 0), (1 / 3, 4 / 3), (1, 0))  # 4 and -2
    check(ask(systems.particle(), [0], [0], through=[wall]), known)


@refuses(
    "force",
    "bounces",
    says="a time or a place is found where the action is stationary in it",
    because="no action is stationary in the time",
)
def _():
    reflected(dragged("x y"))


@refuses(
    "mesh",
    "bounces",
    says="expected neither a mesh",
    because="none: where elements end is found with the path",
)
def _():
    ao.solve(reflected(), mesh=MESH)


@refuses(
    "ipopt",
    "bounces",
    says="expected neither a mesh",
    because="none: Ipopt is told of given events",
)
def _():
    ao.solve(reflected(), method="ipopt")


@solves("integral", "bounces")
def _():
    """Parabolas that meet the floor half way: the mean height is that asked for."""
    law = systems.particle("x y", integral=lambda q, v, t: q[1])
    known = lambda t: vee(t) + 0.6 * (1 - vee(t)) * vee(t)  # noqa: E731, mean 1/2 + 0.6 / 6
    check(reflected(law, integral=0.6), double, known)


@refuses(
    "accelerations",
    "bounces",
    says="velocities are continuous",
    because="a velocity that jumps has infinite acceleration",
)
def _():
    clamped(beam("x y"), [0, 1], [2, 1], through=[FLOOR])


# -- several systems -------------------------------------------------------------------------------


@solves("given times", "several systems")
def _():
    check(slower(), SLOWED)


@solves("free time", "several systems")
def _():
    """At the energy 1/2 one half takes 1/2, the other one as long as the mass 4 is slower."""
    place = way(None, 0.5)
    problem = slower(T=None, energy=0.5, through=place)
    check(problem, through((0, 0), (0.5, 0.5), (1.5, 1)), T=1.5)


@refuses(
    "infinite time",
    "several systems",
    says="expected one system where an end lies at infinite time",
    because="where a path rests is told by one law",
)
def _():
    ends = ao.Event(-INF, [-1.0]), ao.Event(INF, [1.0])
    ao.Problem([double_well(), heavy(1.0)], *ends, through=way(0, None))


@solves("closed", "several systems")
def _():
    """Once round an axis, with another moment of inertia on the second half."""
    laws = [heavy(m) for m in (1.0, 4.0)]
    ends = ao.Event(0, [0.0]), ao.Periodic(1.0, advance=[1.0])
    check(ao.Problem(laws, *ends, through=way(0.5, None)), SLOWED)


@solves("surface", "several systems")
def _():
    """Straight down through an interface, to a line it meets at right angles."""
    interface = ao.Event(None, None, on=lambda q, t: q[1])
    end = ao.Event(1, None, on=lambda q, t: q[1] + 1)
    laws = [heavy(m, "x y") for m in (1.0, 4.0)]
    problem = ao.Problem(laws, ao.Event(0, [0.5, 1.0]), end, through=[interface])
    check(problem, lambda t: 0 * t + 0.5, through((0, 1), (1 / 3, 0), (1, -1)))


@solves("obstacle", "several systems")
def _():
    """The shortest way round a disc; half of the time it is four times as slow."""
    disc = {"obstacle": lambda q, t: q @ q - 1}
    laws = [heavy(m, "x y", **disc) for m in (1.0, 4.0)]
    sol = ao.solve(ask(laws, [-2, 0.3], [2, 0], through=way(0.5, None, None)))
    assert sol.action == pytest.approx(round_disc() ** 2 / (1 + 1 / 4), rel=KNOWN)


@solves("constraint", "several systems")
def _():
    """Round a circle: the angle is that on a line."""
    laws = [heavy(m, "x y", constraint=lambda q, t: q @ q - 1) for m in (1.0, 4.0)]
    known = [lambda t, f=f: f(SLOWED(t)) for f in (np.cos, np.sin)]
    end = [np.cos(1), np.sin(1)]
    check(ask(laws, [1, 0], end, through=way(0.5, None, None)), *known)


@solves("clock", "several systems")
def _():
    """m x'' = t on each leg."""
    laws = [ao.System(lambda q, v, t, m=m: m * (v @ v) / 2 + q[0] * t, ["x"]) for m in (1.0, 4.0)]

    def known(t):
        p = (1 - 1 / 48 - (1 / 6 - 1 / 48) / 4) / (0.5 + 0.5 / 4)  # of x' = (p + t^2 / 2) / m
        first = p * np.minimum(t, 0.5) + np.minimum(t, 0.5) ** 3 / 6
        late = np.maximum(t, 0.5)
        return first + (p * (late - 0.5) + (late**3 - 0.125) / 6) / 4

    check(ask(laws, [0], [1], through=way(0.5, None)), known)


@solves("force", "several systems")
def _():
    """Dragged on its second half alone."""
    drag = lambda q, v, t: -v  # noqa: E731
    laws = [systems.particle(), systems.particle(force=drag)]

    def known(t):
        v = 1 / (0.5 + 1 - np.exp(-0.5))
        return v * (np.minimum(t, 0.5) + 1 - np.exp(-np.maximum(t - 0.5, 0)))

    check(ask(laws, [0], [1], through=way(0.5, None)), known)


@solves("mesh", "several systems")
def _():
    assert check(slower(), SLOWED, mesh=MESH).mesh.elements == MESH.elements


@solves("ipopt", "several systems")
def _():
    check(slower(), SLOWED, method="ipopt")


@solves("integral", "several systems")
def _():
    """The area counts on the second half alone: a parabola there."""
    laws = [
        systems.particle(integral=lambda q, v, t: 0 * q[0]),
        systems.particle(integral=lambda q, v, t: q[0]),
    ]
    # x'' = k for t > 1/2, x(0) = x(1) = 0: x = -k t / 8 before, then + k (t - 1/2)^2 / 2.
    area = 3 / 64 - 1 / 48
    known = lambda t: (t / 8 - np.maximum(t - 0.5, 0) ** 2 / 2) / area  # noqa: E731
    check(ask(laws, [0], [0], through=way(0.5, None), integral=1.0), known)


@solves("accelerations", "several systems")
def _():
    """One half eight times as stiff: a moment that grows evenly bends it so much less."""
    laws = [ao.System(lambda q, v, a, t, m=m: m * (a @ a) / 2, ["x"]) for m in (1.0, 8.0)]
    sol = ao.solve(clamped(laws, [0], [1], through=way(0.5, None)))
    # m x'' = a + b t: int x'' = 0 and int (1 - t) x'' = 1.
    t0, t1 = 0.5 + 0.5 / 8, 1 / 8 + 3 / 64
    t2 = 1 / 24 + 7 / 192
    a, b = np.linalg.solve([[t0, t1], [t0 - t1, t1 - t2]], [0, 1])
    assert sol.momenta[0] == pytest.approx([-b, a], rel=1e-6)
    assert sol.action == pytest.approx(-b / 2, rel=KNOWN)


# -- of one another --------------------------------------------------------------------------------


@solves("waypoints", "bounces")
def _():
    """By way of a place on its straight way to the floor."""
    check(reflected(through=[ao.Event(0.25, [0.5, 0.5]), FLOOR]), double, vee)


@solves("waypoints", "several systems")
def _():
    laws = [heavy(m) for m in (1.0, 4.0)]
    check(ask(laws, [0], [0], through=way(0.5, 1.0)), TENT, action=1 + 4)


@solves("bounces", "several systems")
def _():
    """Heavier after the floor: the momentum along it is kept, and the energy."""
    laws = [heavy(1.0, "x y"), heavy(1.0, "x y"), heavy(4.0, "x y")]
    line = ao.Event(None, None, on=lambda q, t: 1 - q[1])
    problem = ask(laws, [0, 1], [0, 3], through=[FLOOR, line])
    check(problem, lambda t: 0 * t, through((0, 1), (1 / 6, 0), (1 / 3, 1), (1, 3)))


# -- ways to solve ---------------------------------------------------------------------------------


def action(sol):
    return sol.action


# Of a kind: a question, what varies from a first value to a last one, and the action at both.
CHANGES = {
    "waypoints": (bent, ("through", 0, "x"), (1.0, 2.0), (2.0, 8.0)),
    "bounces": (reflected, ("end", "x"), (2.0, 4.0), (4.0, 10.0)),
    "several systems": (slower, ("end", "x"), (1.0, 2.0), (0.8, 3.2)),
}
for kind, change in CHANGES.items():

    @solves(kind, "trace")
    def _(change=change):
        question, name, (_, last), (_, known) = change
        found = ao.trace(question(), name, last)
        assert found.actions[-1] == pytest.approx(known, rel=KNOWN)

    @solves(kind, "sweep")
    def _(change=change):
        question, name, values, known = change
        assert ao.sweep(question(), {name: list(values)}).action == pytest.approx(known, rel=KNOWN)


def test_every_pair_with_an_event_is_in_the_table():
    pairs = {TABLE(*names) for names in combinations(TABLE.features, 2) if {*names} & {*EVENTS}}
    assert {*TABLE.solved, *TABLE.refused} == pairs


@pytest.mark.quick(
    "given times x waypoints",
    "infinite time x waypoints",
    "closed x waypoints",
    "constraint x waypoints",
    "given times x bounces",
    "free time x bounces",
    "clock x bounces",
    "constraint x bounces",
    "force x several systems",
    "constraint x several systems",
    "integral x several systems",
    "accelerations x several systems",
    "bounces x several systems",
    "sweep x bounces",
)
@pytest.mark.parametrize("entry", TABLE.solved, ids=TABLE.named)
def test_a_pair_with_an_event_has_its_known_answer(entry):
    TABLE.solved[entry]()


@pytest.mark.parametrize("entry", TABLE.refused, ids=TABLE.named)
def test_a_pair_with_an_event_is_refused_by_a_sentence(entry):
    question, says = TABLE.refused[entry]
    with pytest.raises(ValueError, match=says):
        question()
