"""The answer of a diagnosis in words: headline, explanation, differences, causes, notes, and what is not compared."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from screwgauge.diagnosis.assumptions import not_compared, notes
from screwgauge.diagnosis.phrases import phrase
from screwgauge.diagnosis.properties import word
from screwgauge.diagnosis.sentences import explanation, news
from screwgauge.diagnosis.words import Speaker
from screwgauge.models.content import kinds

if TYPE_CHECKING:
    from screwgauge.diagnosis.causes.causes import Cause
    from screwgauge.diagnosis.facts.fact import Fact, Pair
    from screwgauge.diagnosis.findings import Findings
    from screwgauge.models.readings.reading import Reading

#: Words of a headline at most.
WORDS = 30
#: Family of causes -> what they are of; all else is of geometry.
_FAMILIES = {
    "inertia": ("mass", "com", "inertia", "gravcomp"),
    "rotor": ("armature",),
    "friction": ("damping", "friction"),
    "spring": ("stiffness", "rest"),
    "actuator": ("actuator", "driven joint", "gear"),
    "limit": ("limits",),
    "loop": ("coupling", "held", "leading joint", "polynomial", "softness"),
    "environment": ("density", "gravity", "viscosity"),
}
FAMILIES = {what: family for family, whats in _FAMILIES.items() for what in whats}


@dataclass(frozen=True, slots=True, eq=False)
class Difference:
    """A fact in words.

    Attributes:
        item_a, item_b: What it is of, as each file calls it; empty of a side that lacks it, and of the model.
        what: Property or event.
        a, b: Values in A's frames and counting; a step from A to B is a rotation vector [rad] and a way [m].
        size: Relative, or in lengths of the machine and rad; infinite where a side has none.
        kind: ``model``; ``convention``, which changes no motion; ``digits``, rounding of printed numbers.
    """

    item_a: str
    item_b: str
    what: str
    a: Any
    b: Any
    unit: str
    size: float
    kind: str
    sentence: str


@dataclass(frozen=True, slots=True)
class ToldCause:
    """A cause in words.

    Attributes:
        name: What it is of, in a few words.
        sentence: What differs, and what somebody may have done; `short` without details.
        kind: ``cause``; ``digits``, rounding of printed numbers; ``unseen``, what no torque shows; ``small``, several
            of little weight.
        share: Of the torque difference, that cause alone; NaN where no value makes it.
        family: ``geometry``, ``inertia``, ``rotor``, ``friction``, ``spring``, ``actuator``, ``limit``, ``loop``,
            ``environment`` or ``content``; empty of rounding.
        differences: Numbers of its differences.
        slips: What somebody may have done.
    """

    name: str
    sentence: str
    short: str
    kind: str
    share: float
    family: str
    differences: tuple[int, ...]
    slips: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True, eq=False)
class Words:
    """All that a diagnosis says."""

    headline: str
    explanation: str
    differences: tuple[Difference, ...]
    causes: tuple[ToldCause, ...]
    notes: tuple[str, ...]
    not_compared: tuple[str, ...]
    not_fixed: tuple[str, ...]


def words_of(findings: Findings) -> Words:
    """Make all words of a diagnosis."""
    causes = tuple(_causes(findings))
    first, *rest = [*([headline(findings, causes)] if causes else []), *news(findings)]
    return Words(
        first,
        " ".join([*explanation(findings), *rest]),
        tuple(differences_of(findings.pair, findings.facts)),
        causes,
        tuple(notes(findings)),
        tuple(not_compared(findings)),
        tuple(_not_fixed(findings)),
    )


def _not_fixed(findings: Findings) -> Iterator[str]:
    """Say what the corrected file does not correct, and why."""
    if findings.fix is not None:
        yield from findings.fix.why_not
        yield from (f"{findings.b.library} reads no {word(what)} from the file" for what in findings.fix.unheard)
        speaker = Speaker(findings.pair.a)
        yield from (f"no value in B's file mends this: {speaker.sentence(fact)}" for fact in findings.open_facts)


def headline(findings: Findings, told: Sequence[ToldCause]) -> str:
    """Tell the first cause in at most `WORDS` words, and count the others."""
    others = sum(cause.kind != "digits" for cause in told[1:])
    more = f", and {others} more cause{'s' * (others > 1)}" if others else ""
    brief = Speaker(findings.pair.a, brief=True).cause(findings.causes[0])
    reason = f"{told[0].name}: {told[0].slips[0]}" if told[0].slips else brief
    shorter = (brief, reason) if len(findings.causes[0].groups) > 1 else (reason, brief)
    texts = (told[0].sentence, told[0].short, *shorter, f"{told[0].name} differs")
    fitting = (text for text in texts if len(f"{text}{more}".split()) <= WORDS)
    return f"{next(fitting, texts[-1])}{more}."


def _causes(findings: Findings) -> Iterator[ToldCause]:
    numbers = {id(fact): i for i, fact in enumerate(findings.facts)}
    full, brief = (Speaker(findings.pair.a, brief) for brief in (False, True))
    for cause in findings.causes:
        slips = tuple(_slips(findings, cause))
        sentence = "; ".join([full.cause(cause), *slips])
        short = "; ".join([brief.cause(cause), *slips[:1]])
        of = tuple(numbers[id(fact)] for fact in cause.facts)
        of_all = "" if cause.kind == "digits" else family(cause.facts)
        yield ToldCause(_name(full, cause), sentence, short, cause.kind, cause.share, of_all, of, slips)


def _slips(findings: Findings, cause: Cause) -> Iterator[str]:
    """Say what somebody may have done to make a cause."""
    facts = {id(fact) for fact in cause.facts}
    if cause.kind != "digits":
        reasons = (each for each in findings.reasons if any(id(fact) in facts for fact in each.facts))
        yield from map(phrase, reasons)


def _name(speaker: Speaker, cause: Cause) -> str:
    if cause.kind in ("digits", "small"):
        return {"digits": "printed digits", "small": "small differences"}[cause.kind]
    rest = f" and {len(cause.groups) - 1} more" if len(cause.groups) > 1 else ""
    return speaker.name(cause.groups[0]) + rest


def family(facts: Sequence[Fact]) -> str:
    """Family of some facts: that of the first."""
    first = facts[0]
    if first.what == "whole" and first.b.length == 1.0 and not first.b.mirrored and not first.b.stands:
        return "inertia"
    return "content" if first.what in kinds() else FAMILIES.get(first.what, "geometry")


def differences_of(pair: Pair, facts: Sequence[Fact]) -> Iterator[Difference]:
    """Tell facts one by one."""
    speaker, a = Speaker(pair.a), pair.a.reading
    partners = {name: partner.name for name, partner in pair.joints.items()}
    for fact in facts:
        item_a = fact.part if fact.side != "B" or _has(a, fact.part) else ""
        item_b = fact.partner or partners.get(fact.part, "") or (fact.part if item_a != fact.part else "")
        values = fact.what, fact.a, fact.b, fact.unit, fact.size, fact.kind
        yield Difference(item_a, item_b, *values, speaker.sentence(fact))


def _has(reading: Reading, name: str) -> bool:
    rooms = (reading.bodies, reading.joints, reading.closures, reading.couplings, reading.actuators)
    return any(name in room for room in rooms)
