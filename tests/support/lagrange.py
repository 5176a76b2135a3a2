"""Lagrange's equations by other ways: energies, and plain arrays in place of a trace that folds."""

from __future__ import annotations

from typing import Any

import numpy as np

from screwgauge.engines import lagrange
from screwgauge.reference.applied import Applied
from screwgauge.reference.mechanism import Mechanism
from screwgauge.reference.rotations import Array
from screwgauge.reference.traced.derivatives import adjoints, substitute, tangents
from screwgauge.reference.traced.function import Function
from screwgauge.reference.traced.trace import Node, Scalar, Trace


class Equations(lagrange.Equations):
    """The equations of the engine."""

    @classmethod
    def of(cls, mechanism: Mechanism, applied: Applied | None = None, trace: Trace | None = None) -> Equations:
        return cls(mechanism, applied or Applied(), trace or Trace(10**6))


class Unfolded(Trace):
    def _make(self, op: str, *args: Scalar) -> Node:
        self.nodes.append(node := Node(self, op, args))
        return node

    def add(self, a: Scalar, b: Scalar) -> Scalar:
        return self._make("add", a, b)

    def sub(self, a: Scalar, b: Scalar) -> Scalar:
        return self._make("sub", a, b)

    def mul(self, a: Scalar, b: Scalar) -> Scalar:
        return self._make("mul", a, b)

    def div(self, a: Scalar, b: Scalar) -> Scalar:
        return self._make("div", a, b)

    def neg(self, a: Scalar) -> Scalar:
        return self._make("neg", a)


def over_arrays(some: Equations, what: str, given: dict[str, Array]) -> dict[str, Array]:
    n, asked = len(given["q"]), dict[str, Any]()
    some.__dict__["_function"] = lambda *zero, **outputs: asked.update(outputs, zero=zero)
    getattr(some, what)
    zero = asked.pop("zero")
    known = {name: array for name, array in given.items() if name not in zero}
    arrays = {
        node: known[name][:, i] if name in known else np.zeros(n)
        for name, nodes in some.inputs.items()
        for i, node in enumerate(nodes)
    }
    return {
        name: np.reshape([np.broadcast_to(x, n) for x in substitute(numbers, arrays)], (-1, n)).T
        for name, numbers in asked.items()
    }


def by_energies(some: Equations, state: dict[str, Array]) -> Array:
    """Lagrange's equations from kinetic and potential energy of all bodies, without rotors. Shape (n, n_q)."""
    q, v, a, g = (some.inputs[name] for name in "qvag")
    rate = np.array(some.rate(some.flat), dtype=object).reshape(-1, 12)
    kinetic: Any = 0.0
    potential: Any = 0.0
    for body, position, change in zip(
        some.mechanism.bodies, np.reshape(np.array(some.flat, dtype=object), (-1, 12)), rate, strict=True
    ):
        S, Rd = 0.5 * np.trace(body.inertia) * np.eye(3) - body.inertia, change[:9].reshape(3, 3)
        kinetic = kinetic + 0.5 * body.mass * (change[9:] @ change[9:]) + 0.5 * np.trace(Rd @ S @ Rd.T)
        potential = potential - body.mass * (np.array(g) @ position[9:])
    momenta = adjoints([(kinetic, 1.0)], v)
    changes = tangents(momenta, dict(zip(q + v, v + a, strict=True)))
    forces = adjoints([(kinetic, 1.0), (potential, -1.0)], q)
    needs = [change - force for change, force in zip(changes, forces, strict=True)]
    return Function(some.inputs, {"needs": needs})(len(state["q"]), **state)["needs"]
