"""Whatever a public callable is given, an answer or a sentence comes of it, and nothing internal.

Every callable is called with arguments that fit, one or two of them replaced by odd ones. What it
raises is a ValueError or a TypeError that the package itself says, with a text, or one of its own.
"""

import re
import signal
import sys
import warnings
from itertools import count
from pathlib import Path

import matplotlib
import numpy as np
import pytest
from matplotlib.animation import Animation

import actionopt as ao
from actionopt import plot, scenes, suite

matplotlib.use("Agg")
PACKAGE = str(Path(ao.__file__).parent)
ROOMS = {"ao": ao, "plot": plot, "scenes": scenes, "suite": suite}
# What the package makes of its answers, and users read.
ANSWERS = {
    *("ao.Comparison", "ao.Runs", "ao.Solution", "ao.Status", "ao.SolveError"),
    *("ao.IntegrationError", "scenes.Facts", "scenes.Scene", "scenes.Words", "suite.Family"),
    *(f"plot.{name}" for name in plot.__all__ if name[0].isupper()),
}
# What Python says of arguments that are missing, too many or unknown.
UNFIT = re.compile(r"\(\) (takes|missing|got)|^(too many|missing a|got an unexpected)")
SECONDS = 10  # one call; what takes longer is ended, and no finding

free = ao.System(lambda q, v, t: v[0] ** 2 / 2 - q[0] ** 2 / 2, ["x"])
plane = ao.System(lambda q, v, t, *, m: m * v @ v / 2, ["x", "y"], parameters={"m": 1.0})
problem = ao.Problem(free, ao.Event(0.0, [0.0]), ao.Event(1.0, [1.0]))
solution = ao.solve(problem)
mesh = ao.Mesh.uniform(0.0, 1.0, 2, 4)
line = ao.Path.interpolate(lambda t: t[None], mesh)
runs = ao.sweep(problem, {"t1": [0.9, 1.0]})


def draw(q, t):
    return [scenes.body((q[0], 0.0))]


def calls(folder):
    """Return for each public callable positional and named arguments that fit."""
    return {
        "ao.Event": ((0.0, [0.0]), {"on": None}),
        "ao.Mesh": (([0.0, 1.0], 4), {}),
        "ao.Path": ((mesh, line.values), {"velocities": line.values}),
        "ao.Periodic": ((1.0, [0.0]), {"relabel": [0]}),
        "ao.Problem": ((free, problem.start, problem.end), {"parameters": {}, "energy": None}),
        "ao.State": ((0.0, [0.0], [1.0]), {}),
        "ao.System": ((lambda q, v, t, *, k=1.0: v @ v / 2, ["x"]),
            {"parameters": {}, "constraint": None, "force": None, "obstacle": None, "name": ""}),
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
        "plot.landscapes": (([solution],), {"axes": None}),
        "plot.mesh": ((solution,), {"axes": None}),
        "plot.mesh_data": ((solution,), {}),
        "plot.motion": ((solution, draw), {"ax": None, "count": 3, "force": False}),
        "plot.motion_data": ((solution, draw, 3), {"force": False}),
        "plot.overview": ((solution,), {"axes": None}),
        "plot.page": ((problem, folder / "a.html"), {"draw": None, "guess": None, "units": None}),
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
    }  # fmt: skip


ODD = [
    *(None, True, -1, 0, 3, 1.5, -2.5, np.nan, np.inf, 1e300, 10**400, 1j),
    *("", "x", b"x", "t1", [], (), {}, {"x": 1.0}, {"x", "y"}, [None], ["x"], [[1.0, 2.0], [3.0]]),
    *(np.zeros(0), np.zeros((2, 3, 4)), np.array("x"), [np.nan], [1.0, 2.0], range(3), object()),
    *(int, print, lambda: 0, lambda *a: None, lambda q, v, t: "x", lambda t: t),
    *(free, problem, problem.start, ao.Periodic(1.0), solution, mesh, line, runs),
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
        ours = file.startswith(PACKAGE) or UNFIT.search(str(error))
        said = isinstance(error, (ValueError, TypeError, OSError)) and len(str(error)) > 20
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


def tried(fitting, name, seed, most):
    """Return what is wrong with what comes of odd arguments."""
    room, _, short = name.partition(".")
    call = getattr(ROOMS[room], short)
    rng = np.random.default_rng([seed, sum(name.encode())])
    found = {}
    for _, (positional, named) in zip(range(most), trials(fitting[name], rng), strict=False):
        wrong = finding(call, positional, named)
        if wrong:
            found.setdefault(wrong, (positional, named))
    return found


QUICK = ("ao.Event", "ao.Mesh", "ao.Periodic", "ao.Problem", "ao.State", "ao.System", "ao.solve")


@pytest.mark.parametrize("name", QUICK)
def test_odd_arguments(fitting, name, capsys):
    assert not tried(fitting, name, 0, 20)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 2, 3])
@pytest.mark.parametrize("name", sorted(set(names()) - ANSWERS))
def test_many_odd_arguments(fitting, name, seed, capsys):
    assert not tried(fitting, name, seed, 60)
