"""MuJoCo driven forward: `mj_forward` with proximal refinement on an MJCF, integrated by scipy's methods."""

from __future__ import annotations

import copy
from dataclasses import replace

import mujoco
import numpy as np

from screwgauge.engines.mujoco.tree import MujocoTree
from screwgauge.engines.tree.integrate import integrate_tree
from screwgauge.models.loops import LoopsFile
from screwgauge.problem import ForwardProblem
from screwgauge.reference.errors import SingularPoseError
from screwgauge.reference.rotations import Array
from screwgauge.solution import ForwardSolution

#: The largest impedance d that MuJoCo takes: every pass divides the error by about d / (1 - d) = 1e4.
IMPEDANCE = 0.9999
#: Rows are harder by this than the largest impedance makes them: their regularisation is (1 - d) / d times the mean
#: inverse mass of the bodies (body_invweight0), which is divided by it. Next to singular poses the passes converge
#: slowly: A02 stops there with 1 (N = 2) or 10 (N = 40) and 20 passes, with 1000 no more than 8 are needed.
HARDER = 1000.0
#: Passes end when none of the accelerations changed by more than this share of the largest, or after so many.
SAME, PASSES = 1e-13, 20
#: A larger change in the last pass is not safe.
UNSAFE = 1e-6
_EQUALITY = int(mujoco.mjtDisableBit.mjDSBL_EQUALITY)
_VEL = int(mujoco.mjtStage.mjSTAGE_VEL)


def integrate(problem: ForwardProblem) -> ForwardSolution:
    """Integrates a motion with MuJoCo's refined accelerations.

    Raises:
        ScrewgaugeError: A model, start, method or force that cannot be, or a start of unsafe accelerations.
    """
    warnings: list[str] = []
    # MuJoCo's own handler writes MUJOCO_LOG.TXT into the working directory
    mujoco.set_mju_user_warning(warnings.append)
    try:
        found = integrate_tree(problem, lambda file: make(problem, file))
    finally:
        mujoco.set_mju_user_warning(None)
    return replace(found, notes=(*found.notes, *(f"MuJoCo warns: {text}" for text in dict.fromkeys(warnings))))


def make(problem: ForwardProblem, file: LoopsFile) -> MujocoMover:
    """The mover for a problem."""
    return MujocoMover(MujocoTree(problem.model, file, problem.gravity))


class MujocoMover:
    """Accelerations of a closed tree. See `screwgauge.engines.tree.integrate.Mover`."""

    def __init__(self, tree: MujocoTree, d: float = IMPEDANCE, passes: int = PASSES, harder: float = HARDER) -> None:
        self._tree = tree
        self.model = copy.deepcopy(tree.model)  # the tree switches its equality constraints off
        harden(self.model, d, harder)
        self.data = mujoco.MjData(self.model)
        self.passes = passes if self.model.neq else 0
        hard = f"solimp {d:g}, body_invweight0 / {harder:g}, at most {passes} refinements"
        self.setting = f"mj_forward, {hard}" if self.passes else "mj_forward"
        self.made = self.most = self.calls = 0

    @property
    def tree(self) -> MujocoTree:
        return self._tree

    def place(self, q: Array, v: Array) -> None:
        self.data.qpos[:], self.data.qvel[:] = q, v
        mujoco.mj_fwdPosition(self.model, self.data)
        mujoco.mj_fwdVelocity(self.model, self.data)

    def body(self, index: int) -> tuple[Array, Array, Array]:
        J = np.zeros((6, self.model.nv))
        if index == 0:
            return np.eye(3), np.zeros(3), J
        i = self.tree.ids[index - 1]
        mujoco.mj_jacBody(self.model, self.data, J[3:], J[:3], i)
        return self.data.xmat[i].reshape(3, 3), self.data.xpos[i], J

    def closure(self) -> tuple[Array, Array]:
        rows = self.data.nefc
        return self.data.efc_pos[:rows].copy(), self.data.efc_J[: rows * self.model.nv].reshape(
            rows, self.model.nv
        ).copy()

    def accelerate(self, tau: Array) -> Array:
        model, data = self.model, self.data
        data.qfrc_applied[:] = tau
        mujoco.mj_forwardSkip(model, data, _VEL, 1)
        a: Array = data.qacc.copy()
        made, change = refine(model, data, a, self.passes)
        self.calls, self.made, self.most = self.calls + 1, self.made + made, max(self.most, made)
        size = float(np.abs(a).max())
        # written so that NaN is refused
        if not change <= UNSAFE * max(size, 1.0) < np.inf:
            raise SingularPoseError(
                f"MuJoCo's accelerations are not safe (largest {size:.3g}, changed by {change:.3g} in "
                f"refinement {made})",
                f"{self.tree.engine}, q = {np.array2string(data.qpos[:8], precision=4)}",
                "step over the pose, or check masses and loops of the MJCF",
            )
        return a

    def notes(self) -> tuple[str, ...]:
        if not self.passes:
            return ()
        return (f"{self.made / max(self.calls, 1):.1f} refinements on average, at most {self.most}",)


def harden(model: mujoco.MjModel, d: float, harder: float) -> None:
    """Makes the equality constraints as hard as they get, without springs that pull closing errors in.

    With solref (0, 0) the reference acceleration is that of the closed loop, -Jdot v: its own springs and dampers
    (100 per second by default) would make every motion stiff.
    """
    model.opt.disableflags &= ~_EQUALITY
    model.opt.jacobian = mujoco.mjtJacobian.mjJAC_DENSE  # sparse ones are wrong in 4.0.0 (issue 3767)
    model.opt.tolerance = 1e-15
    model.eq_solimp[:, :2] = d
    model.body_invweight0[:] /= harder
    model.eq_solref[:] = 0.0


def refine(model: mujoco.MjModel, data: mujoco.MjData, a: Array, passes: int) -> tuple[int, float]:
    """Proximal refinement: the last constraint force is applied from outside and the accelerations solved again.

    Args:
        a: Accelerations so far, and in the end the refined ones. Shape (n_v,).
        passes: At most so many.

    Returns:
        How many were made, and the largest change in the last one.
    """
    change = 0.0
    for made in range(1, passes + 1):
        data.qfrc_applied[:] += data.qfrc_constraint
        mujoco.mj_forwardSkip(model, data, _VEL, 1)
        before, change = change, float(np.abs(data.qacc - a).max())
        a[:] = data.qacc
        if change <= SAME * float(np.abs(a).max()) or (made > 2 and not change < before):
            return made, change
    return passes, change
