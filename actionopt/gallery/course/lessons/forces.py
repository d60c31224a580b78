"""Lessons on forces of constraint, and on what symmetries conserve."""

from actionopt.gallery.course.lesson import Exercise, Lesson

PUSH = Lesson(
    "push",
    "Constraints push",
    (5, 10, 15, 15),
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
    observe=(
        "The other way to see the force: make the rod longer by epsilon, with the same angles at "
        "the same times. Which slope has S, and which area has the pull?",
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
        "How much S gains by a longer rod, the pull tells: its sum over the time. In the same way "
        "the momentum at the end is the slope of S with the place of the end. What holds something "
        "is a slope of S with what is held.",
        "A multiplier of the wrong sign is a warning: a floor cannot pull. There the body leaves.",
    ),
    steps=(
        ("Among all paths this is stationary, for f = sqrt(x^2 + y^2) - l:", "L2 = L + lamda f"),
        ("Hold f = epsilon, a rod that is longer by epsilon:", "L2 = L + lamda (f - epsilon)"),
        ("The path may be kept, to first order, so for each second", "dL2/depsilon = -lamda"),
    ),
    figure="rod",
    watch="The sign: which way does the arrow point at the top of a swing, and which at the "
    "bottom?",
    wrong="The rod pulls with the weight, since the bob neither rises nor falls at the lowest "
    "point.",
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
    observe=(
        "Shift the motion, and compare S of its ghost. For each of the three: which shift, by "
        "which share c, changes nothing? Look at the broad curve then.",
        "Now shift only the middle, with a step at each end. What does each step add to S?",
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
    steps=(
        (
            "Only the middle is shifted, by e, and that is a symmetry. The steps to it and back "
            "are all that is left:",
            "S_e = S + p_0 e - p_1 e",
        ),
        ("But a motion is stationary, however it is bent:", "S_e = S"),
        ("So the momentum at the end is that at the start:", "p_1 = p_0"),
    ),
    figure="noether",
    watch="The two steps of the shifted middle: let them say in words what each end adds.",
    wrong="All momenta are conserved if there is no friction; or what stays constant once is "
    "conserved.",
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
            "A free particle of 2 kg goes 3 m in 1.5 s. The end is moved 1 cm farther. By how much "
            "does S change, and how much of that is p times the shift?",
            """\
m, d, T = 2.0, 3.0, 1.5
S = m * d**2 / (2 * T)
change = m * (d + 0.01) ** 2 / (2 * T) - S
p = m * d / T
first = p * 0.01
print(change, "J s, p dx =", first, "J s")
""",
            "By {change:.4g} J s. Of that {first:.3g} J s is p times the shift, {p:.3g} N s times "
            "0.01 m: the momentum is the slope of S with the end. The rest is of second order.",
            "change",
            "J s",
            label="change of S",
        ),
    ),
)
