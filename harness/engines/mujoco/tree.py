"""The engines `mujoco` and `mujoco-full`: MuJoCo on an MJCF with equality constraints.

All of MuJoCo's names, orders and frames stay in this file. Spatial quantities are [angular; linear]; accelerations
contain minus gravity; forces between bodies (cfrc_int) are taken about the centre of mass of the whole tree.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np

from screwgauge.engines.tree.closed_tree import solve_tree
from screwgauge.engines.tree.protocol import BodyPoses
from screwgauge.models.layout import Closure
from screwgauge.models.loops import LoopsFile, read_loops
from screwgauge.problem import OldProblem
from screwgauge.reference.errors import ModelFileError
from screwgauge.reference.mechanism import Frame
from screwgauge.reference.rotations import Array
from screwgauge.solution import Solution

_BODY = mujoco.mjtObj.mjOBJ_XBODY
_SITE = mujoco.mjtObj.mjOBJ_SITE
_EQUALITY = int(mujoco.mjtDisableBit.mjDSBL_EQUALITY)
_CONSTRAINT = int(mujoco.mjtDisableBit.mjDSBL_CONSTRAINT)


def solve(problem: OldProblem) -> Solution:
    """Closes the loops of an MJCF by its own equality constraints and solves the problem."""
    if problem.loops is None:
        raise ModelFileError("has no loops file", str(problem.model), "put NAME.loops.toml beside it")
    file = read_loops(problem.loops)
    warnings: list[str] = []
    # MuJoCo's own handler writes MUJOCO_LOG.TXT into the working directory
    mujoco.set_mju_user_warning(warnings.append)
    try:
        solution = solve_tree(problem, MujocoTree(problem.model, file, problem.gravity), file)
    finally:
        mujoco.set_mju_user_warning(None)
    return replace(solution, notes=(*solution.notes, *(f"MuJoCo warns: {text}" for text in dict.fromkeys(warnings))))


class MujocoTree:
    """A loaded MJCF. See `screwgauge.engines.tree.protocol.Tree` for shapes."""

    def __init__(self, mjcf: Path, file: LoopsFile, gravity: Array | None) -> None:
        try:
            self.model = mujoco.MjModel.from_xml_path(str(mjcf))
        except ValueError as error:
            raise ModelFileError(f"MuJoCo cannot load it ({error})", str(mjcf), "correct the MJCF") from None
        if self.model.nq != self.model.nv:
            raise ModelFileError("has free or ball joints", str(mjcf), "use hinges and slides")
        self.model.opt.jacobian = mujoco.mjtJacobian.mjJAC_DENSE  # sparse ones are wrong in 4.0.0 (issue 3767)
        if gravity is not None:
            self.model.opt.gravity[:] = gravity
        self.data = mujoco.MjData(self.model)
        self.engine = "mujoco" if file.cut == "minimal" else f"mujoco-{file.cut}"
        self.version = mujoco.__version__
        model = self.model
        self.coordinates = tuple(model.joint(j).name for j in range(model.njnt))
        names = {model.body(b).name: b for b in range(1, model.nbody)}
        self.ids = [b for name, b in names.items() if name != "ground"]
        self.bodies = tuple(name for name in names if name != "ground")
        self.parents = tuple(self._parent(b) for b in self.ids)
        self.com = model.body_ipos[self.ids].copy()
        self.closures = self._closures(file)
        self._check_motors(file)

    def _check_motors(self, file: LoopsFile) -> None:
        """Refuses motors, where the file has any, that are not those of the description."""
        wanted = {joint.coordinates[0] for joint in file.joints if joint.actuated}
        joint = int(mujoco.mjtTrn.mjTRN_JOINT)
        for k in range(self.model.nu if wanted <= set(self.coordinates) else 0):  # a missing joint is said elsewhere
            name = self.model.joint(self.model.actuator_trnid[k, 0]).name
            plain = self.model.actuator_gear[k, 0] == 1.0 and not self.model.actuator_biastype[k]
            if self.model.actuator_trntype[k] != joint or name not in wanted or not plain:
                raise ModelFileError(
                    f"its actuator {k} is no motor of gear 1 on one of {', '.join(sorted(wanted))}",
                    f"MJCF of {file.mechanism}",
                    "correct it or leave the actuators out",
                )

    def _parent(self, body: int) -> str:
        parent = self.model.body_parentid[body]
        return self.model.body(parent).name if parent and self.model.body(parent).name else "ground"

    def _closures(self, file: LoopsFile) -> tuple[Closure, ...]:
        """Closures as the equality constraints of the file have them, from its sites."""
        found: dict[str, list[tuple[int, int]]] = {}
        kinds: dict[str, int] = {}
        disabled = bool(self.model.opt.disableflags & (_EQUALITY | _CONSTRAINT))
        for e in range(self.model.neq):
            if disabled or not self.model.eq_active0[e]:
                raise ModelFileError(
                    f"its equality constraint {e} is switched off",
                    f"MJCF of {file.mechanism}",
                    "switch it on",
                )
            if self.model.eq_objtype[e] != _SITE:
                raise ModelFileError(
                    "an equality constraint joins no sites",
                    f"constraint {e} of {file.mechanism}",
                    "use site1, site2",
                )
            sites = int(self.model.eq_obj1id[e]), int(self.model.eq_obj2id[e])
            joint = self.model.site(sites[0]).name.split("@")[0]
            found.setdefault(joint, []).append(sites)
            kinds[joint] = int(self.model.eq_type[e])
        return tuple(self._closure(joint, pairs, kinds[joint]) for joint, pairs in found.items())

    def _closure(self, joint: str, pairs: list[tuple[int, int]], kind: int) -> Closure:
        model, weld = self.model, kind == mujoco.mjtEq.mjEQ_WELD
        bodies = [self._name(int(model.site_bodyid[site])) for site in pairs[0]]
        points = [np.array([model.site_pos[pair[side]] for pair in pairs]) for side in (0, 1)]
        frames = []
        for site in pairs[0]:
            R = np.empty(9)
            mujoco.mju_quat2Mat(R, model.site_quat[site])
            frames.append(Frame(model.site_pos[site].copy(), R.reshape(3, 3)))
        return Closure(joint, "weld" if weld else "point", bodies[0], bodies[1], points[0], points[1], *frames)

    def _name(self, body: int) -> str:
        return str(self.model.body(body).name) if body and self.model.body(body).name else "ground"

    def _set(self, q: Array, v: Array, a: Array) -> None:
        """Positions, velocities and accelerations with all constraints out."""
        self.data.qpos[:], self.data.qvel[:], self.data.qacc[:] = q, v, a

    def _rigid(self) -> None:
        self.model.opt.disableflags |= _EQUALITY

    def poses(self, q: Array) -> BodyPoses:
        n, b, nv = len(q), len(self.ids) + 1, self.model.nv
        R, p, J = np.tile(np.eye(3), (n, b, 1, 1)), np.zeros((n, b, 3)), np.zeros((n, b, 6, nv))
        model, data = self.model, self.data
        for i in range(n):
            data.qpos[:] = q[i]
            mujoco.mj_kinematics(model, data)
            mujoco.mj_comPos(model, data)
            R[i, 1:], p[i, 1:] = data.xmat[self.ids].reshape(-1, 3, 3), data.xpos[self.ids]
            for k, body in enumerate(self.ids, 1):
                mujoco.mj_jacBody(model, data, J[i, k, 3:], J[i, k, :3], body)
        return BodyPoses(R, p, J)

    def _motion(self, q: Array, v: Array, a: Array) -> None:
        """Fills the velocities and accelerations of all bodies of one sample."""
        self._rigid()
        self._set(q, v, a)
        self.data.xfrc_applied[:] = 0.0
        mujoco.mj_inverse(self.model, self.data)
        mujoco.mj_rnePostConstraint(self.model, self.data)

    def accelerations(self, q: Array, v: Array, a: Array) -> tuple[Array, Array]:
        V, A = np.zeros((2, len(q), len(self.ids) + 1, 6))
        gravity = self.model.opt.gravity.copy()
        self.model.opt.gravity[:] = 0.0  # accelerations of bodies contain minus gravity
        for i in range(len(q)):
            self._motion(q[i], v[i], a[i])
            for k, body in enumerate(self.ids, 1):
                mujoco.mj_objectVelocity(self.model, self.data, _BODY, body, V[i, k], 0)
                mujoco.mj_objectAcceleration(self.model, self.data, _BODY, body, A[i, k], 0)
        self.model.opt.gravity[:] = gravity
        return V, A

    def com_accelerations(self, q: Array, v: Array, a: Array) -> Array:
        out, found = np.empty((len(q), len(self.ids), 3)), np.empty(6)
        gravity = self.model.opt.gravity.copy()
        self.model.opt.gravity[:] = 0.0
        for i in range(len(q)):
            self._motion(q[i], v[i], a[i])
            for k, body in enumerate(self.ids):
                # the inertial frame of the body, whose origin is its centre of mass
                mujoco.mj_objectAcceleration(self.model, self.data, mujoco.mjtObj.mjOBJ_BODY, body, found, 0)
                out[i, k] = found[3:]
        self.model.opt.gravity[:] = gravity
        return out

    def tree_force(self, q: Array, v: Array, a: Array) -> Array:
        self._rigid()
        return self._inverse(q, v, a)

    def _inverse(self, q: Array, v: Array, a: Array) -> Array:
        out = np.empty_like(q)
        self.data.xfrc_applied[:] = 0.0
        for i in range(len(q)):
            self._set(q[i], v[i], a[i])
            mujoco.mj_inverse(self.model, self.data)
            out[i] = self.data.qfrc_inverse
        return out

    def soft_force(self, q: Array, v: Array, a: Array, residuals: Array) -> tuple[Array, float]:
        """mj_inverse with its soft equality constraints, and what their stiffness makes of the closure residuals."""
        self.model.opt.disableflags &= ~_EQUALITY
        out, tolerance = np.empty_like(q), 0.0
        self.data.xfrc_applied[:] = 0.0
        for i in range(len(q)):
            self._set(q[i], v[i], a[i])
            mujoco.mj_inverse(self.model, self.data)
            out[i] = self.data.qfrc_inverse
            tolerance = max(tolerance, self._soft_tolerance(residuals))
        self._rigid()
        return out, tolerance

    def _soft_tolerance(self, residuals: Array) -> float:
        """Largest joint force of ``f = D (k r + b rdot + rddot)`` for residuals r as large as those measured."""
        data, rows = self.data, self.data.nefc
        K, B, imp, _ = data.efc_KBIP.reshape(-1, 4)[:rows].T
        f = data.efc_D[:rows] * (K * imp * residuals[0] + B * residuals[1] + residuals[2])
        return float((np.abs(data.efc_J.reshape(rows, -1)).T @ f).max(initial=0.0))

    def transmitted(self, q: Array, v: Array, a: Array, wrench: Array) -> Array:
        out = np.zeros((len(q), len(self.ids) + 1, 6))
        model, data = self.model, self.data
        self._rigid()
        for i in range(len(q)):
            self._set(q[i], v[i], a[i])
            data.xfrc_applied[:] = 0.0
            mujoco.mj_inverse(model, data)
            for k, body in enumerate(self.ids, 1):  # applied at the centre of mass
                arm = data.xipos[body] - data.xpos[body]
                force, moment = wrench[i, k, :3], wrench[i, k, 3:]
                data.xfrc_applied[body, :3], data.xfrc_applied[body, 3:] = (
                    force,
                    moment - np.cross(arm, force),
                )
            mujoco.mj_rnePostConstraint(model, data)
            for k, body in enumerate(self.ids, 1):
                moment, force = data.cfrc_int[body, :3], data.cfrc_int[body, 3:]
                about = data.subtree_com[model.body_rootid[body]]
                out[i, k, :3], out[i, k, 3:] = force, moment + np.cross(about - data.xpos[body], force)
        data.xfrc_applied[:] = 0.0
        return out
