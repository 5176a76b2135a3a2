"""What MuJoCo's joint equalities leave out: of the second derivative of ``q_i - p(q_j)`` the term ``-p'' v_j^2``.

MuJoCo has the like of it for connects and welds (from 3.7 on), but in 4.0.0 joint equalities count as straight.
"""

from __future__ import annotations

from collections.abc import Sequence

import mujoco
import numpy as np

from screwgauge.reference.couplings import Coupling, bind

_EQUALITY = int(mujoco.mjtConstraint.mjCNSTR_EQUALITY)


def curved(couplings: Sequence[Coupling]) -> list[Coupling]:
    """Those for which it is not zero."""
    return [one for one in couplings if one.polynomial[2:].any()]


def complete(model: mujoco.MjModel, data: mujoco.MjData, couplings: Sequence[Coupling]) -> None:
    """Adds the term to the reference accelerations, after MuJoCo's velocity stage has made them.

    Args:
        couplings: Those that are `curved`.
    """
    names = [model.joint(j).name for j in range(model.njnt)]
    bias = bind(couplings, names).bias(data.qpos[None], data.qvel[None])[0]
    for coupling, own in zip(couplings, bias, strict=True):
        rows = (data.efc_type == _EQUALITY) & (data.efc_id == model.equality(coupling.name).id)
        data.efc_aref[np.flatnonzero(rows)] -= own


def left_out(couplings: Sequence[Coupling]) -> tuple[str, ...]:
    """A sentence on couplings of which MuJoCo's own steps and raw accelerations lack the term."""
    names = ", ".join(one.name for one in curved(couplings))
    return (f"MuJoCo leaves the curvature of its joint equalities out of its accelerations: {names}",) if names else ()
