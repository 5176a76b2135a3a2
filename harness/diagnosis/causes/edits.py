"""Edits that would make B of A: each difference with its values and the slips of convention or unit that it may be."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import reduce

import numpy as np

from screwgauge.diagnosis.differences.difference import Difference
from screwgauge.diagnosis.pairing.common import weighed
from screwgauge.diagnosis.patch import Opened, frames_of
from screwgauge.diagnosis.properties import INERTIAL, PROPERTIES, Change, applied, word
from screwgauge.diagnosis.slips import Pair, placement_slips
from screwgauge.models.kinematics import downwards
from screwgauge.models.matter import Matter, combined, displaced, plainest, steps_of
from screwgauge.models.poses import matrix, relative
from screwgauge.models.readings.reading import Reading
from screwgauge.reference.rotations import Array, rotation

#: Family of what one statement on the whole explains.
WHOLE = "the whole"


@dataclass(frozen=True, slots=True)
class Group:
    """Differences that are stated in one row.

    Attributes:
        name: What of which parts; `sentence`: how they differ; `short`: the same of the first alone.
        differences: Numbers of them, the one that is stated first.
        family: Common name of small ones of the same kind.
    """

    name: str
    sentence: str
    differences: tuple[int, ...]
    short: str
    family: str


@dataclass(frozen=True, slots=True, eq=False)
class Value:
    """One property in both models.

    Attributes:
        item: Link, body or joint, in B's name; empty for the model.
        what: Property.
        a, b: In A and in B, in a frame of B: that of the link of mass properties.
    """

    item: str
    what: str
    a: Array
    b: Array


@dataclass(frozen=True, slots=True, eq=False)
class Edit:
    """What somebody may have done to A's file to get B's; a `Change` leads back, from B to A.

    Attributes:
        name: In words: what of which part.
        differences: Numbers of those that it makes.
        slips: What B's value would be made from A's by, if it is a slip of convention or unit; any of them.
        values: What it changes.
    """

    name: str
    differences: tuple[int, ...]
    slips: tuple[str, ...] = ()
    values: tuple[Value, ...] = ()


@dataclass(frozen=True, slots=True, eq=False)
class Files:
    """The files of two models, where they are known and match their readings."""

    a: Opened | None = None
    b: Opened | None = None


def edits(differences: Sequence[Difference], b: Reading, files: Files | None = None) -> list[Edit]:
    """All that B's file would be changed by, link by link where bodies are several.

    Args:
        differences: Static ones between A and B.
        b: The reading that their changes are of.
    """
    made, files = list[Edit](), files or Files()
    real = {i: (d, d.change) for i, d in enumerate(differences) if d.change is not None and d.kind != "digits"}
    for body in dict.fromkeys(change.item for d, change in real.values() if d.what in INERTIAL):
        own = {i: change for i, (d, change) in real.items() if change.item == body and d.what in INERTIAL}
        made += _of_body(own, b, body, files)
    for i, (difference, change) in real.items():
        if difference.what not in INERTIAL:
            made.append(_single(i, difference, change, b, files))
    return made


def _of_body(own: Mapping[int, Change], b: Reading, body: str, files: Files) -> Iterator[Edit]:
    """Edits of a body: one for each mass property, or one for all its links where it consists of several."""
    old, new = b.bodies[body], applied(b, own.values()).bodies[body]
    parts = files.b.parts(body) if files.b else {}
    pairs = _links(files, body, parts, old, new) if files.b and parts else [(body, old, new, {"B": np.eye(3)})]
    if len(parts) > 1:
        yield _together(own, body, pairs)
        return
    ((name, before, after, rotations),) = pairs
    slips, values = _slips(before, after, rotations), _values(name, before, after)
    for i, change in own.items():
        what = change.what
        yield Edit(f"{word(what)} of {body}", (i,), slips[what], (values[what],))


_Pair = tuple[str, Matter, Matter, dict[str, Array]]
"""Name of a link, its matter in B and in A, in its frame, and the orientations in which the models write its tensor."""


def _together(own: Mapping[int, Change], body: str, pairs: Sequence[_Pair]) -> Edit:
    """All mass properties of a body that differ, stated by those of its links."""
    names, slips, values = list[str](), list[str](), list[Value]()
    for name, before, after, rotations in pairs:
        step, slips_of = steps_of(before, after), _slips(before, after, rotations)
        which = [what for what in INERTIAL if step[what] > max(1e-13, 1e-6 * max(step.values()))]
        names.append(
            f"{', '.join(word(what) for what in which)} of {name}{'' if name == body else f', fixed to {body}'}"
        )
        slips += [slip for what in which for slip in slips_of[what]]
        values += [_values(name, before, after)[what] for what in which]
    return Edit("; ".join(names), tuple(own), tuple(slips), tuple(values))


def _values(name: str, before: Matter, after: Matter) -> dict[str, Value]:
    return {w: Value(name, w, np.asarray(getattr(after, w)), np.asarray(getattr(before, w))) for w in INERTIAL}


def _links(files: Files, body: str, parts: Mapping[int, Matter], old: Matter, new: Matter) -> list[_Pair]:
    """The links of a body that differ: those that do by both files, else the one that has to change least."""
    file = files.b
    if file is None:
        return []
    T = {i: relative(file.reading.bodies[body].pose, file.links[i].frame) for i in parts}
    twins = {link.name: link for link in files.a.links} if files.a else {}
    theirs = {i: twins[file.links[i].name] for i in parts if file.links[i].name in twins}
    stated = {i: displaced(m, T[i]) for i, link in theirs.items() if (m := link.matter) is not None}
    if {*stated} == {*parts}:
        whole, scale = reduce(combined, stated.values()), max(steps_of(old, new).values())
        changed = {i: max(steps_of(parts[i], stated[i], new.mass).values()) for i in parts}
        fits = max(steps_of(whole, new).values()) <= 1e-6 * scale
        chosen = {i: stated[i] for i in parts if changed[i] > 1e-6 * max(changed.values())} if fits else {}
    else:
        chosen = {}
    if not chosen:
        chosen = dict([plainest(parts, old, new)])
    pairs = list[_Pair]()
    for i, matter in chosen.items():
        turns = {"B": file.links[i].turn} | ({"A": theirs[i].turn} if i in theirs else {})
        back = relative(T[i], np.eye(4))
        pairs.append((file.links[i].name, displaced(parts[i], back), displaced(matter, back), turns))
    return pairs


def _slips(old: Matter, new: Matter, turns: Mapping[str, Array]) -> dict[str, tuple[str, ...]]:
    """Mass property -> what B's may have been made from A's by."""
    pairs = {what: [np.asarray(getattr(matter, what)) for matter in (new, old)] for what in INERTIAL}
    return {what: _told(what, Pair(a, b, new, turns)) for what, (a, b) in pairs.items()}


def _told(what: str, pair: Pair) -> tuple[str, ...]:
    noun = "each limit" if what == "limits" else word(what)
    return tuple(dict.fromkeys(f"{noun} {slip}" for slip in PROPERTIES[what].slips(pair)))


def _single(i: int, difference: Difference, change: Change, b: Reading, files: Files) -> Edit:
    """A difference of anything else than mass properties."""
    what, more = difference.what, list[Value]()
    pair: tuple[Array, Array] | None = None
    if difference.a is not None and difference.b is not None:
        pair = difference.a, difference.b
    values = [Value(change.item, what, *pair)] if pair else []
    if what == "gravity":
        pair = change.value, downwards(weighed(b))
    elif what == "placement":
        pair = _placements(change, b, files.b)
    slips = _told(what, Pair(*pair)) if pair else ()
    if what == "gravity" and slips:
        more = _base(change, b)
    if more:
        carried = ", ".join(each.item for each in more)
        slips += (f"gravity is that of a base, which carries {carried}, that is turned",)
    if more and files.b:  # whose placement may be a slip
        frames = [link.frame for link in files.b.links if {each.item for each in more} & {*link.joints}]
        turns = [matrix(np.zeros(3), F[:3, :3]) for F in frames]
        slips += tuple(f"placement {slip}" for F in turns for slip in placement_slips(Pair(more[0].a @ F, F)))
    return Edit(f"{word(what)}{f' of {change.item}' if change.item else ''}", (i,), slips, (*values, *more))


def _base(change: Change, b: Reading) -> list[Value]:
    """Placements of all that stands on the ground, if gravity that points elsewhere is to be that of a turned base."""
    down, other = downwards(weighed(b)), change.value
    if abs(np.linalg.norm(down) - np.linalg.norm(other)) > 1e-9 * np.linalg.norm(down):
        return []
    axis = np.cross(other, down)
    sine, cosine = float(np.linalg.norm(axis)), float(other @ down)
    unit = axis / sine if sine > 0.0 else np.eye(3)[int(np.abs(down).argmin())]
    T = matrix(np.zeros(3), rotation(unit, np.array(np.arctan2(sine, cosine))))
    return [Value(b.bodies[name].joints[0], "placement", T, np.eye(4)) for name in b.roots]


def _placements(change: Change, b: Reading, file: Opened | None) -> tuple[Array, Array]:
    """Placements of what a joint carries relative to its parent, in A and in B. Shape (4, 4) each."""
    after, joint = applied(b, [change]), change.item
    links = [i for i, link in enumerate(file.links) if joint in link.joints] if file else []
    if file and links:
        i, frames = links[0], frames_of(file, after)
        near = file.links[i].near
        return relative(frames[near], frames[i]), relative(file.links[near].frame, file.links[i].frame)
    name = b.moved_by(joint)
    poses = [({n: body.pose for n, body in r.bodies.items()}) for r in (after, b)]
    a, old = (relative(pose.get(b.bodies[name].near, np.eye(4)), pose[name]) for pose in poses)
    return a, old
