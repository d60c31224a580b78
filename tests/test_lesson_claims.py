"""What the lessons of the course say in numbers is so, sentence by sentence.

Actions are summed here, of paths in closed form where there are such.
"""

import re
from functools import cache

import numpy as np
import pytest
from helpers import solved

import actionopt as ao
from actionopt import scenes
from actionopt.gallery.course import pictures
from actionopt.gallery.course.experiments import EXPERIMENTS
from actionopt.gallery.course.lessons import BY_NAME, LESSONS
from actionopt.tools.lobatto import lgl

G = 9.81
MARKED = re.compile(
    r"\d|conserved|\bleast|maximum|saddle|index|exact|\bsame\b|\balike|zero|nothing|never|always"
    r"|half|quarter|eighth|twice|equal|opposite|no other|straight|slope|rises|falls|cannot",
    re.IGNORECASE,
)


# -- sums ------------------------------------------------------------------------------------


def summed(f, T, a=0.0, parts=20):
    """Return the integral of f(t) from a to T, by Gauss and Lobatto's rule."""
    rule = lgl(14)
    h = (T - a) / parts
    t = a + h * (np.arange(parts)[:, None] + (rule.nodes + 1) / 2)
    return float(h / 2 * np.sum(rule.weights * f(t)))


def near(a, b, error=1e-8):
    return bool(np.max(np.abs(np.asarray(a) - b)) <= error * max(1.0, np.max(np.abs(b))))


def slope(f, h=1e-4):
    """Return the derivative of f at zero."""
    return (8 * (f(h) - f(-h)) - f(2 * h) + f(-2 * h)) / (12 * h)


def bends(T, count=4):
    """Return bends that vanish at 0 and T, and their velocities."""
    return [
        (
            lambda t, n=n: np.sin(n * np.pi * t / T),
            lambda t, n=n: n * np.pi / T * np.cos(n * np.pi * t / T),
        )
        for n in range(1, count + 1)
    ]


def bent(L, q, v, T, eta, rate):
    """Return the action of q + a eta as a function of a."""
    return lambda a: summed(lambda t: L(q(t) + a * eta(t), v(t) + a * rate(t), t), T)


def stationary(L, q, v, T):
    return all(abs(slope(bent(L, q, v, T, *b))) < 1e-7 for b in bends(T))


def second(L, q, v, T, count=4, h=1e-3):
    """Return the second variation in `count` bends, a matrix."""
    shapes = bends(T, count)

    def S(a):
        return summed(
            lambda t: L(
                q(t) + sum(c * e(t) for c, (e, _) in zip(a, shapes, strict=True)),
                v(t) + sum(c * r(t) for c, (_, r) in zip(a, shapes, strict=True)),
                t,
            ),
            T,
        )

    unit = h * np.eye(count)
    return np.array([[S(a + b) - S(a - b) - S(b - a) + S(-a - b) for a in unit] for b in unit]) / (
        4 * h**2
    )


def downhill(matrix):
    return int(np.sum(np.linalg.eigvalsh(matrix) < 0))


# -- a ball that rises by 1 m in 1 s, on a spring a mass -------------------------------------


def ball(y, v, t=0.0):
    return v**2 / 2 - G * y


def height(t):
    return (1 + G / 2) * t - G * t**2 / 2


def rise(t):
    return 1 + G / 2 - G * t


def spring(x, v, t=0.0):
    return (v**2 - x**2) / 2


def swing(v0=0.3, x0=1.0):
    return lambda t: x0 * np.cos(t) + v0 * np.sin(t), lambda t: v0 * np.cos(t) - x0 * np.sin(t)


def one(L, start, end, T=1.0, **more):
    """Return the path of a Lagrangian of one coordinate."""
    system = ao.System(lambda q, v, t: L(q[0], v[0], t), ["x"])
    return ao.solve(
        ao.Problem(system, ao.Event(0.0, [start]), ao.Event(T, [end])), tol=1e-10, **more
    )


def straight(t):
    return t, np.ones_like(t)


def on_straight(b, a):
    eta, rate = b
    return bent(ball, lambda t: t, lambda t: 1 + 0 * t, 1.0, eta, rate)(a) - (0.5 - G / 2)


t5 = np.linspace(0.0, 1.0, 5)
t75 = np.linspace(0.0, 0.75, 76)


def pieces(places, h=0.1):
    """Return the action of each piece between places a time h apart, V taken at its start."""
    x = np.asarray(places, dtype=float)
    return np.diff(x) ** 2 / (2 * h) - h * np.cos(x[:-1])


def three(x2, x1=0.2, x3=0.5, h=0.1):
    return (x2 - x1) ** 2 / (2 * h) + (x3 - x2) ** 2 / (2 * h) - h * np.cos(x2)


def middle_obeys_newton():
    """Return whether the slope of S is zero where Newton's law puts the middle place."""
    x2 = 0.4
    for _ in range(50):  # m (x3 - 2 x2 + x1) / h^2 = sin x2
        x2 = (0.2 + 0.5 - 0.01 * np.sin(x2)) / 2
    return near(slope(lambda e: three(x2 + e)), 0.0)


def any_law(x, v, t=0.0):
    return v**2 * (1 + x**2) / 2 - x**3


def euler_and_lagrange():
    path = one(any_law, 0.2, 0.5)

    def momentum(t):
        return slope(lambda e: any_law(path(t)[0], path.velocity(t)[0] + e))

    force = slope(lambda e: any_law(path(0.4)[0] + e, path.velocity(0.4)[0]))
    return near(slope(lambda e: momentum(0.4 + e), 1e-3), force, 1e-6)


def piece_of(scene, a, b):
    """Return whether the motion between two times is that which `solve` finds there alone."""
    s = solved(scene, tol=1e-10)
    q = [ao.Event(t, s(t)) for t in (a, b)]
    part = ao.solve(ao.Problem(s.problem.system, *q, parameters=s.problem.parameters), tol=1e-10)
    t = np.linspace(a, b, 9)
    return near(part(t), s(t), 1e-7)


def narrow(at=0.6, wide=0.05):
    """Return a bend about one time, and its velocity."""
    return (
        lambda t: np.exp(-(((t - at) / wide) ** 2)),
        lambda t: -2 * (t - at) / wide**2 * np.exp(-(((t - at) / wide) ** 2)),
    )


def missing_on_straight_line():
    eta, rate = narrow()
    S = bent(ball, lambda t: t, lambda t: 1 + 0 * t, 1.0, eta, rate)
    return near(slope(S), -G * summed(eta, 1.0), 1e-6)  # of m x'' + m g, with the other sign


def sign(s):
    """Return the path of the experiment whose L is T - (1 - 2 s) V."""
    problem = EXPERIMENTS["minus"]()
    values = problem.system.table.values(problem.parameters)
    return ao.solve(
        ao.Problem(problem.system, problem.start, problem.end, parameters={**values, "s": s})
    )


def sagging(s):
    path = sign(s)
    T = path.problem.duration
    return float(path(T / 2)[1] - (path(0.0)[1] + path(T)[1]) / 2)


# -- what may be added -----------------------------------------------------------------------

WAYS = [
    (lambda t: t, lambda t: 1 + 0 * t),
    (height, rise),
    (lambda t: t + np.sin(3 * np.pi * t), lambda t: 1 + 3 * np.pi * np.cos(3 * np.pi * t)),
]


def added(extra):
    """Return by how much S of each of three ways rises."""
    return [summed(lambda t, q=q, v=v: extra(q(t), v(t)), 1.0) for q, v in WAYS]


def alike(extra, by):
    return near(added(extra), by)


def moved(extra):
    """Return how far the motion moves when something is added to L."""
    path = one(lambda y, v, t: ball(y, v) + extra(y, v), 0.0, 1.0)
    return float(np.max(np.abs(path(t5)[0] - height(t5))))


# -- light, slides, films --------------------------------------------------------------------


@cache
def air():
    """Return the ray over 4 m above a road, n^2 = 1 + y / 5."""
    return one(lambda y, v, t: np.sqrt(1 + y / 5) * np.sqrt(1 + v**2), 1.0, 1.0, 4.0)


@cache
def slide():
    return one(lambda y, v, t: np.sqrt((1 + v**2) / (2 * G * y)), 0.05, 1.05, 2.0)


@cache
def film():
    return one(lambda y, v, t: y * np.sqrt(1 + v**2), np.cosh(1), np.cosh(1), 2.0)


def along(path, count=41):
    x = np.linspace(0, path.problem.duration, count)
    return x, path(x)[0], path.velocity(x)[0], path.acceleration(x)[0]


def snell():
    _, y, s, _ = along(air())
    return near(np.sqrt(1 + y / 5) / np.sqrt(1 + s**2), np.sqrt(1 + y[20] / 5), 1e-8)


def cycloid():
    x, y, s, _ = along(slide())
    a = y * (1 + s**2) / 2  # the wheel's radius
    angle = np.arccos(1 - y / a[0])
    angle = np.where(s < 0, 2 * np.pi - angle, angle)
    rolled = a[0] * (angle - np.sin(angle))
    return near(a, a[0], 1e-7) and near(rolled - rolled[0], x, 1e-7)


def hangs_lowest():
    """Compare a catenary with a parabola and a broken line of its length between its ends."""
    x = np.linspace(-1, 1, 20001)

    def length(y):
        return np.sum(np.hypot(np.diff(x), np.diff(y)))

    def centre(y):
        return np.sum((y[1:] + y[:-1]) / 2 * np.hypot(np.diff(x), np.diff(y))) / length(y)

    def of_length(shape, far):
        low, high = 0.0, 10.0
        for _ in range(60):
            k = (low + high) / 2
            low, high = (k, high) if length(k * shape) < far else (low, k)
        return k * shape

    chain = np.cosh(x) - np.cosh(1)
    others = [of_length(s, length(chain)) for s in (x**2 - 1, np.abs(x) - 1, np.cos(np.pi * x) - 1)]
    return all(centre(y) > centre(chain) + 1e-4 for y in others[:2] + [others[2]])


def mirror(angle, wiggle=0.0):
    """Return the length of the way from (-1/2, 0) over a circle of radius 1 to (1/2, 0).

    The first leg is bent to one side by `wiggle`.
    """
    m = np.array([np.cos(angle), np.sin(angle)])
    first, last = (np.linalg.norm(m - (x, 0.0)) for x in (-0.5, 0.5))
    return 2 * np.hypot(first / 2, wiggle) + last


# -- stones ----------------------------------------------------------------------------------

E, FAR, HIGH = 20.0, 2.2, 0.5
ROOT = np.sqrt(4 * E**2 - G * (G * FAR**2 + 4 * E * HIGH))
FLAT, STEEP = ((2 * E + s * ROOT) / (G * FAR) for s in (-1, 1))  # tangents of the angles


def arc(b):
    return (
        lambda x: b * x - G * (1 + b**2) * x**2 / (4 * E),
        lambda x: b - G * (1 + b**2) * x / (2 * E),
    )


def optical(y, s, x=0.0):
    return np.sqrt(2 * (E - G * y)) * np.sqrt(1 + s**2)


def rays():
    """Return whether both throws are rays, and a chord bent otherwise is none."""
    chord = (lambda x: HIGH / FAR * x, lambda x: HIGH / FAR + 0 * x)
    throws = all(stationary(optical, *arc(b), FAR) for b in (FLAT, STEEP))
    return throws and not stationary(optical, *chord, FAR)


def throws_touch_one_curve():
    x = np.linspace(0, 4 * E / G, 8001)
    above = [
        np.min(E / G - G * x**2 / (4 * E) - arc(np.tan(a))[0](x)) for a in np.radians([30, 50, 70])
    ]
    return near(above, 0.0, 1e-5) and min(above) > -1e-9


def flown(b, t):
    """Return the place of a stone of 1 kg after a time, thrown in a direction with the energy E."""
    v = np.sqrt(2 * E / (1 + b**2))
    return v * t, v * b * t - G * t**2 / 2


# -- what is least ---------------------------------------------------------------------------


def index(T):
    return one(spring, 1.0, 0.5, T).morse_index


def cost(n, T, m=2.0, k=3.0):
    """Return what the shape number n costs, of the height 1, and what two shapes share."""
    return [
        summed(
            lambda t, a=a: (
                m * bends(T)[n - 1][1](t) * bends(T)[a - 1][1](t) / 2
                - k * bends(T)[n - 1][0](t) * bends(T)[a - 1][0](t) / 2
            ),
            T,
        )
        for a in (n, n % 4 + 1)
    ]


def bent_spring():
    q, v = swing()
    eta, rate = bends(2.0)[1]
    S = bent(spring, q, v, 2.0, eta, rate)
    return near(S(0.7) - S(0.0), 0.49 * summed(lambda t: spring(eta(t), rate(t)), 2.0))


# -- forces, symmetries ----------------------------------------------------------------------


@cache
def on_rod():
    """Return m, l, and the rod pendulum's motion at equal times: t, q, v, force of constraint."""
    s = solved("rod_pendulum", tol=1e-10)
    t = np.linspace(0, s.problem.duration, 4001)
    values = s.problem.system.table.values(s.problem.parameters)
    return float(values["m"]), float(values["l"]), t, s(t), s.velocity(t), s.constraint_force(t)


def no_work_at_rest():
    *_, v, F = on_rod()
    return near(np.sum(F * v, axis=0), 0.0, 1e-6)


def work_of_wire():
    s = solved("turning_wire", tol=1e-10)
    t = np.linspace(0, s.problem.duration, 201)
    q, v, F, w = s(t), s.velocity(t), s.constraint_force(t), 1.5
    wire = w * np.stack([-q[1], q[0]])
    m = s.problem.system.table.values(s.problem.parameters)["m"]
    gained = m * np.sum(v[:, -1] ** 2 - v[:, 0] ** 2) / 2
    power = np.sum(F * wire, axis=0)
    return (
        near(power, np.sum(F * v, axis=0), 1e-6)
        and near(np.trapezoid(power, t), gained, 1e-4)
        and gained > 0.1
    )


def stationary_with_force():
    """Return whether S and the force's work on a bend cancel, for bends off the circle."""
    m, _, t, _, v, F = on_rod()
    sums = []
    for way in np.eye(2):
        for eta, rate in bends(t[-1], 2):
            of_S = m * (way @ v) * rate(t) - m * G * way[1] * eta(t)
            sums.append((np.trapezoid(of_S, t), np.trapezoid((way @ F) * eta(t), t)))
    return all(abs(a + b) < 1e-5 for a, b in sums) and max(abs(a) for a, _ in sums) > 1


def longer_rod():
    """Return whether S with a longer rod and the same angles grows by the pull's sum."""
    m, l, t, q, v, F = on_rod()

    def S(e):
        k = 1 + e / l  # the same angles at the same times
        return np.trapezoid(m * np.sum((k * v) ** 2, axis=0) / 2 - m * G * k * q[1], t)

    return near(slope(S), np.trapezoid(-np.sum(F * q, axis=0) / l, t), 1e-6)


def slope_with_end():
    def S(e):
        return one(spring, 1.0, 0.5 + e, 1.2).action

    path = one(spring, 1.0, 0.5, 1.2)
    return near(slope(S, 1e-2), path.momenta[1][0], 1e-6)


def shifted(e):
    """Return by how much S of the ball's motion changes that is lifted by e as a whole."""
    return summed(lambda t: ball(height(t) + e, rise(t)) - ball(height(t), rise(t)), 1.0)


def stepped(e, h=1e-6):
    """Return S of a free body that steps aside by e in a time h, and back at the end."""
    v, T = 1.3, 2.0
    return ((v * h + e) ** 2 + (v * h - e) ** 2) / (2 * h) + v**2 * (T - 2 * h) / 2 - e**2 / h


def free_of(name, k):
    """Return the momentum of a coordinate along a scene's motion."""
    s = solved(name, tol=1e-10)
    return s.momentum(np.linspace(0, s.problem.duration, 21))[k]


@cache
def on_cone(up):
    """Return p_r and p_phi of a bead on the inverted cone that starts up its side at a speed."""
    scene = scenes.get("inverted_cone")
    start = scene.problem.start.q
    s = solved("inverted_cone", tol=1e-10)
    v = s.velocity(0.0) + np.array([up, 0.0])
    path = ao.integrate(s.problem.system, ao.State(0.0, start, v), 1.0)
    t = np.linspace(0, 1, 21)
    return s.problem.system.momentum(path(t), path.velocity(t), t)


def lorentz(v):
    return -np.sqrt(1 - v**2)


def tangent(L, v):
    """Return the slope of L at v, and where its tangent meets the axis."""
    p = slope(lambda h: L(v + h), 1e-3)
    return p, L(v) - p * v


def rate_of_H():
    def H(v):
        p, meets = tangent(lorentz, v)
        return p, -meets

    (p0, H0), (p1, H1) = H(0.6 - 1e-4), H(0.6 + 1e-4)
    return near((H1 - H0) / (p1 - p0), 0.6, 1e-6)


def pendulums(p, T, q=0.4):
    """Return angles and momenta after a time of pendulums that start at q, m = g = l = 1."""
    system = ao.System(lambda q, v, t: v[0] ** 2 / 2 + np.cos(q[0]), ["theta"])
    paths = [ao.integrate(system, ao.State(0.0, [q], [x]), T) for x in p]
    return np.array([[float(a(T)[0]), float(a.velocity(T)[0])] for a in paths]).T


def first_focus(p, q=0.0):
    """Return when the neighbours of a pendulum that starts at q meet it first."""
    system = ao.System(lambda q, v, t: v[0] ** 2 / 2 + np.cos(q[0]), ["theta"])
    t = np.linspace(0.1, 5, 500)
    one, two = (ao.integrate(system, ao.State(0.0, [q], [x]), 5.0)(t)[0] for x in (p, p + 1e-4))
    return t[np.argmax(two < one)]


def upright(T):
    """Return how often neighbours of the swing stood upright before T, and its index."""
    t = np.linspace(0.01, T, 400)
    return int(np.sum(np.diff(np.sign(np.sin(t))) != 0)), index(T)


def arrows(S2, hbar=0.3, fade=1e-3):
    """Return the sum of exp(i S2 a^2 / (2 hbar)) over all bends a, faded out slowly far away."""
    return np.sqrt(np.pi / (fade - 1j * S2 / (2 * hbar)))


def two_bends():
    """Return whether the sum over both of 1 and -2 is the product of the sums over each."""
    a, fade = np.linspace(-9, 9, 401), 0.05
    one, two = (np.exp((1j * x - fade) * a**2) for x in (1, -2))
    return near(np.sum(one[:, None] * two), np.sum(one) * np.sum(two))


def leg(s, T=1.0):
    return np.sqrt(1 / (2j * np.pi * T)) * np.exp(1j * s**2 / (2 * T))


def kept_by_legs():
    """Return whether what is summed over all places has the whole probability of its start."""
    s = np.linspace(-12, 12, 601)
    h = s[1] - s[0]
    first = np.exp(-(s**2) / 2) / np.pi**0.25
    last = leg(s[:, None] - s[None]) @ first * h
    return near(np.sum(abs(last) ** 2) * h, 1.0, 1e-8)


def phase_of(y, d=0.7, a=2.0, m=1.3, T=0.9):
    """Return S over hbar = 1 of the ways through both slits."""
    return [m * (2 * a**2 + s**2 + (y - s) ** 2) / (2 * T) for s in (-d / 2, d / 2)]


BAND = 2 * np.pi * 0.9 / (1.3 * 0.7)


# -- lesson: words of it: whether they are so ------------------------------------------------

W = {
    "hunt": {
        "The motion is the path at which this number is stationary.": lambda: (
            stationary(ball, height, rise, 1.0)
            and abs(slope(lambda a: on_straight(bends(1.0)[0], a))) > 1
        ),
        "going a little higher gains exactly as much as it costs": lambda: near(
            summed(lambda t: rise(t) * bends(1.0)[0][1](t), 1.0),
            summed(lambda t: G * bends(1.0)[0][0](t), 1.0),
        ),
        "this path is the parabola that Newton's law gives": lambda: near(
            one(ball, 0.0, 1.0)(t5)[0], height(t5)
        ),
    },
    "first": {
        "a small bend of the motion changes S only to second order": lambda: stationary(
            ball, height, rise, 1.0
        ),
        "Half the bend, a quarter of the change.": lambda: all(
            near((S(0.2) - S(0.0)) / (S(0.4) - S(0.0)), 0.25)
            for S in (bent(ball, height, rise, 1.0, *b) for b in bends(1.0))
        ),
        "its slope is zero, and what is left goes with the square": lambda: stationary(
            spring, *swing(), 2.0
        ),
        "bent one way it rises, the other way it falls": lambda: all(
            on_straight(b, 0.01) * on_straight(b, -0.01) < 0 for b in bends(1.0)[::2]
        ),
        "all small bends change S to first order by nothing": lambda: stationary(
            spring, *swing(), 4.0
        ),
        "Stationary is not least. The next order tells, and it can have either sign.": lambda: (
            second(spring, *swing(), 4.0)[0, 0] < 0 < second(spring, *swing(), 2.0)[0, 0]
        ),
    },
    "local": {
        "If S of the whole path is stationary, so is S of each short piece.": lambda: piece_of(
            "pendulum", 0.2, 0.3
        ),
        "Two short pieces feel it, and no other.": lambda: (
            np.flatnonzero(pieces([0, 0.1, 0.3, 0.2, 0.5]) - pieces([0, 0.1, 0.35, 0.2, 0.5]))
            == [1, 2]
        ).all(),
        "dS/dx2 = m (x2 - x1) / h - m (x3 - x2) / h - h dV/dx2": lambda: near(
            slope(lambda e: three(0.4 + e)),
            (0.4 - 0.2) / 0.1 - (0.5 - 0.4) / 0.1 + 0.1 * np.sin(0.4),
        ),
        "dS/dx2 = -m (x3 - 2 x2 + x1) / h - h dV/dx2": lambda: near(
            slope(lambda e: three(0.4 + e)), -(0.5 - 0.8 + 0.2) / 0.1 + 0.1 * np.sin(0.4)
        ),
        "dS/dx2 = dL/dv1 - dL/dv2 + h dL/dx2": lambda: near(
            slope(
                lambda e: (
                    0.1 * any_law(0.2, (0.4 + e - 0.2) / 0.1)
                    + 0.1 * any_law(0.4 + e, (0.5 - 0.4 - e) / 0.1)
                )
            ),
            2.0 * 1.04 - 1.0 * 1.16 + 0.1 * (1.0 * 0.4 - 3 * 0.16),
            1e-7,
        ),
        "m (x3 - 2 x2 + x1) / h^2 = -dV/dx2": middle_obeys_newton,
        "m x'' = -dV/dx": lambda: near(slope(lambda e: rise(0.3 + e)), -slope(lambda e: G * e)),
        "In line 5 mass times acceleration stands on the left": lambda: (
            BY_NAME["local"].steps[4][1] == "m x'' = -dV/dx"
        ),
        "d/dt (dL/dv) = dL/dx": euler_and_lagrange,
        "It is the slope of S with the path, place by place.": missing_on_straight_line,
    },
    "minus": {
        "with T plus V the ball would fall upwards": lambda: near(
            one(lambda y, v, t: v**2 / 2 + G * y, 0.0, 1.0).acceleration(t5)[0], G, 1e-7
        ),
        "what is added to V everywhere alike changes no path": lambda: (
            moved(lambda y, v: 5.0) < 1e-8
        ),
        "Here L = T - (1 - 2 s) V.": lambda: (
            sagging(0.0) > 0.1 and near(sagging(0.5), 0.0) and near(sagging(1.0), -sagging(0.0))
        ),
        "the force less mass times acceleration": lambda: near(
            slope(lambda e: three(0.4 + e)) / 0.1, np.sin(0.4) - (0.5 - 0.8 + 0.2) / 0.01, 1e-7
        ),
        "the acceleration would be along the slope of V, uphill": lambda: (
            one(lambda y, v, t: v**2 / 2 + G * y, 0.0, 1.0).acceleration(0.5)[0] > 0
        ),
        "T is counted twice in p v": lambda: near(
            slope(lambda h: ball(0.3, 2.0 + h)) * 2.0, 2 * 2.0**2 / 2
        ),
        "so that the action of a period is zero": lambda: (
            abs(summed(lambda t: spring(*(f(t) for f in swing())), 2 * np.pi)) < 1e-9
        ),
        "slower with speed, by T / (m c^2), and faster with height, by V / (m c^2)": lambda: (
            # of the metric (1 + 2 g h / c^2) c^2 dt^2 - dx^2, to first order
            near((1 - np.sqrt(1 - 1e-6)) / (1e-6 / 2), 1.0, 1e-5)
            and near((np.sqrt(1 + 2e-6) - 1) / 1e-6, 1.0, 1e-5)
        ),
        "the one on which its own clock goes furthest ahead": lambda: (
            one(ball, 0.0, 1.0).kind == "minimum"  # of what the clock loses
        ),
        "T - V is not conserved": lambda: np.ptp(ball(height(t5), rise(t5))) > 1,
    },
    "gauge": {
        "S of every path rises by the same number, and no motion changes": lambda: (
            alike(lambda y, v: 6 * y * v, 3.0) and moved(lambda y, v: 6 * y * v) < 1e-8
        ),
        "its level places stay where they were, and a lowest place stays a lowest place": lambda: (
            near(
                second(ball, height, rise, 1.0),
                second(lambda y, v, t: ball(y, v) + 6 * y * v, height, rise, 1.0),
                1e-5,
            )
        ),
        "c y, which is no time derivative": lambda: (
            np.ptp(added(lambda y, v: 6 * y)) > 0.1 and moved(lambda y, v: 6 * y) > 0.1
        ),
        "is F at the end less F at the start, whatever the way between": lambda: alike(
            lambda y, v: (3 * y**2 + np.cos(y)) * v, 1 + np.sin(1)
        ),
        "What does change is the momentum, by the slope of F with x": lambda: near(
            one(lambda y, v, t: ball(y, v) + 6 * y * v, 0.0, 1.0).momentum(t5)[0]
            - one(ball, 0.0, 1.0).momentum(t5)[0],
            6 * height(t5),
            1e-7,
        ),
        "The kinetic energy of a ball seen from a train differs by just such a term": lambda: (
            alike(lambda y, v: ((v - 3) ** 2 - v**2) / 2, 4.5 - 3)
            and moved(lambda y, v: ((v - 3) ** 2 - v**2) / 2) < 1e-8
        ),
        "dS2/da = dS1/da": lambda: all(
            near(slope(bent(ball, *WAYS[0], 1.0, *b)), slope(bent(L, *WAYS[0], 1.0, *b)))
            for b in bends(1.0)
            for L in [lambda y, v, t: ball(y, v) + 6 * y * v]
        ),
    },
    "light": {
        "n / sqrt(1 + (dy/dx)^2) is conserved along the ray": snell,
        "the index grows with height and rays bend upwards": lambda: along(air())[3].min() > 0,
        "The answer is a cycloid.": cycloid,
        "the answer is the catenary": lambda: near(
            along(film())[1], np.cosh(along(film())[0] - 1), 1e-7
        ),
        "the chain makes its centre of mass as low as it can": hangs_lowest,
        "the number need not be least": lambda: (
            [ray.morse_index for ray in pictures.rays(pictures.CAR[0])] == [0, 1]
        ),
        "can be the slowest of those with one reflection": lambda: all(
            mirror(np.pi / 2) > mirror(np.pi / 2 + e) for e in (-0.5, -0.1, 0.1, 0.5)
        ),
        "Among all ways it is a saddle: a detour makes it slower still.": lambda: (
            mirror(np.pi / 2, 0.1) > mirror(np.pi / 2)
        ),
    },
    "stones": {
        "a stone goes the ways of light, in a glass whose index is as large as its speed": rays,
        "the integral of p ds is stationary": rays,
        "is that of the horizontal momentum, which is conserved": lambda: all(
            np.ptp(optical(arc(b)[0](x), 0.0) / np.sqrt(1 + arc(b)[1](x) ** 2)) < 1e-12
            for b in (FLAT, STEEP)
            for x in [np.linspace(0, FAR, 9)]
        ),
        "All throws of one energy touch one curve, the safety parabola": throws_touch_one_curve,
        "beyond it is darkness": lambda: (
            max(np.max(arc(np.tan(a))[0](2.0)) for a in np.linspace(0, 1.57, 2000))
            < E / G - G * 4 / (4 * E) + 1e-9
        ),
        "The steep throw has touched it on the way: it is a saddle, of index 1.": lambda: (
            2 * E / (G * STEEP) < FAR and downhill(second(optical, *arc(STEEP), FAR, 6)) == 1
        ),
        "The flat one is least.": lambda: (
            2 * E / (G * FLAT) > FAR and downhill(second(optical, *arc(FLAT), FAR, 6)) == 0
        ),
        "y = b x - g (1 + b^2) x^2 / (4 E)": lambda: near(
            arc(1.7)[0](flown(1.7, 0.4)[0]), flown(1.7, 0.4)[1]
        ),
        "b = 2 E / (g x)": lambda: near(
            slope(lambda e: arc(2 * E / (G * 1.5) + e)[0](1.5)), 0.0, 1e-8
        ),
        "y = E / g - g x^2 / (4 E)": lambda: near(
            arc(2 * E / (G * 1.5))[0](1.5), E / G - G * 1.5**2 / (4 * E)
        ),
    },
    "least": {
        "up to the first kinetic focus. Past it the action is a saddle.": lambda: (
            [index(T) for T in (1.0, 3.1, 3.2)] == [0, 0, 1]
        ),
        "all its motions meet again after half a period, wherever they have been": lambda: near(
            [swing(v0)[0](np.pi) for v0 in (-2.0, 0.0, 0.7)], -1.0
        ),
        "Up to the focus a bend always costs": lambda: (
            downhill(second(spring, *swing(), 3.1, 6))
            == 0
            < downhill(second(spring, *swing(), 3.2, 6))
        ),
        "Every further focus gives one more independent way down": lambda: (
            [index(T) for T in (6.2, 6.4, 9.4, 9.5)] == [1, 2, 2, 3]
        ),
        "a path with fast wiggles always costs more": lambda: all(
            np.linalg.eigvalsh(second(spring, *swing(), T, 8))[-1] > 0 for T in (2.0, 10.0, 20.0)
        ),
        "with finitely many ways down": lambda: (
            downhill(second(spring, *swing(), 10.0, 6))
            == downhill(second(spring, *swing(), 10.0, 9))
        ),
    },
    "string": {
        "S changes by the integral of m eta'^2 / 2 - k eta^2 / 2": bent_spring,
        "The shapes that do not mix are those of a guitar string.": lambda: all(
            abs(cost(n, 2.3)[1]) < 1e-9 for n in (1, 2, 3)
        ),
        "In a short string the tension wins.": lambda: cost(1, 1.0)[0] > 0 > cost(1, 4.0)[0],
        "a bend costs nothing, and that is the focus of the start": lambda: near(
            [cost(1, np.pi * np.sqrt(2 / 3))[0], swing(0.7, 0.0)[0](np.pi)], 0.0
        ),
        "So the index counts foci": lambda: all(
            index(T) == downhill(second(spring, *swing(), T, 6)) == int(T / np.pi)
            for T in (2.0, 4.0, 7.0, 10.0)
        ),
        "S_n = T s_n a^2 / 4, with s_n = m (n pi / T)^2 - k": lambda: all(
            near(cost(n, 2.3)[0], 2.3 * (2 * (n * np.pi / 2.3) ** 2 - 3) / 4) for n in (1, 2, 3)
        ),
        "T_n = n pi sqrt(m / k)": lambda: near(
            [cost(n, n * np.pi * np.sqrt(2 / 3))[0] for n in (1, 2, 3)], 0.0
        ),
        "A soft shape does not make the motion unstable": lambda: all(
            abs(swing(v0)[0](t) - swing(0.0)[0](t)) <= abs(v0) + 1e-12
            for v0 in (0.1, 1.0)
            for t in (3.2, 30.0, 300.0)
        ),
    },
    "push": {
        "S plus the integral of lambda f dt is, among all paths": stationary_with_force,
        "If the constraint rests, the force does no work on the motion.": no_work_at_rest,
        "the power is the force times the velocity of the wire": work_of_wire,
        "How much S gains by a longer rod, the pull tells: its sum over the time.": longer_rod,
        "the momentum at the end is the slope of S with the place of the end": slope_with_end,
        "dL2/depsilon = -lamda": longer_rod,
        "A multiplier of the wrong sign is a warning: a floor cannot pull.": lambda: (
            np.sum(np.diff(np.sign(solved("sliding_off_circle").multipliers(t75)[0])) != 0) == 1
        ),
    },
    "symmetry": {
        "p at the end less p at the start": lambda: near(slope(shifted), rise(1.0) - rise(0.0)),
        "So the two momenta are equal, and that for any two times.": lambda: (
            np.ptp(free_of("projectile", 0)) < 1e-9 < np.ptp(free_of("projectile", 1))
        ),
        "What does not depend on time has a conserved H": lambda: all(
            (np.ptp(s.energy(np.linspace(0, s.problem.duration, 21))) < 1e-8) == kept
            for name, kept in (("pendulum", True), ("driven_oscillator", False))
            for s in [solved(name, tol=1e-10)]
        ),
        "What may be turned has a conserved angular momentum.": lambda: (
            np.ptp(free_of("kepler_polar", 1)) < 1e-9 < np.ptp(free_of("kepler_polar", 0))
        ),
        "what may be turned and lifted together conserves that combination alone": lambda: (
            np.ptp(1.5 * free_of("screw", 0) + free_of("screw", 1)) < 1e-8
            and min(np.ptp(free_of("screw", k)) for k in (0, 1)) > 0.1
        ),
        "for a bead that circles steadily there, and for no other": lambda: (
            np.ptp(on_cone(0.0)[0]) < 1e-8 and min(np.ptp(on_cone(u)[0]) for u in (-0.5, 0.3)) > 0.1
        ),
        "its angular momentum is conserved on all": lambda: all(
            np.ptp(on_cone(u)[1]) < 1e-7 for u in (0.0, -0.5, 0.3)
        ),
        "p_1 = p_0": lambda: np.ptp(free_of("projectile", 0)) < 1e-9,
        "S_e = S + p_0 e - p_1 e": lambda: near(stepped(0.4), 1.3**2 + 1.3 * 0.4 - 1.3 * 0.4, 1e-5),
    },
    "slopes": {
        "where its tangent meets the axis of L stands -H": lambda: near(
            tangent(lorentz, 0.8), [4 / 3, -5 / 3]
        ),
        "the slope of H with p is v": rate_of_H,
        "where L bends upwards everywhere, for then each slope occurs once": lambda: np.all(
            np.diff([tangent(lorentz, v)[0] for v in np.linspace(-0.9, 0.9, 37)]) > 0
        ),
        "For a slow body p v is twice T, and H = T + V.": lambda: near(
            tangent(lambda v: v**2 - 5, 3.0), [2 * 9 / 3, -(9 + 5)]
        ),
        "L is no difference of T and V at all": lambda: (
            abs(lorentz(0.8) - (1 / np.sqrt(1 - 0.64) - 1)) > 0.1
        ),
        "The momentum is not always m v": lambda: abs(tangent(lorentz, 0.8)[0] - 0.8) > 0.1,
        "-H = L - p v": lambda: near(tangent(lambda v: v**2 - 5, 3.0)[1], 9 - 5 - 6 * 3.0),
        "dH/dp = v": rate_of_H,
    },
    "phase": {
        "a focus is where this line stands upright again": lambda: near(
            slope(lambda e: swing(0.3 + e)[0](np.pi)), 0.0
        ),
        "Each time the line of neighbours passes the upright the index grows by one.": lambda: all(
            len({*upright(T)}) == 1 for T in (2.0, 4.0, 7.0, 10.0)
        ),
        "On a spring all turn with one period, and the line stays straight.": lambda: near(
            np.diff([[f(1.7) for f in swing(v0)] for v0 in (0.0, 0.5, 1.0)], 2, axis=0), 0.0
        ),
        "A pendulum that swings wider is slower, so the line bends": lambda: (
            abs(np.linalg.det(np.diff(pendulums((0.2, 0.9, 1.6), 3.0), axis=1))) > 0.01
        ),
        "its parts stand upright one after the other": lambda: (
            np.pi < first_focus(0.3) < first_focus(0.8) < first_focus(1.3)
        ),
        "q = q_0 cos t + p_0 sin t": lambda: near(
            slope(lambda e: swing()[1](1.7 + e)), -swing()[0](1.7)
        ),
        "dq/dp_0 = sin t": lambda: near(slope(lambda e: swing(0.3 + e)[0](1.7)), np.sin(1.7)),
        "p = p_0 cos t - q_0 sin t": lambda: near(
            slope(lambda e: swing(0.3)[0](1.7 + e)), swing(0.3)[1](1.7)
        ),
    },
    "sum": {
        "the square root of 2 pi hbar / |S2|, turned by an eighth of a turn": lambda: all(
            near(abs(arrows(S2)), np.sqrt(2 * np.pi * 0.3 / abs(S2)), 1e-3)
            and near(np.degrees(np.angle(arrows(S2))), np.sign(S2) * 45, 1e-2)
            for S2 in (2.0, -2.0)
        ),
        "Where S has a slope, neighbours turn by different angles, and cancel.": lambda: (
            abs(np.mean(np.exp(1j * np.linspace(-60, 60, 4001)))) < 0.02
        ),
        "Past a focus one bend changes sides, and the sum turns by a quarter.": lambda: (
            cost(1, 2.5)[0] > 0 > cost(1, 2.6)[0]
            and near(np.degrees(np.angle(arrows(1.0) / arrows(-1.0))), 90, 1e-2)
        ),
        "Two bends that do not mix have a product of two sums: their angles add.": two_bends,
        "At a saddle of index 2 the sum is turned back by a quarter of a turn.": lambda: near(
            np.degrees(np.angle(arrows(-1.0) * arrows(-3.0))), -90, 1e-2
        ),
    },
    "slits": {
        "Where those of two slits are opposite it is dark": lambda: (
            abs(sum(np.exp(1j * np.array(phase_of(BAND / 2))))) < 1e-9
        ),
        "a whole turn from one bright band to the next": lambda: near(
            np.diff(phase_of(BAND)), -2 * np.pi
        ),
        "Close a slit, and the dark places between become brighter.": lambda: (
            abs(np.exp(1j * phase_of(BAND / 2)[0])) > 0.9
        ),
        "two legs, summed over all places between, make one of twice the time": lambda: near(
            leg(0.0) ** 2 * arrows(2.0, 1.0, 0.0), leg(0.0, 2.0)
        ),
        "all probabilities add up to one": kept_by_legs,
        "S = m (2 a^2 + s^2 + (y - s)^2) / (2 T)": lambda: near(
            phase_of(0.3)[1],
            1.3 * (2.0**2 + 0.35**2) / (2 * 0.9) + 1.3 * (2.0**2 + (0.3 - 0.35) ** 2) / (2 * 0.9),
        ),
        "S_2 - S_1 = m y d / T": lambda: near(
            phase_of(0.3)[0] - phase_of(0.3)[1], 1.3 * 0.3 * 0.7 / 0.9
        ),
        "y = 2 pi hbar T / (m d)": lambda: near(BAND * 1.3 * 0.7 / 0.9, 2 * np.pi),
    },
}


# What has a number or one of the words above in it, and says how something is named, what a reader
# is to do, what follows from what stands before, or what no calculation here decides.
UNMEASURED = """
Pull it twice and four times as far.
Then start from a path that is not the motion, and do the same.
The condition is called delta S = 0.
The arrow at each handle is the slope of S with that handle alone: it shows which way S falls.
The slope of S with the middle one has two parts, from T and from V: \
drag it until both arrows cancel.
S = m (x2 - x1)^2 / (2 h) + m (x3 - x2)^2 / (2 h) - h V(x2)
S = h L(x1,v1) + h L(x2,v2), with v1 = (x2 - x1) / h, with v2 = (x3 - x2) / h
T gives the second, V the first, and they must have opposite signs for the two to balance.
L2 = L1 + dF/dt
S2 = S1 + F(x(T),T) - F(x(0),0)
The same calculus finds the way of light, the fastest slide and the form of a soap film.
Press Solve from the straight line: there is another.
With the place along the ground as what runs, x, the Lagrangian is n(y) sqrt(1 + (dy/dx)^2).
The fastest slide between two points has as Lagrangian the time for each piece of the way, \
its length over the speed sqrt(2 g y) at the depth y.
Fermat says the same of the integral of n ds.
n = sqrt(2 (E - V))
n1 cos a1 = n2 cos a2
Bend the path, and slide the duration through half a period.
The whole tale, with pictures, is in \u201cIs it really least?\u201d
eta = a sin(n pi t / T)
The other way to see the force: make the rod longer by epsilon, \
with the same angles at the same times.
In x and y the paths must keep f(x, y) = 0.
What holds something is a slope of S with what is held.
L2 = L + lamda f
L2 = L + lamda (f - epsilon)
If S does not change when every path is shifted, something is conserved on the motions.
Open the pages of these scenes, and look which curves under Energy function and momenta are \
broad and straight.
Shift a motion a little, all of it and alike.
Constant on one motion is not conserved: conserved is what a symmetry keeps on all.
The slope of the tangent is p, and it meets the axis at -H.
It is known as well by its tangents: where that of the slope p meets the axis, for each p.
p = dL/dv
H = p v - L
In this plane two motions never cross, for q and p together decide what comes next.
S_e = S
sin t = 0
Make the constant of Planck smaller, and slide the duration past half a period.
Where S is stationary they turn alike and add up.
For everyday bodies S / hbar is so large that nothing else is left: the path of stationary action \
is seen, and no other.
So the index of a saddle can be seen, in light and in atoms: a quarter of a turn for each way down.
A way through a slit has two straight legs, and its arrow is turned by S / hbar.
Its ends curl up, and what is left is the straight way through the middle.
Normalisation: multiply by sqrt(m / (2 pi i hbar T)) for each leg.
m y d / T = 2 pi hbar
"""


def sentences(text):
    return re.split(r"(?<=[.?!:]) (?=[A-Z])", text)


def told(lesson):
    """Return what a lesson tells: sentences, and the formulas of its steps."""
    texts = [lesson.idea, *lesson.attempt, *lesson.observe, *lesson.explain, lesson.trap]
    return [x for text in texts for x in sentences(text)], [f for _, f in lesson.steps]


def test_every_claim_in_numbers_is_asked_for():
    assert {*W} == {lesson.name for lesson in LESSONS}
    left = set()
    for lesson in LESSONS:
        said, formulas = told(lesson)
        left |= {
            x
            for x in [*formulas, *(y for y in said if MARKED.search(y) and y[-1] != "?")]
            if not any(w in x or any(y in x for y in sentences(w)) for w in W[lesson.name])
        }
    assert left == set(UNMEASURED.strip().splitlines())


@pytest.mark.long
@pytest.mark.parametrize("name", W)
def test_what_a_lesson_says_is_so(name):
    said, formulas = told(BY_NAME[name])
    for words, holds in W[name].items():
        assert words in formulas or words in " ".join(said), words
        assert holds(), words


@pytest.mark.long
def test_the_claims_can_fail():
    assert not stationary(ball, *WAYS[2], 1.0) and not alike(lambda y, v: 6 * y, 3.0)
    assert not near(cost(1, 2.3)[0], 2.3 * (2 * (np.pi / 2.3) ** 2 + 3) / 4)
    assert upright(4.0) != (0, 1) and moved(lambda y, v: 6 * y) > 1e-8
