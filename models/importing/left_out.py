"""What a reading says and neither a description nor its scene can hold, by name; and the springs, which a scene can."""

from __future__ import annotations

from collections.abc import Iterable

from screwgauge.models.readings.reading import Reading
from screwgauge.reference.applied import JointSpring
from screwgauge.reference.errors import first_few
from screwgauge.reference.mechanism import Mechanism

#: How many names a phrase lists.
SHOWN = 6


def springs_of(reading: Reading, mechanism: Mechanism) -> tuple[JointSpring, ...]:
    """Stiffness and damping of hinges and slides."""
    return tuple(
        JointSpring(name, joint.stiffness, joint.rest if joint.stiffness else 0.0, joint.damping)
        for name, joint in reading.joints.items()
        if name in mechanism.coordinates and (joint.stiffness > 0.0 or joint.damping > 0.0)
    )


def left_out(reading: Reading, mechanism: Mechanism) -> tuple[str, ...]:
    """Phrases, each with the names that it is about."""
    joints, springs = reading.joints.items(), {spring.coordinate for spring in springs_of(reading, mechanism)}
    found = {
        "armature of": [name for name, joint in joints if joint.armature],
        "friction of": [name for name, joint in joints if joint.friction],
        "stiffness and damping of": [
            n for n, joint in joints if (joint.stiffness or joint.damping) and n not in springs
        ],
        "compensated gravity of": [name for name, body in reading.bodies.items() if body.gravcomp],
        "inertia of what has no mass:": [
            n for n, body in reading.bodies.items() if body.inertia.any() and not body.mass
        ],
        "gear (not 1) of actuator": [name for name, (_, gear) in reading.actuators.items() if gear != 1.0],
    }
    phrases = [f"{what} {listed(names)}" for what, names in found.items() if names]
    density, viscosity = reading.medium
    if density or viscosity:
        phrases.append(f"medium of density {density:g} kg/m^3 and viscosity {viscosity:g} Pa s")
    held = ("mimic of", "include ")  # couplings are read from the file itself, and what is included is read
    return (*phrases, *(phrase for phrase in reading.ignored if not phrase.startswith(held)))


def listed(names: Iterable[str]) -> str:
    """The first names, and how many more there are."""
    return first_few((f"'{name}'" for name in names), SHOWN)
