"""Figures of the principle: their arrays against closed forms, their words within the picture."""

import io
from itertools import pairwise

import helpers
import matplotlib
import numpy as np
import pytest
import systems
from helpers import at_once
from matplotlib import pyplot
from matplotlib.text import Text
from matplotlib.tri import Triangulation

import actionopt as ao
from actionopt import plot, scenes
from actionopt.gallery.figures import cut
from actionopt.mechanics.conservation.symmetry import cyclic
from actionopt.plot._style import styled_figures
from actionopt.plot.data import fan
from actionopt.plot.data.variations import directions, over_modes, sizes, telling

PARAMETERS = {"oscillator_saddle": ("oscillator", {"duration": 4.0})}
FIGURES = {
    "overview": plot.overview,
    "bundle": plot.bundle,
    "slices": plot.slices,
    "landscape": plot.landscape,
    "energies": plot.energies,
    "conserved": plot.conserved,
    "fan": plot.fan,
    "wavefronts": plot.wavefronts,
    "spectrum": plot.spectrum,
    "family": lambda solution, units: plot.family([solution], units=units),
    "mesh": plot.mesh,
    "phasors": lambda solution, units: plot.phasors(solution, 0.05, units=units),
}
LARGEST = 400_000  # bytes of a figure as SVG
UNFORCED = ("bundle", "slices", "landscape", "fan", "wavefronts", "spectrum")


def solved(name):
    scene, parameters = PARAMETERS.get(name, (name, {}))
    return helpers.solved(scene, **parameters)


def second_variation(k, T, amplitude, w=1.0):
    """Return the second variation of an oscillator along amplitude * sin(k pi t / T)."""
    return amplitude**2 * T / 2 * ((k * np.pi / T) ** 2 - w**2)


# -- words -----------------------------------------------------------------------------------


LABELLED = {
    "oscillator_saddle": tuple(FIGURES),
    "rod_pendulum": ("overview", "bundle"),
    "figure_eight": ("slices", "conserved"),
    "damped_oscillator": ("energies", "conserved"),
}
MORE = {
    "rod_pendulum": ("landscape", "spectrum"),
    "figure_eight": ("overview", "landscape", "energies"),
    "damped_oscillator": ("overview",),
}


@pytest.mark.long
@pytest.mark.parametrize(
    ("name", "figure"),
    [
        *helpers.a_quarter((name, figure) for name in LABELLED for figure in LABELLED[name]),
        *(
            pytest.param(name, figure, marks=pytest.mark.slow)
            for name in MORE
            for figure in MORE[name]
        ),
    ],
)
def test_every_figure_is_labelled_and_nothing_is_clipped(figure, name):
    solution = solved(name)
    axes = np.ravel(FIGURES[figure](solution, units=plot.SI))
    picture = axes[0].figure
    picture.draw_without_rendering()
    renderer = picture.canvas.get_renderer()
    box = picture.get_tightbbox(renderer)
    width, height = picture.get_size_inches()
    assert box.x0 > -0.01 and box.y0 > -0.01
    assert box.x1 < width + 0.01 and box.y1 < height + 0.01
    heading = "saddle" if figure == "phasors" else solution.problem.system.name.replace("_", " ")
    assert axes[0].get_title().startswith(heading)  # of three in a row the words alone fit
    assert axes[-1].get_xlabel()
    for ax in picture.axes:  # colour bars too
        assert ax.get_ylabel()
        words = [ax.xaxis.label, ax.yaxis.label, *ax.texts, *ax.findobj(Text)[-3:]]
        for text in (t for t in words if t.get_text()):
            extent = text.get_window_extent(renderer)
            assert extent.x0 >= -0.5 and extent.x1 <= picture.bbox.width + 0.5, text.get_text()
            assert extent.y0 >= -0.5 and extent.y1 <= picture.bbox.height + 0.5, text.get_text()


def narrow(draw):
    """Return the axes on which `draw` drew the picture for narrow columns."""
    drawn = []
    plot.svgs(lambda figure: drawn.append(draw(figure.subplots())), (6.4, 4.4), cut((6.4, 4.4)))
    return drawn[0]


@pytest.mark.long
@pytest.mark.parametrize(
    ("name", "figure"),
    [
        ("figure_eight", "landscape"),
        pytest.param("rolling_cylinder", "spectrum", marks=pytest.mark.slow),
    ],
)
def test_a_narrow_picture_has_nothing_over_its_edge(name, figure):
    """Where ticks change with the room that they leave, one layout does not settle."""
    picture = narrow(lambda ax: FIGURES[figure](solved(name), ax, units=plot.SI)).figure
    width, height = picture.get_size_inches()
    with styled_figures():  # sizes in words are measured in the style they were drawn in
        box = picture.get_tightbbox(picture._get_renderer())
    assert min(box.x0, box.y0, width - box.x1, height - box.y1) > -0.02


@pytest.mark.long
def test_the_colour_bar_of_a_saddle_has_ticks_on_either_side_of_zero():
    bar = plot.landscape(solved("oscillator_saddle")).child_axes[0]
    ticks, (low, high) = bar.get_yticks(), bar.get_ylim()
    assert low <= ticks.min() < 0 < ticks.max() <= high and 0.0 in ticks


def test_times_beside_a_narrow_strip_do_not_touch():
    scene = scenes.get("drag_quadratic")
    ax = narrow(lambda ax: plot.motion(solved("drag_quadratic"), scene.draw, ax))
    boxes = [x.get_window_extent() for x in ax.get_xticklabels() if x.get_visible()]
    assert len(boxes) >= 3 and all(a.x1 <= b.x0 for a, b in pairwise(boxes))


def test_energy_that_is_nothing_beside_its_parts_is_no_noise():
    above, _ = plot.conserved(solved("kink"))
    low, high = above.get_ylim()
    assert high - low > 0.1 and max(abs(above.lines[0].get_ydata())) < 1e-6


@pytest.mark.long
@pytest.mark.parametrize(
    "figure", ["bundle", *(pytest.param(x, marks=pytest.mark.slow) for x in ("overview", "fan"))]
)
def test_figures_make_no_large_files(figure):
    file = io.BytesIO()
    axes = np.ravel(FIGURES[figure](solved("figure_eight"), units=plot.SI))
    axes[0].figure.savefig(file, format="svg")
    assert file.tell() < LARGEST


@at_once("figure", UNFORCED)
def test_without_a_functional_nothing_is_compared(figure):
    with pytest.raises(ValueError, match=r"expected .* without non-conservative forces"):
        FIGURES[figure](solved("damped_oscillator"), units=plot.SI)


def test_what_cannot_be_drawn_is_refused():
    for name, message in (
        ("rod_pendulum", "without constraints"),
        ("figure_eight", "one coordinate or x and y"),
    ):
        with pytest.raises(ValueError, match=message):
            plot.wavefronts(solved(name))
    with pytest.raises(ValueError, match=r"expected a Solution.*give one of them"):
        plot.paths([solved("kepler")])  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="a coordinate from 0 to 1, found 2"):
        plot.bundle(solved("kepler"), coordinate=2)
    with pytest.raises(ValueError, match="at least one solution"):
        plot.family([])
    with pytest.raises(ValueError, match="at least one solution"):
        plot.landscapes([])
    problem = ao.Problem(
        scenes.get("oscillator").problem.system, ao.Event(0.0, [1.0]), ao.Event(1.0, [None])
    )
    with pytest.raises(ValueError, match="that give all coordinates"):
        plot.spectrum(ao.solve(problem))


@pytest.mark.long
def test_where_a_constraint_leaves_one_curve_paths_are_told_apart_in_time():
    ax = plot.bundle(solved("rod_pendulum"))
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("time $t$", "$x$")
    ax = plot.bundle(solved("kepler"))
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("$x$", "$y$")
    ax = plot.bundle(solved("kepler"), coordinate=1)
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("time $t$", "$y$")


# -- the reader's own style ------------------------------------------------------------------


def contrast(colour, paper):
    """Return the contrast of a colour on paper; WCAG 2.2."""
    *rgb, alpha = matplotlib.colors.to_rgba(colour)
    paper = np.array(matplotlib.colors.to_rgb(paper))
    return helpers.contrast(alpha * np.array(rgb) + (1 - alpha) * paper, paper)


@pytest.mark.quick(
    "bundle-dark_background",
    "conserved-dark_background",
    "family-default",
    "family-dark_background",
)
@pytest.mark.parametrize("reader", ["default", "dark_background"])
@pytest.mark.parametrize("figure", helpers.a_quarter([*FIGURES, "explore"], 1))
def test_every_line_is_seen_on_light_and_on_dark_paper(figure, reader):
    solution = solved("oscillator_saddle")
    with pyplot.style.context(reader):
        if figure == "explore":
            axes = [panel.ax for panel in plot.explore(solution.problem).panels]
        else:
            axes = np.ravel(FIGURES[figure](solution, units=plot.SI))
        for ax in axes:
            paper = ax.get_facecolor()
            for line in ax.lines:
                hollow = line.get_linestyle() == "None"
                colour = line.get_markeredgecolor() if hollow else line.get_color()
                assert contrast(colour, paper) >= 3, (line, colour)
            for text in (ax.title, ax.xaxis.label, ax.yaxis.label, *ax.texts):
                assert contrast(text.get_color(), paper) >= 3, text
            for lines in (c for c in ax.collections if hasattr(c, "levels") and not c.filled):
                if figure != "landscape":  # there on colours
                    for colour in lines.get_edgecolor():
                        assert contrast(colour, paper) >= 3


def test_the_readers_title_stands_in_place_of_ours():
    ax = plot.paths(solved("oscillator"))
    ax.set_title("mine")
    assert [ax.get_title(loc=place) for place in ("left", "center", "right")] == ["", "mine", ""]


# -- arrays ----------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["oscillator", "oscillator_saddle"])
def test_slices_bundle_and_landscape_of_an_oscillator_are_parabolas(name):
    solution = solved(name)
    T = solution.problem.duration
    unit = float(sizes(solution)[0])
    rises = [second_variation(k, T, unit) for k in (1, 2, 3)]

    data = plot.bundle_data(solution, count=4, size=0.2)
    alphas = np.linspace(-0.2, 0.2, 4)
    np.testing.assert_allclose(data.rise, np.outer(rises, alphas**2 / 2).ravel(), rtol=1e-6)
    displaced = np.max(np.abs(data.varied - data.q), axis=(1, 2))
    np.testing.assert_allclose(displaced, np.tile(np.abs(alphas), 3) * unit, rtol=1e-3)

    land = plot.landscape_data(solution, reach=0.4, count=7)
    assert land.modes == (0, 1)
    first, second = np.meshgrid(land.a**2 / 2 * rises[0], land.b**2 / 2 * rises[1])
    np.testing.assert_allclose(land.rise, first + second, atol=1e-9)

    _, modes = directions(solution, 2)
    for mode, rise in zip(modes, rises, strict=False):
        data = plot.slice_data(solution, mode, reach=0.3, count=5)
        assert data.second == pytest.approx(rise, rel=1e-6)
        rising = data.alpha**2 * rise / 2
        np.testing.assert_allclose(data.action - solution.action, rising, atol=1e-12)
        np.testing.assert_allclose(data.action, data.parabola)


def test_the_energies_of_an_oscillator_and_a_charge():
    solution = solved("oscillator")
    data = plot.energies_data(solution, 2001)
    np.testing.assert_allclose(data.kinetic, solution.velocity(data.t)[0] ** 2 / 2, atol=1e-14)
    np.testing.assert_allclose(data.potential, solution(data.t)[0] ** 2 / 2, atol=1e-14)
    area = np.trapezoid(data.kinetic - data.potential, data.t)
    assert area == pytest.approx(solution.action, rel=1e-5)

    solution = solved("charge_planar")
    data = plot.energies_data(solution, 2001)
    m = solution.problem.parameters["m"]
    speed = np.sum(solution.velocity(data.t) ** 2, axis=0)
    np.testing.assert_allclose(data.kinetic, m * speed / 2, atol=1e-13)
    area = np.trapezoid(data.kinetic - data.potential, data.t)
    assert area == pytest.approx(solution.action, rel=1e-5)
    assert r"U_\mathrm{eff}(\dot q)" in plot.energies(solution).get_title()


@pytest.mark.long
@pytest.mark.parametrize(
    "name",
    helpers.a_quarter(
        "moving_pivot oscillating_wall rotating_frame_bound rotating_frame_free "
        "turning_wire_radial turning_wire pendulum polar_pendulum kepler_polar".split()
    ),
)
def test_the_kinetic_energy_drawn_is_that_of_the_body_in_space(name):
    """By differences of where the scene draws it, in a frame at rest."""
    scene, solution = scenes.get(name), solved(name)
    data = plot.energies_data(solution, 101, kinetic=scene.kinetic)
    assert data.told and not data.moving

    def place(t):
        return np.array([scene.draw(solution(s), s)[-1].points[:, 0] for s in t])

    h = 1e-3 * solution.problem.duration
    t = data.t[2:-2]
    v = (8 * (place(t + h) - place(t - h)) - place(t + 2 * h) + place(t - 2 * h)) / (12 * h)
    m = solution.problem.parameters.get("m", 1.0)
    np.testing.assert_allclose(data.kinetic[2:-2], m * np.sum(v**2, axis=1) / 2, rtol=1e-6)
    np.testing.assert_allclose(data.kinetic - data.potential, _lagrangian(solution, data.t))
    words = [t.get_text() for t in _energies(name).get_legend().get_texts()]
    assert {"$T$", "$V$"} <= set(words)


@pytest.mark.long
def test_what_the_lagrangian_does_not_tell_is_not_named():
    words = [t.get_text() for t in plot.energies(solved("hoop_bead")).get_legend().get_texts()]
    assert "$T$" in words and "$V$" not in words  # V is said with an if
    ax = plot.energies(solved("moving_pivot"))
    words = [t.get_text() for t in ax.get_legend().get_texts()]
    assert any("quadratic" in text for text in words)
    assert any("effective potential" in text for text in words)
    assert "$T$" not in words and "$V$" not in words
    assert "T_2" in ax.get_title()

    def lagrangian(q, v, t):  # relativistic, and so not quadratic
        return -np.sqrt(1 - v[0] ** 2)

    system = ao.System(lagrangian, ["x"])
    solution = ao.solve(ao.Problem(system, ao.Event(0.0, [0.0]), ao.Event(1.0, [0.6])))
    words = [t.get_text() for t in plot.energies(solution).get_legend().get_texts()]
    assert any("even in" in text for text in words)


def _energies(name):
    return plot.energies(solved(name), kinetic=scenes.get(name).kinetic)


def _lagrangian(solution, t):
    problem = solution.problem
    q, v = solution(t), solution.velocity(t)
    return problem.system.lagrangian(q, v, t, parameters=problem.parameters)


def test_what_is_conserved():
    data = plot.conserved_data(solved("projectile"))
    assert not data.energy.flags.writeable
    assert data.flat == (True, True, False)
    assert plot.conserved_data(solved("damped_oscillator")).flat == (False, False)
    fact = scenes.get("kepler").facts["energy"]
    np.testing.assert_allclose(plot.conserved_data(solved("kepler")).energy, fact, rtol=1e-6)


@pytest.mark.quick(
    "charge_planar",
    "descent_through_gate",
    "drag_linear",
    "figure_eight",
    "oscillator_2d",
    "polar_pendulum",
    "sliding_off_circle",
    "two_on_a_line",
)
@pytest.mark.parametrize("name", helpers.a_quarter(scenes.SCENES, 2))
def test_conserved_is_what_a_symmetry_keeps(name):
    """H if nothing depends on time and no force acts, the momenta of cyclic coordinates."""
    solution = solved(name)
    system = solution.problem.system
    data = plot.conserved_data(solution)
    if system.r:  # contact may change what is kept without it
        assert not any(data.kept)
        return
    kept = cyclic(system)
    steady = bool(solution.problem.laws)  # the law changes with the place alone
    steady |= not (system.structure.depends_on_time or system.structure.forced)
    expected = (steady, *(x in kept for x in system.coordinates))
    expected += (False,) * system.n * (system.order - 1)  # momenta of what is no coordinate
    if solution.problem.through:  # surfaces may take a symmetry away, and given times the energy
        asked = scenes.get(name).problem
        assert data.kept[0] == any(event.t is None for event in asked.original.through)
        assert not any(k and not e for k, e in zip(data.kept, expected, strict=True))
    else:
        assert data.kept == expected
    assert all(flat for flat, kept in zip(data.flat, data.kept, strict=True) if kept)


def test_what_is_constant_on_one_path_alone_is_not_called_conserved():
    above, below = plot.conserved(solved("heavy_top"))
    words = [t.get_text() for ax in (above, below) for t in ax.get_legend().get_texts()]
    assert [" ".join(w.split()) for w in words] == [
        "$H$, conserved",
        r"$p_{\phi}$, conserved",
        r"$p_{\theta}$, constant on this path",
        r"$p_{\psi}$, conserved",
    ]


def test_all_motions_of_an_oscillator_meet_after_half_a_period():
    solution = solved("oscillator_saddle")
    data = plot.fan_data(solution)
    (focus,) = data.conjugate
    assert focus.t == pytest.approx(np.pi, rel=1e-8)
    away = np.abs(data.t - np.pi) > 1e-6  # at the focus itself rounding decides
    np.testing.assert_array_equal(data.index[away], data.t[away] > np.pi)
    v0 = solution.start.v[0]
    offsets = np.linspace(-0.15, 0.15, 12) * np.max(np.abs(solution.velocity(data.t)))
    expected = np.cos(data.t) + np.outer(v0 + offsets, np.sin(data.t))
    np.testing.assert_allclose(data.neighbours[:, 0], expected, atol=1e-3)


@pytest.mark.long
def test_fronts_of_an_oscillator_are_hamiltons_principal_function():
    solution = solved("oscillator")
    data = plot.fronts_data(solution)
    t, x = data.t[10:], data.q[:, 0, 10:]
    expected = ((x**2 + 1) * np.cos(t) - 2 * x) / (2 * np.sin(t))
    np.testing.assert_allclose(data.action[:, 10:], expected, atol=1e-3)
    assert plot.fronts_data(solved("oscillator_saddle")).t[-1] == pytest.approx(np.pi)


def test_a_sheet_of_the_plane_is_the_action_between_its_places_too():
    """S is quadratic in the place: second differences of it give the middles without an error."""
    solution = solved("projectile")
    data = plot.fronts_data(solution, count=7)
    sheet, T = fan.over_plane(solution, data), data.t[-1]
    m, g = (solution.problem.parameters[k] for k in ("m", "g"))

    def exact(triangles):
        x, y = triangles.x - solution.start.q[0], triangles.y - solution.start.q[1]
        return m * (x**2 + y**2) / (2 * T) - m * g * T * y / 2 - m * g**2 * T**3 / 24

    finer, S = sheet.fine()
    assert sheet.is_aligned and not sheet.triangles.mask.any()
    assert len(finer.triangles) == 16 * len(sheet.triangles.triangles)
    np.testing.assert_allclose(sheet.action, exact(sheet.triangles), atol=1e-12)
    np.testing.assert_allclose(S, exact(finer), atol=1e-12)


def test_triangles_that_share_places_or_hang_on_by_an_edge_are_left_out():
    grid = np.array([[x, y] for y in range(4) for x in range(4)], dtype=float)
    flat = Triangulation(*grid.T)
    none = np.zeros(len(flat.triangles), dtype=bool)
    assert not fan._turns_over(*grid.T, flat.triangles).any()
    assert fan._turns_over(*(grid * [-1, 1]).T, flat.triangles).all()
    assert not fan._overlaps(grid.T, flat.triangles, none).any()
    folded = np.abs(grid.T - [[1.6], [0.0]])  # the columns 0 and 1 lie on the columns 3 and 2
    assert fan._overlaps(folded, flat.triangles, none).any()
    corners = [k for k, row in enumerate(flat.neighbors) if (row < 0).sum() == 2]
    kept = fan._lone(flat.neighbors, none)
    assert kept[corners].all() and not kept.all()
    middle = grid[flat.triangles].mean(axis=1)[:, 0]
    apart = fan._lone(flat.neighbors, (middle > 1) & (middle < 2))
    assert apart.all() or len(set(middle[~apart] < 1)) == 1  # one side of the gap alone


def test_motions_of_two_coordinates_spread_where_they_meet_again():
    system = ao.System(lambda q, v, t: (v @ v - q[0] ** 2 - 4 * q[1] ** 2) / 2, ["x", "y"])
    ends = ao.Event(0.0, [1.0, 0.2]), ao.Event(2.0, [0.3, 0.5])
    data = plot.fan_data(ao.solve(ao.Problem(system, *ends)), count=4)
    assert [point.t for point in data.conjugate] == pytest.approx([np.pi / 2])
    np.testing.assert_array_equal(data.index, data.t > data.conjugate[0].t)
    focus = np.argmin(np.abs(data.t - np.pi / 2))
    spread = np.ptp(data.neighbours, axis=0)
    assert spread[0].max() < 1e-4 < 0.1 < spread[1].max()
    assert spread[1, focus] < 0.03 * spread[1].max()


def test_the_spectrum_of_an_oscillator():
    data = plot.spectrum_data(solved("oscillator_saddle"), points=4)
    expected = np.array([k**2 - (data.durations / np.pi) ** 2 for k in (1, 2, 3)])
    np.testing.assert_allclose(data.eigenvalues, expected, atol=1e-6)
    away = np.abs(data.durations - np.pi) > 1e-6
    np.testing.assert_array_equal(data.index[away], data.durations[away] > np.pi)
    np.testing.assert_allclose(data.conjugate, [np.pi])


@pytest.mark.long
def test_a_spectrum_is_told_the_index():
    ax = plot.spectrum(solved("oscillator_saddle"))
    assert [t.get_text() for t in ax.texts] == ["index 0", "1"]


@pytest.mark.long
def test_a_family_is_numbered_by_index_and_coloured_by_action():
    several = [solved("oscillator"), solved("oscillator_saddle")]
    t, paths, actions = plot.family_data(several, 5)
    assert paths.shape == (2, 1, 5)
    np.testing.assert_array_equal(actions, [s.action for s in several])
    np.testing.assert_array_equal(paths[1], several[1](t))
    ax = plot.family(several)
    assert [t.get_text() for t in ax.texts] == ["0", "1"]
    assert len(ax.figure.axes) == 2
    assert len(plot.family(several[:1]).figure.axes) == 1  # no bar of one colour


def test_the_mesh_is_the_solutions():
    solution = solved("kepler")
    boundaries, degrees = plot.mesh_data(solution)
    np.testing.assert_array_equal(boundaries, solution.mesh.boundaries)
    _, below = plot.mesh(solution)
    assert all(float(tick).is_integer() for tick in below.get_yticks())
    assert below.get_ylim()[1] > degrees.max()


@pytest.mark.long
@pytest.mark.parametrize("half_periods", [0.8, 1.3, 3.3, 14.4])
def test_no_path_looks_like_a_maximum(half_periods):
    """At any index some neighbours raise S; at a saddle some lower it."""
    solution = helpers.solved("oscillator", duration=half_periods * np.pi)
    data = plot.bundle_data(solution)
    assert solution.morse_index == int(half_periods)
    assert data.rise.max() > 0
    assert (data.rise.min() < 0) == (solution.morse_index > 0)
    assert len(data.rise) == 24


@pytest.mark.parametrize(("ripple", "flat"), [(1e-7, True), (1e-5, False)])
def test_a_ripple_that_nobody_would_see_is_none(ripple, flat):
    """A body under a small slow force: its energy changes by about `ripple` of itself."""
    system = ao.System(lambda q, v, t: v[0] ** 2 / 2 + ripple * q[0], ["x"])
    solution = ao.solve(ao.Problem(system, ao.Event(0.0, [0.0]), ao.Event(1.0, [1.0])))
    data = plot.conserved_data(solution)
    assert np.ptp(data.momentum[0]) == pytest.approx(ripple, rel=1e-6)
    assert data.flat == (True, flat)


@pytest.mark.long
def test_motions_that_run_away_leave_most_of_a_front():
    """Where x'' = x^3 the fast ones are at infinity before the end: they set out less fast then."""
    system = ao.System(lambda q, v, t: v[0] ** 2 / 2 + q[0] ** 4 / 4, ["x"])
    solution = ao.solve(ao.Problem(system, ao.Event(0.0, [0.0]), ao.Event(1.0, [1.0])))
    data = plot.fronts_data(solution, count=21, spread=6.0)
    assert len(data.q) >= 0.75 * 21


def test_a_slice_goes_as_far_either_way():
    solution = solved("oscillator")
    (mode,) = directions(solution, 1)[1]
    assert plot.slice_data(solution, mode, count=3).alpha.tolist() == [-1, 0, 1]


@pytest.mark.long
def test_impulses_of_contact_are_arrows_with_their_values():
    floor = ao.System(lambda q, v, a, t: a[0] ** 2 / 2, ["x"], obstacle=lambda q, t: q[0])
    ends = ao.Event(0, [1.0], v=[-5.0]), ao.Event(1, [1.0], v=[5.0])
    ax = plot.contact(ao.solve(ao.Problem(floor, *ends)))
    (value,) = [text for text in ax.texts if text.get_text().strip()]
    assert value.get_text().strip() == "48" and value.get_position()[0] == pytest.approx(0.5)
    assert list(ax.get_yticks()) == [0.0]


def test_where_paths_stand_on_a_landscape():
    s = ao.solve(ao.Problem(systems.pendulum(), ao.Event(0.0, [0.5]), ao.Event(2.0, [-0.3])))
    chosen, modes = telling(s)
    t = np.linspace(0, 2.0, 30)
    one, other = (modes[k](t) for k in chosen)
    q = s(t) + np.stack([0.1 * one, 0.2 * one - 0.3 * other])
    np.testing.assert_allclose(over_modes(s, t, q), [[0.1, 0.0], [0.2, -0.3]], atol=1e-9)


def test_action_over_time():
    s = ao.solve(ao.Problem(systems.particle(), ao.Event(0.0, [0.0]), ao.Event(2.0, [1.0])))
    triangles, S = fan.over_time(fan.fronts_data(s))
    t, q = triangles.x, triangles.y
    np.testing.assert_allclose(S, q**2 / (2 * t), atol=1e-7)
    assert not triangles.mask.any() and t.min() > 0.1


def test_motions_refocus_along_the_quicker_coordinate():
    system = ao.System(lambda q, v, t: (v @ v - q[0] ** 2 - 4 * q[1] ** 2) / 2, ["x", "y"])
    s = ao.solve(ao.Problem(system, ao.Event(0.0, [0.3, 0.1]), ao.Event(1.0, [0.5, 0.2])))
    found = np.abs(fan._refocusing(s, np.pi / 2, 1e-3))  # where y comes back
    assert found == pytest.approx([0.0, 1.0], abs=1e-6)
    assert fan._refocusing(s, 0.0, 1e-3).tolist() == [0.0, 1.0]
    rod = systems.particle("x y", constraint=lambda q, t: q @ q - 1)
    s = ao.solve(ao.Problem(rod, ao.Event(0.0, [1.0, 0.0]), ao.Event(1.0, [0.0, 1.0])))
    assert np.abs(fan._refocusing(s, 1.0, 1e-3)) == pytest.approx([0.0, 1.0])
