"""Formats facts and causes as sentences, from data alone."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from screwgauge.diagnosis.amounts import (
    WORLD,
    Axes,
    compare_values,
    count,
    format_value,
    freedoms,
    join,
    link_kind,
    noun,
    other_side,
    percent,
    step_in_axes,
    turn_and_way,
)
from screwgauge.diagnosis.causes.causes import Cause, factor_of, without_sides
from screwgauge.diagnosis.facts.fact import AXES, TOLERANCE, Fact
from screwgauge.diagnosis.machine.whole import Whole
from screwgauge.diagnosis.properties import PROPERTIES, ROOMS, UNITS
from screwgauge.models.content import kinds
from screwgauge.models.machine import Machine
from screwgauge.reference.errors import first_few
from screwgauge.reference.mechanism import GROUND

_NAMED = 3
#: Axes in which a transformation of the whole machine is described.
_THERE: Axes = ("the world", WORLD[1])
#: Kind of part that owns a property -> plural noun.
OWNERS = {"body": "bodies", "joint": "joints", "actuator": "actuators", "coupling": "couplings", "closure": "closures"}
#: Event of several joints -> predicate, followed by the model.
_SUBTREES = {
    "branch": "joints and their subtrees are missing from",
    "fixed": "joints do not move in",
    "link": "joints are missing from",
}
#: Properties whose name is plural.
_PLURAL = {"limits"}


@dataclass(frozen=True, slots=True)
class Speaker:
    """Describes differences (facts) between two machines in sentences.

    Attributes:
        a: Machine in whose frames facts are expressed.
        brief: Omit lists, vectors and consequences.
    """

    a: Machine
    brief: bool = False

    def cause(self, cause: Cause) -> str:
        """Describe a cause."""
        first, *rest = cause.groups
        if cause.kind == "digits":
            return self._digits(cause.facts)
        if cause.kind == "small":
            return self._remainder(cause)
        if not rest:
            return self.group(first)
        if self.brief:
            alike = len({nouns(group) for group in rest}) == 1
            names = [self.name([fact for group in rest for fact in group])] if alike else map(self.name, rest)
            return f"{self.group(first)}; partly cancelled by {first_few(names, 1)}"
        more = f"; and {len(rest) - 2} more" if len(rest) > 2 else ""
        return f"{self.group(first)}; partly cancelled by: {'; '.join(map(self.group, rest[:2]))}{more}"

    def group(self, facts: Sequence[Fact]) -> str:
        """Describe facts that a single edit would explain."""
        parts = list(dict.fromkeys(fact.part for fact in facts))
        if len(parts) > 1:
            return self._several(facts, parts)
        if self.brief:
            return self.sentence(facts[0])
        also = list(dict.fromkeys(noun(fact.what) for fact in facts[1:] if fact.what != facts[0].what))
        return self.sentence(facts[0]) + (f"; its {join(also)} differ{'s' * (len(also) == 1)}, too" if also else "")

    def sentence(self, fact: Fact) -> str:
        """Describe a fact."""
        if fact.what in kinds():
            return _content(fact, 1 if self.brief else _NAMED)
        if (tell := _TOLD.get(fact.what)) is not None:
            return tell(self, fact)
        if fact.what not in _SENTENCES:
            return _values(fact) + (_SAME.get(fact.what, "") if fact.kind == "convention" else "")
        text = re.sub(r"\[.*?\]" if self.brief else r"[\[\]]", "", _SENTENCES[fact.what])
        step = self.step(fact, "tilted" if fact.what == "axis" else "turned") if "{step}" in text else ""
        at = f", where it is fixed at {fact.of}" if fact.of else ""
        value = fact.a if fact.side == "A" else fact.b
        return text.format(fact=fact, step=step, at=at, value=value, other=other_side(fact.side))

    def name(self, facts: Sequence[Fact]) -> str:
        """Name the properties and parts of a group of facts: ``mass of upper``."""
        first, parts = facts[0], dict.fromkeys(fact.part for fact in facts)
        if first.what in kinds():
            return first.of if len(facts) == 1 else f"{first.what} ({len(facts)})"
        if not first.part:
            return nouns(facts)
        if _in_another_order(facts):
            return f"order of {len(parts)} joints"
        if len(parts) > 2:
            return f"{nouns(facts)} of {self._count_owners(facts, len(parts))}"
        whats = {part: nouns([fact for fact in facts if fact.part == part]) for part in parts}
        if len({*whats.values()}) == 1:
            return f"{whats[first.part]} of {join([*parts])}"
        return join([f"{what} of {part}" for part, what in whats.items()])

    def _several(self, facts: Sequence[Fact], parts: Sequence[str]) -> str:
        """Describe facts about several parts by what they have in common, or else by an example."""
        first, names = facts[0], "" if self.brief else f": {first_few(parts, _NAMED)}"
        if first.what in kinds():
            return f"{_content(first, 1)}; and {len(facts) - 1} more like it"
        if len({without_sides(part) for part in parts}) == 1:  # a left and a right part
            likewise = f"; {first_few(parts[1:], _NAMED)} likewise"
            return self.group([fact for fact in facts if fact.part == first.part]) + likewise
        if first.what == "name":
            pairs = first_few([f"{fact.a} is {fact.b}" for fact in facts], _NAMED)
            return f"{len(parts)} joints have the names of different joints in B{'' if self.brief else f': {pairs}'}"
        if first.what in _SUBTREES and not {fact.what for fact in facts} - {first.what}:
            return f"{len(parts)} {_SUBTREES[first.what]} {other_side(first.side)}{names}"
        if _in_another_order(facts):
            return f"{len(parts)} joints are in a different order in B"
        owners = self._count_owners(facts, len(parts))
        if {(fact.what, fact.side) for fact in facts} in ({("limits", "A")}, {("limits", "B")}):
            return f"{owners} have no limits in {other_side(first.side)}{names}"
        several = len({fact.what for fact in facts}) > 1
        if alike := _common_predicate(facts, several=several):
            return f"{nouns(facts)} of {owners} {alike}{names}"
        if len(parts) == 2:
            rest = [fact for fact in facts if fact.part != first.part]
            return f"{self.sentence(first)}; {self.name(rest)} differ{'s' * (len(rest) == 1)}, too"
        example = "" if self.brief else f"; for example: {self.sentence(first)}"
        one = not several and first.what not in _PLURAL
        return f"{self.name(facts)} differ{'s' * one}{example}"

    def _count_owners(self, facts: Sequence[Fact], n: int) -> str:
        """Count the owners of facts: ``all 4 joints``, ``3 bodies``."""
        owners = {PROPERTIES[fact.what].owner for fact in facts if fact.what in PROPERTIES}
        owner = owners.pop() if len(owners) == 1 else ""
        every = len(getattr(self.a.reading, ROOMS.get(owner, ""), ())) == n
        return f"{'all ' * every}{n} {OWNERS.get(owner, 'parts')}"

    def _digits(self, facts: Sequence[Fact]) -> str:
        values = count(len(facts), "value differs", "values differ")
        if all(fact.of == AXES for fact in facts):
            return f"{values} because of MuJoCo's compiler (casebook: {AXES})"
        most = "" if self.brief else f", by at most {facts[0].size:.1g} ({self.name(facts[:1])})"
        return f"{values} only in the rounding of printed digits{most}"

    def _remainder(self, cause: Cause) -> str:
        names = "" if self.brief else f": {first_few(map(self.name, cause.groups), _NAMED)}"
        share = f"{100.0 * abs(cause.share):.1g} % of the difference"
        return f"{len(cause.groups)} small differences contribute {share}{names}"

    def axes(self, *names: str) -> list[Axes]:
        """Return the axes of bodies, followed by the world axes."""
        bodies = self.a.reading.bodies
        own = {name: (f"{name} in A", bodies[name].pose[:3, :3]) for name in names if name in bodies}
        return [own.get(name, WORLD) for name in (*names, GROUND) if name in own or name == GROUND]

    def step(self, fact: Fact, turned: str = "turned") -> str:
        """Describe a displacement in the axes of the fact's body, or else of the body that the joint carries."""
        joint = fact.part.partition("/")[0]
        carried = [self.a.reading.moved_by(joint)] if joint in self.a.reading.joints else []
        return turn_and_way(np.asarray(fact.b), self.axes(fact.of, *carried), self.a.length, turned, brief=self.brief)


def _in_another_order(facts: Sequence[Fact]) -> bool:
    return {"axis", "name"} <= {fact.what for fact in facts}


def _of(fact: Fact, text: str) -> str:
    return f"{fact.part}: {text}" if fact.part else text


def _values(fact: Fact) -> str:
    """Describe the values of a property."""
    if fact.side:
        own = f"{format_value(fact.a if fact.side == 'A' else fact.b)} {fact.unit}".rstrip()
        return _of(fact, f"no {noun(fact.what)} in {other_side(fact.side)}; {own} in {fact.side}")
    return _of(
        fact, f"{noun(fact.what)} {compare_values(fact.what, np.asarray(fact.a), np.asarray(fact.b), fact.unit)}"
    )


def _common_predicate(facts: Sequence[Fact], *, several: bool) -> str:
    """Return a predicate for what many facts have in common; empty if they have nothing in common."""
    factor, verb = factor_of(facts[0]), "are" if several else "is"
    if factor is not None and all(factor_of(fact) == factor for fact in facts):
        return f"{verb} {factor:g} times as large in B ({percent(factor)})"
    sides = {fact.side for fact in facts}
    if len(sides) == 1 and "" not in sides:
        return f"{verb} in {sides.pop()} only"
    for none, own in (("A", "b"), ("B", "a")):
        if not several and not any(_has_value(fact, none) for fact in facts):
            values = {f"{float(np.abs(getattr(fact, own)).max()):.6g}" for fact in facts}
            some = f"{'up to ' * (len(values) > 1)}{max(values, key=float)} {facts[0].unit}".rstrip()
            return f"{verb} 0 in {none}, {some} in {other_side(none)}"
    return ""


def _has_value(fact: Fact, side: str) -> bool:
    """Return True if a model has a nonzero or non-numeric value."""
    value = fact.a if side == "A" else fact.b
    return bool(np.any(value)) if isinstance(value, np.ndarray | float | int) else True


def nouns(facts: Sequence[Fact]) -> str:
    """List the nouns for the properties of facts, without repetition."""
    order = dict.fromkeys([*PROPERTIES, *EVENTS, *(fact.what for fact in facts)])
    whats = sorted({fact.what for fact in facts}, key=[*order].index)
    return join([noun(what) for what in whats])


def _content(fact: Fact, most: int) -> str:
    if fact.side:
        return f"{fact.of} is in {fact.side} only"
    if not fact.a:
        return f"{fact.of} has more entries in one model than in the other"
    told = (f"{key} {_format(fact.b[key])} in B, {_format(fact.a[key])} in A" for key in fact.a)
    more = f"; and {len(fact.a) - most} more" if len(fact.a) > most else ""
    return f"{fact.of}: {'; '.join([*told][:most])}{more}"


def _format(value: float | str) -> str:
    return f"{value:.6g}" if isinstance(value, float) else value


def _zero(speaker: Speaker, fact: Fact) -> str:
    if fact.unit == "rad":
        amount = "" if speaker.brief else f" ({fact.b:+.6g} rad)"
        return _of(fact, f"in B its zero is turned by {math.degrees(fact.b):+.6g} deg about the axis{amount}")
    return _of(fact, f"in B its zero is shifted by {1e3 * fact.b:+.6g} mm along the axis")


def _end(speaker: Speaker, fact: Fact) -> str:
    return _of(fact, f"its {f'frame on {fact.of}' if fact.of else 'point'} is displaced in B, {speaker.step(fact)}")


def _kind(speaker: Speaker, fact: Fact) -> str:
    same = "; the loops allow the same motions" if fact.kind == "convention" else ""
    return f"{fact.part} is {link_kind(fact.b)} in B, {link_kind(fact.a)} in A{same}"


def _base(speaker: Speaker, fact: Fact) -> str:
    base = f"{freedoms(fact.b)} in B, {freedoms(fact.a)} in A"
    return f"{fact.part}: the base is modelled differently but moves the same way: {base}"


def _branch(speaker: Speaker, fact: Fact) -> str:
    carried = "its subtree" if speaker.brief else f"its subtree {first_few(fact.more, _NAMED)} ({fact.of} kg)"
    return f"{fact.part} is missing from {other_side(fact.side)}, with {carried}"


def _link(speaker: Speaker, fact: Fact) -> str:
    if not fact.more:
        weld = "weld " * ("weld" in (fact.a, fact.b))
        return f"{weld}{fact.part} is in {fact.side} only"
    return (
        f"{fact.part} is missing from {other_side(fact.side)}, and of its subtree only {first_few(fact.more, _NAMED)} "
        f"({fact.of} kg)"
    )


def _polynomial(speaker: Speaker, fact: Fact) -> str:
    a, b = np.asarray(fact.a, float), np.asarray(fact.b, float)
    if not fact.of:
        return f"{fact.part} is held at {compare_values('zero', a[0], b[0], '')}"
    if not fact.more:
        return _of(fact, f"its coupling to {fact.of} has the coefficients {compare_values('polynomial', a, b, '')}")
    parts = [np.split(each[1:], len(fact.more)) for each in (a, b)]
    told = [f"the constant {compare_values('polynomial', a[0], b[0], '')}"] if abs(a[0] - b[0]) > TOLERANCE else []
    for name, ours, theirs in zip(fact.more, *parts, strict=True):
        if np.abs(ours - theirs).max() > TOLERANCE:
            several = len(ours) > 1
            values = compare_values("polynomial", *((ours, theirs) if several else (ours[0], theirs[0])), "")
            told.append(f"the coefficient{'s' * several} of {name} {values}")
    return _of(fact, f"its coupling to {fact.of} has {', '.join(told)}")


def _leading_joint(speaker: Speaker, fact: Fact) -> str:
    told = [
        f"follows {lead}" if lead else f"is held at {value[0]:.6g}"
        for lead, value in zip(fact.more, (fact.a, fact.b), strict=True)
    ]
    return f"{fact.part} {told[1]} in B, but {told[0]} in A"


def _is_unit(factor: float, unit: str) -> bool:
    """Return True if a factor is 1 or the conversion factor of a commonly confused unit."""
    return factor == 1.0 or any(
        math.isclose(factor, x, rel_tol=1e-4) or math.isclose(factor, 1.0 / x, rel_tol=1e-4) for x in UNITS[unit]
    )


def _transformation(speaker: Speaker, fact: Fact) -> str:
    """Describe the transformation of the whole machine from A to B."""
    whole = fact.b
    assert isinstance(whole, Whole)
    mirror, step = whole.step
    if fact.of:
        turn = step_in_axes(step[0], [_THERE], "deg")
        return f"{fact.of}: in B its zero, and the whole model with it, is turned by {turn}"
    if whole.length == 1.0 and whole.mass == whole.inertia != 1.0 and np.allclose(whole.placement, np.eye(4)):
        weights = f"{whole.mass:.6g} times as large in B ({percent(whole.mass)})"
        return f"masses and inertias of all bodies are {weights}"
    factors = {"lengths": whole.length, "masses": whole.mass, "inertias": whole.inertia}
    units = [f"{name} {factor:.6g} times" for name, factor in factors.items() if factor != 1.0]
    known = all(_is_unit(factor, unit) for factor, unit in zip(factors.values(), ("m", "kg", "kg m^2"), strict=True))
    told = [f"{'in different units' if known else 'scaled'} ({join(units)} A's)"] if units else []
    told += [f"mirrored in {mirror}"] if mirror else []
    if np.abs(step).max() > 1e-9:
        told.append(turn_and_way(step, [_THERE], speaker.a.length, brief=speaker.brief))
    return f"B as a whole is {join(told)}" if units or mirror else f"B as a whole is displaced: {told[0]}"


#: Event or property -> sentence; brief sentences omit the text in brackets.
_SENTENCES = {
    "sign": "{fact.part} is measured in the opposite direction in B[ (its axis is reversed)]",
    "placement": "{fact.part} is displaced in B[, with its subtree]: {step}",
    "axis": "{fact.part}: in B its axis is {step}[; its child is not moved]",
    "start": "{fact.part} starts at a different pose in B, {step}[; a free body can perform the same motions]",
    "name": "{fact.part} is called {fact.b} in B, where {fact.part} is a different joint",
    "fixed": "{fact.part} does not move in {other}{at}[: its child and parent are one body there]",
    "held": "{fact.part} is held at {value:.6g} {fact.unit} in {fact.side} only",
    "coupling": "{fact.part} follows {value} in {fact.side} only",
    "actuator": "actuator {fact.part} of {fact.of} is in {fact.side} only",
    "driven joint": "actuator {fact.part} drives {fact.b} in B, {fact.a} in A",
}
#: Property -> text appended for a convention.
_SAME = {
    "gear": "; the motor is the same, because its joint is measured in the opposite direction",
    "limits": "; the numbers are the same, but measured from a different zero",
}
_TOLD: Mapping[str, Callable[[Speaker, Fact], str]] = {
    "whole": _transformation,
    "zero": _zero,
    "end": _end,
    "kind": _kind,
    "base": _base,
    "branch": _branch,
    "link": _link,
    "polynomial": _polynomial,
    "leading joint": _leading_joint,
}
#: Events that are not properties.
EVENTS = tuple(what for what in (*_TOLD, *_SENTENCES) if what not in PROPERTIES)
