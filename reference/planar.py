"""Finds bodies that can rotate about only one direction, as in a planar machine."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence

import numpy as np

from screwgauge.reference.couplings import Coupling
from screwgauge.reference.mechanism import GROUND, Joint
from screwgauge.reference.rotations import Array, cross, rotation

#: Sine of the angle up to which axes count as parallel: their components have twelve digits.
PARALLEL = 1e-11
#: Function that maps a direction from a body to its neighbour; None if the joint between them may rotate the direction.
Step = Callable[[Array], Array | None]


def normals_of_planes(
    joints: Sequence[Joint], couplings: Sequence[Coupling], parallel: float = PARALLEL
) -> dict[str, Array]:
    """Find the directions about which each body can rotate; return three axes for a body that never rotates.

    A body can only rotate about a ground direction if a chain of joints that only rotate about this direction connects
    it to the ground; all other joints can only restrain the body more. Coordinates that a coupling locks do not rotate.

    Args:
        parallel: Sine of the angle up to which axes count as parallel.

    Returns:
        Body -> unit vectors in body axes, shape (n, 3). Bodies that rotate about several directions are omitted.
    """
    constants = {one.coordinate: one.function.constant for one in couplings if not one.function.terms}
    steps: dict[str, list[tuple[str, Step]]] = {}
    for joint in joints:
        for near, far, outward in ((joint.parent, joint.child, True), (joint.child, joint.parent, False)):
            steps.setdefault(near, []).append((far, _step(joint, constants, outward, parallel)))
    still = _carry({GROUND: np.eye(3)}, steps)
    found = dict(still)
    for direction in _directions(still, joints, constants, parallel):
        for name, axis in _carry({name: axes @ direction for name, axes in still.items()}, steps).items():
            found.setdefault(name, axis[None])
    del found[GROUND]
    return found


def _carry(known: Mapping[str, Array], steps: Mapping[str, Sequence[tuple[str, Step]]]) -> dict[str, Array]:
    """Carry directions (one or three columns) to the axes of further bodies, across joints that cannot rotate them."""
    reached, rim = dict(known), [*known]
    for name in rim:
        for far, step in steps.get(name, ()):
            if far not in reached and (beyond := step(reached[name])) is not None:
                reached[far] = beyond
                rim.append(far)
    return reached


def _step(joint: Joint, constants: Mapping[str, float], outward: bool, parallel: float) -> Step:
    """Build the function that carries directions across a joint, from parent to child or back."""
    near, far = (joint.parent_frame, joint.child_frame)[:: 1 if outward else -1]
    turns = _turns(joint, constants, outward)

    def step(directions: Array) -> Array | None:
        u = near.R.T @ directions
        for axis, angle in turns:
            if angle is not None:
                u = rotation(axis, np.array(-angle)) @ u
            elif u.ndim > 1 or np.linalg.norm(cross(axis, u)) > parallel:
                return None
        return np.asarray(far.R @ u)

    return step


def _turns(joint: Joint, constants: Mapping[str, float], outward: bool) -> list[tuple[Array, float | None]]:
    """List the axes of a joint from parent to child or back, each with its angle if a coupling locks it."""
    sign, turns = 1.0 if outward else -1.0, list[tuple[Array, float | None]]()
    for name, (turning, axis) in zip(joint.coordinates, joint.freedoms, strict=True):
        if turning:
            turns.append((axis, sign * constants[name] if name in constants else None))
    return turns if outward else turns[::-1]


def _directions(
    still: Mapping[str, Array], joints: Iterable[Joint], constants: Mapping[str, float], parallel: float
) -> list[Array]:
    """List ground directions about which joints on non-rotating bodies may rotate other bodies."""
    found = list[Array]()
    for joint in joints:
        for (body, frame), outward in zip(joint.sides, (True, False), strict=True):
            R = frame.R
            for axis, angle in _turns(joint, constants, outward) if body in still else ():
                if angle is None:
                    direction = np.asarray(still[body].T @ R @ axis)
                    if all(np.linalg.norm(cross(direction, one)) > parallel for one in found):
                        found.append(direction)
                    break
                R = R @ rotation(axis, np.array(angle))
    return found
