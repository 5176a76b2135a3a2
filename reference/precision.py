"""Converts mechanisms to different floating-point precisions."""

from __future__ import annotations

from copy import copy
from dataclasses import fields, replace
from typing import TYPE_CHECKING, TypeVar

import numpy as np
from numpy.typing import DTypeLike

from screwgauge.reference.mechanism import Frame, Mechanism

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

T = TypeVar("T", bound="DataclassInstance")


def in_precision(mechanism: Mechanism, dtype: DTypeLike) -> Mechanism:
    """Round every array of a mechanism to `dtype`, so that the solver computes in this precision.

    The checks of the description are not repeated, because rounding may tilt axes by more than the checks allow.
    """
    bodies = tuple(round_to(body, dtype) for body in mechanism.bodies)
    joints = tuple(round_to(joint, dtype) for joint in mechanism.joints)
    axial = None if mechanism.axial is None else (mechanism.axial[0], mechanism.axial[1].astype(dtype))
    return replace(mechanism, bodies=bodies, joints=joints, axial=axial)


def round_to(item: T, dtype: DTypeLike) -> T:
    """Round the arrays of a dataclass and its frames to `dtype`, without the checks of the class."""
    changed = copy(item)
    for one in fields(item):
        value = getattr(item, one.name)
        if isinstance(value, np.ndarray):
            object.__setattr__(changed, one.name, value.astype(dtype))
        elif isinstance(value, Frame):
            object.__setattr__(changed, one.name, round_to(value, dtype))
    return changed
