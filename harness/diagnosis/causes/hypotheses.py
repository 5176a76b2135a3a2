"""What may make two models differ: each static difference, those of one link together, one slip made everywhere."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import reduce

import numpy as np

from screwgauge.diagnosis.causes.common_causes import SEVERAL, printed, scaled, swapped
from screwgauge.diagnosis.causes.conventions import com_slips, gravity_slips, placement_slips, tensor_slips, unit_slip
from screwgauge.diagnosis.causes.hypothesis import COMMON, COUNT, INERTIAL, Files, Hypothesis, Value
from screwgauge.diagnosis.differences.change import Change, Difference, applied
from screwgauge.diagnosis.differences.words import NAMES
from screwgauge.diagnosis.files.opened import Opened, frames_of
from screwgauge.diagnosis.mechanics.matter import Matter, combined, displaced, of_body, plainest, relative, steps_of
from screwgauge.diagnosis.pairing.common import weighed
from screwgauge.models.kinematics import downwards
from screwgauge.models.readings.assemble import matrix
from screwgauge.models.readings.reading import Reading
from screwgauge.reference.rotations import Array, rotation


def hypotheses(differences: Sequence[Difference], b: Reading, files: Files | None = None) -> list[Hypothesis]:
    """All that are tried.

    Args:
        differences: Static ones between A and B.
        b: The reading that their changes are of.
    """
    found, files = list[Hypothesis](), files or Files()
    few = sum(d.kind == "digits" for d in differences) < SEVERAL
    real = {i: (d, d.change) for i, d in enumerate(differences) if d.change is not None and (few or d.kind != "digits")}
    for body in dict.fromkeys(change.item for d, change in real.values() if d.what in INERTIAL):
        own = {i: change for i, (d, change) in real.items() if change.item == body and d.what in INERTIAL}
        found += _of_body(own, b, body, files)
    for i, (difference, change) in real.items():
        if difference.what not in (*INERTIAL, "softness"):  # which is no part of the open tree
            found.append(_single(i, difference, change, b, files))
        if difference.what == "gravity":
            found += _base(i, change, b, files)
    return [*found, *_same_slip(found), *swapped(found), *scaled(real, b, files.b), *printed(differences, files)]


def _of_body(own: Mapping[int, Change], b: Reading, body: str, files: Files) -> Iterator[Hypothesis]:
    """Of a body: each of its mass properties alone and together, or, where it is several links, those of links."""
    old, new = of_body(b.bodies[body]), of_body(applied(b, own.values()).bodies[body])
    parts = files.b.parts(body) if files.b else {}
    pairs = _links(files, body, parts, old, new) if files.b and parts else [(body, old, new, {"B": np.eye(3)})]
    if len(parts) > 1:
        yield _together(own, body, pairs)
        return
    ((name, before, after, rotations),) = pairs
    slips, values = _slips(before, after, rotations), _values(name, before, after)
    for i, change in own.items():
        what = change.what
        yield Hypothesis(f"{word(what)} of {body}", (i,), slips[what], COUNT[what], (values[what],))
    if len(own) > 1:
        yield _together(own, body, pairs)


_Pair = tuple[str, Matter, Matter, dict[str, Array]]
"""Name of a link, its matter in B and in A, in its frame, and the orientations in which the models write its tensor."""


def _together(own: Mapping[int, Change], body: str, pairs: Sequence[_Pair]) -> Hypothesis:
    """All mass properties of a body that differ, told by those of its links."""
    names, slips, values = list[str](), list[str](), list[Value]()
    for name, before, after, rotations in pairs:
        step, said = steps_of(before, after), _slips(before, after, rotations)
        which = [what for what in INERTIAL if step[what] > max(1e-13, 1e-6 * max(step.values()))]
        names.append(
            f"{', '.join(word(what) for what in which)} of {name}{'' if name == body else f', fixed to {body}'}"
        )
        slips += [slip for what in which for slip in said[what]]
        values += [_values(name, before, after)[what] for what in which]
    numbers = sum(COUNT[value.what] for value in values)
    return Hypothesis("; ".join(names), tuple(own), tuple(slips), numbers, tuple(values))


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
    said = {i: displaced(m, T[i]) for i, link in theirs.items() if (m := link.matter) is not None}
    if {*said} == {*parts}:
        whole, scale = reduce(combined, said.values()), max(steps_of(old, new).values())
        changed = {i: max(steps_of(parts[i], said[i], new.mass).values()) for i in parts}
        fits = max(steps_of(whole, new).values()) <= 1e-6 * scale
        chosen = {i: said[i] for i in parts if changed[i] > 1e-6 * max(changed.values())} if fits else {}
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


def word(what: str) -> str:
    """What a property is called."""
    return NAMES.get(what, what)


def _slips(old: Matter, new: Matter, rotations: Mapping[str, Array]) -> dict[str, tuple[str, ...]]:
    """Mass property -> what B's may have been made from A's by."""
    mass = unit_slip("mass", np.asarray(new.mass), np.asarray(old.mass))
    if old.mass == 0.0 < new.mass:
        mass = "left out"
    com = dict.fromkeys(slip for R in rotations.values() for slip in com_slips(new.com, old.com, R))
    return {
        "mass": (f"mass is {mass}",) if mass else (),
        "com": tuple(f"centre of mass {slip}" for slip in com),
        "inertia": tuple(f"inertia {slip}" for slip in tensor_slips(new, old.inertia, rotations)),
    }


def _single(i: int, difference: Difference, change: Change, b: Reading, files: Files) -> Hypothesis:
    """A difference of anything else than mass properties."""
    what, slips = difference.what, list[str]()
    if what == "gravity":
        slips = gravity_slips(change.value, downwards(weighed(b)))
    elif what == "placement":
        slips = placement_slips(*_placements(change, b, files.b))
    elif what in ("limits", "rest", "zero") and difference.a is not None and difference.b is not None:
        slips = [f"is {said}" for said in [unit_slip("angle", difference.a, difference.b)] if said]
    name = f"{word(what)}{f' of {change.item}' if change.item else ''}"
    values = () if difference.a is None or difference.b is None else (difference.a, difference.b)
    return Hypothesis(
        name,
        (i,),
        tuple(f"{word(what)} {slip}" for slip in slips),
        COUNT.get(what, change.value.size),
        (Value(change.item, what, *values),) if values else (),
    )


def _base(i: int, change: Change, b: Reading, files: Files) -> Iterator[Hypothesis]:
    """Gravity that only points elsewhere cannot be told from a base that stands turned."""
    down, other = downwards(weighed(b)), change.value
    if gravity_slips(other, down) and abs(np.linalg.norm(down) - np.linalg.norm(other)) <= 1e-9 * np.linalg.norm(down):
        axis = np.cross(other, down)
        sine, cosine = float(np.linalg.norm(axis)), float(other @ down)
        unit = axis / sine if sine > 0.0 else np.eye(3)[int(np.abs(down).argmin())]
        T = matrix(np.zeros(3), rotation(unit, np.array(np.arctan2(sine, cosine))))
        roots = [b.bodies[name].joints[0] for name in b.roots]
        values = tuple(Value(joint, "placement", T, np.eye(4)) for joint in roots)
        frames = [link.frame for link in files.b.links if {*roots} & {*link.joints}] if files.b else []
        turns = [matrix(np.zeros(3), F[:3, :3]) for F in frames]
        said = tuple(f"placement {slip}" for F in turns for slip in placement_slips(T @ F, F))
        yield Hypothesis(f"turn of the base, which carries {', '.join(roots)}", (i,), said, 3, values)


def _placements(change: Change, b: Reading, file: Opened | None) -> tuple[Array, Array]:
    """Of what a joint carries on what is before it, in A and in B. Shape (4, 4) each."""
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


def _same_slip(found: Sequence[Hypothesis]) -> Iterator[Hypothesis]:
    """Several that are made by the same slip."""
    for slip in dict.fromkeys(slip for hypothesis in found for slip in hypothesis.slips):
        own = [hypothesis for hypothesis in found if slip in hypothesis.slips]
        if len(own) >= COMMON:
            numbers = tuple(dict.fromkeys(i for hypothesis in own for i in hypothesis.differences))
            values = tuple(value for hypothesis in own for value in hypothesis.values)
            yield Hypothesis(f"{slip} in {len(own)} places", numbers, (slip,), 1, values)
