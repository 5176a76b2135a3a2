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


def said(couplings: Sequence[Coupling], *, completed: bool) -> tuple[str, ...]:
    """A sentence on couplings that MuJoCo takes for straight, and on what became of that."""
    names = ", ".join(one.name for one in curved(couplings))
    fate = "added to what it says" if completed else "missing from what it says"
    return (f"MuJoCo takes joint equalities for straight lines; their curvature is {fate}: {names}",) if names else ()
