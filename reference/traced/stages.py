"""Machine code around the two programs of `forward`: states are predicted, closed and answered without Python.

One call answers a state, or all stages of an explicit Runge-Kutta step; see Hairer, Norsett and Wanner, Solving
Ordinary Differential Equations I, 1993, section II.1. Addresses of the buffers are written into the code.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

from screwgauge.reference.rotations import Array

ENTRY = "stages"


@dataclass(frozen=True, slots=True)
class Limits:
    """When a state is beyond doubt.

    Attributes:
        most: Steps of Newton's method.
        settled: Square of one after which the next would be rounding.
        rounding: Square of a closure residual that no step makes smaller: next to a singular pose it would only move
            the pose by that, magnified.
        residual: Square of the largest closure residual before the last step.
        bend, slack: A pose may lie as far from its prediction as this share of the way predicted, and this.
        farthest: Longest way predicted.
        condition, inertia: Largest numbers of the response, see `forward.RESPONSE`.
    """

    most: int
    settled: float
    rounding: float
    residual: float
    bend: float
    slack: float
    farthest: float
    condition: float
    inertia: float


@dataclass(frozen=True, slots=True, eq=False)
class Buffers:
    """What the programs and the code around them work on; all are C-contiguous, and only the first lane counts.

    Attributes:
        given: Inputs of the response: dependent coordinates, y, yd, time. Shape (d + 2 k + 1, width).
        step, answer: Outputs of the programs. Shapes (d + 2, width), (m, width).
        y, q, K: Where poses are predicted from: y, dependent coordinates and velocity map. Shapes (k,), (d,), (d, k).
        size: Unit of each dependent coordinate. Shape (d,).
        state: From which a step starts: y, yd and work. Shape (2 k + 1,).
        pose, start: y, q and K one after the other, and what they were when a step began. Shape (k + d + d k,).
        A, c: Tableau of the method, the end being its last stage. Shapes (s, s), (s,).
        E: Its error estimates of order 3 and 5. Shape (2, s).
        slopes: Slope at each stage. Shape (s, 2 k + 1).
        new: Where a step leads. Shape (2 k + 1,).
        control: Time, size of the next step and of the last [s], steps taken and tried, how much the next may grow,
            tolerances, time of the end, and the one after which to pause [s].
        log: Time, state and dependent coordinates after each step taken. Shape (n, 2 k + 2 + d).
    """

    given: Array
    step: Array
    answer: Array
    y: Array
    q: Array
    K: Array
    size: Array
    state: Array
    pose: Array
    start: Array
    A: Array
    c: Array
    E: Array
    slopes: Array
    new: Array
    control: Array
    log: Array


class StageCode:
    """Writes a function (t, h, first, last) -> whether these stages of a step h from t are beyond doubt."""

    def __init__(self, buffers: Buffers, limits: Limits, close: list[int], respond: list[int]) -> None:
        from llvmlite import ir

        self.ir, self.limits, self.buffers = ir, limits, buffers
        self.number, self.i64 = ir.DoubleType(), ir.IntType(64)
        self.module = ir.Module(ENTRY)
        self.stages = self.begin(ENTRY, self.number, self.number, self.i64, self.i64)
        t, h, first, last = self.stages.args
        with self.loop(first, self.b.add(last, self.whole(1))) as s:
            self._state(t, h, s)
            if len(buffers.q):
                self._predict()
                self._close(close)
            self.call(respond)
            (k,) = buffers.y.shape
            self.unless(self.b.fcmp_ordered("<=", self.lane(buffers.answer, k + 1), self.real(limits.condition)))
            self.unless(self.b.fcmp_ordered("<=", self.lane(buffers.answer, k + 2), self.real(limits.inertia)))
            self._answer(s)
        self.b.ret(self.whole(1))

    def begin(self, name: str, *arguments: Any) -> Any:
        """A function to write."""
        self.function = self.ir.Function(self.module, self.ir.FunctionType(self.i64, arguments), name)
        self.b = self.ir.IRBuilder(self.function.append_basic_block())
        self.place = {name: self.b.alloca(self.number) for name in ("sum", "far", "off")}
        return self.function

    def whole(self, x: int) -> Any:
        return self.ir.Constant(self.i64, x)

    def real(self, x: float) -> Any:
        return self.ir.Constant(self.number, x)

    def at(self, array: Array, i: Any) -> Any:
        """Address of number i of an array."""
        start = self.b.inttoptr(self.whole(array.ctypes.data), self.number.as_pointer())
        return self.b.gep(start, [i if isinstance(i, self.ir.Value) else self.whole(i)])

    def get(self, array: Array, i: Any) -> Any:
        return self.b.load(self.at(array, i))

    def row(self, array: Array, i: Any, offset: int = 0) -> Any:
        """Where the first lane of row i + offset stands."""
        i = self.whole(i) if isinstance(i, int) else i
        return self.b.mul(self.b.add(i, self.whole(offset)), self.whole(array.shape[1]))

    def lane(self, array: Array, i: Any, offset: int = 0) -> Any:
        return self.get(array, self.row(array, i, offset))

    def increase(self, name: str, x: Any) -> None:
        self.b.store(self.b.fadd(self.b.load(self.place[name]), x), self.place[name])

    def call(self, address_and_arguments: Sequence[int]) -> None:
        address, *arguments = address_and_arguments
        kind = self.ir.FunctionType(self.i64, [self.i64] * len(arguments))
        self.b.call(self.b.inttoptr(self.whole(address), kind.as_pointer()), [self.whole(x) for x in arguments])

    def unless(self, fine: Any) -> None:
        """Leaves with 0 if a condition does not hold."""
        with self.b.if_then(self.b.not_(fine)):
            self.b.ret(self.whole(0))

    @contextmanager
    def loop(self, start: Any, stop: Any) -> Iterator[Any]:
        """Counts from start to before stop."""
        head, body, after = (self.function.append_basic_block() for _ in range(3))
        before = self.b.block
        self.b.branch(head)
        self.b.position_at_end(head)
        i = self.b.phi(self.i64)
        i.add_incoming(start, before)
        self.b.cbranch(self.b.icmp_signed("<", i, stop), body, after)
        self.b.position_at_end(body)
        yield i
        i.add_incoming(self.b.add(i, self.whole(1)), self.b.block)
        self.b.branch(head)
        self.b.position_at_end(after)

    def _state(self, t: Any, h: Any, s: Any) -> None:
        """The state at a stage, its time and the slope of y."""
        b, buffers, zero = self.b, self.buffers, self.whole(0)
        d, k = buffers.K.shape
        with self.loop(zero, self.whole(2 * k)) as i:
            x = b.fadd(self.get(buffers.state, i), b.fmul(h, self.weighed(buffers.A, s, i, s)))
            b.store(x, self.at(buffers.given, self.row(buffers.given, i, d)))
        now = b.fadd(t, b.fmul(h, self.get(buffers.c, s)))
        b.store(now, self.at(buffers.given, self.row(buffers.given, d + 2 * k)))

    def weighed(self, weights: Array, row: Any, i: Any, count: Any) -> Any:
        """Sum of component i of the first slopes, times a row of weights."""
        b, (n, m) = self.b, self.buffers.slopes.shape
        b.store(self.real(0.0), self.place["sum"])
        with self.loop(self.whole(0), count) as j:
            weight = self.get(weights, b.add(b.mul(row, self.whole(n)), j))
            self.increase("sum", b.fmul(weight, self.get(self.buffers.slopes, b.add(b.mul(j, self.whole(m)), i))))
        return b.load(self.place["sum"])

    def _predict(self) -> None:
        """Dependent coordinates by the velocity map, and the length of the way there."""
        b, buffers, zero = self.b, self.buffers, self.whole(0)
        d, k = buffers.K.shape
        for name in ("far", "off"):
            b.store(self.real(0.0), self.place[name])
        with self.loop(zero, self.whole(d)) as r:
            b.store(self.real(0.0), self.place["sum"])
            with self.loop(zero, self.whole(k)) as j:
                change = b.fsub(self.lane(buffers.given, j, d), self.get(buffers.y, j))
                self.increase("sum", b.fmul(self.get(buffers.K, b.add(b.mul(r, self.whole(k)), j)), change))
            way = b.load(self.place["sum"])
            b.store(b.fadd(self.get(buffers.q, r), way), self.at(buffers.given, self.row(buffers.given, r)))
            share = b.fdiv(way, self.get(buffers.size, r))
            self.increase("far", b.fmul(share, share))

    def _close(self, close: Sequence[int]) -> None:
        """Newton's method, and whether it stayed where it was predicted."""
        b, buffers, limits = self.b, self.buffers, self.limits
        d = len(buffers.q)
        body, before = self.function.append_basic_block(), b.block
        b.branch(body)
        b.position_at_end(body)
        count = b.phi(self.i64)
        count.add_incoming(self.whole(1), before)
        self.call(close)
        moved, residual = self.lane(buffers.step, d), self.lane(buffers.step, d + 1)
        there = b.fcmp_ordered("<=", residual, self.real(limits.rounding))
        with self.loop(self.whole(0), self.whole(d)) as r:
            place, change = self.at(buffers.given, self.row(buffers.given, r)), self.lane(buffers.step, r)
            b.store(b.fadd(b.load(place), b.select(there, self.real(0.0), change)), place)
        self.increase("off", b.select(there, self.real(0.0), self.root(moved)))
        there = b.or_(there, b.fcmp_ordered("<=", moved, self.real(limits.settled)))
        count.add_incoming(b.add(count, self.whole(1)), b.block)
        after = self.function.append_basic_block()
        b.cbranch(b.or_(there, b.icmp_signed(">=", count, self.whole(limits.most))), after, body)
        b.position_at_end(after)
        self.unless(there)
        self.unless(b.fcmp_ordered("<=", residual, self.real(limits.residual)))
        far = self.root(b.load(self.place["far"]))
        allowed = b.fadd(b.fmul(self.real(limits.bend), far), self.real(limits.slack))
        self.unless(b.fcmp_ordered("<=", b.load(self.place["off"]), allowed))
        self.unless(b.fcmp_ordered("<=", far, self.real(limits.farthest)))

    def root(self, x: Any) -> Any:
        return self.b.call(self.module.declare_intrinsic("llvm.sqrt", [self.number]), [x])

    def _answer(self, s: Any) -> None:
        """The slope at the stage, and the pose that the next is predicted from."""
        b, buffers, zero = self.b, self.buffers, self.whole(0)
        (d, k), start = buffers.K.shape, b.mul(s, self.whole(buffers.slopes.shape[1]))
        with self.loop(zero, self.whole(k)) as i:
            b.store(self.lane(buffers.given, i, d + k), self.at(buffers.slopes, b.add(start, i)))
            b.store(self.lane(buffers.given, i, d), self.at(buffers.y, i))
        with self.loop(zero, self.whole(k + 1)) as i:
            b.store(self.lane(buffers.answer, i), self.at(buffers.slopes, b.add(b.add(start, i), self.whole(k))))
        with self.loop(zero, self.whole(d)) as r:
            b.store(self.lane(buffers.given, r), self.at(buffers.q, r))
        with self.loop(zero, self.whole(d * k)) as r:
            b.store(self.lane(buffers.answer, r, k + 3), self.at(buffers.K, r))
