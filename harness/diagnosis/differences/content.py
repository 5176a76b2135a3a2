"""Content of two models that no typed entry of a reading holds: compared item by item, or said not to be.

Two models that agree in all else are not called the same where content is present that is not compared.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

from screwgauge.diagnosis.differences.difference import Difference, differ
from screwgauge.diagnosis.pairing.common import Common
from screwgauge.models.content import OTHER, Content, Values, kinds, phrases
from screwgauge.models.readings.reading import Reading

#: Item of A and item of B, of which one may be missing.
_Pair = tuple[Content | None, Content | None]


@dataclass(frozen=True, slots=True)
class Beyond:
    """What became of all content.

    Attributes:
        differences: Of what is compared.
        withheld: What is not compared and could differ, one phrase each, with its side.
        aside: What is outside the comparison, likewise.
    """

    differences: tuple[Difference, ...] = ()
    withheld: tuple[str, ...] = ()
    aside: tuple[str, ...] = ()


def beyond(common: Common) -> Beyond:
    """Compares the content of two models in common names."""
    named_alike = all(name == other for name, other in common.own["joints"].items())
    fates: dict[str, list[tuple[str, Content]]] = {"withheld": [], "aside": []}
    differences = list[Difference]()
    both = {*common.a.joints} & {*common.b.joints}
    for a, b in _pairs(*(_kept(each.content, both) for each in (common.a, common.b))):
        fate = _fate(a, b, (common.a, common.b), named_alike=named_alike)
        sides = [(side, each) for side, each in zip("AB", (a, b), strict=True) if each is not None]
        if fate == "differs":
            differences.append(_difference(a, b))
        elif fate in fates:
            fates[fate] += sides
    return Beyond(tuple(differences), *(tuple(_sided(fates[fate])) for fate in ("withheld", "aside")))


def _kept(content: Iterable[Content], joints: Collection[str]) -> list[Content]:
    """Content that acts on joints of both models; what acts on other joints alone is said of these joints."""
    kept = []
    for each in content:
        acts = {name for room, name, _ in each.of if room == "joints"}
        if not acts or acts & {*joints}:
            kept.append(each)
    return kept


def _pairs(a: Sequence[Content], b: Sequence[Content]) -> Iterator[_Pair]:
    """Items that act on the same; among several of them those that say the same."""
    ours, theirs = _grouped(a), _grouped(b)
    for key in dict.fromkeys((*ours, *theirs)):
        mine, others = list(ours.get(key, ())), list(theirs.get(key, ()))
        for each in list(mine):
            if partner := next((other for other in others if _same(each, other)), None):
                mine.remove(each)
                others.remove(partner)
                yield each, partner
        both = min(len(mine), len(others))
        yield from zip(mine[:both], others[:both], strict=True)
        yield from ((each, None) for each in mine[both:])
        yield from ((None, each) for each in others[both:])


def _grouped(content: Iterable[Content]) -> Mapping[object, list[Content]]:
    """Content by kind and by what it acts on; by its own names where that is nothing that has a partner."""
    groups: dict[object, list[Content]] = {}
    for each in content:
        element = each.what if not each.of or not kinds()[each.kind].arrays else ""
        key = (each.kind, element, tuple((room, name) for room, name, _ in each.of) or each.whose)
        groups.setdefault(key, []).append(each)
    return groups


def _same(a: Content, b: Content) -> bool:
    """Whether both are known and say the same; numbers to rounding."""
    if a.values is None or b.values is None or len(a.of) != len(b.of):
        return False
    shares = all(_alike(x, y) for (*_, x), (*_, y) in zip(a.of, b.of, strict=True))
    return shares and _equal(a.values, b.values)


def _equal(a: Values, b: Values) -> bool:
    """Whether labels and values are."""
    entries = zip(a, b, strict=False)
    return len(a) == len(b) and all(key == other and _alike(x, y) for (key, x), (other, y) in entries)


def _alike(x: float | str, y: float | str) -> bool:
    return not differ(x, y) if isinstance(x, float) and isinstance(y, float) else x == y


def _fate(a: Content | None, b: Content | None, readings: tuple[Reading, Reading], *, named_alike: bool) -> str:
    """``same``, ``differs``, or a fate of `content.toml`."""
    one = a or b
    assert one is not None
    kind = kinds()[one.kind]
    if kind.name == OTHER and named_alike and a is not None and b is not None and _same(a, b):
        return "same"  # whatever it means, both files say it in the same words of the same parts
    if kind.fate != "compared":
        return kind.fate
    if any(each is not None and each.values is None for each in (a, b)):
        return "withheld"
    texts = any(isinstance(value, str) for each in (a, b) if each for _, value in each.values or ())
    if texts and not named_alike:  # they have names of joints in them
        return "withheld"
    if a is not None and b is not None:
        return "same" if _same(a, b) else "differs"
    mine, other = readings if b is None else readings[::-1]
    if kind.alone == "aside":
        return "differs" if mine.form == other.form else "aside" if mine.form == "urdf" else "withheld"
    can_say = other.library == "mujoco" if kind.arrays else other.form == mine.form
    return "withheld" if kind.alone or not can_say else "differs"


def _difference(a: Content | None, b: Content | None) -> Difference:
    """Difference in words, with the first number that differs."""
    one = a or b
    assert one is not None
    if a is None or b is None:
        sentence = f"{one.sentence}: in {'A' if b is None else 'B'} only"
    else:
        sentence = f"{one.sentence}: {_first(a, b)}"
    named = [each.whose.rpartition(" ")[2] if each else "" for each in (a, b)]
    return Difference(named[0], named[1], one.kind, None, None, "", math.inf, sentence)


def _first(a: Content, b: Content) -> str:
    """What differs first."""
    for (_, name, mine), (_, _, other) in zip(a.of, b.of, strict=False):
        if not _alike(mine, other):
            return f"{other:.6g} of {name} in B, {mine:.6g} in A"
    for (key, x), (label, y) in zip(a.values or (), b.values or (), strict=False):
        if key != label or not _alike(x, y):
            values = [f"{value:.6g}" if isinstance(value, float) else value for value in (y, x)]
            return f"{key} {values[0]} in B, {values[1]} in A"
    return "more entries in one than in the other"


def _sided(content: Sequence[tuple[str, Content]]) -> Iterator[str]:
    """One phrase for all of the same name, with the sides that have it."""
    phrases_of = {side: phrases(each for where, each in content if where == side) for side in "AB"}
    for phrase in dict.fromkeys((*phrases_of["A"], *phrases_of["B"])):
        yield f"{phrase} in {' and '.join(side for side in 'AB' if phrase in phrases_of[side])}"
