"""Solvers that misbehave, for the tests of the runner."""

import os
import time


def right(problem, x0):
    return problem.x_star, problem.lam_star, False  # and too modest to say so


def wrong(problem, x0):
    return problem.x_star + 0.01 * problem.unit, None, True


def other(problem, x0):
    return problem.others[0], None, True


def nothing(problem, x0):
    return x0 + float("nan")


def gives_up(problem, x0):
    return x0, None, False


def raises(problem, x0):
    raise RuntimeError("no")


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
