"""A table of pairs of kinds of questions: each has a known answer, or a reason why it has none."""

import numpy as np
import pytest

import actionopt as ao

KNOWN = 1e-7  # how near an answer is to the known one


class Pairs:
    """The pairs of `features`: functions that check an answer, or are refused with words."""

    def __init__(self, features):
        self.features = features
        self.solved, self.refused = {}, {}

    def __call__(self, *names):
        assert set(names) <= set(self.features)
        return frozenset(names)

    def solves(self, *names):
        """Enter a function that asks a question of these kinds, and checks the answer."""

        def entered(function):
            assert self(*names) not in self.solved
            self.solved[self(*names)] = function
            return function

        return entered

    def refuses(self, *names, says, because):
        """Enter a function that asks a question which is refused, `because` of mechanics."""

        def entered(function):
            assert because and self(*names) not in self.refused
            self.refused[self(*names)] = function, says
            return function

        return entered

    def named(self, entry):
        return " x ".join(sorted(entry, key=self.features.index))


def check(problem, *curves, T=1.0, action=None, **options):
    """Solve, and compare coordinates with functions of the time, the duration and the action."""
    sol = ao.solve(problem, **options)
    assert sol.duration == pytest.approx(T, rel=KNOWN)
    t = np.linspace(0, 1, 41) * sol.duration
    for x, known in zip(sol(t + sol.problem.start.t), curves, strict=True):
        assert x == pytest.approx(known(t), abs=KNOWN)
    if action is not None:
        assert sol.action == pytest.approx(action, rel=KNOWN)
    return sol


def ask(system, start, end, T=1.0, **more):
    return ao.Problem(system, ao.Event(0, start), ao.Event(T, end), **more)
