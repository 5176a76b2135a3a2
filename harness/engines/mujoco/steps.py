"""MuJoCo's own stepper: `mj_step`, raw or from refined accelerations, with springs as its own.

A spring along a joint of the tree becomes that joint's stiffness and damping, one between points a spatial tendon
between two sites: exact equivalents, which the implicit integrators see. Constant motors and loads at centres of mass
are set once; all else is set at the start of every step and held over it.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np

from screwgauge.engines.mujoco.mover import MujocoMover
from screwgauge.engines.mujoco.settings import MujocoSettings, refine
from screwgauge.engines.mujoco.tree import MujocoTree, prepare
from screwgauge.engines.tree.applied_forces import TreeForces
from screwgauge.reference.applied import Applied, JointSpring, PointSpring
from screwgauge.reference.mechanism import GROUND
from screwgauge.reference.rotations import Array


@dataclass(frozen=True, slots=True, eq=False)
class Sprung:
    """A model that carries springs itself, and what is left to be applied in every step."""

    model: mujoco.MjModel
    left: Applied


def sprung_model(mjcf: Path, applied: Applied, tree: MujocoTree) -> Sprung:
    """Puts springs into a model: exact equivalents, which the implicit integrators see."""
    spec = mujoco.MjSpec.from_file(str(mjcf))
    tendons = {f"spring {i}": s for i, s in enumerate(applied.springs) if isinstance(s, PointSpring)}
    for name, spring in tendons.items():
        tendon = spec.add_tendon(name=name)
        tendon.springlength = [spring.rest, spring.rest]
        for body, point in ((spring.first, spring.first_point), (spring.second, spring.second_point)):
            (spec.body(body) or spec.worldbody).add_site(name=f"{name}.{body}", pos=point)
            tendon.wrap_site(f"{name}.{body}")
    model = spec.compile()
    prepare(model)
    for name, spring in tendons.items():
        k = model.tendon(name).id
        model.tendon_stiffness[k], model.tendon_damping[k] = spring.stiffness, spring.damping
    loads = tuple(load for load in applied.loads if load.point is not None and load.force.any())
    joints = (spring for spring in applied.springs if isinstance(spring, JointSpring))
    springs = tuple(spring for spring in joints if not joint_spring(model, spring, tree))
    motors = tuple(m for m in applied.motors if not (m.coordinate in tree.coordinates and m.constant))
    return Sprung(model, Applied(applied.gravity, loads, springs, motors))


def joint_spring(model: mujoco.MjModel, spring: JointSpring, tree: MujocoTree) -> bool:
    """Makes a spring the joint's own; False where that is cut or has one already."""
    if spring.coordinate not in tree.coordinates:
        return False
    j = tree.coordinates.index(spring.coordinate)
    dof = model.jnt_dofadr[j]
    if model.jnt_stiffness[j] or model.dof_damping[dof]:
        return False
    model.jnt_stiffness[j], model.dof_damping[dof] = spring.stiffness, spring.damping
    model.qpos_spring[model.jnt_qposadr[j]] = spring.rest
    return True


def _closing(model: mujoco.MjModel) -> tuple[str, ...]:
    """Names of the forces of the constraints in world axes, if all of them join points."""
    if (model.eq_type != mujoco.mjtEq.mjEQ_CONNECT).any():
        return ()
    return tuple(f"{model.equality(e).name}.f{axis}" for e in range(model.neq) for axis in "xyz")


class MujocoStepper:
    """`mj_step` or its parts. See `screwgauge.engines.tree.protocol.Stepper`."""

    def __init__(
        self, sprung: Sprung, tree: MujocoTree, applied: Applied, held: TreeForces, settings: MujocoSettings
    ) -> None:
        """Prepares the steps.

        Args:
            applied: All that acts; what never changes is set once.
            held: What has to be applied in every step.
        """
        self.model, self.held = sprung.model, held
        self.setting, self.passes = settings.steps, settings.passes
        settings.set_steps(self.model)
        self.model.opt.gravity[:] = tree.model.opt.gravity
        self.order = 4 if settings.integrator == "RK4" else 1
        self.data = mujoco.MjData(self.model)
        self.base, self.tau = np.zeros(self.model.nv), np.zeros(self.model.nv)
        self.mover, self.work, self.closing = MujocoMover(tree), settings.work, _closing(self.model)
        self.notes: tuple[str, ...] = (
            ("some forces vary with time or pose and are held over each step",) if held.acts else ()
        )
        self.advance = mujoco.mj_Euler if settings.integrator == "Euler" else mujoco.mj_implicit
        for motor in applied.motors:
            if motor not in sprung.left.motors:
                self.base[tree.coordinates.index(motor.coordinate)] += motor.force(0.0)
        for load in applied.loads:
            if load not in sprung.left.loads and load.body != GROUND:
                i = tree.ids[tree.bodies.index(load.body)]
                self.data.xfrc_applied[i] += np.concatenate([load.force, load.torque])

    def begin(self, t: float, q: Array, v: Array) -> None:
        self.data.time, self.data.qpos[:], self.data.qvel[:] = t, q, v

    def walk(self, t: float, h: float, n: int) -> tuple[Array, Array]:
        model, data = self.model, self.data
        model.opt.timestep = h
        if not self.held.acts and not self.passes:
            data.qfrc_applied[:] = self.base
            mujoco.mj_step(model, data, n)
            n = 0
        for i in range(n):
            self._apply(t + i * h)
            if not self.passes:
                mujoco.mj_step(model, data)
                continue
            mujoco.mj_forward(model, data)
            refine(model, data, data.qacc.copy(), self.passes)
            self.advance(model, data)
        return data.qpos.copy(), data.qvel.copy()

    def _apply(self, t: float) -> None:
        """Forces along the coordinates for the step to come."""
        data = self.data
        data.qfrc_applied[:] = self.base
        if self.held.acts:
            q, v = data.qpos.copy(), data.qvel.copy()
            self.mover.place(q, v)
            self.held.act(t, q, v, self.mover.body, self.tau)
            data.qfrc_applied[:] += self.tau

    def accelerations(self, t: float) -> tuple[Array, Array]:
        self._apply(t)
        mujoco.mj_forward(self.model, self.data)
        a: Array = self.data.qacc.copy()
        total = self.data.efc_force[: self.data.nefc].copy()
        refine(self.model, self.data, a, self.passes, total=total)
        self.data.qfrc_applied[:] = self.base
        return a, -total[: len(self.closing)]  # rows of equality constraints come first, for their first site
