"""Runs a program with NumPy: part after part of the samples, in buffers that fit the cache and are used again."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np

from screwgauge.reference.rotations import Array
from screwgauge.reference.traced.program import Operand, Program
from screwgauge.reference.traced.trace import OPERATIONS

Code = list[tuple[Callable[..., Any], tuple[Array, ...]]]
"""Functions with their operands, the result last."""
#: Samples worked on at a time.
CHUNK = 1024


class Lanes:
    """A program with its buffers. Not for two threads at once."""

    def __init__(self, program: Program, chunk: int = CHUNK) -> None:
        self.program, self.chunk = program, chunk
        self.inputs, self.outputs = (_rows(n, chunk) for n in (program.inputs, len(program.outputs)))
        self.code = self._plan(program)
        self.part: tuple[int, Code] = chunk, self.code

    def _plan(self, program: Program) -> Code:
        """Gives every value a buffer that is free, last used first: it is still in the cache."""
        last = {x: i for i, (_, args) in enumerate(program.code) for x in args if isinstance(x, int)}
        rows = [*zip(program.outputs, self.outputs, strict=True)]
        kept = {x: row for x, row in rows if isinstance(x, int)}
        at: dict[Operand, Array] = dict(enumerate(self.inputs))
        code, free = [], list[Array]()
        for i, (op, args) in enumerate(program.code):
            value = program.inputs + i
            operands = tuple(at[x] if isinstance(x, int) else np.array(x) for x in args)
            free += [at[x] for x in {*args} if isinstance(x, int) and last[x] == i and x not in kept]
            own = kept.get(value)
            at[value] = (free.pop() if free else _rows(1, self.chunk)[0]) if own is None else own
            code.append((OPERATIONS[op], (*operands, at[value])))
        for x, row in rows:
            if isinstance(x, float):
                row[:] = x
            elif at[x] is not row:
                code.append((np.positive, (at[x], row)))
        return code

    def bind(
        self, inputs: Sequence[Array], outputs: Sequence[Array], weights: Array | None = None
    ) -> Callable[[], bool]:
        """As `screwgauge.reference.traced.native.Native.bind`; numbers of a row may lie apart."""
        limits = np.zeros(self.program.checks) if weights is None else weights
        return partial(self._run, inputs, outputs, limits)

    def _run(self, inputs: Sequence[Array], outputs: Sequence[Array], weights: Array) -> bool:
        clear, count = True, inputs[0].shape[1]
        with np.errstate(all="ignore"):
            for start in range(0, count, self.chunk):
                n = min(self.chunk, count - start)
                samples = slice(start, start + n)
                _copy([block[:, samples] for block in inputs], self.inputs[:, :n], inwards=True)
                for function, operands in self._code(n):
                    function(*operands)
                found = self.outputs[:, :n]
                _copy([block[:, samples] for block in outputs], found, inwards=False)
                clear &= not weights.size or bool((weights @ found[-len(weights) :]).max() <= 1.0)
        return clear

    def _code(self, n: int) -> Code:
        """The instructions on the first n samples of the buffers."""
        if n == self.chunk:
            return self.code
        if self.part[0] != n:
            cut = [(f, tuple(x[:n] if x.ndim else x for x in operands)) for f, operands in self.code]
            self.part = n, cut
        return self.part[1]

    def again(self) -> Lanes:
        """One that may run at the same time."""
        return Lanes(self.program, self.chunk)


def _copy(blocks: Sequence[Array], rows: Array, *, inwards: bool) -> None:
    """Copies blocks, one below the other, into rows, or back."""
    row = 0
    for block in blocks:
        some = rows[row : row + len(block)]
        np.copyto(*((some, block) if inwards else (block, some)))
        row += len(block)


def _rows(count: int, chunk: int) -> Array:
    """Buffers whose rows are not a whole number of pages apart: these would share the same few lines of the cache."""
    return np.empty((count, chunk + 8))[:, :chunk]
