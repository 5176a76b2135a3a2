"""Mechanisms as immutable data, checked on construction: bodies, joints, actuated and independent coordinates."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from textwrap import wrap
from typing import TYPE_CHECKING

import numpy as np

from screwgauge.reference.couplings import Coupling, CouplingRows, bind, check_couplings
from screwgauge.reference.errors import DescriptionError
from screwgauge.reference.resistance import RESISTS, Resistance, amounts, resistances
from screwgauge.reference.rotations import Array, across

if TYPE_CHECKING:
    from screwgauge.reference.left_out import LeftOut


GROUND = "ground"
COLUMNS, MOST = 100, 3  # screen width, and largest number of lines each for bodies, joints and so on
#: Fraction of the trace by which rounding may violate the inequalities of an inertia tensor.
SLACK = 1e-12


#: Degrees of freedom of each kind in order: True for a rotation about its axis, False for a translation along it.
#: Composite joints are serial: the preceding degrees of freedom move each axis, and all axes meet at the origin of the
#: joint. E slides in a plane and turns about its normal. F is unconstrained and assigns coordinates to a pose: x, y and
#: z in the parent's frame, then three angles. A fixed joint is a hinge about axis z of its frame that a
#: `Coupling` locks. `equations.joint_types` has the mechanics of each kind.
KINDS: dict[str, tuple[bool, ...]] = {
    "R": (True,),
    "P": (False,),
    "U": (True, True),
    "S": (True, True, True),
    "C": (True, False),
    "E": (False, False, True),
    "F": (False, False, False, True, True, True),
    "fixed": (True,),
}
#: Kind of joint that can close a loop as coincident points of the two bodies -> number of points.
POINTS = {"R": 2, "S": 1}


@dataclass(frozen=True, slots=True, eq=False)
class Frame:
    """A placement: position `p` [m], shape (3,), and orientation `R`, shape (3, 3), of a frame in a body."""

    p: Array = field(default_factory=lambda: np.zeros(3))
    R: Array = field(default_factory=lambda: np.eye(3))

    @property
    def is_identity(self) -> bool:
        return not self.p.any() and np.array_equal(self.R, np.eye(3))


@dataclass(frozen=True, slots=True, eq=False)
class Body:
    """A rigid body.

    Attributes:
        mass: Mass [kg], non-negative. The inertia and com of a massless body are zero.
        com: Centre of mass in the body frame [m]. Shape (3,).
        inertia: Inertia tensor about the centre of mass, in body axes [kg m^2]. Shape (3, 3). Points and thin rods
            (zero principal moments) are legal.
        allowed: True if the principal moments may violate the triangle inequality, see `inertia`.
    """

    name: str
    mass: float
    com: Array
    inertia: Array
    where: str = ""
    allowed: bool = False

    def __post_init__(self) -> None:
        where = self.where or self.name
        if not self.mass >= 0.0:
            what = f"mass {self.mass:g} kg is not positive"
            raise DescriptionError(what, where, "use a positive mass, or 0 for a massless body")
        if not (np.isfinite(self.inertia).all() and np.isfinite([self.mass, *self.com]).all()):
            raise DescriptionError("mass, com or inertia is not finite", where, "use finite numbers")
        if self.mass == 0.0 and (self.inertia.any() or self.com.any()):
            what = "a massless body has an inertia or a centre of mass"
            raise DescriptionError(what, where, "add a mass, or remove inertia and com")
        moments = np.linalg.eigvalsh(self.inertia)
        slack = SLACK * max(float(np.trace(self.inertia)), 0.0)
        if moments[0] < -slack:
            what = f"inertia is not positive semidefinite (smallest principal moment {moments[0]:.3g} kg m^2)"
            raise DescriptionError(what, where, "check the signs of the products of inertia")
        if (excess := triangle_excess(self.inertia)) and not self.allowed:
            what = f"principal moments {moments.tolist()} kg m^2 violate the triangle inequality by {excess:.3g}"
            raise DescriptionError(
                what, where, "check the tensor and its axes: no body of positive mass has such moments"
            )


def triangle_excess(inertia: Array) -> float:
    """Return the excess of the largest principal moment over the sum of the other two [kg m^2], or zero.

    Args:
        inertia: Shape (3, 3).
    """
    least, middle, largest = np.linalg.eigvalsh(inertia)
    excess = float(largest - least - middle)
    return excess if excess > SLACK * max(float(np.trace(inertia)), 0.0) else 0.0


@dataclass(frozen=True, slots=True, eq=False)
class Joint:
    """A joint between two bodies; `parent` is on its ground side.

    ``T(parent, child) = parent_frame  X(q)  child_frame^-1``, where X is the serial product of the degrees of freedom.

    Attributes:
        kind: Key of `KINDS`.
        axes: Unit axes of the angles in the joint frame, with preceding coordinates at zero; for P, the axis of the
            slide. Shape (n_axes, 3).
        coordinates: Names of the coordinates, in the order of the degrees of freedom.
        home: Coordinates at the home pose [rad or m]. Shape (n,).
        limits: Bounds of the coordinates [rad or m]; infinite if unbounded. Shape (n, 2).
        rotor: Reflected inertia of each coordinate, i.e. motor inertia times gear ratio squared [kg m^2 or kg]; zero by
            default. Shape (n,).
        damping: Viscous damping of each coordinate [N m s/rad or N s/m]; zero by default. Shape (n,).
        friction: Dry friction of each coordinate [N m or N]; zero by default. Shape (n,).
        held: Coordinates of an F joint along which only the ground can exert the force that their motion needs; results
            list these forces after actuator forces.
    """

    name: str
    kind: str
    parent: str
    child: str
    axes: Array
    coordinates: tuple[str, ...]
    home: Array
    limits: Array
    parent_frame: Frame = field(default_factory=Frame)
    child_frame: Frame = field(default_factory=Frame)
    actuated: bool = False
    where: str = ""
    rotor: Array = field(default_factory=lambda: np.zeros(0))
    damping: Array = field(default_factory=lambda: np.zeros(0))
    friction: Array = field(default_factory=lambda: np.zeros(0))
    held: tuple[str, ...] = ()

    @property
    def freedoms(self) -> tuple[tuple[bool, Array], ...]:
        """Pairs (turns, axis in the joint frame) of all degrees of freedom.

        A single slide is along the first axis; two slides are orthogonal to it (see `across`); three are along frame
        axes.
        """
        return _freedoms(self)

    @property
    def angles(self) -> int:
        """Number of rotational degrees of freedom."""
        return sum(KINDS[self.kind])

    @property
    def slides(self) -> int:
        """Number of translational degrees of freedom."""
        return len(KINDS[self.kind]) - self.angles

    @property
    def fixed(self) -> bool:
        """True if the joint cannot move, because a coupling locks its only coordinate at zero."""
        return self.kind == "fixed"

    @property
    def constrains(self) -> bool:
        """True if the joint transmits any force, as all joints except F do."""
        return len(KINDS[self.kind]) < 6

    @property
    def bodies(self) -> tuple[str, str]:
        """Names of parent and child."""
        return self.parent, self.child

    @property
    def sides(self) -> tuple[tuple[str, Frame], tuple[str, Frame]]:
        """Parent and child, each with the joint's frame on that body."""
        return (self.parent, self.parent_frame), (self.child, self.child_frame)

    @property
    def role(self) -> str:
        """Last part of the dotted name: ``leg1.base`` and ``leg2.base`` share the role ``base``."""
        return self.name.rsplit(".", 1)[-1]

    def __post_init__(self) -> None:
        where = self.where or self.name
        for what in RESISTS:
            object.__setattr__(self, what, amounts(what, getattr(self, what), len(self.coordinates), where))
        if self.actuated and (self.fixed or len(self.coordinates) != 1):
            raise DescriptionError(f"a {self.kind} joint cannot be actuated", where, "actuate an R or a P joint")
        if self.held and (self.constrains or not {*self.held} <= {*self.coordinates}):
            what = f"{', '.join(self.held)} cannot be held"
            raise DescriptionError(what, where, "choose from the names that an F joint gives its coordinates")
        if len(self.axes) > 1:
            gram = self.axes @ self.axes.T
            if np.abs(gram - np.eye(len(gram))).max() > 1e-12:
                what = "the axes of a composite joint are not orthogonal"
                raise DescriptionError(what, where, "use R joints instead")


@lru_cache(maxsize=4096)
def _freedoms(joint: Joint) -> tuple[tuple[bool, Array], ...]:
    ways = {2: across(joint.axes[0])[1], 3: np.eye(3, dtype=joint.axes.dtype)}
    turning, sliding = iter(joint.axes), iter(ways.get(joint.slides, joint.axes))
    return tuple((turns, next(turning if turns else sliding)) for turns in KINDS[joint.kind])


def actuator_names(joints: Sequence[Joint]) -> tuple[str, ...]:
    """Return the names of the actuators: ``leg1`` for ``leg1.slide`` if this is unique, or else the name of the joint.

    The names of `Joint.held` coordinates follow.
    """
    driven = [joint.name for joint in joints if joint.actuated]
    groups = [name.rsplit(".", 1)[0] for name in driven]
    names = (group if groups.count(group) == 1 else name for group, name in zip(groups, driven, strict=True))
    return (*names, *(name for joint in joints for name in joint.held))


def driven_coordinates(joints: Sequence[Joint]) -> tuple[str, ...]:
    """Return the coordinates of the actuators, in the order of `actuator_names`."""
    driven = [joint.coordinates[0] for joint in joints if joint.actuated]
    return (*driven, *(name for joint in joints for name in joint.held))


def by_role(joints: Sequence[Joint]) -> list[Joint]:
    """Return joints grouped by role, in order of first appearance, which is the order of reaction components."""
    roles = list(dict.fromkeys(joint.role for joint in joints))
    return sorted(joints, key=lambda joint: roles.index(joint.role))


@dataclass(frozen=True, eq=False)
class Mechanism:
    """A graph of bodies and joints.

    Attributes:
        independent: Label of each independent coordinate -> name of the joint coordinate, in order.
        axial: Joint and direction (child axes, shape (3,)) along which the rule ``spherical_axial`` requires the
            joint's force (eq. 56); None without such a rule.
        group: Heading under which lists show the mechanism.
        couplings: Couplings of joint coordinates; each coordinate has at most one coupling, and there are no cycles.
        left_out: Forces in the original model file that engines do not include; a run measures their effect.
        remarks: Messages about changes made while reading.
    """

    name: str
    bodies: tuple[Body, ...]
    joints: tuple[Joint, ...]
    independent: Mapping[str, str]
    title: str = ""
    source: str = ""
    group: str = ""
    axial: tuple[str, Array] | None = None
    where: str = ""
    couplings: tuple[Coupling, ...] = ()
    left_out: tuple[LeftOut, ...] = ()
    remarks: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        check_couplings(self.couplings, self.coordinates)

    def __repr__(self) -> str:
        told = [coupling for coupling in self.couplings if not coupling.fixing]
        drives = zip(self.actuator_names, self.actuator_units, strict=True)
        parts: dict[tuple[str, int], list[str]] = {
            ("bodies", len(self.bodies)): [f"{body.name} {body.mass:.4g} kg" for body in self.bodies],
            ("joints", len(self.joints)): [f"{x.name} ({x.kind}: {x.parent} - {x.child})" for x in self.joints],
            ("loops", len(self.joints) - len(self.bodies)): [],
            ("freedoms", len(self.independent)): [f"{label} = {name}" for label, name in self.independent.items()],
            ("actuators", len(self.actuator_names)): [f"{name} [{unit}]" for name, unit in drives],
            ("couplings", len(told)): [
                " of ".join(filter(None, (x.coordinate, " and ".join(x.function.terms)))) for x in told
            ],
        }
        text = [f"Mechanism {self.name}{': ' * bool(self.title)}{self.title}"]
        for (name, count), items in parts.items():
            text += _wrap(f"{name:<10}{count:>4}  ", items)
        return "\n".join(text)

    @cached_property
    def coordinates(self) -> tuple[str, ...]:
        """Names of all joint coordinates, in the order of the joints."""
        return tuple(name for joint in self.joints for name in joint.coordinates)

    @cached_property
    def moving(self) -> tuple[str, ...]:
        """Names of the coordinates of joints that are not fixed."""
        return tuple(name for joint in self.joints if not joint.fixed for name in joint.coordinates)

    @cached_property
    def units(self) -> tuple[str, ...]:
        """Unit of each joint coordinate: rad or m."""
        return tuple("rad" if turn else "m" for joint in self.joints for turn in KINDS[joint.kind])

    @cached_property
    def home(self) -> Array:
        """Joint coordinates at the home pose [rad or m]. Shape (n_q,)."""
        return np.concatenate([joint.home for joint in self.joints])

    def pose_text(self, y: Array, figures: int = 6) -> str:
        """Format independent coordinates, shape (k,), by name for a message: ``a = 0.1, b = 0.2``."""
        return ", ".join(f"{label} = {value:.{figures}g}" for label, value in zip(self.independent, y, strict=True))

    @cached_property
    def limits(self) -> Array:
        """Bounds of the joint coordinates [rad or m]. Shape (n_q, 2)."""
        return np.concatenate([joint.limits for joint in self.joints])

    @cached_property
    def actuators(self) -> tuple[Joint, ...]:
        """Actuated joints; `actuator_names` also includes `Joint.held` coordinates."""
        return tuple(joint for joint in self.joints if joint.actuated)

    @cached_property
    def actuator_names(self) -> tuple[str, ...]:
        return actuator_names(self.joints)

    @property
    def actuator_units(self) -> tuple[str, ...]:
        return tuple("N m" if self.units[column] == "rad" else "N" for column in self.actuated_columns)

    def columns(self, names: Iterable[str]) -> list[int]:
        """Return the positions of named coordinates in the vector of all joint coordinates."""
        return [self.coordinates.index(name) for name in names]

    @cached_property
    def independent_columns(self) -> list[int]:
        return self.columns(self.independent.values())

    @cached_property
    def actuated_columns(self) -> list[int]:
        return self.columns(driven_coordinates(self.joints))

    @cached_property
    def rotors(self) -> Array:
        """Rotor inertia of each joint coordinate [kg m^2 or kg]. Shape (n_q,)."""
        return np.concatenate([joint.rotor for joint in self.joints])

    @cached_property
    def resistances(self) -> tuple[Resistance, ...]:
        """Rotors, damping and dry friction of all coordinates."""
        return resistances(self.joints)

    @cached_property
    def coupling_rows(self) -> CouplingRows:
        """Couplings as equations in the vector of all joint coordinates."""
        return bind(self.couplings, self.coordinates)

    @cached_property
    def body_index(self) -> dict[str, int]:
        """Index of each body; the ground has index 0."""
        return {name: i for i, name in enumerate([GROUND, *(body.name for body in self.bodies)])}

    @cached_property
    def masses(self) -> Array:
        """Mass of each body [kg]. Shape (n_body,)."""
        return np.array([body.mass for body in self.bodies], dtype=self.home.dtype)

    @cached_property
    def mass_centres(self) -> Array:
        """Centre of mass of each body in the body frame [m]. Shape (n_body, 3)."""
        return np.array([body.com for body in self.bodies])

    @cached_property
    def inertias(self) -> Array:
        """Inertia tensor of each body about its centre of mass, in body axes [kg m^2]. Shape (n_body, 3, 3)."""
        return np.array([body.inertia for body in self.bodies])

    @property
    def mass(self) -> float:
        """Total mass [kg]."""
        return float(sum(body.mass for body in self.bodies))

    def joint(self, name: str) -> Joint:
        return next(joint for joint in self.joints if joint.name == name)

    def body(self, name: str) -> Body:
        return next(body for body in self.bodies if body.name == name)


def _wrap(lead: str, items: Sequence[str]) -> list[str]:
    """Wrap items after a lead without breaking an item; return at most `MOST` lines."""
    whole = wrap(", ".join(item.replace(" ", "\0") for item in items), COLUMNS - len(lead) - 2)
    shown = [*whole[:MOST], *["..."] * (len(whole) > MOST)] or [""]
    return [f"  {lead if not i else ' ' * len(lead)}{line}".replace("\0", " ").rstrip() for i, line in enumerate(shown)]
