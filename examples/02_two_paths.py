"""Two paths between the same events: a planet reached the short way, and the long way round.

A ship leaves the Earth and meets Mars, 135 degrees further round the Sun, 0.6 years later. Both
ways round make the action stationary, each is even least among its neighbours, and they differ in
S: the principle does not say that nature takes the least action of all.

Both are arcs of ellipses, and Lambert's theorem checks them: the time depends only on the axis a,
the two distances r1 + r2 and the chord c. In Lagrange's form, with s = (r1 + r2 + c) / 2,

    2 pi T = a^(3/2) (alpha - sin alpha -+ (beta - sin beta)),
    sin^2(alpha / 2) = s / 2a,    sin^2(beta / 2) = (s - c) / 2a,

minus for the short way and plus for the long way, in astronomical units and years.

Expect: two paths, both minima; the formula's times equal to 0.6 years to nine digits. Takes a
second or two.
"""

import numpy as np

import actionopt as ao

mu = 4 * np.pi**2  # of the Sun, AU^3/yr^2
KM_S = 4.74047  # km/s in one AU/yr


def lagrangian(q, v, t):
    """T - V of a unit mass."""
    return v @ v / 2 + mu / np.sqrt(q @ q)


ship = ao.System(lagrangian, ["x", "y"], name="transfer")
earth, mars = np.array([1.0, 0.0]), 1.524 * np.array([-np.sqrt(0.5), np.sqrt(0.5)])
problem = ao.Problem(ship, ao.Event(0.0, earth), ao.Event(0.6, mars))
found = ao.solve_all(problem, tol=1e-10, shots=20, continuations=0)

chord = np.linalg.norm(mars - earth)
half = (1.0 + 1.524 + chord) / 2
times = []
for path, sign in zip(found, (-1, 1), strict=True):
    a = -mu / (2 * path.energy(0.0))
    alpha, beta = 2 * np.arcsin(np.sqrt(np.array([half, half - chord]) / (2 * a)))
    times.append(a**1.5 * (alpha - np.sin(alpha) + sign * (beta - np.sin(beta))) / (2 * np.pi))


def visualize():
    """Draw both ways round the Sun."""
    from actionopt import plot

    ax = plot.paths(found[0], compare=False)
    t = np.linspace(0.0, 0.6, 400)
    ax.plot(*found[1](t), linewidth=4.5, alpha=0.5, label="the long way")
    ax.plot(0, 0, "*", color="black", markersize=12, label="Sun")
    ax.lines[0].set_label("the short way")
    ax.set(xlabel="$x$ (AU)", ylabel="$y$ (AU)")
    ax.set_title("two paths from the Earth to Mars")
    ax.legend(loc="upper right", fontsize="small")
    return ax


if __name__ == "__main__":
    print(found)
    for path, time in zip(found, times, strict=True):
        speed = KM_S * np.linalg.norm(path.start.v - [0.0, 2 * np.pi])
        print(
            f"{path.kind} of S, leaves the Earth at {speed:.1f} km/s, Lambert's T = {time:.9f} yr"
        )

    from matplotlib import pyplot

    visualize()
    pyplot.show()
