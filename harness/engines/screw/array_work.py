"""The array solver in the place of a program, or beside it: samples that have their own loads, and their errors."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from copy import copy
from dataclasses import replace

import numpy as np

from screwgauge.engines.estimate import Part
from screwgauge.engines.screw.bounds import examined
from screwgauge.engines.screw.inverse import Work
from screwgauge.problem import GivenMotion, Problem
from screwgauge.reference.closed.resting import home_equations
from screwgauge.reference.layout import Layout
from screwgauge.reference.rotations import Array


def under(problem: Problem, loads: Array | None) -> Problem:
    """A problem under loads that change from sample to sample, force and torque of each. Shape (m, n)."""
    if loads is None:
        return problem
    each = np.split(loads.T, len(loads) // 3, axis=1)
    some = tuple(
        replace(load, force=force, torque=torque)
        for load, force, torque in zip(problem.applied.loads, each[::2], each[1::2], strict=True)
    )
    return replace(problem, applied=replace(problem.applied, loads=some))


def filled(into: Mapping[str, Array], part: Part, units: Mapping[str, Sequence[str]], length: float) -> None:
    """Fills arrays with the values of the array solver, and with their errors if these are wanted."""
    for name, array in into.items():
        array[:] = examined(part, units, length) if name == "error" else part.values[name]


class ArrayWork:
    """The array solver in the place of a program."""

    def __init__(self, lay: Layout, problem: Problem, motion: GivenMotion, reason: str) -> None:
        self.lay, self.problem, self.reason = lay, problem, reason
        self.said = f"all samples by the array solver: {reason}"
        self.length, self.by_array = home_equations(lay).length, Counter[str]()
        self.part(motion.part(slice(0, 1)))

    def part(self, motion: GivenMotion, loads: Array | None = None, into: Mapping[str, Array] | None = None) -> Part:
        """As `TracedWork.part`."""
        work = Work(under(self.problem, loads), motion, self.lay)
        found = work.part(slice(None))
        self.names, self.units = work.names, {name: work.names()[name][1] for name in found.values}
        self.by_array[self.reason] += len(motion)
        filled(into or {}, found, self.units, self.length)
        return found

    bound = None

    def bind(self, inputs: Sequence[Array], values: Mapping[str, Array]) -> None:
        """There is nothing to bind: `part` is to be asked."""

    def again(self) -> ArrayWork:
        """The same for another thread."""
        return copy(self)
