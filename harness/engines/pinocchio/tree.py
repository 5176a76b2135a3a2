"""Pinocchio on a URDF: its open tree, and the closures as its constraints.

Pinocchio's names, orders and frames stay in this folder. A joint's spatial quantities are [linear; angular] in
the joint's own frame; LOCAL_WORLD_ALIGNED gives velocities and accelerations of a frame's origin in world axes.
"""

from __future__ import annotations

from collections.abc import Callable, Collection
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

from screwgauge.engines.tree.protocol import BodyPoses
from screwgauge.models.loops import LoopsFile
from screwgauge.models.readings.overheard import overheard
from screwgauge.reference.couplings import bind
from screwgauge.reference.errors import ModelFileError
from screwgauge.reference.files import read_model
from screwgauge.reference.mechanism import GROUND
from screwgauge.reference.rotations import Array, cross

#: Singular values below this share of the largest are those of couplings that the loops keep already.
REDUNDANT = 1e-9
_ALIGNED = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
_ANGULAR_FIRST = [3, 4, 5, 0, 1, 2]


def _load(urdf: Path) -> pin.Model:
    """Loads a URDF. Its parser says on stderr, and only there, what is wrong, and goes on with half of it."""
    text, reason = read_model(urdf), ""
    with overheard() as said:
        try:
            model = pin.buildModelFromXML(text)
        except (ValueError, RuntimeError) as error:
            reason = str(error)
    reason = next(iter(said), reason)
    if reason:
        raise ModelFileError(f"Pinocchio cannot load it ({reason.rstrip('.')})", str(urdf), "correct the URDF")
    return model


class PinocchioTree:
    """A loaded URDF. See `screwgauge.engines.tree.protocol.Tree` for shapes."""

    def __init__(self, urdf: Path, file: LoopsFile) -> None:
        self.model = _load(urdf)
        if self.model.nq != self.model.nv:
            raise ModelFileError("has continuous joints", str(urdf), "use revolute joints with wide limits")
        self.gravity = self.model.gravity.linear.copy()  # the usual one: a URDF says none
        self.data = self.model.createData()
        self.engine = "pinocchio" if file.cut == "minimal" else f"pinocchio-{file.cut}"
        self.version = pin.__version__
        joints = sorted((self.model.joints[j].idx_v, self.model.names[j]) for j in range(1, self.model.njoints))
        self.coordinates = tuple(name for _, name in joints)
        self.closures, self.couplings = file.closures, file.couplings
        wanted = {*file.bodies, *(side for c in file.closures for side in (c.parent, c.child))}
        frames = [i for i, f in enumerate(self.model.frames) if f.type == pin.FrameType.BODY and f.name in wanted]
        self.frames = [i for i in frames if self.model.frames[i].name != "ground"]
        self.bodies = tuple(self.model.frames[i].name for i in self.frames)
        self.joints = [self.model.frames[i].parentJoint for i in self.frames]
        self.parents = tuple(self._parent(joint) for joint in self.joints)
        # a fixed joint merges the inertia of its link into the moving joint before it
        placed = [(self.model.frames[i].placement, joint) for i, joint in zip(self.frames, self.joints, strict=True)]
        self.masses = np.array([self.model.inertias[joint].mass for joint in self.joints])
        com = [place.actInv(self.model.inertias[joint].lever) for place, joint in placed]
        self.com = np.where(self.masses[:, None] > 0.0, com, 0.0)

    def under(self, gravity: Array | None) -> None:
        self.model.gravity.linear[:] = self.gravity if gravity is None else gravity

    def _parent(self, joint: int) -> str:
        """The body that carries a joint, past the massless crosses of composite joints."""
        while joint:
            joint = self.model.parents[joint]
            if joint in self.joints:
                return str(self.bodies[self.joints.index(joint)])
        return "ground"

    def poses(self, q: Array, only: Collection[int] | None = None) -> BodyPoses:
        n, b = len(q), len(self.frames) + 1
        R, p, J = np.tile(np.eye(3), (n, b, 1, 1)), np.zeros((n, b, 3)), np.zeros((n, b, 6, self.model.nv))
        looked_at = [(k, frame) for k, frame in enumerate(self.frames, 1) if only is None or k in only]
        for i in range(n):
            pin.computeJointJacobians(self.model, self.data, q[i])
            for k, frame in looked_at:
                M = pin.updateFramePlacement(self.model, self.data, frame)
                R[i, k], p[i, k] = M.rotation, M.translation
                # one column comes without its axis
                J[i, k] = pin.getFrameJacobian(self.model, self.data, frame, _ALIGNED).reshape(6, -1)
        return BodyPoses(R, p, J[:, :, _ANGULAR_FIRST])

    def accelerations(self, q: Array, v: Array, a: Array) -> tuple[Array, Array]:
        V, A = np.zeros((2, len(q), len(self.frames) + 1, 6))
        for i in range(len(q)):
            pin.forwardKinematics(self.model, self.data, q[i], v[i], a[i])
            for k, frame in enumerate(self.frames, 1):
                V[i, k] = pin.getFrameVelocity(self.model, self.data, frame, _ALIGNED).vector
                A[i, k] = pin.getFrameClassicalAcceleration(self.model, self.data, frame, _ALIGNED).vector
        return V[:, :, _ANGULAR_FIRST], A[:, :, _ANGULAR_FIRST]

    def com_accelerations(self, q: Array, v: Array, a: Array) -> Array:
        out = np.empty((len(q), len(self.frames), 3))
        placed = [self.model.frames[i].placement for i in self.frames]
        placements = [pin.SE3(np.eye(3), M.act(com)) for M, com in zip(placed, self.com, strict=True)]
        for i in range(len(q)):
            pin.forwardKinematics(self.model, self.data, q[i], v[i], a[i])
            for k, (joint, at) in enumerate(zip(self.joints, placements, strict=True)):
                out[i, k] = pin.getFrameClassicalAcceleration(self.model, self.data, joint, at, _ALIGNED).linear
        return out

    def tree_force(self, q: Array, v: Array, a: Array) -> Array:
        return np.array([pin.rnea(self.model, self.data, q[i], v[i], a[i]) for i in range(len(q))])

    def bare(self, q: Array, v: Array, a: Array) -> Callable[[], None]:
        """Calls of `rnea` and nothing else, one for each sample: what a clock is held to."""
        rows = [*zip(q, v, a, strict=True)]

        def run() -> None:
            for row in rows:
                pin.rnea(self.model, self.data, *row)

        return run

    def soft_force(self, q: Array, v: Array, a: Array, residuals: Array) -> tuple[Array, float]:
        """Pinocchio's constraints are rigid: the same as `tree_force`."""
        return self.tree_force(q, v, a), 0.0

    def transmitted(self, at: BodyPoses, q: Array, v: Array, a: Array, wrench: Array) -> Array:
        """See `screwgauge.engines.tree.protocol.Tree`. Forces of joints are taken in the joints' own frames."""
        n, out = len(q), np.zeros_like(wrench)
        placed = [self.model.frames[i].placement for i in self.frames]
        # orientation of the joint that carries each body, and the body's origin in its frame
        R = at.R[:, 1:] @ np.stack([M.rotation.T for M in placed])
        origin = np.stack([M.translation for M in placed])
        inside = (wrench[:, 1:].reshape(n, -1, 2, 3) @ R).reshape(n, -1, 6)
        inside[..., 3:] += cross(origin, inside[..., :3])
        external, carried = np.zeros((n, self.model.njoints, 6)), np.empty((n, len(self.joints), 6))
        for k, joint in enumerate(self.joints):
            external[:, joint] += inside[:, k]
        for i in range(n):
            forces = pin.StdVec_Force([pin.Force(force) for force in external[i]])
            pin.rnea(self.model, self.data, q[i], v[i], a[i], forces)
            carried[i] = [self.data.f[joint].vector for joint in self.joints]
        carried[..., 3:] -= cross(origin, carried[..., :3])
        out[:, 1:] = (carried.reshape(n, -1, 2, 3) @ R.swapaxes(2, 3)).reshape(n, -1, 6)
        return out


class Constraints:
    """The closures of a tree as Pinocchio's constraints, and its couplings, for which Pinocchio has none.

    Attributes:
        models, datas: A 3D contact for each pair of points, a 6D one for each weld.
        couplings: In the coordinates of the tree.
    """

    def __init__(self, tree: PinocchioTree, *, frames: bool = False, gains: tuple[float, float] | None = None) -> None:
        """Makes the constraints.

        Args:
            frames: Every closure is a 6D contact of its two frames, as a weld would be.
            gains: Baumgarte's, of position and velocity; none by default.
        """
        self.model, self.data = tree.model, tree.model.createData()
        self.couplings, self.gains = bind(tree.couplings, tree.coordinates), gains or (0.0, 0.0)
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
        """Accelerations of the tree; by `aba` where nothing closes it. Shape (n_v,) each.

        They are linear in the forces, so that Pinocchio's answers to unit forces along the couplings give those that
        keep the couplings; what rounding leaves of them is taken out once more.
        """
        a = self._closed(q, v, tau, settings)
        if not len(self.couplings):
            return a
        C = self.couplings.matrix(q[None])[0]
        answers = np.stack([self._closed(q, v, tau + row, settings) - a for row in C], axis=1)
        for _ in range(2):
            tau = tau - C.T @ np.linalg.lstsq(C @ answers, self.uncoupled(q, v, a), rcond=REDUNDANT)[0]
            a = self._closed(q, v, tau, settings)
        return a

    def uncoupled(self, q: Array, v: Array, a: Array) -> Array:
        """What accelerations leave over of the couplings' second derivatives. Shape (n_v,) each -> (n_coupling,)."""
        (stiffness, damping), rows = self.gains, self.couplings
        C, bias, gap = (of[0] for of in (rows.matrix(q[None]), rows.bias(q[None], v[None]), rows.residuals(q[None])))
        return np.asarray(C @ (a + damping * v) + bias + stiffness * gap)

    def _closed(self, q: Array, v: Array, tau: Array, settings: Any) -> Array:
        """The same, couplings not kept."""
        if not len(self.models):
            return np.asarray(pin.aba(self.model, self.data, q, v, tau))
        return np.asarray(pin.constraintDynamics(self.model, self.data, q, v, tau, self.models, self.datas, settings))

    def jacobian(self, data: Any, q: Array) -> Array:
        """Derivative of the gaps for a placed `data`: velocity of the second side less that of the first, couplings."""
        couplings: Array = self.couplings.matrix(q[None])[0]
        if not len(self.models):
            return couplings
        return np.vstack([-pin.getConstraintsJacobian(self.model, data, self.models, self.datas), couplings])


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
