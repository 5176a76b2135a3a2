"""Computes derivatives of traced values in the same trace, which folds constants and shares expressions."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

from screwgauge.reference.traced.trace import OPERATIONS, Node, NotTraceableError, Scalar, apply


def tangents(outputs: Sequence[Scalar], rates: Mapping[Node, Scalar]) -> list[Scalar]:
    """Compute the rates of change of values in forward mode.

    Args:
        rates: Rate of each independently changing node, e.g. an input; all other nodes depend on these nodes or are
            constant.

    Raises:
        NotTraceableError: A value results from an operation without a derivative.
    """
    known: dict[int, Scalar] = {node.index: rate for node, rate in rates.items()}
    for node in _nodes_below(outputs, known):
        if node.index not in known and any(isinstance(x, Node) and x.index in known for x in node.args):
            parts = (slope * known[x.index] for x, slope in _slopes(node) if isinstance(x, Node) and x.index in known)
            known[node.index] = sum(parts, start=0.0)
    return [known.get(x.index, 0.0) if isinstance(x, Node) else 0.0 for x in outputs]


def adjoints(weighted: Iterable[tuple[Scalar, Scalar]], by: Sequence[Node]) -> list[Scalar]:
    """Differentiate a weighted sum with respect to given nodes, in one reverse sweep.

    Args:
        weighted: (value, weight) pairs; weights count as constants.
        by: Nodes that do not depend on each other.

    Raises:
        NotTraceableError: A value results from an operation without a derivative.
    """
    pairs = [(x, weight) for x, weight in weighted if isinstance(x, Node)]
    ends, found = {node.index for node in by}, dict[int, Scalar]()
    nodes = _nodes_below([x for x, _ in pairs], ends)
    active = set(ends)
    for node in nodes:
        if any(isinstance(x, Node) and x.index in active for x in node.args):
            active.add(node.index)
    for x, weight in pairs:
        if x.index in active:
            found[x.index] = found.get(x.index, 0.0) + weight
    for node in reversed(nodes):
        if node.index in found and node.index not in ends:
            for x, slope in _slopes(node):
                if isinstance(x, Node) and x.index in active:
                    found[x.index] = found.get(x.index, 0.0) + found[node.index] * slope
    return [found.get(node.index, 0.0) for node in by]


def substitute(outputs: Sequence[Scalar], numbers: Mapping[Node, Scalar]) -> list[Scalar]:
    """Substitute floats, sample arrays or nodes for given nodes in traced values."""
    known: dict[int, Scalar] = {node.index: number for node, number in numbers.items()}
    for node in _nodes_below(outputs, known):
        args = [known.get(x.index, x) if isinstance(x, Node) else x for x in node.args]
        if node.index not in known and any(x is not y for x, y in zip(args, node.args, strict=True)):
            known[node.index] = _compute(node.op, args)
    return [known.get(x.index, x) if isinstance(x, Node) else x for x in outputs]


def _compute(op: str, args: Sequence[Scalar]) -> Scalar:
    """Apply an operation to operands of any scalar type."""
    trace = next((x.trace for x in args if isinstance(x, Node)), None)
    if trace is None:
        return OPERATIONS[op](*args)
    return getattr(trace, op)(*args) if op in ("add", "sub", "mul", "div", "neg") else trace.function(op, *args)


def _nodes_below(outputs: Iterable[Scalar], known: Iterable[int] = ()) -> list[Node]:
    """Return the nodes on which outputs depend, in creation order, without nodes below `known`."""
    found, ends = dict[int, Node](), set(known)
    stack = [x for x in outputs if isinstance(x, Node)]
    while stack:
        node = stack.pop()
        if node.index not in found:
            found[node.index] = node
            stack += [x for x in node.args if isinstance(x, Node)] if node.index not in ends else []
    return [found[index] for index in sorted(found)]


def _slopes(node: Node) -> list[tuple[Scalar, Scalar]]:
    """Return the operands of a node, and the derivative of the node with respect to each operand.

    Raises:
        NotTraceableError: The operation of the node lacks a derivative.
    """
    a, b = (*node.args, 0.0)[:2]
    match node.op:
        case "input":
            return []
        case "add":
            return [(a, 1.0), (b, 1.0)]
        case "sub":
            return [(a, 1.0), (b, -1.0)]
        case "neg":
            return [(a, -1.0)]
        case "mul":
            return [(a, b), (b, a)]
    return _slopes_of_function(node, a, b)


def _slopes_of_function(node: Node, a: Scalar, b: Scalar) -> list[tuple[Scalar, Scalar]]:
    match node.op:
        case "div":
            inverse = 1.0 / b
            return [(a, inverse), (b, -(node * inverse))]
        case "sqrt":
            return [(a, 0.5 / node)]
        case "sin":
            return [(a, apply("cos", a))]
        case "cos":
            return [(a, -apply("sin", a))]
        case "atan2":
            inverse = 1.0 / (a * a + b * b)
            return [(a, b * inverse), (b, -(a * inverse))]
    raise NotTraceableError(f"'{node.op}' has no derivative", "tracing", "use other functions")
