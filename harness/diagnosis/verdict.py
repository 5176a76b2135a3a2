"""The verdict of a diagnosis in words: a headline, then how much it explains and how sure that is."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence

from screwgauge.diagnosis.causes.attribution import Attribution, Cause, Largest
from screwgauge.diagnosis.causes.backfill import Backfill
from screwgauge.diagnosis.causes.explanation import Explanation
from screwgauge.diagnosis.differences.content import Beyond
from screwgauge.diagnosis.differences.difference import Difference
from screwgauge.diagnosis.differences.loops import ALIKE, Loops
from screwgauge.diagnosis.differences.static import distinct
from screwgauge.diagnosis.library_dynamics import LibraryCheck
from screwgauge.diagnosis.model import Model
from screwgauge.diagnosis.notes import does_not_use, one_file, unused
from screwgauge.diagnosis.pairing.mapping import Pairing
from screwgauge.diagnosis.properties import CLOSING, PARTS
from screwgauge.diagnosis.together import Together
from screwgauge.models.content import kinds
from screwgauge.reference.errors import first_few

#: Scaled torques that differ by no more are the same, whatever the readers' rounding.
SAME = 1e-11
#: Of closures and couplings, what decides which motions they leave.
BINDING = CLOSING - {"softness"}
#: Of that, what two models may state in different ways: a hinge by two points or, in a plane, by one.
RESTATED = {"closure"}
#: What is in the libraries' own torques alone.
APART = {"medium", *kinds()}
#: Content that acts by friction, stops or contacts, which all torques leave out.
RESISTING = {"fixed tendons", "range of rotation", "softness of stops", "softness of friction", "contact pairs"}
#: Quantity that a library computes otherwise than its reading -> case of the casebook.
CASES = {"Jdot v": "mj-jdotv-before-3.7", "acceleration": "spatial-or-classical"}
#: Words of a headline at most.
WORDS = 30
#: What a sentence can do without, the least needed first.
_DETAILS = (
    r", with (?!all )[^;]*",
    r", each in the frame of its own file",
    r", \([^()]*\) (?:deg|mm) in the axes of [^;)]*?(?= and shifted|[;)]|$)",
    r" \((?:[^()]|\([^()]*\))*\)$",
    r", turned by [^;]*",
)
_NAMED = 3


def verdict(
    models: tuple[Model, Model],
    differences: Sequence[Difference],
    why: Explanation,
    seen: Iterable[LibraryCheck],
    loops: tuple[Loops | None, bool],
    beyond: Beyond,
    both: Together | None,
    *,
    late: bool = False,
) -> tuple[str, str]:
    """The headline, and further sentences: the share that causes explain, and the rest.

    Args:
        loops: What loops leave, and whether the two state the same in different ways.
        beyond: What is compared item by item, and what is not.
        both: The libraries' own torques of both models.
        late: There was no time for some of it.
    """
    cause, proof, (bound, restated) = why.attribution, why.proof, loops
    apart = [_witness(witness) for witness in seen if not witness.agrees]
    unlike = any(model.never_closed for model in models) or (bound is not None and not bound.closes_alike)
    if differences:
        sentences = [headline(cause.causes)]
        if both is None or both.agrees:
            sentences += _explains(differences, why, both, late=late)
        else:
            sentences.append(_as_loaded(both))
    elif cause.before.scaled > SAME:
        unexplained = "there was no time to explain" if late else "nothing that the two say explains"
        sentences = [f"Torques differ by {_largest(cause.before)}, which {unexplained}."]
    elif late:
        sentences = ["Nothing differs in what was compared."]
    else:
        sentences = _alike(models, cause, beyond, both, alone=not (apart or unlike))
    first, second = models
    if first.file is not None and one_file(models) and differences:
        sentences.append(f"{first.file.name} is read differently by {first.library} (A) and {second.library} (B).")
        sentences += unused(models, differences)
    elif proof is not None and proof.unheard:
        sentences.append(does_not_use(second.library, [change.what for change in proof.unheard]))
    sentences += _bound(bound, restated=restated) if bound else []
    sentences += [f"In {side} {m.never_closed}." for side, m in zip("AB", models, strict=True) if m.never_closed]
    return sentences[0], " ".join([*sentences[1:], *apart])


def headline(causes: Sequence[Cause]) -> str:
    """The first cause in a sentence of at most `WORDS` words, and how many more there are."""
    first, others = causes[0], sum(cause.kind == "cause" for cause in causes[1:])
    more = f", and {others} more cause{'s' * (others > 1)}" if others else ""
    room = WORDS - len(more.split())
    slip = f": {first.slips[0]}" if first.slips and first.slips[0] not in first.sentence else ""
    for text in (f"{first.sentence}{slip}", f"{first.short}{slip}", first.sentence, *_shorter(first.short)):
        if text and len(text.split()) <= room:
            return f"{text}{more}."
    return f"{' '.join(text.split()[:room])} ...{more}."


def _shorter(text: str) -> Iterator[str]:
    """A sentence, then without its details, one after the other."""
    yield text
    for detail in _DETAILS:
        text = re.sub(detail, "", text)
        yield text
    while ", " in text:
        text = text.rpartition(", ")[0]
        if text.count("(") == text.count(")"):
            yield text


def _bound(bound: Loops, *, restated: bool) -> list[str]:
    """Motions that loops leave, where these differ, or where the same ones are stated in different ways."""
    a, b = bound.mobility
    if a != b:
        return [f"Closures and couplings leave {a} degree{'s' * (a != 1)} of freedom in A, {b} in B."]
    if not bound.alike:
        apart = f"Poses that close A leave B open: {bound.opened}." if bound.opened else ""
        much = f"The motions that loops leave differ by {bound.row.max_abs:.2g} ({bound.row.worst})"
        where = ", at the nearest poses that close B" if bound.opened else ""
        return [*filter(None, (apart, f"{much}{where}." if bound.row.max_abs > ALIKE else ""))]
    if restated:
        return [f"Loops are stated otherwise and leave the same motions ({bound.row.max_abs:.1g})."]
    return []


def stopped(limit: float, left_out: Sequence[str]) -> str:
    """Verdict of a diagnosis that met its time limit."""
    return f"Stopped after {limit:g} s (--limit), without: {first_few(left_out, _NAMED)}."


def partly(models: tuple[Model, Model], pairing: Pairing) -> str:
    """Verdict on two models of which less than half of the joints have a partner."""
    a, b = (len(model.reading.joints) for model in models)
    by = "the map" if "given" in pairing.how.values() else "their names"
    return (
        f"Compared by {by} are {len(pairing.joints)} of {a} joints of A and {b} of B ({_pairs(pairing)}); the others "
        "have no partner."
    )


def _pairs(pairing: Pairing) -> str:
    """Some joints with their partners."""
    pairs = ", ".join(f"{name} = {other}" for name, other in list(pairing.joints.items())[:_NAMED])
    return f"{pairs}{', ...' if len(pairing.joints) > _NAMED else ''}"


def strange(models: tuple[Model, Model], pairing: Pairing) -> tuple[str, str]:
    """Verdict and explanation for two models that are not of one machine."""
    a, b = (len(model.reading.joints) for model in models)
    more = f" Partners are {_pairs(pairing)}." if pairing.joints else ""
    return (
        f"A and B are models of different machines: of {a} joints of A and {b} of B, {len(pairing.joints)} have a "
        "partner.",
        f"If they are the same machine, name the partners with --map.{more}",
    )


def _alike(
    models: tuple[Model, Model], why: Attribution, beyond: Beyond, both: Together | None, *, alone: bool
) -> list[str]:
    """Verdict that all that is compared is the same; `alone`: and nothing else differs."""
    reading = models[0].reading
    joints, bodies = len(reading.joints), len(reading.bodies)
    count = f"{joints} joint{'s' * (joints != 1)} and {bodies} bod{'y' if bodies == 1 else 'ies'}"
    agree = f"{count} say the same, and torques agree to {why.before.scaled:.1g} of the largest"
    outside = [f"No part of that: {_listed(beyond.aside)}."] if beyond.aside else []
    if both is not None and not both.agrees:
        suspects = [f"What is not compared could be the cause: {_listed(beyond.withheld)}."] if beyond.withheld else []
        return [_as_loaded(both), *suspects, f"All else is the same: {agree}.", *outside]
    if both is not None and any(both.calls):
        agree += f", those of the libraries as loaded to {both.row.scaled:.1g}"
    if beyond.withheld:
        return [f"Not all compared: {_listed(beyond.withheld)}.", f"All else is the same: {agree}.", *outside]
    return [f"{'' if alone else 'The models are the same: '}{agree}.", *outside]


def _as_loaded(both: Together) -> str:
    """How far apart the libraries' own torques are."""
    calls = [f"{call or 'dynamics'} of {side}" for side, call in zip("AB", both.calls, strict=True)]
    return (
        f"The libraries' own torques as loaded ({' and '.join(calls)}, passive forces included) differ by "
        f"{both.row.max_abs:.4g} of {both.largest:.4g} {both.row.unit} ({both.row.worst})."
    )


def _explains(differences: Sequence[Difference], of: Explanation, both: Together | None, *, late: bool) -> list[str]:
    """Share of the torque difference that causes explain, the rest, and differences without effect on torques."""
    why, proof = of.attribution, of.proof
    if why.before.scaled <= SAME:
        unseen = sum(len(cause.differences) for cause in why.causes[1:] if cause.kind == "unseen")
        further = [f"{_others(unseen)} not affect torques."] if unseen else []
        text = _unseen(differences, why.before.scaled, both)
        return [f"{text[0].upper()}{text[1:]}.", *further]
    if not why.seen:
        why_not = "there was no time to explain" if late else "nothing that the two say explains"
        return [f"Torques differ by {_largest(why.before)}, which {why_not}."]
    many = sum({*cause.differences} & {*why.seen} != set() for cause in why.causes) > 1
    share = 1.0 if proof is not None and proof.agrees else why.share
    explains = f"{'Together they explain' if many else 'It explains'} {_percent(share)} of the torque difference"
    rest = distinct(each for i, each in enumerate(differences) if i not in why.seen and each.what not in PARTS)
    apart = sum(each.what in APART for each in rest)
    others, more = len(rest) - apart, list[str]()
    if others:
        more.append(f"{_others(others)} not affect torques{_of_tree(differences, why.seen)}.")
    if apart:
        which = f"other difference{'s are' if apart > 1 else ' is'}"
        more.append(f"{apart} {which} in forces that these torques leave out.")
    return [f"{explains}; {_left(why, proof)}.", *more]


def _others(count: int) -> str:
    return f"{count} further difference{'s do' if count > 1 else ' does'}"


def _of_tree(differences: Sequence[Difference], seen: Sequence[int]) -> str:
    """Phrase that limits a verdict to the open tree, where closures or couplings are not seen."""
    closed = any(each.what in CLOSING for i, each in enumerate(differences) if i not in seen)
    return " of the open tree" if closed else ""


def _unseen(differences: Sequence[Difference], off: float, both: Together | None) -> str:
    """Why torques agree all the same.

    Args:
        both: Those of the libraries, where they agree, too.
    """
    closed = [each.what in CLOSING for each in differences]
    if any(each.what in ("branch", "link", "kind") for each in differences):
        return f"torques of all else agree ({off:.1g})"
    if any(each.what in RESISTING for each in differences):
        return f"torques, which leave out friction of tendons, stops and contacts, agree ({off:.1g})"
    if both is None and any(each.what in APART for each in differences):
        return f"torques of bodies and joints, which leave it out, agree ({off:.1g})"
    if not any(closed):
        return f"no torque shows it ({off:.1g})"
    which = "it" if all(closed) else "what differs in closures and couplings"
    rest = "" if all(closed) else f", and no torque shows the rest ({off:.1g})"
    return f"torques are compared of the open tree, which cannot show {which}{rest}"


def _left(why: Attribution, proof: Backfill | None) -> str:
    """What backfill leaves."""
    left = why.left if proof is None else proof.left
    if left.scaled == float("inf"):
        return "after backfill there are no torques to compare"
    where = "" if proof is not None and proof.on == "file" else " of the reading"
    return f"after backfill{where} {_largest(left)} are left"


def _largest(largest: Largest) -> str:
    return (
        f"{largest.value:.1g} {largest.unit}"
        if largest.scaled < 1e-9
        else f"{largest.value:.4g} {largest.unit} ({largest.component})"
    )


def _percent(share: float) -> str:
    """Four decimals, and never all of it where something is left."""
    return "100.0000 %" if share > 1.0 - 5e-7 else f"{min(share * 100.0, 99.9999):.4f} %"


def _listed(sentences: Sequence[str]) -> str:
    return first_few(sentences, _NAMED, "; ")


def _witness(witness: LibraryCheck) -> str:
    if witness.failed:
        return f"{witness.library} fails on {witness.side} ({witness.failed})."
    name, off = max(witness.scaled.items(), key=lambda entry: entry[1])
    book = f" (casebook: {CASES[name]})" if name in CASES else ""
    return (
        f"{witness.library} itself computes another {name.replace('_', ' ')} for {witness.side} than follows from what "
        f"it has read ({off:.2g} of the largest): a difference of the engine, not of the model{book}."
    )
