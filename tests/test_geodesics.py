"""Geodesics and rays: lengths that are homogeneous of degree one in the velocities."""

import pickle

import numpy as np
import pytest
import systems
from helpers import at_once, slow

import actionopt as ao
from actionopt.mechanics.laws.lengths import is_length
from actionopt.solver.kinds.revisions import _nearer, stretch_to_end


def sphere(q, v):
    return np.sqrt(v[0] ** 2 + np.sin(q[0]) ** 2 * v[1] ** 2)


def wind(q, v, *, w):
    """Travel time at unit speed in the wind (w, 0): |v - F W| = F."""
    along, rest = w * v[0], 1 - w * w
    return (np.sqrt(rest * (v @ v) + along**2) - along) / rest


def optical(q, v, *, M):
    """Coordinate time of light around a black hole, in the equatorial plane."""
    f = 1 - 2 * M / q[0]
    return np.sqrt(v[0] ** 2 / f**2 + q[0] ** 2 * v[1] ** 2 / f)


@pytest.mark.parametrize("w, T", [(0.5, 1.09716754070973), (0.0, np.sqrt(2))])
def test_the_least_time_in_a_wind(w, T):
    """(w T - 1)^2 + 1 = T^2: 1.097... for w = 1/2."""
    air = ao.System.geodesic(wind, ["x", "y"], parameters={"w": w})
    solution = ao.solve(ao.Problem(air, ao.Event(0, [0, 0]), ao.Event(1, [1, 1])))
    assert abs((w * T - 1) ** 2 + 1 - T**2) < 1e-13
    assert abs(solution.length - T) < 1e-13
    assert pickle.loads(pickle.dumps(solution)).length == solution.length


@pytest.mark.long
@pytest.mark.parametrize(
    "angle, T",
    [
        (3.3, 50.4997725673849),
        *slow((9.5, 84.8553103202039)),
    ],
)
def test_light_around_a_black_hole(angle, T):
    """Values by quadrature in 25 digits, at any rate of the clock."""
    space = ao.System.geodesic(optical, ["r", "phi"], parameters={"M": 1.0})
    solution = ao.solve(ao.Problem(space, ao.Event(2, [20, 0]), ao.Event(5, [20, angle])))
    assert abs(solution.length - T) < 1e-11 * T
    assert solution.compare().agrees


@pytest.mark.quick("-5.0-49.90208657928")
@pytest.mark.parametrize("angle, T", [(5.0, 44.41848538706), (-5.0, 49.90208657928)])
def test_light_around_a_turning_black_hole(angle, T):
    """With it and against it, a = 0.7, r = 15 to 12; by quadrature of Carter's equations.

    Near r = 0, where no light is, all but nothing is left of the terms of this length.
    """

    def kerr(q, v, *, a):
        r = q[0]
        lapse, twist = 1 - 2 / r, -2 * a / r * v[1]
        space = r**2 * v[0] ** 2 / (r**2 - 2 * r + a**2)
        space = space + (r**2 + a**2 + 2 * a**2 / r) * v[1] ** 2
        return (twist + np.sqrt(twist**2 + lapse * space)) / lapse

    space = ao.System.geodesic(kerr, ["r", "phi"], parameters={"a": 0.7})
    ray = ao.solve(ao.Problem(space, ao.Event(0, [15, 0]), ao.Event(1, [12, angle])))
    assert abs(ray.length - T) < 1e-9


@pytest.mark.long
def test_a_geodesic_that_rises_far_above_the_line_between_its_ends():
    """In the half-plane, cosh of the distance is 1 + |a - b|^2 / (2 y_a y_b): y is up to 150."""
    plane = ao.System.geodesic(lambda q, v: np.sqrt(v @ v) / q[1], ["x", "y"])
    ends = ao.Event(0, [0.0, 0.01]), ao.Event(1, [300.0, 0.01])
    solution = ao.solve(ao.Problem(plane, *ends))
    assert abs(solution.length - np.arccosh(1 + 300**2 / (2 * 0.01**2))) < 1e-10
    assert solution.morse_index == 0


@pytest.mark.slow
@pytest.mark.parametrize("principle", ["auto", "least"])
def test_a_geodesic_that_is_followed_from_a_nearer_end(principle):
    plane = ao.System.geodesic(lambda q, v: np.sqrt(v @ v) / q[1], ["x", "y"])
    ends = ao.Event(0, [0.0, 0.01]), ao.Event(1, [3000.0, 0.5])
    solution = ao.solve(ao.Problem(plane, *ends), principle=principle, seconds=60)
    assert solution.length == pytest.approx(np.arccosh(1 + (3000**2 + 0.49**2) / 0.01), abs=1e-9)
    assert solution.morse_index == 0


def test_a_nearer_question_ends_after_a_part_of_the_way_or_of_the_time():
    ends = ao.Event(2.0, [1.0]), ao.Event(6.0, [3.0])
    swing = systems.pendulum("x")
    part = _nearer(ao.Problem(swing, *ends), 0.25)
    assert (part.start, part.end.t, part.end.q) == (ends[0], 3.0, (3.0,))
    line = ao.System.geodesic(lambda q, v: np.sqrt(v @ v) / q[0], ["x"])
    part = _nearer(ao.Problem(line, *ends), 0.25)
    assert (part.start, part.end.t, part.end.q) == (ends[0], 6.0, (1.5,))


@pytest.mark.long
def test_the_two_ways_around_a_sphere():
    ball = ao.System.geodesic(sphere, ["theta", "phi"])
    ends = ao.Event(0, [1.2, 0.0]), ao.Event(1, [1.9, 2.0])
    beeline = np.cos(1.2) * np.cos(1.9) + np.sin(1.2) * np.sin(1.9) * np.cos(2.0)
    short = ao.solve(ao.Problem(ball, *ends))
    assert abs(short.length - np.arccos(beeline)) < 1e-12
    there = lambda t: np.stack([1.2 + 0.7 * t, (2 - 2 * np.pi) * t])  # noqa: E731
    other = ao.Event(1, [1.9, 2.0 - 2 * np.pi])
    long = ao.solve(ao.Problem(ball, ends[0], other), guess=there)
    assert abs(long.length - (2 * np.pi - np.arccos(beeline))) < 1e-12
    assert (short.morse_index, long.morse_index) == (0, 1)
    (point,) = ao.conjugate_points(long)
    assert abs(point.t * long.length - np.pi) < 1e-8


@pytest.mark.slow
@pytest.mark.parametrize(
    "theta, other, phi", [(1.05, 0.6, 3.2), (1.05, 0.6, 3.3), (2.337, 1.924, 3.376)]
)
def test_the_long_way_that_passes_near_a_pole_is_found(theta, other, phi):
    """There the angle turns by half a circle; the short one passes the other pole."""
    ball = ao.System.geodesic(sphere, ["theta", "phi"])
    found = ao.solve(ao.Problem(ball, ao.Event(0, [theta, 0.0]), ao.Event(1, [other, phi])))
    beeline = np.cos(theta) * np.cos(other) + np.sin(theta) * np.sin(other) * np.cos(phi)
    assert found.length == pytest.approx(2 * np.pi - np.arccos(beeline), abs=1e-7)
    assert found.morse_index == 1


def test_a_length_survives_a_file(tmp_path):
    ball = ao.System.geodesic(sphere, ["theta", "phi"])
    solution = ao.solve(ao.Problem(ball, ao.Event(0, [1, 0]), ao.Event(1, [1.5, 1])))
    solution.save(tmp_path / "way.npz")
    assert abs(ao.load(tmp_path / "way.npz", ball).length - solution.length) < 1e-14
    with pytest.raises(ValueError, match="load it with"):
        ao.load(tmp_path / "way.npz").length  # noqa: B018


def test_a_metric_under_a_constraint():
    ball = ao.System.geodesic(
        lambda q, v: np.sqrt(v @ v), ["x", "y", "z"], constraint=lambda q, t: q @ q - 1
    )
    solution = ao.solve(ao.Problem(ball, ao.Event(0, [1, 0, 0]), ao.Event(1, [0, 0.6, 0.8])))
    assert abs(solution.length - np.pi / 2) < 1e-12


def test_a_length_given_as_a_lagrangian_is_recognised():
    for n in (1, 2):
        system = ao.System(lambda q, v, t: (1 + q[0] ** 2) * np.sqrt(v @ v), ["x", "y"][:n])
        problem = ao.Problem(system, ao.Event(0, [0] * n), ao.Event(1, [1] * n))
        with pytest.raises(ValueError, match=r"System\.geodesic\(length"):
            ao.solve(problem)


@at_once(
    "length, said",
    [
        (lambda q, v: v @ v, "homogeneous of degree one"),
        (lambda q, v: -np.sqrt(v @ v), "positive"),
        (lambda q, v: 0 * v[0], "positive"),
        (lambda q, v: np.sqrt(1 + v @ v), "homogeneous of degree one"),
        (lambda q, v, t: np.sqrt(v @ v), "no clock"),
    ],
)
def test_what_is_no_length(length, said):
    with pytest.raises(ValueError, match=said):
        ao.System.geodesic(length, ["x", "y"])


def test_only_geodesics_have_a_length_that_is_positive():
    ends = ao.Event(0, [0, 0]), ao.Event(1, [1, 1])
    plane = systems.particle("x y")
    with pytest.raises(ValueError, match=r"expected a path of System\.geodesic"):
        ao.solve(ao.Problem(plane, *ends)).length  # noqa: B018
    back = ao.System.geodesic(lambda q, v: 0.5 * np.sqrt(v @ v) - v[0], ["x", "y"])
    with pytest.raises(ValueError, match="expected a length that is not negative"):
        ao.solve(ao.Problem(back, *ends), throw=False).length  # noqa: B018


def test_a_jump_of_the_refractive_index_is_named_at_once():
    glass = ao.System.geodesic(
        lambda q, v: np.where(q[1] > 0.3, 1.0, 1.5) * np.sqrt(v @ v), ["x", "depth"]
    )
    problem = ao.Problem(glass, ao.Event(0, [0, 0]), ao.Event(1, [1, 1]))
    with pytest.raises(ao.SolveError, match=r"0\.3<depth changes") as error:
        ao.solve(problem)
    assert error.value.solution.status is ao.Status.JUMP
    assert error.value.solution.stats["iterations"] == {}


@pytest.mark.parametrize("end", [[-1, 0.1], [-1, 0.3]])
def test_no_path_has_a_negative_length(end):
    """A wind faster than the ship leaves no way against it; with it there is one."""
    gale = ao.System.geodesic(wind, ["x", "y"], parameters={"w": 1.2})
    against = ao.Problem(gale, ao.Event(0, [0, 0]), ao.Event(1, end))
    with pytest.raises(ao.SolveError, match="expected a length that is not negative") as found:
        ao.solve(against)
    assert found.value.solution.status is ao.Status.NOT_FOUND
    assert ao.solve(against.replace(end=ao.Event(1, [1, 0.2]))).length > 0


def test_what_leaves_the_straight_line_grows_with_the_way():
    plane = ao.System.geodesic(lambda q, v: np.sqrt(v @ v) / q[1], ["x", "y"])
    near, far = (
        ao.Problem(plane, ao.Event(0, [0.0, 1.0]), ao.Event(1, [x, 1.0])) for x in (1.0, 2.0)
    )
    path = ao.solve(near)
    led = stretch_to_end(path, far, 2.0)
    t = np.linspace(0, 1, 7)
    assert led(t)[0] == pytest.approx(2 * path(t)[0])
    assert led(t)[1] - 1 == pytest.approx(2 * (path(t)[1] - 1))


@pytest.mark.long
def test_a_length_through_events_is_that_of_all_legs():
    """On a sphere, over times that are not as the lengths; and of light, as Fermat says."""
    sphere = ao.System.geodesic(
        lambda q, v: np.sqrt(v[0] ** 2 + np.sin(q[0]) ** 2 * v[1] ** 2), ["theta", "phi"]
    )
    a, b, c = [1.0, 0.0], [1.8, 1.0], [1.3, 2.0]
    way = ao.Problem(sphere, ao.Event(0, a), ao.Event(1, c), through=[ao.Event(0.3, b)])
    x, y, z = (
        np.array([np.sin(u) * np.cos(w), np.sin(u) * np.sin(w), np.cos(u)]) for u, w in (a, b, c)
    )
    assert ao.solve(way).length == pytest.approx(np.arccos(x @ y) + np.arccos(y @ z), rel=1e-9)
    media = [ao.System.geodesic(lambda q, v, n=n: n * np.sqrt(v @ v), ["x", "y"]) for n in (1, 1.5)]
    surface = ao.Event(None, None, on=lambda q, t: q[1])
    ray = ao.solve(ao.Problem(media, ao.Event(0, [0, 1]), ao.Event(1, [2, -1]), through=[surface]))
    s = np.linspace(0, 2, 20001)
    least = np.min(np.hypot(s, 1) + 1.5 * np.hypot(2 - s, 1))
    assert ray.length == pytest.approx(least, rel=1e-7)


def test_a_lagrangian_that_grows_with_the_speed_is_a_length():
    assert not is_length(ao.System(lambda q, v, a, t: a[0] ** 2, ["x"]))
    assert not is_length(systems.particle())
    assert is_length(ao.System(lambda q, v, t: np.sqrt(v @ v), ["x", "y"]))
    assert not is_length(ao.System(lambda q, v, t: np.sqrt(-1 - v @ v), ["x", "y"]))


@pytest.mark.parametrize("through", [(), (ao.Event(0.5, [0.5, 0.6]),)], ids=["arc", "two_arcs"])
def test_the_length_of_a_path_with_a_given_integral(through):
    """The arc over a chord of length 1 that has the area .3 below it; the length is no action."""
    system = ao.System.geodesic(
        lambda q, v: np.sqrt(v @ v), ["x", "y"], integral=lambda q, v, t: q[1] * v[0]
    )
    ends = ao.Event(0.0, [0.0, 0.0]), ao.Event(1.0, [1.0, 0.0])
    solution = ao.solve(ao.Problem(system, *ends, through=through, integral=0.3))
    t = np.linspace(0.0, 1.0, 2001)
    x, y = solution(t)
    assert solution.length == pytest.approx(np.hypot(np.diff(x), np.diff(y)).sum(), rel=1e-5)
    if not through:
        assert abs(solution.length - 1.3867333434165148) < 1e-9
