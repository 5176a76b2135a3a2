"""Makes machine code of a program with llvmlite: as many samples at a time as a vector register of the CPU holds."""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Sequence
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from screwgauge.reference.rotations import Array
from screwgauge.reference.traced.program import Operand, Program
from screwgauge.reference.traced.vectormath import VectorMath

ENTRY = "samples"


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
    """The program for LLVM: ``samples(inputs, outputs, count)``, the first two being pointers to rows of numbers."""
    import llvmlite.ir as ir

    module = ir.Module("screwgauge")
    number, i64 = ir.DoubleType(), ir.IntType(64)
    vector = ir.VectorType(number, width)
    pointer = number.as_pointer()
    table = pointer.as_pointer()
    function = ir.Function(module, ir.FunctionType(ir.VoidType(), [table, table, i64]), ENTRY)
    begin = ir.IRBuilder(function.append_basic_block())
    body, end = function.append_basic_block(), function.append_basic_block()
    source, target, blocks = function.args
    begin.branch(body)
    b = ir.IRBuilder(body)
    count = b.phi(i64)
    count.add_incoming(ir.Constant(i64, 0), begin.block)
    offset = b.mul(count, ir.Constant(i64, width))
    maths = VectorMath(module, b, width)

    def place(rows: Any, row: int) -> Any:
        start = b.load(b.gep(rows, [ir.Constant(i64, row)]))
        return b.bitcast(b.gep(start, [offset]), vector.as_pointer())

    values = {i: b.load(place(source, i), align=8) for i in range(program.inputs)}

    def operand(x: Operand) -> Any:
        return values[x] if isinstance(x, int) else maths.constant(x)

    stored: dict[int, list[int]] = {}
    for row, x in enumerate(program.outputs):
        if isinstance(x, int) and x >= program.inputs:
            stored.setdefault(x, []).append(row)
        else:
            b.store(operand(x), place(target, row), align=8)
    for i, (op, args) in enumerate(program.code, program.inputs):
        values[i] = maths.operation(op, [operand(x) for x in args])
        for row in stored.get(i, ()):
            b.store(values[i], place(target, row), align=8)
    following = b.add(count, ir.Constant(i64, 1))
    count.add_incoming(following, b.block)
    b.cbranch(b.icmp_unsigned("<", following, blocks), body, end)
    ir.IRBuilder(end).ret_void()
    return str(module)


def machine_code(program: Program) -> bytes:
    """Object code of a program for this CPU.

    The program is simplified already: LLVM's own passes would double the time and gain nothing.
    """
    llvm, _, width = _host()
    return bytes(_machine().emit_object(llvm.parse_assembly(_ir(program, width))))


def _machine() -> Any:
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
        self.engine = llvm.create_mcjit_compiler(empty, _machine())
        self.engine.add_object_file(llvm.ObjectFileRef.from_data(code))
        self.engine.finalize_object()
        address = self.engine.get_function_address(ENTRY)
        if not address:
            raise RuntimeError("the code has no entry")
        self.function = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_void_p, ctypes.c_int64)(address)

    def bind(self, inputs: Sequence[Array], outputs: Sequence[Array]) -> Callable[[], None]:
        """What runs all samples of some arrays, again and again: the arrays have to stay.

        Args:
            inputs, outputs: Shapes (m, n) each, in the order of the program; a row's numbers lie side by side.
        """
        n = inputs[0].shape[1]
        whole = n - n % self.width
        source, target = _rows(inputs), _rows(outputs)
        arguments = source.ctypes.data, target.ctypes.data, whole // self.width
        last = [np.empty((len(block), self.width)) for block in inputs]
        found = [np.empty((len(block), self.width)) for block in outputs]
        last_rows, found_rows = _rows(last), _rows(found)
        rest = last_rows.ctypes.data, found_rows.ctypes.data, 1

        def run() -> None:
            if whole:
                self.function(*arguments)
            if whole < n:
                for block, padded in zip(inputs, last, strict=True):
                    padded[:] = block[:, -1:]
                    padded[:, : n - whole] = block[:, whole:]
                self.function(*rest)
                for block, padded in zip(outputs, found, strict=True):
                    block[:, whole:] = padded[:, : n - whole]

        # the tables of pointers live as long as what uses them
        run.kept = source, target, last_rows, found_rows  # type: ignore[attr-defined]
        return run

    def again(self) -> Native:
        """One that may run at the same time: itself."""
        return self


def _rows(blocks: Sequence[Array]) -> NDArray[np.int64]:
    """Where each row begins."""
    return np.concatenate([block.ctypes.data + block.strides[0] * np.arange(len(block)) for block in blocks])
