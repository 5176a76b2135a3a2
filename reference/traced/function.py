"""Programs with named inputs and outputs, as functions of samples."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from itertools import accumulate

import numpy as np

from screwgauge.reference.rotations import Array
from screwgauge.reference.traced.program import Lanes, program
from screwgauge.reference.traced.trace import Node, Scalar

#: Number of samples processed at a time.
LANES = 1024


class Function:
    """A traced function that evaluates samples with NumPy; calls must not overlap.

    Attributes:
        operations: Number of operations per sample.
    """

    def __init__(self, inputs: Mapping[str, Sequence[Node]], outputs: Mapping[str, Sequence[Scalar]]) -> None:
        """Compile the given outputs.

        Args:
            inputs: All inputs on which outputs depend, by name.
        """
        self._rows = {name: [node.args[0] for node in nodes] for name, nodes in inputs.items()}
        self._ends = dict(zip(outputs, accumulate(map(len, outputs.values())), strict=True))
        flat = [x for numbers in outputs.values() for x in numbers]
        self._made = np.array([i for i, x in enumerate(flat) if isinstance(x, Node)], dtype=np.intp)
        self._constants = np.array([0.0 if isinstance(x, Node) else x for x in flat], dtype=float)
        self._count = 1 + max((row for rows in self._rows.values() for row in rows), default=-1)
        code = program(self._count, [flat[i] for i in self._made])
        self.operations, self._lanes = len(code.code), Lanes(code, LANES)
        self._bound: tuple[Array, Array, Callable[[], bool]] | None = None

    def __call__(self, n: int, **given: Array) -> dict[str, Array]:
        """Evaluate n samples.

        Args:
            given: Inputs by name; zero if omitted. Shape (n, m), or (m,) for all samples.

        Returns:
            Outputs by name. Shape (n, m) each.
        """
        if self._bound is None or self._bound[0].shape[1] != n:  # binding takes as long as a few samples
            inputs, made = np.empty((self._count, n)), np.empty((len(self._made), n))
            self._bound = inputs, made, self._lanes.bind([inputs], [made])
        inputs, made, run = self._bound
        inputs[:] = 0.0
        for name, values in given.items():
            inputs[self._rows[name]] = np.broadcast_to(values, (n, len(self._rows[name]))).T
        run()
        out = np.tile(self._constants, (n, 1))
        out[:, self._made] = made.T
        return dict(zip(self._ends, np.split(out, [*self._ends.values()][:-1], axis=1), strict=True))
