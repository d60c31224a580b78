"""Write a test problem as an AMPL `.nl` file: ASCII, 17 significant digits.

The expression graph is written as it is: what is used more than once becomes a defined variable,
sums in a row one n-ary sum, so that no reader has to recurse deeply. Everything is declared
nonlinear; the J and G segments carry the structure with zero coefficients.

Source: D. M. Gay, *Writing .nl Files*, Sandia report SAND2005-7907P (2005).
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import casadi as ca
import numpy as np

from actionopt.suite.expression import nlp
from actionopt.suite.problem import TestProblem
from actionopt.tools.files import whole
from actionopt.tools.types import Array

# CasADi's operation: its opcode, and where the format has none of its own, more lines about the
# operands: before them, and after.
CODES = {"ADD": 0, "SUB": 1, "MUL": 2, "DIV": 3, "POW": 5, "CONSTPOW": 5, "NEG": 16, "FABS": 15}
CODES |= {"TANH": 37, "TAN": 38, "SQRT": 39, "SINH": 40, "SIN": 41, "LOG": 43, "EXP": 44}
CODES |= {"COSH": 45, "COS": 46, "ATANH": 47, "ATAN2": 48, "ATAN": 49, "ASINH": 50, "ASIN": 51}
CODES |= {"ACOSH": 52, "ACOS": 53}
OPERATIONS = {
    **{getattr(ca, f"OP_{name}"): (f"o{code}", "") for name, code in CODES.items()},
    ca.OP_SQ: ("o5", "n2"),
    ca.OP_TWICE: ("o2\nn2", ""),
    ca.OP_INV: ("o3\nn1", ""),
}


@dataclass(frozen=True, eq=False)
class Node:
    """An operation and its operands; a leaf has the text of its line instead."""

    operation: int
    operands: tuple[int, ...] = ()
    text: str = ""


def write(problem: TestProblem, file: str | Path, x0: Array | None = None) -> None:
    """Write the problem with the starting point x0 (n,), by default its own.

    Raises ValueError if its Lagrangian has an operation the format does not know.
    """
    start = problem.start() if x0 is None else x0
    with whole(file) as part, open(part, "w", encoding="ascii", newline="\n") as out:
        out.writelines(line + "\n" for line in lines(problem, start))


def lines(problem: TestProblem, x0: Array) -> Iterator[str]:
    """Yield the lines of the file."""
    given = nlp(problem, "SX")
    function = ca.Function("nlp", [given["x"]], [given["f"], given["g"]])
    nodes, results = _graph(function)
    uses = Counter(operand for node in nodes for operand in node.operands)
    uses.update(results)
    shared = [k for k, node in enumerate(nodes) if node.operands and uses[k] > 1]
    names = {k: f"v{problem.n + i}" for i, k in enumerate(shared)}
    rows, cols = problem.jacobian_structure
    yield from _header(problem, len(shared))
    for k in shared:
        yield f"V{names[k][1:]} 0 0"
        yield from _prefix(nodes, k, names)
    for i, k in enumerate(results[1:]):
        yield f"C{i}"
        yield from _prefix(nodes, k, names, top=True)
    yield "O0 0"
    yield from _prefix(nodes, results[0], names, top=True)
    yield f"x{problem.n}"
    yield from (f"{i} {_number(v)}" for i, v in enumerate(x0))
    if problem.m:
        yield "r"
        yield from ("4 0" for _ in range(problem.m))
    yield "b"
    yield from ("3" for _ in range(problem.n))
    columns = np.cumsum(np.bincount(cols, minlength=problem.n))
    yield f"k{problem.n - 1}"
    yield from map(str, columns[:-1].tolist())
    order = np.argsort(rows, kind="stable")
    splits = np.searchsorted(rows[order], np.arange(1, problem.m))
    for i, mine in enumerate(np.split(cols[order], splits) if problem.m else []):
        yield f"J{i} {mine.size}"
        yield from (f"{j} 0" for j in mine.tolist())
    yield f"G0 {problem.n}"
    yield from (f"{j} 0" for j in range(problem.n))


def _header(problem: TestProblem, shared: int) -> list[str]:
    n, m = problem.n, problem.m
    return [
        f"g3 1 1 0  # problem {problem.name}",
        f" {n} {m} 1 0 {m}  # vars, constraints, objectives, ranges, eqns",
        f" {m} 1  # nonlinear constraints, objectives",
        " 0 0  # network constraints: nonlinear, linear",
        f" {n if m else 0} {n} {n if m else 0}  # nonlinear vars in constraints, objectives, both",
        " 0 0 0 1  # linear network variables; functions; arith, flags",
        " 0 0 0 0 0  # discrete variables: binary, integer, nonlinear (b,c,o)",
        f" {problem.nnz_jacobian} {n}  # nonzeros in Jacobian, gradients",
        " 0 0  # max name lengths: constraints, variables",
        f" {shared if m else 0} 0 {0 if m else shared} 0 0  # common exprs: b,c,o,c1,o1",
    ]


def _graph(function: ca.Function) -> tuple[list[Node], list[int]]:
    """Return the nodes of the expression in order, and those of the outputs' entries.

    CasADi's instructions overwrite their work vector; a node is made for each value instead.
    """
    nodes: list[Node] = []
    work: dict[int, int] = {}
    sizes = [function.nnz_out(0), function.numel_out(1)]
    results = [_leaf(nodes, "n0")] * (sizes[0] + sizes[1])
    for k in range(function.n_instructions()):
        operation = function.instruction_id(k)
        out, given = function.instruction_output(k), function.instruction_input(k)
        if operation == ca.OP_OUTPUT:
            results[out[1] + (sizes[0] if out[0] else 0)] = work[given[0]]
        elif operation == ca.OP_INPUT:
            work[out[0]] = _leaf(nodes, f"v{given[1]}")
        elif operation == ca.OP_CONST:
            work[out[0]] = _leaf(nodes, f"n{_number(function.instruction_constant(k))}")
        elif operation in OPERATIONS:
            nodes.append(Node(operation, tuple(work[i] for i in given)))
            work[out[0]] = len(nodes) - 1
        else:
            raise ValueError(f"expected an operation of the .nl format, found CasADi's {operation}")
    return nodes, results


def _leaf(nodes: list[Node], text: str) -> int:
    nodes.append(Node(ca.OP_CONST, text=text))
    return len(nodes) - 1


def _prefix(
    nodes: list[Node], root: int, names: dict[int, str], top: bool = False
) -> Iterator[str]:
    """Yield an expression in Polish prefix form; at the `top` a shared one is only named."""
    stack: list[int | str] = [root]
    first = not top
    while stack:
        item = stack.pop()
        if isinstance(item, str):
            yield item
            continue
        if item in names and not first:
            yield names[item]
            continue
        first = False
        node = nodes[item]
        if not node.operands:
            yield node.text
            continue
        terms = _sum(nodes, item, names)
        if len(terms) > 2:
            yield "o54"
            yield str(len(terms))
            stack.extend(reversed(terms))
            continue
        before, after = OPERATIONS[node.operation]
        yield before
        if after:
            stack.append(after)
        stack.extend(reversed(node.operands))


def _sum(nodes: list[Node], item: int, names: dict[int, str]) -> list[int]:
    """Return the terms of ((a + b) + c) + ..., from the left: the order of summation is kept."""
    terms: list[int] = []
    while nodes[item].operation == ca.OP_ADD and not (terms and item in names):
        item, last = nodes[item].operands
        terms.append(last)
    return [item, *reversed(terms)]


def _number(value: float) -> str:
    return f"{value:.17g}"
