"""Runs a program with NumPy: part after part of the samples, in buffers that fit the cache and are used again."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np

from screwgauge.reference.rotations import Array
from screwgauge.reference.traced.program import Operand, Program
from screwgauge.reference.traced.trace import OPERATIONS

#: Samples worked on at a time.
CHUNK = 1024


class Lanes:
    """A program with its buffers. Not for two threads at once."""

    def __init__(self, program: Program, chunk: int = CHUNK) -> None:
        self.program, self.chunk = program, chunk
        self.inputs, self.outputs = (_rows(n, chunk) for n in (program.inputs, len(program.outputs)))
        self.code: list[tuple[Callable[..., Any], tuple[Array, ...]]] = []
        self._plan(program)

    def _plan(self, program: Program) -> None:
        """Gives every value a buffer that is free, last used first: it is still in the cache."""
        last = {x: i for i, (_, args) in enumerate(program.code) for x in args if isinstance(x, int)}
        kept = {x: row for x, row in zip(program.outputs, self.outputs, strict=True) if isinstance(x, int)}
        at: dict[Operand, Array] = dict(enumerate(self.inputs))
        free = list[Array]()
        for i, (op, args) in enumerate(program.code):
            value = program.inputs + i
            operands = tuple(at[x] if isinstance(x, int) else np.array(x) for x in args)
            free += [at[x] for x in {*args} if isinstance(x, int) and last[x] == i and x not in kept]
            own = kept.get(value)
            at[value] = (free.pop() if free else _rows(1, self.chunk)[0]) if own is None else own
            self.code.append((OPERATIONS[op], (*operands, at[value])))
        for x, row in zip(program.outputs, self.outputs, strict=True):
            if isinstance(x, float):
                row[:] = x
            elif at[x] is not row:
                self.code.append((np.copyto, (row, at[x])))

    def bind(self, inputs: Sequence[Array], outputs: Sequence[Array]) -> Callable[[], None]:
        """What runs all samples of some arrays, again and again.

        Args:
            inputs, outputs: Shapes (m, n) each, in the order of the program.
        """
        return partial(self._run, inputs, outputs)

    def _run(self, inputs: Sequence[Array], outputs: Sequence[Array]) -> None:
        with np.errstate(all="ignore"):
            for start in range(0, inputs[0].shape[1], self.chunk):
                rows = slice(start, start + self.chunk)
                n, row = inputs[0][:, rows].shape[1], 0
                for block in inputs:
                    self.inputs[row : row + len(block), :n] = block[:, rows]
                    row += len(block)
                self.inputs[:, n:] = self.inputs[:, n - 1 : n]
                for function, operands in self.code:
                    function(*operands)
                row = 0
                for block in outputs:
                    block[:, rows] = self.outputs[row : row + len(block), :n]
                    row += len(block)

    def again(self) -> Lanes:
        """One that may run at the same time."""
        return Lanes(self.program, self.chunk)


def _rows(count: int, chunk: int) -> Array:
    """Buffers whose rows are not a whole number of pages apart: these would share the same few lines of the cache."""
    return np.empty((count, chunk + 8))[:, :chunk]
