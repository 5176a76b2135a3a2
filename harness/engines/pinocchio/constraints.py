"""Pinocchio's constraint models for the closures of a tree, and `constraintDynamics` on them."""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin

from screwgauge.engines.pinocchio.tree import PinocchioTree
from screwgauge.reference.mechanism import GROUND
from screwgauge.reference.rotations import Array


class Constraints:
    """The closures of a tree as Pinocchio's constraints.

    Attributes:
        models, datas: A 3D contact for each pair of points, a 6D one for each weld.
    """

    def __init__(self, tree: PinocchioTree, *, frames: bool = False, gains: tuple[float, float] | None = None) -> None:
        """Makes the constraints.

        Args:
            frames: Every closure is a 6D contact of its two frames, as a weld would be.
            gains: Baumgarte's, of position and velocity; none by default.
        """
        self.model, self.data = tree.model, tree.model.createData()
        self.models, self.datas = _contacts(tree, frames), pin.StdVec_RigidConstraintData()
        for model in self.models:
            if gains is not None:
                model.m_baumgarte_parameters.Kp, model.m_baumgarte_parameters.Kd = gains
            self.datas.append(model.createData())
        if len(self.models):
            pin.initConstraintDynamics(self.model, self.data, self.models, self.datas)

    def __len__(self) -> int:
        return len(self.models)

    def accelerate(self, q: Array, v: Array, tau: Array, settings: Any) -> Array:
        """Accelerations of the tree; by `aba` where nothing closes it. Shape (n_v,) each."""
        if not len(self.models):
            return np.asarray(pin.aba(self.model, self.data, q, v, tau))
        return np.asarray(pin.constraintDynamics(self.model, self.data, q, v, tau, self.models, self.datas, settings))

    def jacobian(self, data: Any) -> Array:
        """Rows of the constraints for a placed `data`: velocity of the first side less that of the second."""
        return np.asarray(pin.getConstraintsJacobian(self.model, data, self.models, self.datas))


def _contacts(tree: PinocchioTree, frames: bool) -> Any:
    models = pin.StdVec_RigidConstraintModel()
    for closure in tree.closures:
        if frames or closure.type == "weld":
            kind = pin.ContactType.CONTACT_6D
            here, there = closure.parent_frame, closure.child_frame
            turned = closure.type == "weld"  # frames of a cut hinge are laid along their bodies
            pairs = [tuple(pin.SE3(f.R if turned else np.eye(3), f.p) for f in (here, there))]
        else:
            kind = pin.ContactType.CONTACT_3D
            points = zip(closure.parent_points, closure.child_points, strict=True)
            pairs = [tuple(pin.SE3(np.eye(3), point) for point in pair) for pair in points]
        for first, second in pairs:
            sides = (*_place(tree, closure.parent, first), *_place(tree, closure.child, second))
            models.append(pin.RigidConstraintModel(kind, tree.model, *sides, pin.ReferenceFrame.LOCAL))
    return models


def _place(tree: PinocchioTree, body: str, at: Any) -> tuple[int, Any]:
    """Joint that carries a body, and a placement in the body in that joint's frame."""
    if body == GROUND:
        return 0, at
    frame = tree.model.frames[tree.frames[tree.bodies.index(body)]]
    return frame.parentJoint, frame.placement * at
