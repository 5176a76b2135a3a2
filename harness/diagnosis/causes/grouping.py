"""Differences as rows: rounding, a factor, a value, a body, a joint, a mirrored side, a kind of subtree is one each."""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Callable, Hashable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import reduce

import numpy as np

from screwgauge.diagnosis.causes.edits import Edit, Files, Group
from screwgauge.diagnosis.differences.difference import Difference, rounded
from screwgauge.diagnosis.patch import Opened
from screwgauge.diagnosis.properties import BODIES, INERTIAL, JOINTS, PLACES, PROPERTIES, applied, word, words
from screwgauge.models.content import kinds
from screwgauge.models.matter import Matter, combined, steps_of
from screwgauge.models.readings.reading import Reading
from screwgauge.reference.errors import first_few

#: What has a property that one factor may change in many places, in the singular and the plural.
OWNERS = {"body": ("body", "bodies"), "joint": ("joint", "joints"), "actuator": ("motor", "motors")}
SCALED = {name: OWNERS[each.owner] for name, each in PROPERTIES.items() if each.scales}
#: From how many places on a factor, or what has no relation, is one row; and how far each may be from it, relative.
SEVERAL, FACTOR = 3, 1e-5
#: What a factor or a swap leaves of a difference.
LEFT = 1e-6
#: What is said of one subtree -> of several alike.
_OF_SEVERAL = (
    (r"^ and \d+ joints? behind it: ", ", each with what is behind it: "),
    (r"with all that (?:it carries|they carry) \((.*?)\)", r"with all that they carry (\1 each)"),
    (
        r": does not move in (.), where what it carries is part of what is before it",
        r": do not move in \1, where what they carry is part of what is before them",
    ),
)
_NAMED = 3


@dataclass(frozen=True, slots=True, eq=False)
class Grouping:
    """What groups are made of.

    Attributes:
        differences: All of them.
        b: The reading that their changes are of; `files`: of both models.
        weight: How much a difference counts: of several in a row, the one that counts most is stated.
        edits: That make them.
        whole: Of those that one statement on the whole explains.
    """

    differences: Sequence[Difference]
    b: Reading
    files: Files
    weight: Callable[[int], float]
    edits: Sequence[Edit]
    whole: Group | None = None

    def groups(self) -> list[Group]:
        """All differences, each in one group."""
        texts = [file.xml.text() for file in (self.files.a, self.files.b) if file]
        told = self.whole.differences if self.whole else ()
        digits = [i for i in rounded(self.differences, texts) if i not in told]
        same_sentence: dict[str, list[int]] = defaultdict(list)  # shares of one body have that of the whole
        for i, each in enumerate(self.differences):
            if i not in digits and i not in told:
                same_sentence[each.sentence].append(i)
        groups = [self._single(numbers) for numbers in same_sentence.values()]
        steps = (
            *(self._swapped, self._scaled, self._factors, self._slips, self._subtrees, self._of_one_part),
            *(self._same_words, self._mirrored, self._content, self._renamed),
        )
        for merge in steps:
            groups = merge(groups)
        return [*([self.whole] if self.whole else []), *groups, *self._digits(digits)]

    def _single(self, numbers: Sequence[int]) -> Group:
        one = self.differences[numbers[0]]
        return Group(titled(one), one.sentence, tuple(numbers), one.sentence, family(one))

    def _first(self, group: Group) -> Difference:
        return self.differences[group.differences[0]]

    def _heaviest(self, members: Iterable[Group]) -> list[Group]:
        return sorted(members, key=lambda group: -self.weight(group.differences[0]))

    def _names(self, members: Iterable[Group]) -> str:
        return first_few([_item(self._first(member)) for member in members], _NAMED)

    def _digits(self, numbers: Sequence[int]) -> Iterator[Group]:
        """Rounding, by what rounds."""
        by_reason: dict[str, list[int]] = defaultdict(list)
        for i in numbers:
            each = self.differences[i]
            by_reason[each.sentence.rpartition(": ")[2] if each.kind == "digits" else "one file has few"].append(i)
        for reason, some in by_reason.items():
            largest = max((self.differences[i] for i in some), key=lambda one: one.size)
            why = reason.removeprefix("rounding, ")
            sentence = f"{len(some)} values differ only in rounding of printed digits ({why})"
            sentence += f", at most {largest.size:.1g} of the value ({titled(largest)})"
            sentence = self.differences[some[0]].sentence if len(some) == 1 else sentence
            yield Group("digits that are printed in a file", sentence, tuple(some), sentence, "digits")

    def _swapped(self, groups: list[Group]) -> list[Group]:
        """Two parts of which each has the mass of the other one."""
        masses = {i: group for i, group in enumerate(groups) if self._first(group).what == "mass"}
        for i, one in masses.items():
            for k, two in masses.items():
                pairs = [(self._first(each).whole or (self._first(each).a, self._first(each).b)) for each in (one, two)]
                if k <= i or any(None in pair for pair in pairs):
                    continue
                (a, b), (c, d) = ((float(x), float(y)) for x, y in pairs)  # type: ignore[arg-type]
                if max(abs(a - d), abs(b - c)) < LEFT * abs(a - c):
                    names = [_item(self._first(each)) for each in (one, two)]
                    sentence = f"masses of {names[0]} and {names[1]} are swapped: {one.sentence}"
                    numbers = (*one.differences, *two.differences)
                    swap = Group(f"masses of {names[0]} and {names[1]}", sentence, numbers, sentence, one.family)
                    return [swap if n == i else each for n, each in enumerate(groups) if n != k]
        return groups

    def _scaled(self, groups: list[Group]) -> list[Group]:
        """Masses of several bodies, each of one link or more, that are those of A times one number."""
        own: dict[str, list[Group]] = defaultdict(list)
        for group in groups:
            one = self._first(group)
            if one.change is not None and one.what in INERTIAL:
                own[one.change.item].append(group)
        own = {name: some for name, some in own.items() if any(self._first(each).what == "mass" for each in some)}
        if len(own) < SEVERAL:
            return groups
        changes = {
            name: [self.differences[i].change for g in some for i in g.differences] for name, some in own.items()
        }
        after = {name: applied(self.b, filter(None, some)).bodies[name] for name, some in changes.items()}
        ratios = [self.b.bodies[name].mass / after[name].mass for name in own if after[name].mass]
        ratio = float(np.median(ratios)) if ratios else 0.0
        if not ratio:  # most of them have no mass in B, which is no scale
            return groups
        for noun, both in (("masses", False), ("masses and inertias", True)):
            fits = [name for name in own if _fits(self.b, self.files.b, name, after[name], ratio, both)]
            if len(fits) >= SEVERAL:
                members = [group for name in fits for group in own[name]]
                ones = [self._first(next(g for g in own[name] if self._first(g).what == "mass")) for name in fits]
                return _replaced(groups, members, self._of_factor(ones, "times", float(f"{ratio:.5g}"), noun, members))
        return groups

    def _factors(self, groups: list[Group]) -> list[Group]:
        """Groups with one factor, or one value, in many places, merged."""

        def key(group: Group) -> Hashable:
            one = self._first(group)
            single = one.what in SCALED and one.kind == "model" and group.sentence == one.sentence
            how = _factor(one) if single else None
            return how and (one.what, *how)

        def row(members: list[Group]) -> Group:
            ones = [self._first(member) for member in members]
            how = _factor(ones[0])
            assert how is not None
            return self._of_factor(ones, *how, words(ones[0].what), members)

        return _merged(groups, key, row, SEVERAL)

    def _of_factor(
        self, ones: Sequence[Difference], how: str, value: float, noun: str, members: Sequence[Group]
    ) -> Group:
        what, b = ones[0].what, self.b
        one, many = SCALED[what]
        solid = [body for body in b.bodies.values() if body.mass]
        all_ = len(b.joints if one == "joint" else b.actuators if one == "motor" else solid)
        who = f"all {len(ones)} {many}" if len(ones) >= all_ else f"{len(ones)} of {all_} {many}"
        names = first_few([_item(each) for each in ones], _NAMED)
        unit = PROPERTIES[what].units.get(value, "")
        percent = f"{100.0 * (value - 1.0):+.2f} %" if 0.0 < value < 10.0 else f"x {value:g}"
        meant = f", as if written {unit}" if unit else ""
        how_much = (
            f"{value:g} times those of A in B ({percent}{meant}: {names})"
            if value
            else f"0 in B, {_common(ones)} in A ({names})"
        )
        how_much = f"{value:g} {ones[0].unit} in B, 0 in A ({names})" if how == "is" else how_much
        sentence = f"{noun} of {who}: {how_much}"
        return Group(f"{noun} of {who}", sentence, _numbers(members), sentence, members[0].family)

    def _slips(self, groups: list[Group]) -> list[Group]:
        """Groups with one slip in several places, merged."""
        slips = {edit.differences[0]: edit.slips for edit in self.edits if len(edit.differences) == 1}
        counts: dict[str, int] = defaultdict(int)
        for group in groups:
            for slip in slips.get(group.differences[0], ()):
                counts[slip] += 1

        def key(group: Group) -> Hashable:
            own = slips.get(group.differences[0], ())
            return max(own, key=lambda slip: counts[slip]) if own else None

        def row(members: list[Group]) -> Group:
            first, *_ = members = self._heaviest(members)
            name = f"{key(first)} in {len(members)} places ({self._names(members)})"
            return Group(name, f"{name}: {first.sentence}", _numbers(members), name, first.family)

        return _merged(groups, key, row)

    def _subtrees(self, groups: list[Group]) -> list[Group]:
        """Subtrees of one make that one model lacks; joints that one model holds."""

        def key(group: Group) -> Hashable:
            one = self._first(group)
            tail = one.sentence.removeprefix(_item(one))
            return (bool(one.item_a), tail) if one.what == "branch" else None

        def row(members: list[Group]) -> Group:
            tail = members[0].sentence.removeprefix(_item(self._first(members[0])))
            for one, many in _OF_SEVERAL:
                tail = re.sub(one, many, tail)
            sentence = f"{self._names(members)}{tail}"
            return Group(f"{len(members)} subtrees", sentence, _numbers(members), sentence, members[0].family)

        return _merged(groups, key, row)

    def _renamed(self, groups: list[Group]) -> list[Group]:
        """Joints that have other names in B, such as numbers that are shifted."""

        def key(group: Group) -> Hashable:
            one = self._first(group)
            return "name" if one.what == "name" and one.kind == "convention" else None

        def row(members: list[Group]) -> Group:
            pairs = [(one.item_a, one.item_b) for one in map(self._first, members)]
            names = first_few([f"{a} is {b}" for a, b in pairs], _NAMED)
            sentence = f"{len(pairs)} joints have other names in B, in part those of others: {names}"
            return Group("names of joints", sentence, _numbers(members), sentence, members[0].family)

        return _merged(groups, key, row, SEVERAL)

    def _same_words(self, groups: list[Group]) -> list[Group]:
        """Groups that say the same values of several parts, merged."""

        def key(group: Group) -> Hashable:
            one = self._first(group)
            if one.sentence != group.sentence or one.what not in (*SCALED, "limits", "rest", *PLACES):
                return None
            scalar = one.what in SCALED and one.what != "inertia" and one.kind == "model"
            return one.what, str(one.whole or (one.a, one.b)) if scalar else _words(one)

        def row(members: list[Group]) -> Group:
            members = self._heaviest(members)
            one = self._first(members[0])
            sentence = f"{self._names(members)}, each: {_words(one)}"
            noun = f"{words(one.what)} in {len(members)} places"
            return Group(noun, sentence, _numbers(members), sentence, members[0].family)

        return _merged(groups, key, row)

    def _of_one_part(self, groups: list[Group]) -> list[Group]:
        """The mass properties of a body; the place of a joint."""

        def key(group: Group) -> Hashable:
            one = self._first(group)
            alone = group.sentence == one.sentence and group.family in (BODIES, JOINTS)
            return (group.family, _item(one)) if alone else None

        def row(members: list[Group]) -> Group:
            members = self._heaviest(members)
            first, *others = (self._first(member) for member in members)
            nouns = list(dict.fromkeys(word(each.what) for each in others if each.what != first.what))
            sentence = "; ".join([first.sentence, *map(_words, others)])
            short = f"{first.sentence}, and its {' and '.join(nouns)}" if nouns else first.sentence
            noun = "mass properties" if members[0].family == BODIES else "place"
            return Group(f"{noun} of {_item(first)}", sentence, _numbers(members), short, members[0].family)

        return _merged(groups, key, row)

    def _mirrored(self, groups: list[Group]) -> list[Group]:
        """What differs alike on the left and on the right."""

        def key(group: Group) -> Hashable:
            ones = {self.differences[i].what: self.differences[i] for i in group.differences}
            item, *others = {_item(self.differences[i]) for i in group.differences}
            if others or (sideless := _sideless(item)) == item.lower():
                return None
            largest = ones.get("mass", self._first(group))
            return sideless, tuple(sorted(ones)), f"{largest.size:.1e}"

        def row(members: list[Group]) -> Group:
            first, *others = self._heaviest(members)
            also = f"; {self._names(others)} likewise"
            sentence, short = first.sentence + also, first.short + also
            return replace(first, sentence=sentence, short=short, differences=_numbers((first, *others)))

        return _merged(groups, key, row)

    def _content(self, groups: list[Group]) -> list[Group]:
        """What no typed entry of a reading holds, by its kind."""

        def key(group: Group) -> Hashable:
            one = self._first(group)
            return one.what if one.what in kinds() else None

        return _merged(groups, key, together, SEVERAL)


def together(members: Sequence[Group]) -> Group:
    """Groups of one family that differ in unlike ways, of which the first is stated."""
    first, numbers = members[0], _numbers(members)
    name = f"{first.family}, {len(numbers)} differences"
    sentence = f"{name}: {first.short}; and {len(numbers) - len(first.differences)} more"
    return Group(name, sentence, numbers, sentence, first.family)


def titled(one: Difference) -> str:
    """What it is of which part."""
    item = one.item_b or one.item_a
    return f"{word(one.what)} of {item}" if item else word(one.what)


def family(one: Difference) -> str:
    """What it is a property of, in the plural."""
    return (PROPERTIES[one.what].row if one.what in PROPERTIES else "") or words(one.what)


def _merged(
    groups: Sequence[Group], key: Callable[[Group], Hashable], row: Callable[[list[Group]], Group], least: int = 2
) -> list[Group]:
    """Groups with the same key as one, where there are enough of them; a key of None is nobody's."""
    alike: dict[Hashable, list[Group]] = defaultdict(list)
    for group in groups:
        if (of := key(group)) is not None:
            alike[of].append(group)
    out = list(groups)
    for members in alike.values():
        if len(members) >= least:
            out = _replaced(out, members, row(members))
    return out


def _replaced(groups: Sequence[Group], members: Sequence[Group], by: Group) -> list[Group]:
    """One group in place of several, where the first of them was."""
    out = [by if group is members[0] else group for group in groups]
    return [group for group in out if all(group is not member for member in members)]


def _numbers(members: Iterable[Group]) -> tuple[int, ...]:
    return tuple(i for member in members for i in member.differences)


def _item(one: Difference) -> str:
    return one.item_a or one.item_b


def _words(one: Difference) -> str:
    """Sentence of a difference without its item."""
    return one.sentence.removeprefix(f"{_item(one)}: ").removeprefix(f"{one.item_b}: ")


def _common(ones: Sequence[Difference]) -> str:
    """Value of all in A; ``not 0`` if they have several."""
    values = {f"{value:.4g}" for one in ones if one.a is not None for value in np.ravel(one.a)}
    return f"{values.pop()} {ones[0].unit}" if len(values) == 1 else "not 0"


def _factor(each: Difference) -> tuple[str, float] | None:
    """``times`` and what B's value is of A's, or ``is`` and the value where A has none."""
    if each.a is None or each.b is None:
        return None
    a, b = each.whole if each.whole and each.whole[0] is not None else (each.a, each.b)
    a, b = np.asarray(a, dtype=float).ravel(), np.asarray(b, dtype=float).ravel()
    square = float(a @ a)
    if square == 0.0:
        return ("is", float(f"{b[0]:.6g}")) if len(b) == 1 else None
    factor = float(a @ b) / square
    fits = float(np.abs(b - factor * a).max()) <= FACTOR * float(np.abs(b).max())
    factor = float(f"{factor:.5g}")
    return ("times", factor) if fits and factor != 1.0 else None


def _fits(b: Reading, file: Opened | None, name: str, after: Matter, ratio: float, both: bool) -> bool:
    """Whether a body of A is that of B, each of its links divided by the ratio."""
    before = b.bodies[name]
    parts = [*file.parts(name).values()] if file else [before]
    smaller = [replace(p, mass=p.mass / ratio, inertia=p.inertia / (ratio if both else 1.0)) for p in parts if p.mass]
    if not smaller:
        return False
    left, step = (max(steps_of(matter, after).values()) for matter in (reduce(combined, smaller), before))
    return left <= LEFT * step


def _sideless(name: str) -> str:
    """A name without what distinguishes left and right."""
    return re.sub(r"[lr]", "~", re.sub(r"left|right", "~", name.lower()))
