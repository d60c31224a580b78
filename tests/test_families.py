"""Ends that leave a family of paths: said at any tolerance, with its dimension."""

import numpy as np
import pytest
import systems
from helpers import slow

import actionopt as ao
from actionopt import scenes

SPHERE = systems.particle("x y z", constraint=lambda q, t: (q @ q - 1) / 2)
SPACE = systems.kepler("x y z")
PLANE = systems.oscillator("x y")


def antipodes(axis):
    a = np.array(axis) / np.linalg.norm(axis)
    return ao.Problem(SPHERE, ao.Event(0.0, a), ao.Event(1.0, -a))


def half_an_orbit(r):
    end = ao.Event(np.pi * ((1 + r) / 2) ** 1.5, [-r, 0.0, 0.0])
    return ao.Problem(SPACE, ao.Event(0.0, [1.0, 0.0, 0.0]), end)


FAMILIES = {
    "antipodes": (antipodes([0.0, 0.0, 1.0]), 1),
    "antipodes aslant": (antipodes([1.0, 2.0, 2.0]), 1),
    "half a circle": (half_an_orbit(1.0), 1),
    "half an ellipse": (half_an_orbit(1.52), 1),
    "half a period": (ao.Problem(PLANE, ao.Event(0.0, [1, 0.5]), ao.Event(np.pi, [-1, -0.5])), 2),
}


@pytest.mark.quick("half a period-0.001", "half a period-1e-08")
@pytest.mark.parametrize(
    ("name", "tol"),
    [
        ("antipodes", 1e-3),
        pytest.param("antipodes aslant", 1e-8, marks=pytest.mark.slow),
        pytest.param("antipodes", 1e-12, marks=pytest.mark.slow),
        pytest.param("half a circle", 1e-3, marks=pytest.mark.slow),
        *(pytest.param("half an ellipse", tol, marks=pytest.mark.slow) for tol in (1e-3, 1e-12)),
        *(("half a period", tol) for tol in (1e-3, 1e-8)),
    ],
)
def test_a_family_is_said_to_be_one(name, tol):
    problem, dimension = FAMILIES[name]
    solution = ao.solve(problem, tol=tol, throw=False)
    assert solution.status is ao.Status.DEGENERATE
    if "nullity" in solution.stats:  # else the linear equations themselves were singular
        assert solution.stats["nullity"] == dimension
        assert solution.kind == "degenerate"
    assert solution.stats["condition"] > 1e8


@pytest.mark.slow
@pytest.mark.parametrize("tol", [1e-2, 1e-6])
@pytest.mark.parametrize("seed", [3, 4])
def test_a_family_is_one_in_every_direction(seed, tol):
    """Newton's method stops at another distance from singular matrices in each of them."""
    axis = np.random.default_rng(seed).normal(size=3)
    assert ao.solve(antipodes(axis), tol=tol, throw=False).status is ao.Status.DEGENERATE


@pytest.mark.long
def test_the_message_has_the_dimension_and_the_condition():
    with pytest.raises(ao.SolveError, match=r"condition about .*a family of dimension 1"):
        ao.solve(antipodes([0.0, 0.0, 1.0]))


@pytest.mark.long
def test_a_guess_in_a_plane_of_symmetry_does_not_hide_it():
    """Nothing ever leaves the plane z = 0, in which the half ellipse is determined."""
    r = 1.52
    half = np.pi * ((1 + r) / 2) ** 1.5

    def guess(t):
        s = np.pi * t / half
        radius = 2 * r / (1 + r) / (1 + (r - 1) / (1 + r) * np.cos(s))
        return np.stack([radius * np.cos(s), radius * np.sin(s), 0 * s])

    solution = ao.solve(half_an_orbit(r), guess=guess, throw=False)
    assert solution.status is ao.Status.DEGENERATE
    plane = systems.kepler()
    problem = ao.Problem(plane, ao.Event(0.0, [1.0, 0.0]), ao.Event(half, [-r, 0.0]))
    assert ao.solve(problem, guess=lambda t: guess(t)[:2]).kind == "minimum"


@pytest.mark.long
@pytest.mark.parametrize("miss", [1e-2, 1e-3])
def test_beside_the_antipode_there_is_one_path(miss):
    angle = np.pi - miss
    end = ao.Event(1.0, [np.sin(angle), 0.0, np.cos(angle)])
    solution = ao.solve(ao.Problem(SPHERE, ao.Event(0.0, [0.0, 0.0, 1.0]), end))
    assert solution.action == pytest.approx(angle**2 / 2, rel=1e-9)
    assert solution.kind == "minimum"


@pytest.mark.long
def test_no_index_is_asked_of_many_unknowns_that_are_no_family(monkeypatch):
    """A few solutions tell: on 10,000 elements the index tripled the time of the solve."""
    long = scenes.get("double_pendulum", end=(0.3, 0.2), duration=0.5).problem
    coarse = ao.solve(long, tol=1e-6)
    monkeypatch.setattr("actionopt.analysis.quadratic.index.inertia", None)
    mesh = ao.Mesh.uniform(0.0, 0.5, 3000, 4)
    assert ao.solve(long, mesh=mesh, guess=coarse).success


@pytest.mark.slow
def test_a_family_shows_to_a_loose_tolerance():
    """Half way round a centre of force in nine dimensions, in any plane through the ends."""
    system = ao.System(lambda q, v, t: v @ v / 2 + 1 / np.sqrt(q @ q + 0.1), list("abcdefghi"))
    one, aside = np.eye(9)[0], np.cos(np.arange(9) + 1.0) * (np.arange(9) > 0)
    aside /= np.linalg.norm(aside)
    problem = ao.Problem(system, ao.Event(0.0, one), ao.Event(3.0, -one))

    def guess(t):
        return np.outer(one, np.cos(np.pi * t / 3)) + np.outer(aside, np.sin(np.pi * t / 3))

    assert ao.solve(problem, guess=guess, tol=1e-3, throw=False).status is ao.Status.DEGENERATE


TURN = np.linspace(0.0, 2 * np.pi, 33)
ISOTROPIC = systems.oscillator("x y")
TWO_TO_ONE = ao.System(lambda q, v, t: (v @ v - q[0] ** 2 - 4 * q[1] ** 2) / 2, ["x", "y"])
KEPLER = systems.kepler()
ISOCHRONOUS = ao.System(lambda q, v, t: (v @ v - q @ q - 0.2 / q[0] ** 2) / 2, ["x", "y"])
# Waypoints on a member, for a shape c and an angle; energy; index and nullity, which a count in
# Fourier coefficients and the duration gives as well; and the dimension but for the phase.
CLOSED = {
    "isotropic": (
        ISOTROPIC,
        lambda c, a: [c * np.cos(TURN), np.sqrt(2 - c * c) * np.sin(TURN + a)],
        (1.0, (3, 3)),
    ),
    "two to one": (
        TWO_TO_ONE,
        lambda c, a: [
            np.sqrt(2) * c * np.cos(TURN),
            np.sqrt((1 - c * c) / 2) * np.sin(2 * TURN + a),
        ],
        (1.0, (5, 3)),
    ),
    "Kepler": (
        KEPLER,
        lambda c, a: [np.cos(TURN + a) - c / 2, np.sqrt(1 - c * c / 4) * np.sin(TURN + a)],
        (-0.5, (1, 3)),
    ),
    "isochronous": (
        ISOCHRONOUS,
        lambda c, a: [
            1.05 + 0.6 * c * np.cos(2 * TURN),
            1.2 * np.sqrt(1 - c * c) * np.sin(TURN + a),
        ],
        (1.5, (5, 3)),
    ),
}


@pytest.mark.parametrize(
    "name",
    ["isotropic", *slow(*(x for x in CLOSED if x != "isotropic"))],
)
@pytest.mark.parametrize(
    "shape", [0.3, *(pytest.param(c, marks=pytest.mark.slow) for c in (0.5, 0.8))]
)
def test_closed_paths_of_one_energy_are_a_family_of_one_index(name, shape):
    system, guess, (energy, counted) = CLOSED[name]
    problem = ao.Problem(system, ao.Event(0.0, None), ao.Periodic(None), energy=energy)
    with pytest.raises(ao.SolveError, match="are a family of dimension 2") as raised:
        ao.solve(problem, guess=np.array(guess(shape, 0.7)), tol=1e-6)
    found = raised.value.solution
    assert found.status is ao.Status.DEGENERATE and found.error < 1e-6
    assert (found.inertia.index, found.inertia.nullity) == counted
    assert found.stats["nullity"] == counted[1] and found.kind == "degenerate"


@pytest.mark.slow
@pytest.mark.parametrize("tol", [1e-3, 1e-4, 1e-6])
@pytest.mark.parametrize("name", list(CLOSED))
@pytest.mark.parametrize("aside", [0.0, 0.5])
def test_closed_paths_are_a_family_at_loose_tolerances(name, tol, aside):
    """Also in space, aslant by an angle, with a third coordinate of the frequency of another."""
    system, guess, (energy, (index, nullity)) = CLOSED[name]
    points = np.array(guess(0.45, 0.7))
    if aside:
        in_space = {
            "isotropic": lambda q, v, t: (v @ v - q @ q) / 2,
            "two to one": lambda q, v, t: (v @ v - q @ q - 3 * q[1] ** 2) / 2,
            "Kepler": lambda q, v, t: v @ v / 2 + 1 / np.sqrt(q @ q),
            "isochronous": lambda q, v, t: (v @ v - q @ q - 0.2 / q[0] ** 2) / 2,
        }
        system = ao.System(in_space[name], ["x", "y", "z"])
        turned = 0 if name == "two to one" else 1
        points = np.array([*points, np.sin(aside) * points[turned]])
        points[turned] *= np.cos(aside)
        index, nullity = index + 1, nullity + 2
    problem = ao.Problem(system, ao.Event(0.0, None), ao.Periodic(None), energy=energy)
    found = ao.solve(problem, guess=points, tol=tol, throw=False)
    assert found.status is ao.Status.DEGENERATE and found.error <= tol
    assert (found.inertia.index, found.inertia.nullity) == (index, nullity)


@pytest.mark.long
@pytest.mark.parametrize("points", [13, pytest.param(33, marks=pytest.mark.slow)])
@pytest.mark.parametrize("r", [0.9, pytest.param(1.4, marks=pytest.mark.slow)])
def test_a_rough_circle_leads_to_the_one_of_its_energy(r, points):
    """Round a centre a shift of time is a turn, and is not on the way to it."""
    system = ao.System(lambda q, v, t: (v @ v - q @ q) / 2 - (q @ q) ** 2 / 4, ["x", "y"])
    problem = ao.Problem(system, ao.Event(0.0, None), ao.Periodic(None), energy=2.5)
    turn = np.linspace(0.0, 2 * np.pi, points)
    found = ao.solve(problem, guess=r * np.array([np.cos(turn), np.sin(turn)]), tol=1e-6)
    square = found(np.linspace(0.0, found.duration, 7))
    square = (square * square).sum(axis=0)
    exact = (np.sqrt(34) - 2) / 3  # r^2 + 3 r^4 / 4 = 5 / 2
    assert np.abs(square - exact).max() <= 1e-5
    assert found.duration == pytest.approx(2 * np.pi / np.sqrt(1 + exact), rel=1e-6)
    assert found.inertia.nullity == found.inertia.moves == 1


def test_the_motion_itself_leads_to_itself_in_a_family():
    """Newton's method may go to any member of it, to rest as well."""
    problem = ao.Problem(ISOTROPIC, ao.Event(0.0, None), ao.Periodic(2 * np.pi))
    circle = ao.solve(
        problem, guess=lambda t: np.array([np.cos(t), np.sin(t)]), tol=1e-6, throw=False
    )
    assert circle.status is ao.Status.DEGENERATE
    assert np.ptp(circle.path.values, axis=1) == pytest.approx(2.0, abs=0.2)


@pytest.mark.long
def test_five_points_on_a_circle_lead_to_a_resolved_ellipse():
    """Of a given period the family has all dimensions there are, its size among them."""
    turn = np.linspace(0.0, 2 * np.pi, 5)
    problem = ao.Problem(ISOTROPIC, ao.Event(0.0, None), ao.Periodic(2 * np.pi))
    guess = np.array([np.cos(turn), np.sin(turn)])
    found = ao.solve(problem, guess=guess, tol=1e-6, throw=False)
    assert found.status is ao.Status.DEGENERATE and found.error <= 1e-6
    assert found.inertia.nullity == 4
    assert np.ptp(found.path.values, axis=1) == pytest.approx(2.0, abs=0.1)


@pytest.mark.quick("<lambda>1-<lambda>")
@pytest.mark.parametrize("guess", [None, lambda t: [1.5 - np.cos(2 * np.pi * t) / 2, np.sin(t)]])
@pytest.mark.parametrize("on", [lambda q, t: q[0] - 0.3, lambda q, t: q[0] ** 2 + q[1] ** 2 - 1])
def test_rests_on_a_line_are_a_family(on, guess):
    # A constant has no rates: the variation along the line shows in no kinetic energy.
    free = systems.particle("x y")
    problem = ao.Problem(free, ao.Event(0.0, None, on=on), ao.Periodic(1.0))
    found = ao.solve(problem, guess=guess, throw=False)
    assert found.status is ao.Status.DEGENERATE and found.inertia.nullity == 1
    assert abs(on(found(0.5), 0.5)) < 1e-12


def rests(n, V, start=None, guess=None, T=2.2, **given):
    """Return the closed path in a potential near a place at which the guess rests, if there is."""
    system = ao.System(lambda q, v, t: v @ v / 2 - V(q), [f"x{i}" for i in range(n)])
    if isinstance(guess, list):
        place = np.array(guess)
        guess = lambda t: np.repeat(place[:, None], np.size(t), axis=1)  # noqa: E731
    start = ao.Event(0.0, [None] * n if start is None else start)
    return ao.solve(ao.Problem(system, start, ao.Periodic(T)), guess=guess, throw=False, **given)


@pytest.mark.quick("0.7-None-1", "None-0.7-3")
@pytest.mark.parametrize("n", [1, 3])
@pytest.mark.parametrize("guess, given", [(None, None), (None, 0.7), (0.7, None), (0.7, 0.0)])
def test_rests_of_a_free_body_are_told_apart_by_moving_it(n, guess, given):
    start = [given, *[None] * (n - 1)]
    found = rests(n, lambda q: 0, start, None if guess is None else [guess] * n)
    assert found.status is ao.Status.SOLVED and found.kind == "minimum"
    left = n if given is None else n - 1
    assert (found.inertia.index, found.inertia.nullity, found.inertia.moves) == (0, left, left)
    assert given is None or found.start.q[0] == pytest.approx(given, abs=1e-12)


@pytest.mark.quick("0.001")
@pytest.mark.parametrize("off", [0.0, 1e-3])
def test_rests_along_a_curve_are_a_family(off):
    found = rests(2, lambda q: (q[1] - q[0] ** 2) ** 2, guess=[0.5, 0.25 + off])
    assert found.status is ao.Status.DEGENERATE and found.error < 1e-10
    # A constant lowers S across the curve, and cosine and sine of 2 pi t / T do not.
    assert (found.inertia.index, found.inertia.nullity) == (1, found.stats["nullity"]) == (1, 1)
    with pytest.raises(ao.SolveError, match="at rest are a family of dimension 1"):
        ao.solve(found.problem, guess=found.path)


def test_a_guess_near_the_centre_of_turns_leads_to_it():
    """No turn moves the centre, though it does the guess."""
    found = rests(3, lambda q: q @ q / 2 + (q @ q) ** 2, guess=[0.1, -0.05, 0.02])
    assert found.status is ao.Status.SOLVED and np.abs(found.start.q).max() < 1e-12
    assert (found.inertia.index, found.inertia.nullity) == (3, 0)


@pytest.mark.quick("squares0-2.0-4-2")
@pytest.mark.parametrize(
    ("squares", "T", "index", "nullity"),
    [
        # Constants along x0 and x2 lower S, cosine and sine of pi t along x0; of 2 pi t do not.
        ([4 * np.pi**2, -1.2, 0.4], 2.0, 4, 2),
        # The same of k t / 2, k = 0, 1 and 2, and to 4, and to 6; the matrix is sparse.
        ([1, 4, 9, -1], 4 * np.pi, 21, 6),
    ],
)
def test_a_rest_in_resonance_is_one_of_a_family(squares, T, index, nullity):
    """Elements begin at conjugate times: four of them in two periods."""
    found = rests(len(squares), lambda q: np.multiply(squares, q) @ q / 2, T=T)
    assert found.status is ao.Status.DEGENERATE
    assert (found.inertia.index, found.inertia.nullity) == (index, nullity)


@pytest.mark.quick("1")
@pytest.mark.parametrize("n", [1, 2])
def test_a_loop_that_shrinks_to_a_rest_is_no_answer(n):
    loop = lambda t: [np.cos(np.pi * t / 1.1 + k) for k in range(n)]  # noqa: E731
    assert rests(n, lambda q: 0, guess=loop).status is ao.Status.NOT_FOUND
