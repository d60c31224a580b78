"""Whatever a public callable is given, an answer or a sentence comes of it, and nothing internal.

Every callable is called with arguments that fit, one or two of them replaced by odd ones. What it
raises is a ValueError or a TypeError that the package itself says, with a text, or one of its own.
"""

import dis
import inspect
import re
import signal
import sys
import warnings
from itertools import count
from pathlib import Path

import matplotlib
import numpy as np
import pytest
import systems
from matplotlib.animation import Animation
from scipy.interpolate import CubicSpline

import actionopt as ao
from actionopt import plot, scenes, suite

matplotlib.use("Agg")
PACKAGE = str(Path(ao.__file__).parent)
ROOMS = {"ao": ao, "plot": plot, "scenes": scenes, "suite": suite}
# What functions of the package return, and users do not make.
ANSWERS = {
    *(f"ao.{name}" for name in ao.__all__ if name[0].isupper()),
    *(
        "scenes.Facts",
        "scenes.Known",
        "scenes.Measure",
        "scenes.Scene",
        "scenes.Words",
        "suite.Family",
        "suite.Model",
    ),
    *(f"plot.{name}" for name in plot.__all__ if name[0].isupper()),
} - {
    f"ao.{name}"
    for name in ("Bounce", "Event", "Mesh", "Path", "Periodic", "Problem", "State", "System")
}
# What Python says of arguments that are missing, too many, unknown, or no place in a sequence,
# and what the odd callable `int` says of an array.
UNFIT = re.compile(
    r"\(\) (takes|missing|got)|^(too many|missing a|got an unexpected)|"
    r"indices must|scalar index|index-sized|"
    r"only (0-dim|length-1|size-1)|as an integer|int\(\) argument"
)
SECONDS = 10  # one call; what takes longer is ended, and no finding

free = systems.oscillator()
plane = ao.System(lambda q, v, t, *, m: m * v @ v / 2, ["x", "y"], parameters={"m": 1.0})
problem = ao.Problem(free, ao.Event(0.0, [0.0]), ao.Event(1.0, [1.0]))
solution = ao.solve(problem)
mesh = ao.Mesh.uniform(0.0, 1.0, 2, 4)
line = ao.Path.interpolate(lambda t: t[None], mesh)
cubic = CubicSpline([0.0, 0.5, 1.0], [0.0, 0.2, 1.0])
runs = ao.sweep(problem, {"t1": [0.9, 1.0]})
bent = ao.System(lambda q, v, a, t: a @ a / 2, ["x"])
spline = ao.solve(ao.Problem(bent, *(problem.start, problem.end), through=[ao.Event(None, [0.3])]))
passed = ao.solve(ao.Problem(free, problem.start, problem.end, through=[ao.Event(0.5, [0.1])]))


def draw(q, t):
    return [scenes.body((q[0], 0.0))]


def calls(folder):
    """Return for each public callable positional and named arguments that fit."""
    return {
        "ao.Bounce": ((lambda q, t: q[0],), {"t": None, "q": None}),
        "ao.Event": ((0.0, [0.0]), {"on": None, "v": None}),
        "ao.Mesh": (([0.0, 1.0], 4), {}),
        "ao.Path": ((mesh, line.values), {"velocities": line.values}),
        "ao.Periodic": ((1.0, [0.0]), {"relabel": [0]}),
        "ao.Problem": ((free, problem.start, problem.end), {"parameters": {}, "energy": None,
            "through": [], "integral": None}),
        "ao.State": ((0.0, [0.0], [1.0]), {}),
        "ao.System": ((lambda q, v, t, *, k=1.0: v @ v / 2, ["x"]),
            {"parameters": {}, "constraint": None, "force": None, "obstacle": None, "name": "",
            "integral": None}),
        "ao.conjugate_points": ((solution,), {}),
        "ao.contact_loss": ((solution,), {}),
        "ao.find_symmetries": ((free,), {"parameters": {}}),
        "ao.integrate": ((free, ao.State(0.0, [0.0], [1.0]), 1.0),
            {"tol": 1e-6, "parameters": {}, "mesh": mesh}),
        "ao.integrate_pfaffian": ((lambda q: [q[1], q[0]], [0.0, 0.0]),
            {"parameters": {}, "reach": 1.0}),
        "ao.load": ((folder / "kept.npz", free), {}),
        "ao.monodromy": ((solution,), {}),
        "ao.noether": ((plane, [1.0, 0.0]), {"time": 0.0, "gauge": None, "parameters": {}}),
        "ao.second_variation": ((solution, 2), {"units": 1.0}),
        "ao.solve": ((problem,), {"tol": 1e-6, "guess": line, "principle": "auto",
            "method": "auto", "mesh": mesh, "seconds": 1.0, "progress": print, "throw": True}),
        "ao.solve_all": ((problem,), {"tol": 1e-6, "angles": [], "windings": 0, "starts": 1,
            "shots": 5, "continuations": 0, "seed": 0, "progress": None}),
        "ao.sweep": ((problem, {"t1": [0.9, 1.0]}), {"executor": None, "tol": 1e-6,
            "record": None, "keep_paths": False, "zip": False, "progress": None, "resume": None}),
        "ao.trace": ((problem, "t1", 1.2), {"start": None, "guess": line, "tol": 1e-6,
            "steps": 3, "count": True, "progress": None}),
        "ao.variation": ((solution, lambda t: [t * (1 - t)]), {"unit": 1.0}),
        "plot.animation": ((solution, draw), {"seconds": 0.1, "fps": 10, "force": False}),
        "plot.bundle": ((solution,), {"ax": None, "coordinate": 0, "count": 3, "size": 0.2}),
        "plot.bundle_data": ((solution, 3, 0.2), {}),
        "plot.conserved": ((solution,), {"axes": None}),
        "plot.conserved_data": ((solution, 9), {}),
        "plot.contact": ((solution,), {"ax": None}),
        "plot.curves": ((solution, 9), {}),
        "plot.deviation": ((solution,), {"ax": None}),
        "plot.energies": ((solution,), {"ax": None, "kinetic": None}),
        "plot.energies_data": ((solution, 9), {"kinetic": None}),
        "plot.explore": ((problem,), {"guess": line, "units": None}),
        "plot.family": (([solution],), {"ax": None, "coordinate": 0}),
        "plot.family_data": (([solution], 9), {}),
        "plot.fan": ((solution,), {"ax": None, "coordinate": 0, "count": 3, "spread": 0.1}),
        "plot.fan_data": ((solution, 3, 0.1), {}),
        "plot.film": ((solution, draw, folder / "a.gif"), {"seconds": 0.1, "fps": 10}),
        "plot.fronts_data": ((solution, 5, 0.5), {"until": None}),
        "plot.landscape": ((solution,), {"ax": None, "reach": 0.5}),
        "plot.landscape_data": ((solution, 0.5, 3), {}),
        "plot.language": (("de",), {}),
        "plot.landscapes": (([solution],), {"axes": None}),
        "plot.mesh": ((solution,), {"axes": None}),
        "plot.mesh_data": ((solution,), {}),
        "plot.motion": ((solution, draw), {"ax": None, "count": 3, "force": False}),
        "plot.motion_data": ((solution, draw, 3), {"force": False}),
        "plot.overview": ((solution,), {"axes": None}),
        "plot.page": (
            (problem, folder / "a.html"),
            {"draw": None, "guess": None, "units": None, "lang": None},
        ),
        "plot.paths": ((solution,), {"ax": None, "compare": True}),
        "plot.phasors": ((solution, 0.1), {"axes": None, "mode": 0, "coordinate": 0}),
        "plot.phasors_data": ((solution, 0.1), {"mode": 0}),
        "plot.planar": ((["x", "y"],), {}),
        "plot.relaxation": ((solution,), {"start": None, "method": "descent", "coordinate": 0}),
        "plot.relaxation_data": ((solution,), {"start": None, "method": "descent", "steps": 5}),
        "plot.relaxation_film": ((solution, folder / "b.gif"), {"start": None, "fps": 5}),
        "plot.runs": ((runs, "action"), {"ax": None}),
        "plot.save": ((solution, folder / "a.png"), {"compare": False}),
        "plot.save_runs": ((runs, folder / "c.png", "action"), {}),
        "plot.slice_data": ((solution, line, 1.0, 5), {}),
        "plot.slices": ((solution,), {"ax": None, "etas": None, "reach": 0.5}),
        "plot.spectrum": ((solution,), {"ax": None, "count": 1}),
        "plot.spectrum_data": ((solution, 1, 5), {}),
        "plot.svg": ((lambda figure: figure.subplots(), (2.0, 1.0)), {}),
        "plot.svgs": ((lambda figure: figure.subplots(), (2.0, 1.0)), {}),
        "plot.symbol": (("theta",), {}),
        "plot.wavefronts": ((solution,), {"ax": None, "until": None}),
        "scenes.Shape": (("body", [[0.0], [0.0]]), {}),
        "scenes.body": (((0.0, 0.0),), {}),
        "scenes.circle": ((1.0, (0.0, 0.0)), {"points": 5}),
        "scenes.from_file": ((folder / "own.py",), {"settings": {}}),
        "scenes.get": (("pendulum",), {"l": 1.0}),
        "scenes.ground": (((0.0, 0.0), (1.0, 0.0)), {}),
        "scenes.parameters": (("pendulum",), {}),
        "scenes.project": ((np.zeros((3, 2)),), {}),
        "scenes.rod": (((0.0, 0.0), (1.0, 0.0)), {}),
        "scenes.spring": (((0.0, 0.0), (1.0, 0.0)), {}),
        "scenes.title": (("pendulum",), {}),
        "suite.TestProblem": ((suite.FAMILIES["pendulum"],), {"elements": 2, "degree": 2,
            "decades": None, "parameters": {}}),
        "suite.find": ((), {"kind": None, "constrained": None, "index": None, "size": None,
            "tags": (), "convex": None}),
        "suite.get": (("pendulum", 2, 2), {"decades": None}),
        "suite.model": (("arm_in_disc",), {}),
    }  # fmt: skip


EVENT_PARTS = ("of_places", "places", "pinned_places")
# Methods that the rooms call on each other's objects, and users do not.
INTERNAL = {
    *("Problem.active", "Problem.found_at", "Problem.in_force", "Problem.packed_of"),
    *("System.assemble", "System.laws_of", "System.of_laws"),
    *(f"{kind}.{name}" for kind in ("Event", "Periodic") for name in EVENT_PARTS),
    *("Mesh.cut", "Mesh.divide", "Mesh.over", "Mesh.part", "Mesh.with_times"),
    *(
        "Path.at",
        "Path.carried_on",
        "Path.node_velocities",
        "Path.through",
        "Periodic.after",
        "Problem.closed_from",
    ),
    *("Runs.begin", "Runs.put", "Runs.read", "System.arguments"),
    *(
        "System.check_free",
        "System.check_order",
        "System.dynamics",
        "System.forget",
        "System.memoize",
    ),
    *(
        "System.operations",
        "System.pointwise",
        "System.with_contact_distance",
        "System.with_obstacle_rows",
        "System.with_parameters",
    ),
    *("Variation.moved", "Variation.nodes"),
}


def answers():
    """Return an object of each type that has methods a user may call."""
    time, points = ao.Event(1.0, [0.5]), ao.solve_all(problem)
    return [
        *(solution, line, mesh, problem, free, time, ao.Periodic(1.0), runs, points, plot.SI),
        *(ao.trace(problem, "t1", 1.1), ao.variation(solution, lambda t: [t * (1 - t)])),
        *(ao.noether(plane, [1.0, 0.0]), plot.motion_data(solution, draw, 3)),
    ]


def methods_of(answer):
    """Return the names of the methods of an object that the package defines for users."""
    kind, found = type(answer), []
    for name in dir(kind):
        method = inspect.getattr_static(kind, name)
        method = getattr(method, "__func__", method)
        known = inspect.isfunction(method) and method.__module__.startswith("actionopt")
        open_to_users = name[0] != "_" or name in ("__call__", "__getitem__")
        if known and open_to_users and f"{kind.__name__}.{name}" not in INTERNAL:
            found.append(name)
    return found


def method_calls(folder):
    """Return for each method positional and named arguments that fit."""
    x, rate, clock = pytest.importorskip("sympy").symbols("x rate clock")
    at, state = (0.5,), ([0.5], [1.0], 0.5)
    file, values = folder / "m.npz", {"parameters": {}}
    calls = {}
    for name in ("__call__", "velocity", "acceleration"):
        calls[f"Path.{name}"] = calls[f"Solution.{name}"] = at, {}
    for name in (
        "constraint_force",
        "contact_force",
        "derivatives",
        "energy",
        "momentum",
        "multipliers",
    ):
        calls[f"Solution.{name}"] = at, {}
    for name in (
        "acceleration",
        "constraint_force",
        "energy",
        "force",
        "generalized_force",
        "lagrangian",
        "mass_matrix",
        "momentum",
        "multipliers",
    ):
        calls[f"System.{name}"] = state, values
    for name in ("constraint", "constraint_jacobian", "obstacle"):
        calls[f"System.{name}"] = ([0.5], 0.5), values
    for name in ("coordinate", "generalized_force", "momentum"):
        calls[f"UnitNames.{name}"] = ("theta",), {}
    return calls | {
        "Conserved.__call__": (([0.0, 0.0], [1.0, 0.0], 0.0), values),
        "Conserved.drift": ((solution, 5), {}),
        "Event.at": ((2.0,), {}),
        "Event.shifted": (([1.0],), {}),
        "Mesh.moved": ((1.0, 2.0), {}),
        "Mesh.uniform": ((0.0, 1.0, 2, 4), {}),
        "Motion.plain": ((), {}),
        "Path.interpolate": ((lambda t: t[None], mesh), {}),
        "Path.from_ppoly": ((cubic,), {}),
        "Path.legendre": ((), {}),
        "Path.on": ((mesh,), {}),
        "Path.to_ppoly": ((), {}),
        "Paths.__getitem__": ((0,), {}),
        "Periodic.at": ((2.0,), {}),
        "Periodic.shifted": (([1.0],), {}),
        "Problem.replace": ((), {"start": None, "end": problem.end, "parameters": {},
            "energy": None}),
        "Runs.retry": ((line,), {"executor": None, "progress": None, "resume": None}),
        "Runs.save": ((file,), {}),
        "Runs.solution": ((0,), {}),
        "Runs.to_xarray": ((), {"units": {"action": "J s"}}),
        "Solution.action_function": ((), {}),
        "Solution.compare": ((), {}),
        "Solution.opti": ((), {}),
        "Solution.save": ((file,), {}),
        "Solution.sensitivity": ((), {}),
        "Solution.to_dataframe": ((), {"t": [0.5]}),
        "Solution.to_xarray": ((), {"t": [0.5]}),
        "System.dynamics_function": ((), {}),
        "System.from_sympy": ((rate**2 / 2 - x**2, [x], [rate], clock), {"parameters": {},
            "constraint": None, "force": None, "obstacle": None, "name": ""}),
        "System.geodesic": ((lambda q, v: (v @ v) ** 0.5, ["x"]),
            {"parameters": {}, "constraint": None, "obstacle": None, "name": ""}),
        "System.to_sympy": ((), {}),
        "System.velocity": (([0.5], [1.0], 0.5, [1.0]), values),
        "Trace.at": ((1.05,), {}),
        "Trace.solution": ((0,), {}),
        "Variation.__call__": ((0.1,), {}),
        "Variation.path": ((0.1,), {}),
    }  # fmt: skip


ODD = [
    *(None, True, -1, 0, 3, 1.5, -2.5, np.nan, np.inf, 1e300, 10**400, 1j),
    *("", "x", b"x", "t1", [], (), {}, {"x": 1.0}, {"x", "y"}, [None], ["x"], [[1.0, 2.0], [3.0]]),
    *(np.zeros(0), np.zeros((2, 3, 4)), np.array("x"), [np.nan], [1.0, 2.0], range(3), object()),
    *(int, print, lambda: 0, lambda *a: None, lambda q, v, t: "x", lambda t: t),
    *(free, problem, problem.start, ao.Periodic(1.0), solution, mesh, line, runs),
    *(ao.Bounce(lambda q, t: q[0]), bent, spline, passed),
    *(ao.Event(0.0, [1.0, 2.0]), ao.Path.interpolate(lambda t: np.stack([t, t]), mesh)),
]


def odd(rng):
    return ODD[rng.integers(len(ODD))]


def trials(given, rng):
    """Yield endlessly arguments of which one or two are odd, missing or too many."""
    for k in count():
        positional, named = list(given[0]), dict(given[1])
        # Others than those that are odd are left as they are by default, as a rule.
        kept = rng.random() < 0.5
        places = [*range(len(positional)), *named]
        chosen = [places[i] for i in rng.permutation(len(places))[: 1 + (k % 3 == 2)]]
        for place in chosen:
            if isinstance(place, int):
                positional[place] = odd(rng)
            else:
                named[place] = odd(rng)
        if not kept:
            named = {name: x for name, x in named.items() if name in chosen}
        if rng.random() < 0.05:
            positional = positional[:-1] if rng.random() < 0.5 else [*positional, odd(rng)]
        yield positional, named


class TooLong(BaseException):
    """A call that takes its time."""


def finding(call, positional, named):
    """Return what is wrong with what comes of a call; nothing if it is in order."""

    def late(*_):
        raise TooLong

    before = signal.signal(signal.SIGALRM, late)
    signal.alarm(SECONDS)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            found = call(*positional, **named)
            if isinstance(found, Animation):
                found._draw_was_started = True  # it need not be shown
    except TooLong:
        return ""
    except (ao.SolveError, ao.IntegrationError):
        return ""
    except Exception as error:
        last = error.__traceback__
        while last.tb_next is not None:
            last = last.tb_next
        file = last.tb_frame.f_code.co_filename
        raised = last.tb_frame.f_code.co_code[last.tb_lasti] == dis.opmap["RAISE_VARARGS"]
        ours = (file.startswith(PACKAGE) and raised) or UNFIT.search(str(error))
        kinds = ValueError, TypeError, OSError, IndexError, ImportError
        said = isinstance(error, kinds) and len(str(error)) > 20
        if not (ours and said) or isinstance(error, np.linalg.LinAlgError):
            return f"{type(error).__name__}: {str(error)[:150]} ({file}:{last.tb_lineno})"
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)
        if "matplotlib.pyplot" in sys.modules:
            sys.modules["matplotlib.pyplot"].close("all")
    return ""


@pytest.fixture
def fitting(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    solution.save(tmp_path / "kept.npz")
    (tmp_path / "own.py").write_text("from actionopt import scenes\nscene = scenes.get('pendulum')")
    return calls(tmp_path)


def names():
    return [
        f"{room}.{name}"
        for room, module in ROOMS.items()
        for name in module.__all__
        if callable(getattr(module, name))
    ]


def test_every_public_callable_is_called(fitting):
    assert set(names()) - ANSWERS == set(fitting)


def tried(call, fitting, name, seed, most):
    """Return what is wrong with what comes of odd arguments."""
    rng = np.random.default_rng([seed, sum(name.encode())])
    found = {}
    for _, (positional, named) in zip(range(most), trials(fitting, rng), strict=False):
        wrong = finding(call, positional, named)
        if wrong:
            found.setdefault(wrong, (positional, named))
    return found


QUICK = ("ao.Event", "ao.Mesh", "ao.Periodic", "ao.Problem", "ao.State", "ao.System", "ao.solve")
SHORT = {"System.geodesic", "Runs.retry"}  # these solve or derive anew: a few trials, when quick


def function(name):
    room, _, short = name.partition(".")
    return getattr(ROOMS[room], short)


@pytest.mark.parametrize("name", QUICK)
def test_odd_arguments(fitting, name, capsys):
    assert not tried(function(name), fitting[name], name, 0, 20)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 2, 3])
@pytest.mark.parametrize("name", sorted(set(names()) - ANSWERS))
def test_many_odd_arguments(fitting, name, seed, capsys):
    assert not tried(function(name), fitting[name], name, seed, 60)


def odd_methods(folder, seed, most):
    """Return what is wrong with what comes of odd arguments of methods, by method."""
    fitting, found = method_calls(folder), {}
    assert len(fitting) == sum(len(methods_of(answer)) for answer in answers())
    for answer in answers():
        for method in methods_of(answer):
            name = f"{type(answer).__name__}.{method}"
            trials = 1 if most < 10 and name in SHORT else most
            found |= {name: tried(getattr(answer, method), fitting[name], name, seed, trials)}
    return {name: wrong for name, wrong in found.items() if wrong}


@pytest.mark.long
def test_odd_arguments_of_methods(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)  # some odd arguments are names of files
    assert not odd_methods(tmp_path, 0, 4)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_many_odd_arguments_of_methods(tmp_path, seed, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert not odd_methods(tmp_path, seed, 100)


def questions():
    """Return problems of other kinds, by what is special of them."""
    fall = ao.System(lambda q, v, t: v @ v / 2 - 9.81 * q[1], ["x", "y"])
    start, end = ao.Event(0.0, [0.0, 1.0]), ao.Event(1.0, [1.0, 1.0])
    floor = ao.Bounce(lambda q, t: q[1])
    rope = {"lagrangian": lambda q, v, t: q[0] * np.sqrt(1 + v[0] ** 2), "coordinates": ["y"]}
    rope = ao.System(**rope, integral=lambda q, v, t: np.sqrt(1 + v[0] ** 2))
    on = ao.Event(1.0, None, on=lambda q, t: q[0] ** 2 + q[1] ** 2 - 4)
    return {
        "accelerations": ao.Problem(bent, problem.start, problem.end),
        "gates": ao.Problem(bent, problem.start, problem.end, through=[ao.Event(None, [0.3])]),
        "bounce": ao.Problem(fall, start, end, through=[floor]),
        "integral": ao.Problem(rope, ao.Event(0.0, [0.0]), ao.Event(1.0, [0.2]), integral=1.5),
        "surface": ao.Problem(fall, start, on),
        "energy": ao.Problem(free, problem.start, ao.Event(None, [0.5]), energy=1.0),
    }


@pytest.mark.slow
@pytest.mark.parametrize("kind", questions())
def test_callables_take_questions_of_all_kinds_or_say_why_not(fitting, tmp_path, kind, capsys):
    asked = questions()[kind]
    answer = ao.solve(asked)
    by = {id(solution): answer, id(problem): asked, id(free): asked.system}
    found = {}
    for name, (given, _) in fitting.items():
        changed = [by.get(id(x), x) for x in given]
        if any(a is not b for a, b in zip(changed, given, strict=True)):
            found[name] = finding(function(name), changed, {})
    fit = method_calls(tmp_path)
    for own in (answer, asked, asked.system, answer.path):
        for method in methods_of(own):
            name = f"{type(own).__name__}.{method}"
            found[name] = finding(getattr(own, method), fit[name][0], {})
    assert not {name: wrong for name, wrong in found.items() if wrong}


class Three:
    """A whole number of another library."""

    def __index__(self):
        return 3


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda: plot.fan_data(solution, Three(), 0.1), None),
        (lambda: plot.landscapes(iter([solution])), None),
        (
            lambda: plot.phasors(solution, 0.1, coordinate=Three()),
            "coordinate from 0 to 0, found 3",
        ),
        (lambda: plot.slices(solution, etas=np.inf), "several variations"),
        (lambda: plot.fan(solution, np.array(0.5)), "axes of Matplotlib"),
        (lambda: plot.save(solution, "a.png", compare=np.zeros(0)), "compare=True or"),
        (lambda: ao.sweep(problem, {"t1": [1.0]}, keep_paths=np.zeros(0)), "keep_paths=True or"),
        (lambda: ao.trace(problem, "t1", 1.2, count=np.zeros(2)), "count=True or"),
        (lambda: ao.trace(problem, np.zeros(0), 1.2), "expected a name, or a tuple"),
        (lambda: ao.Problem(free, problem.start, 1.0, integral=1.0), r"Event\(t, q\) as the end"),
        (lambda: ao.Mesh([0.0, 1.0], [[1, 2], [3]]), "one degree or one for each"),
        (lambda: plot.slices(solution, etas=np.array("x")), "several variations"),
        (lambda: plot.landscapes(np.array("x")), "several solutions"),
        (lambda: (plot.fan_data(solution, 3), plot.fan_data(solution, np.ones(2))), "whole number"),
        (lambda: scenes.get("pendulum", l=1j), "a real number for l"),
        (lambda: ao.Problem(free, problem.start, problem.end, through=np.array("x")), "a list of"),
        (lambda: ao.System(lambda q, v, t: v @ v, np.array("x")), "a sequence of coordinate names"),
        (lambda: ao.sweep(problem, {"t1": [1.0]}, record=np.zeros(0)), "out of index"),
        (lambda: plot.page(problem, "a.html", lang=np.zeros(2)), "a language of"),
        (lambda: suite.find(convex=np.zeros(2)), "convex=True or"),
        (lambda: suite.find(index=-1), "for index, found -1"),
    ],
)
def test_what_only_looks_like_an_argument_is_taken_or_refused(call, said, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    if said is None:
        call()
    else:
        with pytest.raises(ValueError, match=said):
            call()


@pytest.mark.long
def test_symbols_of_other_packages_are_none_of_sympy():
    x, rate, clock = pytest.importorskip("sympy").symbols("x rate clock")
    with pytest.raises(ValueError, match="sympy"):
        ao.System.from_sympy(rate**2, [x], [rate], clock, force=free.symbols.q)
    with pytest.raises(ValueError, match="symbols of sympy"):
        ao.System.from_sympy(rate**2, free.symbols.q, [rate], clock)


def test_derivatives_are_known_where_only_one_leg_is_asked():
    exact = spline.parts[0].discrete.path(0.1)
    assert spline.derivatives(0.1)[0] == pytest.approx(exact)
    with pytest.raises(ValueError, match="accelerations"):
        ao.monodromy(spline)
    with pytest.raises(ValueError, match="trial paths are moved by their places"):
        plot.explore(spline.problem)
