"""A pendulum: from a Lagrangian and two events to the path between them.

A pendulum of one metre is seen at +0.3 rad and one second later at -0.2 rad. What did it do in
between? Of all the ways to join the two, nature takes the one whose action S is stationary.

Expect: an action of 9.6481 J s for a mass of one kilogram; the same path, to ten digits, from
integrating the equation of motion forward. Takes a tenth of a second.
"""

import numpy as np

import actionopt as ao


def lagrangian(q, v, t, *, l, g):
    """T - V of a mass of 1 kg on a rod of length l (m), by its angle from straight down (rad)."""
    return (l * v[0]) ** 2 / 2 + g * l * np.cos(q[0])


pendulum = ao.System(lagrangian, ["theta"], parameters={"l": 1.0, "g": 9.81}, name="pendulum")
problem = ao.Problem(pendulum, ao.Event(0.0, [0.3]), ao.Event(1.0, [-0.2]))
solution = ao.solve(problem, tol=1e-10)

# The same question on the Moon: nothing is derived again.
on_the_moon = ao.solve(ao.Problem(pendulum, problem.start, problem.end, parameters={"g": 1.62}))


def visualize():
    """Draw the path with the forward integration over it, and how far they are apart."""
    from actionopt import plot

    return plot.overview(solution)


if __name__ == "__main__":
    print(f"action           {solution.action:.6f} J s")
    print(f"error estimate   {solution.error:.1e}")
    print(f"forward          {solution.compare().position:.1e}")
    print(f"starts with      {solution.start.v[0]:.6f} rad/s")
    print(f"on the Moon with {on_the_moon.start.v[0]:.6f} rad/s")

    from matplotlib import pyplot

    visualize()
    pyplot.show()
