"""The motion in space: arrays against formulas, pictures and films by what is in them."""

import json
from itertools import pairwise

import helpers
import numpy as np
import pytest
import systems
from helpers import at_once
from matplotlib import pyplot

import actionopt as ao
from actionopt import plot, scenes
from actionopt.plot import _film

G = 9.81
FORCE = 1e-6  # of forces, which follow from accelerations, relative to the largest


def solved(name, **parameters):
    """Return the solution of a scene, and the scene."""
    return helpers.solved(name, **parameters), scenes.get(name, **parameters)


# -- arrays ----------------------------------------------------------------------------------


def test_bodies_are_where_the_coordinates_say():
    solution, scene = solved("pendulum")
    data = plot.motion_data(solution, scene.draw, 7)
    assert np.array_equal(data.t, np.linspace(0.0, 1.0, 7))
    theta = scene.exact(data.t)[0]
    assert np.max(np.abs(data.bodies[0] - [np.sin(theta), -np.cos(theta)])) < 1e-7
    assert data.kinds == ("ground", "rod", "body")
    assert [p.shape for p in data.points] == [(7, 2, 1), (7, 2, 2), (7, 2, 1)]
    assert data.still == (True, False, False)
    assert data.forces is None
    trail = scene.exact(np.linspace(0.0, 1.0, data.trails.shape[2]))[0]
    assert np.max(np.abs(data.trails[0] - [np.sin(trail), -np.cos(trail)])) < 1e-7


def test_the_box_holds_all_that_is_seen_and_no_more():
    solution, scene = solved("rod_pendulum")
    data = plot.motion_data(solution, scene.draw, 3)
    reach = np.abs(data.trails[0, 0]).max()
    assert data.box[1] == pytest.approx(reach, abs=1e-12)
    assert data.box[3] == 0.0  # the pivot
    assert data.box[2] == pytest.approx(-1.0, abs=1e-3)  # the lowest point, between the times


def test_plain_data_are_rounded_json():
    solution, scene = solved("rod_pendulum")
    data = plot.motion_data(solution, scene.draw, 5, force=True)
    plain = json.loads(json.dumps(data.plain(), allow_nan=False))
    assert [s["kind"] for s in plain["shapes"]] == ["ground", "rod", "body"]
    assert [len(s["points"]) for s in plain["shapes"]] == [1, 5, 5]  # the pivot stays
    assert np.shape(plain["trails"]) == (1, data.trails.shape[2], 2)
    rounded = np.array(plain["shapes"][2]["points"])[:, 0].T
    assert 0 < np.max(np.abs(rounded - data.bodies[0])) < data.size / 2000
    arrows = np.array(plain["arrows"])[0].T
    assert np.max(np.abs(arrows - data.arrow * data.forces[0])) < data.size / 2000


def test_a_drawing_of_ones_own():
    system = systems.particle("a b")
    solution = ao.solve(ao.Problem(system, ao.Event(0.0, [0, 0]), ao.Event(2.0, [1, 2])))
    data = plot.motion_data(solution, lambda q, t: [scenes.body((q[0], t))], 3)
    assert np.allclose(data.bodies[0], [[0, 0.5, 1], [0, 1, 2]])


@at_once(
    ("draw", "message"),
    [
        (None, "as `scene.draw`"),
        (lambda q, t: [], "found none"),
        (lambda q, t: None, r"return a list of shapes, such as \[body\(\[x, y\]\)\], found None"),
        (lambda q, t: scenes.body((0, 0)), r"list of shapes, .* found Shape"),
        (lambda q, t: [(0, 0)], r"list of shapes, .* found \[\(0, 0\)\]"),
        (lambda q, t: [scenes.body([0] * 4)], r"in space, found \[0, 0, 0, 0\]"),
        (lambda q, t: [scenes.body([0, 0, 0]), scenes.body([0, 0])], "a third coordinate"),
        (lambda q, t: [scenes.rod([0, 0], None)], r"in space, found \[0, 0\], None"),
        (lambda q, t: [scenes.rod()], "in space, found none"),
        (lambda q, t: [scenes.spring([0, 0], ["a", 1])], "in space, found"),
        (lambda q, t: [scenes.circle(1.0, [0.0])], "in space, found"),
        (lambda q, t: [scenes.body((np.nan, 0))], "finite"),
        (lambda q, t: [scenes.body((0, 0))] * (1 + (t > 0.5)), "same shapes"),
    ],
)
def test_drawings_that_do_not_fit(draw, message):
    with pytest.raises(ValueError, match=message):
        plot.motion_data(solved("pendulum")[0], draw)


def test_one_time_is_no_motion():
    solution, scene = solved("pendulum")
    with pytest.raises(ValueError, match="at least 2 times"):
        plot.motion_data(solution, scene.draw, 1)


# -- forces ----------------------------------------------------------------------------------


def forces(name, **parameters):
    solution, scene = solved(name, **parameters)
    return plot.motion_data(solution, scene.draw, 9, force=True), scene


@pytest.mark.long
@pytest.mark.parametrize("name", ["rod_pendulum", "polar_pendulum"])
@pytest.mark.parametrize("m", [1.0, 2.5])
def test_tension_is_what_mass_times_acceleration_leaves(name, m):
    """F = m a + m g (0, 1), from the angle's formula; Cartesian and polar coordinates alike."""
    data, _ = forces(name, m=m)
    angle = scenes.get("pendulum", m=m)
    theta, w = angle.exact(data.t)[0], angle.facts["velocity"](data.t)[0]
    bend = -G * np.sin(theta)
    a = np.array(
        [
            np.cos(theta) * bend - np.sin(theta) * w**2,
            np.sin(theta) * bend + np.cos(theta) * w**2,
        ]
    )
    expected = m * (a + np.array([[0.0], [G]]))
    assert np.max(np.abs(data.forces[0] - expected)) < FORCE * np.max(np.abs(expected))


@pytest.mark.long
def test_friction_pulls_the_wheel_up_the_slope_and_its_torque_is_left():
    data, scene = forces("rolling_cylinder")
    slope = np.array([np.cos(0.3), -np.sin(0.3)])[:, None]
    expected = scene.facts["friction"] * slope * np.ones(9)
    assert scene.facts["friction"] < 0
    assert np.max(np.abs(data.forces[0] - expected)) < FORCE * abs(scene.facts["friction"])


def test_a_moving_constraint_pushes_across_itself():
    data, scene = forces("turning_wire")
    across = np.array([-np.sin(1.5 * data.t), np.cos(1.5 * data.t)])
    q, v = scene.exact(data.t), scene.facts["velocity"](data.t)
    expected = scene.facts["multipliers"](q, v, data.t)[0] * across
    assert np.max(np.abs(data.forces[0] - expected)) < FORCE * np.max(np.abs(expected))


def test_the_force_does_the_work_of_the_generalized_one():
    """The coordinate s moves the body up twice as far, so half the force does its work."""
    system = ao.System(
        lambda q, v, t: (v[0] ** 2 + v[1] ** 2) / 2 - 3.0 * q[1],
        ["x", "s"],
        constraint=lambda q, t: q[1],
    )
    solution = ao.solve(ao.Problem(system, ao.Event(0.0, [0, 0]), ao.Event(1.0, [1, 0])))
    data = plot.motion_data(solution, lambda q, t: [scenes.body((q[0], 2 * q[1]))], 3, force=True)
    assert np.allclose(data.forces[0], [[0], [1.5]])  # (0, F) . (0, 2 ds) = 3 ds


def test_forces_out_of_the_plane_are_refused():
    system = ao.System(
        lambda q, v, t: (v[0] ** 2 + v[1] ** 2 + v[2] ** 2) / 2,
        ["x", "y", "z"],
        constraint=lambda q, t: q[0] ** 2 + q[1] ** 2 + q[2] ** 2 - 1,
    )
    problem = ao.Problem(system, ao.Event(0.0, [1, 0, 0]), ao.Event(1.0, [0, 0.6, 0.8]))
    solution = ao.solve(problem)
    with pytest.raises(ValueError, match="does work that they cannot"):
        plot.motion_data(solution, lambda q, t: [scenes.body(q[:2] + q[2] / 3)], force=True)
    with pytest.raises(ValueError, match="bodies for forces to act on"):
        plot.motion_data(solution, lambda q, t: [scenes.ground(q[:2])], force=True)


# -- pictures --------------------------------------------------------------------------------


def inside(ax):
    """Check that lines and arrows are within the axes, markers included."""
    pyplot.close("all")
    figure = ax.figure
    figure.draw_without_rendering()
    box = ax.get_window_extent()
    for line in ax.lines:
        points = ax.transData.transform(np.transpose(line.get_data()))
        if not len(points):
            continue
        size = figure.dpi / 72 * (line.get_markersize() / 2 if line.get_marker() != "None" else 1)
        assert np.all(points.min(axis=0) >= [box.x0 + size, box.y0 + size])
        assert np.all(points.max(axis=0) <= [box.x1 - size, box.y1 - size])
    for arrows in ax.collections:
        tips = arrows.XY + np.transpose([arrows.U, arrows.V]) / arrows.scale
        tips = ax.transData.transform(tips)
        assert np.all((tips >= box.min) & (tips <= box.max))
    words = [text.get_window_extent() for text in ax.texts]
    if ax.get_legend() is not None:
        words.append(ax.get_legend().get_window_extent())
    for a, b in pairwise(sorted(words, key=lambda box: box.x0)):
        assert a.x1 < b.x0
    for text in (ax._left_title, *ax.texts):
        extent = text.get_window_extent()
        assert figure.bbox.x0 <= extent.x0 and extent.x1 <= figure.bbox.x1
        assert figure.bbox.y0 <= extent.y0 and extent.y1 <= figure.bbox.y1


@pytest.mark.quick("turning_wire")
@pytest.mark.parametrize("name", helpers.a_quarter(scenes.SCENES, 3))
def test_nothing_is_clipped(name):
    solution, scene = solved(name)
    force = bool(scene.problem.system.m)
    ax = plot.motion(solution, scene.draw, count=5, force=force, units=plot.SI)
    assert ax.get_aspect() == 1.0
    assert ax.get_title().startswith(name.replace("_", " "))
    (length, *others) = [text.get_text() for text in ax.texts]
    assert length.endswith(" m")
    assert [word.endswith(" N") for word in others] == [True] * force
    assert [text.get_text() for text in ax.get_legend().get_texts()] == ["start"]
    inside(ax)


def bodies(ax):
    """Return where bodies are drawn, (count, 2), and which of them are hollow."""
    lines = [x for x in ax.lines if x.get_marker() == "o" and x.get_zorder() == 4]
    places = np.array([np.ravel(line.get_data()) for line in lines])
    return places, [line.get_markerfacecolor() == "white" for line in lines]


def test_the_strobe_shows_each_time_once():
    solution, scene = solved("projectile")
    places, hollow = bodies(plot.motion(solution, scene.draw, count=4))
    assert np.allclose(places, scene.exact(np.linspace(0, 1, 4)).T)
    assert hollow == [True, False, False, False]


@pytest.mark.long
def test_scales_are_as_long_as_they_say():
    solution, scene = solved("rod_pendulum")
    ax = plot.motion(solution, scene.draw, force=True)
    data = plot.motion_data(solution, scene.draw, force=True)
    length, force = ax.texts
    (bar,) = [line for line in ax.lines if line.get_marker() == "|"]
    assert np.ptp(bar.get_xdata()) == pytest.approx(float(length.get_text()))
    key, *arrows = ax.collections
    assert key.U[0] == float(force.get_text().removeprefix("force "))
    assert {1 / a.scale for a in (key, *arrows)} == {data.arrow}
    drawn = np.array([(a.U[0], a.V[0]) for a in arrows])
    assert np.array_equal(drawn.T, data.forces[0])
    longest = data.arrow * np.max(np.linalg.norm(data.forces[0], axis=0))
    assert 0.2 * data.size < longest < 0.3 * data.size


@pytest.mark.quick("oscillator-0")
@pytest.mark.parametrize(("name", "along"), [("oscillator", 0), ("drag_quadratic", 1)])
def test_a_motion_on_a_line_is_a_strip_of_times(name, along):
    solution, scene = solved(name)
    ax = plot.motion(solution, scene.draw, count=5)
    data = plot.motion_data(solution, scene.draw, 5)
    places, _ = bodies(ax)
    assert np.allclose(places[:, along], data.bodies[0, along])
    steps = np.diff(places[:, 1 - along])
    assert np.allclose(steps, steps[0]) and steps[0] * (2 * along - 1) > 0
    axis = ax.xaxis if along else ax.yaxis
    assert [text.get_text() for text in axis.get_ticklabels()] == [f"{t:.3g}" for t in data.t]
    assert axis.get_label_text() == "time $t$"
    assert np.allclose(axis.get_ticklocs(), places[:, 1 - along])


# -- films -----------------------------------------------------------------------------------

SHORT = {"seconds": 0.3, "fps": 20}


@pytest.mark.long
def test_frames_show_the_bodies_where_they_are():
    solution, scene = solved("double_pendulum")
    figure, update = _film._reel(solution, scene.draw, 5, False, plot.SI)
    update(3)
    (ax,) = figure.axes
    data = plot.motion_data(solution, scene.draw, 5)
    assert np.allclose(bodies(ax)[0], data.bodies[:, :, 3])
    assert ax.get_title() == "double pendulum: $t$ = 1.50 s"
    inside(ax)


@pytest.mark.long
def test_an_animation_has_the_film_s_frames():
    solution, scene = solved("projectile")
    page = plot.animation(solution, scene.draw, **SHORT).to_jshtml()
    assert "frames[5]" in page and "frames[6]" not in page


def test_a_film_that_fails_leaves_what_was_there(tmp_path, monkeypatch):
    solution, scene = solved("projectile")
    file = tmp_path / "film.gif"
    file.write_text("old")

    def stop(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(_film.strobe, "outline", stop)
    with pytest.raises(KeyboardInterrupt):
        plot.film(solution, scene.draw, file, **SHORT)
    assert [(f.name, f.read_text()) for f in tmp_path.iterdir()] == [("film.gif", "old")]


def test_what_films_need(tmp_path, monkeypatch):
    solution, scene = solved("projectile")
    with pytest.raises(ValueError, match=r"ends in .*, .html, found 'film.avi'"):
        plot.film(solution, scene.draw, tmp_path / "film.avi", **SHORT)
    monkeypatch.setattr(_film.FFMpegWriter, "isAvailable", lambda: False)
    with pytest.raises(ValueError, match=r"expected ffmpeg .* write .gif or .png"):
        plot.film(solution, scene.draw, tmp_path / "film.mp4", **SHORT)
    with pytest.raises(ValueError, match="at least two frames"):
        plot.film(solution, scene.draw, tmp_path / "film.gif", seconds=0.05)
    with pytest.raises(FileNotFoundError, match="expected a folder that is there"):
        plot.film(solution, None, tmp_path / "nowhere" / "film.gif", **SHORT)  # nothing is drawn
    assert not any(tmp_path.iterdir())


@pytest.mark.skipif(not _film.FFMpegWriter.isAvailable(), reason="no ffmpeg")
@pytest.mark.parametrize("ending", [".mp4", ".webm"])
def test_a_film_by_ffmpeg_is_the_same_file_again(tmp_path, ending):
    solution, scene = solved("projectile")
    files = [tmp_path / f"{k}{ending}" for k in (1, 2)]
    for file in files:
        plot.film(solution, scene.draw, file, **SHORT)
    assert files[0].stat().st_size > 1000
    assert files[0].read_bytes() == files[1].read_bytes()


@pytest.mark.long
def test_a_spherical_pendulum_is_held_along_its_rod():
    """In space the force of the rod is along it, which in the picture of it changes its length."""
    system = ao.System(
        lambda q, v, t: v @ v / 2 - 9.81 * q[2],
        ["x", "y", "z"],
        constraint=lambda q, t: q @ q - 1,
    )

    def draw(q, t):
        return [scenes.ground((0, 0, 0)), scenes.rod((0, 0, 0), q), scenes.body(q)]

    start, end = (np.array([np.sin(a), b, -np.sqrt(np.cos(a) ** 2 - b**2)]) for a, b in
                  ((0.7, 0.0), (0.0, 0.8)))  # fmt: skip
    solution = ao.solve(ao.Problem(system, ao.Event(0.0, start), ao.Event(0.6, end)), tol=1e-10)
    data = plot.motion_data(solution, draw, 21, force=True)
    assert data.space and data.forces is not None
    rod = data.points[1][:, :, 1]
    force = data.forces[0].T
    size = np.linalg.norm(force, axis=1)
    assert np.max(np.linalg.norm(np.cross(rod, force), axis=1)) < 1e-9 * size.max()
    # m (v^2 / l + g cos) towards the pivot
    v, t = solution.velocity(data.t), data.t
    known = np.sum(v**2, axis=0) - 9.81 * solution(t)[2]
    np.testing.assert_allclose(-np.sum(rod * force, axis=1), known, rtol=1e-8)
    seen = np.linalg.norm(data.flat.points[1][:, :, 1], axis=1)
    assert np.ptp(np.linalg.norm(rod, axis=1)) < 1e-9 < 0.1 < np.ptp(seen)
