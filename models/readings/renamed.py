"""A reading by other names."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from screwgauge.models.readings.reading import Reading


def renamed(reading: Reading, names: Mapping[str, Mapping[str, str]]) -> Reading:
    """A reading by other names.

    Args:
        names: ``bodies``, ``joints``, ``closures``, ``couplings``, ``actuators`` -> name -> other name.
    """
    bodies, joints, closures, couplings, actuators = (
        {**{name: name for name in getattr(reading, kind)}, **names.get(kind, {})}
        for kind in ("bodies", "joints", "closures", "couplings", "actuators")
    )
    return replace(
        reading,
        bodies={
            bodies[name]: replace(
                body,
                near=bodies.get(body.near, body.near),
                joints=tuple(joints[joint] for joint in body.joints),
                copy_of=bodies.get(body.copy_of, body.copy_of),
            )
            for name, body in reading.bodies.items()
        },
        joints={joints[name]: joint for name, joint in reading.joints.items()},
        closures={
            closures[name]: replace(c, first=bodies.get(c.first, c.first), second=bodies.get(c.second, c.second))
            for name, c in reading.closures.items()
        },
        couplings={
            couplings[name]: replace(c, joint=joints[c.joint], of=joints.get(c.of, ""))
            for name, c in reading.couplings.items()
        },
        actuators={actuators[n]: (joints.get(joint, joint), gear) for n, (joint, gear) in reading.actuators.items()},
        content=tuple(each.renamed(names) for each in reading.content),
    )
