"""A mechanism in another floating-point precision, to see what rounding alone does to the solver."""

from __future__ import annotations

from copy import copy
from dataclasses import replace
from typing import Any, TypeVar

import numpy as np
from numpy.typing import DTypeLike

from screwgauge.reference.chains import closed_form
from screwgauge.reference.dynamics import force_matrix, joint_reactions
from screwgauge.reference.mechanism import Body, Frame, Joint, Mechanism
from screwgauge.reference.pose import Layout, centres_of_mass, layout, pose
from screwgauge.reference.rotations import Array

T = TypeVar("T", Body, Frame, Joint)


def in_precision(mechanism: Mechanism, dtype: DTypeLike) -> Mechanism:
    """The mechanism with every array rounded to `dtype`; the solver then computes in it throughout.

    The checks of the description are not repeated: rounding may tilt two axes by more than they allow.
    """
    bodies = tuple(_rounded(body, dtype, "com", "inertia") for body in mechanism.bodies)
    joints = tuple(_joint(joint, dtype) for joint in mechanism.joints)
    axial = None if mechanism.axial is None else (mechanism.axial[0], mechanism.axial[1].astype(dtype))
    return replace(mechanism, bodies=bodies, joints=joints, axial=axial)


def wide_force_matrix(lay: Layout, y: Array) -> Array | None:
    """The matrix c of eq. (57) in numpy's longest format, at poses known in closed form.

    Args:
        y: Independent coordinates [rad or m]. Shape (n, k).

    Returns:
        Shape (n, 6 n_body, n_reaction + n_actuator). None where that format is no wider than a double, or the closed
        form leaves the loops open.
    """
    wider = np.finfo(np.longdouble)
    if not wider.eps < np.finfo(float).eps:
        return None
    lay = layout(in_precision(lay.mechanism, np.longdouble))
    q = closed_form(lay, y.astype(np.longdouble))
    if q is None:
        return None
    at = pose(lay, q)
    if not np.abs(at.residual).max(initial=0.0) < 64 * wider.eps:
        return None
    return force_matrix(lay, at, centres_of_mass(lay, at), joint_reactions(lay, at))


def _joint(joint: Joint, dtype: DTypeLike) -> Joint:
    frames = {name: _rounded(getattr(joint, name), dtype, "p", "R") for name in ("parent_frame", "child_frame")}
    return _with(_rounded(joint, dtype, "axes", "home", "limits"), **frames)


def _rounded(item: T, dtype: DTypeLike, *names: str) -> T:
    return _with(item, **{name: getattr(item, name).astype(dtype) for name in names})


def _with(item: T, **changes: Any) -> T:
    """A copy with other fields, made without the checks of its class."""
    changed = copy(item)
    for name, value in changes.items():
        object.__setattr__(changed, name, value)
    return changed
