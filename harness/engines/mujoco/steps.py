"""MuJoCo's own stepper: `mj_step`, raw or from refined accelerations, with springs as its own.

A spring along a joint of the tree becomes that joint's stiffness and damping, one between points a spatial tendon
between two sites: exact equivalents, which the implicit integrators see. Constant motors and loads at centres of mass
are set once; all else is set at the start of every step and held over it.
"""

from __future__ import annotations

from dataclasses import replace

import mujoco
import numpy as np

from screwgauge.engines.mujoco.mover import MujocoMover, refine
from screwgauge.engines.mujoco.tree import MujocoTree
from screwgauge.engines.tree.closure import make_loops
from screwgauge.engines.tree.forces import BodyAt, Forces, tree_forces
from screwgauge.engines.tree.start import loops_file
from screwgauge.engines.tree.stepper import Stepper
from screwgauge.engines.tree.steps import walk_through
from screwgauge.problem import ForwardProblem
from screwgauge.reference.applied import JointSpring, Load, Motor, PointSpring, Spring
from screwgauge.reference.errors import DescriptionError, UnknownNameError
from screwgauge.reference.mechanism import GROUND
from screwgauge.reference.rotations import Array
from screwgauge.solution import ForwardSolution

_NAMES = {
    "Euler": "mjINT_EULER",
    "implicit": "mjINT_IMPLICIT",
    "implicitfast": "mjINT_IMPLICITFAST",
    "RK4": "mjINT_RK4",
    "discrete": "mjINT_DISCRETE",
}
_EQUALITY = int(mujoco.mjtDisableBit.mjDSBL_EQUALITY)
_AUTORESET = int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)


def integrate(problem: ForwardProblem, stepper: Stepper) -> ForwardSolution:
    """Steps through a problem. See `screwgauge.forward.steppers.integrate_steps`."""
    warnings: list[str] = []
    # MuJoCo's own handler writes MUJOCO_LOG.TXT into the working directory
    mujoco.set_mju_user_warning(warnings.append)
    try:
        file = loops_file(problem)
        tree = MujocoTree(problem.model, file, problem.gravity)
        loops = make_loops(tree, file)
        tree_forces(problem, tree, loops)  # says which names are wrong before MuJoCo does
        model, left = sprung_model(problem, tree)
        model.opt.gravity[:] = problem.gravity
        _set(model, stepper)
        held = replace(problem, springs=(), motors=left.motors, loads=left.loads)
        walker = MujocoWalker(model, tree, stepper, tree_forces(held, tree, loops, left.springs))
        _constant(walker, problem, left)
        found = walk_through(problem, file, walker, stepper)
    finally:
        mujoco.set_mju_user_warning(None)
    notes = [f"MuJoCo warns: {text}" for text in dict.fromkeys(warnings)]
    if walker.held.elements:
        notes.append("some forces vary with time or pose and are held over each step")
    return replace(found, notes=tuple(notes))


class _Left:
    """What the model does not carry itself."""

    def __init__(self) -> None:
        self.springs: list[Spring] = []
        self.motors: tuple[Motor, ...] = ()
        self.loads: tuple[Load, ...] = ()


def sprung_model(problem: ForwardProblem, tree: MujocoTree) -> tuple[mujoco.MjModel, _Left]:
    """The model with the problem's springs in it, and what is left to be applied in every step."""
    spec, left = mujoco.MjSpec.from_file(str(problem.model)), _Left()
    tendons: dict[str, PointSpring] = {}
    for i, spring in enumerate(problem.springs):
        if isinstance(spring, PointSpring):
            tendons[name := f"spring {i}"] = spring
            tendon = spec.add_tendon(name=name)
            tendon.springlength = [spring.rest, spring.rest]
            sides = ((spring.first, spring.first_point), (spring.second, spring.second_point))
            for side, (body, point) in enumerate(sides):
                at = spec.body(body) or spec.worldbody
                at.add_site(name=f"{name}.{side}", pos=point)
                tendon.wrap_site(f"{name}.{side}")
    model = spec.compile()
    for name, spring in tendons.items():
        k = model.tendon(name).id
        model.tendon_stiffness[k], model.tendon_damping[k] = spring.stiffness, spring.damping
    for spring in problem.springs:
        if isinstance(spring, JointSpring) and not _joint_spring(model, spring, tree):
            left.springs.append(spring)
    left.motors = tuple(m for m in problem.motors if not _steady(m, tree))
    left.loads = tuple(load for load in problem.loads if load.point is not None and load.force.any())
    return model, left


def _joint_spring(model: mujoco.MjModel, spring: JointSpring, tree: MujocoTree) -> bool:
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


def _steady(motor: Motor, tree: MujocoTree) -> bool:
    return motor.coordinate in tree.coordinates and not motor.polynomial[1:].any() and not len(motor.harmonics)


def _constant(walker: MujocoWalker, problem: ForwardProblem, left: _Left) -> None:
    """Sets what never changes."""
    tree, data = walker.tree, walker.data
    for motor in problem.motors:
        if motor not in left.motors:
            walker.base[tree.coordinates.index(motor.coordinate)] += motor.force(0.0)
    for load in problem.loads:
        if load in left.loads:
            continue
        if load.body == GROUND:
            continue
        i = tree.ids[tree.bodies.index(load.body)]
        data.xfrc_applied[i, :3] += load.force
        data.xfrc_applied[i, 3:] += load.torque


def _set(model: mujoco.MjModel, stepper: Stepper) -> None:
    kind = getattr(mujoco.mjtIntegrator, _NAMES[stepper.integrator], None)
    if kind is None:
        raise UnknownNameError("integrator", stepper.integrator, _NAMES, f"MuJoCo {mujoco.__version__}")
    model.opt.integrator = kind
    model.opt.jacobian = mujoco.mjtJacobian.mjJAC_DENSE  # sparse ones are wrong in 4.0.0 (issue 3767)
    model.opt.disableflags &= ~_EQUALITY
    model.opt.disableflags |= _AUTORESET  # a state that is not finite is to be seen
    if stepper.solref is not None:
        model.eq_solref[:] = stepper.solref
    if stepper.solimp is not None:
        if not 0.0 < stepper.solimp <= 0.9999:
            raise DescriptionError(f"solimp {stepper.solimp:g}", "stepper of mujoco", "give a number up to 0.9999")
        model.eq_solimp[:, :2] = stepper.solimp
    if stepper.passes:
        model.opt.tolerance = 1e-15


class MujocoWalker:
    """`mj_step` or its parts. See `screwgauge.engines.tree.steps.Walker`."""

    def __init__(self, model: mujoco.MjModel, tree: MujocoTree, stepper: Stepper, held: Forces) -> None:
        self.model, self._tree, self.held, self.passes = model, tree, held, stepper.passes
        self.data = mujoco.MjData(model)
        self.base, self.tau = np.zeros(model.nv), np.zeros(model.nv)
        self.mover = MujocoMover(tree)
        self.advance = mujoco.mj_Euler if stepper.integrator == "Euler" else mujoco.mj_implicit

    @property
    def tree(self) -> MujocoTree:
        return self._tree

    def begin(self, t: float, q: Array, v: Array) -> None:
        self.data.time, self.data.qpos[:], self.data.qvel[:] = t, q, v

    def walk(self, t: float, h: float, n: int) -> None:
        model, data = self.model, self.data
        model.opt.timestep = h
        if not self.held.elements and not self.passes:
            data.qfrc_applied[:] = self.base
            mujoco.mj_step(model, data, n)
            return
        for i in range(n):
            self._apply(t + i * h)
            if not self.passes:
                mujoco.mj_step(model, data)
                continue
            mujoco.mj_forward(model, data)
            refine(model, data, data.qacc.copy(), self.passes)
            self.advance(model, data)

    def _apply(self, t: float) -> None:
        """Forces along the coordinates for the step to come."""
        data = self.data
        data.qfrc_applied[:] = self.base
        if self.held.elements:
            q, v = data.qpos.copy(), data.qvel.copy()
            self.held.act(t, q, v, self.look(q, v), self.tau)
            data.qfrc_applied[:] += self.tau

    def state(self) -> tuple[Array, Array]:
        return self.data.qpos.copy(), self.data.qvel.copy()

    def accelerations(self, t: float) -> Array:
        self._apply(t)
        mujoco.mj_forward(self.model, self.data)
        a: Array = self.data.qacc.copy()
        refine(self.model, self.data, a, self.passes)
        self.data.qfrc_applied[:] = self.base
        return a

    def look(self, q: Array, v: Array) -> BodyAt:
        self.mover.place(q, v)
        return self.mover.body
