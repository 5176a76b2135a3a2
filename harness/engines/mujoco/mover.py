"""MuJoCo's accelerations of a closed tree, one state at a time, made as exact as it can: `mj_forward`, refined."""

from __future__ import annotations

import copy

import mujoco
import numpy as np

from screwgauge.engines.mujoco.curvature import curvature
from screwgauge.engines.mujoco.settings import HARDER, PASSES, STIFFEST, harden, refine
from screwgauge.engines.mujoco.tree import MujocoTree
from screwgauge.reference.errors import SingularPoseError
from screwgauge.reference.rotations import Array

#: A larger change in the last pass is not safe.
UNSAFE = 1e-6
_VEL = int(mujoco.mjtStage.mjSTAGE_VEL)


class MujocoMover:
    """Accelerations of a closed tree. See `screwgauge.engines.tree.protocol.Mover`."""

    def __init__(self, tree: MujocoTree) -> None:
        self.tree = tree
        self.model = copy.deepcopy(tree.model)  # the tree switches its equality constraints off
        harden(self.model)
        self.data = mujoco.MjData(self.model)
        self.passes = PASSES if self.model.neq else 0
        self.curvature = curvature(self.model, tree.couplings)
        hard = f"solimp {STIFFEST:g}, body_invweight0 / {HARDER:g}, at most {PASSES} refinements"
        self.setting = f"mj_forward, {hard}" if self.passes else "mj_forward"
        self.made = self.most = self.calls = 0

    def place(self, q: Array, v: Array) -> None:
        self.data.qpos[:], self.data.qvel[:] = q, v
        mujoco.mj_fwdPosition(self.model, self.data)
        mujoco.mj_fwdVelocity(self.model, self.data)
        self.curvature.complete(self.data)

    def body(self, index: int) -> tuple[Array, Array, Array]:
        J = np.zeros((6, self.model.nv))
        if index == 0:
            return np.eye(3), np.zeros(3), J
        i = self.tree.ids[index - 1]
        mujoco.mj_jacBody(self.model, self.data, J[3:], J[:3], i)
        return self.data.xmat[i].reshape(3, 3), self.data.xpos[i], J

    def closure(self) -> tuple[Array, Array]:
        rows, n_v = self.data.ne, self.model.nv  # limits and contacts of a file of the user's own close nothing
        return self.data.efc_pos[:rows].copy(), self.data.efc_J[: rows * n_v].reshape(rows, n_v).copy()

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

    @property
    def notes(self) -> tuple[str, ...]:
        said = f"{self.made / max(self.calls, 1):.1f} refinements on average, at most {self.most}"
        return (said,) if self.passes else ()
