"""Counts of freedoms and constraints (section 2.2), and which forces are unique."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from screwgauge.reference import linear
from screwgauge.reference.equations.joint_types import reaction_names
from screwgauge.reference.equations.newton_euler import force_matrix
from screwgauge.reference.errors import DescriptionError
from screwgauge.reference.graph import Layout, layout
from screwgauge.reference.mechanism import KINDS
from screwgauge.reference.pose import Pose, length, pose
from screwgauge.reference.rotations import Array


@dataclass(frozen=True, slots=True, eq=False)
class Mobility:
    """Counts of a mechanism at a pose.

    Attributes:
        bodies: Moving bodies.
        joint_freedoms: Sum of the joints' freedoms.
        kutzbach: ``6 bodies - constraints``.
        mobility: Joint freedoms minus the rank of the loops and couplings.
        constraints: Reaction components, those of couplings among them.
        constraint_rank: Rank of their columns in the Newton-Euler system.
        overconstraints: How many of them are redundant.
        actuation_redundancy: Actuators beyond what the freedoms need.
        names: Reaction components, then actuators.
        unique: Whether each is determined by the motion alone, whatever rule fixes the redundant actuation.
        determined: Whether each is determined once such a rule is chosen; a redundant constraint leaves some open.
    """

    bodies: int
    joint_freedoms: int
    kutzbach: int
    mobility: int
    constraints: int
    constraint_rank: int
    overconstraints: int
    actuation_redundancy: int
    names: tuple[str, ...]
    unique: tuple[bool, ...]
    determined: tuple[bool, ...]

    @property
    def undetermined(self) -> tuple[str, ...]:
        """Names of the components that have no unique value under any such rule."""
        return tuple(name for name, fixed in zip(self.names, self.determined, strict=True) if not fixed)


def in_lengths(lay: Layout, at: Pose) -> tuple[Layout, Pose]:
    """A mechanism and its pose with its own length as the unit, so that ranks do not depend on its size."""
    if "in lengths" not in lay.kept:
        lay.kept["in lengths"] = _in_lengths(lay)
    scaled: Layout = lay.kept["in lengths"]
    return scaled, pose(scaled, np.where(lay.turns, at.q, at.q / length(lay)))


def _in_lengths(lay: Layout) -> Layout:
    unit, old = length(lay), lay.mechanism
    joints = [
        replace(
            joint,
            home=np.where(KINDS[joint.kind], joint.home, joint.home / unit),
            parent_frame=replace(joint.parent_frame, p=joint.parent_frame.p / unit),
            child_frame=replace(joint.child_frame, p=joint.child_frame.p / unit),
        )
        for joint in old.joints
    ]
    bodies = tuple(replace(body, com=body.com / unit) for body in old.bodies)
    size = {name: 1.0 if turns else unit for name, turns in zip(old.coordinates, lay.turns, strict=True)}
    couplings = tuple(one.scaled(size[one.coordinate], size.get(one.of, 1.0)) for one in old.couplings)
    return layout(replace(old, bodies=bodies, joints=tuple(joints), couplings=couplings))


def mobility(lay: Layout, at: Pose) -> Mobility:
    """Counts at one pose. `at` holds one sample and is closed."""
    lay, at = in_lengths(lay, at)
    mechanism = lay.mechanism
    G = at.constraint_matrix[0]
    c, names = force_matrix(at, at.q, at.S)[0], reaction_names(mechanism.joints, mechanism.couplings)[0]
    constraints = len(names)
    hidden = linear.null_space(c)  # forces that balance among themselves
    internal = linear.null_space(c[:, :constraints])  # those that need no actuator
    rank = constraints - internal.shape[1]
    freedoms = len(mechanism.coordinates) - linear.rank(G)
    return Mobility(
        bodies=len(mechanism.bodies),
        joint_freedoms=len(mechanism.coordinates),
        kutzbach=6 * len(mechanism.bodies) - constraints,
        mobility=freedoms,
        constraints=constraints,
        constraint_rank=rank,
        overconstraints=constraints - rank,
        actuation_redundancy=hidden.shape[1] - (constraints - rank),
        names=(*names, *mechanism.actuator_names),
        unique=_untouched(hidden),
        determined=_untouched(internal) + (True,) * len(mechanism.actuators),
    )


def _untouched(hidden: Array) -> tuple[bool, ...]:
    """Which components no combination of hidden forces changes. Shape (m, k) -> m flags."""
    return tuple(bool(flag) for flag in np.abs(hidden).max(axis=1, initial=0.0) < 1e-9)


def check_independent(lay: Layout, at: Pose) -> None:
    """Refuses independent coordinates that do not determine the motion at a (closed) pose.

    Raises:
        DescriptionError: There are too few, too many, or they depend on each other.
    """
    lay, at = in_lengths(lay, at)
    mechanism = lay.mechanism
    A = at.closing_matrix[0]
    k = len(mechanism.independent)
    freedoms = A.shape[1] - linear.rank(A[: len(A) - k])
    names = ", ".join(f"{label} = {name}" for label, name in mechanism.independent.items())
    where = f"{mechanism.where}, independent"
    if k != freedoms:
        what = f"{k} independent coordinates ({names}) for {freedoms} degrees of freedom"
        raise DescriptionError(what, where, f"name {freedoms}")
    if linear.rank(A) < A.shape[1]:
        raise DescriptionError(f"the coordinates {names} are not independent at the home pose", where, "choose others")
