"""Every pair of kinds of questions: it has a known answer, or mechanics says why it has none.

Answers are closed forms, written here with none of the package's own numbers.
"""

from itertools import combinations

import numpy as np
import pytest
import systems
from pairs import KNOWN, Pairs, ask, check

import actionopt as ao

FEATURES = (
    "given times",
    "free time",
    "infinite time",
    "closed",
    "surface",
    "obstacle",
    "constraint",
    "clock",
    "force",
    "mesh",
    "ipopt",
    "trace",
    "sweep",
    "integral",
    "accelerations",
)
TABLE = Pairs(FEATURES)
pair, solves, refuses, named = TABLE, TABLE.solves, TABLE.refuses, TABLE.named
SOLVED, REFUSED = TABLE.solved, TABLE.refused
MESH = ao.Mesh.uniform(0, 1, 4, 8)
INF = np.inf


# -- systems ---------------------------------------------------------------------------------------


def ring(**more):
    """A particle on the unit circle: angles grow evenly."""
    return systems.particle("x y", constraint=lambda q, t: q @ q - 1, **more)


def ring_that_grows():
    return systems.particle("x y", constraint=lambda q, t: q @ q - (1 + t) ** 2)


def quarter(T=1.0, **more):
    """From the angle 0 to a quarter of the circle."""
    return ask(ring(**more), [1, 0], [0, 1], T)


def falling():
    """L = v^2 / 2 + x t: x'' = t, x = c t + t^3 / 6."""
    return ao.System(lambda q, v, t: v @ v / 2 + q[0] * t, ["x"])


def dragged(names="x", **more):
    """Drag of rate one: q = u (1 - exp(-t))."""
    return systems.particle(names, force=lambda q, v, t: -v, **more)


def driven(drag=False):
    """x'' = x + a cos t: x = -a cos t / 2 closes after 2 pi; with drag x'' + x' = x + a cos t."""
    more = {"force": lambda q, v, t: -v} if drag else {}
    return ao.System(
        lambda q, v, t, *, a: (v @ v + q @ q) / 2 + a * q[0] * np.cos(t),
        ["x"],
        parameters={"a": 1.0},
        **more,
    )


def returning(drag=False):
    return ao.Problem(driven(drag), ao.Event(0, [None]), ao.Periodic(2 * np.pi))


def pendulum_period():
    """Return that of the amplitude 1, 4 K(sin^2(1/2)), by the arithmetic-geometric mean."""
    a, b = 1.0, np.cos(0.5)
    for _ in range(6):
        a, b = (a + b) / 2, np.sqrt(a * b)
    return 2 * np.pi / a


def double_well():
    """L = v^2 / 2 + a^2 (x^2 - 1)^2 / 2: x = tanh a t, S = 4 a / 3."""
    return ao.System(
        lambda q, v, t, *, a: v @ v / 2 + a**2 * (q[0] ** 2 - 1) ** 2 / 2,
        ["x"],
        parameters={"a": 1.0},
    )


def kink(**more):
    return ao.Problem(double_well(), ao.Event(-INF, [-1.0]), ao.Event(INF, [1.0]), **more)


def floor(**more):
    """A string of the weight g above a floor: parabolas end there tangentially."""
    return ao.System(
        lambda q, v, t, *, g: v @ v / 2 + g * q[0],
        ["y"],
        parameters={"g": 2.0},
        obstacle=lambda q, t: q[0],
        **more,
    )


def drop(t, g=2.0):
    return g / 2 * (np.maximum(1 - t * np.sqrt(g / 2), 0) / np.sqrt(g / 2)) ** 2


def over_floor(**more):
    return ask(floor(), [1.0], [0.0], 2.0, **more)


def disc(names="x y", **more):
    return systems.particle(names, obstacle=lambda q, t: q[0] ** 2 + q[1] ** 2 - 1, **more)


def rising_wall():
    return systems.particle(obstacle=lambda q, t: q[0] - 1 + 8 * (t - 0.5) ** 2)


def round_disc(before=0.3, behind=0.0):
    """From (-2, before) to (2, behind): the length of the shortest way, above."""
    free = np.sqrt(np.array([3 + before**2, 3 + behind**2]))
    angle = np.pi - np.arctan2(before, 2) - np.arctan2(behind, 2) - np.arctan(free).sum()
    return free.sum() + angle if angle > 0 else np.hypot(4, before - behind)


def line(s=1.0):
    """Return an event's surface x + y = s."""
    return lambda q, t: q[0] + q[1] - s


def onto(system, on, T=1.0, start=(0.0, 0.0), **more):
    return ao.Problem(system, ao.Event(0, start), ao.Event(T, [None, None], on=on), **more)


def sloped(**more):
    """A particle to x + y = s: straight across."""
    on = lambda q, t, *, s: q[0] + q[1] - s  # noqa: E731
    return onto(systems.particle("x y"), on, parameters={"s": 1.0}, **more)


def half(t):
    return t / 2


# -- given times -----------------------------------------------------------------------------------


@solves("given times", "constraint")
def _():
    check(quarter(np.pi / 2), np.cos, np.sin, T=np.pi / 2)


@solves("given times", "clock")
def _():
    check(ask(falling(), [0], [1]), lambda t: 5 / 6 * t + t**3 / 6)


@solves("given times", "force")
def _():
    check(ask(dragged(), [0], [1 - np.exp(-1)]), lambda t: 1 - np.exp(-t))


@solves("given times", "surface")
def _():
    check(sloped(), half, half, action=0.25)


@solves("given times", "obstacle")
def _():
    check(over_floor(), drop, T=2.0)


@solves("given times", "closed")
def _():
    check(returning(), lambda t: -np.cos(t) / 2, T=2 * np.pi)


@solves("given times", "infinite time")
def _():
    """From the equilibrium, and at 0 when it is given."""
    sol = ao.solve(ao.Problem(double_well(), ao.Event(-INF, [-1.0]), ao.Event(0, [0.0])))
    t = np.linspace(-5, 0, 20)
    assert sol(t)[0] == pytest.approx(np.tanh(t), abs=KNOWN)


@solves("given times", "free time")
def _():
    """One of each."""
    check(ask(systems.particle(), [0], [1], None, energy=2.0), lambda t: 2 * t, T=0.5)


# -- free times ------------------------------------------------------------------------------------


@refuses(
    "free time",
    "infinite time",
    says="expected a finite time beside one that is free",
    because="the duration is infinite, whatever the energy",
)
def _():
    ao.Problem(double_well(), ao.Event(-INF, [-1.0]), ao.Event(None, [0.0]))


@solves("free time", "closed")
def _():
    problem = ao.Problem(
        systems.pendulum(), ao.Event(0, [0.0]), ao.Periodic(None), energy=-np.cos(1)
    )
    assert ao.solve(problem).duration == pytest.approx(pendulum_period(), rel=KNOWN)


@solves("free time", "surface")
def _():
    problem = onto(systems.particle("x y"), line(3 * np.sqrt(2)), None, energy=2.0)
    check(problem, *[lambda t: np.sqrt(2) * t] * 2, T=1.5)


@solves("free time", "obstacle")
def _():
    sol = ao.solve(ask(disc(), [-2, 0.3], [2, 0], None, energy=0.5))
    assert sol.duration == pytest.approx(round_disc(), rel=KNOWN)


@solves("free time", "obstacle", "clock")
def _():
    """Over the wall of "obstacle x clock", left where its slope is -2: H = 2 from there on."""
    sol = ao.solve(ask(rising_wall(), [0], [0], None, energy=2.0))
    assert sol.duration == pytest.approx(0.625 + (1 - 8 / 64) / 2, rel=KNOWN)
    assert sol.contacts[0].begin == pytest.approx(1 / np.sqrt(8), rel=KNOWN)
    assert sol.contacts[0].end == pytest.approx(0.625, rel=KNOWN)


@solves("free time", "constraint")
def _():
    check(quarter(None).replace(energy=0.5), np.cos, np.sin, T=np.pi / 2)


@solves("free time", "constraint", "clock")
def _():
    """Along the line y = t, on which x'' = t: v_x^2 / 2 - x t - 1 / 2 = E at the time 1."""
    system = ao.System(
        lambda q, v, t: v @ v / 2 + q[0] * t, ["x", "y"], constraint=lambda q, t: q[1] - t
    )
    problem = ao.Problem(
        system, ao.Event(0, [0.0, 0.0]), ao.Event(None, [1.0, None]), energy=-11 / 18
    )
    check(problem, lambda t: 5 / 6 * t + t**3 / 6, lambda t: t)


@refuses(
    "free time",
    "given times",
    "constraint",
    says="they tell the time",
    because="a place on a surface that moves tells when it is there",
)
def _():
    ask(ring_that_grows(), [1, 0], [0, 2], None)


@solves("free time", "constraint", "clock", "surface")
def _():
    """A quarter round a ring of radius 1 + t: r^2 theta' = pi, r^2 theta'^2 / 2 - 1 / 2 = E."""
    problem = onto(
        ring_that_grows(), lambda q, t: q[0], None, (1.0, 0.0), energy=np.pi**2 / 8 - 0.5
    )
    known = [lambda t, f=f: (1 + t) * f(np.pi * t / (1 + t)) for f in (np.cos, np.sin)]
    check(problem, *known, guess=ao.solve(ask(ring_that_grows(), [1, 0], [0, 2.1], 1.1)))


@solves("free time", "clock")
def _():
    """H(t1) = v^2 / 2 - x t = (4/3)^2 / 2 - 1 at t1 = 1."""
    problem = ask(falling(), [0], [1], None, energy=-1 / 9)
    check(problem, lambda t: 5 / 6 * t + t**3 / 6, guess=ao.solve(ask(falling(), [0], [1], 1.1)))


@refuses(
    "free time",
    "force",
    says="expected a system without non-conservative forces",
    because="no action is stationary in the time",
)
def _():
    ask(dragged(), [0], [1], None)


def rising():
    """An oscillator of the energy 1/2 from 0 to 1/2: q = sin t."""
    return ask(systems.oscillator(), [0], [0.5], None, energy=0.5)


@solves("free time", "mesh")
def _():
    """Its elements share the time that is found; the error is that of the mesh."""
    assert check(rising(), np.sin, T=np.pi / 6, mesh=MESH).mesh.elements == MESH.elements
    coarse = ao.solve(rising(), mesh=ao.Mesh.uniform(0, 1, 1, 3))
    assert KNOWN < abs(coarse.duration * 6 / np.pi - 1) < coarse.error < 1e-2


@solves("free time", "ipopt")
def _():
    sol = check(rising(), np.sin, T=np.pi / 6, method="ipopt")
    assert sol.stats["rung"] == "ipopt"


# -- infinite times --------------------------------------------------------------------------------


@refuses(
    "infinite time",
    "closed",
    says="expected a path that closes after a finite time",
    because="from rest back to rest is a path between two events",
)
def _():
    ao.Problem(double_well(), ao.Event(0, [-1.0]), ao.Periodic(INF))


@solves("infinite time", "surface")
def _():
    """Away from rest by x = a exp t, y = b exp 2 t to x + y = 1: S = (a^2 + 2 b^2) / 2 is least."""
    hill = ao.System(lambda q, v, t: (v @ v + q[0] ** 2 + 4 * q[1] ** 2) / 2, ["x", "y"])
    end = ao.Event(0, [None, None], on=line())
    sol = ao.solve(ao.Problem(hill, ao.Event(-INF, [0.0, 0.0]), end))
    t = np.linspace(-5, 0, 20)
    known = np.array([2 * np.exp(t), np.exp(2 * t)]) / 3
    assert sol(t) == pytest.approx(known, abs=KNOWN)
    assert sol.action == pytest.approx(1 / 3, rel=KNOWN) and sol.morse_index == 0


@solves("infinite time", "obstacle")
def _():
    """On the wall x = 1 - 4 u^2, u = t - 1, until its slope is that of exp(-t): 8 u = 1 - 4 u^2."""
    wall = ao.System(
        lambda q, v, t: (v @ v + q @ q) / 2,
        ["x"],
        obstacle=lambda q, t: q[0] - 1 + 4 * (t - 1) ** 2,
    )
    sol = ao.solve(ao.Problem(wall, ao.Event(1, [1.0]), ao.Event(INF, [0.0])))
    u = np.sqrt(5) / 2 - 1
    x = 1 - 4 * u**2
    along = u / 2 + 28 * u**3 / 3 + 8 * u**5 / 5  # int (64 u^2 + x^2) / 2 du
    assert sol.contacts[0].end == pytest.approx(1 + u, abs=KNOWN)
    assert sol(4.0) == pytest.approx([x * np.exp(u - 3)], abs=KNOWN)
    assert sol.action == pytest.approx(along + x**2 / 2, rel=KNOWN) and sol.morse_index == 0


@refuses(
    "infinite time",
    "obstacle",
    "given times",
    says="comes to it in a finite time",
    because="what rests in contact is held there by a force",
)
def _():
    ask(floor(), [1.0], [0.0], INF)


@solves("infinite time", "constraint")
def _():
    """A pendulum on the ring that comes to rest upright: tan(a / 4) = tan(pi / 8) exp(-t)."""
    system = ao.System(
        lambda q, v, t, *, g: v @ v / 2 - g * q[1],
        ["x", "y"],
        constraint=lambda q, t: q @ q - 1,
        parameters={"g": 1.0},
    )
    sol = ao.solve(ask(system, [1, 0], [0, 1], INF))
    t = np.linspace(0, 20, 41)
    angle = 4 * np.arctan(np.tan(np.pi / 8) * np.exp(-t))
    assert sol(t) == pytest.approx(np.array([np.sin(angle), np.cos(angle)]), abs=KNOWN)
    action = 4 - 2 * np.sqrt(2)  # int a'^2 dt, above rest; it grows as sqrt(g)
    assert sol.action == pytest.approx(action, rel=KNOWN) and sol.morse_index == 0
    assert sol.sensitivity().parameters["g"] == pytest.approx(action / 2, rel=KNOWN)


@solves("infinite time", "constraint", "force")
def _():
    """The same with drag, beside that of its angle in one coordinate."""
    bound = systems.thrown(g=1.0, constraint=lambda q, t: q @ q - 1, force=lambda q, v, t: -v / 2)
    angle = ao.System(lambda q, v, t: v @ v / 2 - np.cos(q[0]), ["a"], force=lambda q, v, t: -v / 2)
    sol = ao.solve(ask(bound, [1, 0], [0, 1], INF))
    known = ao.solve(ask(angle, [np.pi / 2], [0], INF))
    t = np.linspace(0, 20, 41)
    assert np.arctan2(*sol(t)) == pytest.approx(known(t)[0], abs=KNOWN)
    assert sol.action == pytest.approx(known.action, rel=KNOWN)


@refuses(
    "infinite time",
    "constraint",
    "clock",
    says="nothing rests on what moves",
    because="where a constraint moves, nothing is at rest",
)
def _():
    ao.solve(ask(ring_that_grows(), [1, 0], [0, 1], INF))


@solves("infinite time", "clock")
def _():
    """A clock that dies out: x = 1 / cosh t."""
    stiffness = lambda t: 1 - 2 / np.cosh(t) ** 2  # noqa: E731
    system = ao.System(lambda q, v, t: (v @ v + stiffness(t) * q @ q) / 2, ["x"])
    sol = ao.solve(ask(system, [1], [0], INF))
    t = np.linspace(0, 8, 20)
    assert sol(t)[0] == pytest.approx(1 / np.cosh(t), abs=KNOWN)


@solves("infinite time", "force")
def _():
    """Drag that turns a push aside: q' = W q, of the motions of the linear equations that decay."""
    drag, stiff = np.array([[1.0, 0.7], [-0.3, 0.5]]), np.array([[1.0, 0.2], [0.2, 3.0]])
    system = ao.System(
        lambda q, v, t: (v @ v + q @ (stiff @ q)) / 2, ["x", "y"], force=lambda q, v, t: -(drag @ v)
    )
    rates, motions = np.linalg.eig(np.block([[np.zeros((2, 2)), np.eye(2)], [stiff, -drag]]))
    decaying = rates.real < 0
    rates, motions = rates[decaying], motions[:, decaying]
    start = [1.0, -0.5]
    share = np.linalg.solve(motions[:2], start)[:, None]
    sol = ao.solve(ask(system, start, [0, 0], INF))
    t = np.linspace(0, 20, 81)
    known = motions @ (share * np.exp(rates[:, None] * t))
    assert sol(t) == pytest.approx(known[:2].real, abs=KNOWN)
    # int L dt = sum share_i share_j (v_i.v_j + q_i.stiff q_j) / 2 / -(rate_i + rate_j)
    q, v = motions[:2] * share[:, 0], motions[2:] * share[:, 0]
    both = -(rates[:, None] + rates)
    action = ((v.T @ v + q.T @ stiff @ q) / 2 / both).sum().real
    assert sol.action == pytest.approx(action, rel=KNOWN)


@refuses(
    "infinite time",
    "force",
    "given times",
    says="at single values of a parameter",
    because="what is left of the energy does not come to rest at the other equilibrium",
)
def _():
    law = lambda q, v, t: (v @ v + q @ q) / 2  # noqa: E731
    system = ao.System(law, ["x"], force=lambda q, v, t: -v)
    ao.solve(ao.Problem(system, ao.Event(-INF, [0.0]), ao.Event(INF, [0.0])))


@solves("infinite time", "mesh")
def _():
    """The mesh is over a window."""
    sol = ao.solve(kink(), mesh=ao.Mesh.uniform(-12, 12, 24, 8), tol=1e-6)
    assert sol.action == pytest.approx(4 / 3, rel=1e-6)


@solves("infinite time", "ipopt")
def _():
    assert ao.solve(kink(), method="ipopt").action == pytest.approx(4 / 3, rel=KNOWN)


# -- closed paths ----------------------------------------------------------------------------------


@solves("closed", "surface")
def _():
    """A pendulum that begins where it passes 1/2: with the period of its amplitude 1."""
    start = ao.Event(0, [None], on=lambda q, t: q[0] - 0.5)
    problem = ao.Problem(systems.pendulum(), start, ao.Periodic(None), energy=-np.cos(1))
    swing = ao.Path.interpolate(lambda t: [1.1 * np.cos(t)], ao.Mesh.uniform(0, 2 * np.pi, 4, 8))
    sol = ao.solve(problem, guess=swing)
    assert sol.duration == pytest.approx(pendulum_period(), rel=KNOWN)
    assert sol.start.v**2 / 2 == pytest.approx([np.cos(0.5) - np.cos(1)], rel=KNOWN)


@solves("closed", "surface", "clock")
def _():
    """Pushed alike in x and y at the time 0: x = (3/4) cosh(t - pi) / cosh(pi) - cos t / 2."""
    system = ao.System(
        lambda q, v, t: (v @ v + q @ q) / 2 + q[0] * np.cos(t) + q[1] * np.sin(t), ["x", "y"]
    )
    problem = ao.Problem(system, ao.Event(0, [None, None], on=line()), ao.Periodic(2 * np.pi))
    pushed = lambda t: 0.75 * np.cosh(t - np.pi) / np.cosh(np.pi)  # noqa: E731
    known = [lambda t, f=f: pushed(t) - f(t) / 2 for f in (np.cos, np.sin)]
    assert check(problem, *known, T=2 * np.pi).morse_index == 0


@solves("closed", "obstacle", "clock")
def _():
    """A string of the weight 1 + pi / 2 cos t over a floor: off it from pi / 2 to 3 pi / 2."""
    system = ao.System(
        lambda q, v, t: v @ v / 2 + (1 + np.pi / 2 * np.cos(t)) * q[0],
        ["y"],
        obstacle=lambda q, t: q[0],
    )

    def known(t):
        u = t - np.pi / 2
        lifted = u**2 / 2 - np.pi / 2 * (np.cos(t) + u)
        return np.where(np.abs(t - np.pi) < np.pi / 2, lifted, 0.0)

    sol = check(ao.Problem(system, ao.Event(0, [None]), ao.Periodic(2 * np.pi)), known, T=2 * np.pi)
    assert [arc.begin for arc in sol.contacts] == pytest.approx([0, 3 * np.pi / 2], abs=KNOWN)


@solves("closed", "obstacle")
def _():
    """A belt round two discs of radius 1, 4 apart."""
    system = systems.particle(
        "x y", obstacle=lambda q, t: [(q[0] + a) ** 2 + q[1] ** 2 - 1 for a in (-2, 2)]
    )
    problem = ao.Problem(system, ao.Event(0, [None, None]), ao.Periodic(1.0))
    turn = lambda t: [4 * np.cos(2 * np.pi * t), 2 * np.sin(2 * np.pi * t)]  # noqa: E731
    sol = ao.solve(problem, guess=turn)
    assert sol.action == pytest.approx((8 + 2 * np.pi) ** 2 / 2, rel=KNOWN)
    assert sol.inertia.index == 0 and sol.inertia.nullity == sol.inertia.moves == 1


@solves("closed", "constraint")
def _():
    """Once round the ring."""
    problem = ao.Problem(ring(), ao.Event(0, [1.0, None]), ao.Periodic(2 * np.pi))
    check(problem, np.cos, np.sin, T=2 * np.pi, guess=lambda t: [np.cos(t), 0.9 * np.sin(t)])


@solves("closed", "clock")
def _():
    check(returning(), lambda t: -np.cos(t) / 2, T=2 * np.pi)


@solves("closed", "force")
def _():
    """x = Re exp(i t) / (i - 2)."""
    check(returning(drag=True), lambda t: (np.exp(1j * t) / (1j - 2)).real, T=2 * np.pi)


# -- surfaces --------------------------------------------------------------------------------------


@solves("surface", "obstacle")
def _():
    """Over the top of the disc, and straight across the line."""
    sol = ao.solve(onto(disc(), lambda q, t: q[0] - 2, start=(-2.0, 0.3)))
    assert sol.end.q == pytest.approx([2, 1], abs=KNOWN)


@solves("surface", "constraint")
def _():
    """Along the ring to the diagonal."""
    problem = onto(ring(), lambda q, t: q[0] - q[1], np.pi / 4, start=(1.0, 0.0))
    check(problem, np.cos, np.sin, T=np.pi / 4)


@solves("surface", "clock")
def _():
    """The momentum (1/6 + 1/2, 2/3) is across x + y = 1."""
    system = ao.System(lambda q, v, t: v @ v / 2 + q[0] * t, ["x", "y"])
    check(onto(system, line()), lambda t: t / 6 + t**3 / 6, lambda t: 2 / 3 * t)


@solves("surface", "force")
def _():
    known = [lambda t: (1 - np.exp(-t)) / (1 - np.exp(-1)) / 2] * 2
    check(onto(dragged("x y"), line()), *known)


# -- obstacles -------------------------------------------------------------------------------------


@solves("obstacle", "constraint")
def _():
    """Round a cylinder, in the plane across it."""
    system = disc("x y z", constraint=lambda q, t: q[2])
    sol = ao.solve(ask(system, [-2, 0.3, 0], [2, 0, 0]))
    assert sol.action == pytest.approx(round_disc() ** 2 / 2, rel=KNOWN)


@solves("obstacle", "clock")
def _():
    """Tangents from the ends touch the wall x = 1 - 8 (t - 1/2)^2 at 1/2 -+ (1/2 - 1/sqrt(8))."""
    sol = ao.solve(ask(rising_wall(), [0], [0]))
    assert sol.contacts[0].begin == pytest.approx(1 / np.sqrt(8), rel=KNOWN)


@refuses(
    "obstacle",
    "force",
    says="found both",
    because="what an obstacle holds is a path of least action, and with forces none is least",
)
def _():
    systems.particle(force=lambda q, v, t: -v, obstacle=lambda q, t: q[0])


@solves("obstacle", "trace")
def _():
    """Less and less weight, until the string touches the floor no more, at g = 1 / 2."""
    found = ao.trace(over_floor(), "g", 0.2)
    g, (t, weight) = found.values, np.polynomial.legendre.leggauss(6)
    lying = g**2 * np.sqrt(2 / g) ** 3 / 3
    y, v = [
        np.polynomial.polynomial.polyval(t + 1, row)
        for row in ([1 + 0 * g, -g - 0.5, g / 2], [-g - 0.5, g])
    ]
    free = (v**2 / 2 + g[:, None] * y) @ weight
    assert found.stopped == "it reached the goal" and not found.indices.any()
    assert found.actions == pytest.approx(np.where(g > 0.5, lying, free), rel=KNOWN)


@solves("obstacle", "trace", "given times")
def _():
    """The end sinks until the disc is in the way: the length of the shortest way, above."""
    found = ao.trace(ask(disc(), [-2, 0.9], [2, 1.5]), ("end", "y"), -0.5)
    assert found.actions == pytest.approx(
        [round_disc(0.9, y) ** 2 / 2 for y in found.values], rel=KNOWN
    )
    assert found.solution(0).contacts == () and found.solution(-1).contacts


@solves("obstacle", "sweep")
def _():
    found = ao.sweep(over_floor(), {"g": [2.0, 4.0]})
    assert found.solution(1)(0.5) == pytest.approx([drop(0.5, 4.0)], abs=KNOWN)


# -- constraints, clocks, forces -------------------------------------------------------------------


@solves("constraint", "clock")
def _():
    """On a ring that grows as r = 1 + t: r^2 theta' is conserved."""
    known = [lambda t, f=f: (1 + t) * f(2 * t / (1 + t)) for f in (np.cos, np.sin)]
    check(ask(ring_that_grows(), [1, 0], [2 * np.cos(1), 2 * np.sin(1)]), *known)


@solves("constraint", "force")
def _():
    """The angle is dragged as a coordinate would be."""
    known = [
        lambda t, f=f: f((1 - np.exp(-t)) / (1 - np.exp(-1)) * np.pi / 2) for f in (np.cos, np.sin)
    ]
    check(quarter(force=lambda q, v, t: -v), *known)


@solves("clock", "force")
def _():
    """x'' + x' = t: x = t^2 / 2 - t + c (1 - exp(-t))."""
    system = ao.System(lambda q, v, t: v @ v / 2 + q[0] * t, ["x"], force=lambda q, v, t: -v)
    known = lambda t: t**2 / 2 - t + 2 * (1 - np.exp(-t))  # noqa: E731
    check(ask(system, [0], [known(1)]), known)


# -- integrals that are given ----------------------------------------------------------------------


def mean(names="x", **more):
    """L = v^2 / 2, with int x dt given: x'' = kappa."""
    return systems.particle(names, integral=lambda q, v, t: q[0], **more)


def arched(J=0.5, **more):
    """From 0 to 0 in the time 1: x = 6 J t (1 - t), S = 6 J^2."""
    return ask(mean(**more), [0], [0], integral=J)


def arch(t, J=0.5):
    return 6 * J * t * (1 - t)


@solves("given times", "integral")
def _():
    assert check(arched(), arch, action=1.5).integral_multipliers == pytest.approx([-6])


@solves("free time", "integral")
def _():
    """x = (t + t^2) / 2 at the time 1: kappa = 1, and H = (3/2)^2 / 2 - 1."""
    problem = ask(mean(), [0], [1], None, energy=1 / 8, integral=5 / 12)
    check(problem, lambda t: (t + t**2) / 2, guess=ao.solve(ask(mean(), [0], [1], 1.1)))


@refuses(
    "infinite time",
    "integral",
    says="between finite events",
    because="where a path rests, and at what rates it comes there, changes with the multiplier",
)
def _():
    ask(mean(), [1], [0], INF, integral=1.0)


@solves("closed", "integral")
def _():
    """A circle round the area pi, run through in the time 1: kappa = - 2 pi."""
    system = systems.particle("x y", integral=lambda q, v, t: (q[0] * v[1] - q[1] * v[0]) / 2)
    problem = ao.Problem(system, ao.Event(0, [None, None]), ao.Periodic(1.0), integral=np.pi)
    sol = ao.solve(problem)
    assert sol.action == pytest.approx(2 * np.pi**2, rel=KNOWN) and sol.morse_index == 0
    assert sol.integral_multipliers == pytest.approx([-2 * np.pi], rel=KNOWN)


@solves("surface", "integral")
def _():
    """At right angles on x + y = 1, with kappa = 1."""
    problem = onto(mean("x y"), line(), integral=1 / 24)
    check(problem, lambda t: t**2 / 2 - t / 4, lambda t: 0.75 * t)


@solves("obstacle", "integral")
def _():
    """On the floor between two parabolas, of which J = 2 a / 3: kappa = 2 / a^2, S = 4 / (3 a)."""
    J = 0.4
    a = 3 * J / 2
    problem = ask(mean(obstacle=lambda q, t: q[0]), [1], [1], 2.0, integral=J)
    known = lambda t: (np.maximum(abs(t - 1) - 1 + a, 0) / a) ** 2  # noqa: E731
    sol = check(problem, known, T=2.0, action=4 / (3 * a))
    assert sol.integral_multipliers == pytest.approx([2 / a**2], rel=KNOWN)


@solves("constraint", "integral")
def _():
    """Along x = y all weighs twice."""
    system = mean("x y", constraint=lambda q, t: q[1] - q[0])
    check(ask(system, [0, 0], [0, 0], integral=0.5), arch, arch, action=3.0)


@solves("clock", "integral")
def _():
    """x'' = t + kappa: x = c t + kappa t^2 / 2 + t^3 / 6, of kappa = 1 and c = -2/3."""
    system = ao.System(lambda q, v, t: v @ v / 2 + q[0] * t, ["x"], integral=lambda q, v, t: q[0])
    known = lambda t: -2 / 3 * t + t**2 / 2 + t**3 / 6  # noqa: E731
    check(ask(system, [0], [0], integral=-1 / 3 + 1 / 6 + 1 / 24), known)


@solves("force", "integral")
def _():
    """x'' + x' = kappa = 1: x = t - 2 (1 - exp -t)."""
    known = lambda t: t - 2 * (1 - np.exp(-t))  # noqa: E731
    problem = ask(mean(force=lambda q, v, t: -v), [0], [known(1)], integral=0.5 - 2 * np.exp(-1))
    check(problem, known)


@refuses(
    "mesh",
    "integral",
    says="expected neither a mesh",
    because="none: a multiplier is found with the path, from mesh to mesh",
)
def _():
    ao.solve(arched(), mesh=MESH)


@refuses(
    "ipopt",
    "integral",
    says="expected neither a mesh",
    because="none: what Ipopt is told has no row through the whole path",
)
def _():
    ao.solve(arched(), method="ipopt")


# -- accelerations ---------------------------------------------------------------------------------


def beam(names="x", more=None, **laws):
    """L = a^2 / 2 + more(q, t)."""
    return ao.System(
        lambda q, v, a, t: a @ a / 2 + (0 if more is None else more(q, t)), names.split(), **laws
    )


def clamped(system, start, end, T=1.0, **more):
    """From rest to rest."""
    still = [0.0] * len(start)
    return ao.Problem(system, ao.Event(0, start, v=still), ao.Event(T, end, v=still), **more)


def cubic(t):
    """S = 6 from 0 to 1 in the time 1."""
    return 3 * t**2 - 2 * t**3


@solves("given times", "accelerations")
def _():
    check(clamped(beam(), [0], [1]), cubic, action=6.0)


@solves("free time", "accelerations")
def _():
    """S = 6 / T^3: E = 18 / T^4."""
    check(clamped(beam(), [0], [1], None, energy=18.0), cubic, action=6.0)


@refuses(
    "infinite time",
    "accelerations",
    says="events at finite times of a Lagrangian with accelerations",
    because="none: a rest has two rates for each coordinate there",
)
def _():
    clamped(beam(), [0], [1], INF)


@solves("closed", "accelerations")
def _():
    """The fourth derivative of x, and x, are together cos t."""
    driven = beam(more=lambda q, t: q[0] ** 2 / 2 - q[0] * np.cos(t))
    problem = ao.Problem(driven, ao.Event(0, [None]), ao.Periodic(2 * np.pi))
    check(problem, lambda t: np.cos(t) / 2, T=2 * np.pi)


@solves("surface", "accelerations")
def _():
    """From rest to rest, half way along both axes."""
    start = ao.Event(0, [0.0, 0.0], v=[0.0, 0.0])
    end = ao.Event(1, [None, None], v=[0.0, 0.0], on=line())
    half_way = [lambda t: cubic(t) / 2] * 2
    check(ao.Problem(beam("x y"), start, end), *half_way, action=3.0)


@solves("obstacle", "accelerations")
def _():
    """It lies on the floor from t = 3 / V on: (1 - t V / 3)^3 before."""
    ends = ao.Event(0, [1.0], v=[-9.0]), ao.Event(1, [1.0], v=[9.0])
    system = beam(obstacle=lambda q, t: q[0])
    known = lambda t: np.maximum(np.abs(6 * t - 3) - 1, 0) ** 3 / 8  # noqa: E731
    check(ao.Problem(system, *ends), known, action=324.0)


@solves("constraint", "accelerations")
def _():
    system = beam("x y", constraint=lambda q, t: q[1] - q[0])
    check(clamped(system, [0, 0], [1, 1]), cubic, cubic, action=12.0)


@solves("clock", "accelerations")
def _():
    """The fourth derivative is t."""
    known = lambda t: cubic(t) + (t**5 - 3 * t**3 + 2 * t**2) / 120  # noqa: E731
    check(clamped(beam(more=lambda q, t: -q[0] * t), [0], [1]), known)


@solves("force", "accelerations")
def _():
    """The fourth derivative is v: exp t is one of the motions."""
    ends = ao.Event(0, [1.0], v=[1.0]), ao.Event(1, [np.e], v=[np.e])
    check(ao.Problem(beam(force=lambda q, v, t: -v), *ends), np.exp)


@solves("mesh", "accelerations")
def _():
    sol = check(clamped(beam(), [0], [1]), cubic, mesh=MESH)
    assert sol.mesh.elements == MESH.elements


@refuses(
    "ipopt",
    "accelerations",
    says="method 'ipopt' is not known of it",
    because="none: what Ipopt is told has values at nodes alone",
)
def _():
    ao.solve(clamped(beam(), [0], [1]), method="ipopt")


@solves("integral", "accelerations")
def _():
    """The fourth derivative is minus the multiplier: S = 360 J^2."""
    system = beam(integral=lambda q, v, t: q[0])
    known = lambda t: 15 * t**2 * (1 - t) ** 2  # noqa: E731
    check(clamped(system, [0], [0], integral=0.5), known, action=90.0)


# -- ways to solve ---------------------------------------------------------------------------------

# Of a kind: a question, its answer and duration, and a mesh.
ANSWERS = {
    "given times": (lambda: ask(systems.oscillator(), [0], [np.sin(1)]), [np.sin], 1.0, MESH),
    "closed": (
        *(returning, [lambda t: -np.cos(t) / 2], 2 * np.pi),
        ao.Mesh.uniform(0, 2 * np.pi, 12, 8),
    ),
    "surface": (sloped, [half, half], 1.0, MESH),
    # Its elements end where contact begins as well.
    "obstacle": (over_floor, [drop], 2.0, ao.Mesh.uniform(0, 2, 5, 4)),
    "constraint": (
        *(quarter, [lambda t, f=f: f(t * np.pi / 2) for f in (np.cos, np.sin)], 1.0, MESH),
    ),
    "clock": (lambda: ask(falling(), [0], [1]), [lambda t: 5 / 6 * t + t**3 / 6], 1.0, MESH),
    "force": (
        lambda: ask(dragged(), [0], [1 - np.exp(-1)]),
        *([lambda t: 1 - np.exp(-t)], 1.0, MESH),
    ),
}
for kind, answer in ANSWERS.items():

    @solves(kind, "mesh")
    def _(kind=kind, answer=answer):
        question, curves, T, mesh = answer
        sol = check(question(), *curves, T=T, mesh=mesh)
        assert kind == "obstacle" or sol.mesh.elements == mesh.elements

    @solves(kind, "ipopt")
    def _(answer=answer):
        question, curves, T, _ = answer
        check(question(), *curves, T=T, method="ipopt")


def action(sol):
    return sol.action


def place_at_one(sol):
    return sol(1.0)[0]


# Of a kind: a question, what varies from a first value to a last one, and a number at both.
CHANGES = {
    "given times": (
        lambda: ask(systems.oscillator(), [0], [1]),
        *(("end", "x"), (1.0, 3.0), action, (0.5 / np.tan(1), 4.5 / np.tan(1))),
    ),
    "free time": (
        lambda: ask(systems.particle(), [0], [1], None, energy=2.0),
        *("energy", (2.0, 8.0), lambda sol: sol.duration, (0.5, 0.25)),
    ),
    "infinite time": (kink, "a", (1.0, 2.0), action, (4 / 3, 8 / 3)),
    "closed": (returning, "a", (1.0, 3.0), lambda sol: sol(0.0)[0], (-0.5, -1.5)),
    "surface": (sloped, "s", (1.0, 2.0), action, (0.25, 1.0)),
    "constraint": (quarter, "t1", (1.0, 2.0), action, (np.pi**2 / 8, np.pi**2 / 16)),
    "clock": (lambda: ask(falling(), [0], [1]), "t1", (1.0, 2.0), place_at_one, (1.0, 0.0)),
    "force": (
        lambda: ask(dragged(), [0], [1]),
        *("t1", (1.0, 2.0), place_at_one, (1.0, (1 - np.exp(-1)) / (1 - np.exp(-2)))),
    ),
    "integral": (arched, ("integral", 0), (0.5, 1.0), action, (1.5, 6.0)),
    "accelerations": (
        lambda: clamped(beam(), [0], [1]),
        *("t1", (1.0, 2.0), action, (6.0, 0.75)),
    ),
}
for kind, change in CHANGES.items():

    @solves(kind, "trace")
    def _(change=change):
        question, name, (_, last), read, (_, known) = change
        found = ao.trace(question(), name, last).solution(-1)
        assert read(found) == pytest.approx(known, rel=KNOWN, abs=KNOWN)

    @solves(kind, "sweep")
    def _(change=change):
        question, name, values, read, known = change
        found = ao.sweep(question(), {name: list(values)})
        numbers = [read(found.solution(k)) for k in range(2)]
        assert numbers == pytest.approx(known, rel=KNOWN, abs=KNOWN)


@solves("mesh", "ipopt")
def _():
    check(ask(systems.oscillator(), [0], [np.sin(1)]), np.sin, mesh=MESH, method="ipopt")


# A trace and a sweep choose meshes and ways themselves: they have no such arguments.
NOT_ASKED = {pair(a, b) for a in ("mesh", "ipopt") for b in ("trace", "sweep")} | {
    pair("trace", "sweep")
}


def test_every_pair_is_in_the_table():
    entered = [*SOLVED, *REFUSED, *NOT_ASKED]
    assert len(entered) == len(set(entered))
    pairs = {pair(*names) for names in combinations(FEATURES, 2)}
    assert {entry for entry in entered if len(entry) == 2} == pairs


@pytest.mark.quick(
    "free time x ipopt",
    "infinite time x force",
    "closed x surface x clock",
    "surface x ipopt",
    "obstacle x ipopt",
    "given times x integral",
    "constraint x integral",
    "constraint x accelerations",
)
@pytest.mark.parametrize("entry", SOLVED, ids=named)
def test_a_pair_has_its_known_answer(entry):
    SOLVED[entry]()


@pytest.mark.parametrize("entry", REFUSED, ids=named)
def test_a_pair_is_refused_by_a_sentence(entry):
    question, says = REFUSED[entry]
    with pytest.raises(ValueError, match=says):
        question()
