"""What a bench asks of a scene: its motion, its true states, or a motion that is changed for a purpose. Data only."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import ClassVar, Protocol

import numpy as np

from screwgauge.problem import GivenMotion, ModelFiles, Problem, Rows
from screwgauge.reference.errors import DescriptionError
from screwgauge.reference.graph import spanning_tree
from screwgauge.reference.rotations import Array
from screwgauge.solution import Solution, Values
from screwgauge.study.four_bar import four_bar_states, write_four_bar
from screwgauge.study.posed import Posed
from screwgauge.study.reference import Reference, Score, reference_values

EDGE = 2  # samples at each end where np.gradient, applied twice, is one-sided


@dataclass(frozen=True, slots=True, eq=False)
class Asked:
    """A question with its answer.

    Attributes:
        problems: Put one after the other to one model.
        n_sample: Samples that the answers deliver.
        reference: What the answers are measured against.
        rows: Samples of all answers together that the reference has; all by default.
    """

    files: ModelFiles
    problems: tuple[Problem, ...]
    n_sample: int
    reference: Reference
    rows: Rows | None = None

    def score(self, quantity: str, solutions: Sequence[Solution]) -> Score:
        """Error of the answers."""
        parts = [solution.values[quantity] for solution in solutions]
        whole = Values(parts[0].components, parts[0].units, np.concatenate([part.array for part in parts]))
        return self.reference.score(quantity, whole if self.rows is None else whole.at(self.rows))


class Question(Protocol):
    """What is asked."""

    @property
    def given(self) -> bool:
        """Whether it gives joint motion, so that nothing has to close the loops."""
        ...

    def ask(self, posed: Posed, engine: str, wanted: Sequence[str]) -> Asked:
        """The question on a scene, to an engine, for some quantities."""
        ...


@dataclass(frozen=True, slots=True)
class Motion:
    """The given motion.

    Attributes:
        whole: At all times of the scene, not only at those that are compared.
        one_by_one: One sample after the other.
    """

    whole: bool = False
    one_by_one: bool = False
    given: ClassVar[bool] = False

    def ask(self, posed: Posed, engine: str, wanted: Sequence[str]) -> Asked:
        motion = (posed.whole if self.whole else posed.scene).motion
        tasks = [motion.part(slice(i, i + 1)) for i in range(len(motion))] if self.one_by_one else [motion]
        problems = tuple(posed.problem(*wanted, task=task) for task in tasks)
        rows = np.searchsorted(motion.t, posed.t)
        return Asked(posed.files(engine), problems, len(motion), posed.reference, rows)


@dataclass(frozen=True, slots=True)
class TrueStates:
    """The true motion of a tree. `pushed`: for accelerations under the true forces, else for actuator forces."""

    pushed: bool = False
    given: ClassVar[bool] = True

    def ask(self, posed: Posed, engine: str, wanted: Sequence[str]) -> Asked:
        return Asked(posed.files(engine), (_on_tree(posed, self.pushed),), len(posed.t), posed.reference)


@lru_cache(maxsize=2)
def _on_tree(posed: Posed, pushed: bool) -> Problem:
    """Many methods are asked this."""
    tree = {edge.joint.name for edge in spanning_tree(posed.scene.mechanism).edges}
    coordinates = tuple(c for joint in posed.scene.mechanism.joints if joint.name in tree for c in joint.coordinates)
    if pushed:
        return posed.pushed(coordinates)
    return posed.problem("actuator_force", task=posed.moving(coordinates))


@dataclass(frozen=True, slots=True)
class FourBar:
    """Accelerations of another mechanism, whose closing rows are redundant."""

    given: ClassVar[bool] = True

    def ask(self, posed: Posed, engine: str, wanted: Sequence[str]) -> Asked:
        folder, (problem, right) = posed.folder / "four-bar", four_bar_states(len(posed.t))
        folder.mkdir(exist_ok=True)
        scales = {unit: float(np.abs(right.array).max()) for unit in right.units}
        reference = Reference("closed form", dict.fromkeys(wanted, right), "", dict.fromkeys(wanted, scales))
        return Asked(write_four_bar(folder), (problem,), len(posed.t), reference)


@dataclass(frozen=True, slots=True)
class Differenced:
    """The motion in steps of about a part of its duration. `ends`: compared where differences are one-sided."""

    part: float
    ends: bool = False
    given: ClassVar[bool] = False

    def ask(self, posed: Posed, engine: str, wanted: Sequence[str]) -> Asked:
        t, reference = posed.t, posed.reference
        if len(t) < 3 or not np.allclose(np.diff(t), t[1] - t[0], rtol=1e-9):
            raise DescriptionError(
                "the compared times are not evenly spread", "finite differences", "give an even grid"
            )
        duration = float(t[-1] - t[0])
        fine = max(1, round((t[1] - t[0]) / (self.part * duration)))
        n = fine * (len(t) - 1)
        grid = t[0] + np.arange(n + 1) * (duration / n)
        if self.ends:
            rows = np.r_[0:EDGE, n + 1 - EDGE : n + 1]
            values = reference_values(posed.whole, grid[rows], wanted).values
        else:
            rows = np.arange(len(t)) * fine
            inner = (rows >= EDGE) & (rows < n + 1 - EDGE)
            rows, values = rows[inner], {name: reference.values[name].at(inner) for name in wanted}
        problem = posed.problem(*wanted, task=posed.whole.moved(grid))
        return Asked(posed.files(engine), (problem,), len(rows), replace(reference, values=values), rows)


@dataclass(frozen=True, slots=True)
class Faster:
    """The same poses at another speed."""

    speed: float
    given: ClassVar[bool] = False

    def ask(self, posed: Posed, engine: str, wanted: Sequence[str]) -> Asked:
        motion, reference = posed.scene.motion, posed.reference
        task = GivenMotion(motion.t, motion.y, self.speed * motion.yd, self.speed**2 * motion.ydd)
        # all velocity terms are quadratic: at the same poses, s times the speed makes s^2 times the accelerations
        like = {name: reference.values[name] for name in wanted}
        right = {name: Values(v.components, v.units, self.speed**2 * v.array) for name, v in like.items()}
        problem = posed.problem(*wanted, task=task)
        return Asked(posed.files(engine), (problem,), len(motion), replace(reference, values=right))


@dataclass(frozen=True, slots=True)
class Stepped:
    """The motion at the steps of a method that starts from the first pose.

    Attributes:
        part: Step, as a part of the duration.
        halves: Halfway between steps, too.
    """

    part: float
    halves: bool = False
    given: ClassVar[bool] = False

    def ask(self, posed: Posed, engine: str, wanted: Sequence[str]) -> Asked:
        t, parts = posed.t, 2 if self.halves else 1
        step, n = self.part * float(t[-1] - t[0]), int((1 + 1e-12) / self.part)
        grid: Array = t[0] + np.arange(parts * n + 1) * (step / parts)
        rows = np.minimum(np.rint((t - t[0]) / step).astype(int), n)
        met = np.abs(grid[::parts][rows] - t) <= 1e-9 * max(1.0, abs(t[-1]))
        reference = replace(posed.reference, values={name: posed.reference.values[name].at(met) for name in wanted})
        problem = posed.problem(*wanted, task=posed.whole.moved(grid))
        # delivered are the compared times, however many steps it takes to get from one to the next
        return Asked(posed.files(engine), (problem,), len(t), reference, rows[met])
