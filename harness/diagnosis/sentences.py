"""Formats findings that are not facts: effect, proof, loops, libraries, agreement, limits of the comparison."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from screwgauge.diagnosis.amounts import count, format_value, join, other_side
from screwgauge.diagnosis.facts.fact import STANDARD, known_gravity, other_gravity
from screwgauge.diagnosis.machine.whole import Whole
from screwgauge.diagnosis.properties import CALLS, CLOSING, OPTIONAL, PROPERTIES, noun_of
from screwgauge.diagnosis.shares import SAME, UNSEEN, Torques, components, have_values, with_gravity
from screwgauge.diagnosis.words import Speaker
from screwgauge.models.content import Content, kinds, phrases
from screwgauge.models.kinematics import tree_of, unmodelled_forces
from screwgauge.reference.errors import first_few
from screwgauge.witness.dynamics import inverse_dynamics

if TYPE_CHECKING:
    from screwgauge.diagnosis.causes.causes import Cause
    from screwgauge.diagnosis.facts.fact import Fact
    from screwgauge.diagnosis.findings import Findings
    from screwgauge.diagnosis.libraries import LibraryCheck, Together
    from screwgauge.diagnosis.model import Model
    from screwgauge.diagnosis.shares import Largest

_NAMED = 3
#: Properties that affect only the libraries' own torques, as content does.
_MEDIUM = ("density", "viscosity")
#: Facts about the closing of loops.
_LOOPS = CLOSING | {"held"}
#: Quantity that a library computes differently from its reading -> casebook entry.
CASES = {"Jdot v": "mj-jdotv-before-3.7", "acceleration": "spatial-or-classical"}


def news(found: Findings) -> Iterator[str]:
    """Yield sentences about findings that are not facts, most serious first; the sentence on agreement comes last."""
    if not found.alike:
        yield from _different_machines(found)
        return
    if not found.facts and found.agreement is not None and found.agreement.scaled > SAME:
        forces = "Forces" if found.agreement.unit == "N" else "Torques"
        yield f"{forces} differ by {_amount(found.agreement)}, and no difference between the files explains it."
    if found.together is not None and not found.together.agrees:
        yield _own_torques(found.together)
        if found.withheld:
            yield f"The cause may be content that is not compared: {_join(name_sides(found.withheld))}."
    yield from (_witness(each) for each in found.witnesses if not each.agrees)
    yield from _gravity(found)
    yield from _loops(found)
    yield from _agreement(found)
    if found.order is not None:
        yield found.order.sentence
    if found.only:
        yield f"Only {found.only} properties are compared (--only)."
    if found.left_out:
        yield f"Stopped after {found.limit:g} s (--limit); skipped: {first_few(found.left_out, _NAMED)}."


def _gravity(found: Findings) -> Iterator[str]:
    """Warn if the gravity that libraries assume for a file without gravity differs from that in the other file."""
    side = other_gravity(found.a.reading, found.b.reading)
    if side and not found.only:
        stated = known_gravity((found.b if side == "A" else found.a).reading.gravity)
        usual = f"{-STANDARD[2]:g} m/s^2 downwards for {side}, which specifies no gravity"
        yield f"Called directly, libraries use {usual}, and {format_value(stated)} m/s^2 for {other_side(side)}."


def explanation(found: Findings) -> Iterator[str]:
    """Yield sentences about the effect of the facts on torques and about the proof by the corrected file."""
    few = 2 * len(found.how) < max(len(each.reading.joints) for each in (found.a, found.b))
    if found.alike and few and not found.pair.complete:
        yield _partial(found)
    causes = [cause for cause in found.causes if cause.kind != "digits"]
    if not causes:
        return
    yield from _effect(found, causes)
    if len(causes[0].groups) + len(causes) > 2 and any(_is_scale(fact) for fact in causes[0].facts):
        yield "All other differences are given in the units of A, with the scaling removed."
    yield from _proof(found)
    if found.a.file is not None and found.a.file == found.b.file:
        yield f"{found.a.file.name} is read differently by {found.a.library} (A) and {found.b.library} (B)."
        yield from _ignored_properties(found)


def _is_scale(fact: Fact) -> bool:
    return isinstance(fact.b, Whole) and not (fact.b.length == fact.b.mass == fact.b.inertia == 1.0)


def _different_machines(found: Findings) -> Iterator[str]:
    a, b = (len(each.reading.joints) for each in (found.a, found.b))
    partners = f"{len(found.how) or 'none'} of the {count(a, 'joint')} of A {'has' if len(found.how) < 2 else 'have'}"
    yield f"A and B are models of different machines: {partners} a partner among the {b} joints of B."
    some = f" Partners are {_pairs(found)}." if found.how else ""
    yield f"If they are the same machine, name the partners with --map.{some}"


def _partial(found: Findings) -> str:
    a, b = (len(each.reading.joints) for each in (found.a, found.b))
    return f"Only {len(found.how)} of {a} joints of A and {b} of B are matched and compared ({_pairs(found)})."


def _pairs(found: Findings) -> str:
    """List a few joints and their partners."""
    return first_few((f"{name} = {found.pair.partner(name).name}" for name in found.how), _NAMED)


def _effect(found: Findings, causes: Sequence[Cause]) -> Iterator[str]:
    """Yield sentences about the effect of causes on torques, and about causes without an effect."""
    seen = [each for each in causes if each.kind != "unseen" and not math.isnan(each.share)]
    if seen and found.torques.scaled > UNSEEN:
        most = max(seen, key=lambda each: each.share)
        name = Speaker(found.pair.a).name(most.groups[0])
        much = f"by up to {_amount(found.torques)}"
        forces = "forces" if found.torques.unit == "N" else "torques"
        if len(causes) == 1:
            yield f"It changes {forces} {much}."
        elif len(seen) == 1:
            yield f"{forces.capitalize()} change {much}, only because of {name}."
        else:
            yield f"Together they change {forces} {much}; {percent(most.share)} of this is due to {name}."
    yield from _limits_of_torques(causes)
    plain = [each for each in causes if not all(map(_is_outside, each.facts))]
    unseen = [each for each in plain if each.kind == "unseen" and not _of_loops(each.facts[0])]
    if unseen:
        counts = all(fact.kind == "convention" for each in unseen for fact in each.facts)
        yield f"{_subject(unseen, causes)} {'only coordinates, and ' * counts}no {_force(found)}."
    counting = [each for each in plain if math.isnan(each.share) and all(f.kind == "convention" for f in each.facts)]
    if counting:
        yield f"{_subject(counting, causes)} no motion."
    without = [each for each in plain if each.kind == "cause" and math.isnan(each.share)]
    if any(len(each.groups) > 1 for each in without):
        yield "Their effects cancel each other, so no cause has a share."
    elif any(each.facts[0].kind == "model" for each in without):
        it = "It has" if len(causes) == 1 else "Causes that no value in a file reproduces have"
        yield f"{it} no share{': no value in a file reproduces it' * (len(causes) == 1)}."


def _force(found: Findings, *, several: bool = False) -> str:
    """Name the forces of A's joints: torques, forces, or both."""
    units = {unit for _, unit in components(found.pair.a.reading)}
    names = [f"{name}{'s' * several}" for name, unit in (("torque", "N m"), ("force", "N")) if unit in units]
    return (" and " if several else " or ").join(names)


def _subject(some: Sequence[Cause], causes: Sequence[Cause]) -> str:
    """Return the subject and verb of a sentence about the given causes, which may be a subset of all causes."""
    if len(some) < len(causes):
        return f"{len(some)} of these causes change{'s' * (len(some) == 1)}"
    return "It changes" if len(some) == 1 else "They change"


def _limits_of_torques(causes: Sequence[Cause]) -> Iterator[str]:
    """Yield sentences about differences that do not affect torques."""
    whats = list(dict.fromkeys(fact.what for each in causes for fact in each.facts if _is_outside(fact)))
    if whats:
        yield f"The torques of bodies and joints leave out {join(whats)}."
    if any(each.kind == "unseen" and _of_loops(each.facts[0]) for each in causes):
        yield "Torques for a given motion cannot show how loops differ."


def _is_outside(fact: Fact) -> bool:
    return fact.what in kinds() or fact.what in _MEDIUM


def _of_loops(fact: Fact) -> bool:
    """Return True if a fact concerns the closing of loops; an end may also belong to a joint."""
    return fact.what in _LOOPS or (fact.what == "end" and all(change.what in CLOSING for change in fact.changes))


def _proof(found: Findings) -> Iterator[str]:
    """Report the differences that remain in the corrected copy of B's file."""
    fix = found.fix
    if fix is None:
        return
    again = "After a copy of B's file was corrected and read again,"
    if fix.proved:
        yield f"{again} nothing {'differs' if have_values(found.facts) else 'else differs'}."
    elif fix.left:
        first = Speaker(found.pair.a, brief=True).sentence(fix.left[0])
        yield f"{again} {count(len(fix.left), 'difference remains', 'differences remain')}: {first}."
    if fix.unheard:
        yield name_ignored(found.b.library, fix.unheard)


def name_ignored(library: str, whats: Iterable[str]) -> str:
    """List properties in a file that a library ignores, and their casebook entries."""
    whats = list(dict.fromkeys(whats))
    cases = dict.fromkeys(filter(None, (PROPERTIES[what].cases.get(library) for what in whats if what in PROPERTIES)))
    book = f" (casebook: {', '.join(cases)})" if cases else ""
    return f"{library} ignores {join([*map(noun_of, whats)])} in the file{book}."


def _ignored_properties(found: Findings) -> Iterator[str]:
    """List properties that one library reads from a file but the other library ignores."""
    for k, model in enumerate((found.a, found.b)):
        whats = [
            fact.what for fact in found.facts if fact.what in OPTIONAL and _is_ignored((fact.a, fact.b), k, fact.what)
        ]
        if whats:
            yield name_ignored(model.library, whats)


def _is_ignored(values: tuple[object, object], k: int, what: str) -> bool:
    """Return True if the value of model k is the default and the value of the other model is not."""
    default = np.broadcast_to(PROPERTIES[what].default or 0.0, PROPERTIES[what].shape or ())
    plain = [value is not None and np.array_equal(np.asarray(value), default) for value in values]
    return plain[k] and not plain[1 - k]


def _loops(found: Findings) -> Iterator[str]:
    for side, model in zip("AB", (found.a, found.b), strict=True):
        if model.never_closed:
            yield f"In {side} {model.never_closed}."
    if found.mobility is not None and not found.mobility_agrees:
        a, b = found.mobility
        yield f"Closures and couplings leave {count(a, 'degree')} of freedom in A, {b} in B."


def _agreement(found: Findings) -> Iterator[str]:
    """If nothing differs, report the agreement and the content that was not compared."""
    if not found.agrees:
        return
    reading = found.a.reading
    agree = f"{count(len(reading.joints), 'joint')} and {count(len(reading.bodies), 'body', 'bodies')} agree"
    if found.agreement is not None:
        agree += f", as do their {_force(found, several=True)} (to {found.agreement.scaled:.1g} of the largest value)"
    if found.together is not None and any(found.together.calls):
        agree += f" and the libraries' own torques for the loaded files (to {found.together.row.scaled:.1g})"
    withheld = [*not_compared(found)]
    if withheld:
        yield f"Not all compared: {_join(withheld)}."
    rest = "Everything else is the same: " if withheld or found.facts else ""
    yield f"{rest}{agree}." if not found.left_out else "Nothing that was compared differs."
    if found.aside:
        yield f"Outside the comparison: {_join(name_sides(found.aside))}."


def _own_torques(both: Together) -> str:
    """Report the difference between the libraries' own torques."""
    calls = [f"{call or 'dynamics'} of {side}" for side, call in zip("AB", both.calls, strict=True)]
    unit, forces = both.row.unit, "forces" if both.row.unit == "N" else "torques"
    return (
        f"The libraries' own {forces} for the loaded files ({' and '.join(calls)}, with passive forces) differ by "
        f"{both.row.value:.4g} {unit} at {both.row.component}; the largest value is {both.largest:.4g} {unit}."
    )


def _witness(witness: LibraryCheck) -> str:
    if witness.failed:
        return f"{witness.library} fails on {witness.side} ({witness.failed})."
    name, off = max(witness.scaled.items(), key=lambda entry: entry[1])
    book = f" (casebook: {CASES[name]})" if name in CASES else ""
    return (
        f"The {name.replace('_', ' ')} that {witness.library} computes for {witness.side} differs from its own reading "
        f"of the file by {off:.2g} of the largest value: the engine differs, not the model{book}."
    )


def _amount(largest: Largest) -> str:
    """Format a difference in torque, its component, and its share of the largest torque."""
    return f"{largest.value:.4g} {largest.unit} at {largest.component} ({largest.scaled:.3g} of the largest value)"


def percent(share: float) -> str:
    """Format a share in percent."""
    return f"{100.0 * share:.{'2g' if abs(share) < 0.1 else '1f'}} %"


def _join(sentences: Iterable[str]) -> str:
    return first_few(sentences, _NAMED, "; ")


def notes(found: Findings) -> Iterator[str]:
    """Yield sentences on assumptions about the models; an assumption that both models share appears once."""
    sides = dict[str, list[str]]()
    for side, model in zip("AB", (found.a, found.b), strict=True):
        for sentence in _of_side(model, found):
            sides.setdefault(sentence, []).append(side)
    yield from (f"{' and '.join(of)}: {sentence}" for sentence, of in sides.items())
    yield from _calls(found)
    for what, content in (("not compared", found.withheld), ("outside the comparison", found.aside)):
        if content:
            yield f"{what}: {first_few(name_sides(content), _NAMED, '; ')}"
    if found.fix is not None:
        yield from (f"not in the corrected copy of B: {why}" for why in found.fix.why_not)


def not_compared(found: Findings) -> Iterator[str]:
    """Yield a phrase for each item that could differ but was not compared, and the model that contains it."""
    yield from name_sides(found.withheld)
    if found.why_not:
        yield f"torques of the libraries for the loaded files: {found.why_not}"


def name_sides(content: Sequence[tuple[str, Content]]) -> Iterator[str]:
    """Yield a phrase for each item of content and the models that contain it."""
    of = {side: phrases(each for where, each in content if where == side) for side in "AB"}
    for text in dict.fromkeys((*of["A"], *of["B"])):
        yield f"{text} in {' and '.join(side for side in 'AB' if text in of[side])}"


def _of_side(model: Model, found: Findings) -> Iterator[str]:
    """Yield assumptions about one model."""
    readings = (found.a.reading, found.b.reading)
    yield from (*model.remarks, *(remark.rstrip(".") for remark in model.reading.remarks))
    if model.open_by:
        yield (
            f"loops are open at the home pose as written, {model.open_by}; "
            "the comparison uses a pose that closes the loops"
        )
    if model.reading.gravity is None:
        alone = all(each.gravity is None for each in readings)
        taken = f"{-STANDARD[2]:g} m/s^2 downwards" if alone else "the gravity of the other file"
        yield f"the file specifies no gravity; {taken} is used"
    yield from (f"the dynamics omit {what}" for what in unmodelled_forces(model.reading))
    if model.loops is not None and model.file is not None:
        where = "" if model.loops.parent == model.file.parent else f" in {model.loops.parent}"
        yield f"{model.loops.name}{where or ' in the same folder'} defines the loop closures"
    if not model.says_closures and any(each.closures for each in readings):
        yield "a URDF cannot define loop closures, and its folder has no loops file (choose one with --loops)"
    states_motors = model.library == "mujoco" and model.reading.gravity is not None
    if not model.reading.actuators and (states_motors or any(each.actuators for each in readings)):
        yield "the file has no actuators; torques of all joints are compared, driven or not"
    if model.floating:
        yield "the base is read as floating, like the base of the other model"


def _calls(found: Findings) -> Iterator[str]:
    """List passive forces that only one of the two libraries includes in its inverse dynamics."""
    pairs = ((x, y) for x in found.witnesses for y in found.witnesses if x.library != y.library)
    for more, less in pairs:
        if what := sorted({*more.adds} & {*less.omits}):
            yield _call(more, less, what, found)


def _call(more: LibraryCheck, less: LibraryCheck, what: Sequence[str], found: Findings) -> str:
    reading = with_gravity((found.a if less.side == "A" else found.b).reading)
    free = {name: replace(joint, **dict.fromkeys(what, 0.0)) for name, joint in reading.joints.items()}  # type: ignore[arg-type]
    torques = Torques(reading, found.seed)
    most = torques.largest(inverse_dynamics(tree_of(replace(reading, joints=free)), torques.states) - torques.own)
    cases = [*filter(None, (PROPERTIES[each].call for each in what))]
    book = f" (casebook: {', '.join(cases)})" if cases else ""
    return (
        f"{CALLS[more.library]} of {more.side} contains {join(what)}, but {CALLS[less.library]} of {less.side} does "
        f"not: called directly, they differ by {most.value:.4g} {most.unit} at {most.component}{book}"
    )
