"""Mechanisms as links and joints of a graph, and as SDF: twins in formats that state loops themselves."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from xml.etree import ElementTree as ET

import numpy as np

from screwgauge.models.check import home_poses
from screwgauge.models.formats import TENSOR, quaternion, vector_text
from screwgauge.models.importing.model import Imported, Options, describe
from screwgauge.models.layout import lay_out
from screwgauge.models.poses import exponential, matrix, screw
from screwgauge.models.readings.graph import GraphJoint, read_graph
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
    return home_poses(lay_out(mechanism, "minimal"))


def ordered(mechanism: Mechanism, last: str) -> list[Joint]:
    return sorted((j for j in mechanism.joints if j.constrains), key=lambda joint: joint.kind == last)


def reading_of(mechanism: Mechanism, last: str = "") -> Reading:
    poses = poses_of(mechanism)
    links = {b.name: BodyReading(b.mass, b.com, b.inertia, "", (), poses[b.name]) for b in mechanism.bodies}
    link = {GROUND: ""}
    joints = {
        j.name: GraphJoint(link.get(j.parent, j.parent), link.get(j.child, j.child), freedoms_of(j, poses[j.parent])[0])
        for j in ordered(mechanism, last)
    }
    more = {"name": mechanism.name, "gravity": np.array([0.0, 0.0, -9.81]), "form": "sdf"}
    reading = read_graph(links, joints, mechanism.name, **more)
    return replace(reading, couplings=couplings_of(mechanism.couplings))


def wanted(mechanism: Mechanism) -> Options:
    return Options(independent=mechanism.independent, actuated=[joint.coordinates[0] for joint in mechanism.actuators])


def described(mechanism: Mechanism, last: str = "") -> Imported:
    return describe(reading_of(mechanism, last), mechanism.name, wanted(mechanism))


def sdf_of(mechanism: Mechanism, last: str = "", gravity: Sequence[float] = (0.0, 0.0, -9.81)) -> str:
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


#: Kind of joint -> type of a USD joint, and the freedoms that it has in the axes of its frame.
USD_TYPES = {
    "R": ("Revolute", ("Z",)),
    "P": ("Prismatic", ("Z",)),
    "S": ("Spherical", ()),
    "fixed": ("Fixed", ()),
    "U": ("", ("rotX", "rotY")),
    "C": ("", ("rotZ", "transZ")),
    "E": ("", ("transX", "transY", "rotZ")),
}
FREE_AXES = [f"{kind}{axis}" for kind in ("trans", "rot") for axis in "XYZ"]


def usd_of(mechanism: Mechanism, last: str = "", unit: float = 1.0) -> str:
    """A USD whose poses are the home of a mechanism; what closes loops is excluded from the articulation.

    Args:
        unit: Metres a unit of length.
    """
    poses, names = poses_of(mechanism), {body.name: f"body_{i}" for i, body in enumerate(mechanism.bodies)}
    head = f'defaultPrim = "w"\nmetersPerUnit = {unit!r}\nkilogramsPerUnit = 1\nupAxis = "Z"'
    out = [f'#usda 1.0\n({head})\ndef Xform "w" {{\ndef PhysicsScene "scene" {{}}']
    for body in mechanism.bodies:
        T = poses[body.name].copy()
        T[:3, 3] /= unit
        moments, A = np.diag(body.inertia), np.eye(3)
        if np.abs(body.inertia - np.diag(moments)).max() > 0.0:
            moments, A = np.linalg.eigh(body.inertia)
            A[:, 0] *= np.sign(np.linalg.det(A))
        rows = ", ".join(_tuple(row) for row in T.T)
        out.append(
            f'def Xform "{names[body.name]}" (prepend apiSchemas = ["PhysicsRigidBodyAPI", "PhysicsMassAPI"]) {{\n'
            f'matrix4d xformOp:transform = ({rows})\nuniform token[] xformOpOrder = ["xformOp:transform"]\n'
            f"float physics:mass = {body.mass!r}\npoint3f physics:centerOfMass = {_tuple(body.com / unit)}\n"
            f"float3 physics:diagonalInertia = {_tuple(moments / unit**2)}\n"
            f"quatf physics:principalAxes = {_tuple(quaternion(A))}\n}}"
        )
    for joint in ordered(mechanism, last):
        kind, axes = USD_TYPES[joint.kind]
        D6 = kind == "" and joint.kind != "fixed"
        locked = [axis for axis in FREE_AXES if D6 and axis not in axes]
        api = ", ".join(f'"PhysicsLimitAPI:{axis}"' for axis in locked)
        head = f"(prepend apiSchemas = [{api}])" if api else ""
        out.append(f'def Physics{kind}Joint "{usd_name(joint.name)}" {head} {{')
        turn = _axes(joint)
        for k, (body, frame) in enumerate(joint.sides):
            if body != GROUND:
                out.append(f"rel physics:body{k} = </w/{names[body]}>")
            out.append(f"point3f physics:localPos{k} = {_tuple(frame.p / unit)}")
            out.append(f"quatf physics:localRot{k} = {_tuple(quaternion(frame.R @ turn))}")
        if kind in ("Revolute", "Prismatic"):
            out.append('uniform token physics:axis = "Z"')
        out += [f"float limit:{axis}:physics:low = 1\nfloat limit:{axis}:physics:high = -1" for axis in locked]
        out.append(f"bool physics:excludeFromArticulation = {int(joint.kind == last)}\n}}")
    return "\n".join([*out, "}\n"])


def usd_name(name: str) -> str:
    """A name as an identifier."""
    return re.sub(r"\W", "_", name)


def _axes(joint: Joint) -> Array:
    if joint.kind in ("S", "fixed"):
        return np.eye(3)
    if joint.kind == "U":
        x, y = joint.axes
        return np.array([x, y, np.cross(x, y)]).T
    z = joint.axes[0]
    x = np.eye(3)[int(np.argmin(np.abs(z)))]
    x = x - (x @ z) * z
    x /= np.linalg.norm(x)
    return np.array([x, np.cross(z, x), z]).T


def _tuple(values: object) -> str:
    return f"({', '.join(repr(float(x)) for x in np.ravel(values))})"  # type: ignore[arg-type]


def link_name(body: str) -> str:
    return "world" if body == GROUND else f"{body}.link"


def _text(parent: ET.Element, tag: str, values: object) -> None:
    ET.SubElement(parent, tag).text = vector_text(values)  # type: ignore[arg-type]


def _pose(parent: ET.Element, T: Array, **attributes: str) -> None:
    w, x, y, z = quaternion(T[:3, :3])
    text = vector_text([*T[:3, 3], x, y, z, w])
    ET.SubElement(parent, "pose", rotation_format="quat_xyzw", **attributes).text = text
