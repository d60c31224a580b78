"""The `.nl` file of a program that is written down: what is used twice is a defined variable."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from actionopt.suite.models.expressions import WrittenProgram
from actionopt.suite.nl_lines import bound, derivatives, entries, prefix
from actionopt.suite.program import Program
from actionopt.tools.tape import Tape
from actionopt.tools.types import Array


def lines(problem: Program, x0: Array, longest: tuple[int, int] = (0, 0)) -> Iterator[str]:
    """Yield the text of the file in pieces that end with a line.

    Where all rows are linear and none is a complement of an unknown, they stand in the J segments,
    and their constants in the bounds.
    """
    assert isinstance(problem, WrittenProgram)
    n, m = problem.n, problem.m
    paired = {r: i for i, r in problem.complements}
    affine = bool(problem.linear_rows.all()) and not paired
    written = [problem.f] if affine else [problem.f, problem.c]
    tape = Tape([problem.x], written, ["x"])
    variables = [f"v{j}" for j in range(n)]
    places = {"x": variables, "s": [f"v{n + i}" for i in range(len(tape.common))]}
    lower, upper = problem.constraint_bounds
    equations, both = lower == upper, np.isfinite(lower) & np.isfinite(upper)
    curved = 0 if affine else m
    yield f"""\
g3 1 1 0  # problem {problem.name}; the multipliers of AMPL are minus those of f + lam'c
 {n} {m} 1 {int(np.sum(both & ~equations))} {int(np.sum(equations))}  # vars, rows, f, ranges, eqns
 {curved} 1 0 {len(paired)} 0 0  # nonlinear constraints, objectives; complements
 0 0  # network constraints: nonlinear, linear
 {n if curved else 0} {n} {n if curved else 0}  # nonlinear vars in constraints, objectives, both
 0 0 0 1  # linear network variables; functions; arith, flags
 0 0 0 0 0  # discrete variables: binary, integer, nonlinear (b,c,o)
 {problem.nnz_jacobian} {n}  # nonzeros in Jacobian, gradients
 {longest[0]} {longest[1]}  # max name lengths: constraints, variables
 {len(tape.common)} 0 0 0 0  # common exprs: b,c,o,c1,o1
"""
    for i, k in enumerate(tape.common):
        yield f"V{n + i} 0 0\n" + prefix(tape, k).format(**places)
    for r in range(m):
        text = "n0\n" if affine else prefix(tape, tape.results[1][r], named=True)
        yield f"C{r}\n" + text.format(**places)
    yield "O0 0\n" + prefix(tape, tape.results[0][0], named=True).format(**places)
    yield f"x{n}\n"
    yield from entries(x0)
    zero = np.zeros(n)
    if m:
        shift = problem.constraints(zero) if affine else 0.0
        yield "r\n"
        for r, line in enumerate(map(bound, lower - shift, upper - shift)):
            yield f"5 1 {paired[r] + 1}\n" if r in paired else line
    yield "b\n"
    yield from map(bound, *problem.bounds)
    slopes = problem.jacobian(zero) if affine else np.zeros(problem.nnz_jacobian)
    yield from derivatives(problem, slopes)
