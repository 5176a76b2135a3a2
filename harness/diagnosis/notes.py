"""Assumptions of a comparison, what it leaves out, and limitations of libraries, with the cases of the casebook."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import reduce

import numpy as np

from screwgauge.casebook.book import CASES, shown_here
from screwgauge.diagnosis.compare import STATES, components
from screwgauge.diagnosis.differences.content import Beyond
from screwgauge.diagnosis.differences.difference import Difference
from screwgauge.diagnosis.differences.geometry import step_of
from screwgauge.diagnosis.differences.words import WORLD, turn_and_way
from screwgauge.diagnosis.library_dynamics import LibraryCheck
from screwgauge.diagnosis.model import Model
from screwgauge.diagnosis.pairing.common import STANDARD, Common
from screwgauge.diagnosis.pairing.mapping import CLOSE
from screwgauge.diagnosis.properties import OPTIONAL, PROPERTIES, ROOMS, Change, word
from screwgauge.models.kinematics import draw, not_modelled, plant, size
from screwgauge.models.matter import Matter, combined, displaced
from screwgauge.models.readings.reading import Reading
from screwgauge.reference.errors import first_few
from screwgauge.reference.rotations import Array
from screwgauge.witness.dynamics import passive_parts

#: Things that a note names, others being counted.
NAMED = 3
#: Library -> its call for inverse dynamics.
_CALLS = {"mujoco": "mj_inverse", "pinocchio": "rnea"}


def notes(
    models: tuple[Model, Model],
    common: Common,
    seen: Sequence[LibraryCheck],
    of_loops: str,
    seed: int,
    *,
    compared: bool,
) -> tuple[str, ...]:
    """Notes on two models, a sentence each.

    Args:
        of_loops: What is to be sides_of of loops; `compared`: they are, at closed states.
    """
    (a, b), sides_of = models, dict[str, list[str]]()
    looped = bool(common.a.closures or common.b.closures)
    for side, model, reading in (("A", a, common.a), ("B", b, common.b)):
        for sentence in _of_side(model, reading, models, looped=looped, compared=compared):
            sides_of.setdefault(sentence, []).append(side)
    texts = [_with_sides(sentence, sides) for sentence, sides in sides_of.items()]
    return (
        *([of_loops] if of_loops else []),
        *texts,
        *_elsewhere(common),
        *_welded(common),
        *_calls({"A": a.reading, "B": b.reading}, seen, seed),
    )


def _with_sides(sentence: str, sides: Sequence[str]) -> str:
    """A sentence of `_of_side` on one side, or on both if it is the same of them."""
    one = len(sides) == 1
    words = {"{side}": " and ".join(sides), "{s}": "s" if one else "", "{is}": "is" if one else "are"}
    return reduce(lambda text, word: text.replace(*word), words.items(), sentence)


def _of_side(
    model: Model, reading: Reading, models: tuple[Model, Model], *, looped: bool, compared: bool
) -> Iterator[str]:
    """Sentences on one model, with ``{side}``, and ``{s}`` and ``{is}`` where the verb follows the number of sides.

    Args:
        reading: In common terms.
        looped: One of the models has closures; `compared`: what these leave is compared.
    """
    yield from (f"{{side}}: {sentence}" for sentence in model.remarks)
    if model.open_by:
        where = "; loops are compared where they are closed" if compared else ""
        yield f"{{side}} {{is}} open at home as written: {model.open_by}{where}"
    if model.reading.gravity is None:
        yield f"{{side}} say{{s}} no gravity; {-STANDARD[2]:g} m/s^2 downwards is taken"
    yield from (f"{{side}}: {what} is not in the dynamics" for what in not_modelled(reading))
    if model.loops is not None and model.file is not None:
        where = "" if model.loops.parent == model.file.parent else f" in {model.loops.parent}"
        yield f"what closes loops of {{side}} is said by {model.loops.name}{where or ' beside it'}"
    if not model.says_closures and looped:
        yield "{side} is a URDF, which cannot say what closes loops, and no file beside it does (--loops names one)"
    mjcf = model.library == "mujoco" and model.reading.gravity is not None
    if not model.reading.actuators and (mjcf or any(each.reading.actuators for each in models)):
        yield "{side} name{s} no actuators: torques are compared of all joints of the open tree, driven or not"
    if model.cut is not None and (moved := model.cut.moved):
        yield f"{{side}} cuts its loops elsewhere, at {first_few(moved, NAMED)}: they are compared cut alike"
    if model.floating:
        yield "the base of {side} is read as floating, as that of the other one does"


def outside(content: Beyond) -> Iterator[str]:
    """What is not compared."""
    for what, phrases in (("not compared", content.withheld), ("outside the comparison", content.aside)):
        if phrases:
            yield f"{what}: {first_few(phrases, NAMED, '; ')}"


def _elsewhere(common: Common) -> Iterator[str]:
    """Free bodies that B has elsewhere at home."""
    for name, body in common.b.bodies.items():
        joint = common.b.joints[body.joints[0]]
        step, length = step_of(common.behind[name], joint.centre), size(common.a)
        off = np.linalg.norm(step, axis=1) / (1.0, length)
        if joint.kind == "free" and off.max() > CLOSE:
            much = turn_and_way(step, (WORLD,), length)
            yield f"{body.joints[0]} stands elsewhere at home in B ({much}): a free base is where its coordinates say"


def _welded(common: Common) -> Iterator[str]:
    """Bodies that welds make one in both models, which divide the mass of the whole among them each in its own way."""
    a, b = common.a.bodies, common.b.bodies
    ends = [[{c.first, c.second} for c in r.closures.values() if c.kind == "weld"] for r in (common.a, common.b)]
    for pair in (pair for pair in ends[0] if pair in ends[1] and pair <= a.keys() & b.keys()):
        first, second = sorted(pair)
        parts = [[displaced(each[n], each[n].pose) for n in (first, second)] for each in (a, b)]
        whole, alone = [combined(one, other) for one, other in parts], [one for one, _ in parts]
        if _alike(*whole) and not _alike(*alone):
            yield (
                f"{first} and {second} are welded to each other and are the same as a whole, which A and B divide "
                "otherwise: torques of the open tree show that, motors and the motion do not"
            )


def _alike(one: Matter, two: Matter) -> bool:
    pairs = ((one.mass, two.mass), (one.com, two.com), (one.inertia, two.inertia))
    return all(np.allclose(x, y, rtol=1e-9, atol=1e-9 * float(np.abs(y).max())) for x, y in pairs)


def _calls(readings: dict[str, Reading], seen: Sequence[LibraryCheck], seed: int) -> Iterator[str]:
    """Passive forces that the inverse dynamics of one library contain and those of the other one leave out."""
    for more, less in ((one, other) for one in seen for other in seen if one.library != other.library):
        what = sorted({*more.adds} & {*less.omits})
        if what:
            reading = readings[less.side]
            value, component = _largest_left_out(reading, what, seed)
            cases = [*filter(None, (PROPERTIES[each].call for each in what))]
            book = f" (casebook: {', '.join(cases)})" if cases else ""
            yield (
                f"{_CALLS[more.library]} of {more.side} contains {' and '.join(what)}, {_CALLS[less.library]} of "
                f"{less.side} does not: called as they are, they differ by {value} at {component} on this account{book}"
            )


def _largest_left_out(reading: Reading, what: Sequence[str], seed: int) -> tuple[str, str]:
    """The largest force of some passive parts at random states, with its unit, and its component."""
    tree, states = plant(reading), draw(reading, STATES, seed)
    parts = passive_parts(tree, states)
    force: Array = np.abs(sum(parts[each] for each in what)).max(axis=0)
    i = int(force.argmax())
    name, unit = components(reading)[i]
    return f"{force[i]:.4g} {unit}", name


#: Case of tensors that MuJoCo's compiler turns inexactly, and more than it changes of them.
AXES, INEXACT = "mj-axes-before-3.14", 1e-6


def compiled(models: tuple[Model, Model], differences: Sequence[Difference]) -> list[Difference]:
    """The differences, those of tensors marked that are no larger than what the installed MuJoCo makes of a file."""
    small = [each.what == "inertia" and each.kind == "model" and each.size <= INEXACT for each in differences]
    readers = {model.library for model in models}
    if not any(small) or "mujoco" not in readers or not shown_here(CASES[AXES]):
        return list(differences)
    why = f"as MuJoCo compiles it (casebook: {AXES})"
    return [
        replace(each, kind="digits", sentence=f"{each.sentence}: {why}") if of_it else each
        for each, of_it in zip(differences, small, strict=True)
    ]


def one_file(models: tuple[Model, Model]) -> bool:
    """Whether both sides are the same file."""
    return models[0].file is not None and models[0].file == models[1].file


def unused(models: tuple[Model, Model], differences: Sequence[Difference]) -> Iterator[str]:
    """Notes on what one library reads from a file and the other ignores, a sentence each."""
    for k, model in enumerate(models if one_file(models) else ()):
        whats = [
            each.what for each in differences if each.what in OPTIONAL and _left_out((each.a, each.b), k, each.what)
        ]
        if whats:
            yield does_not_use(model.library, whats)


def does_not_use(library: str, whats: Sequence[str]) -> str:
    """A sentence on properties that a library leaves in a file."""
    names = ", ".join(dict.fromkeys(word(what) for what in whats))
    cases = dict.fromkeys(filter(None, (PROPERTIES[what].cases.get(library) for what in whats)))
    book = f" (casebook: {', '.join(cases)})" if cases else ""
    return f"{library} does not use what the file says of {names}{book}."


def unheard(change: Change, before: Reading, after: Reading) -> bool:
    """Whether a library reads the same as before from a file that has the change."""
    owner = PROPERTIES[change.what].owner
    if change.what not in OPTIONAL or (owner != "model" and change.item not in getattr(after, ROOMS[owner])):
        return False
    holders = [r if owner == "model" else getattr(r, ROOMS[owner])[change.item] for r in (before, after)]
    old, new = (np.asarray(getattr(holder, change.what), dtype=float) for holder in holders)
    return np.array_equal(old, new) and not np.array_equal(new, change.value)


def _left_out(values: tuple[object, object], k: int, what: str) -> bool:
    """Whether one value is the default, and the other one is not."""
    default = np.broadcast_to(PROPERTIES[what].default or 0.0, PROPERTIES[what].shape or ())
    plain = [value is not None and np.array_equal(np.asarray(value), default) for value in values]
    return plain[k] and not plain[1 - k]
