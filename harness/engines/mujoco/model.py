"""The engines `mujoco` and `mujoco-full` run MuJoCo on an MJCF whose equality constraints close the loops."""

from __future__ import annotations

import copy
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from screwgauge.engines.mujoco.dynamics import MujocoMover, MujocoSettings, MujocoStepper, joint_spring, sprung_model
from screwgauge.engines.mujoco.equality_constraints import EXACT, curvature_notes, refine
from screwgauge.engines.mujoco.fixed import editable
from screwgauge.engines.mujoco.tree import MujocoTree, prepare
from screwgauge.engines.tree.applied_forces import TreeForces, resisting_joints, spring_pull
from screwgauge.engines.tree.closed_tree import ClosedTree, close_tree
from screwgauge.engines.tree.model import TreeModel, loops_file
from screwgauge.engines.tree.protocol import Accelerations, TreeDynamics
from screwgauge.models.mjcf import stand_in_sentence
from screwgauge.models.readings.compiled import collect_warnings
from screwgauge.problem import InitialValue, ModelFiles, Problem, Progress, quiet
from screwgauge.reference import linear
from screwgauge.reference.applied import JointSpring
from screwgauge.reference.rotations import Array
from screwgauge.solution import Solution, Stopwatch

#: Settings of `load`.
Settings = MujocoSettings


def load(files: ModelFiles, **settings: Any) -> MujocoModel:
    """Load an MJCF with its loops file; see `MujocoSettings`."""
    file = loops_file(files)
    with collect_warnings():
        tree = MujocoTree(files.model, file)
    return MujocoModel(close_tree(tree, file), MujocoDynamics(files.model, tree, MujocoSettings(**settings)))


class MujocoModel(TreeModel):
    """A tree model that collects MuJoCo's warnings, and reports small moments of inertia that replace zeros."""

    def __init__(self, closed: ClosedTree, dynamics: MujocoDynamics) -> None:
        super().__init__(closed, dynamics)
        self.thin = dynamics.tree.thin

    def solve(self, problem: Problem, progress: Progress = quiet) -> Solution:
        with collect_warnings() as warnings:
            solution = super().solve(problem, progress)
        warned_of = tuple(f"MuJoCo warns: {text}" for text in dict.fromkeys(warnings))
        steps = self.dynamics is not None and self.dynamics.dt is not None
        curves = curvature_notes(self.closed.tree.couplings, problem, own_steps=steps)
        noted = (*solution.notes, *stand_in_sentence(self.thin), *curves, *warned_of)
        return replace(solution, notes=noted, warnings=warned_of)


class MujocoDynamics(TreeDynamics):
    """Dynamics of an MJCF, see `screwgauge.engines.tree.protocol.TreeDynamics`."""

    def __init__(self, mjcf: Path, tree: MujocoTree, settings: MujocoSettings) -> None:
        self.mjcf, self.tree, self.settings = mjcf, tree, settings
        self.integrator, self.dt, self.naive = settings.integrator, settings.dt, settings.naive
        self.setting = settings.states
        settings.soften(tree.model)  # the tree enables and disables its constraints in each call
        self.model = _weld(mjcf, tree) if settings.weld else copy.deepcopy(tree.model)
        settings.soften(self.model)
        if settings.solimp is not None:
            self.model.opt.tolerance = EXACT
        self.data = mujoco.MjData(self.model)

    def mover(self) -> MujocoMover:
        return MujocoMover(self.tree)

    def stepper(self, closed: ClosedTree, problem: Problem, task: InitialValue) -> MujocoStepper:
        applied = problem.applied
        TreeForces(closed, applied, task.start)  # rejects wrong names before MuJoCo does
        model, left, resist = sprung_model(self.mjcf, applied, resisting_joints(closed), self.tree)
        held = TreeForces(closed, left, task.start, resist)
        return MujocoStepper(model, self.tree, applied, held, self.settings)

    def accelerate(self, q: Array, v: Array, tau: Array, springs: Sequence[JointSpring]) -> Accelerations:
        model, data = self.model, self.data
        if springs:  # springs become stiffness of the model's joints where possible
            model = copy.deepcopy(model)
            left = [spring for spring in springs if not joint_spring(model, spring, self.tree)]
            tau = sum((spring_pull(spring, self.tree, q, v) for spring in left), tau)
            data = mujoco.MjData(model)
        out, clock = np.empty_like(q), Stopwatch()
        model.opt.gravity[:] = self.tree.model.opt.gravity
        for i in range(len(q)):
            data.qpos[:], data.qvel[:], data.qfrc_applied[:] = q[i], v[i], tau[i]
            data.qacc_warmstart[:] = 0.0
            if self.settings.weld:
                with clock.pause():
                    _align(model, data)
            mujoco.mj_forward(model, data)
            out[i] = data.qacc
            refine(model, data, out[i], self.settings.passes, same=0.0)
        cost = clock.cost(evaluations=len(q))
        if not self.settings.examine:
            return Accelerations(out, cost)
        J = data.efc_J[: data.nefc * model.nv].reshape(-1, model.nv).copy()
        moved = np.empty_like(J)
        mujoco.mj_solveM(model, data, moved, J)
        # J M^-1 J^T + R at the last state, with MuJoCo's regularisation R
        condition = linear.condition(J @ moved.T + np.diag(data.efc_R[: len(J)]))
        freedoms = model.nv - linear.rank(J)
        return Accelerations(out, cost, np.full(len(q), condition), {}, (f"rank leaves {freedoms} freedoms",))


def _weld(mjcf: Path, tree: MujocoTree) -> mujoco.MjModel:
    """Build the model; for each closure, weld the frames of the cut joint."""
    spec, kinds = editable(mjcf, tree.fixed), mujoco.mjtEq
    for row in [row for row in spec.equalities if row.type != kinds.mjEQ_JOINT]:
        spec.delete(row)
    for closure in tree.closures:
        sides = {"name1": f"{closure.joint}@parent", "name2": f"{closure.joint}@child"}
        spec.add_equality(name=closure.joint, type=kinds.mjEQ_WELD, objtype=mujoco.mjtObj.mjOBJ_SITE, **sides)
    model = spec.compile()
    prepare(model)
    return model


def _align(model: mujoco.MjModel, data: mujoco.MjData) -> None:
    """Rotate the second frame of every weld to agree with the first."""
    mujoco.mj_kinematics(model, data)
    for e in range(model.neq):
        if model.eq_type[e] == mujoco.mjtEq.mjEQ_WELD:
            first, second = model.eq_obj1id[e], model.eq_obj2id[e]
            body = data.xmat[model.site_bodyid[second]].reshape(3, 3)
            turn = body.T @ data.site_xmat[first].reshape(3, 3)
            mujoco.mju_mat2Quat(model.site_quat[second], turn.ravel())
