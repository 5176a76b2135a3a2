"""Solves the inverse kinematics of U-P-S and U-P-U legs in closed form for a given pose of the output body."""

from __future__ import annotations

from collections.abc import Collection
from typing import Any

import numpy as np

from screwgauge.reference.equations.joint_types import Value, locate, locate_body
from screwgauge.reference.equations.kinematics import Coordinates, coordinates, joint_screws, joint_values, zeros
from screwgauge.reference.equations.ops import NUMPY, Ops
from screwgauge.reference.equations.screws import Array, dot, times, transpose
from screwgauge.reference.graph import Edge, Layout, serial_chains
from screwgauge.reference.mechanism import Joint

#: Largest distance from home that counts as zero: home is given to ten digits, and other branches are farther away.
HOME = 1e-8


def closed_form(lay: Layout, y: Array, ops: Ops, fixed: Collection[int] | None = None) -> Coordinates | None:
    """Return tree coordinates on the home branch if every leg, with its wrist cut, has a closed form, or else None.

    The joint of the independent coordinates places the output body; the remaining coordinates of that joint keep their
    home values. If a leg does not allow this, the loops stay open, and Newton's method must continue from the result.

    Args:
        y: Independent coordinates [rad or m]. Shape (..., k).
        fixed: Coordinates that never move. If given, the remaining coordinates of the output body's joint must be among
            them; the home assembly mode then ends only where a leg locks or has zero length.

    Returns:
        Coordinates of the tree; cut joints keep their home coordinates.
    """
    legs = _legs(lay)
    if legs is None:
        return None
    if fixed is not None and not {*lay.columns[legs[0].name]} - {*lay.mechanism.independent_columns} <= {*fixed}:
        return None
    at_home = _coordinates(lay, *legs, lay.mechanism.home[lay.mechanism.independent_columns], NUMPY)
    tree = lay.tree_columns
    close = max(HOME, 64 * float(np.finfo(lay.path.dtype).eps))  # float32 cannot resolve 1e-8
    if not np.abs(at_home.q - lay.mechanism.home)[tree].max() < close:
        return None
    return _coordinates(lay, *legs, y, ops)


def _legs(lay: Layout) -> tuple[Joint, list[list[Joint]]] | None:
    """Find the joint of the output body and the legs; return None unless each leg has a closed form."""
    mechanism = lay.mechanism
    chains = serial_chains(mechanism)
    drivers = [chain[0].joint for chain in chains if len(chain) == 1 and not chain[0].reverse]
    legs = [chain for chain in chains if len(chain) > 1]
    if mechanism.couplings or len(drivers) != 1 or len(legs) != len(chains) - 1:
        return None
    if sum(map(len, chains)) != len(mechanism.joints) or not all(map(_has_closed_form, legs)):
        return None
    chosen, wrists = {*mechanism.independent.values()}, {chain[-1].joint.name for chain in legs}
    if not chosen <= {*drivers[0].coordinates} or wrists != {joint.name for joint in lay.cuts}:
        return None
    return drivers[0], [[edge.joint for edge in chain] for chain in legs]


def _has_closed_form(chain: tuple[Edge, ...]) -> bool:
    """Return True for a U-P-U or U-P-S leg whose slide joins the centres, normal to both axes of the first U joint."""
    kinds = "".join(edge.joint.kind for edge in chain)
    if kinds not in ("UPU", "UPS") or any(edge.reverse for edge in chain):
        return False
    base, slide, wrist = (edge.joint for edge in chain)
    coincide = (base.child_frame, slide.parent_frame, slide.child_frame, wrist.parent_frame)
    normal = np.cross(base.axes[0], base.axes[1])
    return all(frame.is_identity for frame in coincide) and bool(
        np.abs(slide.axes[0] - normal).max() <= 64 * np.finfo(normal.dtype).eps
    )


def _coordinates(lay: Layout, driver: Joint, legs: list[list[Joint]], y: Array, ops: Ops) -> Coordinates:
    q = zeros(y, len(lay.mechanism.coordinates)) + lay.mechanism.home
    q[..., lay.mechanism.independent_columns] = y
    at = coordinates(q, ops)
    values = joint_values(driver.freedoms, lay.columns[driver.name], at)
    eye, origin = zeros(y, 3, 3) + np.eye(3), zeros(y, 3)
    _, R, p = joint_screws(driver, *locate(eye, origin, driver.parent_frame), values)
    platform = locate_body(R, p, driver.child_frame)
    for base, slide, wrist in legs:
        for c, (value, cosine) in zip(
            (*lay.columns[base.name], *lay.columns[slide.name]),
            _leg(base, locate(*platform, wrist.child_frame)[1], ops),
            strict=True,
        ):
            q[..., c] = value if cosine is None else ops.atan2(value, cosine)
            if cosine is not None:
                at.sine[..., c], at.cosine[..., c] = value, cosine
    return at


def _leg(base: Joint, centre: Array, ops: Ops) -> list[Value]:
    """Compute base angles and slide length of a leg whose wrist is at a given point, eqs. (19), (24). (..., 3)."""
    x, y = base.axes
    AC = times(transpose(base.parent_frame.R), centre - base.parent_frame.p)
    u, v, w = (dot(AC, axis) for axis in (x, y, np.cross(x, y)))
    across: Any = v * v + w * w
    h, length = ops.sqrt(across), ops.sqrt(u * u + across)
    over_h, over_length = 1.0 / h, 1.0 / length
    return [(-(v * over_h), w * over_h), (u * over_length, h * over_length), (length, None)]
