"""MuJoCo's equality constraints: hardened, softness removed, and joint equalities completed.

Softness is taken out by proximal refinement. Of the second derivative of a coupling ``q_i - p(q_j)`` the term
``-p'' v_j^2`` is added: MuJoCo has the like of it for connects and welds (from 3.7 on), but in 4.0.0 joint equalities
count as straight.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import mujoco
import numpy as np

from screwgauge.problem import InitialValue, Problem, States
from screwgauge.reference.couplings import Coupling, bind
from screwgauge.reference.rotations import Array

_KIND = int(mujoco.mjtConstraint.mjCNSTR_EQUALITY)


def select_curved(couplings: Sequence[Coupling]) -> list[Coupling]:
    """Select couplings with nonzero second derivative."""
    return [one for one in couplings if not one.function.linear]


def curvature(model: mujoco.MjModel, couplings: Sequence[Coupling]) -> Callable[[mujoco.MjData], None] | None:
    """Return a function that completes MuJoCo's reference accelerations by curved couplings; None without any.

    It is to be called after MuJoCo's velocity stage.
    """
    if not (some := select_curved(couplings)):
        return None
    rows = bind(some, [model.joint(j).name for j in range(model.njnt)])
    ids = [model.equality(one.name).id for one in some]

    def complete(data: mujoco.MjData) -> None:
        for number, own in zip(ids, rows.bias(data.qpos[None], data.qvel[None])[0], strict=True):
            data.efc_aref[np.flatnonzero((data.efc_type == _KIND) & (data.efc_id == number))] -= own

    return complete


def curvature_notes(couplings: Sequence[Coupling], problem: Problem, *, own_steps: bool) -> tuple[str, ...]:
    """Note couplings that MuJoCo linearises, if an answer depends on their curvature.

    Args:
        own_steps: Simulations are MuJoCo's own, of which nothing is made better.
    """
    names, task = ", ".join(one.name for one in select_curved(couplings)), problem.task
    raw = isinstance(task, States) and task.tau is not None
    if not names or not (raw or isinstance(task, InitialValue) or "tree_force_soft" in problem.wanted):
        return ()
    fate = "missing from" if raw or (own_steps and isinstance(task, InitialValue)) else "added to"
    return (f"MuJoCo takes joint equalities for straight lines; their curvature is {fate} what it says: {names}",)


#: The largest impedance d that MuJoCo takes: every pass divides the error by about d / (1 - d) = 1e4.
STIFFEST = 0.9999
#: Rows are harder by this than the largest impedance makes them: their regularisation is (1 - d) / d times the mean
#: inverse mass of the bodies (body_invweight0), which is divided by it. Next to singular poses the passes converge
#: slowly: A02 stops there with 1 (N = 2) or 10 (N = 40) and 20 passes, with 1000 no more than 8 are needed.
HARDER = 1000.0
#: Passes end when none of the accelerations changed by more than this share of the largest, or after so many.
SAME, PASSES = 1e-13, 20
#: The solver's own error stays below the softness that is looked at.
EXACT = 1e-15
DISABLED = int(mujoco.mjtDisableBit.mjDSBL_EQUALITY)
VELOCITY_STAGE = int(mujoco.mjtStage.mjSTAGE_VEL)


def harden(model: mujoco.MjModel) -> None:
    """Harden equality constraints to the limit, without springs against closing errors.

    With solref (0, 0) the reference acceleration is that of the closed loop, -Jdot v: its own springs and dampers
    (100 per second by default) would make every motion stiff.
    """
    model.opt.disableflags &= ~DISABLED
    model.opt.tolerance = EXACT
    model.eq_solimp[:, :2] = STIFFEST
    model.body_invweight0[:] /= HARDER
    if (model.eq_type == mujoco.mjtEq.mjEQ_JOINT).any():  # a screw of 10 mm lead is softer by 1e4 than a gear
        model.dof_invweight0[:] /= HARDER
    if (model.eq_type == mujoco.mjtEq.mjEQ_TENDON).any():
        model.tendon_invweight0[:] /= HARDER
    model.eq_solref[:] = 0.0


def refine(
    model: mujoco.MjModel, data: mujoco.MjData, a: Array, passes: int, *, same: float = SAME, total: Array | None = None
) -> tuple[int, float]:
    """Refine by proximal steps: apply the last constraint force from outside and solve accelerations again.

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
        data.qfrc_applied[:] += _closing_pull(model, data)
        mujoco.mj_forwardSkip(model, data, VELOCITY_STAGE, 1)
        before, change = change, float(abs(data.qacc - a).max())
        a[:] = data.qacc
        if total is not None:
            total += data.efc_force[: data.nefc]
        if same and (change <= same * float(abs(a).max()) or (made > 2 and not change < before)):
            return made, change
    return passes, change


def _closing_pull(model: mujoco.MjModel, data: mujoco.MjData) -> Array:
    """Forces of the equality constraints along the coordinates; their rows come first.

    Friction, limits and contacts of a file of the user's own close no loop: they stay as soft as MuJoCo makes them.
    """
    if data.ne == data.nefc:
        return np.asarray(data.qfrc_constraint)
    J = data.efc_J[: data.ne * model.nv].reshape(data.ne, model.nv)
    return np.asarray(J.T @ data.efc_force[: data.ne])
