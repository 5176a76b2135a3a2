"""The engines `pinocchio` and `pinocchio-full`: Pinocchio on a URDF and its loops file."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pinocchio as pin

from screwgauge.engines.pinocchio.mover import ITERATIONS, MU, PinocchioMover
from screwgauge.engines.pinocchio.tree import Constraints, PinocchioTree
from screwgauge.engines.tree.applied_forces import spring_pull
from screwgauge.engines.tree.closed import close_tree
from screwgauge.engines.tree.fixed_steps import INTEGRATORS
from screwgauge.engines.tree.model import TreeModel, loops_file
from screwgauge.engines.tree.protocol import Accelerations, TreeDynamics
from screwgauge.problem import ModelFiles
from screwgauge.reference import linear
from screwgauge.reference.applied import JointSpring
from screwgauge.reference.errors import DescriptionError, check_choice
from screwgauge.reference.rotations import Array
from screwgauge.solution import Stopwatch


@dataclass(frozen=True, slots=True)
class PinocchioSettings:
    """How accelerations are made.

    Attributes:
        mu, iterations: Of `constraintDynamics` on given states; None, None are the defaults of Pinocchio.
        gains: Baumgarte's, of position and velocity, on given states.
        frames: Loops are closed by whole frames, on given states.
        examine: Conditioning of given states is looked at, and the error that Pinocchio admits.
        integrator, dt: One of `INTEGRATORS` with its step [s], brought back onto the loops after every step; None for
            scipy's methods.
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
            raise DescriptionError(f"step {self.dt:g} s", "stepper of pinocchio", "give a positive number")

    def proximal(self) -> Any:
        """Pinocchio's own settings. Accuracies 0: all iterations are made."""
        if self.mu is None or self.iterations is None:
            return pin.ProximalSettings()
        return pin.ProximalSettings(0.0, 0.0, self.mu, self.iterations)


#: What `load` takes.
Settings = PinocchioSettings


def load(files: ModelFiles, **settings: Any) -> TreeModel:
    """Loads a URDF with its loops file; see `PinocchioSettings`."""
    file = loops_file(files)
    tree = PinocchioTree(files.model, file)
    return TreeModel(close_tree(tree, file), PinocchioDynamics(tree, PinocchioSettings(**settings)))


class PinocchioDynamics(TreeDynamics):
    """What moves a URDF. See `screwgauge.engines.tree.protocol.TreeDynamics`."""

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
        # closing rows are off by exactly mu times the last change of the multipliers
        tolerances = {"joint_acceleration": proximal.mu * change * lift}
        return Accelerations(a, cost, condition, tolerances, (f"rank leaves {q.shape[1] - rank} freedoms",))

    def _examine(self, q: Array, v: Array, tau: Array, mu: float) -> tuple[Array, float, int]:
        """Condition of ``D + mu``, ``D = J M^-1 J^T``, shape (n,); the norm of ``M^-1 J^T D^+``, which turns residuals
        of rows into accelerations, at its worst; and the rank of J at the last state."""
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
