"""What reactions and actuator forces stand for, as the judge reads their names.

Written down from the meaning of the components and not from the solver's table of joint types, by which the engines
resolve theirs: a wrong sign or direction there is to be seen here.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from screwgauge.judging.answer import Answer
from screwgauge.judging.coupled import coupling_shares, force_along
from screwgauge.reference.mechanism import Joint
from screwgauge.reference.rotations import Array, cross, lanes, product, times

_XYZ = "xyz"
#: Kind of joint -> directions of its forces and of its moments: axes of the world or of the child's joint frame, those
#: across or along the joint's axis, the normal to its two.
HELD = {
    "R": ("world", "across"),
    "P": ("across", "frame"),
    "U": ("world", "normal"),
    "S": ("world", ""),
    "C": ("across", "across"),
    "E": ("along", "across"),
    "F": ("", ""),
}


@dataclass(frozen=True, slots=True, eq=False)
class Act:
    """What a joint's parent exerts on its child.

    Attributes:
        force, moment: In world axes, one of them zero. Shape (n, 3), or (3,) for zero.
        point: Where it acts [m]. Shape (n, 3).
    """

    joint: Joint
    force: Array
    moment: Array
    point: Array


@dataclass(frozen=True, slots=True, eq=False)
class Unit:
    """A unit force or a unit moment, of one joint or, if it is that of a coupling, of two.

    Attributes:
        quantity, name: Component of an answer that says how much of it there is.
        unit: N or N m.
    """

    quantity: str
    name: str
    unit: str
    acts: tuple[Act, ...]

    def amount(self, answer: Answer) -> Array:
        """How much of it there is [N or N m]. Shape (n, 1)."""
        values = answer.values[self.quantity]
        return np.ascontiguousarray(values.array[:, values.components.index(self.name)])[:, None]

    def sides(self, answer: Answer) -> Iterator[tuple[int, Array]]:
        """Bodies that it acts on, without ground, and force over moment about the centre of mass. Shape (n, 6)."""
        for act in self.acts:
            for side, sign in ((act.joint.child, 1.0), (act.joint.parent, -1.0)):
                body = answer.mechanism.body_index[side] - 1
                if body >= 0:
                    wrench, arm = lanes(len(act.point), 6), act.point - answer.motions.com.p[:, body]
                    wrench[:, :3], wrench[:, 3:] = sign * act.force, sign * (act.moment + cross(arm, act.force))
                    yield body, wrench


def unit_forces(answer: Answer, quantity: str) -> Iterator[Unit]:
    """All components of ``reaction``, those of couplings last, or of ``actuator_force``."""
    mechanism, bodies = answer.mechanism, answer.motions.bodies
    driven = dict(zip(mechanism.actuators, mechanism.actuator_names, strict=True))
    for joint in driven if quantity == "actuator_force" else mechanism.joints:
        parent, child = (mechanism.body_index[side] for side in (joint.parent, joint.child))
        near, far = product(bodies.R[:, parent], joint.parent_frame.R), product(bodies.R[:, child], joint.child_frame.R)
        point = bodies.p[:, child] + times(bodies.R[:, child], joint.child_frame.p)
        parts = {f"{joint.name}.{label}": (label[0], along) for label, along in held(joint, near, far).items()}
        if quantity == "actuator_force":
            parts = {driven[joint]: ("m" if joint.angles else "f", times(far, joint.axes[0]))}
        for name, (kind, along) in parts.items():
            none, pushes = np.zeros(3), kind == "f"
            act = Act(joint, along if pushes else none, none if pushes else along, point)
            yield Unit(quantity, name, "N" if pushes else "N m", (act,))
    if quantity == "reaction":
        yield from _of_couplings(answer)


def _of_couplings(answer: Answer) -> Iterator[Unit]:
    mechanism, bodies = answer.mechanism, answer.motions.bodies
    owner = {name: joint for joint in mechanism.joints for name in joint.coordinates}
    for name, unit, shares in coupling_shares(mechanism, answer.q):
        acts = []
        for coordinate, share in shares:
            joint = owner[coordinate]
            parent, child = (mechanism.body_index[side] for side in (joint.parent, joint.child))
            near, q = bodies.R[:, parent] @ joint.parent_frame.R, answer.q[:, mechanism.columns(joint.coordinates)]
            force, moment = (share[:, None] * part for part in force_along(joint, coordinate, near, q))
            acts.append(Act(joint, force, moment, bodies.p[:, child] + bodies.R[:, child] @ joint.child_frame.p))
        yield Unit("reaction", name, unit, tuple(acts))


def held(joint: Joint, near: Array, far: Array) -> dict[str, Array]:
    """Directions in which a joint holds its child: ``fx`` and so on are forces, ``mx`` and so on moments.

    Forces of joints that only turn are along the world's axes. All else is along axes of the child's joint frame: all
    three where no freedom turns, else those across the joint's axis, and where that is none of them the two across it
    are called 1 and 2. The force of an E joint is along that axis of the frame that is its normal, or without a letter
    along the normal. The moment of a U joint is along the cross product of its first and its second axis.

    Args:
        near, far: World axes of the joint's frame on its parent and on its child. Shape (n, 3, 3).

    Returns:
        Label -> shape (n, 3).
    """
    forces, moments = (_directions(what, joint, near, far) for what in HELD[joint.kind])
    labelled = {f"f{name}": direction for name, direction in forces.items()}
    return labelled | {f"m{name}": direction for name, direction in moments.items()}


def _directions(what: str, joint: Joint, near: Array, far: Array) -> dict[str, Array]:
    if not what:
        return {}
    if what == "world":
        return {name: np.broadcast_to(axis, (len(far), 3)) for name, axis in zip(_XYZ, np.eye(3), strict=True)}
    if what == "normal":
        return {"": cross(times(near, joint.axes[0]), times(far, joint.axes[1]))}
    frame, across = {name: far[..., i] for i, name in enumerate(_XYZ)}, _beside(joint.axes[0])
    if what == "across":
        return {name: times(far, direction) for name, direction in across.items()}
    along = {name: axis for name, axis in frame.items() if name not in across}
    return frame if what == "frame" else along if len(along) == 1 else {"": times(far, joint.axes[0])}


def _beside(axis: Array) -> dict[str, Array]:
    """Two directions at right angles to an axis: axes of the frame if it is one of them, else made from the first."""
    main = int(np.abs(axis).argmax())
    others = [i for i in range(3) if i != main]
    if not axis[others].any():
        return {_XYZ[i]: np.eye(3)[i] for i in others}
    one = np.cross(axis, np.eye(3)[others[0]])
    one = one / np.sqrt(one @ one)
    return {"1": one, "2": np.cross(axis, one)}
