"""Reads USD (UsdPhysics): mass properties of bodies, joints between frames of two bodies, drives and mimics."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from screwgauge.models.content import Content, force_limits
from screwgauge.models.files.usd import (
    AXES,
    axis_of,
    is_joint,
    names_of,
    number,
    numbers,
    prims,
    stage_of,
    triangles_of,
    value,
)
from screwgauge.models.formats import tensor
from screwgauge.models.matter import NOTHING, Matter, displace, join, polyhedron, uniform
from screwgauge.models.poses import exponential, matrix, relative, screw
from screwgauge.models.readings.graph import WORLD, GraphJoint, Mimic, bounds, in_series, link, read_graph
from screwgauge.models.readings.reading import FREE, ActuatorReading, BodyReading, JointReading, Reading
from screwgauge.reference.errors import ModelFileError, UnknownNameError, first_few
from screwgauge.reference.rotations import Array, quaternion_rotation, sequence_angles

#: Gaps and rotations due to rounding to 32 bits [m or rad]; default density [kg/m^3]; default gravity [m/s^2].
ROUNDING, _WATER, _GRAVITY = 1e-6, 1000.0, 9.81
_SLIDES, _TURNS = ([f"{kind}{axis}" for axis in AXES] for kind in ("trans", "rot"))
#: Default of UsdPhysics for an unspecified vector.
_UNSTATED = (-math.inf,) * 3
#: Type of a joint -> its rotations and translations about the axes of its frames, in the order of their application.
_KINDS = {
    "Revolute": ("rot{}",),
    "Prismatic": ("trans{}",),
    "Spherical": _TURNS,
    "Fixed": (),
    "": (*_SLIDES, *_TURNS),
}
#: Property in the reading of a joint -> attributes.
_PASSIVE = {
    "armature": ("newton:armature", "physxJoint:armature", "mjc:armature"),
    "damping": ("newton:damping", "mjc:damping"),
    "friction": ("newton:friction", "mjc:frictionloss"),
    "stiffness": ("mjc:stiffness",),
}
_DRIVE = ("type", "stiffness", "damping", "targetPosition", "targetVelocity")
#: Shape that can define mass -> its name in `uniform`.
_SHAPES = {name: name for name in ("cylinder", "capsule", "cone", "mesh")} | {"cube": "box", "sphere": "ellipsoid"}
#: Attribute of MuJoCo's schema that makes a shape a shell.
_SHELL = "mjc:shellinertia"
#: Tolerance for the orthonormality of a rotation; bound on units and their inverses [m, kg].
_SQUARE, _LARGEST = 1e-4, 1e9


def read_usd(path: Path, name: str) -> Reading:
    """Read all rigid bodies of a stage and the joints between them; the pose of the stage is the home pose.

    Raises:
        ScrewgaugeError: The stage cannot be read, or contains something that a reading cannot represent.
    """
    from pxr import Usd, UsdGeom, UsdPhysics

    stage = stage_of(path)
    every = [*prims(stage.GetPseudoRoot())][1:]
    bodies = [
        each for each in every if each.HasAPI(UsdPhysics.RigidBodyAPI) and value(each, "physics:rigidBodyEnabled")
    ]
    names = dict(zip((prim.GetPath() for prim in bodies), names_of(bodies), strict=True))
    units = UsdGeom.GetStageMetersPerUnit(stage), UsdPhysics.GetStageKilogramsPerUnit(stage)
    if not all(1.0 / _LARGEST < unit < _LARGEST for unit in units):
        what = f"has units of {units[0]:g} m and {units[1]:g} kg"
        raise ModelFileError(what, str(path), "set metersPerUnit and kilogramsPerUnit, such as 0.01 and 1")
    read = _Stage(stage, str(path), *units, UsdGeom.XformCache(Usd.TimeCode.EarliestTime()), names)
    found = [prim for prim in every if is_joint(prim)]
    joints = [one for one in map(read.joint, found, names_of(found)) if one is not None]
    placed = {one.name: one.graph_joint() for one in joints}
    edges, serial = {n: edge for n, (edge, _) in placed.items()}, list[str]()
    if all(value(prim, "newton:jointsAddMobility", True) for prim in every):
        edges, serial = in_series(edges, ROUNDING)
    paths = {one.prim.GetPath(): one for one in joints}
    return read_graph(
        {names[prim.GetPath()]: read.body(prim) for prim in bodies},
        edges,
        str(path),
        mimics=[mimic for one in joints for mimic in one.mimics(paths)],
        rounding=ROUNDING,
        still={names[prim.GetPath()] for prim in bodies if value(prim, "physics:kinematicEnabled")},
        name=name,
        actuators={n: ActuatorReading(n) for one in joints for n, _ in one.drives()} | _actuators(every, paths),
        gravity=read.gravity(next((prim for prim in every if prim.IsA(UsdPhysics.Scene)), None)),
        content=(*read.content, *(each for one in joints for each in one.content())),
        remarks=(*_gap_messages({n: gap for n, (_, gap) in placed.items()}), *serial),
    )


def _actuators(prims: Iterable[Any], joints: Mapping[Any, _Joint]) -> dict[str, ActuatorReading]:
    """Return the actuators of Newton and MuJoCo that drive a single hinge or slide, given the joints by path."""
    driven = dict[Any, Any]()
    for prim in prims:
        for relationship in ("newton:targets", "mjc:target"):
            target = next(iter(prim.GetRelationship(relationship).GetForwardedTargets()), None)
            if (one := joints.get(target)) is not None and len(one.coordinates) == 1 and not one.is_ball:
                driven[prim] = ActuatorReading(one.name, float([*value(prim, "mjc:gear", ()), 1.0][0]))
    return dict(zip(names_of([*driven]), driven.values(), strict=True))


def _gap_messages(gaps: Mapping[str, float]) -> Iterator[str]:
    """Yield messages about joints whose two frames do not coincide."""
    small = {name: gap for name, gap in gaps.items() if 0.0 < gap <= ROUNDING}
    if (most := max(small.values(), default=0.0)) > ROUNDING**2:
        yield f"The frames of joints {first_few(small, 3)} differ by up to {most:.1g} m or rad; the gaps are closed."
    for name, gap in gaps.items():
        if gap > ROUNDING:
            yield f"The two frames of joint {name} differ by {gap:.2g} m or rad; bodies are moved to close the gap."


@dataclass(frozen=True, slots=True)
class _Stage:
    """A stage, its units, and the names of its bodies by path."""

    stage: Any
    where: str
    unit: float
    kilo: float
    cache: Any
    bodies: Mapping[Any, str]
    content: list[Content] = field(default_factory=list)

    def joint(self, prim: Any, name: str) -> _Joint | None:
        """Return a joint, or None for a joint without constraints."""
        kind = str(prim.GetTypeName()).removeprefix("Physics").removesuffix("Joint")
        off = not value(prim, "physics:jointEnabled", True)
        if off or kind == "Distance":
            what = (
                ("put in place", f"joint {name}, switched off")
                if off
                else ("other equalities", f"distance joint {name}")
            )
            self.content.append(Content(*what))
            return None
        if kind not in _KINDS:
            types = ", ".join(f"Physics{each}Joint" for each in _KINDS)
            raise ModelFileError(f"joint {name} is a {prim.GetTypeName()}", self.where, f"use one of {types}")
        tokens = [token.format(axis_of(prim, "physics:axis", "X")) for token in _KINDS[kind]]
        limits = {token: self.limits(prim, kind, token) for token in tokens}
        free = {token: (low, high) for token, (low, high) in limits.items() if not low >= high}
        same = self.side(prim, 0)[0] == self.side(prim, 1)[0]
        return None if len(free) == len(_KINDS[""]) or same else _Joint(prim, name, kind, self, free)

    def limits(self, prim: Any, kind: str, token: str) -> tuple[float, float]:
        """Return the limits of a degree of freedom of a joint [rad or m]."""
        ends = ("physics:lowerLimit", "physics:upperLimit")
        if kind not in ("Revolute", "Prismatic"):
            ends = (f"limit:{token}:physics:low", f"limit:{token}:physics:high")
        low, high = (self.convert(token, number(prim, n, default=d)) for n, d in zip(ends, FREE, strict=True))
        return bounds(low, high)

    def convert(self, token: str, x: float) -> float:
        """Convert a coordinate to SI units."""
        return math.radians(x) if token in _TURNS else self.unit * x

    def pose_of(self, prim: Any) -> tuple[Array, Array]:
        """Return the world pose of a prim, and its scale. Shapes (4, 4), (3,)."""
        M = np.array(self.cache.GetLocalToWorldTransform(prim), dtype=float).T
        scale = np.linalg.norm(M[:3, :3], axis=0)
        scale[0] *= math.copysign(1.0, np.linalg.det(M[:3, :3]))
        R = M[:3, :3] / np.where(scale == 0.0, 1.0, scale)
        if not (np.abs(R.T @ R - np.eye(3)) < _SQUARE).all():
            raise ModelFileError(f"shears {prim.GetPath()} or scales it to zero", self.where, "use another scale")
        return matrix(self.unit * M[:3, 3], R), scale

    def body_of(self, prim: Any) -> str:
        """Return the body that contains a prim; `WORLD` if the prim does not move."""
        while prim and not prim.IsPseudoRoot() and prim.GetPath() not in self.bodies:
            prim = prim.GetParent()
        return self.bodies.get(prim.GetPath(), WORLD) if prim else WORLD

    def side(self, joint: Any, k: int) -> tuple[str, Array]:
        """Return the body on one side of a joint, and the world frame of the joint on that side. Shape (4, 4)."""
        targets = joint.GetRelationship(f"physics:body{k}").GetForwardedTargets()
        prim = self.stage.GetPrimAtPath(targets[0]) if targets else None
        if targets and not (prim and prim.IsActive()):
            what = f"joint {joint.GetName()} connects {targets[0]}, which does not exist"
            raise ModelFileError(what, self.where, "correct the path")
        T, scale = self.pose_of(prim) if prim else (np.eye(4), np.ones(3))
        p, q = numbers(joint, f"physics:localPos{k}", default=(0.0,) * 3), f"physics:localRot{k}"
        return self.body_of(prim), T @ matrix(self.unit * scale * p, _turn(numbers(joint, q, default=(0.0,) * 4)))

    def body(self, prim: Any) -> BodyReading:
        """Return the mass properties and pose of a body."""
        (T, scale), name = self.pose_of(prim), self.bodies[prim.GetPath()]
        matter = self.mass_properties(prim, scale, Matter(0.0, np.full(3, np.nan), np.full((3, 3), np.nan)))
        weighs = matter.mass and not np.isnan(matter.inertia).any()
        if not weighs or np.isnan(matter.com).any():
            density = number(prim, "physics:density")
            inside = (each for each in prims(prim) if self.body_of(each) == name)
            shapes = [each for each in inside if value(each, "physics:collisionEnabled")]
            whole = join(self.shape(each, T, name, density) for each in shapes)
            if not whole.mass:  # OpenUSD's default
                r = 0.1 * self.unit
                whole = Matter(self.kilo, np.zeros(3), 0.4 * self.kilo * r * r * np.eye(3))
                what = f"mass or inertia of body {name}, by default that of a ball of radius {r:g} m and mass 1 kg"
                self.content.extend([] if weighs else [Content("read differently by the library", what)])
            matter = self.mass_properties(prim, scale, whole)
        if value(prim, "physics:kinematicEnabled"):
            self.content.append(Content("externally moved bodies", "kinematic body", f" {name}"))
        return link(matter, T, weightless=bool(value(prim, "physxRigidBody:disableGravity")))

    def mass_properties(self, prim: Any, scale: Array, shapes: Matter) -> Matter:
        """Return the mass properties of a body or collider: the specified values, completed by those of its shapes."""
        mass, size = self.kilo * number(prim, "physics:mass"), self.kilo * self.unit**2
        inertia = (mass / shapes.mass if mass and shapes.mass else 1.0) * shapes.inertia
        moments = numbers(prim, "physics:diagonalInertia", default=(0.0,) * 3)
        A = _turn(numbers(prim, "physics:principalAxes", default=(0.0,) * 4))
        if (entries := numbers(prim, "newton:inertia", default=(0.0,) * 6)).any():
            inertia = size * tensor(entries)
        elif moments.any():
            inertia = size * A @ np.diag(moments) @ A.T
        com = numbers(prim, "physics:centerOfMass", default=_UNSTATED)
        return Matter(mass or shapes.mass, self.unit * scale * com if np.isfinite(com).all() else shapes.com, inertia)

    def shape(self, prim: Any, body: Array, name: str, density: float) -> Matter:
        """Compute the mass properties of a collider in the frame of its body, given the body's pose, shape (4, 4)."""
        from pxr import UsdGeom, UsdShade

        if not prim.IsA(UsdGeom.Gprim):
            return NOTHING
        (T, scale), hollow = self.pose_of(prim), value(prim, "newton:massModel") == "shell" or value(prim, _SHELL)
        kind = "shell" if hollow else str(prim.GetTypeName()).lower()
        size = self.unit * np.abs(scale)
        axis = AXES.index(axis_of(prim, "axis", "Z"))
        turn = np.roll(np.eye(3), axis + 1, axis=0)  # maps z of the shape to its axis
        across, along = float(np.delete(size, axis).max()), float(size[axis])
        if kind not in _SHAPES:
            what = f"mass of body {name} would come from a {kind or 'shape'}, which is not supported"
            raise ModelFileError(what, self.where, "set mass, diagonalInertia and centerOfMass of the body (MassAPI)")
        lengths = [across * number(prim, "radius", default=1.0), along * number(prim, "height", default=1.0)]
        if kind in ("cube", "sphere"):
            lengths, turn = (size * number(prim, "size", "radius", default=1.0)).tolist(), np.eye(3)
        material = UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial("physics")[0].GetPrim()
        densities = number(prim, "physics:density"), density, number(material, "physics:density") if material else 0.0
        stated = next(filter(None, densities), 0.0)
        rho = self.kilo / self.unit**3 * stated if stated else _WATER
        points = self.unit * scale * np.array(value(prim, "points", ()), dtype=float).reshape(-1, 3)
        if kind == "mesh":
            own = polyhedron(points @ turn, triangles_of(prim, len(points)), rho)
        else:
            own = uniform(_SHAPES[kind], lengths, rho)
        return displace(self.mass_properties(prim, scale, displace(own, matrix(np.zeros(3), turn))), relative(body, T))

    def gravity(self, scene: Any | None) -> Array | None:
        """Return the gravity of a stage [m/s^2]; None if it lacks a scene and z points up. Shape (3,)."""
        from pxr import UsdGeom

        axis = str(UsdGeom.GetStageUpAxis(self.stage))
        if axis not in AXES:
            raise UnknownNameError("upAxis", axis, AXES, self.where)
        down = -np.eye(3)[AXES.index(axis)]
        if scene is None:
            return None if axis == "Z" else _GRAVITY * down
        way = numbers(scene, "physics:gravityDirection", default=(0.0,) * 3)
        size = number(scene, "physics:gravityMagnitude", default=-math.inf)
        on = value(scene, "newton:gravityEnabled", True)
        amount = (self.unit * size if 0.0 <= size < math.inf else _GRAVITY) * bool(on)
        return np.asarray(amount * (way / np.linalg.norm(way) if way.any() else down))


def _turn(q: Array) -> Array:
    """Compute the rotation matrix of a quaternion (w, x, y, z); the identity for a zero quaternion. Shape (3, 3)."""
    return quaternion_rotation(q / np.linalg.norm(q)) if q.any() else np.eye(3)


@dataclass(frozen=True, slots=True)
class _Joint:
    """A joint of a stage.

    Attributes:
        kind: One of `_KINDS`.
        limits: Token of each free rotation or translation -> limits [rad or m], in the order of application.
    """

    prim: Any
    name: str
    kind: str
    stage: _Stage
    limits: Mapping[str, tuple[float, float]]

    @property
    def is_ball(self) -> bool:
        """True if the joint rotates freely about all axes and does not translate."""
        return [*self.limits] == _TURNS and {*self.limits.values()} == {FREE}

    @property
    def coordinates(self) -> dict[str, str]:
        """Token of each degree of freedom -> name of its coordinate; a ball has one entry."""
        several = len(self.limits) > 1 and not self.is_ball
        names = {token: f"{self.name}.{token}" if several else self.name for token in self.limits}
        return {_TURNS[0]: self.name} if self.is_ball else names

    def graph_joint(self) -> tuple[GraphJoint, float]:
        """Return the joint as an edge between two bodies, and the gap between its two frames [m or rad]."""
        (parent, X), (child, F) = (self.stage.side(self.prim, k) for k in (0, 1))
        home, freedoms = self.home(relative(X, F)), dict[str, JointReading]()
        for token, name in self.coordinates.items():
            kind, centre, q = "hinge" if token in _TURNS else "slide", X[:3, 3], home[token]
            way = X[:3, AXES.index(token[-1])]
            if self.is_ball:
                freedoms[name], X = JointReading("ball", np.zeros(6), centre), matrix(centre, F[:3, :3])
                continue
            unit, limits = screw(kind == "hinge", way, centre), self.limits[token]
            freedoms[name] = JointReading(kind, unit, centre, q, limits, **self.passive(token))
            X = exponential(kind, way, centre, q) @ X
        gap = max(float(np.linalg.norm(X[:3, 3] - F[:3, 3])), float(np.abs(X[:3, :3] - F[:3, :3]).max()))
        loop = bool(value(self.prim, "physics:excludeFromArticulation"))
        return GraphJoint(parent, child, freedoms, X @ np.linalg.inv(F), loop), gap

    def home(self, T: Array) -> dict[str, float]:
        """Compute the joint coordinates from the pose T, shape (4, 4), of the second frame relative to the first."""
        turning = [_TURNS.index(token) for token in self.limits if token in _TURNS]
        order = [*turning, *(i for i in range(3) if i not in turning)]
        P = np.eye(3)[order]
        P[2] *= (hand := float(np.linalg.det(P)))
        angles = sequence_angles(P @ T[:3, :3] @ P.T, max(len(turning), 1), hand).tolist()
        named = {_TURNS[i]: angle for i, angle in zip(turning, angles, strict=False)}
        return named | dict(zip(_SLIDES, T[:3, 3].tolist(), strict=True))

    def passive(self, token: str) -> dict[str, float]:
        """Return the passive properties of a degree of freedom, in SI units and per radian."""
        turns, unit = token in _TURNS, self.stage.unit
        size = self.stage.kilo * unit ** (2 if turns else 0)
        found = {what: size * number(self.prim, *names) for what, names in _PASSIVE.items()}
        if turns and value(self.prim, "newton:damping") is not None:
            found["damping"] = math.degrees(found["damping"])
        found["friction"] *= 1.0 if turns else unit
        return {**found, "rest": self.stage.convert(token, number(self.prim, "mjc:springref"))}

    def drives(self) -> Iterator[tuple[str, str]]:
        """Yield each driven coordinate with the instance name of its drive."""
        for token, name in self.coordinates.items():
            plain = {"Revolute": "angular", "Prismatic": "linear"}.get(self.kind, token)
            if value(self.prim, f"drive:{plain}:physics:stiffness") is not None and not self.is_ball:
                yield name, plain

    def content(self) -> Iterator[Content]:
        """Yield the gains and limits of the drives."""
        for name, instance in self.drives():
            of, names = (("joints", name, 1.0),), {n: f"drive:{instance}:physics:{n}" for n in _DRIVE}
            said = {n: a for n, a in names.items() if value(self.prim, a) is not None}
            values = tuple((n, value(self.prim, a) if n == "type" else number(self.prim, a)) for n, a in said.items())
            yield Content("drives", "drive", f" of joint {name}", of, values)
            if math.isfinite(most := number(self.prim, f"drive:{instance}:physics:maxForce", default=math.inf)):
                per = self.stage.unit ** (2 if instance.startswith(("angular", "rot")) else 1)
                yield force_limits(name, self.stage.kilo * per * most)

    def target(self, relationship: str) -> Any:
        """Return the path of the first target of a relationship, or None."""
        return next(iter(self.prim.GetRelationship(relationship).GetForwardedTargets()), None)

    def laws(self) -> Iterator[tuple[Any, str, str, float, float, bool]]:
        """Yield mimic laws: leading joint, own token, token of the leader, constant, slope, and True if in degrees.

        PhysX laws are used only if a Newton law is missing.
        """
        read = partial(number, self.prim)
        if (to := self.target("newton:mimicJoint")) and value(self.prim, "newton:mimicEnabled", True):
            yield to, "", "", read("newton:mimicCoef0"), read("newton:mimicCoef1", default=1.0), False
            return
        names = (name.split(":") for name in self.prim.GetAuthoredPropertyNames())
        for token in dict.fromkeys(parts[1] for parts in names if parts[0] == "physxMimicJoint"):
            of = f"physxMimicJoint:{token}"
            constant, slope = -read(f"{of}:offset"), -read(f"{of}:gearing", default=1.0)
            axis = str(value(self.prim, f"{of}:referenceJointAxis", ""))
            yield self.target(f"{of}:referenceJoint"), token, axis, constant, slope, True

    def mimics(self, joints: Mapping[Any, _Joint]) -> Iterator[Mimic]:
        """Yield the coordinates that follow other coordinates, given the joints by path."""
        for path, token, axis, constant, slope, degrees in self.laws():
            leader, convert = joints.get(path), self.stage.convert
            if leader is None or not (leader.coordinates and self.coordinates):
                what = f"joint {self.name} follows {path}, which is not a moving joint"
                raise ModelFileError(what, self.stage.where, "choose another joint, or remove the mimic")
            pairs = ((token, self), (axis, leader))
            own, leads = (t if t in one.coordinates else next(iter(one.coordinates)) for t, one in pairs)
            ratio = convert(own, 1.0) / convert(leads, 1.0) if degrees else 1.0
            yield self.coordinates[own], leader.name, leads, convert(own, constant), ratio * slope
