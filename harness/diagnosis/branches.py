"""Joints that one model has and the other has not: held there, or gone with all that they carry."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from screwgauge.diagnosis.change import Change, Difference, outwards, without
from screwgauge.diagnosis.mapping import AGAINST_NAME, Pairing, joints_before
from screwgauge.diagnosis.reshape import held
from screwgauge.models.readings.reading import Reading


def missing(a: Reading, b: Reading, pairing: Pairing) -> Iterator[Difference]:
    """One for each joint without a partner that does not hang on another such joint, or without a name of its own."""
    for name, other in pairing.joints.items():
        if pairing.how[name] == AGAINST_NAME:
            sentence = f"{name}: is called {other} in B, where {name} is another joint"
            yield Difference(name, other, "name", None, None, "", math.inf, sentence, kind="convention")
    bodies = dict(pairing.bodies)
    for side, here, there, lost in (
        ("A", (a, pairing.only_a), (b, bodies), "B"),
        ("B", (b, pairing.only_b), (a, {other: name for name, other in bodies.items()}), "A"),
    ):
        reading, alone = here
        before = joints_before(reading)
        for joint in alone:
            if before[joint] not in alone:
                yield _branch(reading, joint, alone, there, (side, lost))


def _branch(
    reading: Reading,
    joint: str,
    alone: tuple[str, ...],
    there: tuple[Reading, dict[str, str]],
    sides: tuple[str, str],
) -> Difference:
    side, lost = sides
    carried, joints = outwards(reading, joint)
    mass = sum(reading.bodies[name].mass for name in carried)
    stuck = not {*joints} <= {*alone} or _weighs(reading, joint, alone, there)
    item_a, item_b = (joint, "") if side == "A" else ("", joint)
    if stuck:
        sentence = f"{joint}: does not move in {lost}, where what it carries is part of what is before it"
        return Difference(item_a, item_b, "branch", None, None, "", math.inf, sentence)
    what = f"{len(carried)} bod{'y' if len(carried) == 1 else 'ies'}, {mass:.6g} kg"
    more = f" and {len(joints) - 1} joint{'s' if len(joints) > 2 else ''} behind it" if len(joints) > 1 else ""
    sentence = f"{joint}{more}: missing in {lost}, with all that {'they carry' if more else 'it carries'} ({what})"
    there_is, change = (np.array(1.0), np.array(0.0)), None
    if side == "B":
        there_is, change = there_is[::-1], Change(joint, "branch", np.array(0.0))
    return Difference(item_a, item_b, "branch", *there_is, "", math.inf, sentence, change)


def _weighs(reading: Reading, joint: str, alone: tuple[str, ...], there: tuple[Reading, dict[str, str]]) -> bool:
    """Whether the other model has the mass of what a joint carries, fixed to what is before it."""
    other, partners = there
    near = next(body.near for body in reading.bodies.values() if joint in body.joints)
    if near not in reading.bodies:
        carried = {link for name in outwards(reading, joint)[0] for link in (name, *reading.bodies[name].fixed)}
        return bool(carried & {*other.fixed})
    partner = other.bodies.get(partners.get(near, ""))
    bare, whole = (each.bodies[near].mass for each in (without(reading, joint), held(reading, alone)))
    return partner is not None and abs(partner.mass - whole) < abs(partner.mass - bare)
