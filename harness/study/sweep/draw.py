"""Draws: the numbers of each variant depend only on its index, not on when or in which process it is solved."""

from __future__ import annotations

import warnings

import numpy as np
from scipy.special import ndtri
from scipy.stats import qmc

from screwgauge.engines.screw.matter import consistent_bodies
from screwgauge.problem import Rows
from screwgauge.reference.parameters import numbers
from screwgauge.reference.rotations import Array
from screwgauge.study.sweep.plan import Plan, Scatter

#: Number of coordinates of a body that are drawn together.
BODY = 10


class Draw:
    """Random draws of a plan.

    Attributes:
        names: Full names of the varied numbers.
    """

    def __init__(self, plan: Plan) -> None:
        self.plan, known = plan, numbers(plan.scene.mechanism, plan.scene.applied)
        self.bodies = {one.name: [known[name] for name in one.numbers] for one in plan.scatter if one.kind == "body"}
        self.names = [*plan.grid, *(name for one in plan.scatter for name in one.numbers)]
        self.dimensions = sum(BODY if one.kind == "body" else 1 for one in plan.scatter)

    def values(self, rows: range) -> Array:
        """Return the values of all varied numbers in given variants. Shape (P, len(rows))."""
        place = np.arange(rows.start, rows.stop)
        sizes = [len(values) for values in self.plan.grid.values()]
        at = np.unravel_index(place // self.plan.count, sizes) if sizes else ()
        grid = [values[i] for values, i in zip(self.plan.grid.values(), at, strict=True)]
        return np.concatenate([np.reshape(grid, (-1, len(rows))), self.scatter(self._uniform(place % self.plan.count))])

    def _uniform(self, draws: Rows) -> Array:
        """Return uniform numbers in (0, 1) for given draws, the same at every grid point. Shape (dimensions, n)."""
        plan, out = self.plan, np.empty((self.dimensions, len(draws)))
        if not self.dimensions:
            return out
        starts = np.flatnonzero(np.diff(draws, prepend=draws[0] - 2) != 1)
        for first, end in zip(starts, [*starts[1:], len(draws)], strict=True):
            begin, count = int(draws[first]), end - first
            if plan.design == "sobol":
                source = qmc.Sobol(self.dimensions, rng=plan.seed)
                with warnings.catch_warnings():  # a part of a sequence is not balanced on its own
                    warnings.simplefilter("ignore", UserWarning)
                    part = (source.fast_forward(begin) if begin else source).random(count)
            else:
                bits = np.random.PCG64(plan.seed).advance(begin * self.dimensions)
                part = np.random.Generator(bits).random((count, self.dimensions))
            out[:, first:end] = part.T
        return np.clip(out, 1e-16, 1.0 - 1e-16)

    def scatter(self, uniform: Array) -> Array:
        """Map uniform draws in (0, 1) to scattered numbers. Shape (dimensions, n) -> (P - number of grid axes, n)."""
        found, row = list[Array](), 0
        for one in self.plan.scatter:
            if one.kind == "body":
                z = one.size * ndtri(uniform[row : row + BODY])
                found.append(consistent_bodies(np.array(self.bodies[one.name]), z))
                row += BODY
                continue
            way = 2.0 * uniform[row] - 1.0 if one.kind == "uniform" else ndtri(uniform[row])
            found.append((one.value + one.size * way)[None])
            row += 1
        return np.concatenate(found) if found else np.empty((0, uniform.shape[1]))

    def deviations(self) -> list[tuple[Scatter, Array]]:
        """Return each scatter with the changes of all numbers per standard deviation. Shape (P, 1 or 10)."""
        found, row = list[tuple[Scatter, Array]](), len(self.plan.grid)
        for one in self.plan.scatter:
            width = BODY if one.kind == "body" else 1
            ways = np.zeros((len(self.names), width))
            if one.kind == "body":
                step = 1e-6 * np.eye(BODY)
                ends = [consistent_bodies(np.array(self.bodies[one.name]), sign * step) for sign in (1.0, -1.0)]
                ways[row : row + width] = one.size * (ends[0] - ends[1]) / 2e-6
            else:
                ways[row, 0] = one.deviation
            found.append((one, ways))
            row += width
        return found
