"""Names for all that has none in an MJCF, so that every library calls it the same."""

from __future__ import annotations

import re
from xml.etree import ElementTree as ET

#: What a constraint or actuator without a name is called by.
NUMBERED = re.compile(r"[a-z]+_\d+_*")


def name_all(root: ET.Element, taken: set[str | None]) -> None:
    """Names bodies, joints, equality constraints and actuators: ``body_2``, ``arm_joint``, ``connect_1``.

    Args:
        taken: Names that are not given; those that are given are added.
    """

    def name(element: ET.Element, wanted: str) -> None:
        if "name" in element.attrib:
            return
        while wanted in taken:
            wanted += "_"
        taken.add(wanted)
        element.set("name", wanted)

    bodies = [body for world in root.iterfind("worldbody") for body in world.iter("body")]
    for i, body in enumerate(bodies):
        name(body, f"body_{i + 1}")
        for k, joint in enumerate(joints_in(body)):
            name(joint, f"{body.get('name')}_joint" + (f"_{k + 1}" if k else ""))
    for section in ("equality", "actuator"):
        for i, entry in enumerate(entry for part in root.iterfind(section) for entry in part):
            name(entry, f"{entry.tag}_{i + 1}")


def joints_in(body: ET.Element) -> list[ET.Element]:
    """Joints of a body itself, those in frames included, in their order."""
    found, waiting = list[ET.Element](), [*body]
    while waiting:
        element = waiting.pop(0)
        if element.tag in ("joint", "freejoint"):
            found.append(element)
        elif element.tag == "frame":
            waiting = [*element, *waiting]
    return found
