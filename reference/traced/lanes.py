"""Runs a program with NumPy: part after part of the samples, in buffers that are used again."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from operator import itemgetter
from typing import Any

import numpy as np

from screwgauge.reference.rotations import Array
from screwgauge.reference.traced.blocks import columns
from screwgauge.reference.traced.program import Operand, Program
from screwgauge.reference.traced.trace import OPERATIONS

#: Samples worked on at a time: a call of NumPy costs as much as some thousand operations in the cache.
CHUNK = 6144


def _maximum(a: Array, b: Array, out: Array) -> None:
    np.maximum(a, b, out=out)  # which alone of the functions takes no third argument


#: A square reads its number once.
_FUNCTIONS: dict[str, Callable[..., Any]] = {**OPERATIONS, "max": _maximum, "square": np.square}


class Lanes:
    """A program with its buffers. Not for two threads at once.

    Attributes:
        code: Functions, and what picks their operands, the result last, from all rows: inputs, outputs, buffers and
            constants.
    """

    def __init__(self, program: Program, chunk: int = CHUNK) -> None:
        self.program, self.chunk = program, chunk
        self.code: list[tuple[Callable[..., Any], itemgetter[Any]]] = []
        operands = (x for args in (*(args for _, args in program.code), program.outputs) for x in args)
        known = dict.fromkeys(x for x in operands if isinstance(x, float))
        self.constants = {x: i - len(known) for i, x in enumerate(known)}  # the last rows
        self.buffers = columns(chunk, self._plan(program)).T

    def _plan(self, program: Program) -> int:
        """Gives every value a row that is free, last used first: it is still in the cache. Returns the buffers."""
        last = {x: i for i, (_, args) in enumerate(program.code, program.inputs) for x in args if isinstance(x, int)}
        first = count = program.inputs + len(program.outputs)
        at, free, wanted = [*range(program.inputs)], list[int](), dict[int, list[int]]()
        for row, x in enumerate(program.outputs, program.inputs):
            if isinstance(x, int):
                wanted.setdefault(x, []).append(row)

        def place(x: Operand) -> int:
            return at[x] if isinstance(x, int) else self.constants[x]

        def copy(source: int, rows: Sequence[int]) -> None:
            self.code += [(np.copyto, itemgetter(row, source)) for row in rows]

        for value, (op, args) in enumerate(program.code, program.inputs):
            rows, own = [place(x) for x in args], wanted.pop(value, [])
            free += [at[x] for x in {*args} if isinstance(x, int) and last[x] == value and at[x] >= first]
            if not own and not free:
                free, count = [count], count + 1
            at.append(own[0] if own else free.pop())
            if op == "mul" and rows[0] == rows[1]:
                op, rows = "square", rows[:1]
            self.code.append((_FUNCTIONS[op], itemgetter(*rows, at[value])))
            copy(at[value], own[1:])  # while it is in the cache
        for row, x in enumerate(program.outputs, program.inputs):
            if isinstance(x, float) or x < program.inputs:
                copy(place(x), [row])
        return count - first

    def bind(
        self, inputs: Sequence[Array], outputs: Sequence[Array], weights: Array | None = None
    ) -> Callable[[], bool]:
        """As `screwgauge.reference.traced.native.Native.bind`; numbers of a row may lie apart."""
        codes, constants = [], [np.array(x) for x in self.constants]
        checks = np.zeros((0, inputs[0].shape[1])) if weights is None else outputs[-1]
        for start in range(0, inputs[0].shape[1], self.chunk):
            given, found = (
                [row[start : start + self.chunk] for block in x for row in block] for x in (inputs, outputs)
            )
            rows = [*given, *found, *self.buffers[:, : len(given[0])], *constants]
            codes.append([(function, pick(rows)) for function, pick in self.code])

        def run() -> bool:
            with np.errstate(all="ignore"):
                for code in codes:
                    for function, operands in code:
                        function(*operands)
                return weights is None or bool((weights @ checks).max(initial=0.0) <= 1.0)

        return run

    def again(self) -> Lanes:
        """One that may run at the same time."""
        return Lanes(self.program, self.chunk)
