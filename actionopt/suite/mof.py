"""Write a test problem as MathOptFormat, the JSON that JuMP's `read_from_file` reads.

`NLPModelsJuMP.MathOptNLPModel` makes an NLPModel of what JuMP has read. Multipliers there have the
sign of df*/dc: minus those of f + lam'c.

Source: B. Legat, O. Dowson, J. D. Garcia and M. Lubin, *MathOptInterface: a data structure for
mathematical optimization problems*, INFORMS J. on Computing 34 (2022), 672-689; schema 1.2.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np

from actionopt.suite.action import ActionProgram
from actionopt.suite.listing import Listing, first_multipliers
from actionopt.suite.problem import TestProblem
from actionopt.tools.files import whole
from actionopt.tools.tape import Tape
from actionopt.tools.types import Array

NAMES = {"ADD": "+", "SUB": "-", "MUL": "*", "DIV": "/", "POW": "^", "CONSTPOW": "^", "NEG": "-"}
NAMES |= {"FABS": "abs"} | {
    name: name.lower()
    for name in "TANH TAN SQRT SINH SIN LOG EXP COSH COS ATANH ATAN ASINH ASIN ACOSH ACOS".split()
}
MOF_OPERATIONS = {getattr(ca, f"OP_{name}"): (text, "{}") for name, text in NAMES.items()}
MOF_OPERATIONS |= {ca.OP_SQ: ("^", "{}2"), ca.OP_TWICE: ("*", "{}2"), ca.OP_INV: ("/", "1{}")}
# What a constraint's set is, by whether it has a lower and an upper bound.
SETS = {(True, False): "GreaterThan", (False, True): "LessThan", (True, True): "Interval"}

Term = dict[str, Any]


def write(problem: ActionProgram, file: str | Path, x0: Array | None = None) -> Path:
    """Write the problem with the starting point x0 (n,), by default its own; return the file.

    Raises ValueError if its Lagrangian has an operation the format does not know.
    """
    if x0 is None:
        assert isinstance(problem, TestProblem)
        x0 = problem.start()
    with whole(file) as part, open(part, "w", encoding="utf-8", newline="\n") as out:
        out.writelines(text(problem, x0))
    return Path(file)


def text(problem: ActionProgram, x0: Array) -> Iterator[str]:
    """Yield the text of the file in pieces: it is never in memory as a whole."""
    listing, names = Listing(problem), problem.variable_names
    head = {
        "version": {"major": 1, "minor": 2},
        "name": problem.name,
        "description": f"{problem.classification}: actionopt's test problem {problem.name}; "
        "duals are minus the multipliers of f + lam'c",
    }
    yield json.dumps(head)[:-1]
    yield ',\n"variables": ['
    yield from _as_list(
        {"name": name, "primal_start": value}
        for name, value in zip(names, x0.tolist(), strict=True)
    )
    yield '],\n"objective": {"sense": "min", "function": {"type": "ScalarNonlinearFunction",\n'
    yield '"node_list": ['
    terms = _Terms(listing, names)
    yield from _as_list(terms.objective())
    yield f'],\n"root": {json.dumps(_node(terms.count))}}}}},\n"constraints": ['
    yield from _as_list(_constraints(listing, names, first_multipliers(problem, x0)))
    yield "]}\n"


def _as_list(items: Iterator[Term]) -> Iterator[str]:
    for k, item in enumerate(items):
        yield (",\n" if k else "\n") + json.dumps(item)


def _node(index: int) -> Term:
    return {"type": "node", "index": index}


def _real(value: float) -> Term:
    return {"type": "real", "value": float(value)}


class _Terms:
    """The nodes of one function, numbered from 1 as they come."""

    def __init__(self, listing: Listing, names: list[str]) -> None:
        self.listing, self.names, self.count = listing, names, 0

    def add(self, kind: str, *args: Term) -> Term:
        """Return a node of this number."""
        self.count += 1
        return {"type": kind, "args": list(args)}

    def unknown(self, column: int, value: float) -> Term:
        """Return an unknown in its own units; what is given, as a number."""
        if column < 0:
            return _real(value)
        return {"type": "variable", "name": self.names[column]}

    def objective(self) -> Iterator[Term]:
        """Yield the nodes of f; the last is f."""
        listing, tape = self.listing, self.listing.lagrangian
        n = listing.layout.system.n
        moving = listing.moving
        summed = []
        for here in listing.evaluations():
            q = yield from self.coordinates(here.columns, here.given)
            v = [_real(0.0)] * n
            for a in moving:
                free = (here.around[:, a] >= 0) & (here.rate != 0)
                columns = here.around[free, a]
                products = []
                for j, rate in zip(columns.tolist(), here.rate[free].tolist(), strict=True):
                    scale = _real(rate / listing.program.stretch[j])
                    yield self.add("*", scale, self.unknown(j, 0.0))
                    products.append(_node(self.count))
                yield self.add("+", _real(float(here.fixed[a])), *products)
                v[a] = _node(self.count)
            root = yield from self.nodes(tape, {"q": q, "v": v, "t": [_real(here.time)]})
            yield self.add("*", _real(here.weight), root)
            summed.append(_node(self.count))
        yield self.add("+", *summed)

    def coordinates(self, columns: Any, given: Any) -> Any:
        """Yield nodes of coordinates in the scene's units; return these."""
        found = []
        for j, value in zip(columns.tolist(), given.tolist(), strict=True):
            term = self.unknown(j, value)
            if j >= 0 and self.listing.program.decades:
                yield self.add("*", _real(1 / float(self.listing.program.stretch[j])), term)
                term = _node(self.count)
            found.append(term)
        return found

    def nodes(self, tape: Tape, inputs: dict[str, list[Term]]) -> Any:
        """Yield the nodes of a tape; return that of its first result."""
        place: dict[int, Term] = {}
        for k, node in enumerate(tape.nodes):
            if node.kind == "constant":
                place[k] = _real(node.value)
            elif node.kind == "input":
                place[k] = inputs[tape.names[node.entry[0]]][node.entry[1]]
            elif node.operation not in MOF_OPERATIONS:
                raise ValueError(
                    f"expected an operation of MathOptFormat, found CasADi's {node.operation}"
                )
            else:
                kind, more = MOF_OPERATIONS[node.operation]
                args = [place[i] for i in node.operands]
                if more.startswith("1"):
                    args = [_real(1.0), *args]
                if more.endswith("2"):
                    args = [*args, _real(2.0)]
                yield self.add(kind, *args)
                place[k] = _node(self.count)
        return place[tape.results[0][0]]


def _constraints(listing: Listing, names: list[str], lam: Array) -> Iterator[Term]:
    """Yield the bounds of x, and the rows of c."""
    problem = listing.program
    for name, lower, upper in zip(names, *problem.bounds, strict=True):
        if np.isfinite(lower) or np.isfinite(upper):
            yield {"function": {"type": "Variable", "name": name}, "set": _set(lower, upper)}
    coefficients, constants = listing.linear
    rows, cols = problem.jacobian_structure
    order = np.argsort(rows, kind="stable")
    splits = np.split(order, np.searchsorted(rows[order], np.arange(1, problem.m)))
    sides = zip(problem.constraint_names, *problem.constraint_bounds, strict=True)
    duals = [{"dual_start": -value} for value in lam.tolist()] or [{}] * problem.m
    for here, mine, constant, (name, lower, upper), dual in zip(
        listing.rows(), splits, constants, sides, duals, strict=problem.m > 0
    ):
        given = [(names[cols[k]], float(coefficients[k])) for k in mine if coefficients[k]]
        if listing.affine:
            terms = [{"coefficient": a, "variable": x} for x, a in given]
            function = {"type": "ScalarAffineFunction", "terms": terms, "constant": 0.0}
            lower, upper = lower - constant, upper - constant
        else:
            made = _Terms(listing, names)
            nodes = list(_row(made, here, constant, given))
            root = _node(made.count)
            function = {"type": "ScalarNonlinearFunction", "root": root, "node_list": nodes}
        yield {"name": name, "function": function, "set": _set(lower, upper), **dual}


def _row(
    made: _Terms, here: Any, constant: float, given: list[tuple[str, float]]
) -> Iterator[Term]:
    q = yield from made.coordinates(here.columns, here.given)
    tape = made.listing.constraints[here.which]
    root = yield from made.nodes(tape, {"q": q, "t": [_real(here.time)]})
    yield made.add("*", _real(here.weight), root)
    summed = [_node(made.count), _real(constant)]
    for name, coefficient in given:
        yield made.add("*", _real(coefficient), {"type": "variable", "name": name})
        summed.append(_node(made.count))
    yield made.add("+", *summed)


def _set(lower: float, upper: float) -> Term:
    if lower == upper:
        return {"type": "EqualTo", "value": float(lower)}
    bounds = {"lower": lower, "upper": upper}
    kind = SETS[bool(np.isfinite(lower)), bool(np.isfinite(upper))]
    return {"type": kind, **{k: float(v) for k, v in bounds.items() if np.isfinite(v)}}
