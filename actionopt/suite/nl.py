"""Write a test problem as an AMPL `.nl` file: ASCII, 17 significant digits, line by line.

Velocities are defined variables, linear in x; what the Lagrangian uses more than once is a defined
variable at each time, too, and f one n-ary sum, so that no reader has to recurse deeply. Of the
constraints, what is linear in x stands in the J segments; where all of them are, constants are
taken into their bounds. Multipliers of AMPL have the sign of df*/dc: minus those of f + lam'c.

Source: D. M. Gay, *Writing .nl Files*, Sandia report SAND2005-7907P (2005).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np

from actionopt.suite.listing import ConstraintRow, Evaluation, Listing, first_multipliers
from actionopt.suite.problem import TestProblem
from actionopt.suite.program import Program
from actionopt.tools.files import whole
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


def write(
    problem: Program, file: str | Path, x0: Array | None = None, *, names: bool = True
) -> list[Path]:
    """Write the problem with the starting point x0 (n,), by default its own; return the files.

    With `names`, `.col` and `.row` files beside it name the variables, and the constraints and the
    objective. Raises ValueError if its Lagrangian has an operation the format does not know.
    """
    if x0 is None:
        assert isinstance(problem, TestProblem)
        x0 = problem.start()
    rows, columns = [*problem.constraint_names, "action"], problem.variable_names
    longest = (max(map(len, rows)), max(map(len, columns))) if names else (0, 0)
    texts: dict[Path, Iterable[str]] = {Path(file): lines(problem, x0, longest)}
    if names:
        texts[Path(file).with_suffix(".row")] = (f"{name}\n" for name in rows)
        texts[Path(file).with_suffix(".col")] = (f"{name}\n" for name in columns)
    for place, text in texts.items():
        with whole(place) as part, open(part, "w", encoding="ascii", newline="\n") as out:
            out.writelines(text)
    return list(texts)


def lines(problem: Program, x0: Array, longest: tuple[int, int] = (0, 0)) -> Iterator[str]:
    """Yield the text of the file in pieces that end with a line.

    `longest` are the lengths of the longest names, of rows and of columns, if there are any.
    """
    listing = Listing(problem)
    first = problem.n + sum(len(tape.common) for _, _, tape in _row_tapes(listing))
    yield _header(problem, listing, first - problem.n, longest)
    for names, places, tape in _row_tapes(listing):
        for name, k in zip(names, tape.common, strict=True):
            yield f"V{name[1:]} 0 0\n" + _text(tape, k).format(**places)
    for here, at, places in _evaluations(listing, first):
        yield from _definitions(listing, here, at, places)
    yield from _rows(listing)
    yield from _objective(listing, first)
    lam = first_multipliers(problem, x0)
    if lam.size:
        yield f"d{lam.size}\n"
        yield from _entries(-lam)
    yield f"x{problem.n}\n"
    yield from _entries(x0)
    coefficients, constants = listing.linear
    if problem.m:
        shift = constants if listing.affine else 0.0
        lower, upper = problem.constraint_bounds
        yield "r\n"
        yield from map(_bound, lower - shift, upper - shift)
    yield "b\n"
    yield from map(_bound, *problem.bounds)
    yield from _derivatives(problem, coefficients)


def _header(problem: Program, listing: Listing, rows: int, longest: tuple[int, int]) -> str:
    n, m = problem.n, problem.m
    bent = 0 if listing.affine else m
    lower, upper = problem.constraint_bounds
    equations = int(np.sum(lower == upper))
    ranges = int(np.sum((lower < upper) & np.isfinite(lower) & np.isfinite(upper)))
    each = len(listing.moving) + len(listing.lagrangian.common)
    return f"""\
g3 1 1 0  # problem {problem.name}; the multipliers of AMPL are minus those of f + lam'c
 {n} {m} 1 {ranges} {equations}  # vars, constraints, objectives, ranges, eqns
 {bent} 1  # nonlinear constraints, objectives
 0 0  # network constraints: nonlinear, linear
 {n if bent else 0} {n} {n if bent else 0}  # nonlinear vars in constraints, objectives, both
 0 0 0 1  # linear network variables; functions; arith, flags
 0 0 0 0 0  # discrete variables: binary, integer, nonlinear (b,c,o)
 {problem.nnz_jacobian} {n}  # nonzeros in Jacobian, gradients
 {longest[0]} {longest[1]}  # max name lengths: constraints, variables
 0 {rows} {listing.layout.evaluations * each} 0 0  # common exprs: b,c,o,c1,o1
"""


# -- the objective ---------------------------------------------------------------------------


def _evaluations(listing: Listing, first: int) -> Iterator[tuple[Evaluation, int, dict[str, Any]]]:
    """Yield each evaluation, its first defined variable, and what L's operands are there."""
    moving, shared = listing.moving, len(listing.lagrangian.common)
    place = {a: i for i, a in enumerate(moving)}
    at = first
    for here in listing.evaluations():
        velocities = [f"v{at + place[a]}" if a in place else "" for a in range(here.columns.size)]
        own = [f"v{at + len(moving) + i}" for i in range(shared)]
        yield here, at, {**_places(listing, here), "v": velocities, "s": own}
        at += len(moving) + shared


def _places(listing: Listing, here: Evaluation | ConstraintRow) -> dict[str, Any]:
    """Return how the coordinates there, in the scene's units, and the time are written."""
    stretch, plain = listing.program.stretch, not listing.program.decades
    q = [
        f"n{_number(value)}"
        if j < 0
        else (f"v{j}" if plain else f"o2\nn{_number(1 / float(stretch[j]))}\nv{j}")
        for j, value in zip(here.columns.tolist(), here.given.tolist(), strict=True)
    ]
    return {"q": q, "t": f"n{_number(here.time)}"}


def _definitions(
    listing: Listing, here: Evaluation, at: int, places: dict[str, Any]
) -> Iterator[str]:
    """Yield the defined variables of one evaluation: the velocities, and what is shared."""
    moving, tape = listing.moving, listing.lagrangian
    for i, a in enumerate(moving):
        free = (here.around[:, a] >= 0) & (here.rate != 0)
        columns = here.around[free, a]
        rates = here.rate[free] / listing.program.stretch[columns]
        yield f"V{at + i} {columns.size} 0\n"
        terms = zip(columns.tolist(), rates.tolist(), strict=True)
        yield from (f"{j} {_number(rate)}\n" for j, rate in terms)
        yield f"n{_number(float(here.fixed[a]))}\n"
    for i, k in enumerate(tape.common):
        yield f"V{at + len(moving) + i} 0 0\n" + _text(tape, k).format(**places)


def _objective(listing: Listing, first: int) -> Iterator[str]:
    tape, count = listing.lagrangian, listing.layout.evaluations
    yield f"O0 0\no54\n{count}\n" if count > 2 else "O0 0\no0\n"
    template = _text(tape, tape.results[0][0], named=True)
    for here, _, places in _evaluations(listing, first):
        yield f"o2\nn{_number(here.weight)}\n" + template.format(**places)


# -- the constraints -------------------------------------------------------------------------


def _row_tapes(listing: Listing) -> Iterator[tuple[list[str], dict[str, Any], Tape]]:
    """Yield the defined variables of each row, what its operands are, and its tape."""
    if listing.affine:
        return
    at = listing.program.n
    for here in listing.rows():
        tape = listing.constraints[here.which]
        own = [f"v{at + i}" for i in range(len(tape.common))]
        yield own, {**_places(listing, here), "s": own}, tape
        at += len(own)


def _rows(listing: Listing) -> Iterator[str]:
    if listing.affine:
        yield from (f"C{r}\nn0\n" for r in range(listing.program.m))
        return
    templates = [_text(tape, tape.results[0][0], named=True) for tape in listing.constraints]
    constants = listing.linear[1]
    rows = zip(listing.rows(), _row_tapes(listing), constants.tolist(), strict=True)
    for r, (here, (_, places, _), constant) in enumerate(rows):
        added = f"o0\nn{_number(constant)}\n" if constant else ""
        text = templates[here.which].format(**places)
        yield f"C{r}\n{added}o2\nn{_number(here.weight)}\n{text}"


def _derivatives(problem: Program, coefficients: Array) -> Iterator[str]:
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
        yield from (f"{j} {_number(value)}\n" for j, value in values)
    yield f"G0 {problem.n}\n"
    yield from (f"{j} 0\n" for j in range(problem.n))


# -- lines -----------------------------------------------------------------------------------


def _text(tape: Tape, root: int, named: bool = False) -> str:
    """Return an expression in Polish prefix form, to be formatted with what its operands are.

    What is shared is only named; `named`: even the expression itself.
    """
    names = {k: f"{{s[{i}]}}" for i, k in enumerate(tape.common)}
    stack: list[int | str] = [root]
    lines: list[str] = []
    while stack:
        item = stack.pop()
        if isinstance(item, str):
            lines.append(item)
            continue
        node = tape.nodes[item]
        if item in names and (named or lines):
            lines.append(names[item])
        elif node.kind == "input":
            lines.append(f"{{{tape.place(node)}}}")
        elif node.kind == "constant":
            lines.append(f"n{_number(node.value)}")
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


def _sum(nodes: Sequence[Node], item: int, names: Mapping[int, str]) -> list[int]:
    """Return the terms of ((a + b) + c) + ..., from the left: the order of summation is kept."""
    terms: list[int] = []
    while nodes[item].operation == ca.OP_ADD and not (terms and item in names):
        item, last = nodes[item].operands
        terms.append(last)
    return [item, *reversed(terms)]


def _entries(values: Array) -> Iterator[str]:
    yield from (f"{i} {_number(value)}\n" for i, value in enumerate(values.tolist()))


def _bound(lower: float, upper: float) -> str:
    if lower == upper:
        return f"4 {_number(lower)}\n"
    if np.isinf(lower):
        return "3\n" if np.isinf(upper) else f"1 {_number(upper)}\n"
    return f"2 {_number(lower)}\n" if np.isinf(upper) else f"0 {_number(lower)} {_number(upper)}\n"


def _number(value: float) -> str:
    return f"{value:.17g}"
