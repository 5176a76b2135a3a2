"""Data classes of applied forces that actuators do not exert: gravity, loads, springs and dampers, motors."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from screwgauge.reference.courses import Course, Samples, Wave
from screwgauge.reference.errors import DescriptionError, SingularPoseError
from screwgauge.reference.rotations import Array

#: Default gravity [m/s^2].
GRAVITY = (0.0, 0.0, -9.81)


#: Axes in which the components of a load are given: world axes, or axes that rotate with its body.
AXES = ("world", "body")


@dataclass(frozen=True, slots=True, eq=False)
class Load:
    """A force and moment on a body.

    Attributes:
        body: Body on which the load acts; a load that the body exerts is stored with reversed signs.
        point: Point of application in the body frame [m], or None for the centre of mass. Shape (3,).
        force, torque: Force [N] and moment [N m]. Shape (3,), or (n, 3) for n samples; NaN if `courses` define
            them, see `at`.
        axes: Axes of force and torque, one of `AXES`.
        courses: Fx, Fy, Fz, Mx, My, Mz as functions of time; empty for a constant load.
    """

    body: str
    point: Array | None
    force: Array
    torque: Array
    axes: str = AXES[0]
    courses: tuple[Course | Samples, ...] = ()

    @classmethod
    def over_time(cls, body: str, point: Array | None, courses: tuple[Course | Samples, ...], axes: str) -> Load:
        """Build a load from six functions of time; if all of them are constant, evaluate force and torque."""
        unknown = np.full(3, np.nan)
        load = cls(body, point, unknown, unknown, axes, courses)
        return load.at(0.0) if all(one.constant for one in courses) else load

    def at(self, t: Any, cos: Wave = np.cos, sin: Wave = np.sin) -> Load:
        """Evaluate force and torque at times [s], which may be of any scalar type. Shape (...)."""
        if not self.courses:
            return self
        each = np.broadcast_arrays(*(course(t, cos, sin) for course in self.courses))
        vectors = np.stack(each, axis=-1)
        return replace(self, force=vectors[..., :3], torque=vectors[..., 3:], courses=())

    @property
    def sampled(self) -> bool:
        """True if the load is known only at the sample times of a file."""
        return any(isinstance(course, Samples) for course in self.courses)

    @property
    def nothing(self) -> bool:
        """True if force and torque vanish at all times."""
        if self.courses:
            return all(course.nothing for course in self.courses)
        return not (self.force.any() or self.torque.any())

    def numbers(self) -> tuple[Any, ...]:
        """Return the load as plain values that can be compared and written to a file."""
        point = None if self.point is None else self.point.tolist()
        if self.courses:
            return self.body, point, self.axes, [course.plain() for course in self.courses]
        plain = self.body, point, self.force.tolist(), self.torque.tolist()
        return plain if self.axes == AXES[0] else (*plain, self.axes)


def _check(where: str, stiffness: float, rest: float, damping: float) -> None:
    values = {"stiffness": stiffness, "rest": rest, "damping": damping}
    for name, value in values.items():
        if not math.isfinite(value):
            raise DescriptionError(f"{name} {value:g} is not finite", where, "use a finite number")
    for name in ("stiffness", "damping"):
        if values[name] < 0.0:
            what = f"{name} {values[name]:g} is negative"
            raise DescriptionError(what, where, "use zero or more: springs and dampers cannot supply energy")


@dataclass(frozen=True, slots=True)
class JointSpring:
    """A spring and damper along one joint coordinate, ``tau = -k (q - q0) - c qd``.

    Attributes:
        coordinate: Name of the joint coordinate.
        stiffness: k [N/m or N m/rad], non-negative.
        rest: q0, at which the spring force is zero [m or rad].
        damping: c [N s/m or N m s/rad], non-negative.
    """

    coordinate: str
    stiffness: float = 0.0
    rest: float = 0.0
    damping: float = 0.0

    def __post_init__(self) -> None:
        _check(f"spring at {self.coordinate}", self.stiffness, self.rest, self.damping)

    def pull(self, q: Any, rate: Any) -> Any:
        """Return the force of spring and damper against the coordinate, for any scalar type."""
        return self.stiffness * (q - self.rest) + self.damping * rate


@dataclass(frozen=True, slots=True, eq=False)
class PointSpring:
    """A spring and damper between points of two bodies, with tension ``k (l - l0) + c ld``.

    The tension may be negative: the spring pushes and pulls.

    Attributes:
        first, second: Names of the bodies; one may be the ground.
        first_point, second_point: Points in the body frames [m]. Shape (3,).
        stiffness: k [N/m], non-negative.
        rest: l0 [m], non-negative.
        damping: c [N s/m], non-negative.
    """

    first: str
    first_point: Array
    second: str
    second_point: Array
    stiffness: float = 0.0
    rest: float = 0.0
    damping: float = 0.0

    def __post_init__(self) -> None:
        _check(self.where, self.stiffness, self.rest, self.damping)
        if self.rest < 0.0:
            raise DescriptionError(
                f"rest length {self.rest:g} m is negative", self.where, "use a length of zero or more"
            )
        if self.first == self.second:
            raise DescriptionError("connects a body to itself", self.where, "choose two bodies")

    def pull(self, length: Any, rate: Any) -> Any:
        """Return the tension, for any scalar type."""
        return self.stiffness * (length - self.rest) + self.damping * rate

    @property
    def where(self) -> str:
        return f"spring between {self.first} and {self.second}"

    @property
    def ends(self) -> tuple[tuple[str, Array], tuple[str, Array]]:
        """The body at each end, and the end point in the body frame."""
        return (self.first, self.first_point), (self.second, self.second_point)

    def no_direction(self, when: str = "") -> SingularPoseError:
        """Build the error for a spring whose end points coincide."""
        what = f"its end points coincide{when}, so its direction is undefined"
        return SingularPoseError(what, self.where, "move the end points or shorten the motion")


Spring = JointSpring | PointSpring


@dataclass(frozen=True, slots=True, eq=False)
class Motor:
    """A force along one joint coordinate, in addition to all other forces along that coordinate.

    Attributes:
        coordinate: Name of the joint coordinate.
        course: Force as a function of time [N or N m].
    """

    coordinate: str
    course: Course

    def force(self, t: Any, cos: Wave = np.cos, sin: Wave = np.sin) -> Any:
        """Return the force [N or N m] at times [s], which may be of any scalar type."""
        return self.course(t, cos, sin)


def hold(forces: Mapping[str, float]) -> tuple[Motor, ...]:
    """Build constant-force motors from a mapping of joint coordinates to forces [N or N m]."""
    return tuple(Motor(name, Course.of(f)) for name, f in forces.items())


@dataclass(frozen=True, slots=True, eq=False)
class Applied:
    """All applied forces except actuator forces.

    Attributes:
        gravity: Gravity in world axes [m/s^2], shape (3,); None keeps the gravity of the model file.
        loads: Loads on bodies.
        springs: Springs and dampers, along joints or between points of bodies.
        motors: Forces along joint coordinates as functions of time.
    """

    gravity: Array | None = None
    loads: tuple[Load, ...] = ()
    springs: tuple[Spring, ...] = ()
    motors: tuple[Motor, ...] = ()

    @property
    def g(self) -> Array:
        """Gravity, or the default value if the gravity of the model file is kept [m/s^2]. Shape (3,)."""
        return np.array(GRAVITY) if self.gravity is None else self.gravity

    def at(self, t: Array) -> Applied:
        """Return the applied forces with loads evaluated at times [s]. Shape (n,)."""
        return replace(self, loads=tuple(load.at(t) for load in self.loads))
