"""Springs and dampers, across a joint or between points of two bodies: what they exert, and their energy."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from screwgauge.reference import screws
from screwgauge.reference.applied import Applied, JointSpring, Load, PointSpring, Spring
from screwgauge.reference.errors import UnknownNameError
from screwgauge.reference.kinematics import Velocities
from screwgauge.reference.layout import Layout
from screwgauge.reference.mechanism import Mechanism
from screwgauge.reference.pose import Pose
from screwgauge.reference.rotations import Array


def check_springs(mechanism: Mechanism, springs: Iterable[Spring]) -> None:
    """Refuses springs at bodies or coordinates that the mechanism does not have."""
    for spring in springs:
        if isinstance(spring, JointSpring):
            if spring.coordinate not in mechanism.coordinates:
                raise UnknownNameError("coordinate", spring.coordinate, mechanism.coordinates, "spring")
            continue
        for body, _ in spring.ends:
            if body not in mechanism.body_index:
                raise UnknownNameError("body", body, mechanism.body_index, "spring")


def _ends(lay: Layout, at: Pose, spring: PointSpring) -> tuple[Array, Array]:
    """World positions of the two points [m]. Shape (n, 3) each."""
    (i, first), (j, second) = ((lay.mechanism.body_index[body], point) for body, point in spring.ends)
    return at.p[:, i] + at.R[:, i] @ first, at.p[:, j] + at.R[:, j] @ second


def spring_forces(lay: Layout, rate: Velocities, springs: Sequence[Spring]) -> tuple[Array, list[Load]]:
    """What springs and dampers exert.

    Returns:
        On the joint coordinates [N or N m], shape (n, n_q), and as loads on bodies, forces of shape (n, 3).

    Raises:
        SingularPoseError: The two points of a spring meet, where it has no direction.
    """
    at, index = rate.pose, lay.mechanism.body_index
    tau = np.zeros_like(at.q)
    loads: list[Load] = []
    for spring in springs:
        if isinstance(spring, JointSpring):
            i = lay.mechanism.coordinates.index(spring.coordinate)
            tau[:, i] -= spring.stiffness * (at.q[:, i] - spring.rest) + spring.damping * rate.w[:, i]
            continue
        a, b = _ends(lay, at, spring)
        length = np.linalg.norm(b - a, axis=1, keepdims=True)
        if not (length > 0.0).all():
            raise spring.no_direction()
        along = (b - a) / length
        v = [screws.velocity_at(rate.V[:, index[body]], r) for body, r in ((spring.first, a), (spring.second, b))]
        speed = np.sum(along * (v[1] - v[0]), axis=1, keepdims=True)
        pull = (spring.stiffness * (length - spring.rest) + spring.damping * speed) * along
        for (body, point), force in zip(spring.ends, (pull, -pull), strict=True):
            if index[body]:  # the ground needs no balance
                loads.append(Load(body, point, force, np.zeros(3)))
    return tau, loads


def springs_and_motors(lay: Layout, rate: Velocities, applied: Applied, t: Array) -> tuple[Array, list[Load]]:
    """What springs, dampers and motors exert at times t [s], shape (n,). Returns and raises as `spring_forces`."""
    tau, loads = spring_forces(lay, rate, applied.springs)
    for motor in applied.motors:
        tau[:, lay.mechanism.coordinates.index(motor.coordinate)] += [motor.force(float(x)) for x in t]
    return tau, loads


def spring_energy(lay: Layout, at: Pose, springs: Sequence[Spring]) -> Array:
    """Energy stored in all springs [J]. Shape (n,)."""
    energy = np.zeros(len(at.q))
    for spring in springs:
        if isinstance(spring, JointSpring):
            stretch = at.q[:, lay.mechanism.coordinates.index(spring.coordinate)] - spring.rest
        else:
            a, b = _ends(lay, at, spring)
            stretch = np.linalg.norm(b - a, axis=1) - spring.rest
        energy += 0.5 * spring.stiffness * stretch**2
    return energy
