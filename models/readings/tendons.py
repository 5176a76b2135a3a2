"""Equalities of MuJoCo's tendons that are couplings of two joints, in coordinates as the file counts them."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.polynomial import Polynomial

from screwgauge.models.mjcf import POWERS
from screwgauge.models.readings.compiled import shares
from screwgauge.models.readings.reading import CouplingReading
from screwgauge.reference.rotations import Array


def coupling_of(model: Any, one: int, other: int, powers: Array) -> CouplingReading:
    """``y - y0 = P(x - x0)`` in powers of x itself: y of joint `one`; joint `other`, if it is negative, is none."""
    y0, x0 = (float(model.qpos0[model.jnt_qposadr[joint]]) if joint >= 0 else 0.0 for joint in (one, other))
    powers = np.array(Polynomial(powers)(Polynomial([-x0, 1.0])).coef if x0 else powers, dtype=float)
    powers[0] += y0
    return CouplingReading(model.joint(one).name, model.joint(other).name if other >= 0 else "", powers)


def tendon_equality(model: Any, i: int) -> CouplingReading | None:
    """``L1 - L10 = P(L2 - L20)`` of lengths that are sums of coordinates, if two joints are all that is left in it."""
    first, second = (shares(model, tendon) for tendon in (model.eq_obj1id[i], model.eq_obj2id[i]))
    p = model.eq_data[i, : POWERS if model.eq_obj2id[i] >= 0 else 1]
    if first is None or second is None:
        return None
    if not p[2:].any():
        slope = float(p[1]) if len(p) > 1 else 0.0
        both = {joint: first.get(joint, 0.0) - slope * second.get(joint, 0.0) for joint in {**first, **second}}
        moved = [joint for joint, share in both.items() if share]
        if len(moved) == 2:
            x, y = moved
            return coupling_of(model, y, x, np.array([p[0], -both[x]]) / both[y])
    elif len(first) == len(second) == 1 and {*first} != {*second}:
        ((y, by),), ((x, per),) = first.items(), second.items()
        return coupling_of(model, y, x, p * per ** np.arange(len(p)) / by)
    return None
