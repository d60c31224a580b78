"""Lessons on light, and on stones that go its ways."""

from actionopt.gallery.course.lesson import Exercise, Lesson

LIGHT = Lesson(
    "light",
    "Light first",
    (5, 5, 15, 20),
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
        "Bend the ray over the hot road, and look at its optical length. Press Start over and tick "
        "Show the motion: this ray dips towards the road. Press Solve from the straight line: "
        "there is another. Go from one to the other by the two buttons that appear. Along which "
        "of them do you see the sky?",
    ),
    explain=(
        "Fermat: between two points light takes a way whose time is stationary. With the place "
        "along the ground as what runs, x, the Lagrangian is n(y) sqrt(1 + (dy/dx)^2). It does not "
        "contain x, so n / sqrt(1 + (dy/dx)^2) is conserved along the ray: that is Snell's law in "
        "a layered air. Above a hot road the index grows with height and rays bend upwards: the "
        "sky is seen in the road, a mirage.",
        "The fastest slide between two points has as Lagrangian the time for each piece of the "
        "way, its length over the speed sqrt(2 g y) at the depth y. The answer is a cycloid. A "
        "soap film between two rings makes its area stationary, L = y sqrt(1 + (dy/dx)^2), and the "
        "answer is the catenary, the curve of a hanging chain, y = c cosh(x / c): the chain makes "
        "its centre of mass as low as it can.",
        "In all of these the thing that runs need not be time, and the number need not be least. A "
        "ray in a hollow mirror can be the slowest of those with one reflection. Among all ways it "
        "is a saddle: a detour makes it slower still.",
    ),
    watch="Let them go from one ray to the other, and ask which of the two is the shorter in time.",
    wrong="Straight on; or to the point straight below the swimmer, so as to swim least.",
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

STONES = Lesson(
    "stones",
    "Stones like rays",
    (5, 15, 10, 15),
    "At a given energy a stone goes the ways of light, in a glass whose index is as large as its "
    "speed.",
    predict=(
        "With one energy a target can be hit by two throws, a flat one and a steep one. Which "
        "targets can be hit by one throw alone, and which by none?",
    ),
    observe=(
        "Drag the arc to the target: W, its optical length, is level at the throws alone. Draw the "
        "rays, dashed, in more pieces, and they settle on the stones. Then lead the target across "
        "the safety parabola.",
    ),
    explain=(
        "With the energy the speed is known at each place, and time need not be asked. Among all "
        "ways of this energy the integral of p ds is stationary: Maupertuis and Jacobi. Fermat "
        "says the same of the integral of n ds. So the stone's way is that of a ray, if n is taken "
        "as large as p.",
        "High above it is slow and n is small: rays bend down there. Snell's law, from layer to "
        "layer, is that of the horizontal momentum, which is conserved.",
        "All throws of one energy touch one curve, the safety parabola; for rays it is a caustic, "
        "a bright edge, and beyond it is darkness. The steep throw has touched it on the way: it "
        "is a saddle, of index 1. The flat one is least.",
    ),
    steps=(
        ("What is summed, for m = 1:", "n = sqrt(2 (E - V))"),
        ("Snell's law between two layers:", "n1 cos a1 = n2 cos a2"),
        ("A throw in the direction b = tan a:", "y = b x - g (1 + b^2) x^2 / (4 E)"),
        ("The highest that any throw reaches above x, where dy/db = 0:", "b = 2 E / (g x)"),
        ("Put in: the safety parabola.", "y = E / g - g x^2 / (4 E)"),
    ),
    watch="On the safety parabola both throws become one: let them find that place slowly.",
    wrong="Every target that is near enough can be hit in two ways; or 45 degrees is always best.",
    trap="Only the ways agree. A stone is fast where n is large, light is slow there.",
    figure="optics",
    scenes=("throw_at_energy", "kepler_at_energy"),
    exercises=(
        Exercise(
            "How far along level ground does a stone of 1 kg fly at most, with E = 20 J and "
            "g = 9.81 m/s^2?",
            """\
import numpy as np

E, g = 20.0, 9.81
angle = np.radians(np.linspace(1, 89, 88001))
distance = 2 * E * np.sin(2 * angle) / g
far, best = distance.max(), np.degrees(angle[np.argmax(distance)])
print(far, "m, at", best, "degrees")
""",
            "{far:.4g} m, at {best:.3g} degrees: the place where the safety parabola meets the "
            "ground.",
            "far",
            "m",
        ),
        Exercise(
            "The target is at 2.2 m, 0.5 m high, again with 20 J. By how much is W of the steep "
            "throw larger than that of the flat one?",
            """\
import numpy as np

E, g, x, y = 20.0, 9.81, 2.2, 0.5
root = np.sqrt(4 * E**2 - g * (g * x**2 + 4 * E * y))
flat, steep = ((2 * E + sign * root) / (g * x) for sign in (-1, 1))  # tangents of the angles


def W(b):
    s = np.linspace(0, x, 200001)
    height, slope = b * s - g * (1 + b**2) * s**2 / (4 * E), b - g * (1 + b**2) * s / (2 * E)
    return np.trapezoid(np.sqrt(2 * (E - g * height)) * np.sqrt(1 + slope**2), s)


more = W(steep) - W(flat)
print(W(flat), W(steep), more, "J s")
""",
            "By {more:.3g} J s. Both are stationary; only the flat one is least.",
            "more",
            "J s",
            label="difference of W",
        ),
    ),
)
