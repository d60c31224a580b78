"""Write a test problem as an AMPL `.nl` file: ASCII, 17 significant digits, line by line.

Velocities are defined variables, linear in x; what the Lagrangian uses more than once is a defined
variable at each time, too, and f one n-ary sum, so that no reader has to recurse deeply. Of the
constraints, what is linear in x stands in the J segments; where all of them are, constants are
taken into their bounds. Multipliers of AMPL have the sign of df*/dc: minus those of f + lam'c.

Source: D. M. Gay, *Writing .nl Files*, Sandia report SAND2005-7907P (2005).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from actionopt.suite.action import ActionProgram
from actionopt.suite.listing import ConstraintRow, Evaluation, Listing, first_multipliers
from actionopt.suite.member import Member
from actionopt.suite.models import nl_expressions
from actionopt.suite.nl_lines import bound, derivatives, entries, number, prefix
from actionopt.suite.program import Program
from actionopt.tools.files import whole
from actionopt.tools.tape import Tape
from actionopt.tools.types import Array


def write(
    problem: Program, file: str | Path, x0: Array | None = None, *, names: bool = True
) -> list[Path]:
    """Write the problem with the starting point x0 (n,), by default its own; return the files.

    With `names`, `.col` and `.row` files beside it name the variables, and the constraints and the
    objective. Raises ValueError if its Lagrangian has an operation the format does not know.
    """
    if x0 is None:
        assert isinstance(problem, Member)
        x0 = problem.start()
    objective = "action" if isinstance(problem, ActionProgram) else "f"
    rows, columns = [*problem.constraint_names, objective], problem.variable_names
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
    if isinstance(problem, ActionProgram):
        return _of_action(problem, x0, longest)
    return nl_expressions.lines(problem, x0, longest)


def _of_action(problem: ActionProgram, x0: Array, longest: tuple[int, int]) -> Iterator[str]:
    listing = Listing(problem)
    first = problem.n + sum(len(tape.common) for _, _, tape in _row_tapes(listing))
    yield _header(problem, listing, first - problem.n, longest)
    for names, places, tape in _row_tapes(listing):
        for name, k in zip(names, tape.common, strict=True):
            yield f"V{name[1:]} 0 0\n" + prefix(tape, k).format(**places)
    for here, at, places in _evaluations(listing, first):
        yield from _definitions(listing, here, at, places)
    yield from _rows(listing)
    yield from _objective(listing, first)
    lam = first_multipliers(problem, x0)
    if lam.size:
        yield f"d{lam.size}\n"
        yield from entries(-lam)
    yield f"x{problem.n}\n"
    yield from entries(x0)
    coefficients, constants = listing.linear
    if problem.m:
        shift = constants if listing.affine else 0.0
        lower, upper = problem.constraint_bounds
        yield "r\n"
        yield from map(bound, lower - shift, upper - shift)
    yield "b\n"
    yield from map(bound, *problem.bounds)
    yield from derivatives(problem, coefficients)


def _header(problem: ActionProgram, listing: Listing, rows: int, longest: tuple[int, int]) -> str:
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
        f"n{number(value)}"
        if j < 0
        else (f"v{j}" if plain else f"o2\nn{number(1 / float(stretch[j]))}\nv{j}")
        for j, value in zip(here.columns.tolist(), here.given.tolist(), strict=True)
    ]
    return {"q": q, "t": f"n{number(here.time)}"}


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
        yield from (f"{j} {number(rate)}\n" for j, rate in terms)
        yield f"n{number(float(here.fixed[a]))}\n"
    for i, k in enumerate(tape.common):
        yield f"V{at + len(moving) + i} 0 0\n" + prefix(tape, k).format(**places)


def _objective(listing: Listing, first: int) -> Iterator[str]:
    tape, count = listing.lagrangian, listing.layout.evaluations
    yield f"O0 0\no54\n{count}\n" if count > 2 else "O0 0\no0\n"
    template = prefix(tape, tape.results[0][0], named=True)
    for here, _, places in _evaluations(listing, first):
        yield f"o2\nn{number(here.weight)}\n" + template.format(**places)


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
    templates = [prefix(tape, tape.results[0][0], named=True) for tape in listing.constraints]
    constants = listing.linear[1]
    rows = zip(listing.rows(), _row_tapes(listing), constants.tolist(), strict=True)
    for r, (here, (_, places, _), constant) in enumerate(rows):
        added = f"o0\nn{number(constant)}\n" if constant else ""
        text = templates[here.which].format(**places)
        yield f"C{r}\n{added}o2\nn{number(here.weight)}\n{text}"
