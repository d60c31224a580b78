"""The operations of expressions, one after the other, as CasADi evaluates them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Collection, Iterator, Sequence
from typing import Any, NamedTuple, TypeVar

import casadi as ca

from actionopt.tools.cached import cached_property

T = TypeVar("T")
# The second result of a function that is a table: which of the pieces its value is from.
PIECE = "actionopt_piece"
# The operation of a call of a function that is linear between points: CasADi's are positive.
LINEAR_TABLE = -1


# An operation, the registers it goes to and those it comes from, and the value of a constant. What
# reads an input comes from (input, nonzero), what writes an output goes to (output, nonzero).
Instruction = tuple[int, list[int], list[int], float]


def instructions(function: ca.Function) -> Iterator[Instruction]:
    """Yield the instructions of a function of SX expressions, in their order."""
    for k in range(function.n_instructions()):
        code, into = function.instruction_id(k), function.instruction_output(k)
        if code == ca.OP_CONST:
            yield code, into, [], function.instruction_constant(k)
        else:
            yield code, into, function.instruction_input(k), 0.0


class Node(NamedTuple):
    """An operation and its operands, earlier nodes; or an entry of an input; or a number."""

    operation: int
    operands: tuple[int, ...] = ()
    entry: tuple[int, int] = (-1, -1)  # which input, and which entry of it
    value: float = 0.0
    function: Any = None  # of CasADi's, that is called
    nonzero: int = 0  # which of all its results

    @property
    def kind(self) -> str:
        """What it is: "operation", "input" or "constant"."""
        if self.operands:
            return "operation"
        return "input" if self.operation == ca.OP_INPUT else "constant"

    def of(self, x: Sequence[ca.SX]) -> Any:
        """Return the operation of expressions in place of its operands."""
        if self.function is None:
            return apply(self.operation, x)
        return ca.vertcat(*[ca.vec(y).nz[:] for y in self.call(x)])[self.nonzero]

    def call(self, x: Sequence[ca.SX]) -> list[ca.SX]:
        """Return all results of the function that is called, with expressions for the operands."""
        arguments, first = [], 0
        for i in range(self.function.n_in()):
            pattern = self.function.sparsity_in(i)
            arguments.append(ca.SX(pattern, ca.vertcat(*x[first : first + pattern.nnz()])))
            first += pattern.nnz()
        return self.function.call(arguments, False, True)


class Tape:
    """Operations in their order, a node for each value, and which of them are the results.

    Nodes are read when they are asked for: of most laws the kinds of operations say enough.

    Parameters
    ----------
    arguments : sequence of casadi.SX
        Dense columns of symbols.
    results : sequence of casadi.SX
        WrittenProgram in these.
    names : sequence of str, optional
        Of the arguments.
    """

    def __init__(
        self, arguments: Sequence[ca.SX], results: Sequence[ca.SX], names: Sequence[str] = ()
    ) -> None:
        self.names, self._given = tuple(names), results
        self._codes: list[int] = []
        if any([result.numel() for result in results]):
            # No register is used twice: the k-th value is in register k.
            f = ca.Function("tape", arguments, results, {"live_variables": False})
            self._function = f
            self._codes = [f.instruction_id(k) for k in range(f.n_instructions())]

    @cached_property
    def operations(self) -> frozenset[int]:
        """CasADi's numbers of all operations."""
        if ca.OP_CALL in self._codes:  # tables have a number of their own
            return frozenset([node.operation for node in self.nodes])
        return frozenset([ca.OP_CONST, *self._codes]) - {ca.OP_OUTPUT}

    @property
    def constants(self) -> list[float]:
        """The numbers that stand in the expressions."""
        at = [k for k, code in enumerate(self._codes) if code == ca.OP_CONST]
        return [self._function.instruction_constant(k) for k in at]

    def last_operands(self, operations: Collection[int]) -> list[tuple[int, int]]:
        """Return what the last operand of each of these operations is: its number, and its input.

        The input is -1 of what is no entry of one.
        """
        f, codes = self._function, self._codes
        if ca.OP_CALL in codes:  # of several results: registers are not numbered as operations are
            last = [self.nodes[x.operands[-1]] for x in self.nodes if x.operation in operations]
            return [(x.operation, x.entry[0]) for x in last]
        made = [k for k, code in enumerate(codes) if code != ca.OP_OUTPUT]  # by register
        at = [made[f.instruction_input(k)[-1]] for k, x in enumerate(codes) if x in operations]
        inputs = [f.instruction_input(k)[0] if codes[k] == ca.OP_INPUT else -1 for k in at]
        return list(zip([codes[k] for k in at], inputs, strict=True))

    @property
    def nodes(self) -> list[Node]:
        """An operation, an entry of an input or a number each; the first is zero."""
        return self._read[0]

    @cached_property
    def _read(self) -> tuple[list[Node], list[tuple[list[int], int]]]:
        """The nodes; and of each result that is not zero the output and nonzero, and its node."""
        nodes, found = [Node(ca.OP_CONST)], []
        for k, code in enumerate(self._codes):
            f = self._function
            if code == ca.OP_CONST:
                nodes.append(Node(code, (), (-1, -1), f.instruction_constant(k)))
                continue
            of = f.instruction_input(k)
            if code == ca.OP_CALL:  # has a value for each of its results that is used
                operands, called = tuple([i + 1 for i in of]), f.instructions_sx()[k]
                into = [i for i, to in enumerate(f.instruction_output(k)) if to >= 0]
                function = called.which_function()
                if PIECE in function.name_out() or function.class_name() == "LinearInterpolant":
                    code = LINEAR_TABLE
                nodes += [Node(code, operands, (-1, -1), 0.0, function, i) for i in into]
                continue
            if code == ca.OP_OUTPUT:
                found.append((f.instruction_output(k), of[0] + 1))
            elif code == ca.OP_INPUT:
                nodes.append(Node(code, (), (of[0], of[1])))
            else:
                nodes.append(Node(code, tuple([i + 1 for i in of])))
        return nodes, found

    @cached_property
    def results(self) -> list[list[int]]:
        """The node of each entry, result by result."""
        results = [[0] * result.numel() for result in self._given]
        places = [result.sparsity().find() for result in self._given]
        for (output, nonzero), node in self._read[1]:
            results[output][places[output][nonzero]] = node
        return results

    @cached_property
    def common(self) -> list[int]:
        """Operations that are used more than once."""
        uses = Counter(operand for node in self.nodes for operand in node.operands)
        uses.update(k for result in self.results for k in result)
        return [k for k, node in enumerate(self.nodes) if node.operands and uses[k] > 1]

    @cached_property
    def common_places(self) -> dict[int, int]:
        """Their places among each other."""
        return {k: i for i, k in enumerate(self.common)}

    def fold(self, make: Callable[[Node, list[T]], T]) -> list[T]:
        """Return what `make` makes of each node and of what it made of the node's operands."""
        made: list[T] = []
        for node in self.nodes:
            made.append(make(node, [made[i] for i in node.operands]))
        return made

    def uses(self, entry: tuple[int, int]) -> bool:
        """Return whether an entry of an input is among the operands."""
        return any(node.entry == entry for node in self.nodes)

    def place(self, node: Node) -> str:
        """Return the name of an entry of an input: "q[0]"; "t" of the time."""
        name = self.names[node.entry[0]]
        return name if name == "t" else f"{name}[{node.entry[1]}]"


def parameter_gradient(L: ca.SX, p: ca.SX) -> ca.SX:
    """Return dL/dp, a dense column, in which x^p log x, the derivative of x^p, is zero at x = 0."""
    found, symbols = ca.densify(ca.jacobian(L, p).T), ca.vertcat(*ca.symvar(L))
    if not p.numel() or ca.OP_POW not in Tape([symbols], [L]).operations:
        return found

    def make(node: Node, x: list[ca.SX]) -> ca.SX:
        if node.kind != "operation":
            return symbols[node.entry[1]] if node.kind == "input" else ca.SX(node.value)
        if node.operation == ca.OP_LOG:  # one of L's own makes L infinite there
            x = [x[0] + (x[0] == 0)]
        return node.of(x)

    tape = Tape([symbols], [found])
    made = tape.fold(make)
    return ca.vertcat(*[made[k] for k in tape.results[0]])


def apply(operation: int, x: Sequence[ca.SX]) -> Any:
    """Return an operation of one expression or of two."""
    make = ca.SX.unary if len(x) == 1 else ca.SX.binary
    return make(operation, *x)
