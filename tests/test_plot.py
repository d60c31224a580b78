"""Pictures: what is drawn equals the arrays, and nothing is shown."""

import gc
import weakref

import matplotlib
import numpy as np
import pytest
import systems
from helpers import at_once, solved
from matplotlib import pyplot

import actionopt as ao
from actionopt import plot, scenes
from actionopt.plot.data import arguments
from actionopt.plot.data.variations import _check_finite


def drawn(ax, label):
    """Return the points of the line with this label, (2, K)."""
    (line,) = [line for line in ax.lines if line.get_label() == label]
    return np.array(line.get_data())


@pytest.mark.long
def test_curves_are_the_solution_the_integration_and_their_distance():
    solution = solved("kepler")
    data = plot.curves(solution, 50)
    assert data.t.shape == data.deviation.shape == (50,)
    assert np.array_equal(data.q, solution(data.t))
    assert np.array_equal(data.forward, solution.compare().path(data.t))
    k = np.argmax(data.deviation)
    size = np.max(np.abs(data.q), axis=1)
    assert data.deviation[k] == np.max(np.abs(data.forward - data.q)[:, k] / size)


def test_cartesian_coordinates_make_an_orbit():
    ax = plot.paths(solved("kepler"))
    data = plot.curves(solved("kepler"))
    assert np.array_equal(drawn(ax, "($x$, $y$)"), data.q)
    assert np.array_equal(drawn(ax, "forward integration"), data.forward)
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("$x$", "$y$")
    assert ax.get_aspect() == 1.0


@pytest.mark.long
def test_every_mass_of_a_chain_has_an_orbit_and_one_legend_for_all():
    ax = plot.paths(solved("chain"))
    words = [text.get_text() for text in ax.get_legend().get_texts()]
    assert words[:2] == ["($x_{1}$, $y_{1}$)", "($x_{2}$, $y_{2}$)"]
    assert words[5:] == ["forward integration", "start", "end"]


def test_other_coordinates_are_drawn_against_time():
    solution = solved("pendulum")
    ax = plot.paths(solution)
    t, theta = drawn(ax, r"$\theta$")
    assert np.array_equal(theta, solution(t)[0])
    assert drawn(ax, "start").ravel().tolist() == [0.0, solution.problem.start.q[0]]
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("time $t$", r"$\theta$")


def test_the_deviation_is_logarithmic_with_both_bounds():
    solution = solved("pendulum")
    ax = plot.deviation(solution)
    assert ax.get_yscale() == "log"
    levels = {line.get_ydata()[0] for line in ax.lines[1:]}
    assert levels == {solution.error, solution.compare().reference_error}


def test_given_axes_are_drawn_on_and_returned():
    _, axes = pyplot.subplots(2)
    returned = plot.overview(solved("pendulum"), axes)
    assert list(returned) == list(axes)
    assert pyplot.get_fignums() == [1]
    assert all(ax.lines for ax in axes)


def test_a_figure_of_its_own_has_the_path_above_the_deviation():
    above, below = plot.overview(solved("pendulum"))
    assert above.figure is below.figure
    assert above.get_position().y0 > below.get_position().y0


def test_style_stays_inside():
    before = dict(matplotlib.rcParams)
    plot.overview(solved("pendulum"))
    assert dict(matplotlib.rcParams) == before


@pytest.mark.long
def test_figures_grow_with_the_words_of_the_reader_who_may_give_their_size(tmp_path):
    solution = solved("pendulum")
    usual = plot.paths(solution, compare=False).figure.get_size_inches()
    with matplotlib.rc_context({"font.size": 22}):
        twice = plot.paths(solution, compare=False)
        assert twice.figure.get_size_inches() == pytest.approx(2 * usual)  # from 11 points
        assert twice.yaxis.label.get_fontsize() == 22
    with matplotlib.rc_context({"figure.figsize": (4, 3), "savefig.dpi": 40}):
        for name, dpi in {"one.png": None, "two.png": 80}.items():
            plot.save(solution, tmp_path / name, compare=False, dpi=dpi)
        shapes = [pyplot.imread(tmp_path / name).shape[:2] for name in ("one.png", "two.png")]
        assert shapes == [(120, 160), (240, 320)]
    with pytest.raises(ValueError, match="found -1"):
        plot.save(solution, tmp_path / "one.png", dpi=-1)


def test_what_a_backend_turns_on_when_it_is_loaded_stays_on(monkeypatch):
    make = plot._style.new_figure

    def first(*size):
        matplotlib.interactive(True)  # as a notebook's backend does
        return make(*size)

    monkeypatch.setattr(plot._style, "new_figure", first)
    try:
        plot.paths(solved("pendulum"))
        assert matplotlib.is_interactive()
        assert matplotlib.rcParams["font.size"] == matplotlib.rcParamsDefault["font.size"]
    finally:
        matplotlib.interactive(False)


def test_without_comparison_nothing_is_integrated(monkeypatch):
    solution = ao.solve(scenes.get("oscillator").problem)
    monkeypatch.setattr(type(solution), "compare", None)
    ax = plot.paths(solution, compare=False)
    assert len(ax.lines) == 3  # the path and two events


def test_free_coordinates_of_an_event_are_not_drawn():
    system = scenes.get("pendulum").problem.system
    problem = ao.Problem(system, ao.Event(0.0, [0.3]), ao.Event(0.5, [None]))
    ax = plot.paths(ao.solve(problem), compare=False)
    assert np.isnan(drawn(ax, "end")[1, 0])


@pytest.mark.long
@pytest.mark.parametrize("ending", ["png", pytest.param("pdf", marks=pytest.mark.slow)])
def test_saved_pictures_have_a_size_and_open_no_window(tmp_path, ending):
    file = tmp_path / f"picture.{ending}"
    plot.save(solved("kepler"), file)
    assert file.stat().st_size > 5000
    assert pyplot.get_fignums() == []


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("picture.xyz", r"ends in .*\.png, .*\.svg, .*found 'picture\.xyz'$"),
        ("picture", r"ends in .*\.png, .*found 'picture', which has no ending$"),
    ],
)
def test_an_unknown_kind_of_picture_is_an_error(tmp_path, monkeypatch, name, message):
    monkeypatch.setattr(ao.Solution, "compare", None)  # nothing is computed first
    with pytest.raises(ValueError, match=message):
        plot.save(solved("kepler"), tmp_path / name)
    with pytest.raises(FileNotFoundError, match=r"nowhere.*found none; make it"):
        plot.save(solved("kepler"), tmp_path / "nowhere" / "picture.png")


@pytest.mark.slow
def test_what_is_asked_twice_is_computed_once():
    solution = ao.solve(scenes.get("oscillator").problem)
    found = plot.bundle_data(solution)
    assert plot.bundle_data(solution, 8, size=0.25) is found
    assert not found.varied.flags.writeable
    assert plot.bundle_data(solution, 4) is not found
    assert plot.bundle_data(solution) is not found  # only the last is kept
    other = ao.solve(scenes.get("oscillator").problem)
    assert plot.bundle_data(other) is not plot.bundle_data(solution)
    found, solution = weakref.ref(plot.bundle_data(solution)), None
    gc.collect()
    assert found() is None


@pytest.mark.long
def test_events_between_the_ends_their_surfaces_and_impulses_are_drawn():
    """Two reflections between walls y = 0 and y = 1: arrows up and down."""
    free = systems.particle("x y")
    walls = [ao.Bounce(lambda q, t: q[1]), ao.Bounce(lambda q, t: 1 - q[1])]
    ends = ao.Event(0, [0, 0.5]), ao.Event(1, [4, 0.5])
    solution = ao.solve(ao.Problem(free, *ends, through=walls))
    ax = plot.paths(solution)
    assert drawn(ax, "reflection") == pytest.approx(np.array([[1, 3], [0, 1]]), abs=1e-9)
    x, y = drawn(ax, "($x$, $y$)")
    assert y.min() == pytest.approx(0, abs=1e-12)  # corners are not cut off
    (arrows,) = [c for c in ax.collections if c.get_label() == "impulse"]
    expected = pytest.approx(np.array([[0, 0], [1, -1]]) * 0.6, abs=1e-9)
    assert np.array([arrows.U, arrows.V]) == expected
    rows = [path.vertices[:, 1] for c in ax.collections for path in c.get_paths()]
    walls = {round(abs(row[0]), 9) for row in rows if row.size and np.ptp(row) < 1e-9}
    assert walls == {0.0, 1.0}
    energy, momenta = plot.conserved(solution)
    p = drawn(momenta, "$p_{y}$")
    at = np.flatnonzero(np.isnan(p[1]))
    assert p[0, at] == pytest.approx([0.25, 0.75])
    assert p[1, at + 1] - p[1, at - 1] == pytest.approx(solution.impulses[:, 1])


@pytest.mark.long
def test_the_areas_of_a_path_of_given_integral_are_those_of_the_action():
    def ds(q, v, t):
        return np.sqrt(1 + v[0] ** 2)

    rope = ao.System(lambda q, v, t: q[0] * ds(q, v, t), ["y"], integral=ds)
    solution = ao.solve(ao.Problem(rope, ao.Event(0, [0]), ao.Event(2, [0.4]), integral=3.0))
    data = plot.energies_data(solution)
    area = np.trapezoid(data.kinetic - data.potential, data.t)
    assert area == pytest.approx(solution.action, rel=1e-4)


def test_a_family_of_reflections_shows_the_wall():
    free = systems.particle("x y")
    wall = ao.Bounce(lambda q, t: 1 - q @ q)
    ends = ao.Event(0, [-0.6, 0.2]), ao.Event(1, [0.8, 0.1])
    problem = ao.Problem(free, *ends, through=[wall])
    guesses = [[[-0.6, x, 0.8], [0.2, y, 0.1]] for x, y in ((0, 1), (0, -1))]
    ax = plot.family([ao.solve(problem, guess=guess) for guess in guesses])
    points = [path.vertices for c in ax.collections for path in c.get_paths() if len(path) > 50]
    radii = np.linalg.norm(np.concatenate(points), axis=1)
    assert (np.abs(radii - 1) < 1e-3).sum() > 100


@at_once(
    ("check", "value", "words"),
    [
        (arguments._positive, 0, "expected a positive number, found 0"),
        (arguments._runs, 3, "expected the answers of a sweep, found 3"),
        (arguments._file, 3, "expected the name of a file, found 3"),
        (arguments._units, 3, r"expected plot.UnitNames\(time='s', ...\), found 3"),
        (arguments._text, 3, "expected a name as text, found 3"),
        (lambda x: _check_finite([1.0, x], "size", 7), np.inf, "size with finite actions, found 7"),
    ],
)
def test_arguments_of_figures_are_refused(check, value, words):
    with pytest.raises(ValueError, match=words):
        check(value)


def test_arguments_of_figures_pass():
    passed = arguments._positive(1e-9), arguments._file("a"), arguments._text("a")
    assert [*passed, _check_finite([1.0], "size", 1.0)] == [None] * 4
