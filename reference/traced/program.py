"""A straight-line program: what is wanted of a trace, in order, with nothing that does not count."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

from screwgauge.reference.traced.trace import Node, Scalar

Operand = int | float
"""Number of a value, inputs first and then one an instruction, or a constant."""


@dataclass(frozen=True, slots=True)
class Program:
    """Instructions on samples, all alike.

    Attributes:
        inputs: How many numbers a sample has.
        code: (operation, operands); instruction number i makes value ``inputs + i``.
        outputs: Values handed out.
        checks: How many of them, the last, say whether the sample is in doubt.
    """

    inputs: int
    code: tuple[tuple[str, tuple[Operand, ...]], ...]
    outputs: tuple[Operand, ...]
    checks: int = 0

    def formulas(self, shown: Callable[[Operand], str]) -> Iterator[tuple[int, str]]:
        """Each value and its formula, which C and Python read alike. `shown`: how an operand is written."""
        signs = {"add": "+", "sub": "-", "mul": "*", "div": "/"}
        for i, (op, args) in enumerate(self.code, self.inputs):
            first, *rest = map(shown, args)
            if op in signs:
                yield i, f"{first} {signs[op]} {rest[0]}"
            else:
                yield i, f"-{first}" if op == "neg" else f"{op}({', '.join([first, *rest])})"

    def as_c(self, name: str = "sample") -> str:
        """The program as C, for reading."""

        def shown(x: Operand) -> str:
            if isinstance(x, float):
                return repr(x)
            return f"x[{x}]" if x < self.inputs else f"v{x}"

        lines = [f"void {name}(const double *x, double *out)", "{"]
        lines += [f"    double v{i} = {formula};" for i, formula in self.formulas(shown)]
        lines += [f"    out[{i}] = {shown(x)};" for i, x in enumerate(self.outputs)]
        return "\n".join([*lines, "}", ""])


def program(inputs: int, outputs: Sequence[Scalar], checks: int = 0, first: Sequence[Scalar] = ()) -> Program:
    """What these outputs need of their trace; operands come shortly before they are used.

    Args:
        first: What is computed before all others, in this order.
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


def only(program: Program, outputs: Sequence[int]) -> Program:
    """The same program with some of its outputs, without what does not count for these; its checks are the last."""
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
