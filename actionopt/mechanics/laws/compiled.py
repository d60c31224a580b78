"""Evaluate a CasADi function at many times at once, straight from numpy memory."""

from __future__ import annotations

import math
import threading
from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING

import casadi as ca
import numpy as np

from actionopt.tools.cached import cached_property
from actionopt.tools.types import Array

if TYPE_CHECKING:
    from actionopt.mechanics.laws.columns import Columns

# Ad hoc, as sizes of memory: what fits a processor's cache, and what nobody misses.
AT_ONCE = 2**18  # numbers up to which all times are evaluated in one call: 2 MB
KEPT = 2**21  # numbers in the memory that a thread keeps for a function: 16 MB
OVERHEAD = 2**11  # that the smallest memory counts for: its CasADi function takes about as much
# Measured: of how many times or more the operations of some are written out, how many, and how many
# operations at most. A call of CasADi's for each time takes as long as a hundred operations; eight
# times at once save most of that, and what is written out pays even where it is evaluated once.
PARTED, PART, PART_OPERATIONS = 256, 8, 2**9
# Evaluations after which it pays for fewer times as well. Measured on 1 to 6 coordinates: writing
# out costs 0.3 ms, and saves 0.1 to 0.2 us of each.
OFTEN = 2**11
# Numbers of one call of CasADi's for several times, whose map holds a sparsity of as many: 64 kB.
# Measured on 10 to 160 coordinates: calls take as long as one for all, and what makes them half.
MAP_NUMBERS = 2**13
VERY_MANY = 2**12  # times from where on numpy takes a third of CasADi's time; measured


class Pointwise:
    """A function of one time, mapped over K times.

    Converting arguments to CasADi matrices costs more than evaluating a small Lagrangian, so
    the arguments are copied into memory that CasADi reads and writes directly. Each thread has
    memory of its own: CasADi lets others run while it evaluates. It is kept for the numbers of
    times K asked last, `KEPT` numbers of it at most.

    Parameters
    ----------
    function : casadi.Function
        Dense column inputs; outputs of any sparsity.
    """

    def __init__(self, function: ca.Function) -> None:
        self.function = function
        self._memory = _Memory()
        self._places: dict[int, tuple[Array, Array, tuple[int, int]]] = {}
        self._entries: dict[tuple[int, bool], tuple[Array, Array]] = {}

    def __reduce__(self) -> tuple:
        """Copy the function; the copy has memory of its own."""
        return Pointwise, (self.function,)

    def __call__(self, *arguments: Array) -> list[Array]:
        """Return the nonzeros of every output, shape (K, nonzeros).

        Arguments have shape (K, rows), or (1, rows) where they are the same at all times; K
        is taken from the first. The arrays returned are overwritten by the thread's next call
        with the same K.
        """
        count, memory = len(arguments[0]), self._memory
        memory.left -= count
        if memory.left < 0 and count > 2 * PART and self._part[1] > 1:
            memory.write_out()
        ready = memory.ready.get(count)
        if ready is None:
            if count == 0 or count > self._sizes[2]:
                return self._in_parts(count, arguments)
            ready = self._prepare(count)
        inputs, outputs, trigger = ready[:3]
        for slot, value in zip(inputs, arguments, strict=True):
            slot[...] = value
        trigger()
        return outputs

    def forget(self) -> None:
        """Free the memory: where the function was evaluated last."""
        self._memory = _Memory()

    def sparsity(self, output: int) -> tuple[Array, Array]:
        """Return rows and columns of the nonzeros of an output."""
        rows, cols, _ = self._places.get(output) or self._find_places(output)
        return rows, cols

    def _find_places(self, output: int) -> tuple[Array, Array, tuple[int, int]]:
        """Return rows and columns of the nonzeros of an output, and its size; keep them."""
        found = self.function.sparsity_out(output)
        both = np.array(found.row(), dtype=np.intp), np.array(found.get_col(), dtype=np.intp)
        self._places[output] = *both, self.function.size_out(output)
        return self._places[output]

    def entries(self, output: int, *, symmetric: bool = False) -> tuple[Array, Array]:
        """Return which nonzero each entry of an output is, and which there are, both (n, n).

        Where it is `symmetric`, the nonzeros may be those of a triangle.
        """
        key = output, symmetric
        if key not in self._entries:
            row, col = self.sparsity(output)
            index, there = np.zeros((2, *self.function.size_out(output)), dtype=np.intp)
            index[row, col], there[row, col] = np.arange(row.size), 1
            if symmetric:
                index, there = np.maximum(index, index.T), np.maximum(there, there.T)
            self._entries[key] = index, there
        return self._entries[key]

    def full(self, output: int, nonzeros: Array, *, symmetric: bool = False) -> Array:
        """Return matrices (K, rows, columns) for the nonzeros (K, nonzeros) of an output.

        Where they are `symmetric`, the nonzeros may be those of a triangle.
        """
        rows, cols, size = self._places.get(output) or self._find_places(output)
        matrices = np.zeros((len(nonzeros), *size))
        matrices[:, rows, cols] = nonzeros
        if symmetric:
            matrices[:, cols, rows] = nonzeros
        return matrices

    def product(
        self,
        output: int,
        nonzeros: Array,
        v: Array,
        *,
        symmetric: bool = False,
        transposed: bool = False,
    ) -> Array:
        """Return the matrices of the nonzeros (K, nonzeros) times v (K, columns): (K, rows).

        Where they are `symmetric`, the nonzeros are those of a triangle. Or `transposed`.
        """
        rows, cols, size = self._places.get(output) or self._find_places(output)
        if not rows.size:
            return np.zeros((len(nonzeros), size[1] if transposed else size[0]))
        if (rows.size, rows.size) == size and (rows == cols).all():  # a diagonal matrix
            return nonzeros * v
        if transposed:
            rows, cols = cols, rows
        if symmetric:
            off = (rows != cols).nonzero()[0]
            rows, cols = np.concatenate([rows, cols[off]]), np.concatenate([cols, rows[off]])
            nonzeros = np.concatenate([nonzeros, nonzeros[:, off]], axis=1)
        count, height = len(nonzeros), size[1] if transposed else size[0]
        at = height * np.arange(count)[:, None] + rows
        found = np.bincount(at.ravel(), (nonzeros * v[:, cols]).ravel(), count * height)
        return found.reshape(count, height)

    @cached_property
    def _sizes(self) -> tuple[list[int], list[int], int, int]:
        """How many numbers of one time every input, every output has; times at once; all numbers.

        Of one time.
        """
        f = self.function
        inputs = [f.numel_in(i) for i in range(f.n_in())]
        outputs = [f.nnz_out(i) for i in range(f.n_out())]
        numbers = max(sum(inputs) + sum(outputs), 1)
        return inputs, outputs, max(AT_ONCE // numbers, 1), numbers

    @cached_property
    def _columns(self) -> Columns | None:
        """The function for `VERY_MANY` times and more, or None."""
        from actionopt.mechanics.laws.columns import Columns

        f = self.function
        if not f.is_a("SXFunction") or f.sz_w() * VERY_MANY > KEPT:
            return None
        try:
            return Columns(f)
        except ValueError:  # an instruction that numpy does not know
            return None

    @cached_property
    def _part(self) -> tuple[ca.Function, int]:
        """The operations of some times written out, and of how many."""
        f = self.function
        if not f.is_a("SXFunction"):
            return f, 1
        part = min(PART, max(PART_OPERATIONS // max(f.n_instructions(), 1), 1))
        return (f.map(part).expand(), part) if part > 1 else (f, 1)

    def _in_parts(self, count: int, arguments: tuple[Array, ...]) -> list[Array]:
        """Evaluate at more times than memory is kept for, or at none, in memory for this once."""
        if count >= VERY_MANY and self._columns is not None:
            return [y[:, :, 0] for y in self._columns(count, 1, [x[..., None] for x in arguments])]
        _, widths, part, _ = self._sizes
        outputs = [np.empty((count, width)) for width in widths]
        for first in range(0, count, part):
            start = min(first, count - part)  # the last part is a whole one, too
            here = slice(start, start + part)
            values = self(*(x if len(x) == 1 else x[here] for x in arguments))
            for output, value in zip(outputs, values, strict=True):
                output[here] = value
        return outputs

    def _prepare(self, count: int) -> tuple:
        """Return memory for `count` times and what evaluates the function there; keep them."""
        often = count > 2 * PART and self._memory.left == math.inf
        mapped, part = self._part if often or count >= PARTED else (self.function, 1)
        parts = -(-count // part)  # the last one evaluates at zeros as well
        *widths, _, numbers = self._sizes
        together = min(max(MAP_NUMBERS // (part * numbers), 1), parts)
        mapped = mapped.map(together) if together > 1 else mapped
        inputs, outputs = ([np.zeros((parts * part, w)) for w in ws] for ws in widths[:2])
        buffers, triggers = [], []
        for first in range(0, parts, together):
            start = min(first, parts - together)  # the last call is a whole one, too
            here = slice(start * part, (start + together) * part)
            buffer, trigger = mapped.buffer()
            for i, slot in enumerate(inputs):
                buffer.set_arg(i, memoryview(slot[here]))  # type: ignore
            for i, slot in enumerate(outputs):
                buffer.set_res(i, memoryview(slot[here]))  # type: ignore
            buffers.append(buffer)
            triggers.append(trigger)
        if part > 1:
            inputs, outputs = ([slot[:count] for slot in slots] for slots in (inputs, outputs))
        trigger = triggers[0] if len(triggers) == 1 else partial(_call_all, triggers)
        ready = inputs, outputs, trigger, buffers, mapped  # the last two keep the memory alive
        self._memory.keep(count, ready, numbers)
        return ready


def _call_all(functions: list[Callable[[], None]]) -> None:
    for function in functions:
        function()


class _Memory(threading.local):
    """The memory that one thread keeps, by the number of times; the oldest is given up first."""

    def __init__(self) -> None:
        self.ready: dict[int, tuple] = {}
        self.size = 0
        self.left: float = OFTEN  # evaluations before operations are written out

    def write_out(self) -> None:
        """Begin anew, operations written out: they give the same numbers, bit by bit."""
        self.ready, self.size, self.left = {}, 0, math.inf

    def keep(self, count: int, ready: tuple, numbers: int) -> None:
        """Keep what is ready for `count` times, of so many numbers each."""
        self.ready[count] = ready
        self.size += max(count * numbers, OVERHEAD)
        while self.size > KEPT and len(self.ready) > 1:
            oldest = next(iter(self.ready))
            del self.ready[oldest]
            self.size -= max(oldest * numbers, OVERHEAD)
