"""Families of paths against closed forms: through folds, past conjugate points."""

import gc
import sys
from types import SimpleNamespace
from weakref import ref

import numpy as np
import pytest
import systems
from helpers import a_quarter, at_once, motion
from scipy.optimize import brentq
from scipy.special import ellipk

import actionopt as ao
from actionopt import scenes
from actionopt.discrete.borders.arclength import Branch, BranchPoint
from actionopt.families.traces.branch_points import Miss, branch_points
from actionopt.families.traces.marks import Step, locate
from actionopt.families.traces.trace import POLE_SIZE, _TraceRun, trace
from actionopt.families.vary import slope, with_values

OSCILLATOR = ao.System(
    lambda q, v, t, *, w: (v[0] ** 2 - (w * q[0]) ** 2) / 2, ["x"], parameters={"w": 2.0}
)


def test_a_function_that_begins_elsewhere_is_refused():
    problem = scenes.get("pendulum").problem
    for other, what in (
        (lambda g: problem.replace(parameters={"g": g + 1.0}), "other parameters"),
        (
            lambda g: problem.replace(end=ao.Event(problem.end.t, [0.5])),
            "other coordinates at events",
        ),
        (lambda g: systems.soap_film(0.5), "another system"),
    ):
        with pytest.raises(ValueError, match=f"is the problem given, found one with {what}"):
            ao.trace(problem, other, 5.0, start=problem.parameters["g"])


@pytest.mark.long
def test_bratu_turns_the_corner():
    # u'' + lam e^u = 0: theta = sqrt(2 lam) cosh(theta / 4); fold at lam = 3.513830719125161
    # where theta tanh(theta / 4) = 4, umax = 1.1868421686343891. Actions at lam = 1 by quadrature.
    found = trace(systems.bratu(), "lam", 4.0)
    (fold,) = found.marks
    assert (fold.kind, fold.before, fold.after) == ("fold", 0, 1)
    assert fold.value == pytest.approx(3.5138307191251612, abs=1e-9)
    assert fold.path(0.5)[0] == pytest.approx(1.1868421686343891, abs=1e-9)
    assert found.values[[0, -1]] == pytest.approx([1.0, 1.0], abs=1e-14)
    assert found.actions[[0, -1]] == pytest.approx([-1.0465167047946651, 16.440013090858122])
    assert found.indices[0] == 0 and found.indices[-1] == 1
    assert "first value" in found.stopped
    # Two paths at every value on the way.
    two = found.at(2.0)
    assert [s.action for s in two] == pytest.approx([-2.2138465852135862, 3.1111695457891663])
    assert [s.morse_index for s in two] == [0, 1]


@pytest.mark.long
def test_a_branch_whose_direction_turns_fast_is_followed():
    """A transfer of two turns, 0.3 from the centre: dr/ds near by gave another direction."""
    system, v = systems.kepler(), [0.7941, 0.71812]
    ends = ao.Event(0.0, [1.0, 0.0]), ao.Event(22.0, [0.0, 1.2])
    guess = motion(system, [1.0, 0.0], v, 0.0, 22.0)
    found = trace(ao.Problem(system, *ends), "t1", 18.0, guess=guess, count=False)
    assert found.stopped == "it reached the goal"


@pytest.mark.slow
def test_every_point_of_a_trace_is_a_path():
    found = trace(systems.bratu(), "lam", 4.0)
    for lam, path in zip(found.values, found.paths, strict=True):
        top = path(0.5)[0]
        theta = 4 * np.arccosh(np.exp(top / 2))
        assert theta == pytest.approx(np.sqrt(2 * lam) * np.cosh(theta / 4), rel=1e-7)


@pytest.mark.slow
def test_soap_film_up_to_the_critical_distance():
    # Both catenoids up to half distance / radius = 0.662743419349182, none beyond.
    found = trace(systems.soap_film(0.5), systems.soap_film, 0.8, start=0.5)
    (fold,) = found.marks
    assert fold.value == pytest.approx(0.66274341934918158, abs=1e-9)
    assert (fold.kind, fold.before, fold.after) == ("fold", 0, 1)
    areas = 2 * np.pi * found.actions
    assert areas[[0, -1]] == pytest.approx([5.99179697580228, 6.84565539431063], rel=1e-9)
    assert max(found.values) < 0.6628


def test_signs_on_the_mesh_tell_the_index_of_seven_points_in_a_row(monkeypatch):
    """At the first point, the eighth after it and the last it is counted by all that tells it."""
    module, whole = sys.modules[trace.__module__], []
    count = vars(module)["regular_index"]
    monkeypatch.setattr(module, "LONGEST_STEP", 2 * module.FIRST_STEP)
    monkeypatch.setattr(
        module,
        "regular_index",
        lambda at, *given: whole.append(at.problem.end.t) or count(at, *given),
    )
    problem = ao.Problem(OSCILLATOR, ao.Event(0.0, 0.0), ao.Event(0.5, 0.0))
    found = trace(problem, "t1", 1.4)
    points = np.searchsorted(found.values, whole).tolist()
    assert points == [0, 8, len(found.values) - 1] and not found.indices.any()


@pytest.mark.long
def test_index_along_growing_time():
    problem = ao.Problem(OSCILLATOR, ao.Event(0.0, 0.0), ao.Event(0.5, 0.0))
    found = trace(problem, "t1", 5.0)
    assert [m.kind for m in found.marks] == ["index"] * 3
    assert [m.value for m in found.marks] == pytest.approx(np.arange(1, 4) * np.pi / 2, abs=1e-8)
    assert [(m.before, m.after) for m in found.marks] == [(0, 1), (1, 2), (2, 3)]
    turns = found.values * 2 / np.pi  # the index at a mark itself is a matter of rounding
    between = np.abs(turns - np.round(turns)) > 1e-6
    assert between.sum() > 5
    assert np.array_equal(found.indices[between], np.floor(turns[between]))
    assert "goal" in found.stopped and found.values[-1] == 5.0


@pytest.mark.long
@pytest.mark.parametrize("to", [0.4, 1.4])
def test_parameter_moves_either_way(to):
    problem = ao.Problem(OSCILLATOR, ao.Event(0.0, 1.0), ao.Event(2.0, 0.5), parameters={"w": 1.1})
    found = trace(problem, "w", to)
    for w, path, S in zip(found.values, found.paths, found.actions, strict=True):
        s, c = np.sin(2 * w), np.cos(2 * w)
        exact = w * (1.25 * c - 1.0) / (2 * s)
        assert exact == pytest.approx(S, rel=1e-7)
        assert path(1.0)[0] == pytest.approx(1.5 / 2 / np.cos(w), rel=1e-7)


@pytest.mark.quick("end-x-9.0")
@pytest.mark.parametrize(("which", "name", "to"), [("end", "x", 9.0), ("start", "y", -2.0)])
def test_coordinate_of_an_event_moves(which, name, to):
    scene = scenes.get("projectile")
    assert scene.problem.system.coordinates[:2] == ("x", "y")
    found = trace(scene.problem, (which, name), to)
    i = scene.problem.system.coordinates.index(name)
    k = 0 if which == "start" else -1
    for value, path in zip(found.values, found.paths, strict=True):
        assert path.values[i, k] == value
    again = ao.solve(found.family(to))
    assert found.solution(-1).action == pytest.approx(again.action, rel=1e-9)
    assert found.actions[-1] == pytest.approx(again.action, rel=1e-9)


def test_the_start_of_a_closed_path_moves_with_its_end():
    system = systems.particle()
    known = {"q0": np.array([-2.0]), "q1": np.array([3.0])}
    ends = {ao.Event(1.0, [0.0]): -2.0, ao.Periodic(1.0): 1.0}
    for end, wanted in ends.items():
        problem = ao.Problem(system, ao.Event(0.0, [0.0]), end)
        assert slope(problem, known, ("start", "x")) == wanted


@pytest.mark.long
def test_forced_system_has_no_index():
    scene = scenes.get("damped_oscillator")
    problem = scene.problem
    found = trace(problem, "t1", problem.end.t * 1.3)
    assert set(found.indices.tolist()) == {-1} and not found.marks
    assert found.solution(-1).action == pytest.approx(found.actions[-1], rel=1e-7)


@pytest.mark.long
def test_one_problem_is_compiled():
    problem = systems.bratu()
    ao.solve(problem)
    system = problem.system
    for name in ("first", "second"):
        system.pointwise(name)
    before = system.derived
    found = trace(problem, "lam", 3.0)
    assert system.derived == before
    assert found.stats["meshes"] <= 3
    assert found.stats["factorizations"] < 12 * len(found.values)


def test_interrupted_trace_keeps_what_it_has():
    seen = []

    def progress(stage, done, total, detail):
        seen.append(detail["value"])
        if len(seen) == 3:
            raise KeyboardInterrupt

    found = trace(systems.bratu(), "lam", 4.0, progress=progress)
    assert "interrupted" in found.stopped
    assert found.values[1:].tolist() == seen


def test_a_change_of_index_where_another_branch_crosses():
    # from 1 to -1 all paths are there at T = pi, and no step leads on to it
    system = systems.oscillator()
    found = trace(ao.Problem(system, ao.Event(0.0, 1.0), ao.Event(1.0, -1.0)), "t1", 4.0)
    (mark,) = found.marks
    assert mark.value == pytest.approx(np.pi, abs=1e-7)
    assert found.values[-1] == 4.0


def test_changes_of_the_index_take_a_few_factorizations_each():
    """Eigenvalues of the oscillators' motions from rest to rest vanish at T = pi / w."""
    w = np.array([1.1, 1.0])
    system = ao.System(lambda q, v, t: (v @ v - (w * q) @ (w * q)) / 2, ["x", "y"])
    ends = ao.Event(0.0, [0.0, 0.0]), ao.Event(2.7, [0.0, 0.0])
    found = trace(ao.Problem(system, *ends), "t1", 3.3)
    assert [(m.before, m.after) for m in found.marks] == [(0, 1), (1, 2)]
    assert [m.value for m in found.marks] == pytest.approx(np.pi / w, abs=1e-9)
    assert found.stats["factorizations"] < 40


def held_upright(e):
    """Return a pendulum held upright at an end, but for e, as x - y; it buckles at w2 = pi^2."""

    def lagrangian(q, v, t, *, w2):
        return v @ v / 2 + w2 * np.cos((q[0] - q[1]) / np.sqrt(2))  # x and y at 45 degrees

    system = ao.System(lagrangian, ["x", "y"], parameters={"w2": 9.0})
    end = ao.Event(1.0, np.array([1 + e, 1 - e]) / np.sqrt(2))
    return ao.Problem(system, ao.Event(0.0, [0.0, 0.0]), end)


def test_a_miss_is_searched_once(monkeypatch):
    """Where another branch is near, steps are shortened to how near it is, not by halves."""
    searches = []

    def search(*asked):
        searches.append(asked)
        return branch_points(*asked)

    monkeypatch.setattr("actionopt.families.traces.trace.branch_points", search)
    found = trace(held_upright(3e-8), "w2", 11.0)
    assert found.stopped == "it reached the goal" and not found.marks
    assert len(searches) <= 2


@pytest.mark.long
@pytest.mark.parametrize(("e", "index"), [(1e-5, 0), (1e-9, 1)])
def test_a_pitchfork_is_one_if_it_is_imperfect_by_no_more_than_the_tolerance(e, index):
    found = trace(held_upright(e), "w2", 11.0)
    assert found.stopped == "it reached the goal" and found.indices[-1] == index
    assert [m.value for m in found.marks] == pytest.approx([np.pi**2] * index, abs=1e-7)
    a, b = found.paths[-1](0.5)
    if index:
        assert abs(a - b) < 1e-6
    else:  # the amplitude y of a swing that is 0 at both ends: sqrt(w2) = 2 K(sin^2 y/2)
        amplitude = brentq(lambda y: 2 * ellipk(np.sin(y / 2) ** 2) - np.sqrt(11.0), 0.1, 2.0)
        assert (a - b) / np.sqrt(2) == pytest.approx(amplitude, abs=1e-4)


def test_branches_that_miss_each_other_have_no_mark():
    """From (e, 0) to (-e, e) the resonance of y is met at pi, with a force of about e."""
    system = systems.oscillator("x y")
    ends = ao.Event(0.0, [0.1, 0.0]), ao.Event(2.9, [-0.1, 3e-4])
    asked = ao.solve(ao.Problem(system, *ends))
    lengths = asked.discrete.tr.lengths
    branch = Branch(
        lambda T: asked.problem.replace(end=ao.Event(T, ends[1].q)), asked.mesh, (), lengths, 1.0
    )
    far = branch.to(branch.first(asked.discrete.z, 2.9, 1.0), 3.4)
    assert far is not None
    sides = (asked.discrete.z, 2.9), (far.z, 3.4)
    before = branch.solves
    missed = branch_points(branch, sides[0], sides[1], 2, 1e-5)
    assert branch.solves == before + 3  # the first step of each tells it
    assert isinstance(missed, Miss) and missed.apart**2 > 1e-5
    reach = branch.norm(far.tr, np.r_[far.z - asked.discrete.z, 0.5])
    assert missed.along == pytest.approx((np.pi - 2.9) / 0.5 * reach, rel=0.1)
    found = branch_points(branch, sides[0], sides[1], 2, 1.0)
    assert found is not None and [p.s for p in found] == pytest.approx([np.pi] * 2)


def test_a_mesh_that_is_refined_resolves_points_ahead():
    asked = scenes.get("double_pendulum").problem
    assert trace(asked, "t1", 1.5 * asked.end.t).stats["meshes"] == 2


@pytest.fixture
def kept(monkeypatch):
    """Have sparse factors of any size, and kept."""
    layout = "actionopt.discrete.matrices.layout."
    for name, value in (("BLOCK_SIZE", 0), ("FILLED", 1.0), ("KEPT_SIZE", 0)):
        monkeypatch.setattr(layout + name, value)


@pytest.fixture
def chain():
    """A hanging chain that is traced by its gravity."""
    scene = scenes.get("chain", links=3, l=1 / 3, amplitude=0.1)
    return ao.solve(scene.problem, guess=scene.guess)


def test_a_point_with_large_factors_takes_one_of_them(kept, chain):
    found = trace(chain.problem, "g", 11.0, guess=chain)
    assert found.stats["factorizations"] <= 1.5 * len(found.values)
    other = ao.solve(chain.problem.replace(parameters={"g": 11.0}), guess=found.paths[-1])
    assert other.action == pytest.approx(found.actions[-1], rel=1e-10)
    assert np.abs(other(found.paths[-1].mesh.nodes) - found.paths[-1].values).max() < 1e-8


def test_what_meshes_left_behind_took_is_free(kept, chain, monkeypatch):
    """At once, not when circles of objects are looked for."""
    module, left = sys.modules[trace.__module__], []
    forget = module.forget
    monkeypatch.setattr(module, "forget", lambda layout: left.append(ref(layout)) or forget(layout))
    gc.disable()
    try:
        found = trace(chain.problem, "g", 13.0, guess=chain)
    finally:
        gc.enable()
    assert found.stats["meshes"] > 2 and len(left) == found.stats["meshes"] - 2
    assert all(layout() is None for layout in left)
    assert chain.discrete.tr.layout in chain.problem.system.layouts.values()


@pytest.mark.long
def test_a_finer_mesh_beside_another_branch_goes_on_along_its_own():
    """At the value at which the mesh is refined a matrix is nearly singular; along it none is."""
    scene = scenes.get("chain", links=10, l=0.1, amplitude=0.1)
    found = trace(scene.problem, "g", 14.0, guess=scene.guess)
    assert found.stopped == "it reached the goal" and found.indices[-1] == 32


class Line:
    """A branch that is a straight line, s along it."""

    def __init__(self):
        self.here = BranchPoint(None, np.zeros(1), 0.0, np.ones(2))

    def step(self, point, length, first):
        return BranchPoint(None, np.full(1, length), float(length), np.ones(2)), 1

    def at(self, s):
        return None

    def inner(self, tr, one, other):
        return one @ other / 2

    def norm(self, tr, change):
        return np.sqrt(self.inner(tr, change, change))


@at_once(
    ("function", "root"),
    [
        (lambda p: p.s, 0.0),  # at the left end
        (lambda p: p.s - 1e-17, 0.0),  # so near it that the secant meets the end
        (lambda p: 1.0 - p.s, 1.0),
        (lambda p: p.s**3 - 0.3**3, 0.3),
        (lambda p: 1e3 * p.s - 1.0 if p.s < 1e-3 else p.s - 1e-3, 1e-3),
    ],
)
def test_roots_along_a_branch(function, root):
    line = Line()
    there = BranchPoint(None, np.ones(1), 1.0, np.ones(2))
    found = locate(line, line.here, there, function)
    assert found.s == pytest.approx(root, abs=1e-11)


def test_a_root_that_no_few_steps_lead_to_is_not_located(monkeypatch):
    monkeypatch.setattr(sys.modules[locate.__module__], "LOCATE_STEPS", 20)
    line, there = Line(), BranchPoint(None, np.ones(1), 1.0, np.ones(2))
    # Its values tell nothing but on which side the root is: 27 bisections lead to it.
    assert locate(line, line.here, there, lambda p: np.sign(p.s - 0.3)) is None


def test_a_period_that_doubles_where_no_step_leads_asks_for_a_shorter_step(monkeypatch):
    monkeypatch.setattr(sys.modules[trace.__module__], "locate", lambda *given: None)
    system = systems.oscillator()
    T = np.array([3.0, 3.3])  # det(M + 1) = 2 + 2 cos T is positive: its sign is made to change
    monkeypatch.setattr(_TraceRun, "_doubling", lambda self, point: point.s - T.mean())
    problem = ao.Problem(system, ao.Event(0.0, None), ao.Periodic(T[0]))
    run = _TraceRun(lambda t: problem.replace(end=ao.Periodic(t)), T[0], 4.0, 1e-8, True)
    run.begin(ao.solve(problem))
    there = run.branch.to(run.here, T[1])
    assert run._marks(run.here, there, run.points[-1].index) is None


def test_a_step_is_no_longer_than_the_branch_is_straight():
    """What it turns by tells how far its tangent leads astray: farther away is another branch."""
    near = ao.solve(systems.bratu(3.3))
    branch = Branch(systems.bratu, near.path.mesh, (), near.discrete.tr.lengths, 3.0)
    here = branch.first(branch.first_unknowns(near.path, None, 3.3), 3.3, 1.0)
    assert branch.step(here, 0.1) is not None
    assert branch.step(here, 0.2) is None


def test_where_no_index_can_be_counted_the_trace_says_what_to_do():
    # d2L/dv2 = cosh v - 2 is not positive: no index counts the variations that lower S
    system = ao.System(
        lambda q, v, t, *, k: np.cosh(v[0]) - v[0] ** 2 - k * q[0] ** 2 / 2,
        ["x"],
        parameters={"k": 1.0},
    )
    problem = ao.Problem(system, ao.Event(0.0, 0.0), ao.Event(1.0, 0.3))
    line = [[0.0, 0.3]]
    with pytest.raises(ValueError, match="count=False"):
        trace(problem, "k", 2.0, guess=line)
    found = trace(problem, "k", 2.0, count=False, guess=line)
    assert found.values[-1] == 2.0


def test_bad_arguments():
    with pytest.raises(ValueError, match="lam"):
        trace(systems.bratu(), "mu", 2.0)
    with pytest.raises(ValueError, match="other than the present"):
        trace(systems.bratu(), "lam", 1.0)
    with pytest.raises(ValueError, match="expected start"):
        trace(systems.soap_film(0.5), systems.soap_film, 0.6)
    with pytest.raises(ValueError, match=r"found \(\)"):
        trace(systems.bratu(), (), 1.0)
    with pytest.raises(ValueError, match="coordinate that the event gives"):
        trace(systems.bratu(), ("end", "v"), 1.0)
    with pytest.raises(ValueError, match="expected a Problem"):
        trace("bratu", "lam", 2.0)  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="the solution as the guess"):
        trace(ao.solve(systems.bratu()), "lam", 2.0)  # type: ignore[arg-type]
    plane = systems.particle("x y")
    half = ao.Problem(plane, ao.Event(0.0, [None, 0.0]), ao.Event(1.0, [1.0, 1.0]))
    with pytest.raises(ValueError, match="event gives, one of y, found 'x'"):
        trace(half, ("start", "x"), 1.0)
    with pytest.raises(ValueError, match="try a nearer goal"):  # steps of 1e294 about 1
        trace(systems.bratu(), "t1", 1e300)


@pytest.mark.long
@pytest.mark.parametrize(("to", "side"), a_quarter([(2.0, -1.0), (3.0, 1.0)]))
def test_a_pole_is_noticed_from_either_side(to, side):
    """x = cos t + B sin t is infinite at T = pi; the way there is down the times."""
    system = systems.oscillator()
    problem = ao.Problem(system, ao.Event(0.0, side), ao.Event(4.0, 0.5 * side))
    found = trace(problem, "t1", to)
    assert np.pi < found.values[-1] < 3.16 and len(found.values) < 60
    assert "without bound as it approaches 3.14159" in found.stopped
    assert not found.marks and set(found.indices.tolist()) == {1}


@pytest.mark.parametrize("part", [0.0, -1.0])
@pytest.mark.parametrize(
    ("before", "now", "goal", "pole"),
    [
        # Sizes like 1 / (pole - s), where the pole is 1 or -1.
        ((0.98, 50.0), (0.99, 100.0), 2.0, None),  # it is known, but not near yet
        ((0.999, 1e3), (0.9999, 1e4), 2.0, 1.0),
        ((0.999, 1e3), (0.9999, 1e4), 1.00001, None),  # the goal comes before
        ((0.9999, 1e4), (0.999, 1e3), 2.0, None),  # it comes away from it
        ((-0.999, 1e3), (-0.9999, 1e4), -2.0, -1.0),
        ((-0.999, 1e3), (-0.9999, 1e4), -1.00001, None),
        ((0.999, 10.0), (0.9999, 99.0), 2.0, None),  # not grown enough to say so
    ],
)
def test_where_a_branch_will_be_infinite(before, now, goal, pole, part, monkeypatch):
    run = object.__new__(_TraceRun)
    run.origin, run.goal, run.pole_size = part * goal, goal, POLE_SIZE
    sizes = dict([before, now])
    monkeypatch.setattr(_TraceRun, "_size", lambda self, point: sizes[point.s])
    here, there = (BranchPoint(None, None, s, None) for s in (before[0], now[0]))
    found = run._pole(here, there)
    assert found == (None if pole is None else pytest.approx(pole, abs=1e-7))


@pytest.mark.long
def test_paths_that_end_on_the_way_end_the_trace():
    system = ao.System(
        lambda q, v, t, *, a: v[0] ** 2 / 2 - np.sqrt(1 - a) * q[0] ** 2 / 2,
        ["x"],
        parameters={"a": 0.9},
    )
    found = ao.trace(ao.Problem(system, ao.Event(0.0, [1.0]), ao.Event(1.0, [0.5])), "a", 2.0)
    assert "no step, however short" in found.stopped
    assert found.values[-1] == pytest.approx(1.0, abs=1e-3) and found.values[-1] <= 1


def at_rest(slope, potential, first):
    """Paths at rest where the slope of `potential` is g: with both ends free there are no others.

    Folds are where that slope turns, and the index is one where it falls.
    """
    system = ao.System(
        lambda q, v, t, *, g: v[0] ** 2 / 2 + potential(q[0]) - g * q[0],
        ["x"],
        parameters={"g": float(slope(first))},
    )
    problem = ao.Problem(system, ao.Event(0.0, [None]), ao.Event(0.5, [None]))
    return problem, {"guess": [[first, first]]}


def check_marks_agree(found):
    """The index changes at marks and nowhere else, and by what they say."""
    said = sum(mark.after - mark.before for mark in found.marks)
    assert found.indices[-1] - found.indices[0] == said
    assert all(abs(mark.after - mark.before) == 1 for mark in found.marks)


@pytest.mark.parametrize("apart", a_quarter([1e-4, 1e-1]))
def test_two_folds_close_to_each_other(apart):
    w = (apart / 2) ** (1 / 3)  # g = q^3 - 3 w^2 q turns at -w and w, 4 w^3 apart, of about 2
    problem, near = at_rest(
        lambda q: q**3 - 3 * w * w * q, lambda q: q**4 / 4 - 1.5 * (w * q) ** 2, -1.0
    )
    found = trace(problem, "g", 1.0, **near)
    assert [m.kind for m in found.marks] == ["fold", "fold"]
    assert [m.value for m in found.marks] == pytest.approx([2 * w**3, -2 * w**3], abs=1e-8)
    assert [(m.before, m.after) for m in found.marks] == [(0, 1), (1, 0)]
    check_marks_agree(found)
    assert [s.morse_index for s in found.at(w**3)] == [0, 1, 0]


@pytest.mark.slow
def test_three_motions_of_a_pendulum_a_little_longer_than_half_a_period():
    system = systems.pendulum("x")
    problem = ao.Problem(system, ao.Event(0.0, [0.0]), ao.Event(3.15, [-1.0]))
    found = trace(problem, ("end", "x"), 1.0)
    assert [(m.kind, m.before, m.after) for m in found.marks] == [("fold", 0, 1), ("fold", 1, 0)]
    check_marks_agree(found)
    assert [s.morse_index for s in found.at(1e-4)] == [0, 1, 0]


@pytest.mark.long
@pytest.mark.parametrize(
    "seed", [0, *(pytest.param(k, marks=pytest.mark.slow) for k in range(1, 50))]
)
def test_folds_of_random_branches(seed):
    """Rest where a sum of sines has the slope g: its turning points, in order."""
    rng = np.random.default_rng(seed)
    rise, first, k = rng.uniform(0.3, 1.5), rng.normal(), int(rng.integers(2, 6))
    a, w, phase = (
        rng.normal(size=k) * rng.choice([0.3, 1.0]),
        rng.uniform(0.5, 4, k),
        6 * rng.random(k),
    )

    def slope(q):
        return rise * q + sum(a[i] * np.sin(w[i] * q + phase[i]) for i in range(k))

    def potential(q):
        return rise * q**2 / 2 - sum(a[i] / w[i] * np.cos(w[i] * q + phase[i]) for i in range(k))

    problem, near = at_rest(slope, potential, first)
    start = slope(first)
    way = np.sign(slope(first + 1e-4) - start)
    q = first + way * np.linspace(1e-4, 40.0, 400001)
    over = (slope(q) >= start + 4.0) | (slope(q) < start)
    q = q[: int(np.argmax(over))]
    g = slope(q)
    turns = np.flatnonzero(np.diff(np.sign(np.diff(g)))) + 1
    found = trace(problem, "g", start + 4.0, **near)
    assert [m.value for m in found.marks] == pytest.approx(g[turns], abs=1e-6)
    assert all(m.kind == "fold" for m in found.marks)
    check_marks_agree(found)


@pytest.mark.long
@pytest.mark.parametrize(
    "step", [lambda x: abs(x) / x, pytest.param(np.sign, marks=pytest.mark.slow)]
)
def test_a_branch_ends_where_its_paths_come_to_cross_a_jump(step):
    system = ao.System(lambda q, v, t: v[0] ** 2 / 2 - 0.4 * step(q[0] - 0.0123), ["x"])
    problem = ao.Problem(system, ao.Event(0.0, [-1.0]), ao.Event(1.0, [-0.5]))
    branch = ao.trace(problem, ("end", "x"), 1.0)
    assert branch.values[-1] == pytest.approx(0.0123, abs=2e-4) and branch.values[-1] < 0.0123
    assert "L jumps by 0.8" in branch.stopped
    assert branch.solution(len(branch.values) - 1).success


# -- through events, and with given integrals ------------------------------------------------------

FREE = systems.particle("x y")


@pytest.mark.slow
def test_a_fold_of_two_legs_is_that_of_one():
    """Films between rings of radius 1: apart by 1.3254868 at most, where x tanh x = 1."""
    film = ao.System(lambda q, v, t: q[0] * np.sqrt(1 + v[0] ** 2), ["r"])
    ends = ao.Event(-0.3, [1.0]), ao.Event(0.3, [1.0])
    problem = ao.Problem(film, *ends, through=[ao.Event(0.1, [None])])
    found = trace(problem, "t1", 1.5)
    (fold,) = found.marks
    assert (fold.kind, fold.before, fold.after) == ("fold", 0, 1)
    assert fold.value + 0.3 == pytest.approx(1.3254868387, abs=1e-8)


@pytest.mark.long
def test_a_reflection_ends_where_the_shadow_begins():
    """Off a disc: no ray is reflected to a point behind the tangent from the source."""
    disc = ao.Bounce(lambda q, t: q @ q - 1)
    ends = ao.Event(0, [-2, 1.5]), ao.Event(1, [2, 1.5])
    found = trace(ao.Problem(FREE, *ends, through=[disc]), ("end", "y"), -1.0)
    edge = 1.5 + 4 * np.tan(np.arcsin(1 / 2.5) - np.arctan2(1.5, 2))
    assert edge < found.values[-1] < edge + 1e-3
    assert "passes through the surface" in found.stopped
    ray = found.solution(len(found.values) // 2)
    assert ray.action == pytest.approx(found.actions[len(found.values) // 2], abs=1e-8)
    (again,) = found.at(1.0)
    assert again.problem.end.q == (2.0, 1.0) and again.success


@pytest.mark.quick("vary2-0.5")
@pytest.mark.parametrize(
    ("vary", "to"),
    [("k", 3.0), (("through", 0, "t"), 1.4), (("through", 1, "x"), 0.5), ("t1", 4.0)],
)
def test_waypoints_move_along_a_trace(vary, to):
    """Against the closed form of the oscillator's legs."""
    spring = ao.System(
        lambda q, v, t, *, k: v[0] ** 2 / 2 - k * q[0] ** 2 / 2, ["x"], parameters={"k": 1.0}
    )
    between = [ao.Event(1.0, [0.5]), ao.Event(2.2, [-1.0])]
    problem = ao.Problem(spring, ao.Event(0, [0.0]), ao.Event(3, [1.0]), through=between)
    found = trace(problem, vary, to)
    last = with_values(problem, {vary: to})
    w = np.sqrt(float(last.parameters["k"]))
    t = np.array([e.t for e in last.joints_found])
    x = np.array([e.q[0] for e in last.joints_found])
    angle, a, b = w * np.diff(t), x[:-1], x[1:]
    legs = w * ((a**2 + b**2) * np.cos(angle) - 2 * a * b) / (2 * np.sin(angle))
    assert found.actions[-1] == pytest.approx(legs.sum(), abs=1e-9)
    assert "reached the goal" in found.stopped


def test_durations_change_where_the_way_stays():
    """Straight from one point to another, sqrt(5) apart, at sqrt(2 E)."""
    problem = ao.Problem(FREE, ao.Event(0, [0, 0]), ao.Event(None, [2, 1]), energy=0.5)
    found = trace(problem, "energy", 2.0)
    assert found.durations == pytest.approx(np.sqrt(2.5 / found.values), rel=1e-12)


@pytest.mark.long
def test_a_rope_grows():
    """y = a cosh(x / a) + c with 2 a sinh(1 / a) as length: dS/dl = -kappa."""

    def ds(q, v, t):
        return np.sqrt(1 + v[0] ** 2)

    rope = ao.System(lambda q, v, t: q[0] * ds(q, v, t), ["y"], integral=ds)
    problem = ao.Problem(rope, ao.Event(-1, [0]), ao.Event(1, [0]), integral=2.5)
    found = trace(problem, ("integral", 0), 4.0)
    a = brentq(lambda a: 2 * a * np.sinh(1 / a) - 4.0, 0.1, 10)
    c = -a * np.cosh(1 / a)
    assert found.actions[-1] == pytest.approx(a + a**2 * np.sinh(2 / a) / 2 + 4 * c, abs=1e-8)
    assert not found.indices.any()


@at_once(
    "vary",
    [
        ("through", 0),
        ("through", 2, "x"),
        ("through", 0, "z"),
        ("through", 1, "t"),
        ("integral", 0),
    ],
)
def test_what_no_event_gives_does_not_vary(vary):
    between = [ao.Event(0.5, [1, None]), ao.Event(None, [2, None])]
    ends = ao.Event(0, [0, 0]), ao.Event(1, [3, 0])
    with pytest.raises(ValueError, match="expected"):
        trace(ao.Problem(FREE, *ends, through=between), vary, 1.0)


@pytest.mark.long
@pytest.mark.parametrize("w", [pytest.param(3e-3, marks=pytest.mark.slow), 1e-4])
def test_a_pulse_that_moves_is_not_lost_by_the_mesh(w):
    """S = 1/2 + E t - E G(t, s) / 2 for t and s in the pulse, G Green's function of x''."""

    def lagrangian(q, v, t, *, c):
        return v[0] ** 2 / 2 + q[0] * np.exp(-(((t - c) / w) ** 2)) / (w * np.sqrt(np.pi))

    system = ao.System(lagrangian, ["x"], parameters={"c": 0.4})
    found = ao.trace(ao.Problem(system, ao.Event(0.0, [0.0]), ao.Event(1.0, [1.0])), "c", 0.6)
    c = np.array(found.values)
    exact = 0.5 + c - (c - c**2 - w / np.sqrt(2 * np.pi)) / 2
    assert found.actions == pytest.approx(exact, abs=1e-7)


@pytest.mark.long
def test_a_pulse_of_the_time_alone_counts_in_the_action():
    """It moves no path: a body goes straight, and S has its integral besides."""
    width = 8.7e-3
    system = ao.System(lambda q, v, t: v @ v / 2 - 2 * np.exp(-(((t - 0.655) / width) ** 2)), ["x"])
    problem = ao.Problem(system, ao.Event(0.0, [0.0]), ao.Event(0.5, [1.0]))
    found = ao.trace(problem, "t1", 1.5, tol=1e-9)
    exact = 1 / 3 - 2 * width * np.sqrt(np.pi)
    assert found.values[-1] == 1.5 and found.actions[-1] == pytest.approx(exact, rel=1e-8)


@at_once(
    ("slope", "turns", "hides"),
    [  # of a cubic: where it turns between 0 and 1, and whether its ends do not show that
        (np.poly1d([0.4, 0.6], True), [0.4, 0.6], True),
        (-np.poly1d([0.15, 0.5], True), [0.15, 0.5], True),
        (np.poly1d([0.3, 1.6], True), [0.3], False),
        (np.poly1d([0.5, 0.5], True) + 0.4, [], False),
        (np.poly1d([1.2, 1.4], True), [], False),
    ],
)
def test_where_the_cubic_of_a_step_turns(slope, turns, hides):
    length = 0.7
    step = Step(length, slope(0), slope(1), slope(0.5) - (slope(0) + slope(1)) / 2)
    assert step.hides_folds == hides
    for place in np.linspace(0.1, 0.9, 9):
        near = any(abs(place - x) < 0.09 for x in turns)
        far = all(abs(place - x) > 0.11 for x in turns)
        assert step.turns_at(place * length) is near or not (near or far)


def test_a_trace_ends_where_there_is_no_further_question():
    """The end x = s of a free particle on the line x = y is off it, and refused, beyond s = 1."""
    system = systems.particle("x y", constraint=lambda q, t: q[0] - q[1])

    def family(s):
        return ao.Problem(system, ao.Event(0, [0.0, 0.0]), ao.Event(1, [s, min(s, 1.0)]))

    found = ao.trace(family(0.5), family, 2.0, start=0.5)
    assert found.values[-1] == pytest.approx(1.0, abs=1e-5) and "expected" in found.stopped
    assert found.actions == pytest.approx(found.values**2)
    assert ao.trace(family(0.5), family, 1.0, start=0.5).stopped == "it reached the goal"
    assert ao.trace(family(1.0), family, 0.5, start=1.0).stopped == "it reached the goal"


@pytest.mark.parametrize("T", [1.0, 3.0, 4.0])
def test_multipliers_of_minus_one_tell_where_a_period_doubles(T):
    """det(M + 1) = 2 + 2 cos T of an oscillator."""
    ends = ao.Event(0.0, [0.3]), ao.Event(T, [0.5])
    point = SimpleNamespace(at=ao.solve(ao.Problem(systems.oscillator(), *ends)).discrete)
    found = _TraceRun._doubling(SimpleNamespace(tol=1e-8), point)
    assert found == pytest.approx(2 + 2 * np.cos(T), abs=1e-6)
