"""Linkages by points, axes and inertia in the world: frames, tree and order are a writer's.

A machine is the same machine in another pose, with other frames and other cuts, if `Linkage` has it so; what is written
of it by `writers` shares no code with the package.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from campaigns.corpus.poses import Array, Random, frame, pose, turn, unit

GROUND = "ground"


@dataclass(frozen=True, slots=True, eq=False)
class Body:
    """A rigid body.

    Attributes:
        mass: [kg]
        com: In the world. Shape (3,).
        inertia: About the centre of mass, in axes of the world. Shape (3, 3).
    """

    name: str
    mass: float
    com: Array
    inertia: Array


@dataclass(frozen=True, slots=True, eq=False)
class Joint:
    """A joint.

    Attributes:
        kind: ``R``, ``P``, ``U`` or ``S``.
        point: On its axis, in the world. Shape (3,).
        axes: Directions in the world: one of R and P, two of U, none of S.
        damping: [N m s/rad or N s/m]
        limits: Of R and P, from this pose; None where there are none.
    """

    name: str
    kind: str
    parent: str
    child: str
    point: Array
    axes: tuple[Array, ...] = ()
    damping: float = 0.0
    limits: tuple[float, float] | None = None
    actuated: bool = False

    def turned(self) -> Joint:
        """Seen from its other side: a coordinate counts the same, since the axis turns with the sides."""
        return replace(self, parent=self.child, child=self.parent, axes=tuple(-a for a in reversed(self.axes)))


@dataclass(frozen=True, slots=True, eq=False)
class Linkage:
    """Bodies, and joints of which some close loops.

    Attributes:
        cut: Joints that are not in the tree.
        frames: Body -> its frame in the world; at its first joint, parallel to the world, where none is given.
        independent: Joints whose coordinates are the independent ones.
    """

    name: str
    bodies: tuple[Body, ...]
    joints: tuple[Joint, ...]
    cut: tuple[str, ...] = ()
    independent: tuple[str, ...] = ()
    frames: dict[str, Array] = field(default_factory=dict)

    def tree(self) -> list[Joint]:
        left = [joint for joint in self.joints if joint.name not in self.cut]
        reached, found = {GROUND}, list[Joint]()
        while left:
            some = [j for j in left if (j.parent in reached) != (j.child in reached)]
            if not some:
                raise ValueError(f"{self.name}: {[j.name for j in left]} are no tree")
            joint = some[0] if some[0].parent in reached else some[0].turned()
            found.append(joint)
            reached.add(joint.child)
            left.remove(some[0])
        return found

    def closures(self) -> list[Joint]:
        return [joint for joint in self.joints if joint.name in self.cut]

    def frame_of(self, body: str) -> Array:
        """Shape (4, 4)."""
        if body == GROUND:
            return np.eye(4)
        first = next(joint for joint in self.tree() if joint.child == body)
        return self.frames.get(body, pose(p=first.point))

    # --- the same machine, said differently

    def moved(self, rng: Random) -> Linkage:
        return replace(self, frames={b.name: frame(rng, 0.2) for b in self.bodies})

    def renamed(self, style: str = "{kind}{number}") -> Linkage:
        """Bodies and joints numbered."""
        bodies = {b.name: f"part{i}" for i, b in enumerate(self.bodies)} | {GROUND: GROUND}
        joints = {j.name: style.format(kind="joint", number=i) for i, j in enumerate(self.joints)}
        return replace(
            self,
            bodies=tuple(replace(b, name=bodies[b.name]) for b in self.bodies),
            joints=tuple(
                replace(j, name=joints[j.name], parent=bodies[j.parent], child=bodies[j.child]) for j in self.joints
            ),
            cut=tuple(joints[name] for name in self.cut),
            independent=tuple(joints[name] for name in self.independent),
            frames={bodies[name]: T for name, T in self.frames.items()},
        )

    def reordered(self, rng: Random) -> Linkage:
        bodies, joints = ([some[int(i)] for i in rng.permutation(len(some))] for some in (self.bodies, self.joints))
        return replace(self, bodies=tuple(bodies), joints=tuple(joints))  # type: ignore[arg-type]

    def flipped(self, names: Iterable[str]) -> Linkage:
        some = {*names}
        return replace(self, joints=tuple(_flipped(j) if j.name in some else j for j in self.joints))

    def with_cut(self, *cut: str) -> Linkage:
        return replace(self, cut=cut)

    # --- another machine

    def with_body(self, name: str, **changes: object) -> Linkage:
        return replace(self, bodies=tuple(replace(b, **changes) if b.name == name else b for b in self.bodies))  # type: ignore[arg-type]

    def with_joint(self, name: str, **changes: object) -> Linkage:
        return replace(self, joints=tuple(replace(j, **changes) if j.name == name else j for j in self.joints))  # type: ignore[arg-type]


def _flipped(joint: Joint) -> Joint:
    limits = joint.limits and (-joint.limits[1], -joint.limits[0])
    return replace(joint, axes=tuple(-axis for axis in joint.axes), limits=limits)


def rod(name: str, mass: float, ends: Sequence[Array], across: Array, width: float = 0.02, aside: float = 0.0) -> Body:
    """A box from one end to the other, no two of its moments alike.

    Args:
        across: A direction that turns with the rod, across it. Shape (3,).
        aside: How far its centre of mass is off, along the third direction.
    """
    a, b = ends
    along = unit(b - a)
    length = float(np.linalg.norm(b - a))
    moments = mass * np.array([2.0 * width**2, length**2 + width**2, length**2 + 1.5 * width**2]) / 12.0
    second = unit(across - (across @ along) * along)
    R = np.array([along, second, np.cross(along, second)]).T
    return Body(name, mass, (a + b) / 2.0 + aside * R[:, 2], R @ np.diag(moments) @ R.T)


def plate(name: str, mass: float, centre: Array, R: Array, radius: float) -> Body:
    moments = mass * radius**2 * np.array([0.26, 0.29, 0.5])
    return Body(name, mass, centre + R @ np.array([0.003, -0.002, 0.004]), R @ np.diag(moments) @ R.T)


def bent(machine: Linkage, q: dict[str, float]) -> Linkage:
    for name, value in q.items():
        joint = next(j for j in machine.joints if j.name == name)
        step = _step(joint, value)
        outside = _outside(machine, joint.child)
        machine = replace(
            machine,
            bodies=tuple(_carried(b, step) if b.name in outside else b for b in machine.bodies),
            joints=tuple(
                replace(j, point=_point(step, j.point), axes=tuple(step[:3, :3] @ a for a in j.axes))
                if j.parent in outside
                else j
                for j in machine.joints
            ),
        )
        if joint.limits is not None:
            machine = machine.with_joint(name, limits=(joint.limits[0] - value, joint.limits[1] - value))
    return machine


def _step(joint: Joint, value: float) -> Array:
    if joint.kind == "P":
        return pose(p=value * joint.axes[0])
    R = turn(joint.axes[0], value)
    return pose(R, joint.point - R @ joint.point)


def _point(T: Array, p: Array) -> Array:
    return np.asarray(T[:3, :3] @ p + T[:3, 3])


def _carried(body: Body, T: Array) -> Body:
    return replace(body, com=_point(T, body.com), inertia=T[:3, :3] @ body.inertia @ T[:3, :3].T)


def _outside(machine: Linkage, body: str) -> set[str]:
    found = {body}
    while more := {j.child for j in machine.joints if j.parent in found} - found:
        found |= more
    return found
