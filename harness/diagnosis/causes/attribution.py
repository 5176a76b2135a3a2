"""Which differences between two models make their torques differ, and by what share."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from screwgauge.diagnosis.causes.hypothesis import Hypothesis
from screwgauge.diagnosis.deadline import Deadline
from screwgauge.diagnosis.differences.change import Change, Difference, applied
from screwgauge.models.readings.reading import Reading
from screwgauge.reference.rotations import Array

#: Scaled torques that differ by less are the same: own dynamics of two readings leave 1e-14, MuJoCo's tensors 5e-14.
ROUNDING = 1e-12
#: A hypothesis explains as much as another one if it leaves no more than this share of the difference beside it.
ALIKE = 1e-6
#: A step that takes away less than this share of what is left is none.
LEAST = 1e-3
#: Combinations that are tried; models that differ everywhere have no cause that could be told in a sentence.
MOST = 150


@dataclass(frozen=True, slots=True, eq=False)
class Torques:
    """What is to be explained, and how to ask.

    Attributes:
        a: Torques of A at the states. Shape (n, m).
        of: Torques of B, or of B after changes, at the same states, in the counting of A. Shape (n, m).
        names: Of the components, m of them.
        unit: Of each, m of them.
    """

    a: Array
    of: Callable[[Reading], Array]
    names: tuple[str, ...]
    unit: tuple[str, ...]

    @property
    def scale(self) -> Array:
        """Of each component: its largest magnitude, at least a thousandth of that of any of the same unit. (m,)."""
        most = np.abs(self.a).max(axis=0, initial=0.0)
        units = np.array(self.unit)
        floor = np.array([most[units == unit].max() for unit in self.unit])
        return np.asarray(np.maximum(np.maximum(most, 1e-3 * floor), 1e-300))

    def left(self, b: Reading) -> Array:
        """Difference to A, scaled; infinite where there is no number. Shape (n, m)."""
        left = (self.of(b) - self.a) / self.scale
        return np.asarray(np.where(np.isfinite(left), left, np.inf))


@dataclass(frozen=True, slots=True)
class Largest:
    """The largest difference: scaled, and as it is, with component and unit."""

    scaled: float
    value: float
    component: str
    unit: str


@dataclass(frozen=True, slots=True, eq=False)
class Step:
    """A hypothesis that was taken.

    Attributes:
        alone: Share of the torque difference that it explains by itself.
        share: Share explained by it and all before it.
        alike: Others that explain as much and cannot be told from it by torques.
    """

    hypothesis: Hypothesis
    alone: float
    share: float
    alike: tuple[Hypothesis, ...] = ()


@dataclass(frozen=True, slots=True, eq=False)
class Attribution:
    """What was found.

    Attributes:
        before: Largest torque difference, scaled, then where and how large: component, value and its unit.
        ranking: All hypotheses with the share that each explains alone, the best first.
        steps: Those that together explain the most, in the order in which they were taken.
        changes: Of all steps, in the order in which they are to be made.
        left: As `before`, after all steps.
        unseen: Differences that no torque shows.
    """

    before: Largest
    ranking: tuple[tuple[Hypothesis, float], ...]
    steps: tuple[Step, ...]
    changes: tuple[Change, ...]
    left: Largest
    unseen: tuple[Difference, ...]

    @property
    def share(self) -> float:
        """Of the torque difference that all steps explain."""
        return self.steps[-1].share if self.steps else 0.0

    @property
    def complete(self) -> bool:
        """Whether nothing but rounding is left."""
        return self.left.scaled <= ROUNDING


def largest(torques: Torques, left: Array) -> Largest:
    """The largest of scaled differences, shape (n, m)."""
    if not left.size:
        return Largest(0.0, 0.0, "", "")
    i, j = np.unravel_index(int(np.abs(left).argmax()), left.shape)
    scaled = float(np.abs(left[i, j]))
    return Largest(scaled, float(scaled * torques.scale[j]), torques.names[j], torques.unit[j])


def attribute(
    torques: Torques,
    b: Reading,
    differences: Sequence[Difference],
    hypotheses: Sequence[Hypothesis],
    deadline: Deadline | None = None,
) -> Attribution:
    """Takes hypotheses one by one, each time the one that then explains most, until rounding is left.

    What there is no time to try is no hypothesis.

    Args:
        b: The reading that changes are made in.
        differences: All of them, in the order in which their changes are to be made; `Hypothesis.differences` are
            numbers in it.
    """
    start = torques.left(b)
    before = size(start)

    def left(numbers: Collection[int]) -> Array:
        return torques.left(applied(b, changes_of(differences[i] for i in sorted(numbers))))

    def together(numbers: Collection[int]) -> float:
        return math.inf if over("combinations of hypotheses") else size(left(numbers))

    over = (deadline or Deadline()).over
    tried = [(each, size(left(each.differences))) for each in hypotheses if not over(f"hypothesis {each.name}")]
    hypotheses, alone = [hypothesis for hypothesis, _ in tried], [each for _, each in tried]
    shares = [_share(before, each) for each in alone]
    order = sorted(range(len(shares)), key=lambda i: (-round(shares[i], 9), hypotheses[i].numbers))
    steps = _steps(together, hypotheses, alone, before)
    used = {number for step in steps for number in step.hypothesis.differences}
    after = largest(torques, left(used))
    unseen = tuple(difference for i, difference in enumerate(differences) if i not in used)
    ranking = tuple((hypotheses[i], shares[i]) for i in order)
    changes = changes_of(differences[i] for i in sorted(used))
    return Attribution(largest(torques, start), ranking, steps, changes, after, unseen)


def changes_of(differences: Iterable[Difference]) -> tuple[Change, ...]:
    """What makes B as A, of those differences that have it."""
    return tuple(each.change for each in differences if each.change is not None)


def size(left: Array) -> float:
    """Root of the mean square over samples and components; squares must not overflow."""
    most = float(np.abs(left).max(initial=0.0))
    return most * float(np.sqrt(np.mean((left / most) ** 2))) if 0.0 < most < np.inf else most


def _share(before: float, left: float) -> float:
    return 1.0 - left / before if before > 0.0 else 0.0


def _steps(
    left: Callable[[Collection[int]], float], hypotheses: Sequence[Hypothesis], alone: Sequence[float], before: float
) -> tuple[Step, ...]:
    """The greedy combination.

    What each took away when it was last tried tells which to try first, and when none of the rest can be better.
    """
    taken, steps, now, asked = set[int](), list[Step](), before, 0
    gains = {i: before - each for i, each in enumerate(alone)}
    while now > ROUNDING and gains:
        if asked > MOST:
            return (*steps, *_rest(left, hypotheses, taken, before))
        tried = dict[int, float]()
        for i in sorted(gains, key=lambda i: -gains[i]):
            gain = now - min(tried.values(), default=now)
            if gain > LEAST * now and gains[i] < gain * (1.0 - ALIKE):
                break
            tried[i] = left(taken | {*hypotheses[i].differences}) if steps else alone[i]
            asked += len(steps) > 0
        best = min(tried.values())
        if best > (1.0 - LEAST) * now:
            return (*steps, *_rest(left, hypotheses, taken, before))
        equal = [i for i in tried if tried[i] <= max(best + ALIKE * now, ROUNDING)]
        chosen = min(equal, key=lambda i: (hypotheses[i].numbers, -len(hypotheses[i].differences), tried[i]))
        own = {*hypotheses[chosen].differences}
        alike = tuple(hypotheses[i] for i in equal if _another(hypotheses[i], hypotheses[chosen]))
        share = _share(before, tried[chosen])
        steps.append(Step(hypotheses[chosen], _share(before, alone[chosen]), share, alike))
        gains |= {i: now - each for i, each in tried.items()}
        now, taken = tried[chosen], taken | own
        gains = {i: gain for i, gain in gains.items() if not {*hypotheses[i].differences} <= taken}
    return tuple(steps)


def _rest(
    left: Callable[[Collection[int]], float], hypotheses: Sequence[Hypothesis], taken: set[int], before: float
) -> Iterator[Step]:
    """All that is left at once, where no part of it helps alone."""
    numbers = {number for hypothesis in hypotheses for number in hypothesis.differences} - taken
    rest = Hypothesis("all other differences together", tuple(sorted(numbers)), (), len(numbers))
    share, gone = _share(before, left(taken | numbers)), _share(before, left(taken))
    if share - gone > LEAST * (1.0 - gone):
        yield Step(rest, _share(before, left(numbers)), share)


def _another(hypothesis: Hypothesis, chosen: Hypothesis) -> bool:
    """Whether it is of something else, and not the chosen one with more beside it or in other words."""
    if hypothesis is chosen or {*chosen.differences} < {*hypothesis.differences}:
        return False
    items = [{(value.item, value.what) for value in each.values} for each in (hypothesis, chosen)]
    return not items[0] <= items[1]
