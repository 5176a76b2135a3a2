"""Facts of content that no typed entry of a reading holds, and what of it is not compared."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

from screwgauge.diagnosis.facts.fact import Fact, Pair, apart
from screwgauge.diagnosis.facts.structure import actuator_partners
from screwgauge.models.content import OTHER, Content, kinds
from screwgauge.models.readings.reading import Reading

#: Item of A and item of B, of which one may be missing.
_Both = tuple[Content | None, Content | None]


@dataclass(frozen=True, slots=True)
class Beyond:
    """Content of two models, by what becomes of it.

    Attributes:
        facts: Of what is compared.
        withheld: What is not compared and could differ, with its side; `aside`: what is outside the comparison.
    """

    facts: tuple[Fact, ...] = ()
    withheld: tuple[tuple[str, Content], ...] = ()
    aside: tuple[tuple[str, Content], ...] = ()


def content_of(pair: Pair) -> Beyond:
    """Compare content item by item, by what it acts on."""
    a, b = pair.a.reading, pair.b.reading
    names = {
        "joints": pair.back,
        "bodies": {other: name for name, other in pair.alignment.bodies.items()},
        "actuators": {other: name for name, other in actuator_partners(pair).items()},
    }
    alike = all(name == partner.name for name, partner in pair.joints.items())
    facts, fates = list[Fact](), {"withheld": list[tuple[str, Content]](), "aside": list[tuple[str, Content]]()}
    theirs = [each.renamed(names) for each in b.content]
    for one, other in _pairs(_kept(a.content, pair), _kept(theirs, pair)):
        fate = _fate(one, other, (a, b), alike=alike)
        if fate == "differs":
            facts.append(_fact(one, other))
        elif fate in fates:
            fates[fate] += [(side, each) for side, each in zip("AB", (one, other), strict=True) if each is not None]
    return Beyond(tuple(facts), tuple(fates["withheld"]), tuple(fates["aside"]))


def _kept(content: Iterable[Content], pair: Pair) -> list[Content]:
    """Content without what acts on joints of one side alone, which is told of these joints."""
    acts = [({name for room, name, _ in each.of if room == "joints"}, each) for each in content]
    return [each for joints, each in acts if not joints or joints & pair.joints.keys()]


def _pairs(a: Sequence[Content], b: Sequence[Content]) -> Iterator[_Both]:
    """Pair items that act on the same; among several of them those that say the same."""
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
    """Content by kind and by what it acts on; by its own name where that is nothing that has a partner."""
    groups = defaultdict[object, list[Content]](list)
    for each in content:
        element = each.what if not each.of or not kinds()[each.kind].arrays else ""
        acts = tuple(sorted((room, name) for room, name, _ in each.of))
        groups[each.kind, element, acts or each.whose].append(each)
    return groups


def _entries(a: Content, b: Content) -> Iterator[tuple[str, float | str, float | str]]:
    """Label and both values of all that two items of one length say."""
    for (_, name, x), (*_, y) in zip(sorted(a.of), sorted(b.of), strict=False):
        yield f"coefficient of {name}", x, y
    for (key, one), (_, other) in zip(a.values or (), b.values or (), strict=False):
        yield key, one, other


def _unlike(a: Content, b: Content) -> list[tuple[str, float | str, float | str]]:
    return [(key, x, y) for key, x, y in _entries(a, b) if _size(x, y)]


def _size(x: float | str, y: float | str) -> float:
    if isinstance(x, float) and isinstance(y, float):
        return apart(x, y)
    return 0.0 if x == y else math.inf


def _same(a: Content, b: Content) -> bool:
    """Whether both are known and say the same; numbers to rounding."""
    if a.values is None or b.values is None or len(a.of) != len(b.of) or len(a.values) != len(b.values):
        return False
    labels = all(key == other for (key, _), (other, _) in zip(a.values, b.values, strict=True))
    return labels and not _unlike(a, b)


def _fate(a: Content | None, b: Content | None, readings: tuple[Reading, Reading], *, alike: bool) -> str:
    """``same``, ``differs``, or a fate of `content.toml`.

    Args:
        alike: All joints have the same names in both.
    """
    one = a or b
    assert one is not None
    kind, both = kinds()[one.kind], a is not None and b is not None
    if kind.name == OTHER and alike and a is not None and b is not None and _same(a, b):
        return "same"  # whatever it means, both files say it in the same words of the same parts
    if kind.fate != "compared":
        return kind.fate
    if any(each is not None and each.values is None for each in (a, b)):
        return "withheld"
    texts = any(isinstance(value, str) for each in (a, b) if each for _, value in each.values or ())
    if texts and not alike:  # they have names of joints in them
        return "withheld"
    if both:
        return "same" if _same(a, b) else "differs"  # type: ignore[arg-type]
    mine, other = readings if b is None else readings[::-1]
    if kind.alone == "aside":
        return "differs" if mine.form == other.form else "aside" if mine.form != "mjcf" else "withheld"
    can_say = other.library == "mujoco" if kind.arrays else other.form == mine.form
    return "withheld" if kind.alone or not can_say else "differs"


def _fact(a: Content | None, b: Content | None) -> Fact:
    """A fact whose values are all numbers and texts that differ, by their labels."""
    one = a or b
    assert one is not None
    names = [each.whose.rpartition(" ")[2] if each else "" for each in (a, b)]
    if a is None or b is None:
        first, second = (None if each is None else dict[str, float | str]() for each in (a, b))
        return Fact(names[0] or names[1], one.kind, first, second, partner=names[1], of=one.sentence)
    unlike = _unlike(a, b)
    same_length = len(a.of) == len(b.of) and len(a.values or ()) == len(b.values or ())
    size = max((_size(x, y) for _, x, y in unlike), default=math.inf) if same_length else math.inf
    ours, theirs = ({key: pair[k] for key, *pair in unlike} for k in (0, 1))
    return Fact(names[0], one.kind, ours, theirs, "", size, partner=names[1], of=one.sentence)
