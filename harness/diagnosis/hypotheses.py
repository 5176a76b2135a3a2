"""What may make two models differ: each static difference, those of one link together, one slip made everywhere."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from screwgauge.diagnosis.change import Change, Difference, applied
from screwgauge.diagnosis.conventions import com_slips, gravity_slips, placement_slips, tensor_slips, unit_slip
from screwgauge.diagnosis.dynamics import downwards
from screwgauge.diagnosis.matter import Matter, displaced, of_body, plainest, relative, steps_of
from screwgauge.diagnosis.opened import Opened, frames_of
from screwgauge.models.readings.reading import Reading
from screwgauge.reference.rotations import Array

_INERTIAL = ("mass", "com", "inertia")
#: Property -> what it is called where its name does not say it, and how many numbers it is.
_WORDS = {"com": "centre of mass", "centre": "point on the axis", "zero": "zero", "rest": "rest of the spring"}
_COUNT = {"mass": 1, "com": 3, "inertia": 6, "placement": 6, "axis": 2, "centre": 2, "pose": 6}
#: Slips and ratios are common to a model if so many parts have them.
_COMMON = 2


@dataclass(frozen=True, slots=True, eq=False)
class Hypothesis:
    """A cause that would explain differences.

    Attributes:
        name: In words: what of which part.
        differences: Numbers of those that it accounts for.
        changes: What makes B as A in this.
        slips: What B's value would be made from A's by, if it is a slip of convention or unit; any of them.
        numbers: How many numbers it changes.
    """

    name: str
    differences: tuple[int, ...]
    changes: tuple[Change, ...]
    slips: tuple[str, ...] = ()
    numbers: int = 1


@dataclass(frozen=True, slots=True, eq=False)
class Files:
    """The files of two models, where they are known and can be put beside their readings."""

    a: Opened | None = None
    b: Opened | None = None


def hypotheses(differences: Sequence[Difference], b: Reading, files: Files | None = None) -> list[Hypothesis]:
    """All that are tried.

    Args:
        differences: Static ones between A and B.
        b: The reading that their changes are of.
    """
    found, files = list[Hypothesis](), files or Files()
    real = {i: d for i, d in enumerate(differences) if d.change is not None and d.kind != "digits"}
    bodies = dict.fromkeys(d.change.item for d in real.values() if d.change and d.what in _INERTIAL)
    for body in bodies:
        own = {i: d for i, d in real.items() if d.change and d.change.item == body and d.what in _INERTIAL}
        found += _of_body(own, b, body, files)
    found += [each for i, d in real.items() if d.what not in _INERTIAL for each in _single(i, d, b, files)]
    found += _everywhere(found)
    printed = {i: d for i, d in enumerate(differences) if d.change is not None and d.kind == "digits"}
    if printed:
        found.append(_together("digits of the numbers that are printed", printed, len(printed)))
    return found


def _together(name: str, own: Mapping[int, Difference], numbers: int, slips: tuple[str, ...] = ()) -> Hypothesis:
    """Several differences with one cause."""
    return Hypothesis(name, tuple(own), tuple(d.change for d in own.values() if d.change), slips, numbers)


def _of_body(own: Mapping[int, Difference], b: Reading, body: str, files: Files) -> Iterator[Hypothesis]:
    """Of a body: each of its mass properties alone, or, where it is several links, those of one link."""
    after = of_body(applied(b, [d.change for d in own.values() if d.change]).bodies[body])
    parts = files.b.parts(body) if files.b else {}
    if files.b is None or not parts:
        rotations = {"B": np.eye(3)}
        old, new = of_body(b.bodies[body]), after
    else:
        chosen, matter = plainest(parts, of_body(b.bodies[body]), after)
        link = files.b.links[chosen]
        back = relative(relative(b.bodies[body].pose, link.frame), np.eye(4))
        old, new = displaced(parts[chosen], back), displaced(matter, back)
        rotations = {"B": link.turn}
        if files.a and (twins := [other for other in files.a.links if other.name == link.name]):
            rotations["A"] = twins[0].turn
        if len(parts) > 1:
            yield _of_link(own, link.name, body, old, new, rotations)
            return
    slips = _slips(old, new, rotations)
    for i, difference in own.items():
        what = difference.what
        yield _together(f"{_WORDS.get(what, what)} of {body}", {i: difference}, _COUNT[what], slips[what])


def _of_link(
    own: Mapping[int, Difference], link: str, body: str, old: Matter, new: Matter, rotations: Mapping[str, Array]
) -> Hypothesis:
    """A link that is one of several of a body."""
    slips, step = _slips(old, new, rotations), steps_of(old, new)
    which = [what for what in _INERTIAL if step[what] > max(1e-13, 1e-6 * max(step.values()))]
    name = f"{', '.join(_WORDS.get(what, what) for what in which)} of {link}"
    fixed = "" if link == body else f", fixed to {body}"
    said = tuple(slip for what in which for slip in slips[what])
    return _together(f"{name}{fixed}", own, sum(_COUNT[what] for what in which), said)


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


def _single(i: int, difference: Difference, b: Reading, files: Files) -> Iterator[Hypothesis]:
    """A difference of anything else than mass properties."""
    change, what, slips = difference.change, difference.what, list[str]()
    if change is None:
        return
    if what == "gravity":
        slips = gravity_slips(change.value, downwards(b))
    elif what == "placement":
        slips = placement_slips(*_placements(change, b, files.b))
    elif what in ("limits", "rest", "zero") and difference.a is not None and difference.b is not None:
        slips = [f"is {said}" for said in [unit_slip("angle", difference.a, difference.b)] if said]
    name = f"{_WORDS.get(what, what)}{f' of {change.item}' if change.item else ''}"
    said = tuple(f"{_WORDS.get(what, what)} {slip}" for slip in slips)
    yield Hypothesis(name, (i,), (change,), said, _COUNT.get(what, change.value.size))


def _placements(change: Change, b: Reading, file: Opened | None) -> tuple[Array, Array]:
    """Of what a joint carries on what is before it, in A and in B. Shape (4, 4) each."""
    after, joint = applied(b, [change]), change.item
    links = [i for i, link in enumerate(file.links) if joint in link.joints] if file else []
    if file and links:
        i, frames = links[0], frames_of(file, after)
        near = file.links[i].near
        return relative(frames[near], frames[i]), relative(file.links[near].frame, file.links[i].frame)
    name, body = next((name, body) for name, body in b.bodies.items() if joint in body.joints)
    poses = [({name: body.pose for name, body in r.bodies.items()}) for r in (after, b)]
    a, old = (relative(pose.get(body.near, np.eye(4)), pose[name]) for pose in poses)
    return a, old


def _everywhere(found: Sequence[Hypothesis]) -> Iterator[Hypothesis]:
    """What several have in common: the same slip."""
    slips = dict.fromkeys(slip for hypothesis in found for slip in hypothesis.slips)
    for slip in slips:
        own = [hypothesis for hypothesis in found if slip in hypothesis.slips]
        if len(own) >= _COMMON:
            numbers = tuple(dict.fromkeys(i for hypothesis in own for i in hypothesis.differences))
            changes = tuple(change for hypothesis in own for change in hypothesis.changes)
            yield Hypothesis(f"{slip} in {len(own)} places", numbers, changes, (slip,))
