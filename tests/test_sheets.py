"""Which members of a grid hang together: maps of functions whose sheets are known."""

import numpy as np
import pytest

import actionopt as ao
from actionopt import scenes
from actionopt.families.sweeps.batch import solve_run
from actionopt.families.sweeps.sheets import leaps, sheets

ALL = np.ones((30, 40), dtype=bool)
X, Y = np.meshgrid(np.linspace(-1, 1, 30), np.linspace(-1, 1, 40), indexing="ij")


def labels(told, solved=ALL, index=None):
    return sheets(solved, index, np.stack(told, axis=-1))


@pytest.mark.parametrize(
    "told",
    [
        [X, Y],
        [np.sin(3 * X + Y), np.cos(2 * Y)],
        [X**2, Y**2],
        [np.exp(3 * X) * Y],
        [np.sqrt(1 + X)],  # as beside a fold
        [np.zeros_like(X), X],
        [np.ones_like(X)],
        [1 + 1e-9 * np.random.default_rng(1).uniform(size=X.shape), X],
    ],
    ids=str,
)
def test_a_smooth_map_is_one_sheet(told):
    assert not labels(told).any()


@pytest.mark.parametrize("size", [0.6, 3.0, 300.0])
def test_a_map_that_jumps_is_two(size):
    over = X + 0.3 * Y > 0.1
    found = labels([np.sin(X) + Y + size * over, Y])
    assert set(found[over]) == {1} and set(found[~over]) == {0}


def test_changes_may_grow_towards_the_edge_but_not_leap():
    steep = 3.0 ** -np.arange(5.0)[:, None] + 1e-3 * np.arange(6)
    few = np.ones(steep.shape, dtype=bool)
    for told in (steep, steep[::-1]):
        assert not labels([told], few).any()
    even = 10 + 0.1 * np.arange(5.0)[:, None] + 1e-3 * np.arange(6)
    for row in (0, 4):
        told = even + 3 * (np.arange(5) == row)[:, None]
        found = labels([told], few)
        assert found.max() == 1 and np.ptp(found[row]) == 0 and (found[row] != found[2]).all()


@pytest.mark.long
def test_paths_that_hardly_change_with_their_time_any_more_are_one_sheet():
    """Over a barrier in little time or long: the first row is not a sheet by itself."""
    law = ao.System(
        lambda q, v, t, *, k: v[0] ** 2 / 2 - k * np.cos(q[0]), ["q"], parameters={"k": 1.0}
    )
    problem = ao.Problem(law, ao.Event(0.0, [1.0]), ao.Event(1.0, [3.0]))
    over = {"t1": np.linspace(1.0, 4.0, 4), "k": np.linspace(1.0, 2.0, 6)}
    runs = ao.sweep(problem, over, record="index")
    assert not runs.index.any() and not runs.branch.any()


def test_a_narrow_strip_is_a_sheet_of_its_own():
    strip = np.abs(X - X[12, 0]) < 1e-9  # one member wide
    found = labels([X + 2.0 * strip, Y])
    assert found.max() == 2 and set(found[strip]) == {1}


def test_a_mirrored_sheet_is_told_by_the_sign_of_the_momenta():
    over = Y > 0.4
    found = labels([np.where(over, -1, 1) * (2 + X)])
    assert set(found[over]) == {1} and set(found[~over]) == {0}


def test_a_change_of_index_separates_where_it_is_known():
    index = (Y > 0).astype(int)
    found = labels([X, Y], index=index)
    assert np.array_equal(found, index)
    index[:, :30] = -1
    assert not labels([X, Y], index=index).any()


def test_what_failed_is_none_and_may_part_the_rest():
    solved = np.abs(X - X[9, 0]) > 1e-9
    found = labels([np.where(solved, X, np.nan), Y], solved)
    assert set(found[~solved]) == {-1}
    assert set(found[:9].ravel()) == {0} and set(found[10:].ravel()) == {1}
    solved[9, 3] = True  # a bridge
    assert set(labels([X, Y], solved)[solved]) == {0}
    assert (labels([X, Y], ~ALL) == -1).all()


def test_sheets_that_wind_hang_together():
    """A spiral: each member is reached by a long way only."""
    angle, radius = np.arctan2(Y, X), np.hypot(X, Y)
    arm = np.mod(radius / 0.5 - angle / (2 * np.pi), 1) < 0.6
    found = labels([X, Y], arm & (radius > 0.2) & (radius < 0.95))
    assert found[1, 20] == found[8, 16] == found[24, 20] == 0
    assert found[5, 20] == found[20, 20] == -1  # what lies between


def test_few_members_are_not_judged():
    for count in (1, 2):
        assert not sheets(np.ones(count, bool), None, np.arange(count)[:, None] * 5.0).any()


def test_uneven_steps_are_no_breaks():
    x = np.geomspace(1e-3, 1, 40)
    assert not sheets(np.ones(40, bool), None, np.stack([np.log(x), x], axis=-1)).any()


def test_sheets_that_hang_together_round_a_cusp_are_two():
    """The least x of x^4/4 + a x^2/2 + b x: for a < 0 it leaps where b changes its sign."""
    b, a = np.meshgrid(np.linspace(-1, 1, 41), np.linspace(-1, 1, 40))
    x = np.empty(a.shape)
    for at in np.ndindex(a.shape):
        roots = np.roots([1, 0, a[at], b[at] - 1e-3])
        roots = roots[np.abs(roots.imag) < 1e-9].real
        x[at] = roots[np.argmin(roots**4 / 4 + a[at] * roots**2 / 2 + (b[at] - 1e-3) * roots)]
    found = sheets(np.ones(a.shape, bool), None, x[..., None])
    leaps = (np.abs(np.diff(x, axis=1)) > 0.5) & (a[:, 1:] < -0.2)
    assert leaps.sum() >= 10 and found.max() == 1
    assert (np.diff(found, axis=1)[leaps] != 0).all()
    assert (np.diff(found[:, :20], axis=1) == 0)[a[:, 1:20] < -0.2].all()


def test_the_action_tells_a_leap_among_momenta_that_change_as_much():
    x = np.linspace(0, 4, 41)
    assert not (leaps(-np.cos(3 * x), 3 * np.sin(3 * x), x, 0) > 1).any()
    up = x > 1.95
    S, p = np.where(up, -np.cos(3 * x), 0.4 + x**2), np.where(up, 3 * np.sin(3 * x), 2 * x)
    assert np.flatnonzero(leaps(S, p, x, 0) > 1).tolist() == [19]


def test_momenta_that_change_steeply_are_no_break_where_the_action_changes_as_they_tell():
    """Of S' = tanh(t / w), met by two steps on either side of zero; of two sheets it is told."""
    t, w = np.arange(-7.0, 8.0, 2.0), 0.7
    S, p = w * np.logaddexp(t / w, -t / w), np.tanh(t / w)
    told, all_solved = np.stack([p, t / 20], axis=-1), np.ones(t.size, bool)
    assert sheets(all_solved, None, told).max() == 1
    assert not sheets(all_solved, None, told, [leaps(S, p, t, 0)]).any()
    S = np.where(t > 0, S + 3, S)
    assert sheets(all_solved, None, told, [leaps(S, p, t, 0)]).max() == 1


@pytest.mark.long
@pytest.mark.parametrize(
    ("name", "values"),
    [
        ("t1", np.linspace(1.4, 1.2, 9)),
        ("g", np.linspace(9.8, 7, 9)),
        ("t0", np.linspace(0, 0.2, 9)),
    ],
)
def test_slopes_tell_a_leap_where_momenta_leap_everywhere(name, values):
    """Paths of a pendulum that swings right first, and left first, in turn."""
    problem = scenes.get("pendulum").problem.replace(end=ao.Event(1.4, [-0.2]))
    guesses = [
        ao.solve(problem, guess=lambda t, a=a: a * np.sin(2.2 * t)[None]) for a in (1.8, -1.8)
    ]
    right, left = (solve_run(problem, {name: values}, guess=guess) for guess in guesses)
    assert right.momenta[:, 0, 0].min() > 0 > left.momenta[:, 0, 0].max()
    in_turn = np.arange(values.size) % 2 > 0
    mixed = [
        np.where(in_turn, a, b)
        for a, b in ((right.action, left.action), (right.slopes[:, 0], left.slopes[:, 0]))
    ]
    momenta = np.where(in_turn[:, None], right.momenta[..., 0], left.momenta[..., 0])
    assert not sheets(ALL[0, : values.size], None, momenta).any()
    assert (leaps(*mixed, values, 0) > 1).all()
    for found in (right, left):
        assert not (leaps(found.action, found.slopes[:, 0], values, 0) > 1).any()
