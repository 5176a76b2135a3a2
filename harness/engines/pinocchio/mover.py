"""Pinocchio's accelerations of a closed tree, one state at a time, as exact as it can make them."""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin

from screwgauge.engines.pinocchio.tree import ALIGNED, ANGULAR_FIRST, Constraints, PinocchioTree
from screwgauge.reference.errors import SingularPoseError
from screwgauge.reference.rotations import Array

#: Proximal regularisation [1/kg, like the inverse mass that it is added to], and iterations.
#: Measured on states of A02 (2 and 40), A03, A04 against the null space of the rows: 5 iterations leave 3e-14 of the
#: largest acceleration for any mu from 1e-6 to 1e-12, 2 leave 4e-7 at 1e-6, and 1e-14 gives NaN (A03). Close to a
#: singular pose a larger mu is slower, and a smaller one turns rounding into noise that the step size follows: over
#: nine tolerances of A02, 1e-6 kept the smallest errors and never stopped.
MU, ITERATIONS = 1e-6, 10
#: Where they leave a closing error of this share of the largest acceleration, next to a singular pose, more are made.
ENOUGH, MORE = 1e-10, 200
#: Closing accelerations may be wrong by this share of the largest acceleration.
UNSAFE = 1e-6


class PinocchioMover:
    """Accelerations of a closed tree. See `screwgauge.engines.tree.protocol.Mover`."""

    notes: tuple[str, ...] = ()

    def __init__(self, tree: PinocchioTree) -> None:
        self.tree, self.model = tree, tree.model
        self.kinematics, self.constraints = self.model.createData(), Constraints(tree)
        # accuracies 0: all iterations are made. What is called the absolute residual contains Jdot v
        self.settings = pin.ProximalSettings(0.0, 0.0, MU, ITERATIONS)
        self.more = pin.ProximalSettings(0.0, 0.0, MU, MORE)
        setting = f"constraintDynamics, mu {MU:g}, {ITERATIONS} iterations" if len(self.constraints) else "aba"
        self.setting = setting + (", couplings by unit forces" if tree.couplings else "")
        self.q = self.v = np.zeros(self.model.nv)
        self.stale = True

    def place(self, q: Array, v: Array) -> None:
        self.q, self.v, self.stale = q, v, True

    def body(self, index: int) -> tuple[Array, Array, Array]:
        if index == 0:
            return np.eye(3), np.zeros(3), np.zeros((6, self.model.nv))
        self._refresh()
        frame = self.tree.frames[index - 1]
        M = pin.updateFramePlacement(self.model, self.kinematics, frame)
        J = pin.getFrameJacobian(self.model, self.kinematics, frame, ALIGNED)
        return M.rotation, M.translation, J[ANGULAR_FIRST].reshape(6, -1)

    def _refresh(self) -> None:
        if self.stale:
            pin.computeJointJacobians(self.model, self.kinematics, self.q)
            self.stale = False

    def closure(self) -> tuple[Array, Array]:
        couplings = self.constraints.couplings
        if not len(self.constraints) and not len(couplings):
            return np.zeros(0), np.zeros((0, self.model.nv))
        self._refresh()
        gaps, J = [], self.constraints.jacobian(self.kinematics, self.q)
        for model, data in zip(self.constraints.models, self.constraints.datas, strict=True):
            apart = data.c1Mc2
            gaps.append(apart.translation if model.type == pin.ContactType.CONTACT_3D else pin.log6(apart).vector)
        gaps.append(couplings.residuals(self.q[None])[0])
        return np.concatenate(gaps), J

    def accelerate(self, tau: Array) -> Array:
        a, left, size = self._solve(tau, self.settings)
        if left > ENOUGH * size:
            a, left, size = self._solve(tau, self.more)
        # written so that NaN is refused
        if not left <= UNSAFE * size < np.inf:
            raise SingularPoseError(
                f"Pinocchio's accelerations are not safe (largest {size:.3g}, closing error {left:.3g} after "
                f"{MORE} proximal iterations)",
                f"{self.tree.engine}, q = {np.array2string(self.q[:8], precision=4)}",
                "step over the pose, or check masses and loops of the URDF",
            )
        return a

    def _solve(self, tau: Array, settings: Any) -> tuple[Array, float, float]:
        """Accelerations, what those of loops are off by (the last change of the multipliers times mu) or those of
        couplings, and the largest acceleration, 1 at least."""
        a = self.constraints.accelerate(self.q, self.v, tau, settings)
        left = settings.mu * settings.relative_residual if len(self.constraints) else 0.0
        if len(self.constraints.couplings):
            left = max(left, float(np.abs(self.constraints.uncoupled(self.q, self.v, a)).max()))
        return a, left, max(float(np.abs(a).max()), 1.0)
