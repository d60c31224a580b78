"""Solvers that misbehave, for the tests of the runner."""

import os
import sys
import time
from types import FunctionType

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


def vanish(problem, x0):
    os._exit(3)


def hang(problem, x0):
    while True:
        time.sleep(0.01)


def memory(problem, x0):
    hoard = []
    while True:
        hoard.append(bytearray(2**26))
