"""Writes the tree of a mechanism as URDF, reads any URDF link by link, and edits its text.

In written files, the frame of a link is the body frame of the description, and the intermediate links of composite
joints have no ``<inertial>``. A separate file in the same folder closes the loops: see `files.loops`.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Set
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np

from screwgauge.models.content import Content
from screwgauge.models.files.xml import Element, TextLink, UnpatchableError, XmlText, number, numbers
from screwgauge.models.formats import TENSOR, WIDE, number_text, of_rpy, rpy, tensor, vector_text
from screwgauge.models.layout import Freedom, Link, lay_out
from screwgauge.models.matter import NOTHING, Matter
from screwgauge.models.poses import matrix
from screwgauge.models.readings.reading import CouplingReading
from screwgauge.reference.couplings import PolynomialSum
from screwgauge.reference.errors import DescriptionError, ModelFileError, UnknownNameError
from screwgauge.reference.files import read_model
from screwgauge.reference.mechanism import GROUND, Frame, Joint, Mechanism
from screwgauge.reference.rigid import inverse
from screwgauge.reference.rotations import Array

#: Part of the model files that includes ``robot.yaml``, see `screwgauge.models.generate`.
PART = "yaml"
STRONG = 1e9


def write_urdf(mechanism: Mechanism, cut: str, *, include: Set[str] = frozenset()) -> str:
    """Write the tree of a cut mechanism as URDF; the loops file contains the closures.

    Args:
        cut: ``minimal`` or ``full``.
        include: ``limits`` writes the finite limits of the description instead of wide limits; ``yaml`` adds the
            frames that a ``robot.yaml`` names.
    """
    tree = lay_out(mechanism, cut)
    robot = ET.Element("robot", name=mechanism.name)
    robot.append(ET.Comment(f" {cut} cut; loops are closed by the loops file; written by screwgauge models "))
    ET.SubElement(robot, "link", name=GROUND)
    for link in tree.links:
        _add(robot, link, "limits" in include)
    if PART in include:
        for name, link_name, frame in (side for one in tree.closures for pair in one.frames() for side in pair):
            ET.SubElement(robot, "link", name=name)
            joint = ET.SubElement(robot, "joint", name=f"{name}.fixed", type="fixed")
            _placement(joint, frame)
            _ends(joint, link_name, name)
    ET.indent(robot)
    return '<?xml version="1.0" encoding="utf-8"?>\n' + ET.tostring(robot, encoding="unicode") + "\n"


def _add(robot: ET.Element, link: Link, limited: bool) -> None:
    """Add a link, the elementary joints that lead to it, and the massless links between them."""
    name = link.joint.name
    names = [f"{name}.cross{i + 1}" for i in range(len(link.freedoms) - 1)]
    mounted = not link.far_frame.is_identity
    names.append(frame_link(link) if mounted else link.name)
    near, frame = link.near, link.near_frame
    for freedom, far in zip(link.freedoms, names, strict=True):
        if link.joint.fixed:
            fixed = ET.SubElement(robot, "joint", name=freedom.coordinate, type="fixed")
            _placement(fixed, frame)
            _ends(fixed, near, far)
        else:
            _elementary(robot, freedom, near, far, frame, limited)
        if far != link.name:
            ET.SubElement(robot, "link", name=far)
        near, frame = far, Frame()
    if mounted:
        mount = ET.SubElement(robot, "joint", name=f"{name}.mount", type="fixed")
        _placement(mount, inverse(link.far_frame))
        _ends(mount, near, link.name)
    element, body = ET.SubElement(robot, "link", name=link.name), link.body
    if body.mass:
        element.append(ET.fromstring(inertial_text(Matter(body.mass, body.com, body.inertia))))


def frame_link(link: Link) -> str:
    """Return the name of the massless link at the joint's frame on the far body."""
    return f"{link.original}@{link.joint.name}.frame"


def _elementary(robot: ET.Element, freedom: Freedom, near: str, far: str, frame: Frame, limited: bool) -> None:
    kind = "revolute" if freedom.turns else "prismatic"
    joint = ET.SubElement(robot, "joint", name=freedom.coordinate, type=kind)
    _placement(joint, frame)
    _ends(joint, near, far)
    ET.SubElement(joint, "axis", xyz=vector_text(freedom.axis))
    low, high = np.clip(freedom.limits, -WIDE, WIDE) if limited else (-WIDE, WIDE)
    _add_numbers(joint, "limit", lower=low, upper=high, effort=STRONG, velocity=STRONG)
    if freedom.damping or freedom.friction:
        _add_numbers(joint, "dynamics", damping=freedom.damping, friction=freedom.friction)


def _add_numbers(joint: ET.Element, tag: str, **numbers: float) -> None:
    ET.SubElement(joint, tag, {key: number_text(value) for key, value in numbers.items()})


def _ends(joint: ET.Element, near: str, far: str) -> None:
    ET.SubElement(joint, "parent", link=near)
    ET.SubElement(joint, "child", link=far)


def _placement(joint: ET.Element, frame: Frame) -> None:
    if not frame.is_identity:
        ET.SubElement(joint, "origin", xyz=vector_text(frame.p), rpy=vector_text(rpy(frame.R)))


def moments(I: Array) -> dict[str, str]:
    """Format a tensor [kg m^2] as the attributes ixx, ixy, ixz, iyy, iyz, izz of an ``<inertia>``. Shape (3, 3)."""
    return {f"i{'xyz'[i]}{'xyz'[j]}": number_text(I[i, j]) for i in range(3) for j in range(i, 3)}


#: Placements or directions that differ by less count as equal [m or 1]: products of frames have errors of this size.
SAME = 1e-14
#: Name of the joint of a floating base, as in Pinocchio.
FLOATING = "root_joint"
#: Coefficients of `<mimic>` and their defaults, lowest degree first.
_MIMIC = (("offset", 0.0), ("multiplier", 1.0))
#: Property in the reading of a joint -> element and attribute; limits have two attributes.
JOINT = {"limits": ("limit", ""), "damping": ("dynamics", "damping"), "friction": ("dynamics", "friction")}


def check_tree(root: ET.Element, where: str) -> None:
    """Reject a URDF whose joints do not connect all its links into a tree.

    Raises:
        ModelFileError: A joint lacks a parent or child, a link is the child of two joints, or the URDF does not have
            exactly one root link.
        UnknownNameError: A joint connects a missing link, or mimics a missing joint.
    """
    links = [link.get("name", "") for link in root.iterfind("link")]
    joints = [joint.get("name", "") for joint in root.iterfind("joint")]
    known, hung = {*links}, set[str]()
    for joint in root.iterfind("joint"):
        for side in ("parent", "child"):
            end = joint.find(side)
            if end is None or not end.get("link"):
                raise ModelFileError(f"joint {joint.get('name')} has no {side}", where, "name that link")
            if end.get("link") not in known:
                raise UnknownNameError("link", end.get("link"), links, f"{where}, joint {joint.get('name')}")
        child = carried_link(joint)
        if child in hung:
            remedy = "cut the loop and close it in a loops file next to the URDF"
            raise ModelFileError(f"link {child} is the child of two joints", where, remedy)
        hung.add(child)
        leads = joint.find("mimic")
        if leads is not None and leads.get("joint") not in joints:
            raise UnknownNameError("joint", leads.get("joint"), joints, f"{where}, mimic of {joint.get('name')}")
    free = [name for name in links if name not in hung]
    if len(free) != 1:
        several = f"{len(free)} links are not the child of a joint ({', '.join(free[:3])})"
        what = several if free else "every link is the child of a joint"
        raise ModelFileError(what, where, "make exactly one link the root")


def carried_link(joint: ET.Element) -> str:
    """Return the name of the link that a joint of a URDF carries."""
    child = joint.find("child")
    return "" if child is None else child.get("link", "")


def root_link(root: ET.Element) -> str:
    """Return the name of the root link of a URDF, which is not the child of any joint."""
    children = {carried_link(joint) for joint in root.iterfind("joint")}
    return next((link.get("name", "") for link in root.iterfind("link") if link.get("name") not in children), "")


def mimics(root: ET.Element, where: str) -> dict[str, CouplingReading]:
    """Return the couplings of mimicking joints by name; a joint that mimics a fixed joint is locked at its offset."""
    couplings = {}
    moving = {joint.get("name", ""): joint for joint in root.iterfind("joint") if joint.get("type") != "fixed"}
    for name, joint in moving.items():
        if (mimic := joint.find("mimic")) is not None:
            ratio = np.array([number(mimic, key, default, where) for key, default in _MIMIC])
            leads = mimic.get("joint", "")
            held = leads not in moving
            couplings[name] = CouplingReading(name, PolynomialSum.of({"" if held else leads: ratio}))
    return couplings


def tree_urdf(urdf: Path, joints: Iterable[Joint]) -> str:
    """Read a URDF; replace the fixed joints of a description with hinges.

    Raises:
        ModelFileError: The file cannot be read, or `with_hinges` rejects it.
    """
    return with_hinges(read_model(urdf), joints, str(urdf))


def with_hinges(text: str, joints: Iterable[Joint], where: str) -> str:
    """In the text of a URDF, replace the fixed joints of a description with hinges about the joints' z axes.

    A coupling in the description keeps each hinge at a constant angle.

    Raises:
        ModelFileError: A fixed joint's location on the link that it carries differs from that in the description.
    """
    fixed = {joint.name: joint for joint in joints if joint.fixed}
    if not fixed:
        return text
    root = ET.fromstring(text)
    for element in root.iterfind("joint[@type='fixed']"):
        if (joint := fixed.get(element.get("name", ""))) is None:
            continue
        link, (name, _, mounted) = carried_link(element), carried_link(element).partition("@")
        frame, sign = (joint.parent_frame, -1.0) if name == joint.parent else (joint.child_frame, 1.0)
        if not mounted and frame.p.any():
            what = f"places fixed joint '{joint.name}' differently on link {link} than the description does"
            raise ModelFileError(what, where, "write the models again, and use the new files")
        element.set("type", "revolute")
        ET.SubElement(element, "axis", xyz=vector_text(sign * (frame.R[:, 2] if not mounted else np.eye(3)[2])))
        _add_numbers(element, "limit", lower=-WIDE, upper=WIDE, effort=STRONG, velocity=STRONG)
    return ET.tostring(root, encoding="unicode")


def fixed_joints(root: ET.Element) -> dict[str, str]:
    """Return the link that each fixed joint carries."""
    return {joint.get("name", ""): carried_link(joint) for joint in root.iterfind("joint[@type='fixed']")}


def add_floating_base(root: ET.Element) -> None:
    """Attach the root link to the world with a floating joint."""
    base, links = root_link(root), {link.get("name") for link in root.iterfind("link")}
    world = next(name for name in ("world", "world_", "world__") if name not in links)
    ET.SubElement(root, "link", name=world)
    _ends(ET.SubElement(root, "joint", name=FLOATING, type="floating"), world, base)


def without_shapes(root: ET.Element) -> list[Content]:
    """Remove mesh shapes and purely visual elements from a URDF; return the removed content that affects mechanics."""
    touching, content = list[str](), list[Content]()
    for link in root.iterfind("link"):
        for shape in [*link.iterfind("visual"), *link.iterfind("collision")]:
            geometry = shape.find("geometry")
            for call in (element for element in shape.iter() if element.tag.startswith("xacro:")):
                content.append(Content("put in place", call.tag, f" of link {link.get('name', '')}"))
            if shape.tag == "visual" or geometry is None or geometry.find("mesh") is not None:
                link.remove(shape)
                if shape.tag == "collision":
                    touching.append(link.get("name", ""))
    for material in root.findall("material"):
        root.remove(material)
    weightless = {link.get("name", "") for link in root.iterfind("link") if link.find("inertial") is None}
    phrase = "mesh of link {}, from which MuJoCo would compute the link's mass"
    names = dict.fromkeys(touching)
    content += [Content("mass from meshes", phrase.format(name)) for name in names if name in weightless]
    return content + [Content("contacts of geoms", "collision", f" of link {name}") for name in names]


def links(xml: XmlText) -> list[TextLink]:
    """List the links of a URDF, parents first; the first entry is the root.

    Raises:
        DescriptionError: A joint names a missing link.
    """
    elements = {element.get("name"): element for element in xml.root.children if element.tag == "link"}
    towards: dict[str, list[Element]] = {}
    children = set()
    for joint in (element for element in xml.root.children if element.tag == "joint"):
        ends = [end.get("link") if (end := joint.find(tag)) else "" for tag in ("parent", "child")]
        if not {*ends} <= {*elements}:
            raise DescriptionError(
                f"joint '{joint.get('name')}' does not connect two links", "the URDF", "name two links of the file"
            )
        towards.setdefault(ends[0], []).append(joint)
        children.add(ends[1])
    found = [TextLink(name, elements[name]) for name in elements if name not in children][:1]
    for i, near in enumerate(found):  # the list grows during the loop
        near.matter, near.turn = _matter(near.element)
        for joint in towards.get(near.name, []):
            name = child.get("link") if (child := joint.find("child")) else ""
            moves = {} if joint.get("type") == "fixed" else {joint.get("name"): joint}
            found.append(TextLink(name, elements[name], i, moves, joint, near.frame @ origin(joint)))
    return found


def origin(element: Element) -> Array:
    """Return the placement that the ``<origin>`` of a URDF element defines. Shape (4, 4)."""
    place = element.find("origin")
    if place is None:
        return np.eye(4)
    return matrix(numbers(place.get("xyz")), of_rpy(numbers(place.get("rpy"))))


def _matter(link: Element) -> tuple[Matter, Array]:
    """Return a link's mass properties, and the orientation of the frame in which the file gives the tensor."""
    inertial = link.find("inertial")
    if inertial is None:
        return NOTHING, np.eye(3)
    T, mass, entries = origin(inertial), inertial.find("mass"), inertial.find("inertia")
    R = T[:3, :3]
    J = tensor(float(entries.get(f"i{name}", "0")) if entries else 0.0 for name in TENSOR)
    return Matter(float(mass.get("value", "0")) if mass else 0.0, T[:3, 3], R @ J @ R.T), R


def place(xml: XmlText, link: TextLink, T: Array) -> None:
    """Set the placement of a link relative to its parent."""
    if link.mount is not None:
        _set_origin(xml, link.mount, T)


def _set_origin(xml: XmlText, element: Element, T: Array) -> None:
    old = origin(element)
    new = {}
    if np.abs(T[:3, 3] - old[:3, 3]).max() > SAME:
        new["xyz"] = vector_text(T[:3, 3])
    if np.abs(T[:3, :3] - old[:3, :3]).max() > SAME:
        new["rpy"] = vector_text(rpy(T[:3, :3]))
    xml.set_in(element, "origin", **new)


def direct(xml: XmlText, joint: Element, axis: Array, point: Array) -> None:
    """Set the axis of a joint in the frame of its link; the axis passes through the origin of the link."""
    xml.set_in(joint, "axis", xyz=vector_text(axis))


def fill(xml: XmlText, link: TextLink, matter: Matter, *, plain: bool) -> None:
    """Set the mass properties of a link; write only the properties that differ.

    Args:
        plain: Write all properties, with the tensor in the axes of the link.
    """
    inertial, old = link.element.find("inertial"), link.matter
    T = np.eye(4) if inertial is None or plain else origin(inertial)
    R = T[:3, :3]
    J = R.T @ matter.inertia @ R
    if inertial is None:
        xml.insert(link.element, inertial_text(matter))
        return
    if plain or old is None or matter.mass != old.mass:
        xml.set_in(inertial, "mass", value=number_text(matter.mass))
    if plain:
        xml.set_in(inertial, "origin", xyz=vector_text(matter.com), rpy="0 0 0")
    else:
        _set_origin(xml, inertial, matrix(matter.com, R))
    if plain or old is None or not np.allclose(matter.inertia, old.inertia, rtol=0.0, atol=1e-15 * np.abs(J).max()):
        xml.set_in(inertial, "inertia", **moments(J))


def inertial_text(matter: Matter) -> str:
    """Format mass properties as an ``<inertial>``, with the tensor in the axes of the link."""
    tensor = " ".join(f'{name}="{value}"' for name, value in moments(matter.inertia).items())
    where = f'<origin xyz="{vector_text(matter.com)}" rpy="0 0 0"/>'
    return f'<inertial>{where}<mass value="{number_text(matter.mass)}"/><inertia {tensor}/></inertial>'


def tell(xml: XmlText, joint: Element, what: str, value: Array) -> None:
    """Set a property of a joint."""
    if what == "limits":
        bounds = {side: number_text(bound) for side, bound in zip(("lower", "upper"), value, strict=True)}
        xml.set_in(joint, "limit", **{side: bound for side, bound in bounds.items() if np.isfinite(float(bound))})
    else:
        tag, name = JOINT[what]
        xml.set_in(joint, tag, **{name: number_text(float(value))})


def couple(xml: XmlText, joint: Element, coupling: CouplingReading) -> None:
    """Set the coefficients of a joint that mimics another joint."""
    function = coupling.function
    if joint.find("mimic") is None or len(function.terms) > 1 or not function.linear:
        raise UnpatchableError(f"joint '{coupling.joint}' does not mimic exactly one joint linearly")
    multiplier = function.slopes.get(function.lead, 0.0)
    xml.set_in(joint, "mimic", offset=number_text(function.constant), multiplier=number_text(multiplier))


def check_matter(xml: XmlText) -> None:
    """Accept any URDF: libraries use its mass properties unchanged."""


def hang(xml: XmlText, link: TextLink, near: TextLink) -> None:
    """Attach a link to a different parent link."""
    if link.mount is not None:
        xml.set_in(link.mount, "parent", link=near.name)


def drop(xml: XmlText, gone: Collection[TextLink]) -> None:
    """Remove links and their joints."""
    for link in gone:
        xml.replace(link.element)
        if link.mount is not None:
            xml.replace(link.mount)


#: The children of removed links have already been attached to other links.
splice = drop
