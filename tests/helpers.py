"""What the tests of several modules need: solutions solved once, and motions not by the package."""

from functools import cache
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import actionopt as ao
from actionopt import Event, Mesh, Problem, scenes
from actionopt.discrete.action.transcription import Transcription
from actionopt.solver.refinement.workspace import Workspace
from actionopt.solver.search.search import Search
from actionopt.solver.search.strategies import STRATEGIES

# Scenes each of which takes ten times as long as most.
LONG = {"string_to_wall", "way_round_ball"}


def fake(**known) -> Any:
    """Return what has these attributes, for a function that asks for no more."""
    return SimpleNamespace(**known)


def _case(x, *marks):
    return pytest.param(*(x if isinstance(x, tuple) else (x,)), marks=marks)


def slow(*variants):
    """Return variants of a test that are run where the slow ones are."""
    return [_case(x, pytest.mark.slow) for x in variants]


def a_quarter(variants, first=0):
    """Return a test's variants, every fourth of them quick; tests with another `first` take others.

    All are run where the slow ones are; scenes that take long are run there alone.
    """
    found = []
    for k, x in enumerate(variants):
        spared = (k - first) % 4 or (isinstance(x, str) and x in LONG)
        found += slow(x) if spared else [_case(x)]
    return found


# What a test raises that fails: `pytest.raises` its own, and variants of variants several.
FAILURES = Exception, pytest.fail.Exception, BaseExceptionGroup


def at_once(names, variants):
    """Return a test with all its variants, as `pytest.mark.parametrize` takes them, in one run.

    To report one takes five milliseconds: longer than many take. All are run, whichever fail.
    """
    names = [x.strip() for x in names.split(",")] if isinstance(names, str) else names
    variants = list(variants)  # several are the rows and columns of a table

    def of_all(test):
        def run(**given):
            failures = []
            for variant in variants:
                values = variant if len(names) > 1 else [variant]
                own = dict(zip(names, values, strict=True))
                try:
                    test(**given, **own)
                except FAILURES as failure:
                    failure.add_note(str(own))
                    failures.append(failure)
            if len(failures) > 1:
                raise BaseExceptionGroup(f"{len(failures)} of {len(variants)}", failures)
            if failures:
                raise failures[0]

        run.__doc__ = test.__doc__
        return run

    return of_all


@cache
def of_one_leg():
    """Return the scenes whose paths pass no events between their ends and have no integrals.

    And whose Lagrangian contains no accelerations.
    """
    asked = ((name, scenes.get(name).problem) for name in scenes.SCENES)
    simple = [(name, x) for name, x in asked if not x.through and x.integral is None]
    return [name for name, x in simple if x.system.order == 1]


@cache
def solved(name, *, tol=1e-8, **parameters):
    """Return the solution of a scene, near its guess if it has one."""
    scene = scenes.get(name, **parameters)
    return ao.solve(scene.problem, guess=scene.guess, tol=tol)


def contrast(*colours):
    """Return the contrast of two colours, (r, g, b) of 0 to 1 each; WCAG 2.2."""
    share = np.array(colours)
    linear = np.where(share <= 0.04045, share / 12.92, ((share + 0.055) / 1.055) ** 2.4)
    dark, light = sorted(linear @ [0.2126, 0.7152, 0.0722])
    return float((light + 0.05) / (dark + 0.05))


def same_bits(one, other, because):
    """Assert that two computations gave the same numbers, to the last bit.

    Any rounding may part them, and does so on another processor first. So `because` says why none
    can: the same operations on the same numbers, or on these with other signs or powers of two.
    """
    message = f"other bits, which cannot be {because}"
    np.testing.assert_array_equal(one, other, message, strict=True)


def applies(strategy, problem, principle="auto"):
    """Return whether a strategy is open to a problem, by its name."""
    ws = Workspace(problem)
    ws.transcribe(Mesh.uniform(problem.start.t, problem.end.t, 4, 6), None)
    search = Search(ws, 1e-8, principle, None, STRATEGIES, may_be_least=principle != "stationary")
    (way,) = (way for way in STRATEGIES if way.name == strategy)
    return way.applies(search)


def times(problem, count=401):
    return np.linspace(problem.start.t, problem.end.t, count)


def integrated(rate, y, t0, t1, rtol=1e-13):
    """Integrate y' = rate(t, y) independently of the package: a function of (K,) times."""
    return solve_ivp(rate, (t0, t1), y, "DOP853", rtol=rtol, atol=rtol / 10, dense_output=True).sol


def motion(system, q, v, t0, t1, parameters=None, rtol=1e-13):
    """Integrate the equations of motion from a state: a function of (K,) times, q (n, K)."""

    def rate(t, y):
        q, v = np.split(y, 2)
        return np.concatenate([v, system.acceleration(q, v, t, parameters=parameters)])

    run = integrated(rate, np.concatenate([q, v]), t0, t1, rtol)
    return lambda t: run(t)[: system.n]


def forward(solution, factor=1.0):
    """Return the motion that sets out as the solution does, with `factor` times its velocity."""
    problem, start = solution.problem, solution.start
    ends = start.t, problem.end.t
    return motion(problem.system, start.q, factor * start.v, *ends, problem.parameters)


def relative_error(curve, exact, t):
    """Largest |q_h - q|, each coordinate in units of the largest it reaches: what tol bounds."""
    known = exact(t)
    size = np.max(np.abs(known), axis=1)
    size = np.where(size > 1e-12 * size.max(), size, size.max())
    return float(np.max(np.max(np.abs(curve(t) - known), axis=1) / size))


def transcribed(system, ends, T, elements=8, degree=6, lengths=None):
    """Return the action between two places in the time T, on equal elements."""
    problem = Problem(system, Event(0.0, ends[0]), Event(T, ends[1]))
    lengths = problem.lengths if lengths is None else np.array(lengths)
    return Transcription(problem, Mesh.uniform(0.0, T, elements, degree), lengths)


def record(solver, problem, at="optimum", seconds=1.0, count=1, **more):
    """Return a record of the suite's runner: by default of a minimum, found exactly."""
    found = {} if at is None else {"at": at, "off": 0.0, "f_there": 1.0, "index": 0, "above": False}
    return {
        "solver": solver,
        "problem": problem,
        "outcome": "answered",
        "said": "solved",
        "unbounded": False,
        "class": "QUR2-MN-9-0",
        "n": 9,
        "f_star": 1.0,
        "f_lowest": 1.0,
        "f_start": 11.0,
        "residual": 0.0,
        "seconds": seconds,
        "times": [2 * seconds, seconds],
        "evaluations": {"f": count},
        "history": [(1, 11.0, 0.0), (count, 1.0, 0.0)],
        **found,
        **more,
    }
