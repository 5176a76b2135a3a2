"""Reads SDF 1.5 to 1.12: mass properties of links, shapes that define them, joints and couplings."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from xml.etree import ElementTree as ET

import numpy as np

from screwgauge.models.content import OTHER, Content, force_limits
from screwgauge.models.files.sdf import OF, Frame, Frames, base_of, is_true
from screwgauge.models.formats import TENSOR, tensor
from screwgauge.models.matter import NOTHING, SHAPES, Matter, displace, join, uniform
from screwgauge.models.poses import relative, screw
from screwgauge.models.readings.graph import WORLD, GraphJoint, Mimic, bounds, link, read_graph
from screwgauge.models.readings.reading import FREE, BodyReading, JointReading, Reading
from screwgauge.reference.errors import ModelFileError, first_few
from screwgauge.reference.rotations import Array

#: Type of a joint -> hinges, slides and balls of which it consists; the slide of a screw follows its hinge.
_KINDS = {
    "fixed": (),
    "revolute": ("hinge",),
    "continuous": ("hinge",),
    "prismatic": ("slide",),
    "universal": ("hinge", "hinge"),
    "revolute2": ("hinge", "hinge"),
    "ball": ("ball",),
    "screw": ("hinge", "slide"),
}
#: Default density of shapes [kg/m^3]; default gravity of a world [m/s^2].
_WATER, _GRAVITY = 1000.0, "0 0 -9.8"
#: Property in the reading of a joint -> element of the joint's dynamics.
_DYNAMICS = {
    "damping": "damping",
    "friction": "friction",
    "stiffness": "spring_stiffness",
    "rest": "spring_reference",
}
#: Shape -> element that contains all its lengths, for shapes without separate elements; cosine above which axes count
#: as parallel.
_WHOLE, _ALONG = {"box": "size", "ellipsoid": "radii"}, 1.0 - 1e-9
#: Way in which links define mass properties -> message about them.
_STATED = {
    "shapes": "Mass and inertia of {} come from their shapes.",
    "nothing": "SDF assigns 1 kg and 1 kg m^2 to links without a mass: {}.",
    "mass alone": "SDF assigns 1 kg m^2 to links without moments of inertia: {}.",
}
#: Number of links that a sentence names.
_NAMED = 6


def read_sdf(root: ET.Element, name: str, where: str) -> Reading:
    """Read all links and joints in a file with merged includes; the joints are at zero in the file's pose.

    Args:
        name: Name of the reading, unless exactly one model moves.

    Raises:
        ScrewgaugeError: A number, frame or kind of joint cannot be read.
    """
    world = root.find("world")
    top = root if world is None else world
    moving = [f"{m.get('name')}{OF}" for m in top.iterfind("model") if not is_true(m.findtext("static"))]
    frames = Frames(where, moving[0] if len(moving) == 1 else "")
    frames.add(top)
    frames.place()
    links = {frames.reading_name(n): f for n, f in frames.by_name.items() if f.element.tag == "link"}
    every = (_Joint(n, f, frames) for n, f in frames.by_name.items() if f.element.tag == "joint" and not f.still)
    joints = {one.name: one for one in every}
    if any(f.element.get("name") == "world" for f in links.values()):
        raise ModelFileError("a link is called 'world', which is the name of the ground", where, "rename it")
    reading = read_graph(
        {n: _link(n, f, frames) for n, f in links.items()},
        {n: GraphJoint(WORLD, n, {}) for n, f in links.items() if f.still}
        | {n: one.in_graph() for n, one in joints.items() if one.kind != "gearbox"},
        where,
        mimics=[mimic for one in joints.values() for mimic in one.mimics(joints)],
        name=frames.alone.removesuffix(OF) or name,
        gravity=None if world is None else frames.vector(world, "gravity", _GRAVITY, 3),
        content=(
            *_other_models(root, world),
            *_ball_axes(joints),
            *(force_limits(*each) for one in joints.values() for each in one.efforts()),
        ),
        remarks=tuple(_remarks({n: f.element for n, f in links.items() if not f.still})),
    )
    for n, body in reading.bodies.items():
        if body.gravcomp % 1.0:  # the weight of the remaining links acts at a different centre of mass
            remedy = "set <gravity> on all links that are fixed to each other, or on none"
            raise ModelFileError(f"switches off gravity for only a part of body {n}", where, remedy)
    return reading


def _other_models(root: ET.Element, world: ET.Element | None) -> Iterator[Content]:
    """Yield worlds and models that are not part of the first world."""
    others = [e for e in root if e.tag in ("world", "model")] if world is not None else []
    return (
        Content(OTHER, f"{e.tag} {e.get('name')}, which is outside the first world") for e in others if e is not world
    )


def _ball_axes(joints: Mapping[str, _Joint]) -> Iterator[Content]:
    """Yield the axes of ball joints, which are ignored because the coordinates of a ball do not refer to axes."""
    balls = (name for name, one in joints.items() if one.kind == "ball" and one.frame.element.find("axis") is not None)
    return (Content(OTHER, f"axis of ball joint {name}, which cannot have an axis") for name in balls)


def _remarks(links: Mapping[str, ET.Element]) -> Iterator[str]:
    """Yield messages about links without explicit mass properties."""
    stated = dict[str, list[str]]()
    for name, element in links.items():
        inertial = ET.Element("inertial") if (found := element.find("inertial")) is None else found
        numbers = "mass alone" if any(inertial.find(f"inertia/i{k}{k}") is None for k in "xyz") else "all"
        numbers = "nothing" if inertial.find("mass") is None else numbers
        stated.setdefault("shapes" if is_true(inertial.get("auto")) else numbers, []).append(name)
    return (text.format(first_few(stated[kind], _NAMED)) for kind, text in _STATED.items() if kind in stated)


def _link(name: str, frame: Frame, frames: Frames) -> BodyReading:
    """Return mass properties and pose of a link; without an ``<inertial>``, SDF defines 1 kg and 1 kg m^2."""
    element, inertial = frame.element, frame.element.find("inertial")
    inertial = ET.Element("inertial") if inertial is None else inertial
    if is_true(inertial.get("auto")):
        density = frames.number(inertial, "density", _WATER)
        matter = join(_shape(name, frame, each, density, frames) for each in element.iterfind("collision"))
        if not matter.mass:
            what = f"mass of link {name} would come from its shapes (inertial auto), but no shape has mass"
            raise ModelFileError(what, frames.where, "write out its <inertial>")
        share = frames.number(inertial, "mass", matter.mass) / matter.mass
        matter = Matter(share * matter.mass, matter.com, share * matter.inertia)
    else:
        I = tensor(frames.number(inertial, f"inertia/i{key}", float(key[0] == key[1])) for key in TENSOR)
        matter = displace(Matter(frames.number(inertial, "mass", 1.0), np.zeros(3), I), frames.pose(inertial))
    weightless = (element.findtext("gravity") or "true").strip() in ("false", "0")
    return link(matter, frames.poses[frame.placed], weightless=weightless)


def _shape(name: str, frame: Frame, collision: ET.Element, density: float, frames: Frames) -> Matter:
    """Return the mass properties of a shape in the frame of its link; `NOTHING` for a plane."""
    shape = next(iter(collision.find("geometry") or ()), ET.Element("missing shape"))
    if shape.tag == "plane":
        return NOTHING
    if shape.tag not in SHAPES:
        what = f"mass of link {name} would come from a {shape.tag} (inertial auto), which is not supported"
        raise ModelFileError(what, frames.where, "write out its <inertial>")
    whole = _WHOLE.get(shape.tag)
    tags = [whole] if whole else SHAPES[shape.tag]
    lengths = [x for tag in tags for x in frames.vector(shape, tag, "", 3 if whole else 1).tolist()]
    here, T = frames.poses[frame.placed], frames.pose(collision)
    if other := base_of(collision):
        T = relative(here, frames.at(frame.resolve(other))) @ T
    return displace(uniform(shape.tag, lengths, frames.number(collision, "density", density)), T)


@dataclass(frozen=True, slots=True)
class _Joint:
    """A joint of an SDF file."""

    full: str
    frame: Frame
    frames: Frames

    @property
    def name(self) -> str:
        """Name of the joint in the reading."""
        return self.frames.reading_name(self.full)

    @property
    def kind(self) -> str:
        """Type of the joint."""
        return self.frame.element.get("type", "")

    @property
    def coordinates(self) -> tuple[str, ...]:
        """Names of the coordinates: the name of the joint, or numbered names for several degrees of freedom."""
        count = len(_KINDS.get(self.kind, ()))
        return (self.name,) if count == 1 else tuple(f"{self.name}.{i + 1}" for i in range(count))

    def axis(self, i: int) -> ET.Element:
        """Return the axis element of degree of freedom i; a screw has only one such element, for its hinge."""
        axis = self.frame.element.find("axis2" if i and self.kind != "screw" else "axis")
        return ET.Element("axis") if axis is None else axis

    def link(self, side: str) -> str:
        """Return the link on one side of the joint, ``parent`` or ``child``."""
        if not (name := self.frame.element.findtext(side)):
            raise ModelFileError(f"joint {self.name} has no {side}", self.frames.where, "name it")
        return self.frames.link(self.frame.resolve(name))

    def direction(self, i: int) -> Array:
        """Return the unit vector of an axis in the world frame. Shape (3,)."""
        axis, base = self.axis(i), self.full
        way, (xyz,) = self.frames.vector(axis, "xyz", "0 0 1", 3), [*axis.findall("xyz"), axis][:1]
        if not way.any():
            raise ModelFileError(f"axis of joint {self.name} is 0", self.frames.where, "set a direction")
        if name := xyz.get("expressed_in"):
            base = self.frame.resolve(name)
        elif is_true(axis.findtext("use_parent_model_frame")):
            base = self.frame.model
        return np.asarray(self.frames.at(base)[:3, :3] @ way / np.linalg.norm(way))

    def in_graph(self) -> GraphJoint:
        """Convert the joint to an edge between two links."""
        if self.kind not in _KINDS:
            what = f"joint {self.name} has the unsupported type '{self.kind}'"
            raise ModelFileError(what, self.frames.where, f"use one of {', '.join(_KINDS)}, gearbox")
        parent, child = self.link("parent"), self.link("child")
        if parent == child:
            raise ModelFileError(f"joint {self.name} connects a link to itself", self.frames.where, "name two links")
        return GraphJoint(parent, child, {n: self._freedom(i) for i, n in enumerate(self.coordinates)})

    def _freedom(self, i: int) -> JointReading:
        kind, centre = _KINDS[self.kind][i], self.frames.poses[self.full][:3, 3]
        if kind == "ball":
            return JointReading("ball", np.zeros(6), centre)
        joint = JointReading(kind, screw(kind == "hinge", self.direction(i), centre), centre)
        if self.kind == "screw" and i:
            return joint
        axis, number = self.axis(i), self.frames.number
        limits = bounds(number(axis, "limit/lower", -math.inf), number(axis, "limit/upper", math.inf))
        dynamics = {what: number(axis, f"dynamics/{tag}", 0.0) for what, tag in _DYNAMICS.items()}
        return replace(joint, limits=FREE if self.kind == "continuous" else limits, **dynamics)  # type: ignore[arg-type]

    def efforts(self) -> Iterator[tuple[str, float]]:
        """Yield each coordinate that has an effort limit, with that limit [N or N m]."""
        for i, name in enumerate(self.coordinates):
            _, most = bounds(0.0, self.frames.number(self.axis(i), "limit/effort", -1.0))
            if 0.0 <= most < math.inf:
                yield name, most

    def mimics(self, joints: Mapping[str, _Joint]) -> Iterator[Mimic]:
        """Yield the coordinates that follow other coordinates; for a gearbox, yield the following hinge."""
        e, number = self.frame.element, self.frames.number
        if self.kind == "gearbox":
            (one, s), (two, t) = (self._gear_hinge(side, joints, i) for i, side in enumerate(("parent", "child")))
            yield two, one, "", 0.0, -number(e, "gearbox_ratio", 1.0) * s * t
        if self.kind == "screw":
            old = e.find("screw_thread_pitch") is None and e.find("thread_pitch") is not None
            pitch = number(e, "thread_pitch" if old else "screw_thread_pitch", 1.0)
            if not pitch:
                raise ModelFileError(f"pitch of screw {self.name} is 0", self.frames.where, "set a pitch")
            pitch = -math.tau / pitch if old else pitch
            yield self.coordinates[1], self.name, "1", 0.0, pitch / math.tau
        for i, name in enumerate(self.coordinates[: 1 if self.kind == "screw" else None]):
            if (mimic := self.axis(i).find("mimic")) is not None:
                leader, nth = self.frame.resolve(mimic.get("joint")), mimic.get("axis", "").removeprefix("axis") or "1"
                slope, zero = number(mimic, "multiplier", 1.0), number(mimic, "reference", 0.0)
                yield name, self.frames.reading_name(leader), nth, number(mimic, "offset", 0.0) - slope * zero, slope

    def _gear_hinge(self, side: str, joints: Mapping[str, _Joint], i: int) -> tuple[str, float]:
        """Return the hinge between a link and the reference body of a gearbox, and the sign of the hinge axis."""
        near, reference = self.link(side), self.link("gearbox_reference_body")
        for name, joint in joints.items():
            if _KINDS.get(joint.kind) == ("hinge",) and {joint.link("parent"), joint.link("child")} == {
                near,
                reference,
            }:
                cosine = float(joint.direction(0) @ self.direction(i))
                if abs(cosine) > _ALONG:
                    return name, math.copysign(1.0, cosine) * (1.0 if joint.link("child") == near else -1.0)
        what = f"gearbox {self.name} requires a hinge along its axis between '{near}' and '{reference or 'world'}'"
        raise ModelFileError(what, self.frames.where, "add that hinge, or name another gearbox_reference_body")
