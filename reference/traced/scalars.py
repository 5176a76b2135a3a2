"""Runs a program as Python code on one sample at a time: for single states, where arrays cost more than they save."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

from screwgauge.reference.rotations import Array
from screwgauge.reference.traced.program import Operand, Program


class Scalars:
    """A program as a function of floats. NaN where an operation has no result."""

    width = 1

    def __init__(self, program: Program) -> None:
        self.program = program
        names: dict[str, Any] = {name: getattr(math, name) for name in ("sin", "cos", "sqrt", "atan2")}
        exec(compile(_source(program), "<program>", "exec"), names)  # numbers and names of ours
        self.function: Callable[..., tuple[float, ...]] = names["sample"]

    def bind(
        self, inputs: Sequence[Array], outputs: Sequence[Array], weights: Array | None = None
    ) -> Callable[[], bool]:
        """As `screwgauge.reference.traced.native.Native.bind`; numbers of a row may lie apart."""
        limits = [] if weights is None else weights.tolist()

        def run() -> bool:
            clear = True
            for i in range(inputs[0].shape[1]):
                given = [x for block in inputs for x in block[:, i].tolist()]
                try:
                    found = self.function(*given)
                except (ArithmeticError, ValueError):
                    found = (math.nan,) * len(self.program.outputs)
                row = 0
                for block in outputs:
                    block[:, i] = found[row : row + len(block)]
                    row += len(block)
                checks = found[len(found) - len(limits) :]
                clear &= not limits or sum(x * y for x, y in zip(limits, checks, strict=True)) <= 1.0
            return clear

        return run

    def again(self) -> Scalars:
        """One that may run at the same time: itself."""
        return self


def _source(program: Program) -> str:
    def shown(x: Operand) -> str:
        return repr(x) if isinstance(x, float) else f"v{x}"

    lines = [f"def sample({', '.join(f'v{i}' for i in range(program.inputs))}):"]
    lines += [f" v{i} = {formula}" for i, formula in program.formulas(shown)]
    return "\n".join([*lines, f" return ({', '.join(map(shown, program.outputs))},)"])
