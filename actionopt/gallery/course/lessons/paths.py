"""Lessons on paths and their action: the hunt, the first order, and the law of each piece."""

from actionopt.gallery.course.lesson import Exercise, Lesson

HUNT = Lesson(
    "hunt",
    "The hunt for the motion",
    (5, 10, 10, 20),
    "Every path from here to there in a given time has a number, its action. The motion is the "
    "path at which this number is stationary.",
    predict=(
        "A ball of 1 kg is thrown over three metres and arrives, one metre higher, after one "
        "second. At every moment take its kinetic energy less its potential energy, and add these "
        "up over the second: that is the action S of the path, in joule seconds.",
        "Which way gives the smallest S: straight on, in a low arc, or in a high one? Write down "
        "your guess, and why, before you try.",
    ),
    attempt=(
        "Drag the handles and hunt for the path of smallest action. Keep the best S you find. A "
        "path that goes high gains by the potential energy at the top, and pays in kinetic energy "
        "on the way: there is a best compromise.",
    ),
    explain=(
        "To be high is worth something: potential energy takes from S, so time spent high makes S "
        "smaller. But to get there and back within the second takes speed, and kinetic energy adds "
        "to S. The best path is the one at which going a little higher gains exactly as much as it "
        "costs.",
        "For the ball this path is the parabola that Newton's law gives. Nobody told the hunt "
        "about forces: it only compared numbers of whole paths.",
    ),
    watch="Do all write down a guess before they drag? Ask for the best S of each group, and for "
    "its height halfway.",
    wrong="The straight line, because it is shortest; or the lowest arc, because it needs least "
    "energy.",
    trap="S belongs to the whole path, not to a moment; and both ends are fixed, time included.",
    explorer="projectile",
    parts=("hunt", "lagrangian"),
    scenes=("projectile",),
    exercises=(
        Exercise(
            "What is S of the straight line, flown at constant speed from (0, 0) to (3 m, 1 m)?",
            """\
m, g, T, x, y = 1.0, 9.81, 1.0, 3.0, 1.0
kinetic = m * (x**2 + y**2) / (2 * T**2)
potential = m * g * y / 2  # the mean over the way
straight = (kinetic - potential) * T
print("S =", straight, "J s")
""",
            "The kinetic energy is {kinetic:.4g} J all the time, the potential energy "
            "{potential:.4g} J in the mean. So S = {straight:.3g} J s.",
            "straight",
            "J s",
            label="S",
        ),
        Exercise(
            "Give the ball a vertical acceleration -a instead of -g, with the same ends. For which "
            "a is S smallest, and how small is it there?",
            """\
import numpy as np

m, g, T, x, y = 1.0, 9.81, 1.0, 3.0, 1.0
a = np.linspace(0, 20, 2001)
t = np.linspace(0, T, 401)[:, None]
height = (y / T + a * T / 2) * t - a * t**2 / 2
speed = (y / T + a * T / 2) - a * t
L = m * ((x / T) ** 2 + speed**2) / 2 - m * g * height
S = np.trapezoid(L, t, axis=0)
best, least = a[np.argmin(S)], S.min()
print("a =", best, "m/s^2, S =", least, "J s")
""",
            "At a = {best:.3g} m/s^2, which is g: S = {least:.4g} J s there.",
            "best",
            "m/s^2",
            label="a",
        ),
        Exercise(
            "Let the machine hunt. Which action does it find, and how high does the ball fly?",
            """\
import numpy as np

import actionopt as ao

ball = ao.System(lambda q, v, t: v @ v / 2 - 9.81 * q[1], ["x", "y"])
path = ao.solve(ao.Problem(ball, ao.Event(0.0, [0.0, 0.0]), ao.Event(1.0, [3.0, 1.0])))
action, top = path.action, path(np.linspace(0, 1, 10001))[1].max()
print("S =", action, "J s, top", top, "m")
""",
            "S = {action:.5g} J s, and {top:.4g} m: the parabola again.",
            "top",
            "m",
            label="height",
        ),
    ),
)

FIRST_ORDER = Lesson(
    "first",
    "To first order, nothing",
    (5, 10, 10, 20),
    "Stationary means: a small bend of the motion changes S only to second order. Half the bend, a "
    "quarter of the change.",
    predict=(
        "You have found the motion. Now bend it a little. Bend it twice as much: by which factor "
        "does the change of S grow?",
    ),
    attempt=(
        "Press Solve, pull one handle a little, and write down by how much S has grown. Pull "
        "it twice and four times as far. Then start from a path that is not the motion, and do the "
        "same.",
    ),
    explain=(
        "Near a lowest point every smooth curve is a parabola: its slope is zero, and what is left "
        "goes with the square. That is what makes the motion special among all paths. Elsewhere S "
        "has a slope, and a small bend changes it in proportion: bent one way it rises, the other "
        "way it falls, and so that path cannot be the motion.",
        "So one need not try all paths. It is enough that all small bends change S to first order "
        "by nothing. The condition is called delta S = 0.",
    ),
    watch="Let them divide the change by the square of the bend, and see that the quotient stays.",
    wrong="Twice the bend, twice the change: so it is where S has a slope, and nowhere else.",
    trap="Stationary is not least. The next order tells, and it can have either sign.",
    explorer="projectile",
    parts=("half", "bend"),
    scenes=("projectile", "oscillator"),
    exercises=(
        Exercise(
            "Bend the ball's parabola upwards by e sin(pi t / T). By how much does S rise for e = "
            "0.1 m, 0.2 m and 0.4 m?",
            """\
import numpy as np

m, g, T = 1.0, 9.81, 1.0
t = np.linspace(0, T, 20001)
y, vy = 5.905 * t - g * t**2 / 2, 5.905 - g * t


def action(e):
    height = y + e * np.sin(np.pi * t / T)
    speed = vy + e * np.pi / T * np.cos(np.pi * t / T)
    return np.trapezoid(m * (9 + speed**2) / 2 - m * g * height, t)


one, two, four = (action(e) - action(0) for e in (0.1, 0.2, 0.4))
print(one, two, four, "J s")
""",
            "By {one:.4g}, {two:.4g} and {four:.4g} J s: four times as much for each doubling.",
            "one",
            "J s",
            label="for e = 0.1 m",
        ),
        Exercise(
            "The same bends of the straight line, flown at constant speed: by how much does S "
            "change for e = 0.1 m and for e = -0.1 m?",
            """\
import numpy as np

m, g, T = 1.0, 9.81, 1.0
t = np.linspace(0, T, 20001)


def action(e):
    height = t + e * np.sin(np.pi * t / T)
    speed = 1 + e * np.pi / T * np.cos(np.pi * t / T)
    return np.trapezoid(m * (9 + speed**2) / 2 - m * g * height, t)


up, down = action(0.1) - action(0), action(-0.1) - action(0)
print(up, down, "J s")
""",
            "By {up:.3g} and {down:.3g} J s: it falls one way and rises the other. The straight "
            "line is not stationary.",
            "up",
            "J s",
            label="for e = 0.1 m",
        ),
        Exercise(
            "A mass of 1 kg on a spring of 1 N/m moves for 4 s. Its motion is bent by "
            "e sin(pi t / T). Does S rise or fall, and by how much for e = 0.1 m?",
            """\
import numpy as np

T, e = 4.0, 0.1
t = np.linspace(0, T, 20001)
eta, rate = e * np.sin(np.pi * t / T), e * np.pi / T * np.cos(np.pi * t / T)
change = np.trapezoid((rate**2 - eta**2) / 2, t)  # exact: S is quadratic in the path
print(change, "J s")
""",
            "It changes by {change:.3g} J s, and so falls: stationary, and yet not least.",
            "change",
            "J s",
        ),
    ),
)

LOCAL = Lesson(
    "local",
    "From the whole path to Newton",
    (5, 10, 15, 15),
    "If S of the whole path is stationary, so is S of each short piece. Of three neighbouring "
    "points the middle one obeys Newton's law.",
    predict=(
        "How can a ball know about its whole path? It cannot look ahead. Which property of a whole "
        "path could be checked piece by piece?",
    ),
    attempt=(
        "The arrow at each handle is the slope of S with that handle alone: it shows which way S "
        "falls. Pull each one along its arrow until the arrow is gone, and go round once more: "
        "where all of them are gone, the path is the motion.",
        "Press Solve, drag one handle, and look at the missing force: where is it not zero? Only "
        "near the handle that you moved.",
    ),
    observe=(
        "Now three places alone. The slope of S with the middle one has two parts, from T and from "
        "V: drag it until both arrows cancel. Then slide h: how does its height above the dashed "
        "line depend on h?",
    ),
    figure="three",
    explain=(
        "Take three places on the path, a time h apart, and move only the one in the middle. Two "
        "short pieces feel it, and no other.",
        "In line 5 mass times acceleration stands on the left, the force on the right. So a "
        "stationary whole is a row of stationary pieces, and each piece says no more than Newton's "
        "law.",
        "Where that law is not fulfilled, a force is missing. It is the slope of S with the path, "
        "place by place.",
    ),
    steps=(
        (
            "The action of the two pieces that x2 belongs to, with V taken where they meet:",
            "S = m (x2 - x1)^2 / (2 h) + m (x3 - x2)^2 / (2 h) - h V(x2)",
        ),
        (
            "Its slope with x2, term by term:",
            "dS/dx2 = m (x2 - x1) / h - m (x3 - x2) / h - h dV/dx2",
        ),
        ("The first two terms are one:", "dS/dx2 = -m (x3 - 2 x2 + x1) / h - h dV/dx2"),
        ("Stationary: the slope is zero. Divide by -h.", "m (x3 - 2 x2 + x1) / h^2 = -dV/dx2"),
        ("The steps made smaller, the fraction is the acceleration:", "m x'' = -dV/dx"),
        (
            "The same for any L, taken at the start of each piece:",
            "S = h L(x1,v1) + h L(x2,v2), with v1 = (x2 - x1) / h, with v2 = (x3 - x2) / h",
        ),
        (
            "x2 is in both velocities, and in the second place:",
            "dS/dx2 = dL/dv1 - dL/dv2 + h dL/dx2",
        ),
        (
            "Zero, and divided by h: the law of Euler and Lagrange.",
            "d/dt (dL/dv) = dL/dx",
        ),
    ),
    watch="Those who pull one handle only find its arrow back after the next one: go round "
    "several times.",
    wrong="The ball tries out all paths and takes the best; or it must know its end beforehand.",
    trap="The principle does not say that nature looks ahead. It is a law about pieces, in "
    "disguise.",
    scenes=("pendulum", "projectile"),
    explorer="projectile",
    parts=("missing", "slopes"),
    exercises=(
        Exercise(
            "A ball is at 0 m, and 0.1 s later at 0.5 m. Where is it after another 0.1 s?",
            """\
g, h = 9.81, 0.1
before, here = 0.0, 0.5
after = 2 * here - before - g * h**2
print(after, "m")
""",
            "At {after:.4g} m: as far again, less g h^2.",
            "after",
            "m",
        ),
        Exercise(
            "Go on like this for a pendulum of 1 m, from 0.5 rad at rest, for 1 s in 100 steps. "
            "How "
            "far off is the angle at the end?",
            """\
import numpy as np

import actionopt as ao

g, h, steps = 9.81, 0.01, 100
before = 0.5
here = before - h**2 * g * np.sin(before) / 2  # from rest
for _ in range(steps - 1):
    before, here = here, 2 * here - before - h**2 * g * np.sin(here)
pendulum = ao.System(lambda q, v, t: v[0] ** 2 / 2 + 9.81 * np.cos(q[0]), ["theta"])
exact = float(ao.integrate(pendulum, ao.State(0.0, [0.5], [0.0]), 1.0)(1.0)[0])
angle, off = here, abs(here - exact)
print(angle, "rad, off by", off)
""",
            "It is at {angle:.4f} rad, off by {off:.1g} rad. A hundred steps of three points each "
            "are already a good pendulum.",
            "off",
            "rad",
        ),
        Exercise(
            "Which force is missing all along the straight line of the ball of 1 kg?",
            """\
m, g = 1.0, 9.81
acceleration = 0.0  # of the straight line at constant speed
missing = m * acceleration + m * g
print(missing, "N, upwards")
""",
            "{missing:.3g} N upwards, its weight: someone would have to carry the ball.",
            "missing",
            "N",
        ),
    ),
)
