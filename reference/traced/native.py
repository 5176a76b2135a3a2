"""Generates machine code of programs with llvmlite; the code processes a vector of samples at a time."""

from __future__ import annotations

import ctypes
from collections import deque
from collections.abc import Callable, Sequence
from functools import cache
from itertools import islice
from typing import Any

import numpy as np
from numpy.typing import NDArray

from screwgauge.reference.rotations import Array
from screwgauge.reference.traced.program import Operand, Program
from screwgauge.reference.traced.vector_math import FLOAT, VectorMath, number_of

ENTRY = "samples"
#: Number of operations below which programs inline sines and arctangents; a call spills all registers.
SMALL = 6000
#: Number of cache lines that are prefetched before they are written: a missing line delays all others.
AHEAD = 40


@cache
def _host() -> tuple[Any, str, int]:
    """Return llvmlite's binding, a string with CPU and CPU features, and the number of values in a vector register.

    Raises:
        ImportError: llvmlite is not installed.
    """
    import llvmlite.binding as llvm

    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    features = llvm.get_host_cpu_features()
    width = 8 if features.get("avx512f") else 4 if features.get("avx") else 2
    version = ".".join(map(str, llvm.llvm_version_info))
    return llvm, f"LLVM {version} {llvm.get_host_cpu_name()} {features.flatten()}", width


def cpu() -> str:
    """Return the compiler, CPU and CPU features for which machine code is generated."""
    return _host()[1]


def _ir(program: Program, width: int, dtype: np.dtype[Any]) -> str:
    """Build the LLVM code of ``doubt = samples(inputs, outputs, weights, count)``, see `Native.bind`.

    A separate function without a loop processes one block of samples: constants stay in memory, which leaves registers
    free, and the stack is aligned to cache lines.
    """
    import llvmlite.ir as ir

    module, i64 = ir.Module("screwgauge"), ir.IntType(64)
    pointer = number_of(ir, dtype).as_pointer()
    table = pointer.as_pointer()
    block = ir.Function(module, ir.FunctionType(i64, [table, table, pointer, i64]), "block")
    block.linkage, block.attributes.alignstack = "internal", 64
    block.attributes.add("noinline")
    source, target, weights, offset = block.args
    b = ir.IRBuilder(block.append_basic_block())
    maths = VectorMath(module, b, width, inline=len(program.code) < SMALL, dtype=dtype)
    checks, total = _statements(maths, program, source, target, offset)
    for i, x in enumerate(checks):
        total = maths.fma(x, maths.spread(b.load(b.gep(weights, [ir.Constant(i64, i)]))), total)
    doubt = b.bitcast(b.fcmp_unordered(">", total, maths.constant(1.0)), ir.IntType(width))
    b.ret(b.zext(doubt, i64))
    _loop(ir, module, block, width)
    return str(module)


def _statements(maths: VectorMath, program: Program, source: Any, target: Any, offset: Any) -> tuple[list[Any], Any]:
    """Emit the program and store its outputs; return the checks, and 0 (NaN if an output is not finite)."""
    b, i64, zero = maths.b, maths.ir.IntType(64), maths.constant(0.0)
    lost, values_end = zero, len(program.outputs) - program.checks

    def place(rows: Any, row: int) -> Any:
        start = b.load(b.gep(rows, [maths.ir.Constant(i64, row)]))
        return b.bitcast(b.gep(start, [offset]), maths.vector.as_pointer())

    values = {i: b.load(place(source, i), align=maths.bits // 8) for i in range(program.inputs)}

    def operand(x: Operand) -> Any:
        return values[x] if isinstance(x, int) else maths.constant(x)

    made = [x if isinstance(x, int) else 0 for x in program.outputs]
    waiting = deque(sorted(range(len(made)), key=made.__getitem__))
    coming = (place(target, row) for row in [*waiting])

    def fetch(count: int) -> None:
        for line in islice(coming, count):
            maths.fetch(line)

    def store(value: int) -> None:
        nonlocal lost
        while waiting and made[waiting[0]] <= value:
            row = waiting.popleft()
            fetch(1)
            b.store(output := operand(program.outputs[row]), place(target, row), align=maths.bits // 8)
            if row < values_end:
                lost = maths.fma(output, zero, lost)

    fetch(AHEAD)
    store(program.inputs - 1)
    for i, (op, args) in enumerate(program.code, program.inputs):
        values[i] = maths.operation(op, [operand(x) for x in args])
        store(i)
    return [operand(x) for x in program.outputs[values_end:]], lost


def _loop(ir: Any, module: Any, block: Any, width: int) -> None:
    """Emit a loop over all blocks; the last block ends with the last sample and may repeat earlier samples."""
    i64 = block.ftype.return_type
    function = ir.Function(module, block.ftype, ENTRY)
    *tables, count = function.args
    begin = ir.IRBuilder(function.append_basic_block())
    body, end = function.append_basic_block(), function.append_basic_block()
    last = begin.sub(count, ir.Constant(i64, width))
    begin.branch(body)
    b = ir.IRBuilder(body)
    start, doubts = b.phi(i64), b.phi(i64)
    for value in (start, doubts):
        value.add_incoming(ir.Constant(i64, 0), begin.block)
    offset = b.select(b.icmp_signed("<", start, last), start, last)
    doubt = b.or_(doubts, b.call(block, [*tables, offset]))
    following = b.add(start, ir.Constant(i64, width))
    start.add_incoming(following, body)
    doubts.add_incoming(doubt, body)
    b.cbranch(b.icmp_signed("<", following, count), body, end)
    ir.IRBuilder(end).ret(doubt)


def machine_code(program: Program, dtype: np.dtype[Any] = FLOAT) -> bytes:
    """Compile a program for this CPU and a number type.

    LLVM's optimization passes would double the compile time without gain, because the program is already simplified.
    """
    llvm, _, width = _host()
    return bytes(machine().emit_object(llvm.parse_assembly(_ir(program, width * 8 // dtype.itemsize, dtype))))


def machine() -> Any:
    """Return the target machine for this CPU."""
    llvm, _, width = _host()
    features = llvm.get_host_cpu_features().flatten() + (",-prefer-256-bit" if width == 8 else "")
    target = llvm.Target.from_default_triple()
    return target.create_target_machine(cpu=llvm.get_host_cpu_name(), features=features, opt=1, jit=True)


class Native:
    """Machine code and its entry point; any number of threads may run it concurrently."""

    def __init__(self, program: Program, code: bytes, dtype: np.dtype[Any] = FLOAT) -> None:
        """Load object code for a number type.

        Raises:
            RuntimeError: The code is damaged.
        """
        llvm, _, width = _host()
        self.dtype, self.width = dtype, width * 8 // dtype.itemsize
        self.program = program
        empty = llvm.parse_assembly("")
        self.engine = llvm.create_mcjit_compiler(empty, machine())
        self.engine.add_object_file(llvm.ObjectFileRef.from_data(code))
        self.engine.finalize_object()
        self.address = self.engine.get_function_address(ENTRY)
        if not self.address:
            raise RuntimeError("the compiled code has no entry point")
        self.function = ctypes.CFUNCTYPE(ctypes.c_int64, *[ctypes.c_void_p] * 3, ctypes.c_int64)(self.address)

    def bind(
        self, inputs: Sequence[Array], outputs: Sequence[Array], weights: Array | None = None
    ) -> Callable[[], bool]:
        """Return a function that runs the program on given arrays, and returns False if any sample is in doubt.

        Args:
            inputs, outputs: Arrays in the order of the program, with contiguous rows. Shape (m, n) each.
            weights: A sample is in doubt if the sum of its checks times these weights exceeds 1, or if an output is not
                finite; by default, checks are ignored.
        """
        n = inputs[0].shape[1]
        if n < self.width:
            return self._pad(inputs, outputs, weights)
        weights = np.zeros(self.program.checks) if weights is None else weights
        limits = np.ascontiguousarray(weights, self.dtype)
        tables = rows(inputs), rows(outputs), limits
        function, arguments = self.function, [*(ctypes.c_void_p(x.ctypes.data) for x in tables), ctypes.c_int64(n)]

        def run(_kept: Any = (self, tables, inputs, outputs)) -> bool:
            return not function(*arguments)

        return run

    def _pad(self, inputs: Sequence[Array], outputs: Sequence[Array], weights: Array | None) -> Callable[[], bool]:
        """Pad samples to a full register by repeating the last sample."""
        given, results = (
            [np.empty((len(block), self.width), self.dtype) for block in blocks] for blocks in (inputs, outputs)
        )
        inner = self.bind(given, results, weights)

        def run() -> bool:
            for block, padded in zip(inputs, given, strict=True):
                padded[:, : block.shape[1]], padded[:, block.shape[1] :] = block, block[:, -1:]
            clear = inner()
            for block, padded in zip(outputs, results, strict=True):
                block[:] = padded[:, : block.shape[1]]
            return clear

        return run

    def copy(self) -> Native:
        """Return a runner that may run concurrently, which is this object itself."""
        return self


def rows(blocks: Sequence[Array]) -> NDArray[np.int64]:
    """Return the address of the first element of each row."""
    return np.concatenate([block.ctypes.data + block.strides[0] * np.arange(len(block)) for block in blocks])
