"""MuJoCo's dynamics of a closed tree: accelerations as accurate as possible, and MuJoCo's own stepper.

`MujocoMover` refines the accelerations of `mj_forward`, state by state. `MujocoStepper` calls `mj_step`, or
steps from refined accelerations. Springs become elements of the MuJoCo model, so that its implicit integrators include
them: a spring along a tree joint becomes the joint's stiffness and damping, and a spring between points becomes a
spatial tendon between two sites. Constant motors, and constant loads at centres of mass in world axes, are set once.
All other forces are set at the start of every step and kept constant over the step.
"""

from __future__ import annotations

import copy
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np

from screwgauge.engines.mujoco.equality_constraints import (
    DISABLED,
    EXACT,
    HARDER,
    PASSES,
    STIFFEST,
    VELOCITY_STAGE,
    curvature,
    harden,
    refine,
)
from screwgauge.engines.mujoco.fixed import editable
from screwgauge.engines.mujoco.tree import MujocoTree, prepare
from screwgauge.engines.tree.applied_forces import TreeForces
from screwgauge.reference.applied import Applied, JointSpring, Load, PointSpring
from screwgauge.reference.errors import DescriptionError, SingularPoseError, UnknownNameError, check_choice
from screwgauge.reference.mechanism import GROUND
from screwgauge.reference.resistance import Resistance
from screwgauge.reference.rotations import Array

#: Integrator -> its name in MuJoCo; ``discrete`` needs MuJoCo 4.0.
INTEGRATORS = {
    "Euler": "mjINT_EULER",
    "implicit": "mjINT_IMPLICIT",
    "implicitfast": "mjINT_IMPLICITFAST",
    "RK4": "mjINT_RK4",
    "discrete": "mjINT_DISCRETE",
}
#: Integrators that can step from refined accelerations; the others solve for accelerations internally.
REFINABLE = ("Euler", "implicit", "implicitfast")
_AUTORESET = int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)
#: Change in the last pass, relative to the largest acceleration, above which accelerations are unreliable.
UNSAFE = 1e-6


class MujocoMover:
    """Mover that refines the accelerations of `mj_forward`, see `screwgauge.engines.tree.protocol.Mover`."""

    def __init__(self, tree: MujocoTree) -> None:
        self.tree = tree
        self.model = copy.deepcopy(tree.model)  # the tree disables the equality constraints of its own model
        harden(self.model)
        self.data = mujoco.MjData(self.model)
        self.passes = PASSES if self.model.neq else 0
        self.complete = curvature(self.model, tree.couplings)
        hard = f"solimp {STIFFEST:g}, body_invweight0 / {HARDER:g}, at most {PASSES} refinements"
        self.setting = f"mj_forward, {hard}" if self.passes else "mj_forward"
        self.made = self.most = self.calls = 0

    def place(self, q: Array, v: Array) -> None:
        self.data.qpos[:], self.data.qvel[:] = q, v
        mujoco.mj_fwdPosition(self.model, self.data)
        mujoco.mj_fwdVelocity(self.model, self.data)
        if self.complete:
            self.complete(self.data)

    def body(self, index: int) -> tuple[Array, Array, Array]:
        J = np.zeros((6, self.model.nv))
        if index == 0:
            return np.eye(3), np.zeros(3), J
        i = self.tree.ids[index - 1]
        mujoco.mj_jacBody(self.model, self.data, J[3:], J[:3], i)
        return self.data.xmat[i].reshape(3, 3), self.data.xpos[i], J

    def closure(self) -> tuple[Array, Array]:
        rows, n_v = self.data.ne, self.model.nv  # limits and contacts of a user's file do not close loops
        return self.data.efc_pos[:rows].copy(), self.data.efc_J[: rows * n_v].reshape(rows, n_v).copy()

    def accelerate(self, tau: Array) -> Array:
        model, data = self.model, self.data
        data.qfrc_applied[:] = tau
        mujoco.mj_forwardSkip(model, data, VELOCITY_STAGE, 1)
        a: Array = data.qacc.copy()
        made, change = refine(model, data, a, self.passes)
        self.calls, self.made, self.most = self.calls + 1, self.made + made, max(self.most, made)
        size = float(np.abs(a).max())
        # written so that NaN is refused
        if not change <= UNSAFE * max(size, 1.0) < np.inf:
            raise SingularPoseError(
                f"MuJoCo's accelerations are unreliable: the largest is {size:.3g}, and refinement {made} still "
                f"changed one of them by {change:.3g}",
                f"{self.tree.engine}, q = {np.array2string(data.qpos[:8], precision=4)}",
                "step over the pose, or check the masses and loops of the MJCF",
            )
        return a

    @property
    def notes(self) -> tuple[str, ...]:
        note = f"{self.made / max(self.calls, 1):.1f} refinements on average, at most {self.most}"
        return (note,) if self.passes else ()


@dataclass(frozen=True, slots=True)
class MujocoSettings:
    """Settings for accelerations and steps; None keeps the file's value or MuJoCo's default.

    SciPy's methods ignore these settings; they integrate refined accelerations with constraints as hard as possible.

    Attributes:
        solimp: Impedance d of the equality constraints, independent of the closure residual; at most 0.9999.
        solref: Time constant [s] of the constraint springs, optionally with the damping ratio.
        passes: Number of proximal refinements for given states; in a step, the upper limit.
        naive: Take actuator forces from `mj_inverse` with equality constraints enabled.
        weld: Close each loop by welding the two frames of its cut joint, which are first aligned at each given state.
        examine: Examine the conditioning of given states.
        integrator, dt: An entry of `INTEGRATORS` and its step [s]; `dt` is None for SciPy's methods.
        work: Examine every step to compute the input work, which takes longer than the steps themselves.
    """

    solimp: float | None = None
    solref: float | tuple[float, float] | None = None
    passes: int = 0
    naive: bool = False
    weld: bool = False
    examine: bool = False
    integrator: str = "Euler"
    dt: float | None = None
    work: bool = True

    def __post_init__(self) -> None:
        where = "stepper of mujoco"
        check_choice("integrator", [self.integrator], INTEGRATORS, where)
        if self.dt is not None and not 0.0 < self.dt < np.inf:
            raise DescriptionError(f"the step is {self.dt:g} s", where, "use a positive number")
        if self.solimp is not None and not 0.0 < self.solimp <= STIFFEST:
            raise DescriptionError(f"solimp is {self.solimp:g}", where, "use a positive number up to 0.9999")
        if self.dt is not None and self.passes and self.integrator not in REFINABLE:
            raise DescriptionError(
                f"{self.integrator} cannot step from refined accelerations",
                where,
                f"use {', '.join(REFINABLE)}, or remove passes",
            )

    def soften(self, model: mujoco.MjModel) -> None:
        """Enable equality constraints and apply their settings."""
        model.opt.disableflags &= ~DISABLED
        if self.solimp is not None:
            model.eq_solimp[:, :2] = self.solimp
        if self.solref is not None:
            model.eq_solref[:, : np.size(self.solref)] = self.solref

    def set_steps(self, model: mujoco.MjModel) -> None:
        """Apply the settings of the constraints and the integrator to a model that takes steps.

        Raises:
            UnknownNameError: This version of MuJoCo lacks the integrator.
        """
        kind = getattr(mujoco.mjtIntegrator, INTEGRATORS[self.integrator], None)
        if kind is None:
            raise UnknownNameError("integrator", self.integrator, INTEGRATORS, f"MuJoCo {mujoco.__version__}")
        self.soften(model)
        model.opt.integrator = kind
        model.opt.timestep = self.dt or model.opt.timestep  # `discrete` accelerations depend on it
        model.opt.disableflags |= _AUTORESET  # non-finite states must stay visible
        if self.passes:
            model.opt.tolerance = EXACT

    @property
    def steps(self) -> str:
        """Description of the stepper."""
        solref = self.solref if isinstance(self.solref, tuple) else (self.solref,)
        spring = " ".join("default" if x is None else f"{x:g}" for x in solref)
        return f"{self.integrator}, dt {self.dt:g} s, solref {spring}, {self._constraints('at most ')}"

    @property
    def states(self) -> str:
        """Description of how accelerations of given states are computed."""
        return f"mj_forward, {self._constraints()}"

    def _constraints(self, most: str = "") -> str:
        solimp = "default" if self.solimp is None else f"{self.solimp:g}"
        return f"solimp {solimp}, {f'{most}{self.passes} refinements' if self.passes else 'raw'}"


def sprung_model(
    mjcf: Path, applied: Applied, resist: Sequence[Resistance], tree: MujocoTree
) -> tuple[mujoco.MjModel, Applied, list[Resistance]]:
    """Represent springs and dampers by exactly equivalent elements of the model, which implicit integrators include.

    Returns:
        The model, and the forces and resistances that remain to be applied in every step.
    """
    spec = editable(mjcf, tree.fixed)
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
    loads = tuple(one for one in applied.loads if one.courses or one.axes == "body" or _off_centre(one))
    joints = (spring for spring in applied.springs if isinstance(spring, JointSpring))
    springs = tuple(spring for spring in joints if not joint_spring(model, spring, tree))
    motors = tuple(m for m in applied.motors if not (m.coordinate in tree.coordinates and m.course.constant))
    left = list[Resistance]()
    for one in resist:
        if one.what == "damping" and one.coordinate in tree.coordinates:
            model.dof_damping[model.jnt_dofadr[tree.coordinates.index(one.coordinate)]] += one.amount
        else:
            left.append(one)
    return model, Applied(applied.gravity, loads, springs, motors), left


def _off_centre(load: Load) -> bool:
    """Return True if the load's moment about the centre of mass changes with the body's orientation."""
    return load.point is not None and bool(load.force.any())


def joint_spring(model: mujoco.MjModel, spring: JointSpring, tree: MujocoTree) -> bool:
    """Add a spring to its joint in the model; return False if the joint is cut or already has a spring."""
    if spring.coordinate not in tree.coordinates:
        return False
    j = tree.coordinates.index(spring.coordinate)
    dof = model.jnt_dofadr[j]
    if model.jnt_stiffness[j] or model.dof_damping[dof]:
        return False
    model.jnt_stiffness[j], model.dof_damping[dof] = spring.stiffness, spring.damping
    model.qpos_spring[model.jnt_qposadr[j]] = spring.rest
    return True


def _force_names(model: mujoco.MjModel) -> tuple[str, ...]:
    """Return the names of the constraint forces in world axes; empty unless all constraints connect points."""
    if (model.eq_type != mujoco.mjtEq.mjEQ_CONNECT).any():
        return ()
    return tuple(f"{model.equality(e).name}.f{axis}" for e in range(model.neq) for axis in "xyz")


class MujocoStepper:
    """Stepper that calls `mj_step` or its stages, see `screwgauge.engines.tree.protocol.Stepper`."""

    def __init__(
        self, model: mujoco.MjModel, tree: MujocoTree, applied: Applied, held: TreeForces, settings: MujocoSettings
    ) -> None:
        """Prepare the steps.

        Args:
            applied: All applied forces; constant forces are set once.
            held: Forces to apply at each step.
        """
        self.model, self.held = model, held
        self.setting, self.passes = settings.steps, settings.passes
        settings.set_steps(self.model)
        self.model.opt.gravity[:] = tree.model.opt.gravity
        self.order = 4 if settings.integrator == "RK4" else 1
        self.data = mujoco.MjData(self.model)
        self.base, self.tau = np.zeros(self.model.nv), np.zeros(self.model.nv)
        self.mover, self.work, self.closing = MujocoMover(tree), settings.work, _force_names(self.model)
        self.notes: tuple[str, ...] = (
            ("forces that vary with time or pose are held constant over each step",) if held.acts else ()
        )
        self.advance = mujoco.mj_Euler if settings.integrator == "Euler" else mujoco.mj_implicit
        for motor in applied.motors:
            if motor not in held.applied.motors:
                self.base[tree.coordinates.index(motor.coordinate)] += motor.force(0.0)
        for load in applied.loads:
            if load not in held.applied.loads and load.body != GROUND:
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
        """Set the forces along the coordinates for the next step."""
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
        return a, -total[: len(self.closing)]  # equality rows come first; their forces act on the first site
