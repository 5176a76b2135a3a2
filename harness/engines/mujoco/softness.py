"""How soft MuJoCo's equality constraints are, and the proximal refinement that takes the softness out."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import mujoco

from screwgauge.reference.rotations import Array

#: Passes end when none of the accelerations changed by more than this share of the largest, or after so many.
SAME, PASSES = 1e-13, 20
#: The solver's own error stays below the softness that is looked at.
EXACT = 1e-15
EQUALITY = int(mujoco.mjtDisableBit.mjDSBL_EQUALITY)
_VEL = int(mujoco.mjtStage.mjSTAGE_VEL)


@contextmanager
def heard() -> Iterator[list[str]]:
    """MuJoCo's warnings as a list: its own handler writes MUJOCO_LOG.TXT into the working directory."""
    warnings: list[str] = []
    mujoco.set_mju_user_warning(warnings.append)
    try:
        yield warnings
    finally:
        mujoco.set_mju_user_warning(None)


def harden(model: mujoco.MjModel, d: float, harder: float) -> None:
    """Makes the equality constraints as hard as they get, without springs that pull closing errors in.

    With solref (0, 0) the reference acceleration is that of the closed loop, -Jdot v: its own springs and dampers
    (100 per second by default) would make every motion stiff.
    """
    model.opt.disableflags &= ~EQUALITY
    model.opt.jacobian = mujoco.mjtJacobian.mjJAC_DENSE  # sparse ones are wrong in 4.0.0 (issue 3767)
    model.opt.tolerance = EXACT
    model.eq_solimp[:, :2] = d
    model.body_invweight0[:] /= harder
    model.eq_solref[:] = 0.0


def refine(
    model: mujoco.MjModel, data: mujoco.MjData, a: Array, passes: int, *, same: float = SAME, total: Array | None = None
) -> tuple[int, float]:
    """Proximal refinement: the last constraint force is applied from outside and the accelerations solved again.

    Args:
        a: Accelerations so far, and in the end the refined ones. Shape (n_v,).
        passes: At most so many.
        same: Share of the largest acceleration below which a change ends it; with 0 all passes are made.
        total: Constraint forces so far, to which those of the passes are added. Shape (n_row,).

    Returns:
        How many were made, and the largest change in the last one.
    """
    change = 0.0
    for made in range(1, passes + 1):
        data.qfrc_applied[:] += data.qfrc_constraint
        mujoco.mj_forwardSkip(model, data, _VEL, 1)
        before, change = change, float(abs(data.qacc - a).max())
        a[:] = data.qacc
        if total is not None:
            total += data.efc_force[: data.nefc]
        if same and (change <= same * float(abs(a).max()) or (made > 2 and not change < before)):
            return made, change
    return passes, change
