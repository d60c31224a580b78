"""Second derivatives of a Lagrangian that is a sum of many like terms, as of pairs of bodies.

CasADi derives a dense Hessian column by column, each of them from all of L: n bodies take n^3
operations, and the memory of as many. Here terms of one form are derived once, and what comes of it
is written for each of them (partial separability: A. Griewank, Ph. L. Toint, in *Nonlinear
Optimization 1981*, 1982).
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable
from typing import Any

import casadi as ca
import numpy as np

from actionopt.tools.tape import Node, Tape

# Operations of a term, and entries of the arguments in it, most: ad hoc; two bodies have 15 and 6.
TERM_OPERATIONS, TERM_ENTRIES = 100, 12
LEAST_ALIKE = 8  # terms that are derived as one; ad hoc
# Nonzeros a row, and rows, least, for which it is done. Measured on bodies that attract each other:
# 20 of them are derived as fast by CasADi, 50 in twice and 100 in eight times the time.
DENSE_ROW, LEAST_ROWS = 40, 150

Entry = tuple[int, int]  # which argument, and which entry of it
Term = tuple[ca.SX, list[Entry]]  # what it is multiplied by, and the entries in order


def hessian(
    L: ca.SX, x: ca.SX, arguments: list[ca.SX], tape: Callable[[], Tape]
) -> tuple[ca.SX, ca.SX]:
    """Return second derivatives by x, at least their upper triangle, and the gradient.

    Parameters
    ----------
    L, x : casadi.SX
        Scalar; q and v in one column.
    arguments : list of casadi.SX
        q, v, t and the parameters.
    tape : callable
        Returns the operations of L.
    """
    if x.numel() < LEAST_ROWS:
        return ca.hessian(L, x)
    slope = ca.gradient(L, x)
    if ca.jacobian_sparsity(slope, x).nnz() < DENSE_ROW * x.numel():
        return ca.hessian(L, x)
    alike, rest = _terms(tape(), arguments)
    if not alike:
        return ca.hessian(L, x)
    nonzeros, rows, cols = [], [], []
    for form, terms in alike.items():
        second, row, col = _derive(form, terms, arguments)
        nonzeros.append(second)
        rows.append(row)
        cols.append(col)
    row, col = np.concatenate(rows), np.concatenate(cols)
    size = x.numel()
    cell, which = np.unique(np.maximum(row, col) * size + np.minimum(row, col), return_inverse=True)
    sums = ca.DM(ca.Sparsity.triplet(cell.size, row.size, which.tolist(), list(range(row.size))), 1)
    pattern = ca.Sparsity.triplet(size, size, (cell % size).tolist(), (cell // size).tolist())
    like = ca.SX(pattern, ca.mtimes(sums, ca.vertcat(*nonzeros)))
    return like + ca.triu(ca.hessian(rest, x)[0]), slope


def _terms(tape: Tape, arguments: list[ca.SX]) -> tuple[dict[tuple, list[Term]], ca.SX]:
    """Return the terms of which there are many by their form, and the sum of all others."""

    def write(node: Node, operands: list[Any]) -> Any:
        if node.kind == "input":
            return arguments[node.entry[0]][node.entry[1]]
        return node.of(operands) if operands else ca.SX(node.value)

    made = tape.fold(write)
    moves = tape.fold(lambda node, operands: any(operands) or 0 <= node.entry[0] < 2)
    found: dict[tuple, list[Term]] = defaultdict(list)
    roots: dict[tuple, list[int]] = defaultdict(list)
    rest = ca.SX(0)
    last = tape.results[0][0]
    factors = {last: ca.SX(1)}  # of nodes that are summed up; operands stand before what they make
    for root in range(last, -1, -1):
        if root not in factors or not moves[root]:
            continue
        factor, node = factors[root], tape.nodes[root]
        parts = _parts(node.operation, node.operands, factor, moves, made)
        form = None if parts else _form(tape.nodes, root)
        if form is not None:
            found[form[0]].append((factor, form[1]))
            roots[form[0]].append(root)
        elif not parts:
            rest += factor * made[root]
        for part, times in parts:
            factors[part] = factors[part] + times if part in factors else times
    for form in [form for form, terms in found.items() if len(terms) < LEAST_ALIKE]:
        given = [factor for factor, _ in found.pop(form)]
        rest += ca.dot(ca.vertcat(*given), ca.vertcat(*[made[k] for k in roots[form]]))
    return dict(found), rest


def _parts(
    code: int, of: tuple[int, ...], factor: ca.SX, moves: list[bool], made: list[Any]
) -> list[tuple[int, ca.SX]]:
    """Return the operands of which an operation is a sum, with the factors of each; none of others.

    `moves` tells which nodes depend on the path, `made` has the expressions of all.
    """
    if code in (ca.OP_ADD, ca.OP_SUB):
        return [(of[0], factor), (of[1], -factor if code == ca.OP_SUB else factor)]
    if code in (ca.OP_NEG, ca.OP_TWICE):
        return [(of[0], -factor if code == ca.OP_NEG else 2 * factor)]
    if code == ca.OP_MUL and not all(moves[i] for i in of):
        moving, other = of if moves[of[0]] else of[::-1]
        return [(moving, factor * made[other])]
    if code == ca.OP_DIV and not moves[of[1]]:
        return [(of[0], factor / made[of[1]])]
    return []


def _form(nodes: list[Node], root: int) -> tuple[tuple, list[Entry]] | None:
    """Return the operations below a root, entries by number, and the entries; None of a large one.

    An operation is CasADi's number of it, and the places of its operands before it.
    """
    places: dict[int, int] = {}
    entries: dict[Entry, int] = {}
    form: list[tuple] = []
    todo = [root]
    while todo:
        k = todo[-1]
        node = nodes[k]
        below = [i for i in node.operands if i not in places]
        if below:
            todo += below
            continue
        todo.pop()
        if k in places:
            continue
        places[k] = len(form)
        if node.kind == "input":
            form.append((ca.OP_INPUT, entries.setdefault(node.entry, len(entries)), node.entry[0]))
        elif node.kind == "constant":
            form.append((ca.OP_CONST, node.value))
        else:
            form.append((node.operation, *[places[i] for i in node.operands]))
        if node.function is not None or len(form) > TERM_OPERATIONS or len(entries) > TERM_ENTRIES:
            return None
    return tuple(form), list(entries)


def _derive(
    form: tuple, terms: list[Term], arguments: list[ca.SX]
) -> tuple[ca.SX, np.ndarray, np.ndarray]:
    """Return the second derivatives of all terms of a form, in a column, and where they belong."""
    n = arguments[0].numel()
    factors, entries = zip(*terms, strict=True)
    first = entries[0]
    of, factor = ca.SX.sym("of", len(first)), ca.SX.sym("factor")
    made: list[Any] = []
    for code, *operands in form:
        if code == ca.OP_INPUT:
            made.append(of[operands[0]])
        elif code == ca.OP_CONST:
            made.append(ca.SX(operands[0]))
        else:
            made.append(Node(code, (0,)).of([made[i] for i in operands]))
    moving = [k for k, (argument, _) in enumerate(first) if argument < 2]
    second = ca.triu(ca.hessian(factor * made[-1], of[moving])[0])
    function = ca.Function("second", [of, factor], [second.nz[:]])
    given = ca.horzcat(*[ca.vertcat(*[arguments[i][j] for i, j in one]) for one in entries])
    at = np.array([[i * n + j for i, j in one if i < 2] for one in entries])
    row, col = (np.array(x, dtype=int) for x in second.sparsity().get_triplet())
    nonzeros = function.map(len(terms))(given, ca.horzcat(*factors))
    return ca.vec(nonzeros), at[:, row].ravel(), at[:, col].ravel()
