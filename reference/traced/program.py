"""Straight-line programs: the instructions, in order, that compute outputs of a trace; NumPy runs them.

Samples are evaluated in batches with reused buffers. `native` generates machine code of the same programs.
"""

from __future__ import annotations

import weakref
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from math import isfinite
from operator import itemgetter
from threading import Lock, RLock
from typing import Any

import numpy as np
from numpy.typing import DTypeLike

from screwgauge.reference.rotations import Array
from screwgauge.reference.traced.trace import OPERATIONS, Node, Scalar

Operand = int | float
"""Index of a value (inputs come first, then instructions), or a constant."""


@dataclass(frozen=True, slots=True)
class Program:
    """Instructions that apply equally to all samples.

    Attributes:
        inputs: Number of inputs per sample.
        code: Pairs (operation, operands); instruction number i computes value ``inputs + i``.
        outputs: Values to return.
        checks: Number of trailing outputs that decide whether the sample is in doubt.
    """

    inputs: int
    code: tuple[tuple[str, tuple[Operand, ...]], ...]
    outputs: tuple[Operand, ...]
    checks: int = 0

    def formulas(self, operand_text: Callable[[Operand], str]) -> Iterator[tuple[int, str]]:
        """Yield each value and its formula, which is valid in C and Python; `operand_text` formats an operand."""
        signs = {"add": "+", "sub": "-", "mul": "*", "div": "/"}
        for i, (op, args) in enumerate(self.code, self.inputs):
            first, *rest = map(operand_text, args)
            if op in signs:
                yield i, f"{first} {signs[op]} {rest[0]}"
            else:
                yield i, f"-{first}" if op == "neg" else f"{op}({', '.join([first, *rest])})"

    def as_c(self, name: str = "sample") -> str:
        """Write the program as readable C."""

        def operand_text(x: Operand) -> str:
            if isinstance(x, float):
                return repr(x)
            return f"x[{x}]" if x < self.inputs else f"v{x}"

        lines = [f"void {name}(const double *x, double *out)", "{"]
        lines += [f"    double v{i} = {formula};" for i, formula in self.formulas(operand_text)]
        lines += [f"    out[{i}] = {operand_text(x)};" for i, x in enumerate(self.outputs)]
        return "\n".join([*lines, "}", ""])


def program(inputs: int, outputs: Sequence[Scalar], checks: int = 0, first: Sequence[Scalar] = ()) -> Program:
    """Collect the instructions that outputs need; operands are computed shortly before their use.

    Args:
        first: Nodes to compute before all others, in this order.
    """
    number, code = dict[int, int](), list[tuple[str, tuple[Operand, ...]]]()

    def operand(x: Scalar) -> Operand:
        return number[x.index] if isinstance(x, Node) else float(x)

    for output in (*first, *outputs):
        stack = [output] if isinstance(output, Node) else []
        while stack:
            node = stack[-1]
            if node.index in number:
                stack.pop()
            elif node.op == "input":
                number[node.index] = node.args[0]
            elif missing := [x for x in node.args if isinstance(x, Node) and x.index not in number]:
                stack += missing
            else:
                number[node.index] = inputs + len(code)
                code.append((node.op, tuple(operand(x) for x in node.args)))
    return Program(inputs, tuple(code), tuple(operand(x) for x in outputs), checks)


def reduce_program(program: Program, outputs: Sequence[int]) -> Program:
    """Reduce a program to the given outputs, of which the checks come last."""
    kept = [program.outputs[i] for i in outputs]
    needed = {x for x in kept if isinstance(x, int)}
    for value in range(program.inputs + len(program.code) - 1, program.inputs - 1, -1):
        if value in needed:
            needed |= {x for x in program.code[value - program.inputs][1] if isinstance(x, int)}
    rows = [value for value in range(program.inputs, program.inputs + len(program.code)) if value in needed]
    number = {x: x for x in range(program.inputs)} | {value: program.inputs + i for i, value in enumerate(rows)}

    def operand(x: Operand) -> Operand:
        return number[x] if isinstance(x, int) else x

    code = ((op, tuple(map(operand, args))) for op, args in (program.code[value - program.inputs] for value in rows))
    return Program(program.inputs, tuple(code), tuple(map(operand, kept)), program.checks)


#: Number of values in a cache line.
LINE = 8
#: Largest answer whose memory a `Pool` keeps [bytes]; memory for larger answers is newly allocated each time.
KEPT = 1 << 26


def columns(n: int, m: int, dtype: DTypeLike = float) -> Array:
    """Allocate an array of shape (n, m) with contiguous columns.

    Columns start at cache lines. Their distance is never a multiple of the page size, because they would then share
    the same few cache lines.
    """
    wide = n + LINE - n % LINE
    room = np.empty(m * wide + LINE, dtype)
    first = -(room.ctypes.data // room.itemsize) % LINE
    return room[first : first + m * wide].reshape(m, wide)[:, :n].T


class Block:
    """A memory block for one result.

    Attributes:
        array: The memory as an array for its owner, see `columns`.
        known: Data that the owner keeps with the memory.
    """

    def __init__(self, n: int, m: int) -> None:
        self.array, self.known = columns(n, m), dict[Any, Any]()
        room = self.array.base
        assert room is not None
        self._room, self._first = room.data, (self.array.ctypes.data - room.ctypes.data) // self.array.itemsize

    def lend(self, back: Callable[[Block], None]) -> Array:
        """Lend the memory of the block to a caller. Shape (n, m).

        Args:
            back: Function to call when the last array on the memory is released. All views refer to one base array,
                because NumPy does not see the owner of the underlying memory.
        """
        n, m = self.array.shape
        lent, wide = np.frombuffer(self._room), self.array.strides[1] // self.array.itemsize
        view = lent[self._first : self._first + m * wide].reshape(m, wide)[:, :n].T
        if view.base is lent:
            weakref.finalize(lent, back, self).atexit = False
        return view


class Pool:
    """A pool of memory blocks with equal shapes; a block goes back to the pool when its last array is released.

    Touching fresh memory takes longer than writing the values, because the operating system zeroes every page. A block
    is never lent to two callers at once: arrays and their exports refer to the lent array, and the block goes back to
    the pool only when that array is released.
    """

    def __init__(self, kept: int = KEPT) -> None:
        self.kept, self.shape, self.free = kept, (0, 0), list[Block]()
        self._lock = RLock()  # a block may be released while a second one is taken

    def take(self, n: int, m: int) -> Block:
        """Take a free block of n rows and m columns."""
        with self._lock:
            if (n, m) != self.shape:
                self.shape, self.free = (n, m), []
            return self.free.pop() if self.free else Block(n, m)

    def lend(self, block: Block) -> Array:
        """Lend the memory of a block to a caller until the array is released. Shape (n, m)."""
        return block.lend(self._take_back)

    def _take_back(self, block: Block) -> None:
        with self._lock:
            if block.array.shape == self.shape and (len(self.free) + 1) * block.array.nbytes <= self.kept:
                self.free.append(block)


#: Number of samples processed at a time: a NumPy call takes as long as a few thousand operations in the cache.
CHUNK = 6144


def _maximum(a: Array, b: Array, out: Array) -> None:
    np.maximum(a, b, out=out)  # the only function without a third argument


#: Operation -> function; ``square`` reads its operand only once.
_FUNCTIONS: dict[str, Callable[..., Any]] = {**OPERATIONS, "max": _maximum, "square": np.square}


def is_clear(outputs: Sequence[Array], weights: Array) -> bool:
    """Return True if no sample is in doubt, see `screwgauge.reference.traced.native.Native.bind`.

    Args:
        outputs: Blocks of outputs; the last block has the checks. Shapes (m, n) each.
    """
    checked = (weights @ outputs[-1]).max(initial=0.0) <= 1.0
    return bool(checked) and all(isfinite(block.sum()) for block in outputs[:-1])


class Lanes:
    """A program and its buffers; concurrent threads wait for each other.

    Attributes:
        code: Functions, each with the rows of its operands and its result; rows hold inputs, outputs, buffers and
            constants, in this order.
    """

    def __init__(self, program: Program, chunk: int = CHUNK, dtype: DTypeLike = float) -> None:
        self.program, self.chunk, self.dtype, self._lock = program, chunk, np.dtype(dtype), Lock()
        self.code: list[tuple[Callable[..., Any], itemgetter[Any]]] = []
        operands = (x for args in (*(args for _, args in program.code), program.outputs) for x in args)
        known = dict.fromkeys(x for x in operands if isinstance(x, float))
        self.constants = {x: i - len(known) for i, x in enumerate(known)}  # the last rows
        self.buffers = columns(chunk, self._plan(program), self.dtype).T

    def _plan(self, program: Program) -> int:
        """Assign a free row to each value, preferring recently used (cached) rows; return the number of buffers."""
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
            rows, places = [place(x) for x in args], wanted.pop(value, [])
            free += [at[x] for x in {*args} if isinstance(x, int) and last[x] == value and at[x] >= first]
            if not places and not free:
                free, count = [count], count + 1
            at.append(places[0] if places else free.pop())
            if op == "mul" and rows[0] == rows[1]:
                op, rows = "square", rows[:1]
            self.code.append((_FUNCTIONS[op], itemgetter(*rows, at[value])))
            copy(at[value], places[1:])  # while the value is in the cache
        for row, x in enumerate(program.outputs, program.inputs):
            if isinstance(x, float) or x < program.inputs:
                copy(place(x), [row])
        return count - first

    def bind(
        self, inputs: Sequence[Array], outputs: Sequence[Array], weights: Array | None = None
    ) -> Callable[[], bool]:
        """Bind arrays like `screwgauge.reference.traced.native.Native.bind`; rows need not be contiguous."""
        codes, constants = [], [np.array(x, self.dtype) for x in self.constants]
        for start in range(0, inputs[0].shape[1], self.chunk):
            given, results = (
                [row[start : start + self.chunk] for block in x for row in block] for x in (inputs, outputs)
            )
            rows = [*given, *results, *self.buffers[:, : len(given[0])], *constants]
            codes.append([(function, pick(rows)) for function, pick in self.code])

        def run() -> bool:
            with self._lock, np.errstate(all="ignore"):
                for code in codes:
                    for function, operands in code:
                        function(*operands)
                return weights is None or is_clear(outputs, weights)

        return run

    def copy(self) -> Lanes:
        """Copy the object so that copy and original may run concurrently."""
        return Lanes(self.program, self.chunk, self.dtype)


class Narrow:
    """A float32 runner for float64 arrays, which rounds inputs and widens outputs."""

    def __init__(self, inner: Any) -> None:
        self.program, self.inner = inner.program, inner

    def bind(
        self, inputs: Sequence[Array], outputs: Sequence[Array], weights: Array | None = None
    ) -> Callable[[], bool]:
        """Bind arrays like `Lanes.bind`."""
        given, results = ([np.empty(x.shape, self.inner.dtype) for x in blocks] for blocks in (inputs, outputs))
        inner = self.inner.bind(given, results, weights)

        def run() -> bool:
            with np.errstate(over="ignore"):
                for block, narrow in zip(inputs, given, strict=True):
                    narrow[:] = block
            clear = bool(inner())
            for block, narrow in zip(outputs, results, strict=True):
                block[:] = narrow
            return clear

        return run

    def copy(self) -> Narrow:
        """Copy the runner so that copy and original may run concurrently."""
        return Narrow(self.inner.copy())
