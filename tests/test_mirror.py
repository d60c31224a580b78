"""The other way round: what is positive in one problem is negative in its mirror image.

Every number is negated exactly, so that all that has no sign of its own is the same: the error
estimate, the figures of the search, the meshes and the comparison. Nothing else tells a size that
was taken without its magnitude, where the values of a problem happen to be of one sign.
"""

import casadi as ca
import numpy as np
import pytest
from helpers import a_quarter, same_bits

import actionopt as ao
from actionopt import Event, Mesh, Periodic, Problem, System
from actionopt.analysis.quadratic.second_variation import form
from actionopt.analysis.spectra.conjugate import conjugate_points
from actionopt.analysis.spectra.modes import second_variation
from actionopt.discrete.meshes.path import Path
from actionopt.solver.refinement.workspace import Workspace

SAME = 1e-6  # of figures such as round-off, where a decomposition chooses its own signs


def pendulum(q, v, t):
    return v[0] ** 2 / 2 + 9.81 * np.cos(q[0]) + q[0]


def pulsed(q, v, t):
    return v[0] ** 2 / 2 - q[0] ** 4 / 4 + 40 * np.exp(-(((t - 0.43) / 0.004) ** 2)) * q[0]


def stepped(q, v, t):
    return v[0] ** 2 / 2 + ca.if_else(t > 0.3141592, 5.0, 0.0) * q[0] - q[0] ** 4 / 40


def valley(q, v, t):
    return v @ v / 2 - 9.0 * q[0] - 2 * (q[1] - q[0] ** 2) ** 2


def far(q, v, t):
    x, y = q[0] - 1e5, q[1] - 1e5
    return v @ v / 2 - (x**2 + y**2) / 2 - x**2 * y + y**3 / 3


def layered(q, v, t):
    return v[0] ** 2 / 2 + 5e3 * q[0] ** 2 + 2e3 * q[0]


def surface(q, t):
    return [q[0] ** 2 + q[1] ** 2 + q[2] ** 2 - 0.01]  # which no float is on


def on_the_sphere(u, w):
    return [0.1 * np.cos(u) * np.cos(w), 0.1 * np.sin(u) * np.cos(w), 0.1 * np.sin(w)]


CASES = {
    # name: Lagrangian, coordinates, start, end, duration; constraint, force, what solve is told
    "pendulum": (pendulum, 1, [0.3], [0.9], 0.8, None, None, {}),
    "saddle": (pendulum, 1, [0.3], [0.9], 4.0, None, None, {}),
    "free end": (pendulum, 1, [0.7], [None], 0.8, None, None, {}),
    "pulse": (pulsed, 1, [1.0], [2.0], 1.0, None, None, {}),
    "step": (stepped, 1, [0.2], [1.5], 1.0, None, None, {}),
    "valley": (valley, 2, [0.5, 1.0], [2.0, 3.0], 1.0, None, None, {}),
    "far": (far, 2, [1e5 + 0.1, 1e5 + 0.05], [1e5 - 0.2, 1e5 + 0.1], 2.0, None, None, {}),
    "layers": (layered, 1, [1.0], [0.3], 1.0, None, None, {}),
    "sphere": (
        lambda q, v, t: v @ v / 2 - q[2], 3, on_the_sphere(0.3, 0.4), on_the_sphere(0.9, 0.2), 0.1,
        surface, None, {},
    ),
    "drag": (
        pendulum, 1, [0.3], [0.9], 0.8, None, lambda q, v, t: [-v[0] * np.sqrt(1 + v[0] ** 2)], {},
    ),
    "friction": (
        lambda q, v, t: v[0] ** 2 / 2, 1, [1.0], [2.0], 1.0, None, lambda q, v, t: [-30 * v[0]], {},
    ),
    "a mesh": (
        pendulum, 1, [0.3], [0.9], 0.8, None, None, {"mesh": Mesh.uniform(0.0, 0.8, 3, 5)},
    ),
    "closed": (
        lambda q, v, t: v[0] ** 2 / 2 - q[0] ** 4 / 4 - q[0] + np.cos(t) * q[0],
        1, [None], None, 2 * np.pi, None, None, {},
    ),
}  # fmt: skip


def problem_of(name, side=1.0, sign=1.0, way=1.0):
    """Return a problem and what `solve` is told, in other units of q, L and t.

    For side = -1 it is the mirror image, for sign = -1 that of -L, and for way = -1 that of a
    motion run backwards.
    """
    lagrangian, n, start, end, T, constraint, force, options = CASES[name]
    side = np.broadcast_to(side, (n,))

    def image(row):
        return [None if x is None else unit * x for unit, x in zip(side, row, strict=True)]

    def pushed(q, v, t):
        given = force(q / side, v * (way / side), t / way)
        return [sign / unit * x for unit, x in zip(side, given, strict=True)]

    system = System(
        lambda q, v, t: sign * lagrangian(q / side, v * (way / side), t / way),
        ["x", "y", "z"][:n],
        constraint=None if constraint is None else lambda q, t: constraint(q / side, t / way),
        force=None if force is None else pushed,
    )
    if "mesh" in options:
        mesh = options["mesh"]
        options = {"mesh": Mesh(abs(way) * mesh.boundaries, mesh.degrees)}
    T = abs(way) * T
    last = Periodic(T) if end is None else Event(T, image(end))
    return Problem(system, Event(0.0, image(start)), last), options


@pytest.fixture(scope="module")
def both():
    kept = {}

    def get(name):
        if name not in kept:
            found = []
            for side in (1, -1):
                problem, options = problem_of(name, side)
                found.append(ao.solve(problem, tol=1e-8, **options))
            kept[name] = found
        return kept[name]

    return get


# Why what was done is the same to the last bit.
SIGN, EXACT = "rounding knows no sign", "powers of two round nothing"


def figures(solution):
    """Return what was done to find a path, without the times it took."""
    stats = {k: v for k, v in solution.stats.items() if k not in ("time", "derived", "rounds")}
    rounds = [{k: v for k, v in r.items() if k != "time"} for r in solution.stats["rounds"]]
    return stats | {"rounds": rounds}


def flat(value):
    """Return the numbers in nested mappings and sequences, in order."""
    if isinstance(value, dict):
        return [x for k in sorted(value) for x in flat(value[k])]
    if isinstance(value, (list, tuple)):
        return [x for y in value for x in flat(y)]
    return [value]


NUMBERS = (
    *("position", "velocity", "arrival", "local", "energy_drift", "reference_error"),
    *("allowed", "amplified", "reason", "agrees"),
)
UNFORCED = [name for name, case in CASES.items() if case[6] is None]
EXACT = [name for name in CASES if name not in ("sphere", "layers")]


@pytest.mark.quick("pendulum")
@pytest.mark.parametrize("name", a_quarter(CASES))
def test_the_path_is_mirrored_and_all_that_was_done_is_the_same(name, both):
    here, there = both(name)
    assert here.status is there.status
    assert here.mesh.degrees == there.mesh.degrees
    same_bits(here.mesh.boundaries, there.mesh.boundaries, because=SIGN)
    same_bits(here.path.values, -there.path.values, because=SIGN)
    same_bits([here.action, here.error], [there.action, there.error], because=SIGN)
    assert flat(figures(here)) == flat(figures(there))


@pytest.mark.long
@pytest.mark.parametrize("name", a_quarter(EXACT))
def test_the_comparison_is_the_same(name, both):
    """But where a singular value decomposition, or a motion that overflows, has its own signs."""
    one, other = (solution.compare() for solution in both(name))
    assert [getattr(one, key) for key in NUMBERS] == [getattr(other, key) for key in NUMBERS]


@pytest.mark.long
@pytest.mark.parametrize("name", a_quarter(UNFORCED, 2))
def test_the_second_variation_is_the_same(name, both):
    here, there = both(name)
    one, other = here.inertia, there.inertia
    assert (one.index, one.nullity, one.tolerance) == (other.index, other.nullity, other.tolerance)
    low, high = (second_variation(solution, 3).eigenvalues for solution in (here, there))
    assert low == pytest.approx(high, rel=SAME, abs=SAME * np.max(np.abs(high)))
    if CASES[name][3] is not None:
        times = [conjugate_points(solution) for solution in (here, there)]
        assert [c.multiplicity for c in times[0]] == [c.multiplicity for c in times[1]]
        assert [c.t for c in times[0]] == pytest.approx([c.t for c in times[1]], rel=1e-9)
    first, second = here.sensitivity(), there.sensitivity()
    for row, sign in (("q0", -1), ("q1", -1), ("t0", 1), ("t1", 1), ("q0q1", 1), ("q1q1", 1)):
        a, b = np.array(getattr(first, row)), np.array(getattr(second, row))
        assert np.allclose(a, sign * b, rtol=SAME, atol=SAME * np.max(np.abs(a)))


@pytest.mark.long
@pytest.mark.parametrize("name", a_quarter((x for x in CASES if x not in ("closed", "layers")), 2))
def test_an_action_of_the_other_sign_has_the_same_stationary_paths(name):
    """-L has the equations of motion of L; only what is least is not."""
    found = []
    for sign in (1, -1):
        problem, options = problem_of(name, 1, sign)
        found.append(ao.solve(problem, tol=1e-8, principle="stationary", **options))
    here, there = found
    same_bits(here.mesh.boundaries, there.mesh.boundaries, because=SIGN)
    same_bits(here.path.values, there.path.values, because=SIGN)
    same_bits([here.action, here.error], [-there.action, there.error], because=SIGN)
    assert flat(figures(here)) == flat(figures(there))
    one, other = (solution.compare() for solution in found)
    if name in UNFORCED:
        rates = [form(solution.discrete).frequency for solution in found]
        assert rates[1] == pytest.approx(rates[0], rel=SAME)
    if name in EXACT:
        assert [getattr(one, key) for key in NUMBERS] == [getattr(other, key) for key in NUMBERS]


# -- parts of a search and of a comparison ---------------------------------------------------


@pytest.mark.quick("pendulum")
@pytest.mark.parametrize("name", a_quarter(name for name in CASES if name != "closed"))
def test_a_path_under_way_is_measured_alike(name, both):
    """How sensitive, whether singular, what is missed: on a coarse mesh with something left."""
    found = []
    solution, _ = both(name)
    for side, sign in ((1, 1), (-1, 1), (1, -1)):
        problem, _ = problem_of(name, side, sign)
        ws = Workspace(problem, linear=problem.system.structure.linear)
        mesh = Mesh.uniform(problem.start.t, problem.end.t, 3, 4)
        ws.transcribe(mesh, Path(mesh, side * solution(mesh.nodes)))
        polished, missed, here = ws.follow(), ws.quadrature_shift(), ws.here
        tr, z, steep = here.tr, here.z, here.resolution.steep()
        step = side * np.linspace(-2.0, 1.0, tr.layout.size)
        known = polished, here.noise, here.gain, here.error, here.rough, here.singular
        row = [*known, *here.sizes, *here.lengths, tr.action_unit, *tr.row_units]
        row += [tr.relative_step(step), missed, here.with_probed(False).growth, *tr.uneven(z)]
        found.append(row + [cut for part in tr.cuts(z) for cut in part] + steep.ravel().tolist())
    for row in found[1:]:
        one, other = np.array(found[0], dtype=float), np.array(row, dtype=float)
        assert np.allclose(one, other, rtol=SAME, atol=1e-14, equal_nan=True)


@pytest.mark.long
@pytest.mark.parametrize(
    ("way", "goal", "stopped"),
    a_quarter(
        [(("start", "x"), 0.0, "goal"), (("end", "x"), 2.5, "goal"), (("end", "x"), -0.5, "goal")]
    ),
)
def test_a_trace_is_mirrored(way, goal, stopped):
    traces = []
    for side in (1, -1):
        problem, _ = problem_of("saddle", side)
        traces.append(ao.trace(problem, way, side * goal, tol=1e-7))
    one, other = traces
    assert stopped in one.stopped and stopped in other.stopped
    same_bits(one.values, -other.values, because=SIGN)
    same_bits(one.actions, other.actions, because=SIGN)
    assert np.array_equal(one.indices, other.indices)
    assert one.stats == other.stats
    assert [(m.kind, m.value) for m in one.marks] == [(m.kind, -m.value) for m in other.marks]
