"""A constraint and its force: the pendulum again, in Cartesian coordinates.

The rod is now an equation, x^2 + y^2 = l^2, and its pull comes with the path: the multiplier
lambda of L' = L + lambda (x^2 + y^2 - l^2) is the force of constraint in disguise, G' lambda with
G = (2x, 2y). Its size is the tension of the rod. The angle, which knows of no rod, gives it as

    m l theta'^2 + m g cos theta.

Expect: a tension of 15.6 N at the lowest point and of 6.9 N where the swing turns, and agreement
of the two descriptions to nine digits. Takes a tenth of a second.
"""

import numpy as np

import actionopt as ao

m, l, g = 1.0, 1.0, 9.81  # kg, m, m/s^2
start, end = 0.3, -0.2  # rad from straight down, one second apart


def cartesian(q, v, t):
    """T - V of a point mass; y points up."""
    x, y = q
    return m * v @ v / 2 - m * g * y


def rod(q, t):
    """Zero on the circle of radius l."""
    x, y = q
    return x**2 + y**2 - l**2


def by_angle(q, v, t):
    """T - V of the same mass by its angle."""
    return m * (l * v[0]) ** 2 / 2 + m * g * l * np.cos(q[0])


def at(angle):
    """Return where the mass is when the rod hangs at `angle` (rad)."""
    return [l * np.sin(angle), -l * np.cos(angle)]


system = ao.System(cartesian, ["x", "y"], constraint=rod, name="rod pendulum")
problem = ao.Problem(system, ao.Event(0.0, at(start)), ao.Event(1.0, at(end)))
solution = ao.solve(problem, tol=1e-10)

system = ao.System(by_angle, ["theta"], name="pendulum")
reference = ao.solve(ao.Problem(system, ao.Event(0.0, [start]), ao.Event(1.0, [end])), tol=1e-10)

t = np.linspace(0.0, 1.0, 201)
tension = np.linalg.norm(solution.constraint_force(t), axis=0)
expected = m * l * reference.velocity(t)[0] ** 2 + m * g * np.cos(reference(t)[0])


def visualize():
    """Draw the tension of the rod against time, from the multiplier and from the angle."""
    from matplotlib import pyplot

    _, ax = pyplot.subplots()
    ax.plot(t, tension, linewidth=4, alpha=0.5, label=r"from the multiplier $\lambda$")
    ax.plot(t, expected, "k--", linewidth=1, label=r"$m l \dot\theta^2 + m g \cos\theta$")
    ax.set(xlabel="time $t$ (s)", ylabel="tension (N)")
    ax.legend()
    return ax


if __name__ == "__main__":
    print(f"tension from {tension.min():.3f} to {tension.max():.3f} N")
    print(f"multiplier against angle: {np.max(np.abs(tension - expected)):.1e} N")

    from matplotlib import pyplot

    visualize()
    pyplot.show()
