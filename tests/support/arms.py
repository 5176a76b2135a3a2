"""An arm with a gripper and a loop as SDF, USD, MJCF and URDF, for files that lost a part of it."""

from collections.abc import Callable
from copy import deepcopy
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from screwgauge.models.formats import TENSOR, number_text, tensor_text, vector_text
from screwgauge.reference.rotations import Array, quaternion_rotation

Y, Z, X = (0.0, 1.0, 0.0), (0.0, 0.0, 1.0), (1.0, 0.0, 0.0)
WORLD = ""


@dataclass
class Link:
    """A link: its matter, moments along axes turned by a quaternion (w, x, y, z), and its place in the world."""

    mass: float
    com: tuple[float, float, float]
    moments: tuple[float, float, float]
    at: tuple[float, float, float]
    turn: tuple[float, float, float, float] = (1.0, 0.0, 0.0, 0.0)
    products: bool = True

    @property
    def inertia(self) -> Array:
        R = quaternion_rotation(np.array(self.turn) / np.linalg.norm(self.turn))
        I = R @ np.diag(self.moments) @ R.T
        return I if self.products else np.diag(np.diag(I))


@dataclass
class Joint:
    kind: str
    parent: str
    child: str
    axis: tuple[float, float, float] = Z
    limits: tuple[float, float] | None = (-2.0, 2.0)
    damping: float = 0.0
    friction: float = 0.0
    armature: float = 0.0
    effort: float = 0.0
    mimic: tuple[str, float, float] | None = None
    at: tuple[float, float, float] | None = None
    loop: bool = False


@dataclass
class Arm:
    """All of it."""

    links: dict[str, Link] = field(default_factory=dict)
    joints: dict[str, Joint] = field(default_factory=dict)
    gravity: tuple[float, float, float] = (0.0, 0.0, -9.81)
    unit: float = 1.0
    kilo: float = 1.0

    def place(self, joint: Joint) -> Array:
        return np.array(joint.at if joint.at is not None else self.links[joint.child].at)


def arm() -> Arm:
    turn = (0.8, 0.6, 0.0, 0.0)
    return Arm(
        {
            "shoulder": Link(2.4, (0.01, 0.02, 0.14), (0.021, 0.02, 0.004), (0, 0, 0.1)),
            "upper": Link(1.6, (0.02, -0.015, 0.11), (0.011, 0.0105, 0.0021), (0, 0.05, 0.4), turn),
            "fore": Link(0.9, (0.015, 0.01, 0.09), (0.0031, 0.0042, 0.0022), (0, 0.05, 0.65), (0.6, 0, 0.8, 0)),
            "strut": Link(0.3, (0.0, 0.0, 0.1), (0.0011, 0.0012, 0.0002), (0.1, 0.05, 0.4)),
            "thumb": Link(0.1, (0.02, 0.0, 0.03), (0.0001, 0.0002, 0.00015), (0.05, 0.05, 0.9)),
            "finger": Link(0.12, (-0.02, 0.0, 0.03), (0.0001, 0.0002, 0.00016), (-0.05, 0.05, 0.9)),
        },
        {
            "j1": Joint("hinge", WORLD, "shoulder", Z, (-2, 2), 0.5, 0.1, 0.02, 50),
            "j2": Joint("hinge", "shoulder", "upper", Y, (-1.5, 2), 0.4, 0.0, 0.03, 40),
            "j3": Joint("hinge", "upper", "fore", Y, (-2, 1), 0.25, 0.0, 0.01, 30),
            "s": Joint("hinge", "shoulder", "strut", Y, None),
            "t": Joint("hinge", "fore", "strut", Y, None, at=(0.1, 0.05, 0.65), loop=True),
            "g1": Joint("slide", "fore", "thumb", X, (0, 0.04), 2.0, 0.0, 0.0, 10),
            "g2": Joint("slide", "fore", "finger", X, (-0.04, 0), mimic=("g1", -1.0, 0.0)),
        },
    )


def sdf(arm: Arm) -> str:
    out = [f'<sdf version="1.11"><world name="w"><gravity>{vector_text(arm.gravity)}</gravity><model name="arm">']
    for name, link in arm.links.items():
        I = "".join(f"<i{key}>{number_text(link.inertia[at])}</i{key}>" for key, at in TENSOR.items())
        out.append(
            f'<link name="{name}"><pose>{vector_text(link.at)} 0 0 0</pose><inertial>'
            f"<pose>{vector_text(link.com)} 0 0 0</pose><mass>{link.mass}</mass><inertia>{I}</inertia>"
            "</inertial></link>"
        )
    for name, joint in arm.joints.items():
        kind = {"hinge": "revolute", "slide": "prismatic"}.get(joint.kind, joint.kind)
        limit = "" if joint.limits is None else "<lower>{}</lower><upper>{}</upper>".format(*joint.limits)
        limit += f"<effort>{joint.effort}</effort>" if joint.effort else ""
        mimic = ""
        if joint.mimic:
            mimic = '<mimic joint="{}"><multiplier>{}</multiplier><offset>{}</offset></mimic>'.format(*joint.mimic)
        axis = (
            f'<axis><xyz expressed_in="__model__">{vector_text(joint.axis)}</xyz><limit>{limit}</limit><dynamics>'
            f"<damping>{joint.damping}</damping><friction>{joint.friction}</friction></dynamics>{mimic}</axis>"
        )
        out.append(
            f'<joint name="{name}" type="{kind}"><pose relative_to="__model__">{vector_text(arm.place(joint))} 0 0 0'
            f"</pose><parent>{joint.parent or 'world'}</parent><child>{joint.child}</child>"
            f"{axis if kind != 'fixed' else ''}</joint>"
        )
    return "\n".join([*out, "</model></world></sdf>"])


def usd(arm: Arm) -> str:
    """The arm as USD."""
    size = float(np.linalg.norm(arm.gravity)) / arm.unit
    head = (
        f'#usda 1.0\n(\ndefaultPrim = "arm"\nmetersPerUnit = {arm.unit}\nkilogramsPerUnit = {arm.kilo}\nupAxis = "Z"\n)'
    )
    out = [f'{head}\ndef Xform "arm" {{\ndef PhysicsScene "scene" {{']
    out.append(f"vector3f physics:gravityDirection = {_of(arm.gravity)}\nfloat physics:gravityMagnitude = {size!r}\n}}")
    for name, link in arm.links.items():
        moments, turn = (link.moments, link.turn) if link.products else (np.diag(link.inertia), (1, 0, 0, 0))
        moments = np.array(moments) / arm.unit**2 / arm.kilo
        out.append(
            f'def Xform "{name}" (prepend apiSchemas = ["PhysicsRigidBodyAPI", "PhysicsMassAPI"]) {{\n'
            f"double3 xformOp:translate = {_of(np.array(link.at) / arm.unit)}\n"
            f'uniform token[] xformOpOrder = ["xformOp:translate"]\nfloat physics:mass = {link.mass / arm.kilo!r}\n'
            f"point3f physics:centerOfMass = {_of(np.array(link.com) / arm.unit)}\n"
            f"float3 physics:diagonalInertia = {_of(moments)}\nquatf physics:principalAxes = {_of(turn)}\n}}"
        )
    for name, joint in arm.joints.items():
        kind = {"hinge": "Revolute", "slide": "Prismatic", "fixed": "Fixed"}[joint.kind]
        at = arm.place(joint)
        # z of the joint's frame becomes its axis by a turn about an axis in the plane of x and y
        z = np.array(joint.axis) / np.linalg.norm(joint.axis)
        q = np.array([1.0 + z[2], -z[1], z[0], 0.0]) if z[2] > -1.0 else np.array([0.0, 1.0, 0.0, 0.0])
        lines = []
        for k, body in enumerate((joint.parent, joint.child)):
            origin = np.array(arm.links[body].at) if body else np.zeros(3)
            lines += [f"rel physics:body{k} = </arm/{body}>"] * bool(body)
            lines.append(f"point3f physics:localPos{k} = {_of((at - origin) / arm.unit)}")
            lines.append(f"quatf physics:localRot{k} = {_of(q / np.linalg.norm(q))}")
        if kind != "Fixed":
            lines.append('uniform token physics:axis = "Z"')
        if joint.limits and kind != "Fixed":
            scaled = np.degrees(joint.limits) if kind == "Revolute" else np.array(joint.limits) / arm.unit
            lines += [
                f"float physics:{n}Limit = {x!r}" for n, x in zip(("lower", "upper"), scaled.tolist(), strict=True)
            ]
        hinge = joint.kind == "hinge"
        lines.append(f"float newton:armature = {joint.armature!r}")
        lines.append(f"float newton:damping = {float(np.radians(joint.damping)) if hinge else joint.damping!r}")
        lines.append(f"float newton:friction = {joint.friction!r}")
        if joint.effort:
            drive = f"drive:{'angular' if hinge else 'linear'}:physics"
            most = joint.effort / arm.kilo / arm.unit ** (2 if hinge else 1)
            lines.append(f"float {drive}:stiffness = 0\nfloat {drive}:maxForce = {most!r}")
        if joint.mimic:
            leader, slope, offset = joint.mimic
            lines.append(f"rel newton:mimicJoint = </arm/{leader}>\nfloat newton:mimicCoef1 = {slope!r}")
            lines.append(f"float newton:mimicCoef0 = {offset / arm.unit!r}")
        lines.append(f"bool physics:excludeFromArticulation = {int(joint.loop)}")
        out.append(f'def Physics{kind}Joint "{name}" {{\n' + "\n".join(lines) + "\n}")
    return "\n".join([*out, "}\n"])


def _of(values: object) -> str:
    return f"({', '.join(repr(float(x)) for x in np.ravel(values))})"  # type: ignore[arg-type]


def mjcf(arm: Arm) -> str:
    children: dict[str, list[str]] = {}
    for name, joint in arm.joints.items():
        if not joint.loop:
            children.setdefault(joint.parent, []).append(name)

    def bodies(parent: str) -> str:
        out, origin = [], np.array(arm.links[parent].at) if parent else np.zeros(3)
        for name in children.get(parent, []):
            joint, link = arm.joints[name], arm.links[arm.joints[name].child]
            text = f'<body name="{joint.child}" pos="{vector_text(np.array(link.at) - origin)}">'
            if joint.kind != "fixed":
                limits = "" if joint.limits is None else f'range="{vector_text(joint.limits)}"'
                effort = f'actuatorfrcrange="{-joint.effort} {joint.effort}"' if joint.effort else ""
                at = vector_text(arm.place(joint) - np.array(link.at))
                text += (
                    f'<joint name="{name}" type="{joint.kind}" pos="{at}" axis="{vector_text(joint.axis)}" {limits} '
                    f'damping="{joint.damping}" frictionloss="{joint.friction}" armature="{joint.armature}" {effort}/>'
                )
            I = tensor_text(link.inertia)
            text += f'<inertial pos="{vector_text(link.com)}" mass="{link.mass}" fullinertia="{I}"/>'
            out.append(f"{text}{bodies(joint.child)}</body>")
        return "".join(out)

    rows = []
    for name, joint in arm.joints.items():
        if joint.loop:
            for i, side in enumerate((-0.5, 0.5)):
                anchor = arm.place(joint) + side * np.array(joint.axis) - np.array(arm.links[joint.parent].at)
                at = vector_text(anchor)
                rows.append(f'<connect name="{name}.{i}" body1="{joint.parent}" body2="{joint.child}" anchor="{at}"/>')
        if joint.mimic:
            leader, slope, offset = joint.mimic
            rows.append(f'<joint joint1="{name}" joint2="{leader}" polycoef="{offset} {slope} 0 0 0"/>')
    return (
        f'<mujoco model="arm"><compiler angle="radian" autolimits="true" boundmass="0" boundinertia="0"/>'
        f'<option gravity="{vector_text(arm.gravity)}"/><worldbody>{bodies(WORLD)}</worldbody>'
        f"<equality>{''.join(rows)}</equality></mujoco>"
    )


def urdf(arm: Arm) -> str:
    out = ['<robot name="arm"><link name="world"/>']
    for name, link in arm.links.items():
        I = " ".join(f'i{key}="{number_text(link.inertia[at])}"' for key, at in TENSOR.items())
        out.append(
            f'<link name="{name}"><inertial><origin xyz="{vector_text(link.com)}"/><mass value="{link.mass}"/>'
            f"<inertia {I}/></inertial></link>"
        )
    for name, joint in arm.joints.items():
        if joint.loop:
            continue
        kind = {"hinge": "revolute", "slide": "prismatic", "fixed": "fixed"}[joint.kind]
        kind = "continuous" if kind == "revolute" and joint.limits is None else kind
        origin = np.array(arm.links[joint.parent].at) if joint.parent else np.zeros(3)
        low, high = joint.limits or (-1e3, 1e3)
        mimic = '<mimic joint="{}" multiplier="{}" offset="{}"/>'.format(*joint.mimic) if joint.mimic else ""
        limit = f'<limit lower="{low}" upper="{high}" effort="{joint.effort or 1e9}" velocity="100"/>'
        at = np.array(arm.links[joint.child].at) - origin
        out.append(
            f'<joint name="{name}" type="{kind}"><parent link="{joint.parent or "world"}"/>'
            f'<child link="{joint.child}"/><origin xyz="{vector_text(at)}"/>'
            f'<axis xyz="{vector_text(joint.axis)}"/>{limit if kind != "fixed" else ""}{mimic}'
            f'<dynamics damping="{joint.damping}" friction="{joint.friction}"/></joint>'
        )
    return "\n".join([*out, "</robot>"])


WRITERS: dict[str, Callable[[Arm], str]] = {"sdf": sdf, "usda": usd, "xml": mjcf, "urdf": urdf}


def write(folder: Path, name: str, form: str, change: Callable[[Arm], None] | None = None) -> Path:
    one = deepcopy(arm())
    if form in ("sdf", "urdf"):  # which have none
        for joint in one.joints.values():
            joint.armature = 0.0
    if change is not None:
        change(one)
    file = folder / f"{name}.{form}"
    file.write_text(WRITERS[form](one), encoding="utf-8")
    return file
