"""A mechanism in another floating-point precision, to see what rounding alone does to the solver."""

from __future__ import annotations

from copy import copy
from dataclasses import fields, replace
from typing import TYPE_CHECKING, TypeVar

import numpy as np
from numpy.typing import DTypeLike

from screwgauge.reference.dynamics import force_matrix, joint_reactions
from screwgauge.reference.kinematics import closed_form
from screwgauge.reference.layout import Layout, layout
from screwgauge.reference.mechanism import Frame, Mechanism
from screwgauge.reference.pose import centres_of_mass, pose
from screwgauge.reference.rotations import Array

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

T = TypeVar("T", bound="DataclassInstance")


def in_precision(mechanism: Mechanism, dtype: DTypeLike) -> Mechanism:
    """The mechanism with every array rounded to `dtype`; the solver then computes in it throughout.

    The checks of the description are not repeated: rounding may tilt two axes by more than they allow.
    """
    bodies = tuple(rounded(body, dtype) for body in mechanism.bodies)
    joints = tuple(rounded(joint, dtype) for joint in mechanism.joints)
    axial = None if mechanism.axial is None else (mechanism.axial[0], mechanism.axial[1].astype(dtype))
    return replace(mechanism, bodies=bodies, joints=joints, axial=axial)


def rounded(item: T, dtype: DTypeLike) -> T:
    """A dataclass with its arrays, those of its frames too, rounded to `dtype`; checks of its class are not made."""
    changed = copy(item)
    for one in fields(item):
        value = getattr(item, one.name)
        if isinstance(value, np.ndarray):
            object.__setattr__(changed, one.name, value.astype(dtype))
        elif isinstance(value, Frame):
            object.__setattr__(changed, one.name, rounded(value, dtype))
    return changed


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
