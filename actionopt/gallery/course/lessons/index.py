"""Lessons on what is least: foci, a string that goes soft, and the plane of q and p."""

from actionopt.gallery.course.lesson import Exercise, Lesson

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
    watch="Watch the same bend on both sides of half a period, and keep its size.",
    wrong="It is always least, as the name says; or past the focus it is greatest.",
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

STRING = Lesson(
    "string",
    "A string that goes soft",
    (5, 15, 10, 15),
    "What a small bend costs is the energy of a stretched string whose springs pull it outwards. "
    "At a focus one of its shapes goes soft.",
    predict=(
        "A string is stretched between two walls, and springs all along it pull it outwards. You "
        "move the walls apart, with the tension kept. When does it give way, and in which shape?",
    ),
    observe=(
        "Slide the duration until the string is soft, and pull at it on both sides of that. Which "
        "shape goes soft next, and when?",
    ),
    explain=(
        "Bend the oscillator's motion by eta: S changes by the integral of "
        "m eta'^2 / 2 - k eta^2 / 2. The first term is the energy of a tension m: it costs to be "
        "steep. The second is that of springs that pull outwards: it gains to be far.",
        "The shapes that do not mix are those of a guitar string. In a short string the tension "
        "wins. A long one is less steep, and the springs win. In between it is soft: a bend costs "
        "nothing, and that is the focus of the start.",
        "Every shape that is past soft is one way down. So the index counts foci, and that is "
        "Morse's theorem.",
    ),
    steps=(
        ("The shape number n:", "eta = a sin(n pi t / T)"),
        ("What it costs:", "S_n = T s_n a^2 / 4, with s_n = m (n pi / T)^2 - k"),
        ("Its stiffness is zero after n half periods:", "T_n = n pi sqrt(m / k)"),
    ),
    watch="Ask for the index before the sentence below the figure is read.",
    wrong="It breaks where the springs pull most, all shapes at once.",
    trap="A soft shape does not make the motion unstable: it tells of paths that are compared, not "
    "of what the mass does next.",
    figure="string",
    scenes=("oscillator",),
    exercises=(
        Exercise(
            "A mass of 1 kg is on a spring of 4 N/m. How stiff is the first shape for T = 1 s?",
            """\
import numpy as np

m, k, T = 1.0, 4.0, 1.0
t = np.linspace(0, T, 20001)
eta, rate = np.sin(np.pi * t / T), np.pi / T * np.cos(np.pi * t / T)
cost = np.trapezoid(m * rate**2 / 2 - k * eta**2 / 2, t)  # of the bend 1 m
stiffness = 4 * cost / T
print(stiffness, "N/m")
""",
            "{stiffness:.4g} N/m: the tension still wins.",
            "stiffness",
            "N/m",
        ),
        Exercise(
            "Cut the string into 200 pieces, with m = 1 kg, k = 1 N/m, T = 4 s. What is the lowest "
            "stiffness of all its shapes, and how many are below zero?",
            """\
import numpy as np

pieces, T = 200, 4.0
h = T / pieces
tension = 2 * np.eye(pieces - 1) - np.eye(pieces - 1, k=1) - np.eye(pieces - 1, k=-1)
stiffnesses = np.linalg.eigvalsh(tension / h**2 - np.eye(pieces - 1))
lowest, down = stiffnesses[0], int(np.sum(stiffnesses < 0))
print(lowest, "N/m,", down)
""",
            "{lowest:.4g} N/m, and {down} of them: the index after more than half a period.",
            "lowest",
            "N/m",
            label="lowest stiffness",
        ),
    ),
)

PHASE = Lesson(
    "phase",
    "Place and momentum",
    (5, 15, 10, 15),
    "A motion is a curve in the plane of q and p. All starts from one place are a line there, and "
    "a focus is where this line stands upright again.",
    predict=(
        "Many equal pendulums start at one place with different momenta. At one moment mark each "
        "as a point: place to the right, momentum upwards. What do the points form, at the start "
        "and later? When are two of them at one place?",
    ),
    observe=(
        "Let the time run, and watch the line. What happens in the other picture when it stands "
        "upright? Take the pendulum then: why does its line bend?",
    ),
    explain=(
        "In this plane two motions never cross, for q and p together decide what comes next. The "
        "line of starts turns, and is stretched.",
        "Upright means: neighbours differ in p and not in q. They meet, and this is a focus. Each "
        "time the line of neighbours passes the upright the index grows by one.",
        "On a spring all turn with one period, and the line stays straight. A pendulum that swings "
        "wider is slower, so the line bends, and its parts stand upright one after the other: the "
        "foci of all motions lie on a caustic.",
    ),
    steps=(
        ("A mass on a spring, in units of m = k = 1:", "q = q_0 cos t + p_0 sin t"),
        ("and its momentum:", "p = p_0 cos t - q_0 sin t"),
        ("The line of starts has at the time t the direction", "dq/dp_0 = sin t"),
        ("so that it stands upright at 0, half a period, a whole one:", "sin t = 0"),
    ),
    watch="Draw the line of starts in both pictures at one moment, and match two points of it.",
    wrong="Two motions cross where they are at one place, also in the plane of q and p.",
    trap="Curves that cross when q is drawn against time do not cross in the plane of q and p.",
    figure="phase",
    scenes=("oscillator", "pendulum"),
    exercises=(
        Exercise(
            "A mass of 1 kg is on a spring of 4 N/m. How far apart are two starts from one place "
            "after 0.5 s, if their momenta differ by 1 N s?",
            """\
import actionopt as ao

spring = ao.System(lambda q, v, t: v[0] ** 2 / 2 - 4 * q[0] ** 2 / 2, ["x"])
one, two = (float(ao.integrate(spring, ao.State(0.0, [0.3], [p]), 0.5)(0.5)[0]) for p in (0.0, 1.0))
apart = two - one
print(apart, "m")
""",
            "{apart:.4g} m: the sine of the angle turned, over m and the angular frequency.",
            "apart",
            "m",
        ),
        Exercise(
            "Four pendulums of m = g = l = 1 are the corners of a square of side 0.001 in the "
            "plane of angle and momentum. Which area do they enclose after 3 s, in parts of the "
            "first?",
            """\
import numpy as np

import actionopt as ao

pendulum = ao.System(lambda q, v, t: v[0] ** 2 / 2 - (1 - np.cos(q[0])), ["theta"])
side = 1e-3
corners = [(0.4, 1.2), (0.4 + side, 1.2), (0.4 + side, 1.2 + side), (0.4, 1.2 + side)]
ends = []
for q, p in corners:
    path = ao.integrate(pendulum, ao.State(0.0, [q], [p]), 3.0)
    ends.append((float(path(3.0)[0]), float(path.velocity(3.0)[0])))
turns = zip(ends, ends[1:] + ends[:1], strict=True)
area = sum(q * p2 - q2 * p for (q, p), (q2, p2) in turns) / 2
share = area / side**2
print(share)
""",
            "{share:.3f}: the square becomes a thin slanting one, of the same area. That is "
            "Liouville's theorem.",
            "share",
            label="area",
        ),
    ),
)
