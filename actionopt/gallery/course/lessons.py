"""The nine lessons."""

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
t = np.linspace(0, T, 201)[:, None]
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
    (5, 10, 15, 20),
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
    explain=(
        "Take three places on the path, a time h apart: before, here and after. Move only the one "
        "in the middle, here. The action of the two short pieces is about "
        "m (here - before)^2 / (2 h) + m (after - here)^2 / (2 h) - h V(here).",
        "Its slope in the middle place is zero if m (after - 2 here + before) / h^2 is the force, "
        "minus the slope of V. On the left is mass times acceleration. So a stationary whole is a "
        "row of stationary pieces, and each piece says no more than Newton's law.",
        "Where that law is not fulfilled, a force is missing. It is the slope of S with the path, "
        "place by place.",
    ),
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

T_MINUS_V = Lesson(
    "minus",
    "Why T minus V?",
    (5, 5, 15, 20),
    "The sign is no mystery: with T plus V the ball would fall upwards. And what is added to V "
    "everywhere alike changes no path.",
    predict=(
        "Energy is T plus V. The action has T minus V. What would happen in a world in which the "
        "sum T + V were stationary? Sketch the ball's path there.",
    ),
    attempt=(
        "Here L = T - (1 - 2 s) V. Press Solve, and slide s from 0 to 1, from T - V to T + V: when "
        "is the path straight, and how does it hang then? Slide the mass, which is in T and V "
        "alike: does the path change?",
    ),
    explain=(
        "From the lesson before: the slope of S with the middle place is the force less mass times "
        "acceleration. T gives the second, V the first, and they must have opposite signs for the "
        "two to balance. With a plus the acceleration would be along the slope of V, uphill.",
        "For the conserved energy the signs are equal, and that is no contradiction: "
        "energy is p v less L, and T is counted twice in p v. For a mass on a spring T and V have "
        "the same mean over a period, so that the action of a period is zero, though the energy is "
        "not.",
        "Deeper reasons exist. A clock that is moved and lifted shows a different time: it goes "
        "slower with speed, by T / (m c^2), and faster with height, by V / (m c^2). So T - V is, "
        "but for a factor, what the clock of the ball loses, and the ball's free flight is the one "
        "on "
        "which its own clock goes furthest ahead.",
    ),
    trap="T - V is not conserved and is not an energy that the body has.",
    scenes=("projectile", "oscillator"),
    explorer="minus",
    parts=("parameters",),
    exercises=(
        Exercise(
            "Solve for the ball with L = T + V. How far below or above the straight line is it "
            "halfway?",
            """\
import actionopt as ao

wrong = ao.System(lambda q, v, t: v @ v / 2 + 9.81 * q[1], ["x", "y"])
path = ao.solve(ao.Problem(wrong, ao.Event(0.0, [0.0, 0.0]), ao.Event(1.0, [3.0, 1.0])))
below = 0.5 - float(path(0.5)[1])
print("halfway it is", below, "m below the straight line")
""",
            "{below:.4g} m below: it falls upwards, and has to be thrown downwards.",
            "below",
            "m",
            label="below the straight line",
        ),
        Exercise(
            "A mass on a spring moves as x = cos(t), in SI units with m = k = 1. What are the "
            "means "
            "of T and V over a period, and what is S of a whole period?",
            """\
import numpy as np

t = np.linspace(0, 2 * np.pi, 20001)
T, V = np.sin(t) ** 2 / 2, np.cos(t) ** 2 / 2
kinetic, potential = (np.trapezoid(E, t) / (2 * np.pi) for E in (T, V))
S = round(np.trapezoid(T - V, t), 12) + 0.0  # without round-off
print(kinetic, potential, "J, S =", S, "J s")
""",
            "{kinetic:.4g} J and {potential:.4g} J: the same, and so S = {S:.0f} J s.",
            "S",
            "J s",
            label="S of a period",
        ),
        Exercise(
            "Add 5 J to V everywhere. By how much does S of the ball change, and its path?",
            """\
import numpy as np

import actionopt as ao

ends = ao.Event(0.0, [0.0, 0.0]), ao.Event(1.0, [3.0, 1.0])
first, second = (
    ao.solve(ao.Problem(ao.System(lambda q, v, t: v @ v / 2 - 9.81 * q[1] - c, ["x", "y"]), *ends))
    for c in (0.0, 5.0)
)
change = second.action - first.action
t = np.linspace(0, 1, 101)
apart = float(np.max(np.abs(first(t) - second(t))))
print(change, "J s;", apart, "m")
""",
            "S changes by {change:.4g} J s, for every path alike. The path does not change: where "
            "the zero of V is makes no difference.",
            "change",
            "J s",
            label="change of S",
        ),
    ),
)

LIGHT = Lesson(
    "light",
    "Light first",
    (5, 5, 20, 25),
    "The same calculus finds the way of light, the fastest slide and the form of a soap film. "
    "Time, "
    "or an area, takes the place of the action.",
    predict=(
        "A swimmer at the edge of the sea calls for help, and you stand on the sand. You run "
        "faster "
        "than you swim. Do you go straight?",
        "Light from the sky meets the hot air above a road, in which it is faster than higher up. "
        "Which way does it bend?",
    ),
    attempt=(
        "Bend the ray over the hot road, and look at its optical length. Press Solve from the "
        "straight line, then pull the middle far down and press Solve again: there are two rays. "
        "Along which of them do you see the sky?",
    ),
    explain=(
        "Fermat: between two points light takes a way whose time is stationary. With the place "
        "along the ground as what runs, x, the Lagrangian is n(y) sqrt(1 + y'^2). It does not "
        "contain x, so n / sqrt(1 + y'^2) is conserved along the ray: that is Snell's law in a "
        "layered air. Above a hot road the index grows with height and rays bend upwards: the sky "
        "is seen "
        "in the road, a mirage.",
        "The fastest slide between two points has as Lagrangian the time for each piece of the "
        "way, its length over the speed sqrt(2 g y) at the depth y. The answer is a cycloid. A "
        "soap "
        "film between two rings makes its area stationary, L = y sqrt(1 + y'^2), and the answer is "
        "the catenary, the curve of a hanging chain, y = c cosh(x / c): the chain makes its centre "
        "of "
        "mass as low as it can.",
        "In all of these the thing that runs need not be time, and the number need not be least. A "
        "ray in a hollow mirror can be the slowest of those with one reflection. Among all ways it "
        "is a saddle: a detour makes it slower still.",
    ),
    trap="Fermat's principle too says stationary: light does not look for the fastest way.",
    explorer="mirage",
    exercises=(
        Exercise(
            "Light goes from 1 m above the water to 1 m below it, and 1 m sideways; it is 1.33 "
            "times slower in the water. Where does it cross, and what is the ratio of the sines?",
            """\
import numpy as np

n = 1.33
x = np.linspace(0, 1, 1_000_001)  # where it crosses
time = np.hypot(x, 1) + n * np.hypot(1 - x, 1)
cross = x[np.argmin(time)]
ratio = (cross / np.hypot(cross, 1)) / ((1 - cross) / np.hypot(1 - cross, 1))
print(cross, "m", ratio)
""",
            "It crosses at {cross:.3f} m, past the middle, and the sines are as {ratio:.3f} to 1: "
            "Snell's law.",
            "cross",
            "m",
            label="place of crossing",
        ),
        Exercise(
            "Above a road n^2 = 1 + y / 5, with y in metres. Light goes over 4 m from 1 m to "
            "1 m of height. How far does it dip?",
            """\
import numpy as np

import actionopt as ao

air = ao.System(lambda q, v, t: np.sqrt(1 + q[0] / 5) * np.sqrt(1 + v[0] ** 2), ["y"])
ray = ao.solve(ao.Problem(air, ao.Event(0.0, [1.0]), ao.Event(4.0, [1.0])))
dip = 1 - float(ray(2.0)[0])
print(dip, "m")
""",
            "By {dip:.4g} m. The ray is a parabola, as that of a stone; only that it bends "
            "upwards.",
            "dip",
            "m",
        ),
        Exercise(
            "A bead slides from a speed of 1 m/s without friction, 1 m down and 2 m sideways, with "
            "g = 9.81 m/s^2. How much faster than the straight slide is the best one?",
            """\
import numpy as np

import actionopt as ao

g, first = 9.81, 1 / (2 * 9.81)  # the depth below rest at which the speed is 1 m/s
slide = ao.System(lambda q, v, t: np.sqrt((1 + v[0] ** 2) / (2 * 9.81 * q[0])), ["y"])
best = ao.solve(ao.Problem(slide, ao.Event(0.0, [first]), ao.Event(2.0, [first + 1])))
fast = best.action
a = g / np.hypot(1, 2)  # along the straight slide
straight = (-1 + np.sqrt(1 + 2 * a * np.hypot(1, 2))) / a
print(fast, "s instead of", straight, "s")
""",
            "It takes {fast:.4g} s instead of {straight:.4g} s. It falls first, to be fast early.",
            "fast",
            "s",
            label="time of the best slide",
        ),
    ),
)

LEAST_OR_NOT = Lesson(
    "least",
    "Least or not?",
    (5, 15, 10, 15),
    "A motion is least only if it is short enough: up to the first kinetic focus. Past it the "
    "action is a saddle.",
    predict=("Is the action of a mass on a spring least for a whole swing? For two?",),
    attempt=(
        "Bend the path, and slide the duration through half a period. When does the same bend "
        "begin "
        "to cost less? The whole tale, with pictures, is in \u201cIs it really least?\u201d",
    ),
    explain=(
        "Let the mass leave with different velocities: all its motions meet again after half a "
        "period, wherever they have been. That event is the focus of the start. Up to the focus a "
        "bend always costs; past it one can follow a neighbour as far as the focus and then cut "
        "the "
        "corner. Every further focus gives one more independent way down, and their number is "
        "the Morse index.",
        "The action is never a maximum: a path with fast wiggles always costs more, for the "
        "kinetic energy grows with the square of their frequency.",
    ),
    trap="Not a maximum: past a focus it is a saddle, with finitely many ways down.",
    explorer="oscillator",
    parts=("bend", "wave"),
    scenes=("oscillator", "hoop_bead", "heavy_top"),
    exercises=(
        Exercise(
            "When do the motions of a mass of 2 kg on a spring of 18 N/m meet again?",
            """\
import actionopt as ao

spring = ao.System(lambda q, v, t: 2 * v[0] ** 2 / 2 - 18 * q[0] ** 2 / 2, ["x"])
path = ao.solve(ao.Problem(spring, ao.Event(0.0, [1.0]), ao.Event(1.5, [0.5])))
focus = ao.conjugate_points(path)[0].t
print(focus, "s")
""",
            "After {focus:.4g} s, half a period.",
            "focus",
            "s",
        ),
        Exercise(
            "With m = k = 1 in SI units, what is the Morse index of a motion of 10 s?",
            """\
import actionopt as ao

spring = ao.System(lambda q, v, t: (v[0] ** 2 - q[0] ** 2) / 2, ["x"])
path = ao.solve(ao.Problem(spring, ao.Event(0.0, [1.0]), ao.Event(10.0, [0.5])))
index = path.morse_index
print(index)
""",
            "{index}: three multiples of pi fit into 10.",
            "index",
        ),
        Exercise(
            "On a ball the shortest ways are great circles. Is one of 200 degrees along the "
            "equator "
            "least, and what is its index?",
            """\
import numpy as np

import actionopt as ao

ball = ao.System(
    lambda q, v, t: (v[0] ** 2 + np.cos(q[0]) ** 2 * v[1] ** 2) / 2, ["latitude", "longitude"]
)
far = np.radians(200)
start, end = ao.Event(0.0, [0.0, 0.0]), ao.Event(1.0, [0.0, far])
path = ao.solve(ao.Problem(ball, start, end), guess=lambda t: np.stack([0 * t, far * t]))
index, focus = path.morse_index, np.degrees(far * ao.conjugate_points(path)[0].t)
print(index, focus)
""",
            "No: its index is {index}. The focus is the opposite point, at {focus:.4g} degrees; "
            "past it the other way round is shorter.",
            "index",
            label="index",
        ),
    ),
)

PUSH = Lesson(
    "push",
    "Constraints push",
    (5, 10, 15, 20),
    "What keeps a bead on its wire is a force. Compare only paths that keep to the wire, and the "
    "force comes out as a multiplier.",
    predict=(
        "A pendulum's bob is at the lowest point of its swing. Does the rod pull with the weight, "
        "with less, or with more?",
        "A wire turns and takes a bead along. Can a force that is always across the wire do work?",
    ),
    attempt=(
        "The path below is one of x and y, and its handles stay on the circle: pull one, and the "
        "other coordinate follows. No paths but these are compared.",
        "Watch the arrows in the films of the pendulum with its rod, of the mass on a circle, and "
        "of "
        "the turning wire. When are they longest? When do they turn round?",
    ),
    explain=(
        "A coordinate that fits the constraint, such as the angle, leaves no force to be seen. In "
        "x "
        "and y the paths must keep f(x, y) = 0. Among these alone S is stationary, and so S plus "
        "the integral of lambda f dt is, among all paths, for the right lambda(t).",
        "Its equations have a force more, lambda times the gradient of f: across the surface, as "
        "large as it has to be. If the constraint rests, the force does no work on the motion. If "
        "it moves, as the wire does, it may: the power is the force times the velocity of the "
        "wire.",
        "A multiplier of the wrong sign is a warning: a floor cannot pull. There the body leaves.",
    ),
    trap="A force of constraint is not given beforehand: it is found together with the motion.",
    scenes=("rod_pendulum", "polar_pendulum", "sliding_off_circle", "turning_wire"),
    explorer="rod_pendulum",
    parts=("picture",),
    exercises=(
        Exercise(
            "How hard does the rod of the scene rod_pendulum pull at the lowest point, in parts of "
            "the weight?",
            """\
import numpy as np

import actionopt as ao
from actionopt import scenes

path = ao.solve(scenes.get("rod_pendulum").problem)
t = np.linspace(0, 1, 100001)
lowest = t[np.argmin(path(t)[1])]
pull = float(np.linalg.norm(path.constraint_force(lowest)))
speed = float(np.linalg.norm(path.velocity(lowest)))
weight, parts = 9.81, pull / 9.81
print(pull, "N", parts, speed)
""",
            "With {pull:.4g} N, {parts:.3g} times the weight: it carries that and turns a velocity "
            "of {speed:.3g} m/s round.",
            "parts",
        ),
        Exercise(
            "At which angle does a mass leave a ball that it slides down, from rest at the top?",
            """\
import numpy as np

import actionopt as ao
from actionopt import scenes

path = ao.solve(scenes.get("sliding_off_circle").problem)
t = np.linspace(0, 0.75, 100001)
normal = path.multipliers(t)[0]
angle = float(np.degrees(np.interp(0, -normal, path(t)[1])))
print(angle, "degrees")
""",
            "At {angle:.4g} degrees, where the cosine is two thirds.",
            "angle",
            "degrees",
        ),
        Exercise(
            "How much work does the wire of the scene turning_wire do on the bead?",
            """\
import actionopt as ao
from actionopt import scenes

path = ao.solve(scenes.get("turning_wire").problem)
work = float(path.energy(1.0) - path.energy(0.0))
print(work, "J")
""",
            "{work:.3g} J: all of it goes into the kinetic energy, for there is no potential.",
            "work",
            "J",
        ),
    ),
)

SYMMETRY = Lesson(
    "symmetry",
    "From symmetry to what is conserved",
    (5, 5, 15, 20),
    "If S does not change when every path is shifted, something is conserved on the motions. That "
    "is Noether's theorem, seen at the ends.",
    predict=(
        "A ball flies without air. Which of its momenta stays the same, and how can that be seen "
        "in its Lagrangian, before anything is solved?",
    ),
    attempt=(
        "Press Solve, pull the path aside along x, and then upwards, and look at the missing "
        "force in each coordinate. Slide g: which of the two momenta can notice?",
        "Open the pages of these scenes, and look which curves under Energy function and momenta "
        "are broad and straight. Which letter is missing in the Lagrangian each time?",
    ),
    explain=(
        "Shift a motion a little, all of it and alike. Its S changes by the momenta at the two "
        "ends "
        "times the shift, p at the end less p at the start: in between it is stationary. If L "
        "does not contain the coordinate, S does not change at all. So the two momenta are "
        "equal, and that for any two times.",
        "What does not depend on time has a conserved H, by shifting the clock. What may be turned "
        "has a conserved angular momentum. And what may be turned and lifted together conserves "
        "that combination alone.",
        "The other way round, a momentum that happens not to change on one motion is no law. The "
        "momentum up the side of a cone is constant, zero, for a bead that circles steadily there, "
        "and for no other; its angular momentum is conserved on all.",
    ),
    trap="Constant on one motion is not conserved: conserved is what a symmetry keeps on all.",
    scenes=("projectile", "kepler_polar", "screw", "inverted_cone"),
    explorer="projectile",
    parts=("missing", "parameters"),
    exercises=(
        Exercise(
            "Kepler's planet of the scene kepler: what is its angular momentum at the start and at "
            "the end?",
            """\
import actionopt as ao
from actionopt import scenes

scene = scenes.get("kepler")
path = ao.solve(scene.problem, guess=scene.guess)
(x, y), (u, w) = path.start.q, path.start.v
first = float(x * w - y * u)
(x, y), (u, w) = path.end.q, path.end.v
last = float(x * w - y * u)
print(first, last, "m^2/s")
""",
            "{first:.6g} and {last:.6g} m^2/s: equal areas in equal times.",
            "first",
            "m^2/s",
        ),
        Exercise(
            "In the scene screw neither p_phi nor p_z is conserved. By how much do they change, "
            "and by how much does c p_phi + p_z with c = 1.5 / m?",
            """\
import actionopt as ao
from actionopt import scenes

path = ao.solve(scenes.get("screw").problem)
before, after = path.momenta
one, two = (float(x) for x in after - before)
both = abs(1.5 * one + two)
print(one, two, both)
""",
            "By {one:.3g} J s and {two:.3g} N s; the combination by {both:.0e} N s, which is "
            "round-off.",
            "one",
            "J s",
            label="change of p_phi",
        ),
        Exercise(
            "A free particle of 2 kg goes 3 m in 1.5 s. The end is moved by 1 cm. By how much does "
            "S "
            "change, to first order, and what is that per centimetre?",
            """\
m, d, T = 2.0, 3.0, 1.5
S = m * d**2 / (2 * T)
change = m * (d + 0.01) ** 2 / (2 * T) - S
p = m * d / T
print(change, "J s, p dx =", p * 0.01, "J s")
""",
            "By {change:.4g} J s, which is p times the shift, {p:.3g} N s times 0.01 m, to first "
            "order: the momentum is the slope of S with the end.",
            "change",
            "J s",
            label="change of S",
        ),
    ),
)

SUM = Lesson(
    "sum",
    "The sum over paths",
    (5, 10, 15, 20),
    "Why should nature care about a stationary number? In quantum mechanics all paths count, each "
    "with an arrow that turns with S. Only near a stationary path do the arrows agree.",
    predict=(
        "Add a thousand arrows of length one that point in all directions: how long is the sum? "
        "And if fifty of them point the same way?",
    ),
    attempt=(
        "Look at the arrows of neighbouring paths, laid end to end: near the motion they make a "
        "long step, far from it they curl up. Make the constant of Planck smaller, and slide the "
        "duration past half a period.",
    ),
    explain=(
        "Each path has an arrow that has turned by the angle S / hbar. Where S has a slope, "
        "neighbours turn by different angles, and cancel. Where S is stationary they turn alike "
        "and "
        "add up. For everyday bodies S / hbar is so large that nothing else is left: the path of "
        "stationary action is seen, and no other.",
        "With S = S* + S2 a^2 / 2 for a bend of the size a, the arrows add up to the square root "
        "of "
        "2 pi hbar / |S2|, turned by an eighth of a turn: forwards if bends cost action, "
        "backwards "
        "if they gain. Past a focus one bend changes sides, and the sum turns by a quarter.",
        "So the index of a saddle can be seen, in light and in atoms: a quarter of a turn for each "
        "way down.",
    ),
    trap="The particle does not choose one of the paths: all of them count.",
    scenes=("oscillator",),
    explorer="oscillator",
    exercises=(
        Exercise(
            "Add the arrows exp(i S2 a^2 / (2 hbar)) with S2 = 1, hbar = 1 over all bends a. How "
            "long is the sum, and at which angle?",
            """\
import numpy as np

a = np.linspace(-60, 60, 2_000_001)
arrows = np.exp(1j * a**2 / 2 - 1e-3 * a**2)  # faded out, slowly, far away
total = np.sum(arrows) * (a[1] - a[0])
length, angle = abs(total), np.degrees(np.angle(total))
print(length, angle)
""",
            "{length:.4g}, nearly the square root of 2 pi, at {angle:.3g} degrees.",
            "length",
            label="length of the sum",
        ),
        Exercise(
            "The same with S2 = -1, as for the bend that costs less past the first focus.",
            """\
import numpy as np

a = np.linspace(-60, 60, 2_000_001)
total = np.sum(np.exp(-1j * a**2 / 2 - 1e-3 * a**2)) * (a[1] - a[0])
length, angle = abs(total), np.degrees(np.angle(total))
print(length, angle)
""",
            "As long, at {angle:.3g} degrees: turned back by a quarter of a turn.",
            "angle",
            "degrees",
            label="angle of the sum",
        ),
        Exercise(
            "A ball of 1 kg is bent off its way by e sin(pi t / T) with T = 1 s. For which e has "
            "its "
            "arrow turned by half a turn?",
            """\
import numpy as np

hbar, m, T = 1.054571817e-34, 1.0, 1.0
# S rises by m (pi e)^2 / (4 T)
e = np.sqrt(np.pi * hbar * 4 * T / m) / np.pi
print(e, "m")
""",
            "For {e:.2g} m. For a ball the paths that count are one path.",
            "e",
            "m",
        ),
    ),
)

LESSONS = (HUNT, FIRST_ORDER, LOCAL, T_MINUS_V, LIGHT, LEAST_OR_NOT, PUSH, SYMMETRY, SUM)
BY_NAME = {lesson.name: lesson for lesson in LESSONS}
