"""A system of your own, step by step: a bead on a cycloid, the curve on which clocks do not err.

Copy this file and change it. Its steps are those of every problem: write L(q, v, t), name the
coordinates, say where the system is at two times, solve, and doubt the answer.

The bead slides on x = a (phi + sin phi), y = a (1 - cos phi). Huygens found in 1659 that its time
from rest to the bottom, pi sqrt(a / g), does not depend on where it starts: measured along the
curve, s = 4 a sin(phi / 2), it is a harmonic oscillator of frequency sqrt(g / 4a).

The command solves this file as well: `actionopt solve 07_your_own_system.py --set a=0.5`, and
`actionopt explore 07_your_own_system.py` opens a window on it.

Expect: the bottom reached in 1.003 s from phi = 0.5, 1.5 and 2.5 rad, the starts at rest to nine
digits. Takes a second.
"""

import numpy as np

import actionopt as ao

PARAMETERS = {"m": 0.1, "a": 1.0, "g": 9.81}  # kg, m, m/s^2


# 1. The physics: T - V in coordinates of your choice, with numpy or casadi functions.
def lagrangian(q, v, t, *, m, a, g):
    """T - V of the bead: its speed is 2 a cos(phi / 2) phi'."""
    return m * (2 * a * np.cos(q[0] / 2) * v[0]) ** 2 / 2 - m * g * a * (1 - np.cos(q[0]))


bead = ao.System(lagrangian, ["phi"], parameters=PARAMETERS, name="cycloid")
quarter = np.pi * np.sqrt(PARAMETERS["a"] / PARAMETERS["g"])


# 2. The question: two events. A function of parameters can be asked again and again.
def problem(*, start=1.5, duration=quarter, **parameters):
    """From `start` (rad) to the bottom."""
    events = ao.Event(0.0, [start]), ao.Event(duration, [0.0])
    return ao.Problem(bead, *events, parameters=parameters)


# 3. The answer, and what follows from it.
starts = (0.5, 1.5, 2.5)  # rad
solutions = [ao.solve(problem(start=start), tol=1e-10) for start in starts]

# 4. Doubt: forward integration from the start, which knows nothing of the action; and a formula.
t = np.linspace(0.0, quarter, 201)
deviations = [solution.compare().position for solution in solutions]
errors = [
    np.max(np.abs(np.sin(s(t)[0] / 2) - np.sin(start / 2) * np.cos(np.pi * t / (2 * quarter))))
    for s, start in zip(solutions, starts, strict=True)
]


def visualize():
    """Draw the beads on their way down: all arrive together."""
    from matplotlib import pyplot

    _, ax = pyplot.subplots()
    for solution, start in zip(solutions, starts, strict=True):
        ax.plot(t, solution(t)[0], linewidth=2, label=f"from {start} rad")
    ax.set(xlabel="time $t$ (s)", ylabel=r"$\varphi$ (rad)", title="beads on a cycloid")
    ax.legend()
    return ax


if __name__ == "__main__":
    print(f"to the bottom in {quarter:.3f} s")
    for start, s, far, error in zip(starts, solutions, deviations, errors, strict=True):
        print(
            f"from {start} rad: {s.start.v[0]:+.0e} rad/s, forward {far:.0e}, formula {error:.0e}"
        )

    from matplotlib import pyplot

    visualize()
    pyplot.show()
