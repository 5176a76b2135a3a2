"""Equalities of MuJoCo's tendons that are couplings of two joints, in coordinates as the file counts them."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.polynomial import Polynomial

from screwgauge.models.mjcf import POWERS
from screwgauge.models.readings.reading import CouplingReading
from screwgauge.reference.rotations import Array

#: What a tendon does besides coupling joints, as MuJoCo keeps it.
_PULLS = ("stiffness", "damping", "frictionloss", "limited", "armature", "actfrclimited")


def coupling_of(model: Any, one: int, other: int, powers: Array) -> CouplingReading:
    """``y - y0 = P(x - x0)`` in powers of x itself: y of joint `one`; joint `other`, if it is negative, is none."""
    y0, x0 = (float(model.qpos0[model.jnt_qposadr[joint]]) if joint >= 0 else 0.0 for joint in (one, other))
    powers = np.array(Polynomial(powers)(Polynomial([-x0, 1.0])).coef if x0 else powers, dtype=float)
    powers[0] += y0
    return CouplingReading(model.joint(one).name, model.joint(other).name if other >= 0 else "", powers)


def tendon_equality(model: Any, i: int) -> CouplingReading | None:
    """``L1 - L10 = P(L2 - L20)`` of lengths that are sums of coordinates, if two joints are all that is left in it."""
    first, second = (_shares(model, tendon) for tendon in (model.eq_obj1id[i], model.eq_obj2id[i]))
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


def _shares(model: Any, tendon: int) -> dict[int, float] | None:
    """Joint -> what it adds to the length of a fixed tendon, nothing without one; None of another kind of tendon."""
    import mujoco

    at = range(model.tendon_adr[tendon], model.tendon_adr[tendon] + model.tendon_num[tendon]) if tendon >= 0 else ()
    if any(model.wrap_type[k] != int(mujoco.mjtWrap.mjWRAP_JOINT) for k in at):
        return None
    return {int(model.wrap_objid[k]): float(model.wrap_prm[k]) for k in at}


def pulling(model: Any, i: int) -> Iterator[str]:
    """Tendons of an equality that do more than to couple joints, said in words."""
    for tendon in (model.eq_obj1id[i], model.eq_obj2id[i]):
        if tendon >= 0 and any(getattr(model, f"tendon_{what}", np.zeros(model.ntendon))[tendon] for what in _PULLS):
            yield f"forces and range of tendon {model.tendon(tendon).name}"
