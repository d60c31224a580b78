"""The twenty questions on ideas: of three answers to each the first alone is true, as measured."""

import numpy as np
import pytest
import systems

from actionopt import Event, Problem, State, System, integrate, scenes, solve
from actionopt.gallery.course.concepts import QUESTIONS
from actionopt.gallery.course.lessons import BY_NAME

G = 9.81
ENDS = Event(0.0, [0.0, 0.0]), Event(1.0, [3.0, 1.0])


def integral(f, T=1.0):
    x, w = np.polynomial.legendre.leggauss(60)
    return T / 2 * w @ f(T * (1 + x) / 2)


def thrown(height, rate):
    """Return S of the ball of 1 kg on a path of its own."""
    return integral(lambda t: (9 + rate(t) ** 2) / 2 - G * height(t))


def bent(e, a=G):
    """Return the change of S as a throw of the acceleration -a is bent by e sin(pi t)."""
    y, v = lambda t: (1 + a / 2) * t - a * t**2 / 2, lambda t: 1 + a / 2 - a * t
    moved = thrown(
        lambda t: y(t) + e * np.sin(np.pi * t), lambda t: v(t) + e * np.pi * np.cos(np.pi * t)
    )
    return moved - thrown(y, v)


def wiggled(T, n):
    """Return the change of S as an oscillator of m = k = 1 is bent by sin(n pi t / T)."""
    w = n * np.pi / T
    return integral(lambda t: (w**2 * np.cos(w * t) ** 2 - np.sin(w * t) ** 2) / 2, T)


def ball(m=1.0, sign=1.0, add=0.0):
    law = System(lambda q, v, t: m * v @ v / 2 - sign * m * G * q[1] - add, ["x", "y"])
    return solve(Problem(law, *ENDS))


def lifted():
    """Return how much S changes with V, and how far the motion moves."""
    one, two = ball(), ball(add=5.0)
    t = np.linspace(0, 1, 21)
    return two.action - one.action, np.max(np.abs(one(t) - two(t)))


def gauged():
    """Return how far p and the motion move by d/dt (3 y^2)."""
    laws = [
        System(lambda q, v, t, c=c: v[0] ** 2 / 2 - G * q[0] + c * q[0] * v[0], ["y"])
        for c in (0.0, 6.0)
    ]
    one, two = (solve(Problem(law, Event(0.0, [0.0]), Event(1.0, [1.0]))) for law in laws)
    return abs(two.momentum(1.0) - one.momentum(1.0))[0], abs(two(0.4) - one(0.4))[0]


def water():
    x = np.linspace(0, 1, 100001)
    return x[np.argmin(np.hypot(x, 1) + 1.33 * np.hypot(1 - x, 1))]


def throws(x=2.2, y=0.5, E=20.0):
    """Return the tangents of the angles that hit, flat first, and their W = int 2 T dt."""
    b = np.sort(np.roots([-G * x**2 / (4 * E), x, -y - G * x**2 / (4 * E)]))
    b = b[np.isreal(b)].real
    t, up = x * np.sqrt((1 + b**2) / (2 * E)), b * np.sqrt(2 * E / (1 + b**2))
    return b, 2 * E * t - 2 * G * (up * t**2 / 2 - G * t**3 / 6)


def pull():
    """Return the pull of the rod at the lowest point, in weights."""
    path = solve(scenes.get("rod_pendulum").problem)
    t = np.linspace(0, 1, 10001)
    return np.linalg.norm(path.constraint_force(t[np.argmin(path(t)[1])])) / G


def carried():
    """Return the work of a turning wire on a bead on its way out, from rest along the wire."""
    spun = System(lambda q, v, t: (v[0] ** 2 + 4 * q[0] ** 2) / 2, ["r"])
    path = integrate(spun, State(0.0, [1.0], [0.0]), 1.0)
    r, v = path(1.0)[0], path.velocity(1.0)[0]
    return (v**2 + 4 * r**2 - 4) / 2


def momenta():
    path = ball()
    return path.momentum(1.0) - path.momentum(0.0)


def fast():
    """Return p v over the kinetic energy, slow and fast."""
    law = System(lambda q, v, t: -np.sqrt(1 - v[0] ** 2), ["x"])
    p = law.momentum([[0.0, 0.0]], [[0.01, 0.8]], 0.0)[0]
    v = np.array([0.01, 0.8])
    return p * v / (1 / np.sqrt(1 - v**2) - 1)


def patch():
    """Return the area of a patch of pendulums after 3 s, in parts of the first."""
    law = systems.pendulum()
    corners = [(0.4, 1.2), (0.401, 1.2), (0.4, 1.201)]
    paths = [integrate(law, State(0.0, [q], [p]), 3.0) for q, p in corners]
    at, right, up = (np.array([x(3.0)[0], x.velocity(3.0)[0]]) for x in paths)
    return np.linalg.det(np.stack([right - at, up - at])) / 1e-6


def turned():
    """Return by how many degrees the sum over a bend turns as its second order changes sign."""
    a = np.linspace(-60, 60, 400001)
    sums = [np.sum(np.exp((0.5j * s - 1e-3) * a**2)) for s in (1, -1)]
    return np.degrees(np.angle(sums[1] / sums[0]))


def slits():
    """Return the brightness of a dark place, with both slits and with one; m = hbar = 1."""
    arrows = np.exp(1j * np.array([0.0, np.pi]))
    return abs(arrows.sum()) ** 2, abs(arrows[0]) ** 2


def period():
    """Return S, and the energy times the period, of x = cos t."""
    S = integral(lambda t: (np.sin(t) ** 2 - np.cos(t) ** 2) / 2, 2 * np.pi)
    return S, np.pi


def index():
    law = systems.oscillator()
    return solve(Problem(law, Event(0.0, [1.0]), Event(10.0, [0.5]))).morse_index


def near(x, y, error=1e-6):
    return abs(x - y) < error


# Name: what is measured, and what each answer claims of it.
CLAIMS = {
    "twice": (lambda: bent(0.2) / bent(0.1), (lambda x: near(x, 4), lambda x: near(x, 2),
              lambda x: near(x, 0))),
    "sides": (lambda: (bent(0.05, 0), bent(-0.05, 0)), (lambda x: x[0] * x[1] < 0,
              lambda x: min(x) > 0, lambda x: max(x) < 0)),
    "zero": (lifted, (lambda x: near(x[0], -5) and near(x[1], 0), lambda x: x[1] > 1e-3,
             lambda x: near(x[0], 0))),
    "plus": (lambda: ball(sign=-1.0)(0.5)[1] - 0.5, (lambda x: x < -0.1,
             lambda x: near(x, G / 8), lambda x: near(x, 0))),
    "heavy": (lambda: ball(2.0)(0.5)[1] - ball()(0.5)[1], (lambda x: near(x, 0),
              lambda x: x < -1e-3, lambda x: x > 1e-3)),
    "period": (period, (lambda x: near(x[0], 0), lambda x: near(*x), lambda x: x[0] < -1e-3)),
    "gauge": (gauged, (lambda x: near(x[0], 6) and near(x[1], 0), lambda x: near(max(x), 0),
              lambda x: min(x) > 1e-3)),
    "water": (water, (lambda x: 0.51 < x < 0.99, lambda x: near(x, 0.5, 0.01),
              lambda x: near(x, 1, 0.01))),
    "two": (lambda: len(throws()[0]), (lambda x: x == 2, lambda x: x == 1, lambda x: x > 2)),
    "steep": (lambda: np.diff(throws()[1])[0], (lambda x: x > 0.1, lambda x: x < -0.1,
              lambda x: near(x, 0))),
    "saddle": (lambda: (wiggled(4.0, 1), wiggled(4.0, 5)), (lambda x: x[0] < 0 < x[1],
               lambda x: min(x) >= 0, lambda x: max(x) <= 0)),
    "index": (index, (lambda x: x == 3, lambda x: x == 1, lambda x: x > 3)),
    "soft": (lambda: wiggled(np.pi, 1), (lambda x: near(x, 0), lambda x: x > 1e-3,
             lambda x: x < -1e-3)),
    "bottom": (pull, (lambda x: x > 1.01, lambda x: near(x, 1), lambda x: x < 0.99)),
    "wire": (carried, (lambda x: x > 0.1, lambda x: near(x, 0), lambda x: x < -0.1)),
    "flight": (momenta, (lambda x: near(x[0], 0) and not near(x[1], 0),
               lambda x: near(np.max(np.abs(x)), 0), lambda x: not near(x[0], 0))),
    "fast": (fast, (lambda x: near(x[0], 2, 1e-3) and x[1] < 1.9, lambda x: near(x[1], 2, 1e-3),
             lambda x: x[1] > 2.1)),
    "patch": (patch, (lambda x: near(x, 1, 0.01), lambda x: x > 1.01, lambda x: x < 0.99)),
    "turn": (turned, (lambda x: near(x, -90, 1), lambda x: near(abs(x), 180, 1),
             lambda x: near(x, 0, 1))),
    "closed": (slits, (lambda x: x[1] > x[0] + 0.1, lambda x: x[1] < x[0] - 0.1,
               lambda x: near(*x))),
}  # fmt: skip


def test_each_question_has_three_answers_and_a_lesson():
    assert [x.name for x in QUESTIONS] == list(CLAIMS) and len(QUESTIONS) == 20
    assert all(x.lesson in BY_NAME and len(x.answers) == 3 for x in QUESTIONS)


@pytest.mark.slow
@pytest.mark.parametrize("name", CLAIMS)
def test_the_first_answer_alone_is_true(name):
    measure, claims = CLAIMS[name]
    x = measure()
    assert [bool(claim(x)) for claim in claims] == [True, False, False], x
