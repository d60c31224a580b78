"""Solvers that misbehave, for the tests of the runner."""

import os
import subprocess
import sys
import time
from types import FunctionType

import numpy as np

from actionopt import suite
from actionopt.scenes import Scene
from actionopt.suite import Family, TestProblem


def right(problem, x0):
    known = suite.get("pendulum")
    return known.x_star, known.lam_star, False  # and too modest to say so


def wrong(problem, x0):
    known = suite.get("pendulum")
    return known.x_star + 0.01 * known.unit, None, True


def other(problem, x0):
    return suite.get("kepler_two_ways").others[0].x, None, True


def saddle(problem, x0):
    return suite.get("pendulum_long").x_star


def falls(problem, x0):
    return x0, None, "unbounded"


def falls_far(problem, x0):
    step = 1e4 * np.sin(np.linspace(0, np.pi, problem.n))  # the slowest of all motions
    return x0 + step, None, "unbounded"


def hides(problem, x0):
    """Try what would leave no count behind."""
    for name in ("view", "counts", "visited", "transcription", "__self__"):
        if hasattr(problem, name) or hasattr(problem.objective, name):
            raise LookupError(f"found {name}")
    problem.bounds[0][:] = problem.hessian_structure[0][:] = 0
    for _ in range(3):
        problem.objective(x0)
    return x0, None, False


CALLS = []


def wavers(problem, x0):
    """Be right once, and then not."""
    CALLS.append(problem)
    return right(problem, x0)[0] + (len(CALLS) > 1), None, True


def peeks(problem, x0):
    """Look for the answer wherever attributes lead."""
    seen, ahead = set(), [problem]
    while ahead:
        thing = ahead.pop()
        if id(thing) in seen or isinstance(thing, (str, bytes, int, float, type(os))):
            continue
        seen.add(id(thing))
        if isinstance(thing, (TestProblem, Family, Scene)):
            raise LookupError(f"found a {type(thing).__name__}")
        if isinstance(thing, dict):
            ahead.extend(thing.values())
        elif isinstance(thing, (list, tuple, set)):
            ahead.extend(thing)
        elif isinstance(thing, FunctionType):
            ahead.extend(cell.cell_contents for cell in thing.__closure__ or ())
        elif type(thing).__module__.startswith("actionopt"):
            ahead.extend(getattr(thing, name, None) for name in dir(thing) if name[:2] != "__")
    return x0, None, len(seen) < 20  # it has looked around


def looks_up(problem, x0):
    """Look for the answer in what calls, and where functions were evaluated last."""
    # Whoever digs may; there is no answer there.
    inside = [cell.cell_contents for cell in problem.objective.__closure__]
    (problem,) = (function.__self__ for function in inside if callable(function))
    system, frame = problem.transcription.problem.system, sys._getframe()
    found = [name for name, function in system._pointwise.items() if function._memory.ready]
    found += ["point"] if problem.transcription._point else []
    while frame := frame.f_back:
        found += [k for k, x in frame.f_locals.items() if isinstance(x, (TestProblem, Scene))]
    if found:
        raise LookupError(f"found {', '.join(found)}")
    return x0, None, False


def nothing(problem, x0):
    return x0 + float("nan")


def gives_up(problem, x0):
    return x0, None, False


def raises(problem, x0):
    raise RuntimeError("no")


def too_short(problem, x0):
    return x0[:-1]


def mute(problem, x0):
    return x0, None, "perhaps"


def takes_too_much(problem, x0, tolerance):
    return x0


def crash(problem, x0):
    os.abort()


def hang(problem, x0):
    while True:
        pass


def sleep(problem, x0):
    time.sleep(100)


def calls(problem, x0):
    """Let another program take the time."""
    subprocess.run([sys.executable, "-c", "while True: pass"], check=True)


def memory(problem, x0):
    hoard = []
    while True:
        hoard.append(bytearray(2**26))
