"""Cheap bounds that a program emits with every sample, and when they leave it to the array solver."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from screwgauge.engines.estimate import CLEAR, CLEAR_FORCES, Part, Trust, absolute, by_powers, summand
from screwgauge.problem import Problem, Rows
from screwgauge.quantities import arm
from screwgauge.reference import linear
from screwgauge.reference.equations.rounding import extent
from screwgauge.reference.graph import Layout
from screwgauge.reference.rotations import Array
from screwgauge.reference.traced.trace import Scalar, apply
from screwgauge.reference.traced.tracing import CHECKS

#: Gains are estimated; the norm of the equations themselves, without dimension, is of this size.
SAFETY, CONDITION = 2.0, 4.0
#: Closure residual beyond which Newton's method has not arrived, for one row; what all bodies' balance may leave.
ARRIVED, BALANCED = 32 * linear.EPS, 1e-9
#: How far Newton's method may go, times the gain: as long as that is small, no other assembly lies between.
NEAR = 0.2


Numbers = Mapping[str, Scalar]
"""What a program says of its samples, see `roots`: nodes of its trace, or arrays of shape (n,)."""


def roots(checks: Iterable[Scalar]) -> dict[str, Scalar]:
    """Name -> root of the square that a program emits, see `CHECKS`."""
    return {name: apply("sqrt", x) for name, x in zip(CHECKS, checks, strict=True)}


class Bounds:
    """How the numbers of a program are read.

    Attributes:
        weights: A sample whose checks, times these, add up to more than 1 may be doubtful.
    """

    def __init__(self, lay: Layout, problem: Problem, length: float) -> None:
        self.wanted, self.length, self.mass = problem.wanted, length, lay.mechanism.mass
        self.stretch = extent(lay).stretch
        loads = (float(np.linalg.norm(x.force) + np.linalg.norm(x.torque) / length) for x in problem.applied.loads)
        self.weight = self.mass * float(np.linalg.norm(problem.applied.g)) + sum(loads)  # all weights and loads [N]
        # each of several spherical joints adds one at least
        self.spare_charts = max(sum(joint.angles == 3 for joint in lay.cuts) - 1, 0)
        # largest closure residual that rounding makes of all rows
        self.arrived = float(ARRIVED * max(6 * len(lay.cuts), 1) ** 0.5)
        self.weights = self._weights()

    def trust(self, out: Numbers) -> Trust:
        """What the numbers of a program rest on."""
        gain = SAFETY * apply("max", out["gain"], 1e-300)
        speed = out["speed"]
        rush = apply("max", speed * speed, out["rush"])
        load = self.weight + self.mass * self.length * rush
        charts = apply("sqrt", apply("max", out["charts"] * out["charts"] - float(self.spare_charts), 1.0))
        forces = dict[str, Scalar]()
        if "reaction" in self.wanted:
            forces["reaction"] = SAFETY * out["whole_gain"] * out["whole_gain"]
        if forces or "actuator_force" in self.wanted:
            forces["actuator_force"] = SAFETY * apply("max", out["drive"], 1.0)
        numbers = charts, forces, speed, rush, load, out["closing"], self.stretch
        return Trust(CONDITION * gain, gain, *numbers)

    def estimated(
        self, out: Numbers, values: Mapping[str, Sequence[Scalar]], units: Mapping[str, Sequence[str]]
    ) -> tuple[list[Scalar], list[Scalar]]:
        """Errors of quantities at samples that are clear, of each of their units.

        Returns:
            Sums of squares as they grow, with the numbers they are made of, and the errors.
        """
        trust, sums, errors = self.trust(out), list[Scalar](), list[Scalar]()
        for name, each in units.items():
            whole: Scalar = 0.0
            for x, unit in zip(values[name], each, strict=True):
                whole = whole + arm(unit, self.length) ** -2.0 * (x * x)
                sums += [x, whole]
            errors += [by_powers(name, trust) * local for _, local in _sizes(whole, each, trust, self.length)]
        return sums, errors

    def _weights(self) -> Array:
        limits = {
            "gain": CLEAR**2,
            "whole_gain": CLEAR_FORCES if "reaction" in self.wanted else np.inf,
            "drive": CLEAR_FORCES**2,
            "moved": (NEAR / (SAFETY * CLEAR)) ** 2,
            "closing": self.arrived**2,
            "balance": max(BALANCED * self.weight, 1e-150) ** 2,  # without weight nothing is sure to load
            "charts": (SAFETY * CLEAR) ** 2,
        }
        free = 1.0 - self.spare_charts / (SAFETY * CLEAR) ** 2
        return np.array([1.0 / (free * limits.get(name, np.inf)) for name in CHECKS])

    def near(self, out: Numbers) -> NDArray[np.bool_]:
        """Whether Newton's method stayed on its assembly. Shape (n,)."""
        return np.asarray(out["moved"] * SAFETY * out["gain"] <= NEAR)

    def left(self, out: Numbers, trust: Trust, counts: Counter[str]) -> Rows:
        """Samples for the array solver; `counts` says how many for which reason."""
        doubts = {
            "badly conditioned": trust.doubtful(SAFETY),
            "not closed": np.flatnonzero(~((out["closing"] <= self.arrived) & self.near(out))),
            "not balanced": np.flatnonzero(~(out["balance"] <= BALANCED * np.maximum(trust.load, 1e-300))),
        }
        left: Rows = np.zeros(0, dtype=np.intp)
        for reason, rows in doubts.items():
            counts[reason] += len(np.setdiff1d(rows, left))
            left = np.union1d(left, rows)
        return left


def examined(part: Part, units: Mapping[str, Sequence[str]], length: float) -> Array:
    """The errors of `Bounds.estimated` at samples that need not be clear. Shape (n, n_unit)."""
    errors = []
    for name, each in units.items():
        whole = (part.values[name] ** 2 / np.array([arm(unit, length) for unit in each]) ** 2).sum(axis=1)
        for unit, local in _sizes(whole, each, part.trust, length):
            errors.append(absolute(name, part, local, [i for i, has in enumerate(each) if has == unit]))
    return np.stack(errors, axis=1)


def _sizes(whole: Scalar, units: Sequence[str], trust: Trust, length: float) -> list[tuple[str, Scalar]]:
    """Each unit of a quantity, and the size of what its numbers are made of. `whole`: sum of the squares of all."""
    local = apply("sqrt", whole) + summand(units[0], trust) if units else 0.0
    return [(unit, arm(unit, length) * local) for unit in dict.fromkeys(units)]
