"""Machine code that takes whole steps: the size of each follows the error of the one before.

See Hairer, Norsett and Wanner, Solving Ordinary Differential Equations I, 1993, sections II.4 and II.10.
"""

from __future__ import annotations

import ctypes
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from screwgauge.reference.rotations import Array
from screwgauge.reference.traced import native
from screwgauge.reference.traced.stages import ENTRY, Buffers, Limits, StageCode

WALK = "walk"
#: How the size of a step follows its error: section II.4.
SHRINK, GROW, SAFETY = 0.2, 10.0, 0.9
#: Steps that one call takes at most, and what is in `Buffers.control`.
STEPS = 256
T, SIZE, LAST, TAKEN, TRIED, MOST, RTOL, ATOL, END, UNTIL = range(10)


class Stages:
    """The compiled loops over stages and steps."""

    def __init__(self, close: native.Native, respond: native.Native, buffers: Buffers, limits: Limits) -> None:
        import llvmlite.binding as llvm

        d, k = buffers.K.shape
        self.kept = [close, respond, buffers]
        closing = self._call(close, [buffers.given[: d + k]], [buffers.step])
        code = _StepCode(buffers, limits, closing, self._call(respond, [buffers.given], [buffers.answer]))
        self.engine = llvm.create_mcjit_compiler(llvm.parse_assembly(str(code.module)), native.machine())
        self.engine.finalize_object()
        number, count = ctypes.c_double, ctypes.c_int64
        #: (t, h, first, last) -> whether these stages of a step h from t are beyond doubt.
        self.run = ctypes.CFUNCTYPE(count, number, number, count, count)(self.engine.get_function_address(ENTRY))
        #: () -> whether steps led past a time or filled the log; otherwise the next one is not for this code.
        self.walk = ctypes.CFUNCTYPE(count)(self.engine.get_function_address(WALK))

    def _call(self, program: native.Native, inputs: Sequence[Array], outputs: Sequence[Array]) -> list[int]:
        """Address of a program's code, and its arguments."""
        tables = native.rows(inputs), native.rows(outputs), np.zeros(program.program.checks + 1)
        self.kept += tables
        return [program.address, *(table.ctypes.data for table in tables), program.width]


class _StepCode(StageCode):
    """Writes the loop over steps, too."""

    def __init__(self, buffers: Buffers, limits: Limits, close: list[int], respond: list[int]) -> None:
        super().__init__(buffers, limits, close, respond)
        self.begin(WALK)
        self.place |= {name: self.b.alloca(self.number) for name in ("three", "five")}
        self.walk()

    def walk(self) -> None:
        """Steps of adaptive size."""
        b, control, last = self.b, self.buffers.control, len(self.buffers.slopes) - 1
        body = self.function.append_basic_block()
        b.branch(body)
        b.position_at_end(body)
        t, h, end = (self.get(control, i) for i in (T, SIZE, END))
        goal = self._least(b.fadd(t, h), end)
        h = b.fsub(goal, t)
        self.unless(b.fcmp_ordered(">", b.fadd(t, b.fmul(self.real(0.1), h)), t))
        self.unless(b.icmp_signed("!=", b.call(self.stages, [t, h, self.whole(1), self.whole(last)]), self.whole(0)))
        error = self._error(h)
        factor = b.fdiv(self.real(SAFETY), self.root(self.root(self.root(error))))
        with b.if_else(b.fcmp_ordered("<", error, self.real(1.0))) as (fine, rejected):
            with fine:
                count = b.fadd(self.get(control, TAKEN), self.real(1.0))
                self._log(goal)
                size = b.fmul(h, self._least(factor, self.get(control, MOST)))
                self._set({T: goal, LAST: h, SIZE: size, TAKEN: count, MOST: GROW})
                past = b.fcmp_ordered(">=", goal, self.get(control, UNTIL))
                with b.if_then(b.or_(past, b.fcmp_ordered(">=", count, self.real(STEPS)))):
                    b.ret(self.whole(1))
                self._copy(self.buffers.new, self.buffers.state)
                self._copy(self.buffers.slopes[last], self.buffers.slopes[0])
                self._copy(self.buffers.pose, self.buffers.start)
            with rejected:
                shrunk = b.select(b.fcmp_ordered(">", factor, self.real(SHRINK)), factor, self.real(SHRINK))
                self._set({SIZE: b.fmul(h, shrunk), MOST: 1.0})
                self._copy(self.buffers.start, self.buffers.pose)
        b.branch(body)

    def _least(self, x: Any, y: Any) -> Any:
        return self.b.select(self.b.fcmp_ordered("<", x, y), x, y)

    def _set(self, values: Mapping[int, Any]) -> None:
        for i, x in values.items():
            self.b.store(self.real(x) if isinstance(x, float) else x, self.at(self.buffers.control, i))

    def _copy(self, source: Array, target: Array) -> None:
        with self.loop(self.whole(0), self.whole(source.size)) as i:
            self.b.store(self.get(source, i), self.at(target, i))

    def _error(self, h: Any) -> Any:
        """Where the step leads, and its error over what is tolerated: section II.10 of the edition of 1993."""
        b, buffers, (n, m) = self.b, self.buffers, self.buffers.slopes.shape
        rtol, atol = self.get(buffers.control, RTOL), self.get(buffers.control, ATOL)
        self._set({TRIED: b.fadd(self.get(buffers.control, TRIED), self.real(1.0))})
        for name in ("three", "five"):
            b.store(self.real(0.0), self.place[name])
        size = self.module.declare_intrinsic("llvm.fabs", [self.number])
        with self.loop(self.whole(0), self.whole(m)) as i:
            old = self.get(buffers.state, i)
            new = b.fadd(old, b.fmul(h, self.weighed(buffers.A, self.whole(n - 1), i, self.whole(n))))
            b.store(new, self.at(buffers.new, i))
            old, new = b.call(size, [old]), b.call(size, [new])
            scale = b.fadd(atol, b.fmul(rtol, b.select(b.fcmp_ordered(">", old, new), old, new)))
            for row, name in enumerate(("three", "five")):
                share = b.fdiv(self.weighed(buffers.E, self.whole(row), i, self.whole(n)), scale)
                self.increase(name, b.fmul(share, share))
        five = b.load(self.place["five"])
        both = b.fadd(five, b.fmul(self.real(0.01), b.load(self.place["three"])))
        error = b.fdiv(b.fmul(h, five), self.root(b.fmul(both, self.real(float(m)))))
        return b.select(b.fcmp_ordered("==", both, self.real(0.0)), self.real(0.0), error)

    def _log(self, t: Any) -> None:
        """Keeps the end of a step."""
        b, buffers = self.b, self.buffers
        place = b.mul(b.fptosi(self.get(buffers.control, TAKEN), self.i64), self.whole(buffers.log.shape[1]))
        b.store(t, self.at(buffers.log, place))
        for source, offset in ((buffers.new, 1), (buffers.q, 1 + buffers.new.size)):
            with self.loop(self.whole(0), self.whole(source.size)) as i:
                b.store(self.get(source, i), self.at(buffers.log, b.add(place, b.add(i, self.whole(offset)))))
