"""A forward problem stepped by MuJoCo itself, springs and dampers as its joints' own."""

from __future__ import annotations

from dataclasses import dataclass
from time import perf_counter
from typing import Any

import mujoco
import numpy as np

from screwgauge.bench.contestants_mujoco import STIFFEST
from screwgauge.engines.mujoco import MujocoTree
from screwgauge.forward.problem import ForwardProblem
from screwgauge.forward.tree_motion import loops_file, start_state
from screwgauge.reference.rotations import Array
from screwgauge.reference.springs import JointSpring
from screwgauge.stress.mujoco_steps import Setting, add_springs, soften


@dataclass(frozen=True, slots=True, eq=False)
class Stepped:
    """What stepping led to at the times asked for.

    Attributes:
        coordinates: Of the tree.
        q: Shape (n, n_v).
        energy: Kinetic, in gravity and springs [J]. Shape (n,).
        seconds: Wall time of the steps alone.
        warning: What MuJoCo warned of, empty if nothing.
    """

    coordinates: tuple[str, ...]
    q: Array
    energy: Array
    seconds: float
    warning: str


def step(problem: ForwardProblem, integrator: str, dt: float) -> Stepped:
    """Steps through the problem's times, with the hardest loops that MuJoCo has; steps are cut to fit the times."""
    file = loops_file(problem)
    tree = MujocoTree(problem.model, file, problem.gravity)
    q, v = start_state(problem, tree, file)
    model, data = tree.model, mujoco.MjData(tree.model)
    model.opt.disableflags &= ~int(mujoco.mjtDisableBit.mjDSBL_EQUALITY)
    model.opt.enableflags |= int(mujoco.mjtEnableBit.mjENBL_ENERGY)
    soften(model, Setting(integrator, impedance=STIFFEST))
    add_springs(model, [spring for spring in problem.springs if isinstance(spring, JointSpring)])
    data.qpos[:], data.qvel[:] = q, v
    said: list[str] = []
    mujoco.set_mju_user_warning(said.append)
    try:
        rows, seconds = _walk(model, data, problem.times, dt)
    finally:
        mujoco.set_mju_user_warning(None)
    states, energies = (np.array(part) for part in zip(*rows, strict=True))
    warning = "; ".join(dict.fromkeys(text.split(". ")[0] for text in said))
    return Stepped(tree.coordinates, states, energies, seconds, warning)


_Row = tuple[Array, float]


def _walk(model: Any, data: Any, times: Array, dt: float) -> tuple[list[_Row], float]:
    rows, seconds = [_look(model, data)], 0.0
    for whole in np.diff(times):
        n = int(np.ceil(whole / dt * (1 - 1e-12)))
        model.opt.timestep = whole / n
        start = perf_counter()
        mujoco.mj_step(model, data, n)
        seconds += perf_counter() - start
        rows.append(_look(model, data))
    return rows, seconds


def _look(model: Any, data: Any) -> _Row:
    mujoco.mj_forward(model, data)
    return data.qpos.copy(), float(data.energy.sum())
