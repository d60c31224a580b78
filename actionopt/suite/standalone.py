"""Write a test problem as one Python file that needs nothing but numpy, with its answer in it.

The Lagrangian and the constraints are written down as they are evaluated, for all times at once,
with their first and second derivatives; the sums over the mesh are a few lines of numpy.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np

from actionopt.suite.problem import TestProblem
from actionopt.tools.files import write as write_file
from actionopt.tools.tape import Tape
from actionopt.tools.types import Array

INFIX = {"ADD": "+", "SUB": "-", "MUL": "*", "DIV": "/", "POW": "**", "CONSTPOW": "**"}
FUNCTION_NAMES = {
    f"A{name}": f"arc{name.lower()}" for name in ("SIN", "COS", "TAN", "SINH", "COSH", "TANH")
}
FUNCTION_NAMES |= {
    name: name.lower() for name in "SIN COS TAN SINH COSH TANH SQRT LOG EXP FABS SIGN".split()
}
OPERATORS = {getattr(ca, f"OP_{name}"): f"{{0}} {sign} {{1}}" for name, sign in INFIX.items()}
OPERATORS |= {
    getattr(ca, f"OP_{name}"): f"np.{call}({{0}})" for name, call in FUNCTION_NAMES.items()
}
OPERATORS |= {
    ca.OP_NEG: "-{0}",
    ca.OP_SQ: "{0} * {0}",
    ca.OP_TWICE: "2 * {0}",
    ca.OP_INV: "1 / {0}",
    ca.OP_ATAN2: "np.arctan2({0}, {1})",
}
NUMBERS_PER_LINE = 5  # numbers in a line

MODULE_TEMPLATE = '''\
"""{title}

    minimise f(x) subject to C_LOWER <= c(x) <= C_UPPER and X_LOWER <= x <= X_UPPER

`objective(x)`, `gradient(x)` (N,), `constraints(x)` (M,), `jacobian(x)` (M, N), and
`hessian(x, lam)` (N, N) of f + lam'c; X0 is where to start. At the optimum, X_STAR and LAM_STAR,
grad f + J' lam = 0{inequalities}. It is a {kind}{unbounded}.

{about}
Written by actionopt {version}; numpy is all that it needs.
"""

import numpy as np

NAME, CLASS, N, M = {name!r}, {classification!r}, {n}, {m}
INDEX = {index!r}  # directions that lower f along c = 0
F_STAR = {f_star!r}
X_STAR = np.array({x_star})
LAM_STAR = np.array({lam_star}, dtype=float)
X0 = np.array({x0})
X_LOWER, X_UPPER = {x_lower}, {x_upper}
C_LOWER, C_UPPER = {c_lower}, {c_upper}

# The mesh: nodes of the elements, which unknown each coordinate there is (-1: it is given), the
# quadrature on [-1, 1] and the derivatives of polynomials there.
ELEMENTS, DEGREE, COORDINATES, FUNCTIONS = {elements}, {degree}, {coordinates}, {functions}
TIMES = np.array({times})
COLUMNS = np.full((TIMES.size, COORDINATES), -1)
COLUMNS.ravel()[{free}] = np.arange(N)
GIVEN = np.zeros((TIMES.size, COORDINATES))
GIVEN[0], GIVEN[-1] = {given}
UNITS = np.logspace(-{decades!r} / 2, {decades!r} / 2, N)  # of x in one of the scene's
WEIGHTS = np.array({weights})
D = np.array({derivative}).reshape(DEGREE + 1, DEGREE + 1)
NODES = DEGREE * np.arange(ELEMENTS)[:, None] + np.arange(DEGREE + 1)
HALF = np.diff(TIMES[::DEGREE]) / 2
SUMMED = np.bincount(NODES.ravel(), (HALF[:, None] * WEIGHTS).ravel())
ROW_NODE, ROW_FUNCTION = {row_node}, {row_function}


def _lagrangian(q, v, t):
    """Return L, its gradient by (q, v) and its Hessian, row by row."""
{lagrangian}


def _constraint(q, t):
    """Return the functions f, their gradients by q and their Hessians, row by row."""
{constraint}


def _coordinates(x):
    Q = GIVEN.copy()
    Q[COLUMNS >= 0] = np.asarray(x) / UNITS
    return Q


def _terms(x):
    Q = _coordinates(x)[NODES]
    V = np.einsum("kj,eja->eka", D, Q) / HALF[:, None, None]
    w = HALF[:, None] * WEIGHTS
    q, v = np.moveaxis(Q, 2, 0), np.moveaxis(V, 2, 0)
    L = np.array([w * part for part in _lagrangian(q, v, TIMES[NODES])])
    return L[0], L[1 : 1 + 2 * COORDINATES], L[1 + 2 * COORDINATES :]


def _rows(x):
    t = TIMES[ROW_NODE]
    parts = np.array([p + 0 * t for p in _constraint(_coordinates(x)[ROW_NODE].T, t)])
    n, m, r = COORDINATES, FUNCTIONS, np.arange(M)
    f, J, H = np.split(parts * SUMMED[ROW_NODE], [m, m + m * n])
    J, H = J.reshape(m, n, M), H.reshape(m, n, n, M)
    return f[ROW_FUNCTION, r], J[ROW_FUNCTION, :, r], H[ROW_FUNCTION, :, :, r]


def _scattered(shape, columns, values):
    """Add values where all their columns are unknowns, in the units of x."""
    total = np.zeros(shape)
    keep = np.all([c >= 0 for c in columns], axis=0)
    np.add.at(total, tuple(c[keep] for c in columns), values[keep])
    for axis in range(total.ndim):
        total /= np.expand_dims(UNITS, tuple(k for k in range(total.ndim) if k != axis))
    return total


def objective(x):
    """Return f(x)."""
    return float(np.sum(_terms(x)[0]))


def gradient(x):
    """Return grad f(x), (N,)."""
    by_q, by_v = np.split(_terms(x)[1], 2)
    by_node = by_q + np.einsum("kj,aek->aej", D, by_v / HALF[:, None])
    columns = np.moveaxis(COLUMNS[NODES], 2, 0)
    return _scattered((N,), (columns,), by_node)


def constraints(x):
    """Return c(x), (M,)."""
    return _rows(x)[0] if M else np.zeros(0)


def jacobian(x):
    """Return dc/dx, (M, N)."""
    total = np.zeros((M, N))
    if M:
        columns = COLUMNS[ROW_NODE]
        rows = np.broadcast_to(np.arange(M)[:, None], columns.shape)
        free = columns >= 0
        total[rows[free], columns[free]] = (_rows(x)[1])[free]
    return total / UNITS


def hessian(x, lam=None, factor=1.0):
    """Return the second derivative of factor * f + lam'c, (N, N)."""
    n = COORDINATES
    second = factor * _terms(x)[2].reshape(2 * n, 2 * n, ELEMENTS, DEGREE + 1)
    qq, qv = second[:n, :n], second[:n, n:] / HALF[:, None]
    vv = second[n:, n:] / HALF[:, None] ** 2
    by_node = np.einsum("kj,kl,abek->ejalb", D, D, vv)
    mixed = np.einsum("kl,abek->ekalb", D, qv)
    by_node += mixed + np.transpose(mixed, (0, 3, 4, 1, 2))
    k = np.arange(DEGREE + 1)
    by_node[:, k, :, k, :] += np.transpose(qq, (3, 2, 0, 1))
    columns = COLUMNS[NODES]
    first = np.broadcast_to(columns[:, :, :, None, None], by_node.shape)
    last = np.broadcast_to(columns[:, None, None, :, :], by_node.shape)
    total = _scattered((N, N), (first, last), by_node)
    if M and lam is not None:
        there = COLUMNS[ROW_NODE]
        bent = _rows(x)[2] * np.asarray(lam)[:, None, None]
        first = np.broadcast_to(there[:, :, None], bent.shape)
        total += _scattered((N, N), (first, np.broadcast_to(there[:, None, :], bent.shape)), bent)
    return total


if __name__ == "__main__":
    residual = gradient(X_STAR) + jacobian(X_STAR).T @ LAM_STAR
    print(NAME, CLASS, "f* =", objective(X_STAR), "of", F_STAR)
    print("largest residual", np.max(np.abs(residual)), "of", np.max(np.abs(gradient(X0))))
'''


def write(problem: TestProblem, file: str | Path) -> Path:
    """Write the problem and its answer to a Python file; return it.

    Raises ValueError if its Lagrangian has an operation numpy does not know.
    """
    write_file(Path(file), text(problem))
    return Path(file)


def text(problem: TestProblem) -> str:
    """Return the text of the file."""
    from actionopt import __version__

    tr, layout, mesh = problem.transcription, problem.transcription.layout, problem.mesh
    rule = layout.groups[0].rule
    system = tr.problem.system
    bounds = [_array(side) for side in (*problem.bounds, *problem.constraint_bounds)]
    settings = {**problem.family.parameters, **problem.parameters, "decades": problem.decades}
    about = [
        f"Parameters {json.dumps(settings)}, {mesh.elements} elements of degree {rule.degree};",
        f"x0 {problem.default_start!r}. Tags: {', '.join(problem.tags) or 'none'}.",
        f"Source: {' '.join(problem.scene.source.split())}",
    ]
    return MODULE_TEMPLATE.format(
        title=f"{problem.name}, {problem.classification}: {problem.scene.title}",
        inequalities=" + z, lam and z >= 0 at upper bounds" if problem.inequalities else "",
        kind=problem.kind,
        unbounded="; f is unbounded below" if problem.unbounded else "",
        about="\n".join(about).replace("\\", "/"),
        version=__version__,
        name=problem.name,
        classification=problem.classification,
        n=problem.n,
        m=problem.m,
        index=problem.index_star,
        f_star=float(problem.f_star),
        x_star=_list(problem.x_star),
        lam_star=_list(problem.lam_star),
        x0=_list(problem.start()),
        x_lower=bounds[0],
        x_upper=bounds[1],
        c_lower=bounds[2],
        c_upper=bounds[3],
        elements=mesh.elements,
        degree=rule.degree,
        coordinates=system.n,
        functions=system.m,
        times=_list(mesh.nodes),
        free=_span(layout.free),
        given=f"{tr.ends[0].tolist()}, {tr.ends[-1].tolist()}",
        decades=problem.decades,
        weights=_list(rule.weights),
        derivative=_list(rule.derivative.ravel()),
        row_node=_span(layout.row_node) if problem.m else "np.zeros(0, int)",
        row_function=_span(layout.row_constraint) if problem.m else "np.zeros(0, int)",
        lagrangian=_body(_derivatives(problem, True)),
        constraint=_body(_derivatives(problem, False)) if problem.m else "    return []",
    )


def _derivatives(problem: TestProblem, lagrangian: bool) -> Tape:
    """Return functions, their gradients and their Hessians, as one tape."""
    asked = problem.transcription.problem
    s, numbers = asked.system.symbols, ca.DM(asked.packed.ravel())
    n = asked.system.n
    q, v, t = ca.SX.sym("q", n), ca.SX.sym("v", n), ca.SX.sym("t")
    given = [q, v, t] if lagrangian else [q, t]
    law = asked.system.L if lagrangian else ca.vec(asked.system.f)
    symbols = [s.q, s.v, s.t, s.p] if lagrangian else [s.q, s.t, s.p]
    values = ca.vec(ca.Function("law", symbols, [law]).expand()(*given, numbers))
    by = ca.vertcat(q, v) if lagrangian else q
    slopes = ca.jacobian(values, by)
    second = [ca.vec(ca.hessian(values[i], by)[0]) for i in range(values.numel())]
    out = ca.vertcat(values, ca.vec(slopes.T), *second)
    names = ["q", "v", "t"] if lagrangian else ["q", "t"]
    return Tape(given, [out], names)


def _body(found: Tape) -> str:
    """Return the lines of a function that returns the results, as a list."""
    words: dict[int, str] = {}
    lines: list[str] = []
    for k, node in enumerate(found.nodes):
        if node.kind == "constant":
            words[k] = repr(node.value) if node.value >= 0 else f"({node.value!r})"
        elif node.kind == "input":
            words[k] = found.place(node)
        elif node.operation not in OPERATORS:
            raise ValueError(f"expected an operation of numpy's, found CasADi's {node.operation}")
        else:
            code = OPERATORS[node.operation].format(*(words[i] for i in node.operands))
            words[k] = f"a{k}"
            lines.append(f"    a{k} = {code}")
    return "\n".join([*lines, f"    return {_wrap([words[k] for k in found.results[0]])}"])


def _wrap(words: Sequence[str], indent: str = "        ") -> str:
    """Return a list of words, a few of them a line."""
    if len(words) <= NUMBERS_PER_LINE:
        return f"[{', '.join(words)}]"
    lines = [
        ", ".join(words[k : k + NUMBERS_PER_LINE]) for k in range(0, len(words), NUMBERS_PER_LINE)
    ]
    return "[\n" + "".join(f"{indent}{line},\n" for line in lines) + indent[4:] + "]"


def _list(values: Array) -> str:
    return _wrap([repr(value) for value in values.tolist()], "    ")


def _span(values: Any) -> str:
    """Return an array of whole numbers, in short where they follow each other."""
    if (values == np.arange(values[0], values[0] + values.size)).all():
        return f"np.arange({values[0]}, {values[0] + values.size})"
    return f"np.array({_list(values)})"


def _array(values: Array) -> str:
    """Return an array, in short where all of it is one number."""
    if np.all(values == values[:1]):
        value = values[0] if values.size else 0.0
        return f"np.full({values.size}, {float(value)!r})".replace("inf", "np.inf")
    return f"np.array({_list(values)})".replace("inf", "np.inf")
