"""The fronts of a double pendulum: the action of the paths from one place to all others.

Every path sets out from the place of rest at time 0. Its action is a function S of the place where
it is at a later time, and the lines S = const are fronts, as those of a wave (Hamilton). The
gradient of S is the momentum with which the path arrives: so motions cross their fronts as rays of
light do. Nothing is differentiated for the arrows: each is a path's own momentum, and it stands at
a right angle to the front. Early on S is that of free motion, and the fronts are ellipses of the
kinetic energy; then gravity bends them.

Expect: all paths solved, in one piece; slopes of S between places as the momenta say, to three
digits. Takes a second; `python examples/10_fronts.py 80` draws 80 x 80 places at each time.
"""

import sys

import numpy as np

import actionopt as ao
from actionopt import scenes

TIMES = 0.1, 0.25, 0.4
REACH = 1.0  # radians
pendulum = scenes.get("double_pendulum").problem.system


def fronts(count, T):
    """Return the paths to count x count places at the time T."""
    problem = ao.Problem(pendulum, ao.Event(0.0, [0.0, 0.0]), ao.Event(T, [0.5, 0.5]))
    places = np.linspace(-REACH, REACH, count)
    return ao.sweep(problem, {("end", name): places for name in pendulum.coordinates})


def slopes(runs):
    """Return the slopes of S along both angles by Simpson's rule for the momenta, and by S itself.

    Between every second place; both (2, count - 2, count - 2).
    """
    S, p = runs.action, np.moveaxis(runs.momenta[..., 1, :], -1, 0)
    h = np.diff(runs.grid.values[0])[0]
    first = (p[0, :-2] + 4 * p[0, 1:-1] + p[0, 2:])[:, 1:-1] / 6
    second = (p[1, :, :-2] + 4 * p[1, :, 1:-1] + p[1, :, 2:])[1:-1] / 6
    by_action = (S[2:, 1:-1] - S[:-2, 1:-1]) / (2 * h), (S[1:-1, 2:] - S[1:-1, :-2]) / (2 * h)
    return np.stack([first, second]), np.stack(by_action)


count = 16
found = [fronts(count, T) for T in TIMES]


def visualize(found=found):
    """Draw the fronts at three times, and momenta."""
    from matplotlib import pyplot

    figure, axes = pyplot.subplots(1, 3, figsize=(13, 4.6), sharey=True, layout="constrained")
    for ax, T, runs in zip(axes, TIMES, found, strict=True):
        places = runs.grid.values[0]
        lines = ax.contour(places, places, runs.action.T, 12, colors="C0")
        ax.clabel(lines, lines.levels[::3], fmt="%.3g")
        some = np.linspace(0, runs.shape[0] - 1, 9).round().astype(int)[1:-1]
        p = runs.momenta[np.ix_(some, some)][:, :, 1]
        ax.quiver(*places[[some, some]], *p.T, angles="xy", width=0.006)
        ax.set(aspect="equal", title=f"$t = {T:g}$ s", xlabel=r"$\theta_1$")
    axes[0].set_ylabel(r"$\theta_2$")
    figure.suptitle(r"fronts $S(\theta_1, \theta_2, t)$ = const, N m s, and momenta")
    return axes


if __name__ == "__main__":
    if len(sys.argv) > 1:
        found = [fronts(int(sys.argv[1]), T) for T in TIMES]
    for T, runs in zip(TIMES, found, strict=True):
        momenta, by_action = slopes(runs)
        off = np.max(np.abs(momenta - by_action)) / np.max(np.abs(momenta))
        print(f"t = {T}: {runs}; slopes of S and momenta differ by {off:.1e}")

    from matplotlib import pyplot

    visualize(found)
    pyplot.show()
