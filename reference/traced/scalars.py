"""Runs a program as Python code on one sample at a time: for single states, where arrays cost more than they save."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

from screwgauge.reference.rotations import Array
from screwgauge.reference.traced.program import Operand, Program

_SIGNS = {"add": "+", "sub": "-", "mul": "*", "div": "/"}


class Scalars:
    """A program as a function of floats. NaN where an operation has no result."""

    width = 1

    def __init__(self, program: Program) -> None:
        self.program = program
        names: dict[str, Any] = {name: getattr(math, name) for name in ("sin", "cos", "sqrt", "atan2")}
        exec(compile(_source(program), "<program>", "exec"), names)  # noqa: S102  of numbers and names of ours
        self.function: Callable[..., tuple[float, ...]] = names["sample"]

    def bind(self, inputs: Sequence[Array], outputs: Sequence[Array]) -> Callable[[], None]:
        """What runs all samples of some arrays, again and again. Shapes (m, n) each, in the order of the program."""

        def run() -> None:
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

        return run

    def again(self) -> Scalars:
        """One that may run at the same time: itself."""
        return self


def _source(program: Program) -> str:
    def shown(x: Operand) -> str:
        return repr(x) if isinstance(x, float) else f"v{x}"

    lines = [f"def sample({', '.join(f'v{i}' for i in range(program.inputs))}):"]
    for i, (op, args) in enumerate(program.code, program.inputs):
        operands = [*map(shown, args)]
        if op in _SIGNS:
            right = _SIGNS[op].join(operands)
        else:
            right = f"-{operands[0]}" if op == "neg" else f"{op}({', '.join(operands)})"
        lines.append(f" v{i}={right}")
    lines.append(f" return ({', '.join(map(shown, program.outputs))},)")
    return "\n".join(lines)
