"""Formats a diagnosis as text: headline, explanation, differences, causes with their slips, notes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from screwgauge.diagnosis.amounts import join, noun
from screwgauge.diagnosis.fix import write_fix
from screwgauge.diagnosis.properties import PROPERTIES, noun_of
from screwgauge.diagnosis.sentences import explanation, news, not_compared, notes
from screwgauge.diagnosis.words import EVENTS, Speaker
from screwgauge.models.content import kinds
from screwgauge.models.readings.read import implausible
from screwgauge.reference.errors import OutputError

if TYPE_CHECKING:
    from screwgauge.diagnosis.causes.causes import Cause
    from screwgauge.diagnosis.causes.reasons import Reason
    from screwgauge.diagnosis.facts.fact import Fact
    from screwgauge.diagnosis.findings import Findings
    from screwgauge.diagnosis.machine.pair import Pair
    from screwgauge.diagnosis.model import Model
    from screwgauge.models.readings.reading import Reading

#: Maximum number of words in a headline.
WORDS = 30
#: Family of causes -> its properties; all other properties belong to geometry.
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
    """A difference between the models (a fact), with the sentence that describes it.

    Attributes:
        item_a, item_b: Name of the part in each file; empty if that file lacks the part, and for the model as a whole.
        what: Property or event.
        a, b: Values in A's frames and coordinates; a step from A to B is a rotation vector [rad] and a translation [m].
        size: Relative difference, or difference in machine lengths and rad; infinite if a model lacks the value.
        kind: ``model``; ``convention``, which does not change the motion; ``digits``, rounding of printed numbers.
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
    """A cause with the sentences that describe it.

    Attributes:
        name: Short name: the property and the parts that differ in it.
        sentence: Description of the difference and the likely slips; `short` omits details.
        kind: ``cause``; ``digits``, rounding of printed numbers; ``unseen``, no effect on torques; ``small``, several
            causes with small shares.
        share: Share of the torque difference due to this cause alone; NaN if no change of a value reproduces it.
        family: ``geometry``, ``inertia``, ``rotor``, ``friction``, ``spring``, ``actuator``, ``limit``, ``loop``,
            ``environment`` or ``content``; empty for rounding.
        differences: Indices into `Diagnosis.differences`.
        slips: Phrases that name the likely mistakes behind the cause.
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
class Diagnosis:
    """The result of comparing two models: differences, causes and proof.

    Attributes:
        found: All findings, as data.
        headline: One sentence that names the first difference, or states that there is none.
        explanation: Further sentences: effect of the causes, proof, and other findings.
        differences: Facts and the sentences that describe them, ordered from the ground outwards.
        causes: Differences grouped by cause, the most important cause first.
        notes: Assumptions, and content that was not compared.
        not_compared: Phrases that name content that could differ but is not compared, and the model that contains it.
        not_fixed: Differences that remain in the file that `write_fix` writes, and why.
        date: Time of the comparison, ISO 8601 in UTC.
    """

    found: Findings
    headline: str
    explanation: str
    differences: tuple[Difference, ...]
    causes: tuple[ToldCause, ...]
    notes: tuple[str, ...]
    not_compared: tuple[str, ...]
    not_fixed: tuple[str, ...]
    date: str = ""

    @property
    def a(self) -> Model:
        return self.found.a

    @property
    def b(self) -> Model:
        return self.found.b

    @property
    def seed(self) -> int:
        return self.found.seed

    @property
    def verdict(self) -> str:
        """Headline and explanation."""
        return f"{self.headline} {self.explanation}".strip()

    @property
    def same(self) -> bool:
        return self.found.same

    @property
    def undecided(self) -> bool:
        """True if nothing differs, but something in `not_compared` might."""
        return self.found.undecided

    @property
    def left_out(self) -> tuple[str, ...]:
        """Work omitted because of the time limit."""
        return self.found.left_out

    def __bool__(self) -> bool:
        """Return True if the two models are the same, for use in `assert diagnosis`."""
        return self.exit_status == 0

    @property
    def exit_status(self) -> int:
        """Exit status: 0 if the same, 1 if different or partly compared, 3 if a library failed or time ran out."""
        if self.left_out or any(witness.failed for witness in self.found.witnesses):
            return 3
        return 0 if self.same else 1

    @property
    def doubts(self) -> tuple[str, ...]:
        """Warnings about implausible numbers in the models."""
        a, b = (implausible(model.reading) for model in (self.a, self.b))
        both = [f"A and B: {text}" for text in a if text in b]
        ours, theirs = [f"A: {text}" for text in a if text not in b], [f"B: {text}" for text in b if text not in a]
        return (*both, *ours, *theirs)

    def write_fix(self, out: str | Path, *, force: bool = False) -> Path:
        """Write a corrected copy of B that agrees with A.

        Args:
            out: Path of the new file; it must not be B itself.
            force: Replace an existing file.

        Raises:
            OutputError: Nothing can be corrected, or `out` exists and was written or changed by another program.
        """
        fix = self.found.fix
        if fix is None or not fix.text or self.b.file is None:
            why = "; ".join(self.not_fixed) or "nothing differs"
            raise OutputError(f"no corrected file can be written: {why}", str(out), "leave out --fix")
        read = (self.a.own or self.a.file, self.a.loops, self.b.loops)
        write_fix(out := Path(out), fix.text, self.b.own or self.b.file, [*filter(None, read)], force=force)
        return out


def diagnosis_of(findings: Findings, date: str) -> Diagnosis:
    """Format findings as a diagnosis."""
    causes = tuple(_causes(findings))
    first, *rest = [*([headline(findings, causes)] if causes else []), *news(findings)]
    return Diagnosis(
        findings,
        first,
        " ".join([*explanation(findings), *rest]),
        tuple(differences_of(findings.pair, findings.facts)),
        causes,
        tuple(notes(findings)),
        tuple(not_compared(findings)),
        tuple(_not_fixed(findings)),
        date,
    )


def _not_fixed(findings: Findings) -> Iterator[str]:
    """List the differences that the corrected file retains, and why."""
    if findings.fix is not None:
        yield from findings.fix.why_not
        yield from (
            f"{findings.b.library} does not read {noun_of(what)} from the file" for what in findings.fix.unheard
        )
        speaker = Speaker(findings.pair.a)
        yield from (f"no value in B's file corrects this: {speaker.sentence(fact)}" for fact in findings.open_facts)


def headline(findings: Findings, told: Sequence[ToldCause]) -> str:
    """Describe the first cause in at most `WORDS` words, and count the remaining causes."""
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
        of_all = "" if cause.kind == "digits" else family_of(cause.facts)
        yield ToldCause(_name(full, cause), sentence, short, cause.kind, cause.share, of_all, of, slips)


def _slips(findings: Findings, cause: Cause) -> Iterator[str]:
    """Describe the likely slips behind a cause."""
    facts = {id(fact) for fact in cause.facts}
    if cause.kind != "digits":
        reasons = (each for each in findings.reasons if any(id(fact) in facts for fact in each.facts))
        yield from map(phrase, reasons)


def _name(speaker: Speaker, cause: Cause) -> str:
    if cause.kind in ("digits", "small"):
        return {"digits": "printed digits", "small": "small differences"}[cause.kind]
    rest = f" and {len(cause.groups) - 1} more" if len(cause.groups) > 1 else ""
    return speaker.name(cause.groups[0]) + rest


def family_of(facts: Sequence[Fact]) -> str:
    """Return the family of the first fact."""
    first = facts[0]
    if first.what == "whole" and first.b.length == 1.0 and not first.b.mirrored and not first.b.stands:
        return "inertia"
    return "content" if first.what in kinds() else FAMILIES.get(first.what, "geometry")


def differences_of(pair: Pair, facts: Sequence[Fact]) -> Iterator[Difference]:
    """Describe each fact as a difference."""
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


#: Slips in the tensor of one link; each changes several properties of the body.
_OF_TENSORS = ("about the origin", "not turned", "turned", "turned twice", "turned transposed", "meant transposed")
#: Singular of properties whose name is plural.
_ONE = {"limits": "limit"}
#: Slip -> sentence: ``it`` stands for the properties, ``noun`` for the first of them, ``part`` for the body or joint.
SLIPS: Mapping[str, str] = {
    "unit": "{it} is in {0}",
    "unit of A": "{it} agrees if A uses {0}",
    "degrees": "angles of {0} are in degrees but read as rad",
    "radians": "angles of {0} are in rad but read as degrees",
    "sequence": "angles of {0} are read in the sequence {1}, but {2} is meant",
    "w last": "quaternions of {0} have w last",
    "left out": "{it} is left out",
    "decimal point": "the decimal point of {it} is {0}",
    "other sign": "{it} has the opposite sign",
    "mirrored": "{it} is mirrored in {0}",
    "order": "the entries of {it} are in the order {0}",
    "turned": "{it} is rotated by {0:.4g} degrees",
    "turned by inertial": "{it} is rotated by the orientation of its inertial in {0}",
    "turned back by inertial": "{it} is rotated back by the orientation of its inertial in {0}",
    "counted back": "{it} is measured in the opposite direction",
    "exchanged coefficients": "offset and multiplier are exchanged",
    "inverse multiplier": "the multiplier is the inverse of A's",
    "inverse function": "the roles of the two joints are exchanged",
    "offset in degrees": "the offset is in degrees",
    "upside down": "gravity is upside down",
    "about the origin": "{it} is about the origin of the link, not about its centre of mass",
    "parallel axis twice": "the parallel-axis term is subtracted twice from {it}",
    "not turned": "{it} is not rotated by its orientation in {0}",
    "turned twice": "{it} is rotated once too often by its orientation in {0}",
    "turned transposed": "{it} is rotated by the transpose of its orientation in {0}",
    "meant transposed": "{it} is rotated by its orientation in {0} instead of by the transpose",
    "products of opposite sign": "products of inertia have the opposite sign",
    "product of opposite sign": "the product of inertia {0} has the opposite sign",
    "no products": "products of inertia are left out",
    "urdf order": "the entries of {it} are in URDF order instead of MJCF order",
    "mjcf order": "the entries of {it} are in MJCF order instead of URDF order",
    "order of products": "products of inertia are in a different order",
    "order of moments": "moments of inertia are in a different order",
    "moments on other axes": "principal moments are assigned to different axes",
    "transposed": "the rotation is transposed",
    "no rotation": "the rotation is left out",
    "inertiafromgeom": "{it} comes from the geoms of {0}, because of its compiler option inertiafromgeom",
    "default density": "{it} comes from the geoms of {0}, with the default density of 1000 kg/m^3",
    "geoms": "{it} comes from the geoms of {0}",
    "density": "masses come from a density of {0:.6g} kg/m^3 in A and {1:.6g} kg/m^3 in B",
    "settotalmass": "masses are scaled to a total of {1:.6g} kg by the compiler option settotalmass of {0}",
    "total kept": "masses are scaled to a total of {0:.6g} kg in both, as MuJoCo's settotalmass does",
    "joint order": "the order of the joints, from the ground outwards, is {0} in A and {1} in B{2}",
    "exchanged": "the {noun} of {0} and the {noun} of {1} are exchanged",
    "before the gear": "the {noun} of {0} is given on the motor side of the gear, whose ratio is {1:.6g}",
    "gear once": "the {noun} of {0} is scaled by the gear ratio {1:.6g}, not by its square",
    "missing part": "{part} lacks the mass properties of {0}, which is missing from {1}",
    "merged without rotation": "{0} is merged into {part} in {1} without its rotation",
    "merged transposed": "{0} is merged into {part} in {1} with its rotation transposed",
    "merged without position": "{0} is merged into {part} in {1} without its position",
    "merged by the inverse": "{0} is merged into {part} in {1} at the inverse of its placement",
    "merged without parallel axis": "{0} is merged into {part} in {1} without the parallel-axis term",
}


def phrase(reason: Reason) -> str:
    """Describe a slip."""
    first, parts = reason.facts[0], {fact.part for fact in reason.facts}
    whats = sorted({fact.what for fact in reason.facts}, key=[*PROPERTIES, *EVENTS].index)
    nouns = [_ONE.get(what) or noun(what) for what in whats]
    article = "each" if len(nouns) > 1 or len(parts) > 1 or {*whats} & _ONE.keys() else "the"
    if reason.part and reason.slip in _OF_TENSORS:
        article, nouns = "the", ["inertia"]
    elif reason.part and len(parts) == 1:
        article, nouns = "the", [noun(first.what)]
    it = "B" if first.what == "whole" else f"{article} {join(nouns)}{f' of {reason.part}' * bool(reason.part)}"
    values = map(_places, reason.values) if reason.slip == "decimal point" else reason.values
    return SLIPS[reason.slip].format(*values, it=it, noun=noun(first.what), part=reason.part or first.part)


def _places(moved: str | float) -> str:
    """Describe how far a decimal point is misplaced, given the power of ten."""
    n = int(abs(float(moved)))
    places = ("one place", "two places", "three places")[n - 1]
    return f"{places} too far to the {'right' if float(moved) > 0.0 else 'left'}"
