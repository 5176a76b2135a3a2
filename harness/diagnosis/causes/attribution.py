"""Why the torques of two models differ: their differences by cause, each with its share of the torque difference."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from screwgauge.diagnosis.causes.edits import WHOLE, Edit, Group, Value
from screwgauge.diagnosis.causes.grouping import SEVERAL, titled, together
from screwgauge.diagnosis.deadline import Deadline
from screwgauge.diagnosis.differences.difference import Difference
from screwgauge.diagnosis.properties import CLOSING, PARTS, Change, applied
from screwgauge.models.readings.reading import Reading
from screwgauge.reference.errors import UnknownNameError
from screwgauge.reference.rotations import Array

#: Scaled torques that differ by less are the same: own dynamics of two readings leave 1e-14, MuJoCo's tensors 5e-14.
ROUNDING = 1e-12
#: A difference whose change moves scaled torques by no more is one that no torque shows.
UNSEEN = 1e-11
#: Causes with less than this share of the torque difference are one row with those of their kind.
SMALL = 1e-2
#: Where no more than this share is left when the first causes, so many at most, are corrected, the others are weighed
#: against that.
REST, FIRST = 1e-3, 5
#: What no torque shows and still is no detail: of closures and couplings, of what is there at all, of the medium.
WEIGHTY = {*CLOSING, *PARTS, "medium", "gravity"}


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
        """Scale of each component: its largest magnitude, at least 1e-3 of the largest of the same unit. Shape (m,)."""
        most, floor = np.abs(self.a).max(axis=0, initial=0.0), self.largest
        return np.asarray(np.maximum(np.maximum(most, 1e-3 * floor), 1e-300))

    @property
    def largest(self) -> Array:
        """Largest magnitude of any component of the same unit. Shape (m,)."""
        most, units = np.abs(self.a).max(axis=0, initial=0.0), np.array(self.unit)
        return np.array([most[units == unit].max() for unit in self.unit])

    def scaled(self, b: Array) -> Array:
        """Difference of torques to A's, scaled; infinite where there is no number. Shape (n, m)."""
        left = (b - self.a) / self.scale
        return np.asarray(np.where(np.isfinite(left), left, np.inf))

    def left(self, b: Reading) -> Array:
        """Scaled difference of the torques of a reading. Shape (n, m)."""
        return self.scaled(self.of(b))


@dataclass(frozen=True, slots=True)
class Largest:
    """The largest difference: scaled, and as it is, with component and unit."""

    scaled: float
    value: float
    component: str
    unit: str


@dataclass(frozen=True, slots=True, eq=False)
class Cause:
    """One or several differences with one cause: a row.

    Attributes:
        name: What of which parts; `sentence`: how it differs; `short`: the same of the part that counts most alone.
        differences: Numbers of them.
        share: Of the torque difference, the projection of what it makes on all of that, one scale a unit; the shares of
            all causes add up to 1 where they do not depend on each other, and what makes up for others has a negative
            one. NaN where no change of B is known, or torques agree.
        of_rest: Its share of what is left when all causes before it that have none are corrected, where that is nearly
            nothing of all (a millimetre next to a factor of 1e9); NaN elsewhere.
        kind: ``cause``; ``digits``, rounding of printed numbers; ``unseen``, what no torque shows.
        slips: What B's values would be made from A's by, of convention or unit; any of them.
        values: In both models.
    """

    name: str
    sentence: str
    differences: tuple[int, ...]
    share: float = math.nan
    kind: str = "cause"
    short: str = ""
    slips: tuple[str, ...] = ()
    values: tuple[Value, ...] = ()
    of_rest: float = math.nan

    @property
    def weight(self) -> float:
        """Weight by which causes are ranked."""
        return self.share if math.isnan(self.of_rest) else self.of_rest


@dataclass(frozen=True, slots=True, eq=False)
class Attribution:
    """Shares of causes in the torque difference.

    Attributes:
        before: Largest torque difference, scaled, then where and how large: component, value and its unit.
        left: The same after all changes.
        share: Of the torque difference that all changes explain, by the root of the mean square.
        causes: The one with the largest share first; then what torques do not determine, rounding, and what none shows.
        seen: Numbers of the differences that torques show; none where these agree.
        by_joint: Component, and its largest scaled difference before and after all changes.
    """

    before: Largest
    left: Largest
    share: float
    causes: tuple[Cause, ...]
    seen: tuple[int, ...]
    by_joint: tuple[tuple[str, float, float], ...] = ()

    @property
    def complete(self) -> bool:
        """Whether nothing but rounding is left."""
        return self.left.scaled <= ROUNDING


#: How much each difference counts -> groups of them.
Groups = Callable[[Callable[[int], float]], Sequence[Group]]


def attribute(
    torques: Torques,
    b: Reading,
    differences: Sequence[Difference],
    groups: Groups,
    edits: Sequence[Edit] = (),
    deadline: Deadline | None = None,
    first: Sequence[int] = (),
) -> Attribution:
    """Corrects each difference alone, each group of them, and all of them.

    What there is no time for has no share.

    Args:
        b: The reading that changes are made in.
        differences: All of them, in the order in which their changes are to be made.
        groups: Makes rows of them. `edits`: what they are made by.
        first: Numbers of what is of the whole, which is corrected before any other is.
    """
    deadline = deadline or Deadline()
    effects = _Effects(torques, b, differences, deadline)
    rest = effects
    if first:
        rest = _Effects(torques, applied(b, changes_of(differences[i] for i in first)), differences, deadline)
    changed = [i for i, each in enumerate(differences) if each.change and each.kind != "digits"]
    alone = {i: rest.of((i,)) for i in changed if i not in first}

    def weight(i: int) -> float:
        effect = alone.get(i)
        share = abs(rest.share(effect)) if effect is not None else 0.0
        return share if share > 0.0 else 1e-12 * min(differences[i].size, 1.0)

    rows = [(each, (effects if each.family == WHOLE else rest).of(each.differences)) for each in groups(weight)]
    before, left = torques.scaled(effects.start), torques.left(applied(b, changes_of(differences)))
    agree = float(np.abs(before).max(initial=0.0)) <= UNSEEN
    seen = tuple(sorted(i for group, effect in rows if not agree and effects.seen(effect) for i in group.differences))
    gone = 1.0 - size(left) / size(before) if size(before) > 0.0 and not agree else 0.0
    most = [np.abs(each).max(axis=0, initial=0.0).tolist() for each in (before, left)]
    return Attribution(
        largest(torques, before),
        largest(torques, left),
        gone,
        tuple(_told(cause, edits) for cause in _rows(rows, (effects, rest), differences, agree=agree)),
        seen,
        tuple(zip(torques.names, *most, strict=True)),
    )


class _Effects:
    """Effects of changes on torques, each computed once.

    Attributes:
        start: Torques of B. Shape (n, m).
    """

    def __init__(self, torques: Torques, b: Reading, differences: Sequence[Difference], deadline: Deadline) -> None:
        self.torques, self.b, self.differences, self.deadline = torques, b, differences, deadline
        self.start = torques.of(b)
        self._off = self._weighed(self.start - torques.a)
        self._total = float(np.vdot(self._off, self._off))
        self._known: dict[tuple[int, ...], Array | None] = {}

    def of(self, numbers: tuple[int, ...]) -> Array | None:
        """Differences between torques of B and those after changes; None where there is no number. Shape (n, m)."""
        if numbers not in self._known:
            self._known[numbers] = self._asked(numbers)
        return self._known[numbers]

    def _asked(self, numbers: tuple[int, ...]) -> Array | None:
        some = [self.differences[i] for i in sorted(numbers)]
        changes = changes_of(some)
        first = some[0]
        if not changes or self.deadline.over(f"share of {titled(first)}"):
            return None
        try:
            effect = self.start - self.torques.of(applied(self.b, changes))
        except UnknownNameError:  # of a part that another change brings
            return None
        return effect if np.all(np.isfinite(effect)) else None

    def share(self, effect: Array | None) -> float:
        """Share of an effect in the torque difference; NaN where there is no difference."""
        if effect is None or not 0.0 < self._total < math.inf:
            return math.nan
        return float(np.vdot(self._off, self._weighed(effect))) / self._total

    def rest(self, first: tuple[int, ...]) -> Array | None:
        """Weighted rest once the first differences are mended; None unless it is a tiny part of the total."""
        gone = self.of(first)
        left = None if gone is None else self._weighed(self.start - self.torques.a - gone)
        return left if left is not None and 0.0 < np.vdot(left, left) <= REST**2 * self._total < math.inf else None

    def share_of_rest(self, numbers: tuple[int, ...], first: tuple[int, ...], rest: Array) -> float:
        """Share of some differences in the rest that the first differences leave."""
        gone, both = self.of(first), self.of(tuple(sorted({*numbers, *first})))
        if gone is None or both is None:
            return math.nan
        return float(np.vdot(rest, self._weighed(both - gone)) / np.vdot(rest, rest))

    def seen(self, effect: Array | None) -> bool:
        """Whether a torque shows it."""
        return effect is not None and bool(np.any(np.abs(effect) > UNSEEN * self.torques.scale))

    def _weighed(self, off: Array) -> Array:
        """A difference over the largest torque of the same unit."""
        most = self.torques.largest
        return np.asarray(off / np.where(most > 0.0, most, 1.0))


def _rows(
    rows: Sequence[tuple[Group, Array | None]],
    of: tuple[_Effects, _Effects],
    differences: Sequence[Difference],
    *,
    agree: bool,
) -> list[Cause]:
    """Groups as causes, the whole first, small ones and what no torque shows with those of their kind."""
    lead, seen, others, digits, unseen = list[Cause](), list[Cause](), list[Group](), list[Cause](), list[Group]()
    groups, (effects, after) = {group.differences: group for group, _ in rows}, of
    for group, effect in rows:
        share = math.nan if agree else effects.share(effect)
        hidden = effect is not None and not effects.seen(effect)
        if group.family == WHOLE:
            lead.append(_cause(group, share, "unseen" if hidden and len(rows) == 1 else "cause"))
        elif group.family == "digits":
            digits.append(_cause(group, share, "digits"))
        elif hidden and not {differences[i].what for i in group.differences} & WEIGHTY:
            unseen.append(group)
        elif math.isnan(share) or hidden:
            others.append(group)
        else:
            own = _cause(group, share)
            seen.append(own if after is effects else replace(own, of_rest=after.share(effect)))
    seen = _ranked(seen, groups, after)
    # names are conventions: what a machine lacks leads them
    others.sort(
        key=lambda group: (
            all(differences[i].what == "name" for i in group.differences),
            -max(differences[i].size for i in group.differences),
        )
    )
    rest = [_cause(group) for group in _few(others)]
    alone = not (lead or seen or rest)
    folded = _folded(unseen, differences, alone=alone)
    return [*lead, *seen, *rest, *(folded if alone else ()), *digits, *(() if alone else folded)]


def _ranked(causes: Sequence[Cause], groups: Mapping[tuple[int, ...], Group], effects: _Effects) -> list[Cause]:
    """Causes that torques show: the leading one first, even where compensating causes weigh more; then by weight.

    Small ones of one family are one row.
    """
    out, others = _weighed(causes, effects)
    small = defaultdict[str, list[Cause]](list)
    for cause in others:
        (small[groups[cause.differences].family] if abs(cause.weight) < SMALL else out).append(cause)
    for some in small.values():
        some.sort(key=lambda cause: -abs(cause.weight))
        if len(some) >= SEVERAL:
            one = together([groups[cause.differences] for cause in some])
            of_rest = sum(cause.of_rest for cause in some)
            some = [replace(_cause(one, sum(cause.share for cause in some)), of_rest=of_rest)]
        out += some
    lead = out[:1]
    return lead + sorted(out[1:], key=lambda cause: (not math.isnan(cause.of_rest), -abs(cause.weight)))


def _weighed(causes: Sequence[Cause], effects: _Effects) -> tuple[list[Cause], list[Cause]]:
    """The first causes, and the others, with their shares of the rest if these are nearly all."""
    ranked = sorted(causes, key=lambda cause: -cause.share)
    for k in range(1, min(FIRST + 1, len(ranked))):
        first = tuple(sorted(i for cause in ranked[:k] for i in cause.differences))
        if (rest := effects.rest(first)) is not None:
            others = [
                replace(cause, of_rest=effects.share_of_rest(cause.differences, first, rest)) for cause in ranked[k:]
            ]
            return ranked[:k], others
    return ranked[:1], ranked[1:]


def _few(groups: Sequence[Group]) -> list[Group]:
    """Groups, with several groups of one family joined into one."""
    families: dict[str, list[Group]] = {}
    for group in groups:
        families.setdefault(group.family, []).append(group)
    return [each for some in families.values() for each in ([together(some)] if len(some) >= SEVERAL else some)]


def _folded(groups: Sequence[Group], differences: Sequence[Difference], *, alone: bool) -> list[Cause]:
    """Differences without effect on torques: one line below other rows, else one for each family."""
    if alone or len(groups) < 2:
        largest_first = sorted(groups, key=lambda group: -max(differences[i].size for i in group.differences))
        return [_cause(group, kind="unseen") for group in _few(largest_first)]
    numbers = tuple(i for group in groups for i in group.differences)
    counts: dict[str, int] = {}
    for group in groups:
        counts[group.family] = counts.get(group.family, 0) + len(group.differences)
    kinds = ", ".join(f"{name} ({count})" for name, count in counts.items())
    sentence = f"{len(numbers)} further differences do not affect torques: {kinds}"
    return [Cause("what no torque shows", sentence, numbers, 0.0, "unseen", sentence)]


def _cause(group: Group, share: float = math.nan, kind: str = "cause") -> Cause:
    return Cause(group.name, group.sentence, group.differences, share, kind, group.short)


def _told(cause: Cause, edits: Sequence[Edit]) -> Cause:
    """A cause with the slips and values of the edits that remove its differences."""
    own = [edit for edit in edits if {*edit.differences} & {*cause.differences}]
    if cause.kind == "digits" or cause.name == WHOLE or not own:
        return cause
    first = next((edit for edit in own if cause.differences[0] in edit.differences), own[0])
    common = [slip for slip in first.slips if all(slip in edit.slips for edit in own)]
    slips = tuple(common) if len(own) > 1 else first.slips
    values = tuple(value for edit in own for value in edit.values)
    return replace(cause, slips=slips, values=values)


def largest(torques: Torques, left: Array) -> Largest:
    """The largest of scaled differences, shape (n, m)."""
    if not left.size:
        return Largest(0.0, 0.0, "", "")
    i, j = np.unravel_index(int(np.abs(left).argmax()), left.shape)
    scaled = float(np.abs(left[i, j]))
    return Largest(scaled, float(scaled * torques.scale[j]), torques.names[j], torques.unit[j])


def changes_of(differences: Iterable[Difference]) -> tuple[Change, ...]:
    """Changes of B that make it A, of the differences that have one."""
    return tuple(each.change for each in differences if each.change is not None)


def size(left: Array) -> float:
    """Root of the mean square over samples and components; squares must not overflow."""
    most = float(np.abs(left).max(initial=0.0))
    return most * float(np.sqrt(np.mean((left / most) ** 2))) if 0.0 < most < np.inf else most
