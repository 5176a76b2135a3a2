"""Records scalar equations while they are evaluated: operator overloading, structural folding, one node an expression.

Only what the structure says is folded: zeros, ones, signs and constants. Expressions that merely agree in value are
never merged: they may agree on one assembly and differ on another.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from screwgauge.reference.errors import ScrewgaugeError
from screwgauge.reference.rotations import Array

Scalar = Any
"""A float, an array over samples, or a `Node`."""

#: Function -> what computes it on arrays.
FUNCTIONS: dict[str, Callable[..., Any]] = {
    "sqrt": np.sqrt,
    "sin": np.sin,
    "cos": np.cos,
    "atan2": np.arctan2,
    "max": np.maximum,
}
#: Operation -> what computes it on arrays.
OPERATIONS: dict[str, Callable[..., Any]] = {
    "add": np.add,
    "sub": np.subtract,
    "mul": np.multiply,
    "div": np.divide,
    "neg": np.negative,
    **FUNCTIONS,
}

#: More operations are not traced: every thousand takes some 20 ms, and a program of them is no faster than arrays.
MOST = 100_000


class NotTraceableError(ScrewgaugeError):
    """A mechanism or a question that no straight-line program is made of; the array solver answers it."""


class Node:
    """A number of a trace.

    Attributes:
        args: What it is made of, nodes and floats.
        index: Its place in the order in which nodes were made.
    """

    __slots__ = ("args", "index", "op", "trace")

    def __init__(self, trace: Trace, op: str, args: tuple[Scalar, ...]) -> None:
        self.trace, self.op, self.args, self.index = trace, op, args, len(trace.nodes)

    @property
    def value(self) -> Array:
        """Its value at the samples that the trace was made at; it chooses pivots and nothing else. Shape (n,)."""
        return self.trace.value(self.index)

    # an array on the other side works element by element, and comes back with one of its numbers

    def __add__(self, other: Scalar) -> Scalar:
        return NotImplemented if isinstance(other, np.ndarray) else self.trace.add(self, other)

    __radd__ = __add__

    def __sub__(self, other: Scalar) -> Scalar:
        return NotImplemented if isinstance(other, np.ndarray) else self.trace.sub(self, other)

    def __rsub__(self, other: Scalar) -> Scalar:
        return NotImplemented if isinstance(other, np.ndarray) else self.trace.sub(other, self)

    def __mul__(self, other: Scalar) -> Scalar:
        return NotImplemented if isinstance(other, np.ndarray) else self.trace.mul(self, other)

    __rmul__ = __mul__

    def __truediv__(self, other: Scalar) -> Scalar:
        return NotImplemented if isinstance(other, np.ndarray) else self.trace.div(self, other)

    def __rtruediv__(self, other: Scalar) -> Scalar:
        return NotImplemented if isinstance(other, np.ndarray) else self.trace.div(other, self)

    def __neg__(self) -> Scalar:
        return self.trace.neg(self)


def apply(name: str, *x: Scalar) -> Scalar:
    """A function by its name, see `FUNCTIONS`."""
    for value in x:
        if isinstance(value, Node):
            return value.trace.function(name, *x)
    found = FUNCTIONS[name](*x)
    return found if np.ndim(found) else float(found)


def _ordered(a: Scalar, b: Scalar) -> tuple[Scalar, Scalar]:
    """A number first, nodes as they were made; one at least is a node."""
    return (b, a) if not isinstance(b, Node) or (isinstance(a, Node) and b.index < a.index) else (a, b)


def _negated(x: Scalar) -> bool:
    return isinstance(x, Node) and x.op == "neg"


class Trace:
    """The graph of all that was computed from its inputs.

    Attributes:
        kept: Samples at which the pivots chosen so far are large, if others may be left to further traces. Shape (n,).
    """

    def __init__(self) -> None:
        self.kept: NDArray[np.bool_] | None = None
        self.nodes: list[Node] = []
        self.inputs: list[Array] = []
        self._values: list[Array] = []
        self._known: dict[tuple[Any, ...], Node] = {}

    def input(self, value: Array) -> Node:
        """A new input. `value`: at the samples that the trace is made at, shape (n,)."""
        self.inputs.append(np.asarray(value, dtype=float))
        return self._make("input", len(self.inputs) - 1)

    @property
    def count(self) -> int:
        """Samples that the trace is made at."""
        return len(self.inputs[0])

    def value(self, index: int) -> Array:
        """Value of a node; all before it are worked out, too."""
        with np.errstate(all="ignore"):
            for node in self.nodes[len(self._values) : index + 1]:
                operands = [self._values[x.index] if isinstance(x, Node) else x for x in node.args]
                known = self.inputs[node.args[0]] if node.op == "input" else OPERATIONS[node.op](*operands)
                self._values.append(known)
        return self._values[index]

    def _make(self, op: str, *args: Scalar) -> Node:
        key = (op, *args)
        if key not in self._known:
            if len(self.nodes) == MOST:
                raise NotTraceableError(f"it takes more than {MOST} operations", "tracing", "use backend array")
            self._known[key] = node = Node(self, op, args)
            self.nodes.append(node)
        return self._known[key]

    def function(self, name: str, *x: Scalar) -> Node:
        """One of `FUNCTIONS`."""
        return self._make(name, *x)

    def neg(self, a: Scalar) -> Scalar:
        if not isinstance(a, Node):
            return -a
        return a.args[0] if a.op == "neg" else self._make("neg", a)

    def add(self, a: Scalar, b: Scalar) -> Scalar:
        if a is b:
            return self.mul(2.0, a)
        a, b = _ordered(a, b)
        if not isinstance(a, Node) and a == 0.0:
            return b
        if _negated(b):
            return self.sub(a, b.args[0])
        return self.sub(b, a.args[0]) if _negated(a) else self._make("add", a, b)

    def sub(self, a: Scalar, b: Scalar) -> Scalar:
        if a is b:
            return 0.0
        if not isinstance(b, Node) and b == 0.0:
            return a
        if not isinstance(a, Node) and a == 0.0:
            return self.neg(b)
        if _negated(b):
            return self.add(a, b.args[0])
        if _negated(a):
            return self.neg(self.add(a.args[0], b))
        opposite = self._known.get(("sub", b, a))
        return self._make("sub", a, b) if opposite is None else self.neg(opposite)

    def mul(self, a: Scalar, b: Scalar) -> Scalar:
        a, b = _ordered(a, b)
        if _negated(b):
            return self.neg(self.mul(a, b.args[0]))
        if isinstance(a, Node):
            return self.neg(self.mul(a.args[0], b)) if a.op == "neg" else self._make("mul", a, b)
        if a <= 0.0:
            return self.neg(self.mul(-a, b)) if a else 0.0
        if a == 1.0:
            return b
        if b.op == "mul" and not isinstance(b.args[0], Node):
            return self.mul(a * b.args[0], b.args[1])
        return self._make("mul", a, b)

    def div(self, a: Scalar, b: Scalar) -> Scalar:
        if not isinstance(b, Node):
            return self.mul(1.0 / b, a)
        if not isinstance(a, Node) and a == 0.0:
            return 0.0
        if _negated(b):
            return self.neg(self.div(a, b.args[0]))
        if _negated(a):
            return self.neg(self.div(a.args[0], b))
        return self._make("div", a, b)
