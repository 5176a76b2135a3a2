"""Wrenches of unit reactions and actuator forces, and of loads, springs, dampers and motors."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.polynomial.polynomial import polyval

from screwgauge.reference import linear
from screwgauge.reference.applied import Applied, JointSpring, Load, PointSpring
from screwgauge.reference.couplings import component_name
from screwgauge.reference.courses import Course, Samples
from screwgauge.reference.mechanism import Joint, Mechanism
from screwgauge.reference.resistance import REST, Resistance
from screwgauge.reference.rotations import Array, cross, lanes, rotation, times
from screwgauge.witness.constraints import coupling_rows
from screwgauge.witness.joints import JOINT_KINDS, MechanismTree, freedoms, orthogonal_axes
from screwgauge.witness.kinematics import TreeMotion
from screwgauge.witness.tree import TreeStates, stack_frames


@dataclass(frozen=True, slots=True, eq=False)
class JointWrench:
    """Wrench of a joint's parent on its child.

    Attributes:
        name, unit: Name of the reaction component, actuator or coordinate along which the wrench acts; N or N m.
        force, moment: Force and moment in world axes; one of the two is zero. Shape (n, 3), or (3,) for zero.
        point: Point of application [m]. Shape (n, 3).
    """

    name: str
    unit: str
    joint: Joint
    force: Array
    moment: Array
    point: Array

    def on_bodies(self, motion: TreeMotion[MechanismTree]) -> Iterator[tuple[int, Array]]:
        """Yield each loaded body except ground, and the force, then moment about its centre of mass. Shape (n, 6)."""
        for side, sign in ((self.joint.child, 1.0), (self.joint.parent, -1.0)):
            body = motion.tree.mechanism.body_index[side] - 1
            if body >= 0:
                wrench, arm = lanes(len(self.point), 6), self.point - motion.com.p[:, body]
                wrench[:, :3], wrench[:, 3:] = sign * self.force, sign * (self.moment + cross(arm, self.force))
                yield body, wrench


def wrench_columns(parts: Sequence[JointWrench], motion: TreeMotion[MechanismTree]) -> tuple[dict[str, str], Array]:
    """Return the components of unit wrenches with their units, and the effect of each component on each body.

    Args:
        parts: Unit wrenches; the unit wrenches of a coupling, which act on several joints, have the same name.

    Returns:
        Component -> N or N m; and force, then moment about the centre of mass. Shape (n, n_body, 6, m).
    """
    n, b = motion.com.p.shape[:2]
    units = {part.name: part.unit for part in parts}
    column = {name: k for k, name in enumerate(units)}
    columns = np.zeros((n, b, 6, len(units)))
    for part in parts:
        for body, wrench in part.on_bodies(motion):
            columns[:, body, :, column[part.name]] += wrench
    return units, columns


def balance_amounts(units: Iterable[str], columns: Array, need: Array, length: float, rules: Array) -> Array:
    """Solve for multiples of unit wrenches that supply required wrenches, in the minimum-norm least-squares sense.

    Equations and unknowns are scaled to forces: moments are divided by a length.

    Args:
        units: Unit of each component, N or N m.
        columns: Effects from `wrench_columns`. Shape (n, n_body, 6, m).
        need: Required wrenches on the bodies, for p cases. Shape (n, n_body, 6, p).
        length: Length that converts moments to forces [m].
        rules: Further linear combinations of the multiples that must vanish. Shape (n, l, m).

    Returns:
        Multiples of the unit wrenches [N or N m]. Shape (n, m, p).
    """
    n, b, _, p = need.shape
    rows = np.tile([1.0, 1.0, 1.0, length, length, length], b)[:, None]
    size = np.array([length if unit == "N m" else 1.0 for unit in units])
    system = np.concatenate([columns.reshape(n, 6 * b, -1) / rows, rules], axis=1) * size
    right = np.concatenate([need.reshape(n, 6 * b, p) / rows, np.zeros((n, rules.shape[1], p))], axis=1)
    return np.asarray(linear.solve(system, right) * size[:, None])


def unit_wrenches(motion: TreeMotion[MechanismTree], quantity: str) -> Iterator[JointWrench]:
    """Yield unit wrenches of all components of ``reaction``, couplings last, or of ``actuator_force``."""
    mechanism, none = motion.tree.mechanism, np.zeros(3)
    driven = dict(zip(mechanism.actuators, mechanism.actuator_names, strict=False))
    for joint in driven if quantity == "actuator_force" else mechanism.joints:
        near, far, point = _frames(motion, joint)
        parts = {
            f"{joint.name}.{label}": (label[0], along)
            for label, along in constrained_directions(joint, near, far).items()
        }
        if quantity == "actuator_force":
            parts = {driven[joint]: ("m" if joint.angles else "f", times(far, joint.axes[0]))}
        for name, (kind, along) in parts.items():
            pushes = kind == "f"
            force, moment = (along, none) if pushes else (none, along)
            yield JointWrench(name, "N" if pushes else "N m", joint, force, moment, point)
    if quantity == "reaction":
        yield from _of_couplings(motion)
    elif held_names := mechanism.actuator_names[len(driven) :]:
        yield from (coordinate_wrench(motion, name, np.ones(len(motion.states.q))) for name in held_names)


def _of_couplings(motion: TreeMotion[MechanismTree]) -> Iterator[JointWrench]:
    """Yield the unit wrenches of each coupling: 1 along its coordinate, minus the slope along each other coordinate."""
    rows, mechanism = coupling_rows(motion), motion.tree.mechanism
    for k, one in enumerate(mechanism.couplings):
        names = one.named
        unit = "N m" if mechanism.units[mechanism.columns(names)[0]] == "rad" else "N"
        shares = zip(names, rows[:, k, mechanism.columns(names)].T, strict=True)
        for share in shares:
            yield replace(coordinate_wrench(motion, *share), name=component_name(one), unit=unit)


def coordinate_wrench(motion: TreeMotion[MechanismTree], coordinate: str, amount: Array) -> JointWrench:
    """Return a force of a given amount, (n,), along a coordinate; it does no work on the joint's other coordinates."""
    mechanism = motion.tree.mechanism
    joint = next(joint for joint in mechanism.joints if coordinate in joint.coordinates)
    near, _, point = _frames(motion, joint)
    unit = force_along(joint, coordinate, near, motion.states.q[:, mechanism.columns(joint.coordinates)])
    force, moment = (amount[:, None] * part for part in unit)
    turns = joint.freedoms[joint.coordinates.index(coordinate)][0]
    return JointWrench(coordinate, "N m" if turns else "N", joint, force, moment, point)


def force_along(joint: Joint, name: str, near: Array, q: Array) -> tuple[Array, Array]:
    """Return the force and moment, (n, 3) each, of a unit force along a coordinate.

    The force does no work on the joint's other coordinates.

    Args:
        near: World axes of the joint's frame on its parent. Shape (n, 3, 3).
        q: Coordinates of the joint. Shape (n, n_freedom).
    """
    i, axes, kinds = joint.coordinates.index(name), [], [kind for kind, _ in freedoms(joint)]
    for (kind, axis), value in zip(freedoms(joint), q.T, strict=True):
        axes.append(near @ axis)
        if kind == "hinge":
            near = near @ rotation(axis, value)
    alike = [k for k, kind in enumerate(kinds) if kind == kinds[i]]
    one = np.linalg.pinv(np.stack([axes[k] for k in alike], axis=1))[:, :, alike.index(i)]
    return (np.zeros_like(one), one) if kinds[i] == "hinge" else (one, np.zeros_like(one))


def _frames(motion: TreeMotion[MechanismTree], joint: Joint) -> tuple[Array, Array, Array]:
    """Return the world axes of a joint's frames on parent and child, and the origin of the child's frame."""
    R, p = motion.links.poses(stack_frames([motion.tree.fix(body, frame) for body, frame in joint.sides]))
    return R[:, 0], R[:, 1], p[:, 1]


def constrained_directions(joint: Joint, near: Array, far: Array) -> dict[str, Array]:
    """Return the constrained directions of a joint; labels such as ``fx`` denote forces, and ``mx`` moments.

    Forces of fixed joints, and of joints that only rotate, are along the world axes. Moments of a P joint are along
    all three axes of the child's joint frame. The force of an E joint is along its normal; its label names the frame
    axis if the normal is one. The moment of a U joint is along the cross product of its first and second axes. All
    remaining forces and moments are along the two directions across the joint's axis. These directions are axes of
    the child's joint frame if the joint's axis is a frame axis; if not, they are labelled 1 and 2.

    Args:
        near, far: World axes of the joint's frame on its parent and on its child. Shape (n, 3, 3).

    Returns:
        Label -> shape (n, 3).
    """
    _, *holds = JOINT_KINDS[joint.kind]
    forces, moments = (_directions(what, joint, near, far) for what in holds)
    labelled = {f"f{name}": direction for name, direction in forces.items()}
    return labelled | {f"m{name}": direction for name, direction in moments.items()}


def _directions(what: str, joint: Joint, near: Array, far: Array) -> dict[str, Array]:
    if not what:
        return {}
    if what == "world":
        return {name: np.broadcast_to(axis, (len(far), 3)) for name, axis in zip("xyz", np.eye(3), strict=True)}
    if what == "normal":
        return {"": cross(times(near, joint.axes[0]), times(far, joint.axes[1]))}
    frame, sideways = {name: far[..., i] for i, name in enumerate("xyz")}, orthogonal_axes(joint.axes[0])
    if what == "across":
        return {name: times(far, direction) for name, direction in sideways.items()}
    along = {name: axis for name, axis in frame.items() if name not in sideways}
    return frame if what == "frame" else along if len(along) == 1 else {"": times(far, joint.axes[0])}


def exerted_wrenches(
    motion: TreeMotion[MechanismTree],
    t: Array,
    applied: Applied,
    resist: Sequence[Resistance] | None = None,
) -> Iterator[tuple[int, Array, Array, Array]]:
    """Yield the wrenches of loads, springs, dampers and motors, and of rotors and friction of joints.

    Args:
        resist: Rotors, damping and dry friction to include; by default all of the mechanism.

    Yields:
        Index of a body, ground excluded; force and moment, shape (n, 3) or (3,); and the vector from the centre of mass
        to the point at which the force acts, shape (n, 3).
    """
    com, mechanism, states = motion.com, motion.tree.mechanism, motion.states
    for load in applied.loads:
        i = mechanism.body_index[load.body] - 1
        point = mechanism.bodies[i].com if load.point is None else load.point
        yield i, *load_in_world(load, t, com.R[:, i]), times(com.R[:, i], point - mechanism.bodies[i].com)
    resisting = (
        (one.coordinate, -resistance_force(one, states))
        for one in (mechanism.resistances if resist is None else resist)
    )
    for each in (*_joint_forces(mechanism, states, t, applied), *resisting):
        act = coordinate_wrench(motion, *each)
        for side, sign in ((act.joint.child, 1.0), (act.joint.parent, -1.0)):
            if (i := mechanism.body_index[side] - 1) >= 0:
                yield i, sign * act.force, sign * act.moment, act.point - com.p[:, i]
    for spring in applied.springs:
        if isinstance(spring, PointSpring):
            yield from _pull(spring, motion, t)


def load_in_world(load: Load, t: Array, R: Array) -> tuple[Array, Array]:
    """Return force and torque of a load in world axes. Shape (n, 3) or (3,) each.

    Args:
        t: Times [s]. Shape (n,).
        R: Orientation of the load's body. Shape (n, 3, 3).
    """
    force, torque = load.force, load.torque
    if load.courses:
        each = np.stack([_over_time(course, t) for course in load.courses], axis=1)
        force, torque = each[:, :3], each[:, 3:]
    if load.axes == "body":
        force, torque = times(R, force), times(R, torque)
    return force, torque


def _over_time(course: Course | Samples, t: Array) -> Array:
    """Evaluate a function of time at times [s]. Shape (n,)."""
    if isinstance(course, Samples):
        return np.asarray(course(t))
    omega, c, s = course.harmonics.T
    waves = np.cos(np.outer(t, omega)) @ c + np.sin(np.outer(t, omega)) @ s
    return np.asarray(polyval(t, course.polynomial) + waves)


def exerted_on_bodies(
    motion: TreeMotion[MechanismTree],
    t: Array,
    applied: Applied,
    resist: Sequence[Resistance] | None = None,
) -> Array:
    """Return the sum of `exerted_wrenches` on each body, with moments about the centre of mass. (n, n_body, 6)."""
    total = np.zeros((len(t), len(motion.tree.mass), 6))
    for body, force, moment, arm in exerted_wrenches(motion, t, applied, resist):
        total[:, body, :3] += force
        total[:, body, 3:] += moment + cross(arm, np.broadcast_to(force, arm.shape))
    return total


def _joint_forces(mechanism: Mechanism, states: TreeStates, t: Array, applied: Applied) -> Iterator[tuple[str, Array]]:
    """Yield the coordinate of each motor, and of each spring and damper, and the force along it. Shape (n,)."""
    for motor in applied.motors:
        yield motor.coordinate, _over_time(motor.course, t)
    for spring in applied.springs:
        if isinstance(spring, JointSpring):
            i = mechanism.coordinates.index(spring.coordinate)
            force = spring.stiffness * (states.q[:, i] - spring.rest) + spring.damping * states.qd[:, i]
            yield spring.coordinate, -force


def resistance_force(one: Resistance, states: TreeStates) -> Array:
    """Return the force of a rotor, damper or dry friction along its coordinate [N or N m]. Shape (n,)."""
    rate = states.qd[:, one.column]
    if one.what == "friction":
        return np.where(np.abs(rate) > REST, np.copysign(one.amount, rate), 0.0)
    return np.asarray(one.amount * (states.qdd[:, one.column] if one.what == "rotor" else rate))


def joint_forces(mechanism: Mechanism, states: TreeStates, t: Array, applied: Applied) -> Array:
    """Return forces of springs, dampers, motors, rotors and friction along joints [N or N m]. Shape (n, n_q)."""
    total = np.zeros_like(states.q)
    for one in mechanism.resistances:
        total[:, one.column] -= resistance_force(one, states)
    for coordinate, force in _joint_forces(mechanism, states, t, applied):
        total[:, mechanism.coordinates.index(coordinate)] += force
    return total


def _pull(
    spring: PointSpring, motion: TreeMotion[MechanismTree], t: Array
) -> Iterator[tuple[int, Array, Array, Array]]:
    """Yield the forces of a point spring on its bodies, along the line between its points."""
    (way, rate), mechanism = _line(spring, motion), motion.tree.mechanism
    length = np.linalg.norm(way, axis=1)
    if not (length > 0.0).all():
        raise spring.no_direction(f" at t = {t[np.argmin(length)]:g} s")
    line = way / length[:, None]
    tension = spring.stiffness * (length - spring.rest) + spring.damping * np.sum(line * rate, axis=1)
    for (body, point), sign in zip(spring.ends, (1.0, -1.0), strict=True):
        if (i := mechanism.body_index[body] - 1) >= 0:
            arm = times(motion.com.R[:, i], point - mechanism.bodies[i].com)
            yield i, sign * tension[:, None] * line, np.zeros(3), arm


def _line(spring: PointSpring, motion: TreeMotion[MechanismTree]) -> tuple[Array, Array]:
    """Return the vector from a spring's first point to its second, and its rate. Shape (n, 3) each."""
    frames = motion.tree.body_frames
    ends = motion.links.frames(stack_frames([frames[body].place(np.eye(3), at) for body, at in spring.ends]))
    return ends.p[:, 1] - ends.p[:, 0], ends.v[:, 1] - ends.v[:, 0]


def spring_energy(motion: TreeMotion[MechanismTree], applied: Applied) -> Array:
    """Return the energy stored in springs [J]. Shape (n,)."""
    stored = np.zeros(len(motion.states.q))
    for spring in applied.springs:
        if isinstance(spring, JointSpring):
            stretch = motion.states.q[:, motion.tree.mechanism.coordinates.index(spring.coordinate)] - spring.rest
        else:
            stretch = np.linalg.norm(_line(spring, motion)[0], axis=1) - spring.rest
        stored += 0.5 * spring.stiffness * stretch**2
    return stored
