"""The engines `pinocchio` and `pinocchio-full` run Pinocchio on a URDF with its loops file."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pinocchio as pin

from screwgauge.engines.pinocchio.tree import ALIGNED, ANGULAR_FIRST, Constraints, PinocchioTree
from screwgauge.engines.tree.applied_forces import spring_pull
from screwgauge.engines.tree.closed_tree import close_tree
from screwgauge.engines.tree.model import TreeModel, loops_file
from screwgauge.engines.tree.protocol import INTEGRATORS, Accelerations, TreeDynamics
from screwgauge.problem import ModelFiles
from screwgauge.reference import linear
from screwgauge.reference.applied import JointSpring
from screwgauge.reference.errors import DescriptionError, SingularPoseError, check_choice
from screwgauge.reference.rotations import Array
from screwgauge.solution import Stopwatch

#: Proximal regularisation mu [1/kg, like the inverse mass to which it is added], and number of iterations.
#: On states of A02 (2 and 40), A03 and A04, compared with solutions in the null space of the rows, 5 iterations leave
#: errors of 3e-14 of the largest acceleration for any mu from 1e-6 to 1e-12, 2 iterations leave 4e-7 for mu = 1e-6, and
#: mu = 1e-14 yields NaN (A03). Close to a singular pose, a larger mu slows the convergence, and a smaller mu amplifies
#: rounding to noise that shortens the steps. In tests with nine tolerances on A02, mu = 1e-6 had the smallest errors,
#: and no integration stopped early.
MU, ITERATIONS = 1e-6, 10
#: Closing error, as a fraction of the largest acceleration, above which `MORE` iterations are made, which happens near
#: singular poses.
ENOUGH, MORE = 1e-10, 200
#: Allowed error of closing accelerations as a fraction of the largest acceleration.
UNSAFE = 1e-6


class PinocchioMover:
    """Mover that calls `constraintDynamics` or `aba`, see `screwgauge.engines.tree.protocol.Mover`."""

    notes: tuple[str, ...] = ()

    def __init__(self, tree: PinocchioTree) -> None:
        self.tree, self.model = tree, tree.model
        self.kinematics, self.constraints = self.model.createData(), Constraints(tree)
        # with zero accuracies, all iterations are made; Pinocchio's absolute residual includes Jdot v
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
                f"Pinocchio's accelerations are unreliable: the largest is {size:.3g}, and their closing error is "
                f"{left:.3g} after {MORE} proximal iterations",
                f"{self.tree.engine}, q = {np.array2string(self.q[:8], precision=4)}",
                "step over the pose, or check the masses and loops of the URDF",
            )
        return a

    def _solve(self, tau: Array, settings: Any) -> tuple[Array, float, float]:
        """Return accelerations, the largest residual of loops or couplings, and the largest acceleration (at least 1).

        The residual of the loops is mu times the last change in the multipliers.
        """
        a = self.constraints.accelerate(self.q, self.v, tau, settings)
        left = settings.mu * settings.relative_residual if len(self.constraints) else 0.0
        if len(self.constraints.couplings):
            left = max(left, float(np.abs(self.constraints.coupling_residual(self.q, self.v, a)).max()))
        return a, left, max(float(np.abs(a).max()), 1.0)


@dataclass(frozen=True, slots=True)
class PinocchioSettings:
    """Settings for accelerations and steps.

    Attributes:
        mu, iterations: Parameters of `constraintDynamics` for given states; None for Pinocchio's defaults.
        gains: Baumgarte gains of position and velocity for given states.
        frames: Close each loop with a 6D contact between its two frames for given states.
        examine: Examine the conditioning of given states, and the error that Pinocchio reports.
        integrator, dt: One of `INTEGRATORS` with its step [s]; the state is projected onto the loops after every step.
            `dt` is None for SciPy's methods.
    """

    mu: float | None = MU
    iterations: int | None = ITERATIONS
    gains: tuple[float, float] | None = None
    frames: bool = False
    examine: bool = False
    integrator: str = "Euler"
    dt: float | None = None

    def __post_init__(self) -> None:
        check_choice("integrator", [self.integrator], INTEGRATORS, "stepper of pinocchio")
        if self.dt is not None and not 0.0 < self.dt < np.inf:
            raise DescriptionError(f"the step is {self.dt:g} s", "stepper of pinocchio", "use a positive number")

    def proximal(self) -> Any:
        """Convert to Pinocchio's settings; with zero accuracies, Pinocchio makes all iterations."""
        if self.mu is None or self.iterations is None:
            return pin.ProximalSettings()
        return pin.ProximalSettings(0.0, 0.0, self.mu, self.iterations)


#: Settings of `load`.
Settings = PinocchioSettings


def load(files: ModelFiles, **settings: Any) -> TreeModel:
    """Load a URDF with its loops file; see `PinocchioSettings`."""
    file = loops_file(files)
    tree = PinocchioTree(files.model, file)
    return TreeModel(close_tree(tree, file), PinocchioDynamics(tree, PinocchioSettings(**settings)))


class PinocchioDynamics(TreeDynamics):
    """Dynamics of a URDF, see `screwgauge.engines.tree.protocol.TreeDynamics`."""

    def __init__(self, tree: PinocchioTree, settings: PinocchioSettings) -> None:
        self.tree, self.settings = tree, settings
        self.integrator, self.dt = settings.integrator, settings.dt
        self.constraints = Constraints(tree, frames=settings.frames, gains=settings.gains)
        proximal = settings.proximal()
        self.setting = f"constraintDynamics, mu {proximal.mu:g}, {proximal.max_iter} iterations"

    def mover(self) -> PinocchioMover:
        return PinocchioMover(self.tree)

    def accelerate(self, q: Array, v: Array, tau: Array, springs: Sequence[JointSpring]) -> Accelerations:
        tau = sum((spring_pull(spring, self.tree, q, v) for spring in springs), tau)
        proximal, a, change = self.settings.proximal(), np.empty_like(q), 0.0
        clock = Stopwatch()
        for i in range(len(q)):
            a[i] = self.constraints.accelerate(q[i], v[i], tau[i], proximal)
            change = max(change, proximal.relative_residual)
        cost = clock.cost(evaluations=len(q))
        if not self.settings.examine:
            return Accelerations(a, cost)
        condition, lift, rank = self._examine(q, v, tau, proximal.mu)
        # the error of the closing rows is exactly mu times the last change in the multipliers
        tolerances = {"joint_acceleration": proximal.mu * change * lift}
        return Accelerations(a, cost, condition, tolerances, (f"rank leaves {q.shape[1] - rank} freedoms",))

    def _examine(self, q: Array, v: Array, tau: Array, mu: float) -> tuple[Array, float, int]:
        """Examine the closing system at given states.

        Returns:
            Condition number of ``D + mu``, where ``D = J M^-1 J^T``, (n,); largest norm of ``M^-1 J^T D^+``, which maps
            row residuals to accelerations; and rank of J at the last state.
        """
        model, data, safe = self.tree.model, self.tree.model.createData(), pin.ProximalSettings(0.0, 0.0, 1e-10, 2)
        condition, lift, rank = np.empty(len(q)), 0.0, 0
        for i in range(len(q)):
            self.constraints.accelerate(q[i], v[i], tau[i], safe)  # places the constraints
            upper = np.triu(pin.crba(model, data, q[i]))
            pin.computeJointJacobians(model, data, q[i])
            J = self.constraints.jacobian(data, q[i])
            moved = np.linalg.solve(upper + np.triu(upper, 1).T, J.T)
            D = J @ moved
            condition[i] = linear.condition(D + mu * np.eye(len(D)))
            lift = max(lift, float(np.linalg.norm(moved @ np.linalg.pinv(D, rcond=1e-10), ord=np.inf)))
            rank = int(linear.rank(J))
        return condition, lift, rank
