"""LLVM operations on vectors of floats, including vectorised sine, cosine and arctangent.

Sine and cosine reduce their argument by multiples of pi/2, known to 159 bits, so that no digit is lost up to
`FARTHEST`; beyond that they are NaN, which the checks of each sample detect.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

FARTHEST = 1e6  # [rad]
#: pi/2 as a sum of doubles.
HALF_PI = (1.5707963267948966, 6.123233995736766e-17, -1.4973849048591833e-33)
FLOAT = np.dtype(float)
#: Largest argument of the arctangent series, for an angle of pi/8; larger angles are reduced by pi/4.
EIGHTH = math.tan(math.pi / 8.0)
_SINE = [(-1.0) ** k / math.factorial(2 * k + 1) for k in range(1, 9)]
_COSINE = [(-1.0) ** k / math.factorial(2 * k) for k in range(2, 10)]


def _arc_coefficients(count: int = 11) -> list[float]:
    """Fit coefficients of ``(arctan(t) / t - 1) / t^2`` as a polynomial in ``u = t^2``, by interpolation up to pi/8."""
    nodes = (1.0 + np.cos(np.pi * (np.arange(count) + 0.5) / count)) * (0.5 * 1.02 * EIGHTH**2)
    u = nodes.astype(np.longdouble)
    series = sum((np.longdouble((-1.0) ** k) / (2 * k + 1) * u ** (k - 1) for k in range(40, 0, -1)), u * 0)
    coefficients = np.zeros(0, dtype=np.longdouble)
    basis = np.ones(1, dtype=np.longdouble)
    for k in range(count):  # Newton's divided differences in extended precision
        value = series[k] - np.polynomial.polynomial.polyval(u[k], coefficients) if k else series[0]
        weight = value / np.polynomial.polynomial.polyval(u[k], basis)
        coefficients = np.polynomial.polynomial.polyadd(coefficients, weight * basis) if k else weight * basis
        basis = np.polynomial.polynomial.polymul(basis, np.array([-u[k], 1], dtype=np.longdouble))
    return [float(c) for c in coefficients]


def number_of(ir: Any, dtype: np.dtype[Any]) -> Any:
    """Return the LLVM type of a NumPy type."""
    return ir.DoubleType() if dtype == FLOAT else ir.FloatType()


def _half_pi(dtype: np.dtype[Any]) -> tuple[float, float, float]:
    """Return pi/2 as a sum of floats of a given type, from large to small."""
    if dtype == FLOAT:
        return HALF_PI
    first = float(np.float32(HALF_PI[0]))
    second = float(np.float32(HALF_PI[0] - first + HALF_PI[1]))
    return first, second, float(np.float32(HALF_PI[0] - first - second + HALF_PI[1]))


class VectorMath:
    """Emits operations on vectors of floats into a block.

    Args:
        module, builder: llvmlite module and builder.
        width: Number of elements of a vector.
        inline: Inline sines and arctangents, because a call spills all registers.
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
        """Broadcast a number to all elements."""
        one = self.b.insert_element(self.ir.Constant(self.vector, self.ir.Undefined), x, self.ir.IntType(32)(0))
        places = self.ir.Constant(self.ir.VectorType(self.ir.IntType(32), self.width), [0] * self.width)
        return self.b.shuffle_vector(one, one, places)

    def intrinsic(self, name: str, *x: Any) -> Any:
        kind = self.ir.FunctionType(self.vector, [self.vector] * len(x))
        full = f"llvm.{name}.v{self.width}f{self.bits}"
        known = self.module.globals.get(full) or self.ir.Function(self.module, kind, full)
        return self.b.call(known, x)

    def fetch(self, place: Any) -> None:
        """Emit a prefetch of the cache line of an address for writing."""
        byte, i32 = self.ir.IntType(8).as_pointer(), self.ir.IntType(32)
        kind = self.ir.FunctionType(self.ir.VoidType(), [byte, i32, i32, i32])
        prefetch = self.module.declare_intrinsic("llvm.prefetch", [byte], kind)
        self.b.call(prefetch, [self.b.bitcast(place, byte), i32(1), i32(3), i32(1)])

    def operation(self, op: str, x: list[Any]) -> Any:
        """Emit one instruction of a program; products may be fused with sums, without reordering."""
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
            return self._angle(*x) if self.inline else self.call("atan2", x, self._angle)
        if x[0] not in self.pairs:
            if self.inline:
                self.pairs[x[0]] = self._sine_and_cosine(*x)
            else:
                both = self.call("sincos", x, self._sine_and_cosine)
                self.pairs[x[0]] = (self.b.extract_value(both, 0), self.b.extract_value(both, 1))
        return self.pairs[x[0]][op == "cos"]

    def call(self, name: str, x: list[Any], emit: Any) -> Any:
        """Emit a call to a function of this module; emit the function on first use."""
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
        """Evaluate a polynomial with Horner's scheme."""
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
        slip = b.fsub(b.fsub(one, top), half)  # the rounding error
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
