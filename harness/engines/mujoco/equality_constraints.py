"""Correct MuJoCo's equality constraints: harden them, remove their softness, and complete joint equalities.

Proximal refinement removes softness. The second derivative of a coupling ``q_i - p(q_j)`` is completed by the term
``-p'' v_j^2``. MuJoCo has included the corresponding term of connects and welds since 3.7, but still linearises joint
equalities in 4.0.0.
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
    """Select the couplings that are not linear."""
    return [one for one in couplings if not one.function.linear]


def curvature(model: mujoco.MjModel, couplings: Sequence[Coupling]) -> Callable[[mujoco.MjData], None] | None:
    """Return a function that adds the curvature of couplings to MuJoCo's reference accelerations.

    Call the function after MuJoCo's velocity stage. The result is None if all couplings are linear.
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
    """Return a note on couplings that MuJoCo linearises, if the solution depends on their curvature.

    Args:
        own_steps: True if simulations use MuJoCo's own stepper, which makes no corrections.
    """
    names, task = ", ".join(one.name for one in select_curved(couplings)), problem.task
    raw = isinstance(task, States) and task.tau is not None
    if not names or not (raw or isinstance(task, InitialValue) or "tree_force_soft" in problem.wanted):
        return ()
    fate = "missing from" if raw or (own_steps and isinstance(task, InitialValue)) else "added to"
    return (f"MuJoCo linearises joint equalities; their curvature is {fate} its results: {names}",)


#: Largest impedance d that MuJoCo accepts: every pass divides the error by about d / (1 - d) = 1e4.
STIFFEST = 0.9999
#: Factor by which constraint rows are made harder than the largest impedance allows. Their regularisation is
#: (1 - d) / d times the mean inverse mass of the bodies (body_invweight0), which is divided by this factor. Near
#: singular poses the passes converge slowly: with 20 passes, simulations of A02 stop there for a factor of 1 (N = 2)
#: or 10 (N = 40); with a factor of 1000, at most 8 passes are needed.
HARDER = 1000.0
#: Change, relative to the largest acceleration, below which passes end; and largest number of passes.
SAME, PASSES = 1e-13, 20
#: Solver tolerance that keeps the solver's own error below the examined softness.
EXACT = 1e-15
DISABLED = int(mujoco.mjtDisableBit.mjDSBL_EQUALITY)
VELOCITY_STAGE = int(mujoco.mjtStage.mjSTAGE_VEL)


def harden(model: mujoco.MjModel) -> None:
    """Make equality constraints as hard as possible, and remove their springs and dampers.

    With solref (0, 0) the reference acceleration equals the acceleration of the closed loop, -Jdot v. MuJoCo's springs
    and dampers (100 per second by default) would make every motion stiff.
    """
    model.opt.disableflags &= ~DISABLED
    model.opt.tolerance = EXACT
    model.eq_solimp[:, :2] = STIFFEST
    model.body_invweight0[:] /= HARDER
    if (model.eq_type == mujoco.mjtEq.mjEQ_JOINT).any():  # a screw of 10 mm lead is 1e4 times softer than a gear
        model.dof_invweight0[:] /= HARDER
    if (model.eq_type == mujoco.mjtEq.mjEQ_TENDON).any():
        model.tendon_invweight0[:] /= HARDER
    model.eq_solref[:] = 0.0


def refine(
    model: mujoco.MjModel, data: mujoco.MjData, a: Array, passes: int, *, same: float = SAME, total: Array | None = None
) -> tuple[int, float]:
    """Refine accelerations by proximal steps: apply the last constraint force externally and solve again.

    Args:
        a: Accelerations, refined in place. Shape (n_v,).
        passes: Largest number of passes.
        same: The passes end once the change is below this fraction of the largest acceleration; if 0, all `passes`
            are made.
        total: Constraint forces, to which the force of each pass is added. Shape (n_row,).

    Returns:
        The number of passes, and the largest change in the last pass.
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
    """Return the forces of the equality constraints along the coordinates; equality rows precede all others.

    Friction, limits and contacts of a user's file do not close loops and stay as soft as MuJoCo makes them.
    """
    if data.ne == data.nefc:
        return np.asarray(data.qfrc_constraint)
    J = data.efc_J[: data.ne * model.nv].reshape(data.ne, model.nv)
    return np.asarray(J.T @ data.efc_force[: data.ne])
