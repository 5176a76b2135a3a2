"""Pinocchio's evaluation of the open tree of a URDF (see `engines.tree.protocol`), with closures as constraints.

Pinocchio's names, orders and frames stay in this folder. A joint's spatial quantities are [linear; angular] in
the joint's own frame; LOCAL_WORLD_ALIGNED gives velocities and accelerations of a frame's origin in world axes.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

from screwgauge.engines.kit.poses import shifted
from screwgauge.engines.tree.protocol import BodyPoses, OpenTree
from screwgauge.models.files.loops import LoopsFile
from screwgauge.models.files.urdf import tree_urdf
from screwgauge.models.readings.pinocchio import capture_errors
from screwgauge.reference.couplings import bind
from screwgauge.reference.errors import LoaderError, ModelFileError, SingularPoseError
from screwgauge.reference.mechanism import GROUND, Joint
from screwgauge.reference.resistance import rotors_of
from screwgauge.reference.rotations import Array, cross

#: Singular values below this fraction of the largest singular value belong to couplings that the loops already enforce.
REDUNDANT = 1e-9
#: Fraction of the largest inertia in the tree below which a joint's inertia counts as zero.
WEIGHTLESS = 1e-15
#: True if constraint data must also be initialised and placed (casebook: pin-4-constraint-api).
PIN_4 = int(pin.__version__.split(".")[0]) >= 4
ALIGNED = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
ANGULAR_FIRST = [3, 4, 5, 0, 1, 2]


def _load(urdf: Path, joints: Sequence[Joint]) -> pin.Model:
    """Load a URDF with the description's fixed joints as hinges.

    Pinocchio's parser reports some errors only on stderr, and continues with part of the file.
    """
    text, reason = tree_urdf(urdf, joints), ""
    with capture_errors() as messages:
        try:
            model = pin.buildModelFromXML(text)
        except (ValueError, RuntimeError) as error:
            reason = str(error)
    reason = next(iter(messages), reason)
    if reason:
        raise ModelFileError(f"Pinocchio cannot load the file ({reason.rstrip('.')})", str(urdf), "correct the URDF")
    return model


class PinocchioTree(OpenTree):
    """A loaded URDF; `screwgauge.engines.tree.protocol.OpenTree` documents the shapes."""

    def __init__(self, urdf: Path, file: LoopsFile) -> None:
        self.model = _load(urdf, file.joints)
        if self.model.nq != self.model.nv:
            raise ModelFileError("has continuous joints", str(urdf), "use revolute joints with wide limits")
        self.gravity = self.model.gravity.linear.copy()  # the default, because a URDF has no gravity
        self.data = self.model.createData()
        self.engine = "pinocchio" if file.cut == "minimal" else f"pinocchio-{file.cut}"
        self.version = pin.__version__
        columns = sorted(range(1, self.model.njoints), key=lambda j: self.model.joints[j].idx_v)
        self.coordinates = tuple(self.model.names[j] for j in columns)
        rotors = rotors_of(file.joints)
        self.model.armature[:] = [rotors.get(name, 0.0) for name in self.coordinates]  # a URDF cannot express them
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
        # origins, orientations and centres of mass of the bodies in the frames of the joints that carry them
        self.origins = np.array([place.translation for place, _ in placed])
        self.turned = np.array([place.rotation for place, _ in placed])
        self.placed = [k for k, (place, _) in enumerate(placed, 1) if not place.isIdentity(0.0)]
        self.centres = np.array([place.act(at) for (place, _), at in zip(placed, self.com, strict=True)])
        carriers = [[], *(self.model.supports[joint] for joint in self.joints)]
        self.moves = np.array([[j in some for j in columns] for some in carriers], dtype=float)
        self.views = _Views(self.data)

    def set_gravity(self, gravity: Array | None) -> None:
        self.model.gravity.linear[:] = self.gravity if gravity is None else gravity

    def _parent(self, joint: int) -> str:
        """Return the body that carries a joint, skipping the massless crosses of composite joints."""
        while joint:
            joint = self.model.parents[joint]
            if joint in self.joints:
                return str(self.bodies[self.joints.index(joint)])
        return "ground"

    def poses(self, q: Array) -> BodyPoses:
        n, joints, twists = len(q), self.views.joints, self.views.twists
        placed, screws = np.empty((n, *joints.shape)), np.empty((n, *twists.shape))
        model, data = self.model, self.data
        for x, place, screw in zip(q, placed, screws, strict=True):
            pin.computeJointJacobians(model, data, x)
            place[:], screw[:] = joints, twists
        bodies = placed.reshape(n, -1, 4, 3)[:, [0, *self.joints]]  # the first joint is the world
        R, p = np.ascontiguousarray(bodies[:, :, :3].swapaxes(2, 3)), bodies[:, :, 3]
        for k in self.placed:  # links on fixed joints
            p[:, k] += R[:, k] @ self.origins[k - 1]
            R[:, k] = R[:, k] @ self.turned[k - 1]
        return BodyPoses(R, p, screws[:, ANGULAR_FIRST], self.moves)

    def bias(self, at: BodyPoses, q: Array, v: Array, V: Array) -> Array:
        model, data, turning = self.model, self.data, self.views.turning
        rates = np.empty((len(q), *turning.shape))
        for x, xd, row in zip(q, v, rates, strict=True):
            pin.computeJointJacobiansTimeVariation(model, data, x, xd)
            row[:] = turning
        return at.bias(rates[:, ANGULAR_FIRST], v, V)

    def com_accelerations(self, q: Array, v: Array, a: Array) -> Array:
        model, data, kept = self.model, self.data, (self.views.joints, self.views.velocities, self.views.accelerations)
        placed, V, A = (np.empty((len(q), *view.shape)) for view in kept)
        for i in range(len(q)):
            pin.forwardKinematics(model, data, q[i], v[i], a[i])
            placed[i], V[i], A[i] = kept
        R = placed[:, self.joints, :9].reshape(len(q), -1, 3, 3)
        V, A = (array[:, self.joints][..., ANGULAR_FIRST] for array in (V, A))
        A[..., 3:] += cross(V[..., :3], V[..., 3:])  # the library's accelerations are spatial
        return np.asarray((shifted(V, A, self.centres)[..., None, :] @ R)[..., 0, :])

    def tree_force(self, q: Array, v: Array, a: Array) -> Array:
        model, data = self.model, self.data
        return np.array([pin.rnea(model, data, *state) for state in zip(q, v, a, strict=True)])

    def mass_matrix(self, q: Array) -> Array:
        upper = np.array([np.triu(pin.crba(self.model, self.data, x)) for x in q])  # old versions fill only this part
        return np.asarray(upper + np.triu(upper, 1).swapaxes(1, 2))

    def transmitted(self, at: BodyPoses, q: Array, v: Array, a: Array, wrench: Array) -> Array:
        """See `screwgauge.engines.tree.protocol.OpenTree`; Pinocchio returns joint forces in the joints' frames."""
        n, out, origin = len(q), np.zeros_like(wrench), self.origins
        # orientation of the joint that carries each body
        R = at.R[:, 1:] @ self.turned.swapaxes(1, 2)
        inside = (wrench[:, 1:].reshape(n, -1, 2, 3) @ R).reshape(n, -1, 6)
        inside[..., 3:] += cross(origin, inside[..., :3])
        external, felt = np.zeros((n, self.model.njoints, 6)), np.empty((n, self.model.njoints, 6))
        for k, joint in enumerate(self.joints):
            external[:, joint] += inside[:, k]
        for i in range(n):
            self.views.external[:] = external[i]
            pin.rnea(self.model, self.data, q[i], v[i], a[i], self.views.pushed)
            felt[i] = self.views.forces
        carried = felt[:, self.joints]
        carried[..., 3:] -= cross(origin, carried[..., :3])
        out[:, 1:] = (carried.reshape(n, -1, 2, 3) @ R.swapaxes(2, 3)).reshape(n, -1, 6)
        return out


class _Views:
    """Array views of the memory in `data`; copy each sample, because Pinocchio's functions overwrite it.

    Attributes:
        joints: Rotation column by column, then translation, of each joint. Shape (n_joint, 12).
        velocities, accelerations, forces: Joint quantities in the joints' own frames. Shape (n_joint, 6).
        pushed, external: External forces on the joints as Pinocchio's vector, and an array view of it, (n_joint, 6).
        twists, turning: Jacobian at the world origin, and its time derivative. Shape (6, n_v).
    """

    def __init__(self, data: Any) -> None:
        self.joints = _rows([M.rotation for M in data.oMi], 12)
        self.pushed = pin.StdVec_Force([pin.Force.Zero() for _ in data.f])
        kept = data.v, data.a, data.f, self.pushed
        self.velocities, self.accelerations, self.forces, self.external = (
            _rows([one.vector for one in of], 6) for of in kept
        )
        self.twists, self.turning = (J.reshape(6, -1) for J in (data.J, data.dJ))  # a single column is returned as 1D


def _rows(parts: list[Array], size: int) -> Array:
    """View the items of a C++ vector as rows of `size` numbers; `parts` holds the first array of each item."""
    begin = np.array([part.__array_interface__["data"][0] for part in parts])
    step = int(begin[-1] - begin[0]) // max(1, len(parts) - 1)
    if (np.diff(begin) != step).any() or 0 < step < 8 * size:
        what = "cannot view its data as NumPy arrays: unexpected memory layout"
        raise LoaderError(what, f"pinocchio {pin.__version__}", "install another version")
    return np.lib.stride_tricks.as_strided(parts[0], (len(parts), size), (step, 8))


class Constraints:
    """Closures of a tree as Pinocchio's constraints, and the tree's couplings, which Pinocchio does not support.

    Attributes:
        models, datas: A 3D contact for each pair of points, and a 6D contact for each weld.
        couplings: Couplings in the coordinates of the tree.
    """

    def __init__(self, tree: PinocchioTree, *, frames: bool = False, gains: tuple[float, float] | None = None) -> None:
        """Build the constraints.

        Args:
            frames: Make every closure a 6D contact of its two frames, like a weld.
            gains: Baumgarte gains of position and velocity; none by default.
        """
        self.tree, self.model, self.data = tree, tree.model, tree.model.createData()
        self.couplings, self.gains = bind(tree.couplings, tree.coordinates), gains or (0.0, 0.0)
        self.models, self.datas = _contacts(tree, frames), pin.StdVec_RigidConstraintData()
        for model in self.models:
            if gains is not None:
                model.m_baumgarte_parameters.Kp, model.m_baumgarte_parameters.Kd = gains
            self.datas.append(model.createData())
        if len(self.models):
            initialise(self.model, self.data, self.models, self.datas)

    def __len__(self) -> int:
        return len(self.models)

    def accelerate(self, q: Array, v: Array, tau: Array, settings: Any) -> Array:
        """Return the accelerations of the tree, shape (n_v,), using `aba` if there are no closures.

        Accelerations are linear in the forces. The responses to unit forces along the couplings therefore determine the
        forces that enforce the couplings; a second pass removes the rounding residual.
        """
        a = self._accelerate_closed(q, v, tau, settings)
        if not np.isfinite(a).all():
            self._check_inertia(q)
            return a
        if not len(self.couplings):
            return a
        C = self.couplings.matrix(q[None])[0]
        answers = np.stack([self._accelerate_closed(q, v, tau + row, settings) - a for row in C], axis=1)
        for _ in range(2):
            tau = tau - C.T @ np.linalg.lstsq(C @ answers, self.coupling_residual(q, v, a), rcond=REDUNDANT)[0]
            a = self._accelerate_closed(q, v, tau, settings)
        return a

    def _check_inertia(self, q: Array) -> None:
        """Reject a joint that moves no inertia in the open tree and thus makes the mass matrix singular.

        Raises:
            SingularPoseError: A joint moves no inertia.
        """
        M = self.tree.mass_matrix(q[None])[0]
        nothing = WEIGHTLESS * M.diagonal().max()
        for k in reversed(range(len(M))):  # outer joints are eliminated first, as their bodies need not move along
            if M[k, k] <= nothing:
                joint, body = self.tree.coordinates[k], self.tree.bodies[int(self.tree.moves[1:, k].argmax())]
                what = f"body '{body}' and the bodies beyond it have no inertia about joint '{joint}'"
                remedy = "add a moment of inertia about that axis, or use screw or mujoco"
                raise SingularPoseError(
                    f"{what}, so Pinocchio cannot compute its acceleration in the open tree", self.tree.engine, remedy
                )
            M -= np.outer(M[:, k], M[k]) / M[k, k]

    def coupling_residual(self, q: Array, v: Array, a: Array) -> Array:
        """Return the residual of the couplings' second derivatives. Shape (n_coupling,)."""
        (stiffness, damping), rows = self.gains, self.couplings
        C, bias, gap = (of[0] for of in (rows.matrix(q[None]), rows.bias(q[None], v[None]), rows.residuals(q[None])))
        return np.asarray(C @ (a + damping * v) + bias + stiffness * gap)

    def _accelerate_closed(self, q: Array, v: Array, tau: Array, settings: Any) -> Array:
        """Return the accelerations of the closed tree, ignoring couplings."""
        if not len(self.models):
            return np.asarray(pin.aba(self.model, self.data, q, v, tau))
        return np.asarray(pin.constraintDynamics(self.model, self.data, q, v, tau, self.models, self.datas, settings))

    def jacobian(self, data: Any, q: Array) -> Array:
        """Return the derivatives of the gaps at the pose of `data`: first the closures' rows (second minus first side),
        then the couplings' rows.

        Updates `datas` to this pose.
        """
        couplings: Array = self.couplings.matrix(q[None])[0]
        if not len(self.models):
            return couplings
        for model, there in zip(self.models, self.datas, strict=True) if PIN_4 else ():  # Pinocchio 3 does this itself
            model.calc(self.model, data, there)
        return np.vstack([-pin.getConstraintsJacobian(self.model, data, self.models, self.datas), couplings])


def initialise(model: Any, data: Any, models: Any, datas: Any) -> None:
    """Call `initConstraintDynamics`, which since Pinocchio 4 also requires the constraints' data."""
    pin.initConstraintDynamics(model, data, models, *([datas] if PIN_4 else []))


def _contacts(tree: PinocchioTree, frames: bool) -> Any:
    models = pin.StdVec_RigidConstraintModel()
    for closure in tree.closures:
        if frames or closure.type == "weld":
            kind = pin.ContactType.CONTACT_6D
            here, there = closure.parent_frame, closure.child_frame
            turned = closure.type == "weld"  # frames of a cut hinge are aligned with their bodies
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
    """Return the joint that carries a body, and convert a placement from the body's frame to that joint's frame."""
    if body == GROUND:
        return 0, at
    frame = tree.model.frames[tree.frames[tree.bodies.index(body)]]
    return frame.parentJoint, frame.placement * at
