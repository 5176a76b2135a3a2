"""Machine code of programs by llvmlite, a vector of samples at a time, with vectorised sine, cosine and arctangent.

Sine and cosine reduce their angle by multiples of pi/2 given to 159 bits, so that no digit is lost up to `FARTHEST`;
beyond they are NaN, which the per-sample checks detect.
"""

from __future__ import annotations

import ctypes
import math
from collections import deque
from collections.abc import Callable, Sequence
from functools import cache
from itertools import islice
from typing import Any

import numpy as np
from numpy.typing import NDArray

from screwgauge.reference.rotations import Array
from screwgauge.reference.traced.program import Operand, Program

FARTHEST = 1e6  # [rad]
#: pi/2 as a sum of doubles.
HALF_PI = (1.5707963267948966, 6.123233995736766e-17, -1.4973849048591833e-33)
FLOAT, FLOAT32 = np.dtype(float), np.dtype(np.float32)
#: Arcs up to pi/8 are summed up; longer ones are counted from pi/4.
EIGHTH = math.tan(math.pi / 8.0)
_SINE = [(-1.0) ** k / math.factorial(2 * k + 1) for k in range(1, 9)]
_COSINE = [(-1.0) ** k / math.factorial(2 * k) for k in range(2, 10)]


def _arc_coefficients(count: int = 11) -> list[float]:
    """Coefficients of ``(arctan(t) / t - 1) / t^2`` as a polynomial in ``u = t^2``, by interpolation up to pi/8."""
    nodes = (1.0 + np.cos(np.pi * (np.arange(count) + 0.5) / count)) * (0.5 * 1.02 * EIGHTH**2)
    u = nodes.astype(np.longdouble)
    series = sum((np.longdouble((-1.0) ** k) / (2 * k + 1) * u ** (k - 1) for k in range(40, 0, -1)), u * 0)
    coefficients = np.zeros(0, dtype=np.longdouble)
    basis = np.ones(1, dtype=np.longdouble)
    for k in range(count):  # Newton's divided differences, in wide numbers
        value = series[k] - np.polynomial.polynomial.polyval(u[k], coefficients) if k else series[0]
        weight = value / np.polynomial.polynomial.polyval(u[k], basis)
        coefficients = np.polynomial.polynomial.polyadd(coefficients, weight * basis) if k else weight * basis
        basis = np.polynomial.polynomial.polymul(basis, np.array([-u[k], 1], dtype=np.longdouble))
    return [float(c) for c in coefficients]


def _half_pi(dtype: np.dtype[Any]) -> tuple[float, float, float]:
    """pi/2 as a sum of numbers of a type."""
    if dtype == FLOAT:
        return HALF_PI
    first = float(np.float32(HALF_PI[0]))
    second = float(np.float32(HALF_PI[0] - first + HALF_PI[1]))
    return first, second, float(np.float32(HALF_PI[0] - first - second + HALF_PI[1]))


class VectorMath:
    """Emits operations on vectors of numbers into a block.

    Args:
        module, builder: llvmlite's.
        width: Numbers in a vector.
        inline: Whether sines and angles are written out wherever they occur; a call costs all registers.
        dtype: float64 or float32.
    """

    def __init__(
        self, module: Any, builder: Any, width: int, *, inline: bool = True, dtype: np.dtype[Any] = FLOAT
    ) -> None:
        from llvmlite import ir

        self.ir, self.module, self.b, self.width, self.inline = ir, module, builder, width, inline
        self.bits, self.half_pi = 8 * dtype.itemsize, _half_pi(dtype)
        self.vector = ir.VectorType(number_of(ir, dtype), width)
        self.mask = ir.VectorType(ir.IntType(self.bits), width)
        self.pairs: dict[Any, tuple[Any, Any]] = {}
        self.functions: dict[str, Any] = {}

    def constant(self, x: float) -> Any:
        return self.ir.Constant(self.vector, [x] * self.width)

    def spread(self, x: Any) -> Any:
        """A number in all places."""
        one = self.b.insert_element(self.ir.Constant(self.vector, self.ir.Undefined), x, self.ir.IntType(32)(0))
        places = self.ir.Constant(self.ir.VectorType(self.ir.IntType(32), self.width), [0] * self.width)
        return self.b.shuffle_vector(one, one, places)

    def intrinsic(self, name: str, *x: Any) -> Any:
        kind = self.ir.FunctionType(self.vector, [self.vector] * len(x))
        full = f"llvm.{name}.v{self.width}f{self.bits}"
        known = self.module.globals.get(full) or self.ir.Function(self.module, kind, full)
        return self.b.call(known, x)

    def fetch(self, place: Any) -> None:
        """Asks for the line of the cache at a place, to be written to soon."""
        byte, i32 = self.ir.IntType(8).as_pointer(), self.ir.IntType(32)
        kind = self.ir.FunctionType(self.ir.VoidType(), [byte, i32, i32, i32])
        prefetch = self.module.declare_intrinsic("llvm.prefetch", [byte], kind)
        self.b.call(prefetch, [self.b.bitcast(place, byte), i32(1), i32(3), i32(1)])

    def operation(self, op: str, x: list[Any]) -> Any:
        """One instruction of a program. Products may be fused with sums; nothing is reordered."""
        flags = ["contract"]
        if op in ("add", "sub", "mul", "div"):
            return getattr(self.b, f"f{op}")(*x, flags=flags)
        if op == "neg":
            return self.b.fneg(*x)
        if op == "sqrt":
            return self.intrinsic("sqrt", *x)
        if op == "max":
            return self.b.select(self.b.fcmp_unordered("<=", *x), x[1], x[0])
        if op == "atan2":
            return self._angle(*x) if self.inline else self.called("atan2", x, self._angle)
        if x[0] not in self.pairs:
            if self.inline:
                self.pairs[x[0]] = self._sine_and_cosine(*x)
            else:
                both = self.called("sincos", x, self._sine_and_cosine)
                self.pairs[x[0]] = (self.b.extract_value(both, 0), self.b.extract_value(both, 1))
        return self.pairs[x[0]][op == "cos"]

    def called(self, name: str, x: list[Any], emit: Any) -> Any:
        """A call of a function of this module, which is written when it is first called."""
        if name not in self.functions:
            ir, outer = self.ir, self.b
            result = ir.LiteralStructType([self.vector] * 2) if name == "sincos" else self.vector
            function = ir.Function(self.module, ir.FunctionType(result, [self.vector] * len(x)), name)
            function.linkage = "internal"
            function.attributes.add("noinline")
            self.b = ir.IRBuilder(function.append_basic_block())
            value = emit(*function.args)
            if isinstance(value, tuple):
                both = ir.Constant(result, ir.Undefined)
                for i, part in enumerate(value):
                    both = self.b.insert_value(both, part, i)
                value = both
            self.b.ret(value)
            self.b, self.functions[name] = outer, function
        return self.b.call(self.functions[name], x)

    def fma(self, a: Any, b: Any, c: Any) -> Any:
        return self.intrinsic("fma", a, b, c)

    def polynomial(self, coefficients: list[float], x: Any) -> Any:
        """Horner's scheme."""
        total = self.constant(coefficients[-1])
        for c in reversed(coefficients[:-1]):
            total = self.fma(total, x, self.constant(c))
        return total

    def _sine_and_cosine(self, x: Any) -> tuple[Any, Any]:
        b, one = self.b, self.constant(1.0)
        turns = self.intrinsic("rint", b.fmul(x, self.constant(2.0 / math.pi)))
        back = b.fneg(turns)
        high, middle, rest = (self.constant(part) for part in self.half_pi)
        first = self.fma(back, high, x)  # exact
        r = self.fma(back, middle, first)
        low = self.fma(back, rest, self.fma(back, middle, b.fsub(first, r)))
        u = b.fmul(r, r)
        flat = self.fma(u, self.constant(-0.5), one)  # slope of the sine, to the few digits that its correction needs
        sine = b.fadd(r, self.fma(b.fmul(u, r), self.polynomial(_SINE, u), b.fmul(low, flat)))
        half = b.fmul(u, self.constant(0.5))
        top = b.fsub(one, half)
        slip = b.fsub(b.fsub(one, top), half)  # what rounding took from it
        cosine = b.fadd(top, b.fadd(slip, b.fsub(b.fmul(b.fmul(u, u), self.polynomial(_COSINE, u)), b.fmul(r, low))))
        quarter = b.fptosi(turns, self.mask)
        whole = [self.ir.Constant(self.mask, [k] * self.width) for k in (0, 1, 2)]
        odd = b.icmp_signed("!=", b.and_(quarter, whole[1]), whole[0])
        near = b.fcmp_ordered("<=", self.intrinsic("fabs", x), self.constant(FARTHEST))
        lost = self.constant(math.nan)
        results = []
        for a, c, count in ((sine, cosine, quarter), (cosine, sine, b.add(quarter, whole[1]))):
            chosen = b.select(odd, c, a)
            below = b.icmp_signed("!=", b.and_(count, whole[2]), whole[0])
            results.append(b.select(near, b.select(below, b.fneg(chosen), chosen), lost))
        return results[0], results[1]

    def _angle(self, y: Any, x: Any) -> Any:
        b = self.b
        high, wide = self.intrinsic("fabs", y), self.intrinsic("fabs", x)
        steep = b.fcmp_ordered(">", high, wide)
        most, least = b.select(steep, high, wide), b.select(steep, wide, high)
        far = b.fcmp_ordered(">", least, b.fmul(most, self.constant(EIGHTH)))
        over = b.select(far, b.fsub(least, most), least)
        t = b.fdiv(over, b.select(far, b.fadd(least, most), most))
        u = b.fmul(t, t)
        arc = self.fma(b.fmul(t, u), self.polynomial(_arc_coefficients(), u), t)
        zero, quarter, half = (self.constant(k * HALF_PI[0]) for k in (0.0, 0.5, 1.0))
        arc = b.fadd(b.select(far, quarter, zero), arc)
        arc = b.select(steep, b.fsub(half, arc), arc)
        behind = b.fcmp_ordered("<", x, zero)
        arc = b.select(behind, b.fsub(self.constant(2.0 * HALF_PI[0]), arc), arc)
        return self.intrinsic("copysign", arc, y)


ENTRY = "samples"
#: Programs of fewer operations hold sines and angles in line; a call costs all registers.
SMALL = 6000
#: Cache lines prefetched before they are written to: a line that is not there yet holds up all others.
AHEAD = 40


def number_of(ir: Any, dtype: np.dtype[Any]) -> Any:
    """The type that LLVM has for numbers."""
    return ir.DoubleType() if dtype == FLOAT else ir.FloatType()


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


def _ir(program: Program, width: int, dtype: np.dtype[Any]) -> str:
    """The program for LLVM: ``doubt = samples(inputs, outputs, weights, count)``, see `Native.bind`.

    One block of samples is a function without loop, so that constants stay in memory instead of taking registers, and
    its stack keeps to whole lines of the cache.
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
    """The program, each output stored as soon as it is there. Returns checks, and 0, or NaN if values are infinite."""
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


def machine_code(program: Program, dtype: np.dtype[Any] = FLOAT) -> bytes:
    """Object code of a program for this CPU, whose numbers are of a type.

    The program is simplified already: LLVM's own passes would double the time and gain nothing.
    """
    llvm, _, width = _host()
    return bytes(machine().emit_object(llvm.parse_assembly(_ir(program, width * 8 // dtype.itemsize, dtype))))


def machine() -> Any:
    """The target machine: this CPU."""
    llvm, _, width = _host()
    features = llvm.get_host_cpu_features().flatten() + (",-prefer-256-bit" if width == 8 else "")
    target = llvm.Target.from_default_triple()
    return target.create_target_machine(cpu=llvm.get_host_cpu_name(), features=features, opt=1, jit=True)


class Native:
    """Machine code with its entry. Any number of threads may run it at once."""

    def __init__(self, program: Program, code: bytes, dtype: np.dtype[Any] = FLOAT) -> None:
        """Loads object code, whose numbers are of a type.

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
            raise RuntimeError("the code has no entry")
        self.function = ctypes.CFUNCTYPE(ctypes.c_int64, *[ctypes.c_void_p] * 3, ctypes.c_int64)(self.address)

    def bind(
        self, inputs: Sequence[Array], outputs: Sequence[Array], weights: Array | None = None
    ) -> Callable[[], bool]:
        """A function that runs all samples of some arrays, and returns whether none of them is in doubt.

        Args:
            inputs, outputs: Shapes (m, n) each, in the order of the program; a row's numbers lie side by side.
            weights: A sample is in doubt whose checks, times these, add up to more than 1, or of which an output is
                not finite; none is by default.
        """
        n = inputs[0].shape[1]
        if n < self.width:
            return self._padded(inputs, outputs, weights)
        weights = np.zeros(self.program.checks) if weights is None else weights
        limits = np.ascontiguousarray(weights, self.dtype)
        tables = rows(inputs), rows(outputs), limits
        function, arguments = self.function, [*(ctypes.c_void_p(x.ctypes.data) for x in tables), ctypes.c_int64(n)]

        def run(_kept: Any = (self, tables, inputs, outputs)) -> bool:
            return not function(*arguments)

        return run

    def _padded(self, inputs: Sequence[Array], outputs: Sequence[Array], weights: Array | None) -> Callable[[], bool]:
        """Fewer samples than a register holds: the last one fills it."""
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

    def again(self) -> Native:
        """A runner that may run at the same time: itself."""
        return self


def rows(blocks: Sequence[Array]) -> NDArray[np.int64]:
    """Addresses at which each row begins."""
    return np.concatenate([block.ctypes.data + block.strides[0] * np.arange(len(block)) for block in blocks])
