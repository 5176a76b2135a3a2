"""Forces in a model file that no engine includes, measured at the states of an answer.

Every entry of `Mechanism.left_out` is converted to additional wrenches that bodies require, and then to forces of
actuators, along coordinates or in joints. Forces have the sign of required forces.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np

from screwgauge.judging.answer import Answer
from screwgauge.judging.residuals import required_wrenches, unit_wrenches_of
from screwgauge.quantities import FORCE
from screwgauge.reference.applied import JointSpring, Spring
from screwgauge.reference.graph import spanning_tree
from screwgauge.reference.left_out import (
    BorneWeight,
    Drag,
    LeftOut,
    StrokeResistance,
    TurnResistance,
    damper_law,
    spring_law,
)
from screwgauge.reference.rotations import Array, cross, times
from screwgauge.witness.constraints import AdmissibleMotion
from screwgauge.witness.dynamics import project_forces
from screwgauge.witness.joints import open_tree
from screwgauge.witness.kinematics import Moving, move
from screwgauge.witness.tree import FixedFrame, TreeStates, stack_frames
from screwgauge.witness.wrenches import balance_amounts, coordinate_wrench, wrench_columns

ARMATURE, DAMPING, FRICTION, SPRINGS, WEIGHT, DRAG = (
    "armature",
    "damping",
    "dry friction",
    "springs",
    "compensated weight",
    "drag",
)
#: Fraction of the largest force below which a force is rounding.
NOTHING = 1e-13


@dataclass(frozen=True, slots=True)
class LeftOutTerm:
    """A kind of omitted force.

    Attributes:
        kind: One of the kinds named by the constants of this module.
        names: Owners, given as noun and name: ``joint m1``.
        size: Largest force that this kind adds to an actuator or, if actuators do not drive all degrees of freedom,
            along an independent coordinate [unit].
        of: Largest total force with this unit in the same components, including all omitted forces [unit].
        component, t: Component and time [s] of the largest force.
        file: Name of the model file that contains the force; empty for the file from which the description was made.
    """

    kind: str
    names: tuple[str, ...]
    size: float
    of: float
    unit: str
    component: str
    t: float
    file: str = ""

    @property
    def inertia(self) -> bool:
        """True for armature, which changes the motion under given forces."""
        return self.kind == ARMATURE


Needed = dict[str, Array]
"""Kind -> wrench that it requires on each body: force, moment about the centre of mass. Shape (n, n_body, 6)."""


@dataclass(frozen=True, eq=False)
class MeasuredPart:
    """Omitted forces at some states of an answer.

    Attributes:
        admissible: Motions that the loops allow.
        needed: Kind -> required wrenches on bodies.
        names: Kind -> its owners.
    """

    answer: Answer
    admissible: AdmissibleMotion
    needed: Needed
    names: Mapping[str, Sequence[str]]

    @cached_property
    def driven(self) -> Array:
        """Actuator velocities per unit velocity of each coordinate in y. Shape (n, n_actuator, k)."""
        return np.asarray(self.admissible.partial[:, self.answer.mechanism.actuated_columns])

    def generalized_forces(self, wrenches: Array) -> Array:
        """Return the generalised forces that supply the required wrenches. Shape (n, k)."""
        return np.asarray(np.einsum("nbx,nbxj->nj", wrenches, self.admissible.bodies))

    def actuators(self, wrenches: Array) -> Array:
        """Return the minimum-norm actuator forces that supply the required wrenches. Shape (n, n_actuator)."""
        back = np.linalg.pinv(np.swapaxes(self.driven, 1, 2))
        return np.asarray((back @ self.generalized_forces(wrenches)[..., None])[..., 0])

    def _reactions(self, wrenches: Array, names: Sequence[str]) -> Array:
        """Return joint reactions that, with the actuator forces, supply the required wrenches. Shape (n, m)."""
        answer, need = self.answer, wrenches.copy()
        driving = [unit for _, unit in unit_wrenches_of(answer, "actuator_force")]
        for force, unit in zip(self.actuators(wrenches).T, driving, strict=True):
            for body, wrench in unit.on_bodies(answer.motion):
                need[:, body] -= force[:, None] * wrench
        parts = [part for _, part in unit_wrenches_of(answer, "reaction")]
        units, columns = wrench_columns(parts, answer.motion)
        none = np.zeros((len(need), 0, len(units)))
        amounts = balance_amounts(units.values(), columns, need[..., None], answer.scales["m"], none)[..., 0]
        return amounts[:, [[*units].index(name) for name in names]]

    def _tree_forces(self, wrenches: Array, names: Sequence[str]) -> Array:
        """Return forces along the open-tree coordinates of some joints. Shape (n, m)."""
        mechanism = self.answer.mechanism
        joints = [joint for joint in mechanism.joints if {*joint.coordinates} <= {*names}]
        graph = spanning_tree(mechanism, [joint.name for joint in joints])
        tree, bodies, shares = open_tree(mechanism, graph, {joint.name for joint in joints})
        still = np.zeros_like(self.answer.q)
        motion = move(tree, TreeStates(self.answer.q, still, still))
        return project_forces(motion, wrenches[:, bodies] * shares[:, None])[:, mechanism.columns(names)]

    def effect(self, kind: str, quantity: str, names: Sequence[str]) -> Array:
        """Return a kind's effect on components of a quantity; zero unless the components are forces. Shape (n, m)."""
        mechanism, wrenches = self.answer.mechanism, self.needed[kind]
        match quantity:
            case "generalized_force":
                return self.generalized_forces(wrenches)[:, [[*mechanism.independent].index(name) for name in names]]
            case "actuator_force":
                return self.actuators(wrenches)[:, [mechanism.actuator_names.index(name) for name in names]]
            case "reaction":
                return self._reactions(wrenches, names)
            case "tree_force" | "tree_force_soft":
                return self._tree_forces(wrenches, names)
        return np.zeros((len(wrenches), len(names)))


Moments = Callable[[], Iterator[tuple[Answer, AdmissibleMotion]]]
"""Yields parts of an answer with positions, velocities and accelerations, each with its admissible motions."""


MeasuredParts = Iterator[MeasuredPart]
"""Parts of the measured forces along a motion."""


def measured_parts(moments: Moments, left_out: Sequence[LeftOut], springs: Sequence[Spring] = ()) -> MeasuredParts:
    """Measure forces of `Mechanism.left_out` along a motion, in parts to limit memory.

    Args:
        springs: Springs of the scene; engines include springs along joints, so their forces are subtracted.
    """
    along_joints = [spring for spring in springs if isinstance(spring, JointSpring)]
    for answer, admissible in moments():
        needed, names = Needed(), dict[str, list[str]]()
        for one in left_out:
            for kind, wrenches in _wrenches_by_kind(answer, one, along_joints):
                needed[kind] = needed[kind] + wrenches if kind in needed else wrenches
                names.setdefault(kind, []).append(one.of)
        yield MeasuredPart(answer, admissible, needed, names)


def left_out_terms(parts: MeasuredParts, file: str = "") -> Iterator[LeftOutTerm]:
    """Yield the largest force of each kind of omitted term, in the unit in which its share is largest."""
    times, whole, drives = list[Array](), list[tuple[Array, Array]](), True
    forces, named = dict[str, list[tuple[Array, Array]]](), dict[str, Sequence[str]]()
    for part in parts:
        mechanism, named = part.answer.mechanism, dict(part.names)
        freedoms = len(mechanism.independent)
        drives = drives and bool(freedoms) and int(np.linalg.matrix_rank(part.driven).min()) == freedoms
        times.append(part.answer.t)
        for kind, wrenches in part.needed.items():
            forces.setdefault(kind, []).append((part.actuators(wrenches), part.generalized_forces(wrenches)))
        rigid = required_wrenches(part.answer)[0] + sum(part.needed.values())
        whole.append((part.actuators(rigid), part.generalized_forces(rigid)))
    if not forces:
        return
    names, units = mechanism.actuator_names, mechanism.actuator_units
    if not drives:
        names = tuple(mechanism.independent)
        units = tuple(FORCE[mechanism.units[column]] for column in mechanism.independent_columns)
    t, of = np.concatenate(times), np.abs(np.concatenate([pair[not drives] for pair in whole])).max(axis=0)
    largest = np.array([max(size for size, has in zip(of, units, strict=True) if has == unit) for unit in units])
    for kind, pairs in forces.items():
        force = np.abs(np.concatenate([pair[not drives] for pair in pairs]))
        share = force / np.maximum(largest, np.finfo(float).tiny)
        i, k = divmod(int(share.argmax()), len(units))
        size = float(force[i, k]) if share[i, k] > NOTHING else 0.0
        owners = tuple(dict.fromkeys(named[kind]))
        yield LeftOutTerm(kind, owners, size, float(largest[k]), units[k], names[k], float(t[i]), file)


def added_forces(parts: MeasuredParts, quantity: str, names: Sequence[str]) -> dict[str, Array]:
    """Return kind -> effect on components of a quantity. Shape (n, m)."""
    by_kind: dict[str, list[Array]] = {}
    for part in parts:
        for kind in part.needed:
            by_kind.setdefault(kind, []).append(part.effect(kind, quantity, names))
    return {kind: np.concatenate(arrays) for kind, arrays in by_kind.items()}


def _wrenches_by_kind(answer: Answer, one: LeftOut, springs: Sequence[JointSpring]) -> Iterator[tuple[str, Array]]:
    """Yield each kind of force in an entry, with the required wrenches on bodies."""
    match one:
        case StrokeResistance() if one.path:
            yield from _along_path(answer, one)
        case StrokeResistance():
            there = [spring for spring in springs if one.of == f"joint {spring.coordinate}"]
            for kind, force in _along_stroke(answer, one, there).items():
                total = np.zeros(_shape(answer))
                for name, share in one.along.items():
                    act = coordinate_wrench(answer.motion, name, share * force)
                    total += _wrench_pair(answer, act.joint.bodies, act.force, act.moment, act.point)
                yield kind, total
        case TurnResistance():
            yield from _about_ball(answer, one)
        case BorneWeight():
            at = _fixed_to(answer, one.body, one.point, np.eye(3))
            force = np.tile(one.mass * answer.applied.g, (len(answer.t), 1))
            yield WEIGHT, _wrench_pair(answer, ("", one.body), force, np.zeros_like(force), at.p[:, 0])
        case Drag():
            at = _fixed_to(answer, one.body, one.frame.p, one.frame.R)
            yield DRAG, _wrench_pair(answer, ("", one.body), *_drag(one, at), at.p[:, 0])


def _shape(answer: Answer) -> tuple[int, int, int]:
    return len(answer.t), len(answer.mechanism.bodies), 6


def _wrench_pair(answer: Answer, bodies: tuple[str, str], force: Array, moment: Array, point: Array) -> Array:
    """Return the wrenches of a force at a point and a moment on the second of two bodies, and their reactions on the
    first body."""
    total, index = np.zeros(_shape(answer)), answer.mechanism.body_index
    for body, sign in zip(bodies, (-1.0, 1.0), strict=True):
        if (i := index.get(body, 0) - 1) >= 0:
            total[:, i, :3] = sign * force
            total[:, i, 3:] = sign * (moment + cross(point - answer.motion.com.p[:, i], force + np.zeros_like(point)))
    return total


def _along_stroke(answer: Answer, one: StrokeResistance, springs: Iterable[JointSpring]) -> Needed:
    """Map kinds to forces along the stroke, minus the forces of the scene's springs at the joint. Shape (n,)."""
    columns, shares = answer.mechanism.columns(one.along), np.array([*one.along.values()])
    stroke, rate, acceleration = (derivative[:, columns] @ shares for derivative in answer.joints)
    forces = _resisting_forces(one, stroke, rate, acceleration)
    there = {ARMATURE: one.armature, DAMPING: one.damping, FRICTION: one.friction, SPRINGS: one.stiffness}
    for spring in springs:
        forces[DAMPING] = forces[DAMPING] - spring.damping * rate
        forces[SPRINGS] = forces[SPRINGS] - spring.stiffness * (stroke - spring.rest)
        there[DAMPING] = there[DAMPING] if one.damping != (spring.damping,) else ()
        alike = one.stiffness == (spring.stiffness,) and one.rest == (spring.rest, spring.rest)
        there[SPRINGS] = () if alike else there[SPRINGS]
    return {kind: force for kind, force in forces.items() if there[kind]}


def _resisting_forces(one: StrokeResistance, stroke: Array, rate: Array, acceleration: Array) -> Needed:
    """Map kinds to forces along the stroke. Shape (n,)."""
    return {
        ARMATURE: one.armature * acceleration,
        DAMPING: damper_law(one.damping, rate),
        FRICTION: one.friction * np.sign(rate),
        SPRINGS: spring_law(one.stiffness, stroke - np.clip(stroke, *one.rest)),
    }


def _along_path(answer: Answer, one: StrokeResistance) -> Iterator[tuple[str, Array]]:
    """Yield each kind of force along a path, with the required wrenches at the ends and bends of the path."""
    frames = [answer.tree.body_frames[body].place(np.eye(3), point) for body, point in one.path]
    at = answer.motion.links.frames(stack_frames(frames))
    way, apart, gained = (np.diff(getattr(at, name), axis=1) for name in "pva")
    length = np.linalg.norm(way, axis=2)
    line = way / np.maximum(length, np.finfo(float).tiny)[..., None]
    rate, across = np.sum(line * apart, axis=2), cross(line, apart)
    turning = np.sum(across * across, axis=2) / np.maximum(length, np.finfo(float).tiny)
    acceleration = np.sum(line * gained, axis=2) + turning
    forces = _resisting_forces(one, *(each.sum(axis=1) for each in (length, rate, acceleration)))
    there = {ARMATURE: one.armature, DAMPING: one.damping, FRICTION: one.friction, SPRINGS: one.stiffness}
    for kind, force in forces.items():
        if there[kind]:
            total, none = np.zeros(_shape(answer)), np.zeros((len(force), 3))
            for i, ((first, _), (second, _)) in enumerate(pairwise(one.path)):
                pull = force[:, None] * line[:, i]
                total += _wrench_pair(answer, ("", second), pull, none, at.p[:, i + 1])
                total += _wrench_pair(answer, ("", first), -pull, none, at.p[:, i])
            yield kind, total


def _about_ball(answer: Answer, one: TurnResistance) -> Iterator[tuple[str, Array]]:
    """Yield each kind of force in a ball joint, with the required wrenches.

    Moments are about the child's axes; a free joint also has forces along world axes.
    """
    joint = answer.mechanism.joint(one.joint)
    near, far = (_frame_motion(answer, answer.tree.fix(body, frame)) for body, frame in joint.sides)
    R, point = far.R[:, 0], far.p[:, 0]
    seen, spin = np.swapaxes(R, 1, 2), (far.w - near.w)[:, 0]
    rates = times(seen, spin), times(seen, (far.b - near.b)[:, 0] - cross(far.w[:, 0], spin))
    ways = far.v[:, 0], far.a[:, 0]
    for kind, there in ((ARMATURE, one.armature), (DAMPING, one.damping), (FRICTION, one.friction)):
        if there:
            moment, force = times(R, _law(kind, one, *rates)), _law(kind, one, *ways) * (joint.kind == "F")
            yield kind, _wrench_pair(answer, joint.bodies, force, moment, point)


def _law(kind: str, one: TurnResistance, rate: Array, acceleration: Array) -> Array:
    if kind == ARMATURE:
        return one.armature * acceleration
    return damper_law(one.damping, rate) if kind == DAMPING else one.friction * np.sign(rate)


def _fixed_to(answer: Answer, body: str, p: Array, R: Array) -> Moving:
    return _frame_motion(answer, answer.tree.body_frames[body].place(R, p))


def _frame_motion(answer: Answer, frame: FixedFrame) -> Moving:
    """Return the motion of a single frame."""
    return answer.motion.links.frames(stack_frames([frame]))


def _drag(one: Drag, at: Moving) -> tuple[Array, Array]:
    """Return the force and moment that overcome a medium's drag on a box (MuJoCo's inertia model). Shape (n, 3) each.

    See mujoco.readthedocs.io, Computation, Passive forces: inertia model.
    """
    R = at.R[:, 0]
    seen = np.swapaxes(R, 1, 2)
    w, v = times(seen, at.w[:, 0]), times(seen, at.v[:, 0] - one.wind)
    x, y, z = one.box
    width = float(np.mean(one.box))
    faces = np.array([y * z, x * z, x * y])
    turning = np.array([x * (y**4 + z**4), y * (x**4 + z**4), z * (x**4 + y**4)])
    force = 3.0 * np.pi * width * one.viscosity * v + 0.5 * one.density * faces * np.abs(v) * v
    moment = np.pi * width**3 * one.viscosity * w + one.density * turning * np.abs(w) * w / 64.0
    return times(R, force), times(R, moment)
