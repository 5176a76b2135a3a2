"""The content of a model file in a form independent of formats, libraries and engines.

Rigidly connected links form one body, and joints are world-frame screws at the home coordinates; therefore, a reading
does not depend on how a format splits bodies, joints and frames. The pose of a body is the product of the exponentials
of its preceding joints, from the ground outwards, and its home pose (Lynch, Park: Modern Robotics, 4.1).
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, field, replace
from itertools import accumulate
from typing import NamedTuple

import numpy as np

from screwgauge.models.content import Content, phrases
from screwgauge.models.matter import Matter
from screwgauge.reference.couplings import Coupling, PolynomialSum
from screwgauge.reference.mechanism import GROUND
from screwgauge.reference.rotations import Array
from screwgauge.witness.tree import FREEDOMS as FREEDOMS


@dataclass(frozen=True, slots=True, eq=False)
class BodyReading(Matter):
    """A moving body and the links fixed to it; its mass properties include these links and refer to its own frame.

    Before links are merged into bodies, an instance represents a single link: `near` is a link (empty for the world),
    and `joints` is empty if the link is fixed to `near`.

    Attributes:
        near: Parent body (or ground), on the ground side.
        joints: Names of the joints between `near` and this body, from `near` outwards; at least one.
        pose: World pose at the home coordinates. Shape (4, 4).
        gravcomp: Compensated fraction of the weight.
        fixed: Name of each link merged into the body -> frame of that link in the body's frame, shape (4, 4).
        first: Link that the last joint carries; empty if the body is named after that link.
        parts: Name of each merged link with mass or inertia -> mass properties of that link, in the body's frame.
        copy_of: Body of a description that this body copies in order to open a loop; empty for all other bodies.
    """

    near: str
    joints: tuple[str, ...]
    pose: Array
    gravcomp: float = 0.0
    fixed: Mapping[str, Array] = field(default_factory=dict)
    first: str = ""
    parts: Mapping[str, Matter] = field(default_factory=dict)
    copy_of: str = ""

    @property
    def centre(self) -> Array:
        """Centre of mass in the world frame at the home pose [m]. Shape (3,)."""
        return np.asarray(self.pose[:3, :3] @ self.com + self.pose[:3, 3])

    def with_matter(self, matter: Matter) -> BodyReading:
        """Return the body with the given mass properties."""
        return replace(self, mass=matter.mass, com=matter.com, inertia=matter.inertia)


#: Library name for files that screwgauge itself reads.
OWN = "screwgauge"
#: Limits of a coordinate without limits.
FREE = (-math.inf, math.inf)
#: Massless link fixed to the world.
BARE = BodyReading(0.0, np.zeros(3), np.zeros((3, 3)), "", (), np.eye(4))


@dataclass(frozen=True, slots=True, eq=False)
class JointReading:
    """A joint of a reading.

    Attributes:
        kind: One of `FREEDOMS`.
        screw: Unit screw of a hinge or slide at the home pose [angular; linear at the world origin]; zeros for other
            kinds. Shape (6,).
        centre: World position of a point on the axis, or of the centre of a ball or free joint, at the home pose [m].
            Shape (3,).
        home: Home coordinate as measured in the file [rad or m]; 0 for a ball or free joint.
        limits: Lowest and highest coordinate; infinite without limits. Shape (2,).
        armature, damping, friction, stiffness: Reflected inertia [kg m^2 or kg], damping [N m s/rad or N s/m], dry
            friction [N m or N], and stiffness [N m/rad or N/m] about the coordinate `rest`, for each degree of freedom.
    """

    kind: str
    screw: Array
    centre: Array
    home: float = 0.0
    limits: tuple[float, float] = FREE
    armature: float = 0.0
    damping: float = 0.0
    friction: float = 0.0
    stiffness: float = 0.0
    rest: float = 0.0

    @property
    def direction(self) -> Array:
        """Unit vector along the axis of a hinge or slide. Shape (3,)."""
        return self.screw[3:] if self.kind == "slide" else self.screw[:3]


@dataclass(frozen=True, slots=True, eq=False)
class ClosureReading:
    """A constraint between two frames that makes their origins (``point``) or whole frames (``weld``) coincide.

    Attributes:
        first, second: Bodies or ground.
        first_frame, second_frame: Frames of the constraint in these bodies. Shape (4, 4) each.
        softness: MuJoCo's solref and solimp (seven numbers) and, for a weld, torquescale; empty for a hard constraint.
        derived: True if the file does not define the second frame, which then coincides with the first at home.
    """

    kind: str
    first: str
    first_frame: Array
    second: str
    second_frame: Array
    softness: tuple[float, ...] = ()
    derived: bool = False


@dataclass(frozen=True, slots=True, eq=False)
class CouplingReading:
    """A coupling: one coordinate is a sum of polynomials of other coordinates (mimic joints, gears, screws, belts).

    Attributes:
        joint: Name of the dependent hinge or slide.
        function: Function of coordinates of hinges and slides, as measured in the file; constant for a locked joint.
        softness: See `ClosureReading`.
    """

    joint: str
    function: PolynomialSum
    softness: tuple[float, ...] = ()

    def solve_for(self, joint: str) -> CouplingReading:
        """Solve the coupling for one of its joints; return the coupling unchanged if it is not linear in that joint."""
        if not self.function.is_linear_in(joint):
            return self
        return replace(self, joint=joint, function=self.function.solve(self.joint, joint))

    @property
    def named(self) -> tuple[str, ...]:
        """All joints of the coupling; the dependent joint comes first."""
        return self.joint, *self.function.terms


class ActuatorReading(NamedTuple):
    """The joint that an actuator drives, and the gear ratio: joint force per unit of actuator force."""

    joint: str
    gear: float = 1.0


@dataclass(frozen=True, slots=True, eq=False)
class Reading:
    """The content of a model file.

    Attributes:
        name: Name of the model.
        library: ``pinocchio``, ``mujoco``, ``yourdfpy``, or `OWN` for a description and for formats that screwgauge
            itself reads.
        bodies: All moving bodies, parents first.
        joints: Joints by name.
        fixed: Link merged into the ground -> world frame of the link, shape (4, 4).
        closures, couplings: Closures and couplings by name.
        actuators: Actuators by name.
        gravity: Gravity in world axes [m/s^2], shape (3,); None if the file does not define it.
        medium: Density [kg/m^3] and viscosity [Pa s] of the surrounding medium.
        content: Further content of the file, including what the library ignores.
        form: ``urdf``, ``mjcf``, ``sdf`` or ``usd``; empty for a description.
        remarks: Sentences about how incomplete data were completed.
        frames: Joint of the file that is not in `joints`, e.g. a fixed joint -> link that the joint carries.
    """

    name: str
    library: str
    bodies: Mapping[str, BodyReading]
    joints: Mapping[str, JointReading]
    fixed: Mapping[str, Array] = field(default_factory=dict)
    closures: Mapping[str, ClosureReading] = field(default_factory=dict)
    couplings: Mapping[str, CouplingReading] = field(default_factory=dict)
    actuators: Mapping[str, ActuatorReading] = field(default_factory=dict)
    gravity: Array | None = None
    medium: tuple[float, float] = (0.0, 0.0)
    content: tuple[Content, ...] = ()
    form: str = ""
    frames: Mapping[str, str] = field(default_factory=dict)
    remarks: tuple[str, ...] = ()

    @property
    def ignored(self) -> tuple[str, ...]:
        """`content` as phrases, one for each kind of element or attribute."""
        return phrases(self.content)

    def place(self, name: str) -> tuple[str, Array] | None:
        """Return the body (or ground) that contains a link, and the link's frame there.

        `name` is the link or the joint that carries it; return None if neither exists.
        """
        return self._place(name) or self._place(self.carried_link(name))

    def _place(self, link: str) -> tuple[str, Array] | None:
        if link in self.fixed:
            return GROUND, self.fixed[link]
        for whole, body in self.bodies.items():
            if link == whole or link in body.fixed:
                return whole, np.eye(4) if link == whole else body.fixed[link]
        return None

    def end_on(self, link: str) -> tuple[str, Array]:
        """Return the body (or ground) that contains a link, with its frame there; the ground for an empty name.

        Raises:
            LookupError: No link has that name, so that a loop or contact would silently be attached to the ground.
        """
        place = self._place(link) if link else (GROUND, np.eye(4))
        if place is None:
            raise LookupError(f"no link '{link}' in the reading")
        return place

    def has_link(self, name: str) -> bool:
        """Return True if a link with that name exists."""
        return self._place(name) is not None

    def carried_link(self, joint: str) -> str:
        """Return the link that a joint carries; empty if the joint is unknown or is followed by further joints."""
        if joint in self.frames:
            return self.frames[joint]
        return next((body.first or name for name, body in self.bodies.items() if body.joints[-1] == joint), "")

    def moved_by(self, joint: str) -> str:
        """Return the body that a joint moves, alone or together with further joints."""
        return next(name for name, body in self.bodies.items() if joint in body.joints)

    @property
    def poses(self) -> dict[str, Array]:
        """World poses of the ground and of all bodies at the home pose. Shape (4, 4) each."""
        return {GROUND: np.eye(4), **{name: body.pose for name, body in self.bodies.items()}}

    def ends(self, closure: str) -> tuple[tuple[str, Array], tuple[str, Array]]:
        """Return the two bodies of a closure, each with the world frame of the closure on that body. Shape (4, 4)."""
        one, poses = self.closures[closure], self.poses
        return (one.first, poses[one.first] @ one.first_frame), (one.second, poses[one.second] @ one.second_frame)

    @property
    def roots(self) -> list[str]:
        """Bodies attached to the ground."""
        return [name for name, body in self.bodies.items() if body.near not in self.bodies]

    @property
    def mass(self) -> float:
        """Mass of all moving bodies [kg]."""
        return sum(body.mass for body in self.bodies.values())

    @property
    def freedom(self) -> int:
        """Number of velocities of all joints."""
        return sum(FREEDOMS[joint.kind] for joint in self.joints.values())

    @property
    def freedoms(self) -> dict[str, slice]:
        """Joint -> its entries in the vector of all velocities, in the order of `joints`."""
        return slices(self.joints, FREEDOMS)


def slices(joints: Mapping[str, JointReading], sizes: Mapping[str, int]) -> dict[str, slice]:
    """Return joint -> slice of its entries in a vector; `sizes` has the number of entries for each kind of joint."""
    ends = accumulate(sizes[joint.kind] for joint in joints.values())
    return {n: slice(end - sizes[j.kind], end) for (n, j), end in zip(joints.items(), ends, strict=True)}


def couplings_of(couplings: Iterable[Coupling]) -> dict[str, CouplingReading]:
    """Convert the couplings of a description to readings, by name."""
    read = (one for one in couplings if not one.fixing)  # a reading does not contain the joint of a fixing
    return {one.name: CouplingReading(one.coordinate, one.function) for one in read}


def collapse(reading: Reading, keep: Collection[str] = ()) -> Reading:
    """Remove bodies without mass and inertia that carry exactly one further body and no closure.

    The joints of such a body are prepended to the joints of the body that it carries; links fixed to it are lost.

    Args:
        keep: Bodies that must not be removed.
    """
    closed = {name for closure in reading.closures.values() for name in (closure.first, closure.second)}
    carried = Counter(body.near for body in reading.bodies.values())
    stays = {*keep, *closed}
    gone = {
        name: body
        for name, body in reading.bodies.items()
        if not body.solid and carried[name] == 1 and name not in stays
    }
    bodies = {}
    for name, body in reading.bodies.items():
        if name in gone:
            continue
        near, joints = body.near, body.joints
        while near in gone:
            near, joints = gone[near].near, gone[near].joints + joints
        bodies[name] = replace(body, near=near, joints=joints)
    return replace(reading, bodies=bodies)


def rename(reading: Reading, names: Mapping[str, Mapping[str, str]]) -> Reading:
    """Rename parts of a reading.

    Args:
        names: ``bodies``, ``joints``, ``closures``, ``couplings``, ``actuators`` -> name -> new name.
    """
    bodies, joints, closures, couplings, actuators = (
        {**{name: name for name in getattr(reading, kind)}, **names.get(kind, {})}
        for kind in ("bodies", "joints", "closures", "couplings", "actuators")
    )
    return replace(
        reading,
        bodies={
            bodies[name]: replace(
                body,
                near=bodies.get(body.near, body.near),
                joints=tuple(joints[joint] for joint in body.joints),
                copy_of=bodies.get(body.copy_of, body.copy_of),
            )
            for name, body in reading.bodies.items()
        },
        joints={joints[name]: joint for name, joint in reading.joints.items()},
        closures={
            closures[name]: replace(c, first=bodies.get(c.first, c.first), second=bodies.get(c.second, c.second))
            for name, c in reading.closures.items()
        },
        couplings={
            couplings[name]: replace(c, joint=joints[c.joint], function=c.function.rename(joints))
            for name, c in reading.couplings.items()
        },
        actuators={actuators[n]: a._replace(joint=joints.get(a.joint, a.joint)) for n, a in reading.actuators.items()},
        content=tuple(each.rename(names) for each in reading.content),
    )
