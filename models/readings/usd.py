"""USD (UsdPhysics) as a reading: bodies with their matter, joints between frames of both, drives and mimics."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from screwgauge.models.content import Content, force_limits
from screwgauge.models.files.usd import is_joint, names_of, prims, stage_of, triangles_of, value
from screwgauge.models.matter import NOTHING, Matter, displaced, joined, polyhedron, uniform
from screwgauge.models.poses import exponential, matrix, relative, screw
from screwgauge.models.readings.graph import WORLD, GraphJoint, graph_of_links
from screwgauge.models.readings.reading import (
    FREE,
    OWN,
    ActuatorReading,
    BodyReading,
    CouplingReading,
    JointReading,
    Reading,
)
from screwgauge.reference.couplings import PolynomialSum
from screwgauge.reference.errors import ModelFileError, first_few
from screwgauge.reference.files import check_count
from screwgauge.reference.rotations import Array, quaternion_rotation

#: Gaps and turns that are the rounding of 32 bits [m or rad]; density that a file leaves open [kg/m^3]; gravity.
ROUNDING, _WATER, _GRAVITY = 1e-6, 1000.0, 9.81
_AXES = {"X": 0, "Y": 1, "Z": 2}
#: Freedoms of a joint by the axes of its frames, in the order in which they follow each other.
_FREEDOMS = {f"{kind}{axis}": (k, i) for kind, k in (("trans", "slide"), ("rot", "hinge")) for axis, i in _AXES.items()}
#: What a joint's reading has -> attributes; per degree where a list says so.
_PASSIVE = {
    "armature": ("newton:armature", "physxJoint:armature", "mjc:armature"),
    "damping": ("newton:damping", "mjc:damping"),
    "friction": ("newton:friction", "mjc:frictionloss"),
    "stiffness": ("mjc:stiffness",),
    "rest": ("mjc:springref",),
}
_DRIVE = ("type", "stiffness", "damping", "targetPosition", "targetVelocity")
#: Types of joints that are read.
_TYPES = tuple(f"Physics{kind}Joint" for kind in ("Revolute", "Prismatic", "Spherical", "Fixed", ""))


def read_usd(path: Path, name: str) -> Reading:
    """Reads all rigid bodies of a stage, and the joints between them; coordinates at home are those of its poses.

    Raises:
        ScrewgaugeError: The stage cannot be read, or holds what no reading does.
    """
    from pxr import Usd, UsdGeom, UsdPhysics

    stage = stage_of(path)
    every = [*prims(stage)]
    moving = [
        prim for prim in every if prim.HasAPI(UsdPhysics.RigidBodyAPI) and value(prim, "physics:rigidBodyEnabled")
    ]
    check_count(len(moving), "links", str(path))
    names = dict(zip((prim.GetPath() for prim in moving), names_of(moving), strict=True))
    units = UsdGeom.GetStageMetersPerUnit(stage), UsdPhysics.GetStageKilogramsPerUnit(stage)
    read = _Stage(stage, str(path), *units, UsdGeom.XformCache(Usd.TimeCode.Default()), names)
    joints = [prim for prim in every if is_joint(prim)]
    graph = {one.name: one for one in map(read.joint, joints, names_of(joints)) if one is not None}
    links = {names[prim.GetPath()]: read.body(prim) for prim in moving}
    edges, serial = _in_series({n: one.in_graph() for n, one in graph.items()})
    assembled = graph_of_links(links, edges, str(path), rounding=ROUNDING)
    return Reading(
        name=name,
        library=OWN,
        bodies=assembled.assembly.bodies,
        joints=assembled.joints,
        fixed=assembled.assembly.fixed,
        closures=assembled.closures,
        couplings={c.joint: c for one in graph.values() for c in one.couplings(graph)},
        actuators={n: ActuatorReading(n) for one in graph.values() for n, _ in one.drives()},
        gravity=read.gravity(next((prim for prim in every if prim.IsA(UsdPhysics.Scene)), None)),
        content=(*read.content, *(each for one in graph.values() for each in one.content())),
        frames={n: joint.child for n, joint in edges.items() if not joint.freedoms},
        remarks=(*_apart({n: one.gap for n, one in graph.items()}), *serial),
    )


def _in_series(joints: Mapping[str, GraphJoint]) -> tuple[dict[str, GraphJoint], list[str]]:
    """Joints of which several between the same two bodies are one, as Newton reads them, and a sentence on these."""
    found, pairs = dict[str, GraphJoint](), dict[tuple[str, str], list[str]]()
    for name, joint in joints.items():
        if joint.loop or not joint.freedoms:
            found[name] = joint
            continue
        same = pairs.setdefault((joint.parent, joint.child), [])
        same.append(name)
        first = found.get(same[0], joint)
        found[same[0]] = replace(first, freedoms={**first.freedoms, **joint.freedoms})
    several = [names for names in pairs.values() if len(names) > 1]
    return found, [
        f"Joints {', '.join(names)} join the same bodies: they are read as one after the other." for names in several
    ]


def _apart(gaps: Mapping[str, float]) -> Iterator[str]:
    """Sentences on joints whose two frames do not meet."""
    small = {name: gap for name, gap in gaps.items() if 0.0 < gap <= ROUNDING}
    if (most := max(small.values(), default=0.0)) > ROUNDING**2:
        yield f"Frames of {first_few(small, 3)} are up to {most:.1g} m or rad apart on their bodies: they are closed."
    for name, gap in gaps.items():
        if gap > ROUNDING:
            yield f"Frames of joint {name} are {gap:.2g} m or rad apart on its bodies: poses are those that close them."


@dataclass(frozen=True, slots=True)
class _Stage:
    """A stage with its units, and the names of its bodies by their paths."""

    stage: Any
    where: str
    unit: float
    kilo: float
    cache: Any
    bodies: Mapping[Any, str]
    content: list[Content] = field(default_factory=list)

    def joint(self, prim: Any, name: str) -> _Joint | None:
        """A joint that constrains something."""
        kind = str(prim.GetTypeName())
        off, distance = not value(prim, "physics:jointEnabled", default=True), kind == "PhysicsDistanceJoint"
        if off or distance:
            what = (
                ("put in place", f"joint {name}, switched off")
                if off
                else ("other equalities", f"distance joint {name}")
            )
            self.content.append(Content(*what))
            return None
        if kind not in _TYPES:
            raise ModelFileError(f"joint {name} is a {kind}", self.where, f"make it one of {', '.join(_TYPES)}")
        one = _Joint(prim, name, self)
        same = self.side(prim, 0)[0] == self.side(prim, 1)[0]
        return None if len(one.tokens) == len(_FREEDOMS) or same else one

    def placed(self, prim: Any) -> tuple[Array, Array]:
        """Pose of a prim in the world, and its scale. Shapes (4, 4), (3,)."""
        M = np.array(self.cache.GetLocalToWorldTransform(prim), dtype=float).T
        scale = np.linalg.norm(M[:3, :3], axis=0)
        scale[0] *= math.copysign(1.0, np.linalg.det(M[:3, :3]))
        if not scale.all():
            raise ModelFileError(f"scales {prim.GetPath()} to nothing", self.where, "give it a size")
        return matrix(self.unit * M[:3, 3], M[:3, :3] / scale), scale

    def body_of(self, prim: Any) -> str:
        """The body that a prim is part of; `WORLD` of what does not move."""
        while prim and not prim.IsPseudoRoot() and prim.GetPath() not in self.bodies:
            prim = prim.GetParent()
        return self.bodies.get(prim.GetPath(), WORLD) if prim else WORLD

    def side(self, joint: Any, k: int) -> tuple[str, Array]:
        """The body on one side of a joint, and the joint's frame there in the world. Shape (4, 4)."""
        targets = joint.GetRelationship(f"physics:body{k}").GetForwardedTargets()
        prim = self.stage.GetPrimAtPath(targets[0]) if targets else None
        if targets and not prim:
            raise ModelFileError(
                f"joint {joint.GetName()} joins {targets[0]}, which is not there", self.where, "mend it"
            )
        T, scale = self.placed(prim) if prim else (np.eye(4), np.ones(3))
        p = np.array(value(joint, f"physics:localPos{k}"), dtype=float)
        R = _turn(value(joint, f"physics:localRot{k}"))
        return self.body_of(prim), T @ matrix(self.unit * scale * p, np.eye(3) if R is None else R)

    def body(self, prim: Any) -> BodyReading:
        """Matter and pose of a body."""
        (T, scale), name = self.placed(prim), self.bodies[prim.GetPath()]
        said = [self.stated(prim, scale, Matter(0.0, np.full(3, np.nan), np.full((3, 3), np.nan)))]
        if not said[0].mass or np.isnan(said[0].com).any() or np.isnan(said[0].inertia).any():
            density = value(prim, "physics:density", default=0.0)
            inside = (each for each in prims(self.stage) if each.GetPath().HasPrefix(prim.GetPath()))
            shapes = [each for each in inside if self.body_of(each) == name and value(each, "physics:collisionEnabled")]
            whole = joined(self.shape(each, T, name, density) for each in shapes)
            if not whole.mass:  # what OpenUSD takes then
                r = 0.1 * self.unit
                whole = Matter(self.kilo, np.zeros(3), 0.4 * self.kilo * r * r * np.eye(3))
                what = f"mass or inertia of body {name}, which states none: of a ball of {r:g} m, 1 kg unless stated"
                self.content.append(Content("read otherwise by the library", what))
            said[0] = self.stated(prim, scale, whole)
        matter = said[0]
        if value(prim, "physics:kinematicEnabled"):
            self.content.append(Content("bodies moved from outside", "kinematic body", f" {name}"))
        weightless = value(prim, "physxRigidBody:disableGravity", default=False)
        return BodyReading(matter.mass, matter.com, matter.inertia, WORLD, (), T, gravcomp=float(weightless))

    def stated(self, prim: Any, scale: Array, shapes: Matter) -> Matter:
        """Matter of a body or collider: as the file states it, and the rest as shapes have it."""
        mass = self.kilo * value(prim, "physics:mass", default=0.0)
        inertia = (mass / shapes.mass if mass and shapes.mass else 1.0) * shapes.inertia
        moments, axes = value(prim, "physics:diagonalInertia"), _turn(value(prim, "physics:principalAxes"))
        if tensor := value(prim, "newton:inertia"):
            xx, yy, zz, xy, xz, yz = tensor
            inertia = self.kilo * self.unit**2 * np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        elif moments is not None and any(moments):
            A = np.eye(3) if axes is None else axes
            inertia = self.kilo * self.unit**2 * A @ np.diag(moments) @ A.T
        com = value(prim, "physics:centerOfMass")
        stated = com is not None and np.isfinite(com).all()
        return Matter(mass or shapes.mass, self.unit * scale * np.array(com) if stated else shapes.com, inertia)

    def shape(self, prim: Any, body: Array, name: str, density: float) -> Matter:
        """Matter of a collider in the frame of its body. body: its pose, shape (4, 4)."""
        from pxr import UsdGeom, UsdShade

        if not prim.IsA(UsdGeom.Gprim):
            return NOTHING
        kind, (T, scale) = str(prim.GetTypeName()).lower(), self.placed(prim)
        size = self.unit * np.abs(scale)
        axis = _AXES[str(value(prim, "axis", default="Z"))]
        turn = np.roll(np.eye(3), axis + 1, axis=0)  # z of the shape becomes its axis
        across, along = float(np.delete(size, axis).max()), float(size[axis])
        if kind not in ("cube", "sphere", "cylinder", "capsule", "cone", "mesh"):
            what = f"mass of body {name} is to come from a {kind or 'shape'}, which is not computed"
            raise ModelFileError(what, self.where, "state mass, diagonalInertia and centerOfMass of the body (MassAPI)")
        lengths = [across * value(prim, "radius", default=1.0), along * value(prim, "height", default=1.0)]
        if kind in ("cube", "sphere"):
            lengths, turn = (size * value(prim, "size", "radius", default=1.0)).tolist(), np.eye(3)
        material = UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial("physics")[0].GetPrim()
        densities = value(prim, "physics:density"), density, material and value(material, "physics:density")
        stated = next((x for x in densities if x), 0.0)
        rho = self.kilo / self.unit**3 * stated if stated else _WATER
        points = self.unit * scale * np.array(value(prim, "points", default=()), dtype=float).reshape(-1, 3)
        solid = {"cube": "box", "sphere": "ellipsoid"}.get(kind, kind)
        own = uniform(solid, lengths, rho) if kind != "mesh" else polyhedron(points @ turn, triangles_of(prim), rho)
        return displaced(self.stated(prim, scale, displaced(own, matrix(np.zeros(3), turn))), relative(body, T))

    def gravity(self, scene: Any | None) -> Array | None:
        """Gravity of a stage; None of one without a scene whose z is up, which is the usual. Shape (3,)."""
        from pxr import UsdGeom

        axis = str(UsdGeom.GetStageUpAxis(self.stage))
        down = -np.eye(3)[_AXES[axis]]
        if scene is None:
            return None if axis == "Z" else _GRAVITY * down
        way, size = np.array(value(scene, "physics:gravityDirection")), value(scene, "physics:gravityMagnitude")
        on = value(scene, "newton:gravityEnabled", default=True)
        amount = (self.unit * size if size >= 0.0 and math.isfinite(size) else _GRAVITY) * bool(on)
        return np.asarray(amount * (way / np.linalg.norm(way) if way.any() else down))


def _turn(quaternion: Any) -> Array | None:
    """Rotation by a quaternion (w, x, y, z); None by none. Shape (3, 3)."""
    q = np.zeros(4) if quaternion is None else np.array(quaternion, dtype=float)
    return quaternion_rotation(q / np.linalg.norm(q)) if q.any() else None


@dataclass(frozen=True, slots=True)
class _Joint:
    """A joint of a stage; its freedoms are `tokens` of `_FREEDOMS`."""

    prim: Any
    name: str
    stage: _Stage

    @property
    def kind(self) -> str:
        """Its type without what all begin and end with."""
        return str(self.prim.GetTypeName()).removeprefix("Physics").removesuffix("Joint")

    @property
    def tokens(self) -> tuple[str, ...]:
        """Freedoms that it leaves, in their order."""
        axis = value(self.prim, "physics:axis", default="X")
        free = {"Revolute": (f"rot{axis}",), "Prismatic": (f"trans{axis}",), "Fixed": ()}
        free["Spherical"] = tuple(token for token in _FREEDOMS if token.startswith("rot"))
        return tuple(t for t in free.get(self.kind, tuple(_FREEDOMS)) if not self.bounds(t)[0] >= self.bounds(t)[1])

    @property
    def coordinates(self) -> dict[str, str]:
        """Token of each freedom -> its name; a ball has one."""
        tokens = self.tokens
        if len(tokens) == 1 or self.is_ball:
            return dict.fromkeys(tokens[:1], self.name)
        return {token: f"{self.name}.{token}" for token in tokens}

    @property
    def is_ball(self) -> bool:
        """Whether it turns about all axes, and does nothing else."""
        turns = len(self.tokens) == len(_AXES) and all(token.startswith("rot") for token in self.tokens)
        return turns and all(self.bounds(token) == FREE for token in self.tokens)

    def bounds(self, token: str) -> tuple[float, float]:
        """Limits of a freedom [rad or m]."""
        names = [(f"limit:{token}:physics:low",), (f"limit:{token}:physics:high",)]
        if self.kind in ("Revolute", "Prismatic"):
            names = [("physics:lowerLimit",), ("physics:upperLimit",)]
        low, high = (value(self.prim, *n, default=d) for n, d in zip(names, FREE, strict=True))
        return self.scaled(token, low), self.scaled(token, high)

    def scaled(self, token: str, x: float) -> float:
        """A coordinate in SI."""
        return math.radians(x) if token.startswith("rot") else self.stage.unit * x

    def moved(self) -> tuple[dict[str, JointReading], Array]:
        """Freedoms at home, and where the frame on the child is by them. Shape (4, 4)."""
        X, F = (self.stage.side(self.prim, k)[1] for k in (0, 1))
        if self.is_ball:
            return {self.name: JointReading("ball", np.zeros(6), X[:3, 3])}, matrix(X[:3, 3], F[:3, :3])
        freedoms, home = {}, self.home(relative(X, F))
        for token, name in self.coordinates.items():
            kind, i = _FREEDOMS[token]
            way, centre = X[:3, i], X[:3, 3]
            numbers: dict[str, Any] = self.passive(token)
            unit = screw(kind == "hinge", way, centre)
            freedoms[name] = JointReading(kind, unit, centre, home[token], self.bounds(token), **numbers)
            X = exponential(kind, way, centre, home[token]) @ X
        return freedoms, X

    def home(self, T: Array) -> dict[str, float]:
        """Coordinates by which one frame stands in the other. T: shape (4, 4)."""
        R, turning = T[:3, :3], [_FREEDOMS[token][1] for token in self.tokens if token.startswith("rot")]
        angles = [math.atan2(-R[1, 2], R[2, 2]), math.asin(float(np.clip(R[0, 2], -1.0, 1.0)))]
        angles.append(math.atan2(-R[0, 1], R[0, 0]))
        if len(turning) == 1:
            i, j, k = (turning[0] + n for n in (-3, -2, -1))
            angles[i] = math.atan2(R[k, j] - R[j, k], R[j, j] + R[k, k])
        return {t: float(T[i, 3] if kind == "slide" else angles[i]) for t, (kind, i) in _FREEDOMS.items()}

    def in_graph(self) -> GraphJoint:
        """The joint between its links."""
        (parent, _), (child, F) = (self.stage.side(self.prim, k) for k in (0, 1))
        freedoms, X = self.moved()
        loop = bool(value(self.prim, "physics:excludeFromArticulation"))
        return GraphJoint(parent, child, freedoms, X @ np.linalg.inv(F), loop)

    @property
    def gap(self) -> float:
        """How far its frames are apart [m or rad]."""
        F, X = self.stage.side(self.prim, 1)[1], self.moved()[1]
        return max(float(np.linalg.norm(X[:3, 3] - F[:3, 3])), float(np.abs(X[:3, :3] - F[:3, :3]).max()))

    def passive(self, token: str) -> dict[str, float]:
        """What a freedom exerts by itself: in SI, per radian."""
        turns, per = token.startswith("rot"), self.stage.kilo
        size = per * self.stage.unit ** (2 if turns else 0)
        found = {what: value(self.prim, *names, default=0.0) for what, names in _PASSIVE.items()}
        if turns and value(self.prim, "newton:damping") is not None:
            found["damping"] = math.degrees(found["damping"])
        found = {what: size * x for what, x in found.items()}
        rest = self.scaled(token, value(self.prim, *_PASSIVE["rest"], default=0.0))
        return {**found, "friction": found["friction"] * (1.0 if turns else self.stage.unit), "rest": rest}

    def drives(self) -> Iterator[tuple[str, str]]:
        """Coordinates that are driven, and the instance of the drive."""
        for token, name in self.coordinates.items():
            plain = {"Revolute": "angular", "Prismatic": "linear"}.get(self.kind, token)
            if value(self.prim, f"drive:{plain}:physics:stiffness") is not None and not self.is_ball:
                yield name, plain

    def content(self) -> Iterator[Content]:
        """Gains and limits of its drives."""
        for name, instance in self.drives():
            said = {n: value(self.prim, f"drive:{instance}:physics:{n}") for n in _DRIVE}
            of, values = (("joints", name, 1.0),), tuple((n, x) for n, x in said.items() if x is not None)
            yield Content("drives", "drive", f" of joint {name}", of, values)
            if math.isfinite(most := value(self.prim, f"drive:{instance}:physics:maxForce", default=math.inf)):
                per = self.stage.unit ** (2 if instance.startswith(("angular", "rot")) else 1)
                yield force_limits(name, self.stage.kilo * per * most)

    def target(self, relationship: str) -> Any:
        """Path that a relationship names; None if it names nothing."""
        return next(iter(self.prim.GetRelationship(relationship).GetForwardedTargets()), None)

    def mimics(self) -> Iterator[tuple[Any, str, str, tuple[float, float], bool]]:
        """Joint that it follows, its own and that one's freedom, constant and slope, and whether these count degrees.

        Those of PhysX count only if there is none of Newton's.
        """
        if (to := self.target("newton:mimicJoint")) and value(self.prim, "newton:mimicEnabled", default=True):
            law = value(self.prim, "newton:mimicCoef0", default=0.0), value(self.prim, "newton:mimicCoef1", default=1.0)
            yield to, self.tokens[0], "", law, False
            return
        names = (each.GetName().split(":") for each in self.prim.GetAuthoredRelationships())
        for token in (parts[1] for parts in names if parts[0] == "physxMimicJoint" and parts[-1] == "referenceJoint"):
            of = f"physxMimicJoint:{token}"
            law = -value(self.prim, f"{of}:offset", default=0.0), -value(self.prim, f"{of}:gearing", default=1.0)
            axis = str(value(self.prim, f"{of}:referenceJointAxis", default=""))
            yield self.target(f"{of}:referenceJoint"), token, axis, law, True

    def couplings(self, joints: Mapping[str, _Joint]) -> Iterator[CouplingReading]:
        """Joints that follow others."""
        for target, token, axis, (constant, slope), degrees in self.mimics():
            leader = next((one for one in joints.values() if one.prim.GetPath() == target), None)
            if leader is None or not (leader.coordinates and self.coordinates):
                what = f"joint {self.name} follows {target}, which is no joint that moves"
                raise ModelFileError(what, self.stage.where, "name another joint, or take the mimic out")
            pairs = ((token, self), (axis, leader))
            own, leads = (t if t in one.coordinates else next(iter(one.coordinates)) for t, one in pairs)
            ratio = self.scaled(own, 1.0) / leader.scaled(leads, 1.0) if degrees else 1.0
            law = PolynomialSum.of({leader.coordinates[leads]: np.array([self.scaled(own, constant), ratio * slope])})
            yield CouplingReading(self.coordinates[own], law)
