"""What velocity a motion has after a surface: reflection and refraction."""

import numpy as np
import pytest
import systems

import actionopt as ao
from actionopt.mechanics.reflection import leave
from actionopt.solver.kinds.ray_tracing import RayTracer


def law(lagrangian):
    system = ao.System(lagrangian, ["x", "y"])
    return system, system.table.pack(system.table.values())


def after(laws, v, by_q, by_t=0.0, *, bounces):
    place = np.zeros((1, 2)), np.array([v]), np.zeros((1, 1))
    return leave(laws, place, (np.array([by_q]), np.array([by_t])), bounces=bounces)[0]


def test_a_wall_that_moves_throws_back_in_its_own_frame():
    free = law(lambda q, v, t: v @ v / 2)
    normal = np.array([0.6, 0.8])  # on = normal.q - 0.3 t: the wall moves with 0.3 along it
    v = after((free, free), [1.0, -2.0], normal, -0.3, bounces=True)
    w = np.array([1.0, -2.0]) - 0.3 * normal
    assert v == pytest.approx(w - 2 * (normal @ w) * normal + 0.3 * normal, abs=1e-14)


def test_snell_and_total_reflection():
    media = [law(lambda q, v, t, n=n: n**2 * (v @ v) / 2) for n in (1.5, 1.0)]
    angle = 0.5
    v = np.array([np.sin(angle), np.cos(angle)]) / 1.5
    out = after(tuple(media), v, [0.0, 1.0], bounces=False)
    assert out[0] / np.linalg.norm(out) == pytest.approx(1.5 * np.sin(angle), abs=1e-14)
    assert np.linalg.norm(out) == pytest.approx(1.0, abs=1e-14)  # n |v| is continuous
    beyond = np.array([np.sin(0.8), np.cos(0.8)]) / 1.5
    assert np.isnan(after(tuple(media), beyond, [0.0, 1.0], bounces=False)).all()
    back = after((media[0], media[0]), beyond, [0.0, 1.0], bounces=True)
    assert back == pytest.approx(beyond * [1, -1], abs=1e-14)


@pytest.mark.parametrize("bounces", [True, False])
def test_momentum_along_and_energy_are_kept_where_h_is_not_quadratic(bounces):
    """A relativistic particle, whose mass changes where it is not thrown back."""

    def rest_mass(m):
        return law(lambda q, v, t: -m * (1 - v @ v) ** 0.5 + 0.3 * v[0] - 0.1 * m)

    laws = rest_mass(1.0), rest_mass(1.0 if bounces else 1.1)
    laws = (laws[0], laws[0]) if bounces else laws
    normal, v = np.array([0.8, -0.6]), np.array([0.3, -0.5])
    out = after(laws, v, normal, 0.05, bounces=bounces)
    sides = list(zip(laws, (v, out), strict=True))
    p = [s.momentum([0, 0], u, 0.0) for (s, _), u in sides]
    H = [s.energy([0, 0], u, 0.0) for (s, _), u in sides]
    mu = (p[1] - p[0]) @ normal
    assert p[1] - p[0] == pytest.approx(mu * normal, abs=1e-12)
    assert H[1] - H[0] == pytest.approx(-0.05 * mu, abs=1e-12)
    assert (out @ normal + 0.05 < 0) == bounces


def test_a_path_that_is_not_reflected_as_the_law_says_is_no_motion():
    """Each leg is a motion of its own, but the place of the reflection is not the right one."""
    free = systems.particle("x y")
    floor = ao.Bounce(lambda q, t: q[1])
    problem = ao.Problem(free, ao.Event(0, [0, 1]), ao.Event(1, [3, 2]), through=[floor])
    found = ao.solve(problem)
    assert found.compare().agrees
    elsewhere = problem.replace(through=[ao.Event(found.problem.through[0].t, [1.1, 0])])
    path = ao.solve(elsewhere).path
    wrong = ao.Solution(
        found.problem, path, found.action, found.lam, found.error, found.status, found.stats
    )
    off = wrong.compare()
    assert not off.agrees
    T = 2 / 3  # of the second leg, along which x would go on at 3.3 instead of 2.85
    assert off.position == pytest.approx((3.3 - 2.85) * T / 3, rel=1e-6)


def test_motions_are_followed_to_the_next_event_and_no_farther():
    wall, line = ao.Bounce(lambda q, t: 1 - q[0]), ao.Event(None, None, on=lambda q, t: q[1] - 20)
    ends = ao.Event(0.0, [0.0, 0.0]), ao.Event(2.0, [0.0, 0.5])
    problem = ao.Problem(systems.particle("x y"), *ends, through=[wall, line, wall])
    assert problem.through[0].on is problem.through[2].on  # what is met twice is traced once
    traced = RayTracer.of(problem, np.ones(2), 2.0).follow(np.array([[20.0, 50.0]]))
    met, lasts = traced.times[0, 1:3], [track.times[-1, 0] for track, _ in traced.tracks[:2]]
    np.testing.assert_allclose(met, [1 / 20, 20 / 50])
    assert (met <= lasts).all() and max(lasts) < 8.0
    forced = ao.System(lambda q, v, t: v @ v / 2 + np.exp(q[0]), ["x", "y"])  # to infinity
    problem = ao.Problem(forced, *ends, through=[wall, line])
    (track, _), *_ = RayTracer.of(problem, np.ones(2), 2.0).follow(np.zeros((1, 2))).tracks
    assert track.times[-1, 0] < 8.0
