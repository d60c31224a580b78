"""Figures on axes of one's own: in a grid, drawn on again, of the wrong kind or number."""

import numpy as np
import pytest
import systems
from helpers import solved
from matplotlib.figure import Figure

from actionopt import Event, Problem, plot, solve
from actionopt.plot import _style as style

KINDS = [plot.paths, plot.bundle, plot.fan, plot.spectrum, plot.landscape, plot.energies]


@pytest.mark.long
def test_axes_in_a_grid_keep_their_size():
    figure = Figure((15, 7), layout="constrained")
    axes = figure.subplots(2, 3).ravel()
    for ax, draw in zip(axes, KINDS, strict=True):
        draw(solved("pendulum"), ax=ax)
    figure.draw_without_rendering()
    widths = [ax.get_position().width for ax in axes]
    assert min(widths) > 0.16  # half of a third; 0.05 where legends beside axes take their room
    titles = [ax.title.get_window_extent() for ax in axes]
    assert not any(a.overlaps(b) for k, a in enumerate(titles) for b in titles[:k])


def test_a_second_call_explains_each_line_once():
    ax = Figure().subplots()
    for _ in range(2):
        plot.energies(solved("pendulum"), ax)
    texts = [text.get_text() for text in ax.get_legend().get_texts()]
    assert len(texts) == len(set(texts)) >= 3


@pytest.mark.long
def test_axes_of_the_wrong_kind_or_number_are_refused():
    with pytest.raises(ValueError, match="expected 2 axes for this figure, found 3"):
        plot.conserved(solved("pendulum"), Figure().subplots(3))
    with pytest.raises(ValueError, match="expected plane axes with straight scales, found 'polar'"):
        plot.energies(solved("pendulum"), Figure().add_subplot(projection="polar"))


@pytest.mark.long
def test_angular_momentum_is_drawn_where_it_is_conserved():
    solution = solved("kepler")
    data = plot.conserved_data(solution)
    q, p = solution(data.t), solution.momentum(data.t)
    assert data.angular == pytest.approx(q[0] * p[1] - q[1] * p[0])
    assert np.ptp(data.angular) < 1e-8 and np.ptp(data.momentum[0]) > 0.1
    axes = plot.conserved(solution, Figure().subplots(2))
    assert "angular momentum, conserved" in axes[1].get_legend_handles_labels()[1]
    assert plot.conserved_data(solved("henon_heiles")).angular is None
    assert plot.conserved_data(solved("projectile")).angular is None
    assert plot.conserved_data(solved("snell")).angular is None  # layers are not turned


def test_a_simple_system_of_ones_own_has_kinetic_and_potential_energy():
    system = systems.pendulum()
    ax = Figure().subplots()
    plot.energies(solve(Problem(system, Event(0.0, [0.3]), Event(1.0, [0.1]))), ax)
    names = ax.get_legend_handles_labels()[1]
    assert "$T$" in names and "$V$, if $L = T - V$" in names


def seen_by_deuteranopes(rgb):
    """Return colours as seen without middle cones (Vienot, Brettel and Mollon 1999), linear."""
    rgb = np.asarray(rgb)[:, :3]
    linear = np.where(rgb > 0.04045, ((rgb + 0.055) / 1.055) ** 2.4, rgb / 12.92)
    return (
        linear @ np.array([[0.29275, 0.70725, 0], [0.29275, 0.70725, 0], [-0.02234, 0.02234, 1]]).T
    )


def test_phases_are_told_apart_without_green():
    colours = seen_by_deuteranopes(style.circle()(np.arange(8) / 8))
    apart = np.linalg.norm(colours[:, None] - colours[None], axis=2)
    assert apart[~np.eye(8, dtype=bool)].min() > 0.03
