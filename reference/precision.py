"""A mechanism in another floating-point precision, to see what rounding alone does to the solver."""

from __future__ import annotations

from collections.abc import Mapping
from copy import copy
from dataclasses import replace
from typing import Any, TypeVar

import numpy as np
from numpy.typing import DTypeLike

from screwgauge.reference.mechanism import Body, Frame, Joint, Mechanism

T = TypeVar("T", Body, Frame, Joint)


def in_precision(mechanism: Mechanism, dtype: DTypeLike) -> Mechanism:
    """The mechanism with every array rounded to `dtype`; the solver then computes in it throughout.

    The checks of the description are not repeated: rounding may tilt two axes by more than they allow.
    """
    bodies = tuple(
        _with(body, com=body.com.astype(dtype), inertia=body.inertia.astype(dtype))
        for body in mechanism.bodies
    )
    joints = tuple(_joint(joint, dtype) for joint in mechanism.joints)
    axial = None if mechanism.axial is None else (mechanism.axial[0], mechanism.axial[1].astype(dtype))
    return replace(mechanism, bodies=bodies, joints=joints, axial=axial)


def _joint(joint: Joint, dtype: DTypeLike) -> Joint:
    frames = {
        name: _with(frame, p=frame.p.astype(dtype), R=frame.R.astype(dtype))
        for name, frame in (("parent_frame", joint.parent_frame), ("child_frame", joint.child_frame))
    }
    arrays = {name: np.asarray(getattr(joint, name), dtype=dtype) for name in ("axes", "home", "limits")}
    return _with(joint, **arrays, **frames)


def _with(item: T, **changes: Any) -> T:
    """A copy with other fields, made without the checks of its class."""
    found = copy(item)
    fields: Mapping[str, Any] = changes
    for name, value in fields.items():
        object.__setattr__(found, name, value)
    return found
