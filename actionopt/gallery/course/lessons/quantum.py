"""Lessons on the sum over all paths."""

from actionopt.gallery.course.lesson import Exercise, Lesson

SUM = Lesson(
    "sum",
    "The sum over paths",
    (5, 10, 15, 15),
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
    observe=(
        "Two bends at once: in place of each arrow of the first spiral the whole second one is "
        "put. Slide the duration past one focus, and past two. By how much does the sum turn each "
        "time?",
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
        "Two bends that do not mix have a product of two sums: their angles add. At a saddle of "
        "index 2 the sum is turned back by a quarter of a turn.",
        "So the index of a saddle can be seen, in light and in atoms: a quarter of a turn for each "
        "way down.",
    ),
    figure="bends",
    watch="Make hbar smaller in steps, and ask which arrows are still needed.",
    wrong="The sum of a thousand arrows is a thousand long; or all of them cancel, and nothing is "
    "left.",
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

SLITS = Lesson(
    "slits",
    "Two slits",
    (5, 15, 10, 15),
    "Add an arrow for each way through the slits. Where those of two slits are opposite it is "
    "dark, though each slit alone would shine.",
    predict=(
        "Particles come one by one to a wall with two slits, and to a screen behind. Can a place "
        "on the screen become brighter when one slit is closed?",
    ),
    observe=(
        "Drag the place along the screen, and look at the arrows of both slits. Close one slit. "
        "Then take the wall away: which ways are left of the great spiral?",
    ),
    explain=(
        "A way through a slit has two straight legs, and its arrow is turned by S / hbar. Along "
        "the screen the arrows of the two slits turn against each other: a whole turn from one "
        "bright band to the next.",
        "Probabilities are not added, arrows are. Close a slit, and the dark places between become "
        "brighter.",
        "Without a wall the arrows of all places make one spiral. Its ends curl up, and what is "
        "left is the straight way through the middle.",
        "Normalisation: multiply by sqrt(m / (2 pi i hbar T)) for each leg. Then two legs, summed "
        "over all places between, make one of twice the time, and all probabilities add up to one.",
    ),
    steps=(
        (
            "The way through the slit at s to the place y:",
            "S = m (2 a^2 + s^2 + (y - s)^2) / (2 T)",
        ),
        ("Between slits at d/2 and -d/2 it differs by", "S_2 - S_1 = m y d / T"),
        ("A whole turn more, from bright to bright:", "m y d / T = 2 pi hbar"),
        ("So the bands are apart by", "y = 2 pi hbar T / (m d)"),
    ),
    watch="Close one slit at a dark place, and let them say what happened to the arrows.",
    wrong="More open slits, more light everywhere.",
    trap="The question is not which slit it took: every way has its arrow.",
    figure="slits",
    exercises=(
        Exercise(
            "Electrons of 1000 km/s go through slits 1 micrometre apart, to a screen 1 m behind. "
            "How far apart are the bright bands, in millimetres?",
            """\
import numpy as np

hbar, m, v = 1.054571817e-34, 9.1093837015e-31, 1e6
d, far = 1e-6, 1.0
T = far / v  # of one leg
bands = 1e3 * 2 * np.pi * hbar * T / (m * d)
print(bands, "mm")
""",
            "{bands:.3g} mm apart.",
            "bands",
            "mm",
        ),
        Exercise(
            "Take m = hbar = 1 and legs of T = 1. How large is the sum over all places s between "
            "of both legs from 0 to 0, each with its factor, in parts of one leg of twice the "
            "time?",
            """\
import numpy as np

s = np.linspace(-60, 60, 2_000_001)
legs = np.exp(1j * (s**2 / 2 + s**2 / 2) - 1e-3 * s**2)  # faded out, slowly, far away
factor = np.sqrt(1 / (2j * np.pi))
both = factor**2 * np.sum(legs) * (s[1] - s[0])
whole = np.sqrt(1 / (2j * np.pi * 2))
ratio = abs(both / whole)
print(ratio)
""",
            "{ratio:.4f}: the factor is right.",
            "ratio",
            label="ratio",
        ),
    ),
)
