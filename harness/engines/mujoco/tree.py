"""MuJoCo's evaluation of the open tree of an MJCF (see `engines.tree.protocol`).

MuJoCo's names, orders and frames stay in this folder. Spatial quantities are [angular; linear]; accelerations
contain minus gravity; forces between bodies (cfrc_int) are taken about the centre of mass of the whole tree."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path

import mujoco
import numpy as np

from screwgauge.engines.kit.poses import shifted
from screwgauge.engines.mujoco.equality_constraints import DISABLED, VELOCITY_STAGE, curvature
from screwgauge.engines.mujoco.fixed import editable
from screwgauge.engines.tree.protocol import BodyPoses, OpenTree
from screwgauge.models.files.loops import LoopsFile
from screwgauge.models.files.parts import check_made
from screwgauge.models.layout import Closure
from screwgauge.models.mjcf import LEAST, mass_properties, why_not
from screwgauge.models.readings.mujoco import coupling_reading, turn
from screwgauge.reference.couplings import Coupling
from screwgauge.reference.errors import ModelFileError
from screwgauge.reference.mechanism import Frame
from screwgauge.reference.rotations import Array, cross, times


class DataBlock:
    """View of arrays that share one buffer as a single block, including any memory between them.

    Attributes:
        block: Memory from the first array to the end of the last. Shape (size,).
    """

    def __init__(self, *arrays: Array) -> None:
        begin = [array.__array_interface__["data"][0] // 8 for array in arrays]
        first = arrays[int(np.argmin(begin))]
        self.spans = [(at - min(begin), array.shape) for at, array in zip(begin, arrays, strict=True)]
        size = max(at + array.size for (at, _), array in zip(self.spans, arrays, strict=True))
        self.block = np.lib.stride_tricks.as_strided(first, (size,), (8,))

    def rows(self, n: int) -> Array:
        """Allocate space for n samples. Shape (n, size)."""
        return np.empty((n, len(self.block)))

    def parts(self, rows: Array) -> Iterator[Array]:
        """Yield a view of each array, of shape (n, ...), in packed samples."""
        for at, shape in self.spans:
            yield rows[:, at : at + math.prod(shape)].reshape(len(rows), *shape)

    def pack(self, *values: Array) -> Array:
        """Pack samples of the given arrays, each of shape (n, ...). Shape (n, size)."""
        rows = self.rows(len(values[0]))
        rows[:] = self.block
        for part, value in zip(self.parts(rows), values, strict=True):
            part[:] = value
        return rows


_SITE = mujoco.mjtObj.mjOBJ_SITE
_CLOSING = (int(mujoco.mjtEq.mjEQ_CONNECT), int(mujoco.mjtEq.mjEQ_WELD))
_CONSTRAINT = int(mujoco.mjtDisableBit.mjDSBL_CONSTRAINT)
_FRICTION = int(mujoco.mjtDisableBit.mjDSBL_FRICTIONLOSS)


def prepare(model: mujoco.MjModel) -> None:
    """Undo the compiler's minimal masses and merged frames, and disable features that need separate handling.

    MuJoCo includes some features of a user's model in only some of its forces. Inverse dynamics derive dry friction
    from the acceleration rather than the rate, and forces between bodies lack gravcomp and drag. Damping is disabled
    because `applied_forces` supplies it to all tree engines.
    """
    model.opt.disableflags |= _FRICTION
    model.dof_damping[:] = 0.0
    model.body_gravcomp[:], model.opt.density, model.opt.viscosity = 0.0, 0.0, 0.0
    model.body_mass[:], model.body_inertia[:] = mass_properties(model)
    for kind in ("body", "site"):  # frames within 1e-6 m are merged, which breaks small mechanisms
        getattr(model, f"{kind}_sameframe")[:] = 0
    model.opt.jacobian = mujoco.mjtJacobian.mjJAC_DENSE  # sparse Jacobians are wrong in 4.0.0 (issue 3767)


class MujocoTree(OpenTree):
    """A loaded MJCF; `screwgauge.engines.tree.protocol.OpenTree` documents the shapes."""

    def __init__(self, mjcf: Path, file: LoopsFile) -> None:
        self.fixed = tuple(joint for joint in file.joints if joint.fixed)
        check_made(mjcf)  # rejects input that crashes MuJoCo, which opens the file itself because of includes
        try:
            self.model = editable(mjcf, self.fixed).compile() if self.fixed else mujoco.MjModel.from_xml_path(str(mjcf))
        except ValueError as error:
            small = "mass and inertia" in str(error) or "eigenvalues" in str(error)
            more = f"set every mass and moment of inertia to zero, or to more than {LEAST:g} kg and kg m^2"
            remedy = more if small else "correct the MJCF"
            raise ModelFileError(f"MuJoCo cannot load the file ({error})", str(mjcf), remedy) from None
        thin = (self.model.body_mass > LEAST) & (self.model.body_inertia.min(axis=1) <= LEAST)
        self.thin = tuple(self.model.body(b).name for b in np.flatnonzero(thin))  # their inertias replace zeros
        prepare(self.model)
        if self.model.nq != self.model.nv:
            raise ModelFileError("has free or ball joints", str(mjcf), "use hinges and slides")
        self.file, self.gravity = mjcf, self.model.opt.gravity.copy()
        self.data = mujoco.MjData(self.model)
        self.engine = "mujoco" if file.cut == "minimal" else f"mujoco-{file.cut}"
        self.version = mujoco.__version__
        model = self.model
        self.coordinates = tuple(model.joint(j).name for j in range(model.njnt))
        names = {model.body(b).name: b for b in range(1, model.nbody)}
        self.ids = [b for name, b in names.items() if name != "ground"]
        self.bodies = tuple(name for name in names if name != "ground")
        self.parents = tuple(self._name(int(model.body_parentid[b])) for b in self.ids)
        self.masses, self.com = model.body_mass[self.ids].copy(), model.body_ipos[self.ids].copy()
        self.closures, self.couplings = self._closures(file), self._couplings(file)
        self.complete = curvature(self.model, self.couplings)
        self.hinges = model.jnt_type == mujoco.mjtJoint.mjJNT_HINGE
        self.moves = np.array([np.isin(model.jnt_bodyid, self._ancestors(b)) for b in (0, *self.ids)], dtype=float)
        data = self.data
        self.state, self.turning = DataBlock(data.qpos, data.qvel), DataBlock(data.cdof_dot, data.subtree_com)
        self.placed = DataBlock(data.xmat, data.xpos, data.xaxis, data.xanchor)
        self._check_motors(file)

    def open_model(self) -> mujoco.MjModel:
        """Return the file's model without equality constraints, for libraries that cannot disable them."""
        spec = editable(self.file, self.fixed)
        for constraint in [*spec.equalities]:
            spec.delete(constraint)
        model = spec.compile()
        prepare(model)
        return model

    def set_gravity(self, gravity: Array | None) -> None:
        self.model.opt.gravity[:] = self.gravity if gravity is None else gravity

    def _check_motors(self, file: LoopsFile) -> None:
        """Reject motors of the file that differ from the motors of the description."""
        wanted = {joint.coordinates[0] for joint in file.joints if joint.actuated}
        joint = int(mujoco.mjtTrn.mjTRN_JOINT)
        for k in range(self.model.nu if wanted <= set(self.coordinates) else 0):  # see `check_names`
            plain = self.model.actuator_gear[k, 0] == 1.0 and not self.model.actuator_biastype[k]
            on = self.model.actuator_trnid[k, 0] if self.model.actuator_trntype[k] == joint else -1
            if on < 0 or self.model.joint(on).name not in wanted or not plain:
                raise ModelFileError(
                    f"actuator {k} is not a motor with gear 1 on one of the joints {', '.join(sorted(wanted))}",
                    f"MJCF of {file.mechanism}",
                    "correct the actuator, or remove all actuators",
                )

    def _closures(self, file: LoopsFile) -> tuple[Closure, ...]:
        """Build the closures from the file's equality constraints and sites."""
        pairs_of: dict[str, list[tuple[int, int]]] = {}
        kinds: dict[str, int] = {}
        disabled = bool(self.model.opt.disableflags & (DISABLED | _CONSTRAINT))
        for e in range(self.model.neq):
            if disabled or not self.model.eq_active0[e]:
                raise ModelFileError(f"equality constraint {e} is disabled", f"MJCF of {file.mechanism}", "enable it")
            if coupling_reading(self.model, e):
                continue
            where = f"MJCF of {file.mechanism}, equality constraint {e}"
            if self.model.eq_type[e] not in _CLOSING:
                what = "its type is not supported, or it does not connect bodies, joints or fixed tendons"
                raise ModelFileError(what, where, 'use connect, weld or a joint equality, or set active="false"')
            if self.model.eq_objtype[e] != _SITE:
                raise ModelFileError("does not join two sites", where, "use site1 and site2")
            sites = int(self.model.eq_obj1id[e]), int(self.model.eq_obj2id[e])
            joint = self.model.site(sites[0]).name.split("@")[0]
            pairs_of.setdefault(joint, []).append(sites)
            kinds[joint] = int(self.model.eq_type[e])
        joints = {joint.name: joint for joint in file.joints}
        closures = [self._closure(joint, pairs, kinds[joint]) for joint, pairs in pairs_of.items()]
        return tuple(c.orient(joints[c.joint]) if c.joint in joints else c for c in closures)

    def _couplings(self, file: LoopsFile) -> tuple[Coupling, ...]:
        """Read couplings from the file's equalities, and solve each equality for the coordinate in the loops file.

        Raises:
            ModelFileError: The file lacks a coupling of the loops file, because no equality can express this coupling.
        """
        where = f"MJCF of {file.mechanism}"
        readings = {self.model.equality(i).name: coupling_reading(self.model, i) for i in range(self.model.neq)}
        coordinates = {one.name: one.coordinate for one in file.couplings}
        for coupling in file.couplings:
            if (lack := why_not(coupling)) and coupling.name not in readings:
                raise ModelFileError(f"lacks coupling '{coupling.name}': {lack}", where, "choose another engine")
        couplings = (
            Coupling(name, one.joint, one.function, f"{where}, equality '{name}'")
            for name, one in readings.items()
            if one
        )
        return tuple(one.solve_for(coordinates.get(one.name, "")) for one in couplings)

    def _closure(self, joint: str, pairs: list[tuple[int, int]], kind: int) -> Closure:
        model, weld = self.model, kind == mujoco.mjtEq.mjEQ_WELD
        bodies = [self._name(int(model.site_bodyid[site])) for site in pairs[0]]
        points = [np.array([model.site_pos[pair[side]] for pair in pairs]) for side in (0, 1)]
        frames = [Frame(model.site_pos[site].copy(), turn(model.site_quat[site])) for site in pairs[0]]
        return Closure(joint, "weld" if weld else "point", bodies[0], bodies[1], points[0], points[1], *frames)

    def _name(self, body: int) -> str:
        return (self.model.body(body).name if body else "") or "ground"

    def _ancestors(self, body: int) -> list[int]:
        """Return a body and its ancestors, excluding the world body."""
        return [body, *self._ancestors(int(self.model.body_parentid[body]))] if body else []

    def _inverse(self, q: Array, v: Array, a: Array, *, soft: bool = False) -> Iterator[int]:
        """Run `mj_inverse` on each sample and yield its index; equality constraints are disabled unless `soft`.

        If `soft`, the curvature of couplings, which MuJoCo omits, is added.
        """
        model, data, flags = self.model, self.data, self.model.opt.disableflags
        model.opt.disableflags = flags & ~DISABLED if soft else flags | DISABLED
        state, qacc, bent = self.state.block, data.qacc, self.complete if soft else None  # creating views is slow
        data.xfrc_applied[:] = 0.0
        for i, (x, xdd) in enumerate(zip(self.state.pack(q, v), a, strict=True)):
            state[:], qacc[:] = x, xdd
            mujoco.mj_inverse(model, data)
            if bent:
                bent(data)
                mujoco.mj_inverseSkip(model, data, VELOCITY_STAGE, 1)
            yield i
        model.opt.disableflags |= DISABLED

    def poses(self, q: Array) -> BodyPoses:
        n, model, data, bodies = len(q), self.model, self.data, [0, *self.ids]  # the first is the world body
        qpos, placed, rows = data.qpos, self.placed.block, self.placed.rows(n)
        for x, row in zip(q, rows, strict=True):
            qpos[:] = x
            mujoco.mj_kinematics(model, data)
            row[:] = placed
        turned, at, axes, anchors = self.placed.parts(rows)
        R, p = turned[:, bodies].reshape(n, -1, 3, 3), at[:, bodies]
        screws, slides = np.empty((n, 6, model.nv)), ~self.hinges
        screws[:, :3], screws[:, 3:] = axes.swapaxes(1, 2), cross(anchors, axes).swapaxes(1, 2)
        screws[:, :3, slides], screws[:, 3:, slides] = 0.0, axes[:, slides].swapaxes(1, 2)
        return BodyPoses(R, p, screws, self.moves)

    def bias(self, at: BodyPoses, q: Array, v: Array, V: Array) -> Array:
        model, data, state, turning = self.model, self.data, self.state.block, self.turning.block
        rows = self.turning.rows(len(q))
        for x, row in zip(self.state.pack(q, v), rows, strict=True):
            state[:] = x
            mujoco.mj_kinematics(model, data)
            mujoco.mj_comPos(model, data)
            mujoco.mj_comVel(model, data)
            row[:] = turning
        rates, about = self.turning.parts(rows)
        return at.bias(rates.swapaxes(1, 2), v, V, about[:, model.body_rootid[[0, *self.ids]]])

    def com_accelerations(self, q: Array, v: Array, a: Array) -> Array:
        model, data = self.model, self.data
        kept, state = (data.cvel, data.cacc, data.xipos, data.subtree_com), (data.qpos, data.qvel, data.qacc)
        V, A, at, about = (np.empty((len(q), *view.shape)) for view in kept)
        gravity = model.opt.gravity.copy()
        model.opt.gravity[:] = 0.0  # accelerations of bodies contain minus gravity
        for i in range(len(q)):
            state[0][:], state[1][:], state[2][:] = q[i], v[i], a[i]
            mujoco.mj_kinematics(model, data)
            mujoco.mj_comPos(model, data)
            mujoco.mj_comVel(model, data)
            mujoco.mj_rnePostConstraint(model, data)
            V[i], A[i], at[i], about[i] = kept
        model.opt.gravity[:] = gravity
        V, A, arms = V[:, self.ids], A[:, self.ids], at[:, self.ids] - about[:, model.body_rootid[self.ids]]
        A[..., 3:] += cross(V[..., :3], V[..., 3:])  # the library's accelerations are spatial
        return shifted(V, A, arms)

    def tree_force(self, q: Array, v: Array, a: Array) -> Array:
        out, force = np.empty_like(q), self.data.qfrc_inverse
        for i in self._inverse(q, v, a):
            out[i] = force
        return out

    def mass_matrix(self, q: Array) -> Array:
        model, data, units = self.model, self.data, np.eye(self.model.nv)
        out = np.empty((len(q), *units.shape))
        for x, M in zip(q, out, strict=True):
            data.qpos[:] = x
            mujoco.mj_fwdPosition(model, data)
            for unit, column in zip(units, M, strict=True):
                mujoco.mj_mulM(model, data, column, unit)
        return out

    def soft_force(self, q: Array, v: Array, a: Array, residuals: Array) -> tuple[Array, float]:
        """Run `mj_inverse` with soft equality constraints.

        Returns:
            Joint forces, and the largest joint force that the constraints' stiffness produces from closure residuals.
        """
        out, rows, data, force = np.empty_like(q), list[tuple[Array, ...]](), self.data, self.data.qfrc_inverse
        for i in self._inverse(q, v, a, soft=True):
            out[i] = force
            if m := data.nefc:
                kept = data.efc_KBIP.ravel()[: 4 * m], data.efc_D[:m], data.efc_J.ravel()[: m * len(force)]
                rows.append(tuple(view.copy() for view in kept))
        return out, self._soft_tolerance(rows, residuals)

    def _soft_tolerance(self, rows: list[tuple[Array, ...]], residuals: Array) -> float:
        """Return the largest joint force due to constraint forces ``D (k r + b rdot + rddot)``.

        Residuals r and their derivatives have the measured magnitudes.

        Args:
            rows: K, B, impedance and power of each sample's constraints, with D and their Jacobian.
        """
        if not rows:
            return 0.0
        (KBIP, D, J), first = (np.concatenate(x) for x in zip(*rows, strict=True)), [len(D) for _, D, _ in rows[:-1]]
        K, B, imp, _ = KBIP.reshape(-1, 4).T
        f = D * (K * imp * residuals[0] + B * residuals[1] + residuals[2])
        J = np.abs(J.reshape(len(f), -1)) * f[:, None]
        return float(np.add.reduceat(J, np.cumsum([0, *first])).max())

    def transmitted(self, at: BodyPoses, q: Array, v: Array, a: Array, wrench: Array) -> Array:
        model, data, ids, out = self.model, self.data, self.ids, np.zeros_like(wrench)
        force, moment = wrench[:, 1:, :3], wrench[:, 1:, 3:]
        external, kept = np.zeros((len(q), model.nbody, 6)), (data.cfrc_int, data.subtree_com)
        external[:, ids, :3] = force  # applied at the centre of mass
        external[:, ids, 3:] = moment - cross(times(at.R[:, 1:], self.com), force)
        felt, about = (np.empty((len(q), *view.shape)) for view in kept)
        applied = data.xfrc_applied
        for i in self._inverse(q, v, a):
            applied[:] = external[i]
            mujoco.mj_rnePostConstraint(model, data)
            felt[i], about[i] = kept
        out[:, 1:, :3] = felt[:, ids, 3:]
        out[:, 1:, 3:] = felt[:, ids, :3] + cross(about[:, model.body_rootid[ids]] - at.p[:, 1:], out[:, 1:, :3])
        return out
