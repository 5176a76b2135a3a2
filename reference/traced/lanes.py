"""Runs a program with NumPy: part after part of the samples, in buffers that fit the cache and are used again."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from screwgauge.reference.rotations import Array
from screwgauge.reference.traced.program import Operand, Program
from screwgauge.reference.traced.trace import OPERATIONS

#: Samples worked on at a time.
CHUNK = 512


class Lanes:
    """A program with its buffers. Not for two threads at once."""

    def __init__(self, program: Program, chunk: int = CHUNK) -> None:
        self.program, self.chunk = program, chunk
        self.columns = [x for x in program.outputs]
        self._plan()

    def _plan(self) -> None:
        """Gives every value a buffer that is free, last used first: it is still in the cache."""
        program = self.program
        last = {x: i for i, (_, args) in enumerate(program.code) for x in args if isinstance(x, int)}
        where, free, count = dict[int, int](), list[int](), 0
        kept = {x: place for place, x in reversed([*enumerate(program.outputs)]) if isinstance(x, int)}
        self.code: list[tuple[Callable[..., Any], tuple[Operand, ...], int]] = []
        self.where = where
        for i, (op, args) in enumerate(program.code):
            value = program.inputs + i
            for x in {*args}:
                if isinstance(x, int) and x >= program.inputs and last[x] == i and x not in kept:
                    free.append(where[x])
            if value in kept:
                where[value] = -1 - kept[value]
            elif free:
                where[value] = free.pop()
            else:
                where[value] = count
                count += 1
            self.code.append((OPERATIONS[op], args, value))
        self.buffers = np.empty((count, self.chunk))

    def run(self, inputs: Array, outputs: Array) -> None:
        """Runs all samples. Shapes (n_input, n), (n_output, n)."""
        for start in range(0, inputs.shape[1], self.chunk):
            rows = slice(start, start + self.chunk)
            self._part(inputs[:, rows], outputs[:, rows])

    def _part(self, inputs: Array, outputs: Array) -> None:
        n, buffers, first = inputs.shape[1], self.buffers, self.program.inputs
        if n < self.chunk:
            buffers = np.ascontiguousarray(buffers[:, :n])
        at: dict[Operand, Any] = {i: row for i, row in enumerate(inputs)}
        at |= {v: outputs[-1 - w] if w < 0 else buffers[w] for v, w in self.where.items()}
        with np.errstate(all="ignore"):
            for function, args, value in self.code:
                function(*[at[x] if isinstance(x, int) else x for x in args], at[value])
        for place, x in enumerate(self.program.outputs):
            if isinstance(x, float) or x < first or self.where[x] != -1 - place:
                outputs[place] = at[x] if isinstance(x, int) else x
