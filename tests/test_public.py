"""What all public names have in common: exported types, their repr, progress and time limits."""

import inspect
import typing
from collections.abc import Mapping
from numbers import Number
from time import perf_counter

import numpy as np
import pytest

import actionopt as ao
from actionopt import plot, scenes, suite
from actionopt.tools.watch import Progress

LATER = {"Executor": object}  # names that modules import for annotations alone
CHAIN = scenes.get("chain", links=100).problem
PENDULUM = ao.System(lambda q, v, t: v[0] ** 2 / 2 + np.cos(q[0]), ["theta"])
QUESTION = ao.Problem(PENDULUM, ao.Event(0.0, [0.5]), ao.Event(2.0, [-0.3]))
SEARCHES = {  # by a name, of which the one with a time or a listener returns
    "solve": lambda **given: ao.solve(QUESTION, throw=False, **given),
    "solve_all": lambda **given: ao.solve_all(
        QUESTION, starts=1, shots=8, continuations=0, **given
    ),
    "sweep": lambda **given: ao.sweep(QUESTION, {"t1": np.linspace(1.0, 2.0, 3)}, **given),
    "trace": lambda **given: ao.trace(QUESTION, "t1", 2.2, **given),
}


def types_in(hint):
    """Return the classes of the package in an annotation."""
    found = {hint} if inspect.isclass(hint) and hint.__module__.startswith("actionopt") else set()
    return found.union(*map(types_in, typing.get_args(hint)))


def test_every_type_that_a_public_function_returns_is_exported():
    exported = [getattr(room, name) for room in (ao, scenes, suite) for name in room.__all__]
    for call in filter(inspect.isfunction, exported):
        for kind in types_in(typing.get_type_hints(call, localns=LATER)["return"]):
            assert kind in exported, call.__name__


def objects():
    """Return an object of each public class, of a large system where it has arrays."""
    path = ao.Path.interpolate(
        lambda t: np.outer(np.arange(200.0), t), ao.Mesh.uniform(0, 1, 40, 4)
    )
    row = np.arange(200.0)
    solved = ao.solve(QUESTION)
    variation = ao.second_variation(solved, 2)
    scene, rope = scenes.get("pendulum"), scenes.Shape("rod", np.zeros((2, 400)))
    swept = ao.sweep(QUESTION, {"t1": [1.9, 2.0]})
    disc = ao.System(lambda q, v, t: v @ v / 2, ["x", "y"], obstacle=lambda q, t: q @ q - 1)
    plane = ao.System(lambda q, v, t: v @ v / 2, ["x", "y"])
    over = ao.solve(ao.Problem(disc, ao.Event(0.0, [-2.0, 0.1]), ao.Event(1.0, [2.0, 0.1])))
    shapes = plot.motion_data(solved, lambda q, t: [scenes.body((q[0], 0.0))], 30)
    return [
        *(
            CHAIN,
            CHAIN.system,
            CHAIN.start,
            ao.Periodic(1.0, row),
            ao.Bounce(len),
            ao.State(0.0, row, row),
            path,
        ),
        *(path.mesh, solved, solved.compare(), solved.inertia, solved.status, variation),
        ao.Sensitivity(row, row, 1.0, 1.0, {"m": row}, *(np.outer(row, row),) * 4, row, row),
        ao.SecondVariation(row, variation.modes * 50, variation.inertia, row),
        *(ao.monodromy(solved), ao.variation(solved, lambda t: [t * (2 - t)]), over.contacts[0]),
        *(swept, ao.trace(QUESTION, "t1", 2.05), SEARCHES["solve_all"]()),
        *(ao.find_symmetries(plane)[0], ao.noether(plane, lambda q, t: [q[1], -q[0]])),
        *(ao.ConjugatePoint(1.0, 2), ao.Contact(0, 1.0, ao.State(0.0, row, row), True)),
        ao.families.traces.marks.Mark("fold", 1.0, path, 0, 1),
        *(ao.SolveError("no path", solved), ao.IntegrationError("no motion")),
        *(plot.SI, shapes, plot.bundle_data(solved, 3), plot.curves(solved, 300)),
        *(plot.conserved_data(solved, 9), plot.energies_data(solved, 9)),
        plot.landscape_data(solved, 0.5, 3),
        *(plot.slice_data(solved, variation.modes[0], 1.0), plot.spectrum_data(solved, 1, 5)),
        *(plot.fan_data(solved, 3), plot.relaxation_data(solved, steps=5)),
        plot.phasors_data(solved, 0.1),
        *(swept.grid, swept.kept, solved.discrete, CHAIN.parameters),
        *(scene, scene.facts, scenes.Known(QUESTION), scenes.Words("What happens?")),
        scenes.Measure("area", "m^2"),
        *(
            rope,
            suite.FAMILIES["pendulum"],
            suite.get("pendulum", 2, 2),
            suite.model("arm_in_disc"),
        ),
    ]


@pytest.mark.long
def test_every_public_type_is_printed_in_one_line():
    printed = {type(x): repr(x) for x in objects()}
    assert max(map(len, printed.values())) < 350 and not any("\n" in x for x in printed.values())
    public = [getattr(room, name) for room in (ao, plot, scenes, suite) for name in room.__all__]
    left = set(filter(inspect.isclass, public)) - set(printed)
    assert "array(" not in "".join(printed.values())
    of_figures, abstract = {"Explorer", "Fronts", "Panels"}, {"Model"}
    assert {kind.__name__ for kind in left} <= of_figures | abstract


def test_every_search_is_told_of_in_one_way_and_can_be_given_a_time():
    told = []
    functions = filter(inspect.isfunction, (getattr(ao, name) for name in ao.__all__))
    searches = {f.__name__ for f in functions if "progress" in inspect.signature(f).parameters}
    assert searches == set(SEARCHES)
    for name, search in SEARCHES.items():
        hints = typing.get_type_hints(getattr(ao, name), localns=LATER)
        assert hints["progress"] == Progress | None and hints["seconds"] == float | None
        search(progress=lambda *call: told.append(call))
        for stage, done, total, detail in told:
            assert isinstance(stage, str) and stage and isinstance(done, (int, np.integer))
            assert total is None or done <= total
            assert isinstance(detail, Mapping) and detail
            assert all(isinstance(x, (Number, np.number)) for x in detail.values())
        assert told
        told.clear()
        for wrong in ({"progress": 3}, {"seconds": 0}, {"seconds": "1"}, {"seconds": np.nan}):
            with pytest.raises(ValueError, match=r"seconds|progress"):
                search(**wrong)


def test_what_ends_for_want_of_time_keeps_what_it_has():
    assert SEARCHES["solve"](seconds=1e-9).status is ao.Status.OUT_OF_TIME
    paths, runs = SEARCHES["solve_all"](seconds=1e-9), SEARCHES["sweep"](seconds=1e-9)
    assert paths.interrupted and len(paths) == 0
    assert runs.interrupted and (runs.status == "UNREACHED").all()
    with pytest.raises(ao.SolveError, match="time"):
        SEARCHES["trace"](seconds=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("seconds", [0.3, 1.0])
@pytest.mark.parametrize("name", ["solve", "solve_all", "sweep", "trace"])
def test_a_time_limit_is_kept(name, seconds):
    links = scenes.get("double_pendulum").problem
    calls = {
        "solve": lambda: ao.solve(
            links.replace(end=links.end.at(60.0)), seconds=seconds, throw=False
        ),
        "solve_all": lambda: ao.solve_all(links, seconds=seconds),
        "sweep": lambda: ao.sweep(links, {"t1": np.linspace(0.5, 2.0, 40_000)}, seconds=seconds),
        "trace": lambda: ao.trace(links, "t1", 50.0, seconds=seconds),
    }
    started = perf_counter()
    calls[name]()
    assert seconds * 0.9 < perf_counter() - started < seconds + 0.2
