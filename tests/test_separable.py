"""Second derivatives of sums of like terms."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest

import actionopt as ao
from actionopt.mechanics.laws import separable
from actionopt.mechanics.laws.switches import narrowness
from actionopt.mechanics.laws.tracing import stack
from actionopt.tools.tape import Tape

TABLE = ca.interpolant(
    "V", "bspline", [np.linspace(-9.0, 9.0, 19)], np.linspace(-3.0, 3.0, 19) ** 2
)


def of_pairs(q, v, t, *, k, c):
    terms = 0.0
    for i in range(8):
        for j in range(i):
            r = q[i] - q[j]
            terms = terms - k * 2 * (1 / np.sqrt(1 + r * r + c[0] * t)) / c[1]
            terms = terms + (1 + t) * np.cos(q[i] * v[j]) * (i + 1)
    return v @ v / 2 - terms - np.exp(np.sum(q) / 9) - TABLE(q[2]) + t * k


@pytest.mark.parametrize("least", [2, 1000])  # terms of a form: all are derived as one, or none
def test_terms_of_one_form_are_derived_as_one(monkeypatch, least):
    monkeypatch.setattr(separable, "LEAST_ROWS", 1)
    monkeypatch.setattr(separable, "DENSE_ROW", 1)
    monkeypatch.setattr(separable, "LEAST_ALIKE", least)
    names = [f"x{i}" for i in range(8)]
    system = ao.System(of_pairs, names, parameters={"k": 0.7, "c": [0.3, 1.9]})
    x, arguments = stack(system.symbols.q, system.symbols.v), system._arguments
    found = separable.hessian(system.L, x, arguments, lambda: system.lagrangian_tape)
    exact = ca.hessian(system.L, x)
    at = np.random.default_rng(1).normal(size=16)
    both = [
        ca.Function("f", arguments, [ca.triu(H), g])(at[:8], at[8:], 0.4, [0.7, 0.3, 1.9])
        for H, g in (found, exact)
    ]
    for ours, theirs in zip(*both, strict=True):
        assert np.allclose(ours.full(), theirs.full(), rtol=0, atol=1e-13)
    alike, _ = separable._terms(system.lagrangian_tape, arguments)
    assert len(alike) == (0 if least == 1000 else 3)


def test_sums_of_what_is_shared_are_gone_through_once():
    def shared(q, v, t, *, c):
        s = q[0] * q[0]
        for _ in range(60):  # 2^60 terms, if each use is a term of its own
            s = s + c * s
        return v @ v / 2 - s

    system = ao.System(shared, ["x", "y"], parameters={"c": 0.1})
    alike, rest = separable._terms(system.lagrangian_tape, system._arguments)
    value = ca.Function("f", system._arguments, [rest])(*[[3.0, 1.0], [2.0, 0.0], 0.0, [0.1]])
    assert not alike and float(value) == pytest.approx(2.0 - 9.0 * 1.1**60)


def test_operands_are_those_of_each_result():
    """What a law of several components divides by is found in all of them."""
    q, t = ca.SX.sym("q", 2), ca.SX.sym("t")
    for law, narrow in (
        (ca.vertcat(q[1], 1 / (q[0] ** 2 + 1e-4)), 1),
        (ca.vertcat(q[0] * q[1], t / (q[0] + 3)), 1),
        (ca.vertcat(q[0] / 2, q[1] / 3), 0),
    ):
        tape = Tape([q, t], [law])
        last = [tape.nodes[node.operands[-1]] for node in tape.nodes if node.operation == ca.OP_DIV]
        assert tape.last_operands([ca.OP_DIV]) == [(node.operation, node.entry[0]) for node in last]
        assert narrowness(tape) == narrow
