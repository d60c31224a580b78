"""The discrete action against a second, slow one that is written out here.

The second one takes complex coordinates, so that its derivatives are exact by complex steps.
"""

import signal
from itertools import product

import numpy as np
import pytest
import systems
from helpers import a_quarter, at_once
from numpy.polynomial import Legendre, Polynomial

from actionopt.discrete.action.transcription import Transcription
from actionopt.discrete.matrices.factors import kkt_nonzeros
from actionopt.discrete.meshes.mesh import Mesh
from actionopt.mechanics.question.problem import Event, Periodic, Problem
from actionopt.mechanics.system import System
from actionopt.solver.refinement.ipopt import DIVERGING_ITERATES, Attempt, find
from actionopt.tools import interrupts

EPS = np.finfo(float).eps
STEP = 1e-30  # of a complex step: its square is below rounding
FORMULA_TOLERANCE = 1e-12  # two summations of a few hundred terms of size one
# Central differences of order six with step h: rounding eps / h and error h^6 f^(7) / 140.
DIFFERENCE_STEP = 3e-3
DIFFERENCE_TOLERANCE = 1e-10


# -- systems that use everything ---------------------------------------------------------------


def still(q, v, t, *, a):
    """Not quadratic, every second derivative there."""
    x, y = q
    u, w = v
    kinetic = (1 + y**2) * u**2 / 2 + w**2 + w**4 / 12 + u * w * np.cos(x) / 2
    return kinetic - a * np.sin(x * y) + x**2 * u * w / 5 - np.exp(y / 3)


def shaken(q, v, t, *, a):
    return still(q, v, t, a=a) * (1 + t / 3) + q[0] * v[1] * np.sin(2 * t)


def force(q, v, t):
    x, y = q
    u, w = v
    return [-u * np.sqrt(1 + u**2 + w**2) + x * y, np.cos(t) * w - y * u]


def surface(q, t, *, b):
    x, y = q
    return [x**2 * y + np.sin(y) * np.exp(x / 4) - b * t]


def line(q, t, *, b):
    return [q[0] * (1 + t) + 2 * q[1] - b]


LAGRANGIANS = {"autonomous": still, "shaken": shaken}
CONSTRAINTS = {"free": None, "line": line, "surface": surface}
FORCES = {"conservative": None, "forced": force}
ENDS = {
    "pinned": ([0.3, None], [None, 0.4]),  # replaced by whole events where nothing constrains
    "free": ([None, 0.2], [None, None]),
}
MESHES = {
    "equal": Mesh.uniform(0.5, 2.0, 3, 3),
    "mixed": Mesh([0.5, 0.7, 1.5, 1.6, 2.0], [4, 2, 4, 1]),
    "one": Mesh([0.5, 2.0], [6]),
}
COMBINATIONS = list(product(LAGRANGIANS, CONSTRAINTS, FORCES))
LAYOUTS = [("pinned", "mixed"), ("free", "mixed"), ("free", "equal"), ("pinned", "one")]
CASES = [  # two of the layouts with each, in turn
    (combination, *LAYOUTS[(k + k // 4 + more) % 4])
    for k, combination in enumerate(COMBINATIONS)
    for more in (0, 2)
]
_systems = {}


def name(value):
    return value if isinstance(value, str) else "-".join(value)


def system_of(lagrangian_name, constraint_name, force_name):
    key = lagrangian_name, constraint_name, force_name
    if key not in _systems:
        f = CONSTRAINTS[constraint_name]
        _systems[key] = System(
            LAGRANGIANS[lagrangian_name],
            ["x", "y"],
            parameters={"a": 1.7} | ({} if f is None else {"b": 0.6}),
            constraint=f,
            force=FORCES[force_name],
        )
    return _systems[key]


def transcribed(system, ends="pinned", mesh="mixed", lengths=(1.0, 1.0)):
    start, end = ENDS[ends]
    if ends == "pinned" and not system.m:
        start, end = [0.3, -0.1], [0.8, 0.4]
    mesh = MESHES[mesh]
    problem = Problem(system, Event(0.5, start), Event(2.0, end))
    return Transcription(problem, mesh, np.array(lengths))


def point(tr, seed=0):
    """Return a generic vector of unknowns: coordinates and multipliers of order one."""
    return np.random.default_rng(seed).uniform(-0.4, 0.4, tr.layout.size)


# -- the same action, slowly -------------------------------------------------------------------


def elements(mesh):
    """Yield for each element: nodes' indices, times, weights (half a length included), d/dt."""
    first = 0
    for left, right, d in zip(mesh.boundaries[:-1], mesh.boundaries[1:], mesh.degrees, strict=True):
        P = Legendre.basis(d)
        xi = np.concatenate([[-1.0], np.sort(P.deriv().roots().real), [1.0]])
        half = (right - left) / 2
        V = np.polynomial.legendre.legvander(xi, d)
        slopes = np.stack([Legendre.basis(k).deriv()(xi) for k in range(d + 1)], axis=1)
        w = half * 2 / (d * (d + 1) * P(xi) ** 2)
        yield first + np.arange(d + 1), left + half * (1 + xi), w, slopes @ np.linalg.inv(V) / half
        first += d


def slow_action(tr, Q, lam=None, forces=False):
    """Return S + sum w lam f for coordinates Q (K, n); also sum w Q (K, n) where asked."""
    system, parameters = tr.problem.system, tr.problem.parameters
    a, b = {"a": parameters["a"]}, {"b": parameters.get("b")}
    name, f, Qf = next(key for key, value in _systems.items() if value is system)
    S, work = 0.0, np.zeros(Q.shape)
    for index, t, w, D in elements(tr.mesh):
        q, v = Q[index].T, (D @ Q[index]).T
        S = S + w @ LAGRANGIANS[name](q, v, t, **a)
        if lam is not None and system.m:
            S = S + np.sum(w * np.nan_to_num(lam[index]).T * np.stack(CONSTRAINTS[f](q, t, **b)))
        if forces:
            work[index] += w[:, None] * np.stack(FORCES[Qf](q, v, t), axis=1)
    return (S, work) if forces else S


def slow_residual(tr, z):
    Q, lam = tr.unpack(z)
    gradient = np.zeros(Q.shape)
    for k in np.ndindex(Q.shape):
        nudged = Q.astype(complex)
        nudged[k] += STEP * 1j
        gradient[k] = slow_action(tr, nudged, lam).imag / STEP
    if tr.problem.system.structure.forced:
        gradient += slow_action(tr, Q, forces=True)[1]
    system = tr.problem.system
    rows = []
    if system.m:
        weight = np.zeros(len(Q))
        for index, _, w, _ in elements(tr.mesh):
            weight[index] += w
        f = system.constraint(Q.T, tr.mesh.nodes, parameters=tr.problem.parameters)
        rows = (weight * f).T[np.isfinite(lam)] / tr.row_unit
    scale = tr.x_unit / tr.action_unit
    return np.concatenate([gradient.ravel()[tr.layout.free] * scale, rows])


def difference(function, x):
    """Return the Jacobian of `function` at x by central differences of order six."""
    columns, h = [], DIFFERENCE_STEP
    for k in range(x.size):
        e = np.zeros(x.size)
        e[k] = h
        pairs = [(function(x + j * e) - function(x - j * e)) for j in (1, 2, 3)]
        columns.append((45 * pairs[0] - 9 * pairs[1] + pairs[2]) / (60 * h))
    return np.stack(columns, axis=1)


def dense(pattern, nonzeros):
    matrix = np.zeros(pattern.shape)
    matrix[pattern.row, pattern.col] = nonzeros
    return matrix


def kkt(tr, z):
    return dense(tr.layout.kkt, kkt_nonzeros(tr.layout, tr.kkt(z)))


def mismatch(found, known):
    """Largest difference, relative to the largest entry."""
    return np.max(np.abs(found - known), initial=0.0) / np.max(np.abs(known), initial=1e-300)


@pytest.mark.quick("shaken-free-conservative-pinned-one")
@pytest.mark.parametrize(("combination", "ends", "mesh"), a_quarter(CASES), ids=name)
def test_residual_is_the_derivative_of_the_action(combination, ends, mesh):
    tr = transcribed(system_of(*combination), ends, mesh, lengths=(0.7, 3.0))
    z = point(tr)
    action = tr.action(z[: tr.layout.unknowns]) * tr.action_unit
    assert action == pytest.approx(slow_action(tr, tr.coordinates(z)), rel=FORMULA_TOLERANCE)
    known = slow_residual(tr, z)
    assert mismatch(tr.residual(z), known) <= FORMULA_TOLERANCE
    # The oracle feels a change in the ninth digit.
    assert mismatch(tr.residual(z * (1 + 1e-9)), known) > 10 * FORMULA_TOLERANCE


@pytest.mark.long
@pytest.mark.parametrize(("combination", "ends", "mesh"), a_quarter(CASES, 2), ids=name)
def test_kkt_matrix_is_the_derivative_of_the_residual(combination, ends, mesh):
    tr = transcribed(system_of(*combination), ends, mesh, lengths=(0.7, 3.0))
    z, cut = point(tr), tr.layout.unknowns
    K = kkt(tr, z)
    assert mismatch(K, difference(tr.residual, z)) <= DIFFERENCE_TOLERANCE
    elsewhere = kkt(tr, z * (1 + 1e-6))
    assert mismatch(elsewhere, K) > 10 * DIFFERENCE_TOLERANCE  # the oracle would have seen it
    far = point(tr, seed=1)  # nothing of the first point is left over
    assert mismatch(kkt(tr, far), difference(tr.residual, far)) <= DIFFERENCE_TOLERANCE
    if tr.layout.rows:
        J = dense(tr.layout.jacobian, tr.jacobian(z[:cut]))
        assert mismatch(J, K[cut:, :cut]) <= EPS
    if not tr.problem.system.structure.forced:
        H = dense(tr.layout.hessian, tr.hessian(z))
        assert np.all(np.tril(H, -1) == 0)
        assert mismatch(H + np.triu(H, 1).T, K[:cut, :cut]) <= 4 * EPS
        assert mismatch(K, K.T) <= 4 * EPS


@pytest.mark.quick("autonomous-free-conservative-blocks", "autonomous-free-conservative-sparse")
@pytest.mark.parametrize("storage", ["blocks", "sparse"])
@pytest.mark.parametrize("combination", a_quarter((x,) for x in COMBINATIONS), ids="-".join)
def test_the_matrix_of_a_closed_path_is_the_derivative_of_the_residual(
    monkeypatch, combination, storage
):
    """Units of action and coordinates are not one: every part of the matrix has them."""
    monkeypatch.setattr(
        "actionopt.discrete.matrices.layout.BLOCK_SIZE", 60 if storage == "blocks" else 0
    )
    monkeypatch.setattr("actionopt.discrete.matrices.layout.FILLED", 1.0)
    monkeypatch.setattr("actionopt.discrete.matrices.layout.SLIM", 0)
    system = system_of(*combination)
    system.layouts.clear()  # one that another storage made
    problem = Problem(system, Event(0.5, [None, None]), Periodic(2.0, advance=[0.3, 0.0]))
    tr = Transcription(problem, MESHES["mixed"], np.array([0.7, 3.0]))
    assert tr.layout.storage == storage and not 0.5 < tr.action_unit < 2
    z = point(tr)
    assert mismatch(kkt(tr, z), difference(tr.residual, z)) <= DIFFERENCE_TOLERANCE
    assert mismatch(kkt(tr, z * (1 + 1e-6)), kkt(tr, z)) > 10 * DIFFERENCE_TOLERANCE


# -- the quadrature ------------------------------------------------------------------------------


POLYNOMIAL = System(
    lambda q, v, t, *, k: t * v[0] ** 2 / 2 - k * t * q[0] + q[0] * v[0], ["x"], parameters={"k": 2}
)


def exact_action(q, k, t0, t1):
    """Integrate L along a polynomial q(t) by the rules for polynomials."""
    t, v = Polynomial([0, 1]), q.deriv()
    L = (t * v**2 / 2 - k * t * q + q * v).integ()
    return L(t1) - L(t0)


@at_once("degree", [1, 2, 3, 5, 8])
@at_once("k", [2.0, -0.7])
def test_action_of_polynomials_is_exact(degree, k):
    # t v^2 has degree 2d - 1, the highest that d + 1 LGL points integrate (d > 1 for t q).
    q = Polynomial(np.random.default_rng(degree).uniform(-1, 1, degree + 1))
    k = k if degree > 1 else 0.0
    mesh = Mesh([0.5, 0.9, 1.1, 2.0], degree)
    events = [Event(t, [q(t)]) for t in (0.5, 2.0)]
    tr = Transcription(Problem(POLYNOMIAL, *events, parameters={"k": k}), mesh, np.ones(1))
    action = tr.action_and_gradient(q(mesh.nodes)[:, None])[0]
    exact = exact_action(q, k, 0.5, 2.0)
    assert action == pytest.approx(exact, rel=FORMULA_TOLERANCE)
    assert action != pytest.approx(exact_action(1.0001 * q, k, 0.5, 2.0), rel=1e-6)


def test_degree_two_d_is_summed_by_the_rule_and_not_integrated():
    square = System(lambda q, v, t: v[0] ** 2 / 2 + q[0] ** 2, ["x"])
    tr = Transcription(Problem(square, Event(0, 0), Event(2, 2)), Mesh([0, 2], 2), np.ones(1))
    action = tr.action_and_gradient(tr.mesh.nodes[:, None] ** 2 / 2)[0]
    # q = t^2 / 2: int v^2 / 2 = 4/3; int q^2 = 8/5, which Simpson's rule makes 5/3.
    assert action == pytest.approx(4 / 3 + 5 / 3, rel=FORMULA_TOLERANCE)


# -- momenta and multipliers -------------------------------------------------------------------


@at_once("mesh", [Mesh([0, 0.1, 1.5], [5, 2]), Mesh.uniform(0, 1.5, 7, 3)])
@at_once(("m", "g", "a"), [(2.0, 9.81, 0.0), (0.3, -1.5, 4.0)])
@at_once("row", [1.0, 1e3])
def test_rows_have_the_multipliers_of_the_continuous_problem(mesh, m, g, a, row):
    # A table that rises as a t^2 / 2 pushes the mass with m (g + a), at every node.
    table = System(
        lambda q, v, t, *, m, g: m * (v[0] ** 2 + v[1] ** 2) / 2 - m * g * q[1],
        ["x", "y"],
        parameters={"m": m, "g": g, "a": a},
        constraint=lambda q, t, *, a: row * (q[1] - a * t**2 / 2),
    )
    problem = Problem(table, Event(0.0, [0, 0]), Event(1.5, [1, a * 1.5**2 / 2]))
    tr = Transcription(problem, mesh, problem.scales)
    Q = np.stack([mesh.nodes / 1.5, a * mesh.nodes**2 / 2], axis=1)
    lam = np.full((len(Q), 1), m * (g + a) / row)
    z = tr.pack(Q, lam)
    assert np.max(np.abs(tr.residual(z))) <= FORMULA_TOLERANCE
    assert np.max(np.abs(tr.residual(tr.pack(Q, 1.001 * lam)))) > 1e-6
    found, same = tr.unpack(z)
    assert np.allclose(found, Q, rtol=1e-15, atol=0)
    assert np.isnan(same[[0, -1]]).all()  # pinned ends have no row
    assert np.allclose(same[1:-1], lam[1:-1], rtol=1e-15)


def test_a_row_stays_at_an_end_that_it_must_decide():
    tr = transcribed(system_of("autonomous", "line", "conservative"), "pinned", "equal")
    assert tr.layout.rows == tr.layout.node_count
    assert tr.layout.unknowns == 2 * tr.layout.node_count - 2


@pytest.mark.parametrize(
    ("lagrangian", "turns"),
    [
        (lambda q, v, t: 3 * (v[0] ** 2 - 4 * q[0] ** 2 + v[1] ** 2 - 49 * q[1] ** 2), 14.0),
        (lambda q, v, t: v[0] * v[1] - 4 * q[0] * q[1], 0.0),  # none of one coordinate alone
    ],
)
def test_turns_are_the_largest_frequency_times_the_duration(lagrangian, turns):
    problem = Problem(
        System(lagrangian, ["x", "y"]), Event(1.0, [0.0, 1.0]), Event(3.0, [1.0, 0.0])
    )
    tr = Transcription(problem, Mesh.uniform(1.0, 3.0, 3, 4), np.ones(2))
    assert tr.turns(tr.pack(tr.straight())) == pytest.approx(turns)


def test_turns_are_those_of_most_of_the_time_and_not_of_most_of_the_nodes():
    """A stiff well is crossed in a moment, however many elements it may take."""
    well = System(lambda q, v, t: v[0] ** 2 / 2 + np.exp(-((q[0] / 1e-3) ** 2)), ["x"])
    problem = Problem(well, Event(0.0, [-1.0]), Event(1.0, [1.0]))
    since = np.r_[0.0, np.linspace(0.499, 0.501, 9), 1.0]
    tr = Transcription(problem, Mesh.over(0.0, 1.0, since, 4), np.ones(1))
    assert tr.turns(tr.pack(tr.straight())) < 1e-6


def test_momenta_are_the_derivatives_of_the_action_by_the_end_points():
    tr = transcribed(system_of("shaken", "free", "conservative"))
    z = point(tr)
    for k, p, sign in ((0, 0, -1), (-1, 1, 1)):
        for i in range(2):
            nudged = tr.coordinates(z).astype(complex)
            nudged[k, i] += STEP * 1j
            known = sign * slow_action(tr, nudged).imag / STEP
            assert tr.momenta(z)[p][i] == pytest.approx(known, rel=FORMULA_TOLERANCE)


# -- structure -----------------------------------------------------------------------------------


@pytest.mark.parametrize("masses", [4, 12])
def test_a_chain_has_a_banded_hessian(masses):
    def coupled(q, v, t):
        springs = sum((q[i + 1] - q[i]) ** 4 for i in range(masses - 1))
        return sum(u**2 for u in v) / 2 - springs

    chain = System(coupled, [f"x{i}" for i in range(masses)])
    ends = [Event(t, np.arange(masses) + t) for t in (0, 1)]
    elements, d = 5, 3
    mesh = Mesh.uniform(0, 1, elements, d)
    tr = Transcription(Problem(chain, *ends), mesh, np.ones(masses))
    H = tr.layout.hessian
    mass, other = H.row % masses, H.col % masses
    node, other_node = H.row // masses, H.col // masses
    assert np.all(np.abs(mass - other) <= 1)  # neighbours only
    assert np.all(np.abs(node - other_node) <= d)  # of one element only
    assert np.max(np.abs(H.row - H.col)) <= d * masses
    # The mass joins a coordinate to itself at the nodes of its element, springs to its neighbours
    # at one node; the first and last nodes are pinned.
    interior = elements * d - 1
    pairs = elements * d * (d + 1) // 2 - 2 * d
    assert H.nnz == masses * (interior + pairs) + (masses - 1) * interior


def test_nothing_is_built_for_what_is_absent():
    plain = System(lambda q, v, t, *, k: v[0] ** 2 / 2 - k * q[0] ** 4, ["x"], parameters={"k": 1})
    tr = Transcription(Problem(plain, Event(0, 0), Event(1, 1)), Mesh([0, 1], 6), np.ones(1))
    z = point(tr)
    find(tr, z, "least")
    find(tr, z, "stationary")
    tr.residual(z)
    tr.kkt(z)
    assert set(plain.derived) == {"first", "second"}
    assert set(tr.counts) == {"first", "second"}
    assert tr.layout.rows == 0 and tr.layout.size == tr.layout.unknowns == 5


def test_an_affine_constraint_has_no_curvature():
    system = systems.particle("x y", constraint=lambda q, t: q[0] - q[1])
    problem = Problem(system, Event(0, [0, 0]), Event(1, [1, 1]))
    tr = Transcription(problem, Mesh([0, 1], 4), np.ones(2))
    tr.kkt(point(tr))
    assert "constraint_curvature" not in system.derived
    assert "force" not in system.derived


def test_counters_count():
    tr = transcribed(system_of("shaken", "surface", "forced"))
    tr.counts.clear()
    z = point(tr)
    x = z[: tr.layout.unknowns]
    tr.gradient(x)
    tr.action(x)  # the same point: nothing new
    tr.residual(z)
    tr.kkt(z)
    assert tr.counts["first"] == tr.counts["force"] == 1
    assert tr.counts["second"] == tr.counts["force_jacobian"] == 1
    assert tr.counts["constraint"] == tr.counts["constraint_curvature"] == 1
    assert tr.counts["constraint_jacobian"] == 1
    tr.residual(z + 1e-3)
    assert tr.counts["first"] == 2


def test_problems_of_one_system_share_their_layout():
    system = System(lambda q, v, t, *, k: v[0] ** 2 / 2 - k * q[0] ** 4, ["x"], parameters={"k": 1})

    def layout(ends=(0.0, 1.0), T=1.0, k=1.0, degrees=(4, 5)):
        events = Event(0.0, ends[0]), Event(T, ends[1])
        mesh = Mesh([0, 0.3 * T, T], degrees)
        return Transcription(Problem(system, *events, parameters={"k": k}), mesh, np.ones(1)).layout

    first = layout()
    assert layout(ends=(2.0, 3.0), T=5.0, k=7.0) is first
    assert layout(degrees=(5, 4)) is not first
    assert layout(ends=(0.0, [None])) is not first


def test_systems_share_what_numbers_their_nodes():
    def layout(force=None, degree=4):
        system = System(lambda q, v, t: v[0] ** 2 / 2 - q[0] ** 4, ["x"], force=force)
        problem = Problem(system, Event(0.0, 0.0), Event(1.0, 1.0))
        return Transcription(problem, Mesh.uniform(0.0, 1.0, 3, degree), np.ones(1)).layout

    first, second = layout(), layout()
    assert second is not first and second.numbering is first.numbering
    assert second.blocks is first.blocks
    assert layout(force=lambda q, v, t: -v).blocks is not first.blocks
    assert layout(degree=5).numbering is not first.numbering


# -- what Ipopt sees -----------------------------------------------------------------------------


def falling(q, v, t, *, g):
    return (v[0] ** 2 + v[1] ** 2) / 2 - g * q[1]


ROD = System(
    falling,
    ["x", "y"],
    parameters={"g": 9.81},
    constraint=lambda q, t: q[0] ** 2 + q[1] ** 2 - 1,
)
SOFT = System(
    lambda q, v, t, *, g: (v[0] ** 2 + v[1] ** 2) / 2 + g * q[1] ** 4,
    ["x", "y"],
    parameters={"g": 9.81},
)


WEAKEST = 5e-3


def bound(system):
    """Return a transcription near a least path, and its vector there."""
    a, b = 0.3, -0.2
    ends = [Event(t, [np.sin(x), -np.cos(x)]) for t, x in ((0.0, a), (0.4, b))]
    tr = Transcription(Problem(system, *ends), Mesh.uniform(0.0, 0.4, 3, 4), np.array([0.3, 1.0]))
    angle = np.linspace(a, b, tr.layout.node_count)
    return tr, tr.pack(np.stack([np.sin(angle), -np.cos(angle)], axis=1))


@pytest.mark.parametrize("system", [ROD, SOFT], ids=["rod", "soft"])
def test_least_and_stationary_find_one_path_and_its_multipliers(system):
    tr, z = bound(system)
    least, root = find(tr, z, "least"), find(tr, z, "stationary")
    assert least.converged and root.converged and not least.diverged
    # Both stop at a scaled residual of 1e-6, and the matrix has no eigenvalue below WEAKEST.
    K = kkt(tr, root.z)
    assert np.min(np.abs(np.linalg.eigvalsh(K))) > WEAKEST
    for attempt in (least, root):
        assert np.max(np.abs(tr.residual(attempt.z))) <= 2e-6
    assert np.max(np.abs(least.z - root.z)) <= 4e-6 / WEAKEST * np.sqrt(root.z.size)
    assert least.iterations < 15  # the exact Hessian contracts quadratically


@pytest.mark.parametrize("factor", [1.0, 2.5, 0.0])
def test_hessian_of_the_lagrangian_has_the_factor_of_the_objective(factor):
    tr, z = bound(ROD)
    z = z + 0.1 * point(tr)
    find(tr, z, "least")
    hessian = tr.layout.solvers["least"].solver.get_function("nlp_hess_l")
    cut = tr.layout.unknowns
    H = np.asarray(hessian(z[:cut], [], factor, z[cut:]))

    def gradient(x):
        J = tr.layout.jacobian
        pull = np.bincount(J.col, tr.jacobian(x) * z[cut + J.row], cut)
        return factor * tr.gradient(x) + pull

    known = np.triu(difference(gradient, z[:cut]))
    assert mismatch(np.triu(H), known) <= DIFFERENCE_TOLERANCE
    assert np.all(np.tril(H, -1) == 0)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_running_away_is_seen(side):
    oscillator = systems.oscillator()
    ends = Event(0, side), Event(5, 0.5 * side)
    problem = Problem(oscillator, *ends)  # past the conjugate time, pi
    tr = Transcription(problem, Mesh.uniform(0, 5, 4, 6), np.ones(1))
    attempt = find(tr, tr.pack(tr.straight()), "least")
    assert attempt.diverged and not attempt.converged
    for sign in (1, -1):  # also where Ipopt stopped before it said so
        far = np.array([0.0, sign * 2 * DIVERGING_ITERATES])
        assert Attempt(far, "Maximum_Iterations_Exceeded", 5).diverged
    assert find(tr, tr.pack(tr.straight()), "stationary").converged


class Late(Exception):
    """What a time limit raises."""


CALLED = [
    ("least", "action"),
    ("least", "gradient"),
    ("least", "constraint"),
    ("least", "hessian"),
    ("stationary", "residual"),
    ("stationary", "kkt"),
]


@pytest.mark.parametrize(
    "error", a_quarter([KeyboardInterrupt(), MemoryError(), SystemExit(3), RuntimeError("no")])
)
@pytest.mark.parametrize(("principle", "method"), CALLED)
def test_an_exception_within_a_function_is_raised_again(
    monkeypatch, capfd, principle, method, error
):
    tr, z = bound(ROD)
    z = z + 0.1 * point(tr)
    converged = find(tr, z, principle).z
    real, calls = getattr(tr, method), []

    def failing(x):
        calls.append(x)
        if len(calls) == 2:
            raise error
        return real(x)

    with monkeypatch.context() as patch:
        patch.setattr(tr, method, failing)
        with pytest.raises(type(error)) as caught:
            find(tr, z, principle)
    assert caught.value is error and len(calls) == 2  # nothing was computed after it
    assert np.array_equal(find(tr, z, principle).z, converged)  # the solver is as good as before
    assert capfd.readouterr() == ("", "")


@pytest.fixture
def alarm():
    """Let the alarm raise an exception."""

    def late(number, frame):
        raise Late

    before = signal.signal(signal.SIGALRM, late)
    yield
    signal.setitimer(signal.ITIMER_REAL, 0)
    assert signal.getsignal(signal.SIGALRM) is late
    signal.signal(signal.SIGALRM, before)


@pytest.mark.long
@pytest.mark.skipif(not hasattr(signal, "SIGALRM"), reason="needs an alarm")
@pytest.mark.usefixtures("alarm")
def test_what_a_signal_handler_raises_is_raised_again(capfd):
    """It arrives in an evaluation, between two of them or within Ipopt: wherever it likes."""
    tr, z = bound(ROD)
    z = z + 0.1 * point(tr)
    converged, random = find(tr, z, "least").z, np.random.default_rng(6)
    for delay in random.uniform(1e-3, 2e-2, 20):
        with pytest.raises(Late):
            signal.setitimer(signal.ITIMER_REAL, delay)
            for _ in range(1000):  # some seconds
                # Not numpy's array_equal, which says False of an exception that arrives in it.
                assert find(tr, z, "least").z.tobytes() == converged.tobytes()
    assert capfd.readouterr() == ("", "")


@pytest.mark.skipif(not hasattr(signal, "SIGALRM"), reason="needs an alarm")
@pytest.mark.usefixtures("alarm")
def test_handlers_are_as_before_when_one_raises_while_they_are_set_back(monkeypatch):
    tr, z = bound(ROD)
    converged, set_back = find(tr, z, "least").z, interrupts._set
    late, before = signal.getsignal(signal.SIGALRM), signal.getsignal(signal.SIGTERM)

    def then_alarm(number, handler):
        set_back(number, handler)
        if number == signal.SIGALRM and handler is late:
            signal.raise_signal(number)

    assert signal.SIGTERM > signal.SIGALRM  # and set back after it
    signal.signal(signal.SIGTERM, late)
    try:
        with monkeypatch.context() as patch, pytest.raises(Late):
            patch.setattr(interrupts, "_set", then_alarm)
            find(tr, z, "least")
        with pytest.raises(Late):  # not kept for a body that has ended
            signal.raise_signal(signal.SIGTERM)
    finally:
        signal.signal(signal.SIGTERM, before)
    assert find(tr, z, "least").z.tobytes() == converged.tobytes()


@pytest.mark.skipif(not hasattr(signal, "SIGALRM"), reason="needs an alarm")
def test_a_signal_handler_may_return_and_may_be_replaced(monkeypatch):
    tr, z = bound(ROD)
    heard, before = [], signal.getsignal(signal.SIGALRM)

    def again(number, frame):
        heard.append("again")

    def first(number, frame):
        heard.append("first")
        signal.signal(signal.SIGALRM, again)

    real = tr.action
    monkeypatch.setattr(tr, "action", lambda x: signal.raise_signal(signal.SIGALRM) or real(x))
    signal.signal(signal.SIGALRM, first)
    try:
        assert find(tr, z, "least").converged
        assert signal.getsignal(signal.SIGALRM) is again
    finally:
        signal.signal(signal.SIGALRM, before)
    assert heard[:2] == ["first", "again"]


def test_magnitudes_are_those_of_coordinates_far_from_zero_and_one_of_multipliers():
    system = systems.particle("x y", constraint=lambda q, t: q[0] - q[1])
    problem = Problem(system, Event(0.0, [-1e6, -1e6]), Event(1.0, [-1e6 + 1, -1e6 + 1]))
    tr = Transcription(problem, Mesh.uniform(0.0, 1.0, 2, 4), problem.lengths)
    far = tr.magnitudes[: tr.layout.unknowns]
    assert far == pytest.approx(1 + 1e6 / np.tile(tr.lengths, far.size // 2), rel=1e-5)
    assert np.all(tr.magnitudes[tr.layout.unknowns :] == 1) and tr.layout.size > far.size
