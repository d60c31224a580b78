"""Evaluate a CasADi function at many times at once, straight from numpy memory."""

from __future__ import annotations

import casadi as ca
import numpy as np

from actionopt.quadrature import Array


class Pointwise:
    """A function of one time, mapped over K times.

    Converting arguments to CasADi matrices costs more than evaluating a small Lagrangian, so
    the arguments are copied into memory that CasADi reads and writes directly.

    Parameters
    ----------
    function : casadi.Function
        Dense column inputs; outputs of any sparsity.
    """

    def __init__(self, function: ca.Function) -> None:
        self.function = function
        self.evaluations = 0
        self._ready: dict[int, tuple] = {}
        self._sparsity: dict[int, tuple[Array, Array]] = {}

    def __call__(self, *arguments: Array) -> list[Array]:
        """Return the nonzeros of every output, shape (K, nonzeros).

        Arguments have shape (K, rows), or (1, rows) where they are the same at all times; K
        is taken from the first. The arrays returned are overwritten by the next call with
        the same K.
        """
        count = len(arguments[0])
        if count == 0:
            return [np.zeros((0, self.function.nnz_out(i))) for i in range(self.function.n_out())]
        ready = self._ready.get(count)
        if ready is None:
            ready = self._ready[count] = self._prepare(count)
        inputs, outputs, trigger = ready[:3]
        for slot, value in zip(inputs, arguments, strict=True):
            slot[...] = value
        trigger()
        self.evaluations += count
        return outputs

    def sparsity(self, output: int) -> tuple[Array, Array]:
        """Return rows and columns of the nonzeros of an output."""
        if output not in self._sparsity:
            found = self.function.sparsity_out(output)
            both = np.array(found.row(), dtype=np.intp), np.array(found.get_col(), dtype=np.intp)
            self._sparsity[output] = both
        return self._sparsity[output]

    def _prepare(self, count: int) -> tuple:
        f = self.function
        mapped = f.map(count) if count > 1 else f
        buffer, trigger = mapped.buffer()
        inputs = [np.zeros((count, f.numel_in(i))) for i in range(f.n_in())]
        outputs = [np.zeros((count, f.nnz_out(i))) for i in range(f.n_out())]
        for i, slot in enumerate(inputs):
            buffer.set_arg(i, memoryview(slot))  # type: ignore
        for i, slot in enumerate(outputs):
            buffer.set_res(i, memoryview(slot))  # type: ignore
        return inputs, outputs, trigger, buffer, mapped  # the last two keep the memory alive
