"""How accurate is it? Error against tolerance, and the order of the method.

The pendulum's motion is known exactly, by Jacobi's elliptic functions. First the path is solved
to tolerances from 1e-3 to 1e-12: the true error must stay below its estimate, and the estimate
below the tolerance. Then refinement is switched off, on meshes of N equal elements of degree d:
the error of the action falls like N^(-2d).

Expect: true errors below the estimates, and those below the tolerances; orders 4.0 and 6.0 for
degrees 2 and 3. Takes a second.
"""

import numpy as np

import actionopt as ao
from actionopt import scenes

scene = scenes.get("pendulum")
problem, t = scene.problem, np.linspace(0.0, 1.0, 1001)
size = np.max(np.abs(scene.exact(t)))  # errors are relative to the largest angle

tols = 10.0 ** -np.arange(3, 13)
solutions = [ao.solve(problem, tol=tol) for tol in tols]
errors = np.array([np.max(np.abs(s(t) - scene.exact(t))) / size for s in solutions])
estimates = np.array([s.error for s in solutions])

counts = np.array([4, 6, 8, 12, 16])
off = {}  # of the action, for each degree
for degree in (2, 3):
    meshes = [ao.Mesh.uniform(0.0, 1.0, N, degree) for N in counts]
    actions = [ao.solve(problem, mesh=m).action for m in meshes]
    off[degree] = np.abs(np.array(actions) - scene.action)
orders = {d: -np.polyfit(np.log(counts[2:]), np.log(e[2:]), 1)[0] for d, e in off.items()}


def visualize():
    """Draw errors against the tolerance, and against the number of elements."""
    from matplotlib import pyplot

    _, (left, right) = pyplot.subplots(1, 2, figsize=(10.0, 4.4), layout="constrained")
    left.loglog(tols, tols, color="black", linewidth=1, label="tolerance")
    left.loglog(tols, estimates, "s--", label="error estimate")
    left.loglog(tols, errors, "o-", label="true error")
    left.set(xlabel="tolerance", ylabel="error of the path / size")
    for degree, values in off.items():
        (line,) = right.loglog(counts, values, "o", label=f"degree {degree}")
        slope = values[-1] * (counts / counts[-1]) ** (-2.0 * degree)
        right.loglog(counts, slope, color=line.get_color(), label=f"$N^{{-{2 * degree}}}$")
    right.set(xlabel="elements $N$", ylabel="error of the action (J s)")
    right.set_xticks(counts, [str(N) for N in counts])
    right.minorticks_off()
    for ax in (left, right):
        ax.legend()
    return left, right


if __name__ == "__main__":
    for tol, s, error in zip(tols, solutions, errors, strict=True):
        unknowns = s.stats["unknowns"]
        print(f"tol {tol:.0e}: error {error:.1e}, estimate {s.error:.1e}, {unknowns:3} unknowns")
    for degree, order in orders.items():
        print(f"degree {degree}: the action is of order {order:.2f}")

    from matplotlib import pyplot

    visualize()
    pyplot.show()
