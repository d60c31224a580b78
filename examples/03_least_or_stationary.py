"""Least action is not always least: an oscillator before and after half a period.

For x'' = -x the action of a path from 0 to 1 is least if it takes less than half a period, pi.
After that it is stationary but not least: lift the path by eps sin(pi t / T), and S *falls*.
The textbook has the number,

    S(x + eps sin(pi t / T)) - S(x) = eps^2 (pi^2 / T^2 - 1) T / 4,

positive for T < pi and negative beyond. Minimising then runs away without end; the path is
found all the same, by asking for dS = 0.

Expect: changes of S for eps = 0.5 of +0.090 at T = 2.5 and of -0.563 at T = 10, as the formula says
to ten digits; a least path refused at T = 10, with the reason. Takes a tenth of a second.
"""

import numpy as np

import actionopt as ao


def lagrangian(q, v, t):
    """T - V of a unit mass on a unit spring."""
    return (v[0] ** 2 - q[0] ** 2) / 2


oscillator = ao.System(lagrangian, ["x"], name="oscillator")
durations = (2.5, 10.0)
solutions = [
    ao.solve(ao.Problem(oscillator, ao.Event(0.0, [0.0]), ao.Event(T, [1.0])), tol=1e-12)
    for T in durations
]

try:
    ao.solve(solutions[1].problem, principle="least")
    refusal = ""
except ao.SolveError as error:
    refusal = str(error)


def action(solution, eps):
    """Return S of the path lifted by eps sin(pi t / T), by Gauss-Legendre quadrature."""
    T = solution.problem.duration
    xi, w = np.polynomial.legendre.leggauss(40)
    t = T * (xi + 1) / 2
    x = solution(t) + eps * np.sin(np.pi * t / T)
    v = solution.velocity(t) + eps * np.pi / T * np.cos(np.pi * t / T)
    return T / 2 * w @ oscillator.lagrangian(x, v, t)


lifts = np.linspace(-1.0, 1.0, 41)
changes = [[action(s, eps) - s.action for eps in lifts] for s in solutions]
expected = [lifts**2 * (np.pi**2 / T**2 - 1) * T / 4 for T in durations]


def visualize():
    """Draw S against the size of the lift, for both durations."""
    from matplotlib import pyplot

    _, ax = pyplot.subplots()
    for T, change, formula in zip(durations, changes, expected, strict=True):
        (line,) = ax.plot(lifts, change, "o", markersize=4, label=f"$T = {T}$")
        ax.plot(lifts, formula, color=line.get_color(), linewidth=1)
    ax.set(xlabel=r"lift $\varepsilon$", ylabel=r"change of the action $S$")
    ax.legend()
    return ax


if __name__ == "__main__":
    for T, change, formula in zip(durations, changes, expected, strict=True):
        print(
            f"T = {T:4}: S changes by {change[30]:+.10f} for eps = 0.5, formula {formula[30]:+.10f}"
        )
    print(refusal)

    from matplotlib import pyplot

    visualize()
    pyplot.show()
