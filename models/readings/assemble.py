"""Merges rigidly connected links into bodies, and converts joints of a reading to different types."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Mapping
from dataclasses import replace
from itertools import permutations
from typing import Any

import numpy as np

from screwgauge.models.content import Content
from screwgauge.models.matter import displace, join
from screwgauge.models.poses import screw
from screwgauge.models.readings.reading import BARE, BodyReading, CouplingReading, JointReading, Reading
from screwgauge.reference.errors import ModelFileError, UnknownNameError
from screwgauge.reference.mechanism import GROUND


def assemble(links: Mapping[str, BodyReading], joints: Mapping[str, JointReading], where: str, **rest: Any) -> Reading:
    """Merge links that cannot move relative to each other.

    A body is named after its link with mass nearest to the ground, or after its first link if all links are massless.
    Links at equal distance are ordered alphabetically, because libraries order them differently.

    Args:
        links: Links by name, parents first.
        rest: Further fields of the `Reading`.

    Raises:
        ModelFileError: A moving body has the name of the ground.
    """
    groups: dict[str, list[tuple[int, str]]] = {"": []}  # first link -> distance from it, link
    at = {"": ("", 0)}
    for name, link in links.items():
        key, far = (name, 0) if link.joints else (at[link.near][0], at[link.near][1] + 1)
        at[name] = key, far
        groups.setdefault(key, []).append((far, name))
    fixed = {name: links[name].pose for _, name in groups.pop("")}
    owner = dict.fromkeys(fixed, GROUND)
    bodies: dict[str, BodyReading] = {}
    for first, group in groups.items():
        ordered = {name: links[name] for _, name in sorted(group)}
        named = next((name for name, link in ordered.items() if link.mass), next(iter(ordered)))
        if named == GROUND:
            raise ModelFileError(f"a moving body is called '{GROUND}'", where, "rename it")
        near = owner[links[first].near] if links[first].near else GROUND
        bodies[named] = replace(
            _merge(named, ordered), near=near, joints=links[first].joints, first="" if named == first else first
        )
        owner |= dict.fromkeys(ordered, named)
    return Reading(bodies=bodies, joints=joints, fixed=fixed, **rest)


def _merge(named: str, links: Mapping[str, BodyReading]) -> BodyReading:
    """Merge links into one body, in the frame of the link after which it is named."""
    body = links[named]
    back = np.linalg.inv(body.pose)
    fixed = {name: back @ link.pose for name, link in links.items() if name != named}
    parts = {name: displace(links[name], T) for name, T in fixed.items() if links[name].solid}
    if not parts:
        return replace(body, fixed=fixed)
    solid = {name: link for name, link in links.items() if link.solid}
    whole = join(parts.get(name, link) for name, link in solid.items())
    gravcomp = sum(link.mass * link.gravcomp for link in solid.values()) / (whole.mass or 1.0)
    return replace(body.with_matter(whole), gravcomp=gravcomp, fixed=fixed, parts=parts)


SPHERICAL, FIXED = "SPHERICAL", "FIXED"
#: Type of a universal joint -> axes of the joint frame about which the joint turns, starting from the ground side.
UNIVERSAL = {f"UJOINT_{one}{two}": (one, two) for one, two in permutations("XYZ", 2)}
KNOWN = (SPHERICAL, FIXED, *UNIVERSAL)
#: Properties of a joint in addition to its axis; they do not apply to the axes of a different joint type.
_OWN = ("armature", "damping", "friction", "stiffness")


def retype(reading: Reading, types: Mapping[str, str], where: str) -> Reading:
    """Change the types of joints.

    A spherical or universal joint keeps the location of the old joint, has no limits, and is at zero at the home pose
    of the old joint. The hinges of a universal joint ``name`` are called e.g. ``name_Z`` and ``name_Y``, after axes of
    the link frame that the old joint carries. A fixed joint disappears, and the bodies that it connects are merged.
    The old names remain valid as names of frames.

    Args:
        types: Joint -> one of `KNOWN`.
        where: Name of the file that changes the types, for error messages.

    Raises:
        ScrewgaugeError: A joint or type does not exist, or a coupling depends on the joint.
    """
    for name, kind in types.items():
        if name not in reading.joints:
            raise UnknownNameError("joint", name, reading.joints, f"{where}, joint_name")
        if kind not in KNOWN:
            raise UnknownNameError(f"type of joint '{name}',", kind, KNOWN, f"{where}, joint_type")
    _check_free(reading, types, where)
    frames = {name: link for name in types if (link := reading.carried_link(name))}
    lost = (phrase for name, kind in types.items() for phrase in _lost_properties(reading.joints[name], name, kind))
    content = (Content("read differently by the library", phrase, values=()) for phrase in lost)
    reading = replace(reading, frames={**reading.frames, **frames}, content=(*reading.content, *content))
    for name, kind in types.items():
        if kind != FIXED:
            reading = _replace_joint(reading, name, _rotational_joints(reading, name, kind, where))
    return _weld(reading, [name for name, kind in types.items() if kind == FIXED], where)


def _lost_properties(joint: JointReading, name: str, kind: str) -> Iterator[str]:
    """Yield the properties of a joint that its new type cannot have."""
    if kind != FIXED:
        low, high = joint.limits
        limited = ["limits"] if low < high and not math.isinf(high - low) else []
        for what in (*limited, *(what for what in _OWN if getattr(joint, what))):
            yield f"{what} of joint {name}, which becomes {kind}"


def _check_free(reading: Reading, types: Mapping[str, str], where: str) -> None:
    """Reject a new type for a coupled joint; a leading joint may become fixed, which locks its followers."""
    for coupling in reading.couplings.values():
        for name in coupling.named:
            if name in types and (name == coupling.joint or types[name] != FIXED):
                what = f"joint '{name}' is coupled to another joint and cannot become {types[name]}"
                raise ModelFileError(what, f"{where}, joint_type", "remove its <mimic> or its joint_type")


def _rotational_joints(reading: Reading, name: str, kind: str, where: str) -> dict[str, JointReading]:
    """Build the spherical joint, or the hinges of a universal joint, that replace a joint."""
    centre = reading.joints[name].centre
    if kind == SPHERICAL:
        return {name: JointReading("ball", np.zeros(6), centre)}
    carried = reading.place(name)
    if carried is None:
        raise ModelFileError(
            f"joint '{name}' is one of several joints that carry the same link", where, "remove its joint_type"
        )
    body, T = carried
    R = (reading.bodies[body].pose @ T)[:3, :3]
    hinges = {f"{name}_{axis}": R[:, "XYZ".index(axis)] for axis in UNIVERSAL[kind]}
    if taken := {*hinges} & {*reading.joints}:
        what = f"joint '{name}' becomes several hinges, but a joint '{min(taken)}' already exists"
        raise ModelFileError(what, f"{where}, joint_type", "rename that joint")
    return {hinge: JointReading("hinge", screw(True, axis, centre), centre) for hinge, axis in hinges.items()}


def _replace_joint(reading: Reading, name: str, by: Mapping[str, JointReading]) -> Reading:
    """Replace a joint with any number of joints, possibly none."""
    body = reading.moved_by(name)
    joints = dict[str, JointReading]()
    for each, joint in reading.joints.items():
        joints |= by if each == name else {each: joint}
    chain = tuple(one for each in reading.bodies[body].joints for one in (by if each == name else (each,)))
    bodies = {**reading.bodies, body: replace(reading.bodies[body], joints=chain)}
    return replace(reading, joints=joints, bodies=bodies)


def _weld(reading: Reading, names: list[str], where: str) -> Reading:
    """Remove joints, and merge the bodies on their two sides."""
    if not names:
        return reading
    couplings = {key: _hold(reading, coupling, names) for key, coupling in reading.couplings.items()}
    for name in names:
        reading = _replace_joint(reading, name, {})
    merged = assemble(dict(_links(reading)), reading.joints, where, name=reading.name, library=reading.library)
    if not reading.joints:
        raise ModelFileError("fixes all joints", f"{where}, joint_type", "leave at least one joint free")
    return replace(reading, bodies=merged.bodies, fixed={**reading.fixed, **merged.fixed}, couplings=couplings)


def _hold(reading: Reading, coupling: CouplingReading, fixed: Collection[str]) -> CouplingReading:
    """Fix the given leading joints of a coupling; a joint that depends only on fixed joints is locked."""
    homes = {name: reading.joints[name].home for name in coupling.function.terms if name in fixed}
    return replace(coupling, function=coupling.function.at(homes)) if homes else coupling


def _links(reading: Reading) -> Iterator[tuple[str, BodyReading]]:
    """Yield the links of all bodies, to be merged again; one link of each body has the body's mass."""
    for name, body in reading.bodies.items():
        near, joints = "" if body.near == GROUND else body.near, body.joints
        if body.first:
            yield body.first, replace(BARE, near=near, joints=joints, pose=body.pose @ body.fixed[body.first])
            near, joints = body.first, ()
        yield name, replace(body, near=near, joints=joints, fixed={}, first="", parts={})
        for link, T in body.fixed.items():
            if link != body.first:
                yield link, replace(BARE, near=name, pose=body.pose @ T)
