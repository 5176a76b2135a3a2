"""Reads the text of an MJCF body by body, in the file's own units, and edits it."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike

from screwgauge.models.files.urdf import SAME
from screwgauge.models.files.xml import Element, TextLink, UnpatchableError, XmlText, numbers
from screwgauge.models.formats import number_text, quaternion, tensor, vector_text
from screwgauge.models.matter import NOTHING, Matter
from screwgauge.models.mjcf import of_tensor
from screwgauge.models.poses import matrix, relative
from screwgauge.models.readings.reading import CouplingReading
from screwgauge.reference.rotations import Array, quaternion_rotation, rotation

#: Property in the reading of a joint -> attribute.
JOINT = {
    "home": "ref",
    "limits": "range",
    "armature": "armature",
    "damping": "damping",
    "friction": "frictionloss",
    "stiffness": "stiffness",
    "rest": "springref",
}
#: Attribute -> slice of a constraint's softness.
SOFTNESS = {"solref": slice(0, 2), "solimp": slice(2, 7), "torquescale": slice(7, 8)}
#: Compiler settings that change mass properties after they are read.
_MENDING = ("balanceinertia", "boundmass", "boundinertia", "settotalmass")
_ANGLES = ("rest", "home", "limits")
_AXES = np.eye(3)
#: Attributes that define an orientation; an element may have only one of them.
ORIENTATIONS = ("quat", "axisangle", "euler", "xyaxes", "zaxis")
_BODIES, _SITES = ("body1", "body2"), ("site1", "site2")
#: Sections whose elements refer to bodies, joints or their content; these references dangle if their target is removed.
_REFERRING = ("actuator", "sensor", "equality", "tendon", "contact", "keyframe")


def links(xml: XmlText) -> list[TextLink]:
    """List the bodies of an MJCF, parents first; the first entry is the world."""
    compiler = compilers(xml)
    worlds = [element for element in xml.root.children if element.tag == "worldbody"]
    numbers_ = {element: i for i, element in enumerate(_bodies(worlds), 1)}
    found = [TextLink("world", worlds[0])] if worlds else []
    waiting = [(child, 0, np.eye(4)) for world in worlds for child in world.children]
    while waiting:
        element, near, T = waiting.pop(0)
        if element.tag == "frame":
            waiting += [(child, near, T @ pose(element, compiler)) for child in element.children]
        elif element.tag == "body":
            name = element.get("name") or f"body_{numbers_[element]}"
            frame = found[near].frame @ T @ pose(element, compiler)
            joints, matter = _joints(name, element), _matter(element, compiler)
            found.append(TextLink(name, element, near, joints, element, frame, *matter, T))
            waiting += [(child, len(found) - 1, np.eye(4)) for child in element.children]
    return found


def _bodies(worlds: Iterable[Element]) -> Iterator[Element]:
    for world in worlds:
        yield from world.iter("body")


def _joints(body: str, element: Element) -> dict[str, Element]:
    """Return the joints of a body by name; unnamed joints get the names that `files.parts` assigns."""
    moving = [child for child in element.children if child.tag in ("joint", "freejoint")]
    return {joint.get("name") or f"{body}_joint" + (f"_{k + 1}" if k else ""): joint for k, joint in enumerate(moving)}


def compilers(xml: XmlText) -> dict[str, str]:
    """Return the attributes of all ``<compiler>`` elements of an MJCF."""
    return {
        key: value
        for element in xml.root.children
        if element.tag == "compiler"
        for key, value in element.attributes.items()
    }


def pose(element: Element, compiler: Mapping[str, str]) -> Array:
    """Return the placement that the attributes of an MJCF element define. Shape (4, 4)."""
    return matrix(numbers(element.get("pos")), _rotation(element.attributes, compiler))


def _rotation(given: Mapping[str, str], compiler: Mapping[str, str]) -> Array:
    unit = 1.0 if compiler.get("angle") == "radian" else np.pi / 180.0
    if "quat" in given:
        q = numbers(given["quat"])
        return quaternion_rotation(q / np.linalg.norm(q))
    if "axisangle" in given:
        values = numbers(given["axisangle"])
        return rotation(values[:3] / np.linalg.norm(values[:3]), values[3] * unit)
    if "euler" in given:
        R = np.eye(3)
        for letter, angle in zip(compiler.get("eulerseq", "xyz"), numbers(given["euler"]) * unit, strict=True):
            turn = rotation(_AXES["xyz".index(letter.lower())], angle)
            R = R @ turn if letter.islower() else turn @ R  # capitals: about fixed axes
        return R
    if "xyaxes" in given:
        x, y = numbers(given["xyaxes"]).reshape(2, 3)
        x = x / np.linalg.norm(x)
        y = y - (x @ y) * x
        y = y / np.linalg.norm(y)
        return np.column_stack([x, y, np.cross(x, y)])
    if "zaxis" in given:
        z = numbers(given["zaxis"])
        z = z / np.linalg.norm(z)
        axis = np.cross(_AXES[2], z)
        s = float(np.linalg.norm(axis))
        return rotation(axis / s if s > 0.0 else _AXES[0], np.arctan2(s, z[2]))
    return np.eye(3)


def _matter(body: Element, compiler: Mapping[str, str]) -> tuple[Matter | None, Array]:
    """Return a body's mass properties (None if geoms define them), and the orientation of the file's inertia axes."""
    inertial, geoms, setting = body.find("inertial"), body.find("geom"), compiler.get("inertiafromgeom", "auto")
    if inertial is None or (setting == "true" and geoms is not None):
        return (NOTHING if geoms is None or setting == "false" else None), np.eye(3)
    T = pose(inertial, compiler)
    R = T[:3, :3]
    if full := inertial.get("fullinertia"):
        J = tensor(numbers(full))
    else:
        J = np.diag(numbers(inertial.get("diaginertia")))
    return Matter(float(inertial.get("mass", "0")), T[:3, 3], R @ J @ R.T), R


def place(xml: XmlText, link: TextLink, T: Array) -> None:
    """Set the placement of a body relative to its parent."""
    new = relative(link.base, T)
    old = pose(link.element, compilers(xml))
    if np.abs(new[:3, 3] - old[:3, 3]).max() > SAME:
        xml.set(link.element, pos=vector_text(new[:3, 3]))
    if np.abs(new[:3, :3] - old[:3, :3]).max() > SAME:
        orient(xml, link.element, new[:3, :3])


def orient(xml: XmlText, element: Element, R: Array) -> None:
    """Set the orientation of an element as a quaternion, replacing any form in which the file gives it."""
    xml.set(element, **dict.fromkeys(name for name in ORIENTATIONS if name in element.attributes))
    xml.set(element, quat=vector_text(quaternion(R)))


def direct(xml: XmlText, joint: Element, axis: Array, point: Array) -> None:
    """Set the axis of a joint and a point on that axis, in the frame of its body."""
    xml.set(joint, axis=vector_text(axis), pos=vector_text(point))


def fill(xml: XmlText, link: TextLink, matter: Matter, *, plain: bool) -> None:
    """Set the mass properties of a body; write only the properties that differ.

    Args:
        plain: Write all properties, with the tensor in the axes of the body.
    """
    J, inertial, old = matter.inertia, link.element.find("inertial"), link.matter
    mass, pos = number_text(matter.mass), vector_text(matter.com)
    if inertial is None:
        xml.add(link.element, "inertial", pos=pos, mass=mass, **of_tensor(J))
        return
    if plain or old is None or matter.mass != old.mass:
        xml.set(inertial, mass=mass)
    if plain or old is None or np.abs(matter.com - old.com).max() > SAME:
        xml.set(inertial, pos=pos)
    if not plain and old is not None and np.allclose(J, old.inertia, rtol=0.0, atol=1e-15 * np.abs(J).max()):
        return
    R = pose(inertial, compilers(xml))[:3, :3]
    principal = R.T @ J @ R
    moments = np.diag(principal)
    aside = float(np.abs(principal - np.diag(moments)).max())
    if not plain and inertial.get("diaginertia") and aside <= SAME * float(moments.max()):
        xml.set(inertial, diaginertia=vector_text(moments))
        return
    put_tensor(xml, inertial, J)


def put_tensor(xml: XmlText, inertial: Element, J: Array) -> None:
    """Write a full tensor in the axes of the body, and remove its orientation, which MuJoCo would reject.

    Args:
        J: Shape (3, 3).
    """
    lost = [name for name in ("fullinertia", "diaginertia", *ORIENTATIONS) if name in inertial.attributes]
    xml.set(inertial, **dict.fromkeys(lost))
    xml.set(inertial, **of_tensor(J))


def check_matter(xml: XmlText) -> None:
    """Reject an MJCF whose compiler settings change the mass properties in the file.

    Raises:
        UnpatchableError: MuJoCo's compiler derives mass properties from geoms, or changes them after reading.
    """
    settings = compilers(xml)
    if settings.get("inertiafromgeom") == "true":
        raise UnpatchableError('inertiafromgeom="true" takes mass properties from geoms and not from <inertial>')
    for name in _MENDING:
        if settings.get(name, "false") not in ("false", "0", "-1"):
            raise UnpatchableError(f'{name}="{settings[name]}" changes mass properties after reading them')


def tell(xml: XmlText, joint: Element, what: str, value: Array) -> None:
    """Set a property of a joint, converting angles to the file's unit."""
    turns = joint.get("type") != "slide"
    unit = 180.0 / np.pi if turns and compilers(xml).get("angle") != "radian" and what in _ANGLES else 1.0
    if what != "limits":
        xml.set(joint, **{JOINT[what]: number_text(float(value) * unit)})
    elif np.all(np.isfinite(value)):
        xml.set(joint, limited="true", range=vector_text(value * unit))
    else:
        xml.set(joint, limited="false")


def tell_body(xml: XmlText, body: Element, gravcomp: float) -> None:
    """Set the compensated fraction of a body's weight."""
    xml.set(body, gravcomp=number_text(gravcomp))


def tell_model(xml: XmlText, **settings: ArrayLike) -> None:
    """Set the gravity, density or viscosity of the model."""
    texts = {name: vector_text(value) for name, value in settings.items()}
    option = [element for element in xml.root.children if element.tag == "option"][-1:]
    if option:
        xml.set(option[0], **texts)
    else:
        xml.add(xml.root, "option", **texts)


def couple(xml: XmlText, joint: Element, coupling: CouplingReading) -> None:
    """Set the function that couples joints."""
    function = coupling.function
    for equality in (each for part in xml.root.iter("equality") for each in part.children):
        if equality.tag == "joint" and equality.get("joint1") == coupling.joint and len(function.terms) < 2:
            xml.set(equality, polycoef=vector_text(function.polynomial))
            return
        parts = _tendon(xml, equality)
        if {*parts} == {*coupling.named} and function.linear:
            (factor,) = numbers(parts[coupling.joint].get("coef"), "nan")
            for name, slope in function.slopes.items():
                xml.set(parts[name], coef=number_text(-factor * slope))
            xml.set(equality, polycoef=vector_text([factor * function.constant, 0.0, 0.0, 0.0, 0.0]))
            return
    raise UnpatchableError(f"the file itself has no equality for joint '{coupling.joint}'")


def _tendon(xml: XmlText, equality: Element) -> dict[str, Element]:
    """Return joint -> element of the fixed tendon whose length an equality fixes; empty for all other equalities."""
    if equality.tag != "tendon" or equality.get("tendon2"):
        return {}
    tendons = (each for part in xml.root.iter("tendon") for each in part.children if each.tag == "fixed")
    held = (each.children for each in tendons if each.get("name") == equality.get("tendon1"))
    return {part.get("joint"): part for part in next(held, [])}


def drive(xml: XmlText, name: str, gear: float) -> None:
    """Set the gear ratio of an actuator."""
    xml.set(_entry(xml, "actuator", name), gear=number_text(gear))


def soften(xml: XmlText, name: str, softness: Sequence[float]) -> None:
    """Set the softness of a constraint."""
    values = {word: vector_text(part) for word, place in SOFTNESS.items() if (part := np.array(softness[place])).size}
    xml.set(_entry(xml, "equality", name), **values)


def close(xml: XmlText, name: str, ends: Mapping[str, tuple[Array, Array]], frames: Mapping[Element, Array]) -> None:
    """Set the frames of a closure.

    Args:
        ends: Closure -> two world frames. Shape (4, 4) each.
        frames: Body -> world frame. Shape (4, 4).
    """
    entry = _entry(xml, "equality", name)
    if "site1" in entry.attributes:
        for i, side in enumerate(_SITES):
            _put_site(xml, entry.get(side), ends[name][i], ends, frames)
        return
    named = {body.get("name"): T for body, T in frames.items()}
    at = [named.get(entry.get(side), np.eye(4)) for side in _BODIES]
    first, second = (relative(body, T) for body, T in zip(at, ends[name], strict=True))
    if entry.tag == "weld":
        q = quaternion(first[:3, :3] @ second[:3, :3].T)
        xml.set(entry, anchor=vector_text(second[:3, 3]), relpose=vector_text([*first[:3, 3], *q]))
    elif _differ(*ends[name], entry.tag):
        raise UnpatchableError(
            f"the two points of '{name}' differ, but the file has only one anchor for both; connect sites instead"
        )
    else:
        xml.set(entry, anchor=vector_text(first[:3, 3]))


def _differ(one: Array, other: Array, tag: str) -> bool:
    """Return True if two frames differ, or, for a connect constraint, if their origins differ."""
    return bool(np.abs(one - other)[:3, slice(3, 4) if tag == "connect" else slice(4)].max() > 1e3 * SAME)


def _put_site(
    xml: XmlText, name: str, T: Array, ends: Mapping[str, tuple[Array, Array]], frames: Mapping[Element, Array]
) -> None:
    """Move a site to a world pose; reject a site that is used for anything but closures at this pose."""
    site = next((element for element in xml.root.iter("site") if element.get("name") == name), None)
    if site is None or site.parent is None or site.parent.tag == "frame" or "fromto" in site.attributes:
        raise UnpatchableError(f"the file itself has no body with a site '{name}' that is placed by pos")
    ties = _entries(xml, "equality")
    wanted = [(tie.tag, ends[key][i]) for key, tie in ties.items() for i in (0, 1) if tie.get(_SITES[i]) == name]
    others = [element for element in xml.root.iter() if element not in ties.values() and name in _values(element)]
    if others or any(_differ(T, other, tag) for tag, other in wanted):
        raise UnpatchableError(f"site '{name}' is also used elsewhere; add a separate site for the closure")
    at = relative(frames.get(site.parent, np.eye(4)), T)
    xml.set(site, pos=vector_text(at[:3, 3]))
    orient(xml, site, at[:3, :3])


def _entries(xml: XmlText, section: str) -> dict[str, Element]:
    """Return actuators or constraints by name; in a file without includes, unnamed items are numbered as in `parts`."""
    rooms = [element for element in xml.root.children if element.tag == section]
    whole = not any(xml.root.iter("include"))
    entries = enumerate(entry for room in rooms for entry in room.children)
    return {entry.get("name", f"{entry.tag}_{i + 1}" if whole else ""): entry for i, entry in entries}


def _entry(xml: XmlText, section: str, name: str) -> Element:
    if entry := _entries(xml, section).get(name):
        return entry
    raise UnpatchableError(f"the file itself has no {section} named '{name}'")


def hang(xml: XmlText, link: TextLink, near: TextLink) -> None:
    """Keep the default class of a body whose parent is removed; the body keeps its place in the text."""
    element, above = link.element, link.element.parent
    while above is not None and above is not near.element and not element.get("childclass"):
        if above.get("childclass"):
            xml.set(element, childclass=above.get("childclass"))
            return
        above = above.parent


def drop(xml: XmlText, gone: Collection[TextLink]) -> None:
    """Remove bodies and everything in them."""
    names = set()
    for link in gone:
        xml.replace(link.element)
        names |= _names(link.element.iter())
    _forget(xml, names)


def splice(xml: XmlText, gone: Collection[TextLink]) -> None:
    """Remove bodies, but keep their child bodies."""
    names = set()
    for link in gone:
        xml.unwrap(link.element)
        names |= _names([link.element])
        waiting = [*link.element.children]
        while waiting:
            element = waiting.pop()
            if element.tag == "frame":
                waiting += element.children
            elif element.tag != "body":
                xml.replace(element)
                names |= _names([element])
    _forget(xml, names)


def _names(elements: Iterable[Element]) -> set[str]:
    """Return the names of elements to which other elements may refer."""
    kinds = ("body", "joint", "freejoint", "geom", "site", "camera")
    return {element.get("name") for element in elements if element.tag in kinds} - {""}


def _forget(xml: XmlText, names: set[str]) -> None:
    """Remove all elements that refer to the given names or, in turn, to removed elements."""
    parts = [(room, part) for room in xml.root.children if room.tag in _REFERRING for part in room.children]
    while lost := [part for room, part in parts if room.tag == "keyframe" or names & _references(part)]:
        parts = [(room, part) for room, part in parts if part not in lost]
        for part in lost:
            xml.replace(part)
            names |= {part.get("name")} - {""}


def _references(part: Element) -> set[str]:
    """Return all attribute values of an element and its children, except their names."""
    return set().union(*map(_values, (part, *part.children)))


def _values(element: Element) -> set[str]:
    return {value for key, value in element.attributes.items() if key != "name"}
