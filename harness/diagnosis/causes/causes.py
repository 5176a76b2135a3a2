"""Groups facts that a single edit would explain into causes, ranked by share of the torque difference."""

from __future__ import annotations

import math
import re
from collections import defaultdict
from collections.abc import Callable, Hashable, Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from screwgauge.diagnosis.facts.fact import IDLE, Fact
from screwgauge.diagnosis.properties import INERTIAL, PARTS, PROPERTIES
from screwgauge.diagnosis.shares import UNSEEN, Torques, have_values
from screwgauge.models.content import kinds
from screwgauge.reference.rotations import Array

#: Smallest number of parts that form one cause if they share a factor or lack the same property; and relative tolerance
#: of the factor.
SEVERAL, FACTOR = 3, 1e-5


def group_facts(facts: Iterable[Fact], known: Sequence[Sequence[Fact]] = ()) -> list[tuple[Fact, ...]]:
    """Group facts that a single edit would explain; each fact is in one group.

    Args:
        known: Groups of facts that a single slip explains.
    """
    left, groups = list(facts), list[tuple[Fact, ...]]()
    for some in known:
        one = tuple(fact for fact in left if any(fact is each for each in some))
        if len({fact.part for fact in one}) > 1:
            groups.append(one)
            left = [fact for fact in left if all(fact is not each for each in one)]
    for key, least in _KEYS:
        alike = defaultdict[Hashable, list[Fact]](list)
        for fact in left:
            if (of := key(fact)) is not None:
                alike[of].append(fact)
        merged = [some for some in alike.values() if len({fact.part for fact in some}) >= least]
        merged = [some for some in merged if key is not _weight or len({fact.what for fact in some}) > 1]
        groups += [tuple(some) for some in merged]
        taken = {id(fact) for some in merged for fact in some}
        left = [fact for fact in left if id(fact) not in taken]
    return _merge_sides(groups)


def _merge_sides(groups: Sequence[tuple[Fact, ...]]) -> list[tuple[Fact, ...]]:
    """Merge the groups of a left and a right part that differ in the same way."""
    alike = defaultdict[Hashable, list[tuple[Fact, ...]]](list)
    for i, group in enumerate(groups):
        parts = {fact.part for fact in group}
        name = without_sides(group[0].part)
        largest = next((fact for fact in group if fact.what == "mass"), group[0])
        whats = f"{largest.size:.1e}", *sorted(fact.what for fact in group)
        alike[(name, whats) if len(parts) == 1 and name != group[0].part.lower() else i].append(group)
    return [tuple(fact for group in some for fact in group) for some in alike.values()]


def without_sides(name: str) -> str:
    """Replace the markers of left and right in a name by ``~``."""
    return re.sub(r"[lr]", "~", re.sub(r"left|right", "~", name.lower()))


def factor_of(fact: Fact) -> float | None:
    """Return the factor that scales A's value to B's value; None if it is 1 or does not exist."""
    if fact.what not in PROPERTIES or not (PROPERTIES[fact.what].scales or fact.what == "com"):
        return None
    if fact.a is None or fact.b is None:
        return None
    a, b = np.asarray(fact.a, float), np.asarray(fact.b, float)
    if not (np.any(a) and np.any(b)):
        return None
    factor = float(np.vdot(a, b) / np.vdot(a, a))
    fits = factor > 0.0 and np.linalg.norm(b - factor * a) <= FACTOR * np.linalg.norm(b)
    more = float(f"{factor - 1.0:.4g}")  # a factor near 1 keeps the same number of digits
    return (1.0 + more if abs(more) < 0.1 else float(f"{factor:.5g}")) if fits and more else None


def _weight(fact: Fact) -> Hashable:
    """Return a key for masses and inertias that share a factor, e.g. after a change of density."""
    return factor_of(fact) if fact.what in ("mass", "inertia") else None


def _factor(fact: Fact) -> Hashable:
    factor = factor_of(fact)
    return factor and (fact.what, factor)


def _value(fact: Fact) -> Hashable:
    """Return a key for a property that one model lacks: the property, the model, and the value in the other model."""
    lacks = _lack(fact)
    value = fact.b if fact.a is None or not np.any(fact.a) else fact.a
    return lacks and (*lacks, str(value))


def _lack(fact: Fact) -> tuple[str, ...] | None:
    """Return a key for a property that one model lacks: the property and the model."""
    if fact.what == "limits":
        return (fact.what, fact.side, fact.unit) if fact.side else None
    if fact.what not in PROPERTIES or PROPERTIES[fact.what].shape != () or fact.a is None or fact.b is None:
        return None
    if fact.what in ("zero", "sign", "mass"):
        return None
    none = ["A"] * (not np.any(fact.a)) + ["B"] * (not np.any(fact.b))
    return (fact.what, none[0]) if len(none) == 1 else None


def _absence(fact: Fact) -> Hashable:
    """Return a key for a part that one model lacks or fixes."""
    return (fact.what, fact.side) if fact.what in ("branch", "fixed", "link") else None


def _part(fact: Fact) -> Hashable:
    """Return a key for one part: mass properties of a body, placement or coordinate of a joint, or one property."""
    if fact.kind == "convention" and fact.what in ("zero", "limits", "rest"):
        return "zero", fact.part
    if fact.what in INERTIAL:
        return "body", fact.part
    if fact.what in ("placement", "axis"):
        return "place", fact.part
    return fact.what, fact.part, fact.of


_KEYS: Sequence[tuple[Callable[[Fact], Hashable], int]] = (
    (lambda fact: fact.what if fact.what in kinds() else None, SEVERAL),
    (_weight, SEVERAL),
    (_factor, SEVERAL),
    (_value, SEVERAL),
    (_lack, SEVERAL),
    (_absence, SEVERAL),
    (lambda fact: fact.what if fact.what == "name" else None, 2),
    (_part, 1),
)


#: Bounds of a share, and of an effect relative to the total; causes beyond them cancel and are shown together.
CANCELS = -0.5, 1.5
#: All causes cancel if the total is below this share of the largest effect.
NOTHING = 1e-6
#: Share below which a cause is small, and smallest number of small (or unseen) causes that are merged.
SMALL, SEVERAL = 1e-4, 3
#: Facts about missing parts, which are ranked first whatever their share.
STRUCTURE = PARTS | {"held", "coupling", "leading joint", "fixed"}


@dataclass(frozen=True, slots=True, eq=False)
class Cause:
    """Facts with a common cause.

    Attributes:
        groups: Groups of facts; several groups if their effects cancel and they are shown together.
        share: Share of the torque difference due to this cause alone; NaN if no change of a value reproduces it.
        kind: ``cause``; ``digits``, rounding of printed numbers; ``unseen``, no effect on torques; ``small``, several
            causes with small shares.
    """

    groups: tuple[tuple[Fact, ...], ...]
    share: float
    kind: Literal["cause", "digits", "unseen", "small"] = "cause"

    @property
    def facts(self) -> tuple[Fact, ...]:
        return tuple(fact for group in self.groups for fact in group)


def rank_causes(facts: Sequence[Fact], torques: Torques, known: Sequence[Sequence[Fact]] = ()) -> list[Cause]:
    """Rank causes: B as a whole, missing parts and large shares come before conventions, unseen facts and rounding.

    Args:
        known: Groups of facts that a single slip explains.
    """
    digits = sorted((fact for fact in facts if fact.kind == "digits"), key=lambda fact: -fact.size)
    ranked = _rank([fact for fact in facts if fact.kind != "digits"], torques, known)
    return [*ranked, *([Cause((tuple(digits),), 0.0, "digits")] if digits else [])]


#: Groups that are shown together, and their scaled effect on torques, which is None if no values reproduce them.
_Row = tuple[tuple[tuple[Fact, ...], ...], Array | None]


def _size(row: _Row) -> float:
    return 0.0 if row[1] is None else float(np.linalg.norm(row[1]))


def _share(row: _Row, total: Array) -> float:
    """Return the projection of an effect onto the total effect, as a share of the total."""
    return 0.0 if row[1] is None else float(np.vdot(total, row[1]) / np.vdot(total, total))


def _rank(facts: Sequence[Fact], torques: Torques, known: Sequence[Sequence[Fact]]) -> list[Cause]:
    rows = [_row([group], torques) for group in group_facts(facts, known)]
    sizes = {id(row[0][0]): _size(row) for row in rows}
    _, total = _row([groups[0] for groups, effect in rows if effect is not None], torques)
    ranked, seen = list[Cause](), list[_Row]()
    for groups, effect in rows:
        if effect is None:
            ranked.append(Cause(groups, math.nan))
        elif np.abs(effect).max(initial=0.0) > UNSEEN:
            seen.append((groups, effect))
        else:
            ranked.append(Cause(groups, 0.0, "unseen"))
    plain = [Cause(groups, 0.0) for groups, _ in seen]
    ranked += plain if total is None or not seen else _give_shares(seen, total, torques)
    ranked = [replace(each, groups=tuple(sorted(each.groups, key=lambda g: -sizes[id(g)]))) for each in ranked]
    return _merge_small(sorted(ranked, key=_order))


def _row(groups: Sequence[tuple[Fact, ...]], torques: Torques) -> _Row:
    facts = [fact for group in groups for fact in group]
    effect = torques.effect(facts) if facts and have_values(facts) else None
    return tuple(groups), None if effect is None else torques.project(effect)


def _give_shares(rows: list[_Row], total: Array, torques: Torques) -> list[Cause]:
    """Assign shares; while a share is out of bounds, merge the largest row with the row that best cancels it."""
    size = float(np.linalg.norm(total))
    if size < NOTHING * max(map(_size, rows)):
        return [Cause(tuple(group for groups, _ in rows for group in groups), math.nan)]
    low, high = CANCELS
    while len(rows) > 1 and not all(_size(row) <= high * size and low <= _share(row, total) <= high for row in rows):
        most = max(rows, key=_size)
        others = [row for row in rows if row is not most]
        joined = [_row((*most[0], *groups), torques) for groups, _ in others]
        least = min(range(len(others)), key=lambda i: _size(joined[i]))
        rows = [*others[:least], joined[least], *others[least + 1 :]]
    return [Cause(row[0], _share(row, total)) for row in rows]


def _order(cause: Cause) -> tuple[object, ...]:
    first = cause.facts[0]
    lacks = first.what in STRUCTURE and first.kind == "model"
    counts = math.isnan(cause.share) and all(fact.kind == "convention" for fact in cause.facts)
    share = 0.0 if math.isnan(cause.share) else cause.share
    size = 0.0 if math.isinf(first.size) else -first.size
    return (
        first.what in IDLE,
        first.what != "whole",
        not lacks,
        counts,
        cause.kind == "unseen",
        -share,
        first.kind != "model",
        size,
    )


def _merge_small(causes_: list[Cause]) -> list[Cause]:
    """Merge causes with small shares, and merge unseen causes that concern the same property."""
    tiny = [each for each in causes_ if each.kind == "cause" and 0.0 < abs(each.share) < SMALL]
    whats = dict.fromkeys(each.facts[0].what for each in causes_ if each.kind == "unseen")
    unseen = [[c for c in causes_ if c.kind == "unseen" and c.facts[0].what == what] for what in whats]
    for some in (tiny, *unseen):
        if len(some) < SEVERAL:
            continue
        if some is tiny:
            one = Cause(tuple(g for each in some for g in each.groups), sum(each.share for each in some), "small")
        else:
            one = Cause((tuple(fact for each in some for fact in each.facts),), 0.0, "unseen")
        causes_ = [*(each for each in causes_ if not any(each is other for other in some)), one]
    return causes_
