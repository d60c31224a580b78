"""The lines of AMPL's `.nl` format: expressions in Polish prefix form, bounds, derivatives.

Source: D. M. Gay, *Writing .nl Files*, Sandia report SAND2005-7907P (2005).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import casadi as ca
import numpy as np

from actionopt.suite.program import Program
from actionopt.tools.tape import Node, Tape
from actionopt.tools.types import Array

# CasADi's operation: its opcode, and where the format has none of its own, more lines about the
# operands: before them, and after.
NL_CODES = {"ADD": 0, "SUB": 1, "MUL": 2, "DIV": 3, "POW": 5, "CONSTPOW": 5, "NEG": 16, "FABS": 15}
NL_CODES |= {"TANH": 37, "TAN": 38, "SQRT": 39, "SINH": 40, "SIN": 41, "LOG": 43, "EXP": 44}
NL_CODES |= {"COSH": 45, "COS": 46, "ATANH": 47, "ATAN2": 48, "ATAN": 49, "ASINH": 50, "ASIN": 51}
NL_CODES |= {"ACOSH": 52, "ACOS": 53}
NL_OPERATIONS = {
    **{getattr(ca, f"OP_{name}"): (f"o{code}", "") for name, code in NL_CODES.items()},
    ca.OP_SQ: ("o5", "n2"),
    ca.OP_TWICE: ("o2\nn2", ""),
    ca.OP_INV: ("o3\nn1", ""),
}


def derivatives(problem: Program, coefficients: Array) -> Iterator[str]:
    """Yield the structure of Jacobian and gradient, with what is linear."""
    rows, cols = problem.jacobian_structure
    columns = np.cumsum(np.bincount(cols, minlength=problem.n))
    yield f"k{problem.n - 1}\n"
    yield from (f"{count}\n" for count in columns[:-1].tolist())
    order = np.argsort(rows, kind="stable")
    splits = np.searchsorted(rows[order], np.arange(1, problem.m))
    for i, mine in enumerate(np.split(order, splits) if problem.m else []):
        yield f"J{i} {mine.size}\n"
        values = zip(cols[mine].tolist(), coefficients[mine].tolist(), strict=True)
        yield from (f"{j} {number(value)}\n" for j, value in values)
    yield f"G0 {problem.n}\n"
    yield from (f"{j} 0\n" for j in range(problem.n))


def prefix(tape: Tape, root: int, named: bool = False) -> str:
    """Return an expression in Polish prefix form, to be formatted with what its operands are.

    What is shared is only named; `named`: even the expression itself.
    """
    names = tape.common_places
    stack: list[int | str] = [root]
    lines: list[str] = []
    while stack:
        item = stack.pop()
        if isinstance(item, str):
            lines.append(item)
            continue
        node = tape.nodes[item]
        if item in names and (named or lines):
            lines.append(f"{{s[{names[item]}]}}")
        elif node.kind == "input":
            lines.append(f"{{{tape.place(node)}}}")
        elif node.kind == "constant":
            lines.append(f"n{number(node.value)}")
        elif len(terms := _sum(tape.nodes, item, names)) > 2:
            lines += ["o54", str(len(terms))]
            stack.extend(reversed(terms))
        else:
            if node.operation not in NL_OPERATIONS:
                raise ValueError(
                    f"expected an operation of the .nl format, found CasADi's {node.operation}"
                )
            before, after = NL_OPERATIONS[node.operation]
            lines.append(before)
            stack.extend([after] if after else [])
            stack.extend(reversed(node.operands))
    return "\n".join(lines) + "\n"


def _sum(nodes: Sequence[Node], item: int, names: Mapping[int, int]) -> list[int]:
    """Return the terms of ((a + b) + c) + ..., from the left: the order of summation is kept."""
    terms: list[int] = []
    while nodes[item].operation == ca.OP_ADD and not (terms and item in names):
        item, last = nodes[item].operands
        terms.append(last)
    return [item, *reversed(terms)]


def entries(values: Array) -> Iterator[str]:
    """Yield the entries of a vector, each with its number."""
    yield from (f"{i} {number(value)}\n" for i, value in enumerate(values.tolist()))


def bound(lower: float, upper: float) -> str:
    """Return a line of bounds."""
    if lower == upper:
        return f"4 {number(lower)}\n"
    if np.isinf(lower):
        return "3\n" if np.isinf(upper) else f"1 {number(upper)}\n"
    return f"2 {number(lower)}\n" if np.isinf(upper) else f"0 {number(lower)} {number(upper)}\n"


def number(value: float) -> str:
    """Return a number so that it reads back to the last bit."""
    return f"{value:.17g}"
