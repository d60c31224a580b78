"""Arrows of neighbouring paths, end to end, tend to sqrt(2 pi i hbar / S'')."""

import matplotlib
import numpy as np
import pytest
from helpers import slow, solved

import actionopt as ao
from actionopt import plot, scenes
from actionopt.plot.data.phasors import phasors_data

matplotlib.use("Agg")
CLOSE = 0.02  # of the limit


def oscillator(T):
    """Return the oscillator's own motion over a time T."""
    end = float(scenes.get("oscillator").exact(T)[0])
    return solved("oscillator", duration=T, end=end)


@pytest.mark.quick("4.4--45.0-0.01")
@pytest.mark.parametrize("hbar", [0.01, *slow(0.03, 0.001)])
@pytest.mark.parametrize(("T", "turned"), [(2.2, 45.0), (4.4, -45.0)])
def test_the_sum_is_turned_by_a_quarter_at_the_focus(T, turned, hbar):
    # S = (x'^2 - x^2) / 2 along sin(pi t / T): S'' = (T / 2) ((pi / T)^2 - 1), times a size.
    found, path = phasors_data(oscillator(T), hbar), oscillator(T)
    size = np.ptp(path(np.linspace(0, T, 2001)))
    second = (T / 2) * ((np.pi / T) ** 2 - 1) * size**2
    assert found.second == pytest.approx(second, rel=1e-4)  # the size from 201 times
    assert found.sum == pytest.approx(np.sqrt(2j * np.pi * hbar / second), rel=CLOSE)
    assert np.degrees(np.angle(found.sum)) == pytest.approx(turned, abs=0.1)
    assert found.ends[-1] == pytest.approx(found.sum)


@pytest.mark.long
def test_the_picture(monkeypatch):
    axes = plot.phasors(oscillator(4.4), 0.02, units=plot.SI)
    assert len(axes) == 3 and "index 1" in axes[0].get_title()
    assert "\N{MINUS SIGN}45" in axes[2].get_title()
    assert axes[2].get_aspect() == 1.0
    again = plot.phasors(oscillator(2.2), 0.02, axes)
    assert again == axes


def test_what_has_no_sum():
    with pytest.raises(ValueError, match="hbar > 0"):
        plot.phasors(oscillator(2.2), 0.0)
    with pytest.raises(ValueError, match="modes, counted from 0, found 999"):
        phasors_data(oscillator(2.2), 0.1, mode=999)
    with pytest.raises(ValueError, match="force"):
        plot.phasors(solved("damped_oscillator"), 0.1)
    with pytest.raises(ValueError, match="conjugate"):
        T = np.pi
        half = ao.Problem(
            scenes.get("oscillator").problem.system, ao.Event(0, [1]), ao.Event(T, [-1])
        )
        phasors_data(ao.solve(half, throw=False), 0.1)
