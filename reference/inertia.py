"""Completes (for planar motion), allows or rejects inertia tensors that violate the triangle inequality."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import replace

import numpy as np

from screwgauge.reference.couplings import Coupling
from screwgauge.reference.errors import DescriptionError, UnknownNameError, first_few
from screwgauge.reference.mechanism import SLACK, Body, Joint, triangle_excess
from screwgauge.reference.planar import normals_of_planes
from screwgauge.reference.rotations import Array

#: Property that entries of `allow` name to accept a body's tensor, e.g. ``wrist.triangle``.
TRIANGLE = "triangle"
#: Sine of the angle below which tilted axes were probably meant to be parallel.
MEANT = 1e-3
#: Largest number of bodies that a message names.
SHOWN = 4


def settle_tensors(
    bodies: Sequence[Body],
    joints: Sequence[Joint],
    couplings: Sequence[Coupling] = (),
    allow: Collection[str] = (),
    where: str = "",
) -> tuple[tuple[Body, ...], tuple[str, ...]]:
    """Complete or allow impossible tensors; return the bodies, and messages about all changed or allowed tensors.

    Args:
        bodies: Bodies with unchecked tensors (`Body.allowed`).
        allow: Entries such as ``wrist.triangle``.

    Raises:
        DescriptionError: A tensor violates the triangle inequality, which would affect results, and is not allowed.
        UnknownNameError: An entry of `allow` refers to a missing body or property.
    """
    excused = _excused_bodies(bodies, allow, where)
    excesses = {body.name: excess for body in bodies if (excess := triangle_excess(body.inertia))}
    normals = normals_of_planes(joints, couplings) if {*excesses} - excused else {}
    found, completed, refused, sentences = list[Body](), list[str](), list[Body](), list[str]()
    for body in bodies:
        tensor: Array | None = body.inertia
        if body.name in excesses and body.name in excused:
            sentences.append(_describe_allowed(body, excesses[body.name]))
        elif body.name in excesses:
            tensor = next(_complete(body.inertia, normals.get(body.name, ())), None)
            if tensor is None:
                refused.append(body)
            else:
                completed.append(body.name)
        found.append(body if tensor is None else replace(body, inertia=tensor, allowed=body.name in excused))
    if refused:
        raise _refusal(refused, normals.get(refused[0].name), joints, couplings)
    if completed:
        sentences.append(
            f"one moment of inertia is enough for {first_few(completed, SHOWN)}, which turn about one direction only, "
            "as in a planar machine: moments about other axes have no effect and are set to the smallest possible value"
        )
    sentences += (f"allow names {name}.{TRIANGLE}, which has no effect" for name in sorted(excused - {*excesses}))
    return tuple(found), tuple(sentences)


def _excused_bodies(bodies: Sequence[Body], allow: Collection[str], where: str) -> set[str]:
    """Return the names of the bodies that `allow` exempts."""
    known, names = [body.name for body in bodies], set[str]()
    for entry in allow:
        name, _, what = entry.rpartition(".")
        if what != TRIANGLE:
            raise UnknownNameError("property", what, [TRIANGLE], f"{where}, allow")
        if name not in known:
            raise UnknownNameError("body", name, known, f"{where}, allow")
        names.add(name)
    return names


def _complete(inertia: Array, normals: Sequence[Array] | Array) -> Iterator[Array]:
    """Yield the tensor, completed with the smallest possible moments across each normal in turn.

    About the normal n, the tensor is kept, ``I n = J n``; across n, the moments of ``I + d (1 - n n^T)`` have the sum
    J. Moments across n that are impossible for any J are not corrected, because they are probably wrong, not omitted.
    """
    size = float(np.trace(inertia))
    for n in normals:
        J = float(n @ inertia @ n)
        raised = inertia + 0.5 * (2.0 * J - size) * (np.eye(3) - np.outer(n, n))
        if J > 0.0 and np.abs(inertia @ n - J * n).max() <= SLACK * size and not triangle_excess(raised):
            yield raised


def _describe_allowed(body: Body, excess: float) -> str:
    """Describe the consequence of a tensor that no body can have."""
    largest = float(np.linalg.eigvalsh(body.inertia)[-1])
    return (
        f"allowed: the largest principal moment of {body.name}, {largest:.4g} kg m^2, exceeds the sum of the other two "
        f"by {excess:.3g} ({excess / largest:.2g} of its value), which is impossible for a rigid body; at least one of "
        f"the three is wrong by {excess / 3.0:.2g} kg m^2 or more, and torques by that error times the acceleration"
    )


def _refusal(
    bodies: Sequence[Body], normals: Array | None, joints: Sequence[Joint], couplings: Sequence[Coupling]
) -> DescriptionError:
    """Build the error for the first body's tensor, with a remedy for all bodies.

    Args:
        normals: Known normals of the first body.
    """
    body, names = bodies[0], ", ".join(f'"{body.name}.{TRIANGLE}"' for body in bodies)
    moments = np.linalg.eigvalsh(body.inertia).tolist()
    excess = triangle_excess(body.inertia)
    what = f"principal moments {moments} kg m^2 violate the triangle inequality by {excess:.3g}"
    if normals is not None:
        axis = np.round(normals[0], 6) + 0.0
        remedy = f"it turns only about its axis {axis.tolist()}, so write only the moment about that axis"
    elif body.name in normals_of_planes(joints, couplings, MEANT):
        remedy = (
            "one moment is enough if the joint axes are parallel; these nearly are, so write their components in full"
        )
    else:
        remedy = (
            "check the tensor: no body of positive mass has such moments, and this body turns about more than one axis"
        )
    return DescriptionError(what, body.where, f"{remedy}, or accept the tensor: allow = [{names}]")
