"""Facts of one cause: one factor in many places, what many parts lack, a body, a joint."""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Callable, Hashable, Iterable, Sequence

import numpy as np

from screwgauge.diagnosis.facts.fact import Fact
from screwgauge.diagnosis.properties import INERTIAL, PROPERTIES
from screwgauge.models.content import kinds

#: From how many parts on a factor, or what all lack, is one cause; and how far each may be from the factor, relative.
SEVERAL, FACTOR = 3, 1e-5


def grouped(facts: Iterable[Fact], known: Sequence[Sequence[Fact]] = ()) -> list[tuple[Fact, ...]]:
    """All facts, each in one group; the largest groups first.

    Args:
        known: Facts of which something else tells that they are one, such as an edit that makes them all.
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
    return _mirrored(groups)


def _mirrored(groups: Sequence[tuple[Fact, ...]]) -> list[tuple[Fact, ...]]:
    """Groups, those of a left and a right part that differ alike as one."""
    alike = defaultdict[Hashable, list[tuple[Fact, ...]]](list)
    for i, group in enumerate(groups):
        parts = {fact.part for fact in group}
        name = sideless(group[0].part)
        largest = next((fact for fact in group if fact.what == "mass"), group[0])
        whats = f"{largest.size:.1e}", *sorted(fact.what for fact in group)
        alike[(name, whats) if len(parts) == 1 and name != group[0].part.lower() else i].append(group)
    return [tuple(fact for group in some for fact in group) for some in alike.values()]


def sideless(name: str) -> str:
    """A name without what distinguishes left and right."""
    return re.sub(r"[lr]", "~", re.sub(r"left|right", "~", name.lower()))


def factor_of(fact: Fact) -> float | None:
    """B's value over A's, where that is one number other than 1; None elsewhere."""
    if fact.what not in PROPERTIES or not (PROPERTIES[fact.what].scales or fact.what == "com"):
        return None
    if fact.a is None or fact.b is None:
        return None
    a, b = np.asarray(fact.a, float), np.asarray(fact.b, float)
    if not (np.any(a) and np.any(b)):
        return None
    factor = float(np.vdot(a, b) / np.vdot(a, a))
    fits = factor > 0.0 and np.linalg.norm(b - factor * a) <= FACTOR * np.linalg.norm(b)
    more = float(f"{factor - 1.0:.4g}")  # a factor near one has as many digits as another one
    return (1.0 + more if abs(more) < 0.1 else float(f"{factor:.5g}")) if fits and more else None


def _weight(fact: Fact) -> Hashable:
    """The factor of mass and inertia in one, as of another density."""
    return factor_of(fact) if fact.what in ("mass", "inertia") else None


def _scaled(fact: Fact) -> Hashable:
    factor = factor_of(fact)
    return factor and (fact.what, factor)


def _moved(fact: Fact) -> Hashable:
    """One value that many parts have and others have none of."""
    lacks = _lacks(fact)
    value = fact.b if fact.a is None or not np.any(fact.a) else fact.a
    return lacks and (*lacks, str(value))


def _lacks(fact: Fact) -> tuple[str, ...] | None:
    """The property that one side lacks, and which side."""
    if fact.what == "limits":
        return (fact.what, fact.side, fact.unit) if fact.side else None
    if fact.what not in PROPERTIES or PROPERTIES[fact.what].shape != () or fact.a is None or fact.b is None:
        return None
    if fact.what in ("zero", "sign", "mass"):
        return None
    none = ["A"] * (not np.any(fact.a)) + ["B"] * (not np.any(fact.b))
    return (fact.what, none[0]) if len(none) == 1 else None


def _absent(fact: Fact) -> Hashable:
    """What one side lacks, by which side and in which way."""
    return (fact.what, fact.side) if fact.what in ("branch", "fixed", "link") else None


def _content(fact: Fact) -> Hashable:
    return fact.what if fact.what in kinds() else None


def _named(fact: Fact) -> Hashable:
    return fact.what if fact.what == "name" else None


def _part(fact: Fact) -> Hashable:
    """A body with its mass properties; a joint with its place; a joint with what counts from it; all else by itself."""
    if fact.kind == "convention" and fact.what in ("zero", "limits", "rest"):
        return "zero", fact.part
    if fact.what in INERTIAL:
        return "body", fact.part
    if fact.what in ("placement", "axis"):
        return "place", fact.part
    return fact.what, fact.part, fact.of


_KEYS: Sequence[tuple[Callable[[Fact], Hashable], int]] = (
    (_content, SEVERAL),
    (_weight, SEVERAL),
    (_scaled, SEVERAL),
    (_moved, SEVERAL),
    (_lacks, SEVERAL),
    (_absent, SEVERAL),
    (_named, 2),
    (_part, 1),
)
