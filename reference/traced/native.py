"""Makes machine code of a program with llvmlite: as many samples at a time as a vector register of the CPU holds."""

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
from screwgauge.reference.traced.vectormath import VectorMath

ENTRY = "samples"
#: Programs of fewer operations hold sines and angles in line; a call costs all registers.
SMALL = 6000
#: Lines of the cache that are asked for before they are written to: a line that is not there yet holds up all others.
AHEAD = 40


@cache
def _host() -> tuple[Any, str, int]:
    """llvmlite's binding, the CPU with its features, and numbers in a vector register.

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
    """The compiler, and name and features of this CPU: what machine code is made by and for."""
    return _host()[1]


def _ir(program: Program, width: int) -> str:
    """The program for LLVM: ``doubt = samples(inputs, outputs, weights, count)``, see `Native.bind`.

    One block of samples is a function without loop, so that constants stay in memory instead of taking registers, and
    its stack keeps to whole lines of the cache.
    """
    import llvmlite.ir as ir

    module, i64 = ir.Module("screwgauge"), ir.IntType(64)
    pointer = ir.DoubleType().as_pointer()
    table = pointer.as_pointer()
    block = ir.Function(module, ir.FunctionType(i64, [table, table, pointer, i64]), "block")
    block.linkage, block.attributes.alignstack = "internal", 64
    block.attributes.add("noinline")
    source, target, weights, offset = block.args
    b = ir.IRBuilder(block.append_basic_block())
    maths = VectorMath(module, b, width, inline=len(program.code) < SMALL)
    outputs, total = _statements(maths, program, source, target, offset), maths.constant(0.0)
    for i, x in enumerate(outputs[len(outputs) - program.checks :]):
        total = maths.fma(x, maths.spread(b.load(b.gep(weights, [ir.Constant(i64, i)]))), total)
    doubt = b.bitcast(b.fcmp_unordered(">", total, maths.constant(1.0)), ir.IntType(width))
    b.ret(b.zext(doubt, i64))
    _loop(ir, module, block, width)
    return str(module)


def _statements(maths: VectorMath, program: Program, source: Any, target: Any, offset: Any) -> list[Any]:
    """The program, each output stored as soon as it is there. Returns the outputs."""
    b, i64 = maths.b, maths.ir.IntType(64)

    def place(rows: Any, row: int) -> Any:
        start = b.load(b.gep(rows, [maths.ir.Constant(i64, row)]))
        return b.bitcast(b.gep(start, [offset]), maths.vector.as_pointer())

    values = {i: b.load(place(source, i), align=8) for i in range(program.inputs)}

    def operand(x: Operand) -> Any:
        return values[x] if isinstance(x, int) else maths.constant(x)

    made = [x if isinstance(x, int) else 0 for x in program.outputs]
    waiting = deque(sorted(range(len(made)), key=made.__getitem__))
    coming = (place(target, row) for row in [*waiting])

    def fetch(count: int) -> None:
        for line in islice(coming, count):
            maths.fetch(line)

    def store(value: int) -> None:
        while waiting and made[waiting[0]] <= value:
            row = waiting.popleft()
            fetch(1)
            b.store(operand(program.outputs[row]), place(target, row), align=8)

    fetch(AHEAD)
    store(program.inputs - 1)
    for i, (op, args) in enumerate(program.code, program.inputs):
        values[i] = maths.operation(op, [operand(x) for x in args])
        store(i)
    return [operand(x) for x in program.outputs]


def _loop(ir: Any, module: Any, block: Any, width: int) -> None:
    """All blocks one after the other; the last ends with the last sample and may repeat some of those before."""
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


def machine_code(program: Program) -> bytes:
    """Object code of a program for this CPU.

    The program is simplified already: LLVM's own passes would double the time and gain nothing.
    """
    llvm, _, width = _host()
    return bytes(machine().emit_object(llvm.parse_assembly(_ir(program, width))))


def machine() -> Any:
    """What compiles for this CPU."""
    llvm, _, width = _host()
    features = llvm.get_host_cpu_features().flatten() + (",-prefer-256-bit" if width == 8 else "")
    target = llvm.Target.from_default_triple()
    return target.create_target_machine(cpu=llvm.get_host_cpu_name(), features=features, opt=1, jit=True)


class Native:
    """Machine code with its entry. Any number of threads may run it at once."""

    def __init__(self, program: Program, code: bytes) -> None:
        """Loads object code.

        Raises:
            RuntimeError: The code is damaged.
        """
        llvm, _, self.width = _host()
        self.program = program
        empty = llvm.parse_assembly("")
        self.engine = llvm.create_mcjit_compiler(empty, machine())
        self.engine.add_object_file(llvm.ObjectFileRef.from_data(code))
        self.engine.finalize_object()
        self.address = self.engine.get_function_address(ENTRY)
        if not self.address:
            raise RuntimeError("the code has no entry")
        self.function = ctypes.CFUNCTYPE(ctypes.c_int64, *[ctypes.c_void_p] * 3, ctypes.c_int64)(self.address)

    def bind(
        self, inputs: Sequence[Array], outputs: Sequence[Array], weights: Array | None = None
    ) -> Callable[[], bool]:
        """What runs all samples of some arrays, again and again, and says whether none of them is in doubt.

        Args:
            inputs, outputs: Shapes (m, n) each, in the order of the program; a row's numbers lie side by side.
            weights: A sample is in doubt whose checks, times these, add up to more than 1; none is by default.
        """
        n = inputs[0].shape[1]
        if n < self.width:
            return self._padded(inputs, outputs, weights)
        limits = np.zeros(self.program.checks) if weights is None else np.ascontiguousarray(weights)
        tables = rows(inputs), rows(outputs), limits
        function, arguments = self.function, [*(ctypes.c_void_p(x.ctypes.data) for x in tables), ctypes.c_int64(n)]

        def run(_kept: Any = (self, tables, inputs, outputs)) -> bool:
            return not function(*arguments)

        return run

    def _padded(self, inputs: Sequence[Array], outputs: Sequence[Array], weights: Array | None) -> Callable[[], bool]:
        """Fewer samples than a register holds: the last one fills it."""
        given, found = ([np.empty((len(block), self.width)) for block in blocks] for blocks in (inputs, outputs))
        inner = self.bind(given, found, weights)

        def run() -> bool:
            for block, padded in zip(inputs, given, strict=True):
                padded[:, : block.shape[1]], padded[:, block.shape[1] :] = block, block[:, -1:]
            clear = inner()
            for block, padded in zip(outputs, found, strict=True):
                block[:] = padded[:, : block.shape[1]]
            return clear

        return run

    def again(self) -> Native:
        """One that may run at the same time: itself."""
        return self


def rows(blocks: Sequence[Array]) -> NDArray[np.int64]:
    """Where each row begins."""
    return np.concatenate([block.ctypes.data + block.strides[0] * np.arange(len(block)) for block in blocks])
