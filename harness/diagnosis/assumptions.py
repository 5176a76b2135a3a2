"""English for what a comparison takes for granted and leaves out, with the cases of the casebook."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from screwgauge.diagnosis.facts.fact import STANDARD
from screwgauge.diagnosis.nouns import listed
from screwgauge.diagnosis.properties import CALLS, PROPERTIES
from screwgauge.diagnosis.shares import Torques, weighed
from screwgauge.models.content import Content, phrases
from screwgauge.models.kinematics import not_modelled, plant
from screwgauge.reference.errors import first_few
from screwgauge.witness.dynamics import inverse_dynamics

if TYPE_CHECKING:
    from screwgauge.diagnosis.findings import Findings
    from screwgauge.diagnosis.libraries import LibraryCheck
    from screwgauge.diagnosis.model import Model

_NAMED = 3


def notes(found: Findings) -> Iterator[str]:
    """Tell what was taken for granted, a sentence each; once where it is so of both sides."""
    sides = dict[str, list[str]]()
    for side, model in zip("AB", (found.a, found.b), strict=True):
        for sentence in _of_side(model, found):
            sides.setdefault(sentence, []).append(side)
    yield from (f"{' and '.join(of)}: {sentence}" for sentence, of in sides.items())
    yield from _calls(found)
    for what, content in (("not compared", found.beyond.withheld), ("outside the comparison", found.beyond.aside)):
        if content:
            yield f"{what}: {first_few(sided(content), _NAMED, '; ')}"
    if found.fix is not None:
        yield from (f"not in the corrected copy of B: {why}" for why in found.fix.why_not)


def not_compared(found: Findings) -> Iterator[str]:
    """Tell what is not compared and could differ, with its side."""
    yield from sided(found.beyond.withheld)
    if found.why_not:
        yield f"torques of the libraries as loaded: {found.why_not}"


def sided(content: Sequence[tuple[str, Content]]) -> Iterator[str]:
    """Content in words, with the sides that have it."""
    of = {side: phrases(each for where, each in content if where == side) for side in "AB"}
    for text in dict.fromkeys((*of["A"], *of["B"])):
        yield f"{text} in {' and '.join(side for side in 'AB' if text in of[side])}"


def _of_side(model: Model, found: Findings) -> Iterator[str]:
    """Tell what was taken for granted of one model."""
    readings = (found.a.reading, found.b.reading)
    yield from (*model.remarks, *(remark.rstrip(".") for remark in model.reading.remarks))
    if model.open_by:
        yield f"open at home as written, {model.open_by}; compared where its loops are closed"
    if model.reading.gravity is None:
        alone = all(each.gravity is None for each in readings)
        taken = f"{-STANDARD[2]:g} m/s^2 downwards" if alone else "that of the other file"
        yield f"the file states no gravity; {taken} is taken"
    yield from (f"{what} is not in the dynamics" for what in not_modelled(model.reading))
    if model.loops is not None and model.file is not None:
        where = "" if model.loops.parent == model.file.parent else f" in {model.loops.parent}"
        yield f"{model.loops.name}{where or ' beside it'} says what closes the loops"
    if not model.says_closures and any(each.closures for each in readings):
        yield "a URDF cannot say what closes loops, and no file beside it does (--loops names one)"
    states_motors = model.library == "mujoco" and model.reading.gravity is not None
    if not model.reading.actuators and (states_motors or any(each.actuators for each in readings)):
        yield "the file names no actuators; torques of all joints are compared, driven or not"
    if model.floating:
        yield "the base is read as floating, as the other one is"


def _calls(found: Findings) -> Iterator[str]:
    """Tell which passive forces one library's inverse dynamics contain and those of the other leave out."""
    pairs = ((x, y) for x in found.witnesses for y in found.witnesses if x.library != y.library)
    for more, less in pairs:
        if what := sorted({*more.adds} & {*less.omits}):
            yield _call(more, less, what, found)


def _call(more: LibraryCheck, less: LibraryCheck, what: Sequence[str], found: Findings) -> str:
    reading = weighed((found.a if less.side == "A" else found.b).reading)
    free = {name: replace(joint, **dict.fromkeys(what, 0.0)) for name, joint in reading.joints.items()}  # type: ignore[arg-type]
    torques = Torques(reading, found.seed)
    most = torques.largest(inverse_dynamics(plant(replace(reading, joints=free)), torques.states) - torques.own)
    cases = [*filter(None, (PROPERTIES[each].call for each in what))]
    book = f" (casebook: {', '.join(cases)})" if cases else ""
    return (
        f"{CALLS[more.library]} of {more.side} contains {listed(what)}, {CALLS[less.library]} of {less.side} does "
        f"not: called as they are, they differ by {most.value:.4g} {most.unit} at {most.component}{book}"
    )
