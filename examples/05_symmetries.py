"""Symmetries and what they conserve: two masses on a spring, free to fly in the plane.

By Noether's theorem every transformation that leaves the action as it is has a quantity that no
motion changes. Nothing about this Lagrangian is told but its formula: the symmetries that are
linear in the coordinates and the time are found from it, each with its conserved quantity,

    shift of time      energy               shift of x or y    momentum
    turn of the plane  angular momentum     boost of x or y    where the centre of mass started

and one that few would guess: the masses may be turned about their centre of mass alone. Then the
same by hand: a turn of the plane moves (x, y) by (-y, x).

Expect: seven symmetries; their quantities the same all along the path, to ten digits of their
size. Takes a second.
"""

import numpy as np

import actionopt as ao

parameters = {"m1": 1.0, "m2": 3.0, "k": 20.0, "l": 1.0}  # kg, kg, N/m, m


def lagrangian(q, v, t, *, m1, m2, k, l):
    """T - V of the masses and the spring between them."""
    stretch = np.sqrt((q[2] - q[0]) ** 2 + (q[3] - q[1]) ** 2) - l
    T = m1 * (v[0] ** 2 + v[1] ** 2) / 2 + m2 * (v[2] ** 2 + v[3] ** 2) / 2
    return T - k * stretch**2 / 2


dumbbell = ao.System(lagrangian, ["x1", "y1", "x2", "y2"], parameters=parameters, name="dumbbell")
start, end = ao.Event(0.0, [0.0, 0.2, 1.2, 0.5]), ao.Event(1.0, [2.0, 1.0, 1.5, 2.0])
solution = ao.solve(ao.Problem(dumbbell, start, end), tol=1e-11)

t = np.linspace(0.0, 1.0, 201)
q, v = solution(t), solution.velocity(t)
symmetries = ao.find_symmetries(dumbbell)
quantities = [symmetry.conserved(q, v, t) for symmetry in symmetries]
changes = [np.ptp(values) / np.max(np.abs(values)) for values in quantities]

turn = ao.noether(dumbbell, lambda q, t: [-q[1], q[0], -q[3], q[2]])
by_hand = sum(m * (q[i] * v[i + 1] - q[i + 1] * v[i]) for m, i in ((1.0, 0), (3.0, 2)))


def visualize():
    """Draw the path, and the conserved quantities against time."""
    from matplotlib import pyplot

    from actionopt import plot

    _, (above, below) = pyplot.subplots(2, figsize=(6.4, 8.0), layout="constrained")
    plot.paths(solution, above, compare=False, units=plot.SI)
    for symmetry, values in zip(symmetries, quantities, strict=True):
        below.plot(t, values, linewidth=2, label=str(symmetry))
    below.set(xlabel="time $t$ (s)", ylabel="conserved quantity (SI)")
    below.legend(ncols=2, fontsize="small", bbox_to_anchor=(0.5, -0.2), loc="upper center")
    return above, below


if __name__ == "__main__":
    for symmetry, values, change in zip(symmetries, quantities, changes, strict=True):
        print(f"{values[0]:12.6f}, changes by {change:.0e} of it: {symmetry}")
    print(f"angular momentum {turn(q, v, t)[0]:.6f} J s, by the textbook {by_hand[0]:.6f} J s")

    from matplotlib import pyplot

    visualize()
    pyplot.show()
