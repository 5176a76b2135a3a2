"""Readings without the massless crosses that stand for joints of several freedoms."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection
from dataclasses import replace

from screwgauge.models.readings.reading import Reading


def collapsed(reading: Reading, keep: Collection[str] = ()) -> Reading:
    """The same motion without bodies of no mass and inertia that carry one further body and no closure.

    The joints of such a body come before those of the body that it carries; links fixed to it are gone.

    Args:
        keep: Bodies that stay all the same.
    """
    closed = {name for closure in reading.closures.values() for name in (closure.first, closure.second)}
    carried = Counter(body.near for body in reading.bodies.values())
    stays = {*keep, *closed}
    gone = {
        name: body
        for name, body in reading.bodies.items()
        if not (body.mass or body.inertia.any()) and carried[name] == 1 and name not in stays
    }
    bodies = {}
    for name, body in reading.bodies.items():
        if name in gone:
            continue
        near, joints = body.near, body.joints
        while near in gone:
            near, joints = gone[near].near, gone[near].joints + joints
        bodies[name] = replace(body, near=near, joints=joints)
    return replace(reading, bodies=bodies)
