"""Mechanisms as links and joints of a graph, and as SDF: twins in formats that state loops themselves."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from xml.etree import ElementTree as ET

import numpy as np

from screwgauge.models.check import home_poses
from screwgauge.models.formats import TENSOR, quaternion, vector_text
from screwgauge.models.importing.model import Imported, Wanted, describe
from screwgauge.models.layout import lay_out
from screwgauge.models.poses import exponential, matrix, screw
from screwgauge.models.readings.graph import GraphJoint, graph_of_links
from screwgauge.models.readings.reading import BodyReading, JointReading, Reading, couplings_of
from screwgauge.reference.mechanism import GROUND, Joint, Mechanism
from screwgauge.reference.rotations import Array

#: Kind of joint -> type of an SDF, and how many axes that has.
TYPES = {
    "R": ("revolute", 1),
    "P": ("prismatic", 1),
    "U": ("universal", 2),
    "S": ("ball", 0),
    "fixed": ("fixed", 0),
}


def freedoms_of(joint: Joint, near: Array) -> tuple[dict[str, JointReading], Array]:
    """Freedoms of a joint at home in the world, and where it sits. near: pose of its parent, shape (4, 4)."""
    X = near @ matrix(joint.parent_frame.p, joint.parent_frame.R)
    if joint.kind == "S":
        return {joint.name: JointReading("ball", np.zeros(6), X[:3, 3])}, X
    found = {}
    if joint.fixed:
        return found, X
    names = (joint.name,) if len(joint.coordinates) == 1 else joint.coordinates
    numbers = zip(names, joint.freedoms, joint.home, joint.limits, joint.damping, strict=True)
    for name, (turns, axis), q, (low, high), damping in numbers:
        way, centre = X[:3, :3] @ axis, X[:3, 3]
        kind = "hinge" if turns else "slide"
        limits = float(low), float(high)
        found[name] = JointReading(kind, screw(turns, way, centre), centre, float(q), limits, damping=float(damping))
        X = exponential(kind, way, centre, float(q)) @ X
    return found, X


def poses_of(mechanism: Mechanism) -> Mapping[str, Array]:
    """World poses at home. Shape (4, 4) each."""
    return home_poses(lay_out(mechanism, "minimal"))


def ordered(mechanism: Mechanism, last: str) -> list[Joint]:
    """Joints, those of a kind last, so that they close loops; without those that constrain nothing."""
    return sorted((j for j in mechanism.joints if j.constrains), key=lambda joint: joint.kind == last)


def reading_of(mechanism: Mechanism, last: str = "") -> Reading:
    """A reading of a graph. `last`: kind of the joints that close loops, as far as they can."""
    poses = poses_of(mechanism)
    links = {b.name: BodyReading(b.mass, b.com, b.inertia, "", (), poses[b.name]) for b in mechanism.bodies}
    link = {GROUND: ""}
    joints = {
        j.name: GraphJoint(link.get(j.parent, j.parent), link.get(j.child, j.child), freedoms_of(j, poses[j.parent])[0])
        for j in ordered(mechanism, last)
    }
    graph = graph_of_links(links, joints, mechanism.name)
    return Reading(
        name=mechanism.name,
        library="screwgauge",
        bodies=graph.assembly.bodies,
        joints=graph.joints,
        fixed=graph.assembly.fixed,
        closures=graph.closures,
        couplings=couplings_of(mechanism.couplings),
        gravity=np.array([0.0, 0.0, -9.81]),
        form="sdf",
    )


def wanted(mechanism: Mechanism) -> Wanted:
    """The independent coordinates and actuators of a mechanism."""
    return Wanted(mechanism.independent, [joint.coordinates[0] for joint in mechanism.actuators])


def described(mechanism: Mechanism, last: str = "") -> Imported:
    """What import makes of the graph of a mechanism."""
    return describe(reading_of(mechanism, last), mechanism.name, wanted(mechanism))


def sdf_of(mechanism: Mechanism, last: str = "", gravity: Sequence[float] = (0.0, 0.0, -9.81)) -> str:
    """An SDF whose zero is the home of a mechanism; its coordinates have the names of its joints."""
    poses, sdf = poses_of(mechanism), ET.Element("sdf", version="1.9")
    world = ET.SubElement(sdf, "world", name="world")
    _text(world, "gravity", gravity)
    model = ET.SubElement(world, "model", name=mechanism.name)
    for body in mechanism.bodies:
        link = ET.SubElement(model, "link", name=link_name(body.name))
        _pose(link, poses[body.name])
        inertial = ET.SubElement(link, "inertial")
        _pose(inertial, matrix(body.com, np.eye(3)))
        _text(inertial, "mass", body.mass)
        inertia = ET.SubElement(inertial, "inertia")
        for key, place in TENSOR.items():
            _text(inertia, f"i{key}", body.inertia[place])
    for joint in ordered(mechanism, last):
        freedoms, X = freedoms_of(joint, poses[joint.parent])
        kind, count = TYPES[joint.kind]
        element = ET.SubElement(model, "joint", name=joint.name, type=kind)
        _pose(element, X, relative_to="__model__")
        for side in ("parent", "child"):
            ET.SubElement(element, side).text = link_name(getattr(joint, side))
        for i, freedom in enumerate([*freedoms.values()][:count]):
            axis = ET.SubElement(element, f"axis{'2' * i}")
            ET.SubElement(axis, "xyz", expressed_in="__model__").text = vector_text(freedom.direction)
    return ET.tostring(sdf, encoding="unicode")


def link_name(body: str) -> str:
    """Link of a body: no two parts of a model have one name, of which joints have that of the description."""
    return "world" if body == GROUND else f"{body}.link"


def _text(parent: ET.Element, tag: str, values: object) -> None:
    ET.SubElement(parent, tag).text = vector_text(values)  # type: ignore[arg-type]


def _pose(parent: ET.Element, T: Array, **attributes: str) -> None:
    w, x, y, z = quaternion(T[:3, :3])
    text = vector_text([*T[:3, 3], x, y, z, w])
    ET.SubElement(parent, "pose", rotation_format="quat_xyzw", **attributes).text = text
