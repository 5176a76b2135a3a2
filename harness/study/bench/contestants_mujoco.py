"""MuJoCo: `mj_inverse` projected and read naively, `mj_forward` over its softness, proximal refinement."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import mujoco
import numpy as np

from screwgauge.engines.mujoco.tree import MujocoTree
from screwgauge.models.loops import LoopsFile, read_loops
from screwgauge.reference.rotations import Array
from screwgauge.study.bench.case import Case
from screwgauge.study.bench.contestant import Contestant, Outcome, Task, count
from screwgauge.study.bench.contestants_tree import engine_paths, inverse_projected
from screwgauge.study.bench.projection import Given, given

IMPEDANCE = (0.9, 0.95, 0.99, 0.995, 0.999, 0.9995, 0.9999)
TIME_CONSTANTS = (0.1, 0.02, 0.005, 0.002)
PASSES = (1, 2, 3, 4, 5, 7, 11, 15, 20)
STIFFEST = 0.9999  # the largest impedance that MuJoCo takes
_NAME = "joint_acceleration"


def load(case: Case) -> tuple[MujocoTree, LoopsFile]:
    """The MJCF of the minimal cut, loaded."""
    problem = case.problem("mujoco", (_NAME,))
    assert problem.loops is not None
    file = read_loops(problem.loops)
    return MujocoTree(problem.model, file, problem.gravity), file


def path(quick: bool) -> list[Contestant]:
    """The engine as `screwgauge run` drives it."""
    return engine_paths("mujoco", load, "Newton on its own poses, rates, Jdot v, mj_inverse, projection")


def projected(quick: bool) -> list[Contestant]:
    """`mj_inverse` without its equality constraints on the true joint motion, then projection on the actuators."""
    return [inverse_projected(load, "mj_inverse, then projection", "mj_inverse", "mj_inverse + projection")]


def naive(quick: bool) -> list[Contestant]:
    """What `mj_inverse` says of the actuated joints, taken for the actuator forces."""

    def prepare(case: Case) -> Task:
        start = given(case, *load(case))
        model, data = with_equality(start)
        driven, load_at = list(start.driven), start.load

        def call() -> Array:
            out = np.empty((len(start.q), len(driven)))
            for i in range(len(out)):
                data.qpos[:], data.qvel[:], data.qacc[:] = start.q[i], start.v[i], start.a[i]
                mujoco.mj_inverse(model, data)
                out[i] = (data.qfrc_inverse - load_at[i])[driven]
            return out

        def read(array: Array) -> dict[str, Outcome]:
            return {"actuator_force": case.outcome("actuator_force", array)}

        return Task(call, read, len(start.q))

    covers = "from given joint motion: mj_inverse sample by sample, equality constraints on, loads taken off"
    setting = "qfrc_inverse of the actuated joints read as actuator forces"
    return [Contestant(setting, ("actuator_force",), covers, prepare, given=True, label="mj_inverse, read naively")]


def forward(quick: bool) -> list[Contestant]:
    """`mj_forward` with the true forces over the impedance d of the equality constraints."""

    def make(d: float) -> Contestant:
        return _forward(
            f"solimp d = {d:g}, solref default",
            lambda tree: soften(tree, d),
            parameter=("(1 - d) / d", (1 - d) / d),
            label=f"d {d:g}" if d in (0.9, 0.99, STIFFEST) else "",
            series="solimp",
        )

    shipped = _forward("all settings default", lambda tree: None, label="default", series="default")
    return [shipped, *(make(d) for d in IMPEDANCE)]


def solref(quick: bool) -> list[Contestant]:
    """The same over the time constant of solref, which acts on closure errors and there are none."""

    def make(constant: float) -> Contestant:
        return _forward(
            f"solimp d = {STIFFEST:g}, solref time constant = {constant:g} s",
            lambda tree: soften(tree, STIFFEST, constant),
            series="solref",
            drawn=False,
        )

    return [make(constant) for constant in TIME_CONSTANTS]


def refinement(quick: bool) -> list[Contestant]:
    """Proximal refinement: the last constraint force is applied from outside, and the step solved again."""

    def make(d: float, passes: int) -> Contestant:
        return _forward(
            f"solimp d = {d:g}, {count(passes, 'pass')}",
            lambda tree: soften(tree, d),
            passes=passes,
            series=f"d = {d:g}",
            parameter=("passes", float(passes)),
            label=count(passes, "pass"),
        )

    return [make(d, passes) for d in (0.9, STIFFEST) for passes in PASSES]


def soften(tree: MujocoTree, d: float, constant: float | None = None) -> None:
    """Sets the impedance of all equality constraints, and the time constant of their springs if one is given."""
    tree.model.eq_solimp[:, :2] = d
    if constant is not None:
        tree.model.eq_solref[:, 0] = constant
    tree.model.opt.tolerance = 1e-15  # the solver's own error stays below the softness that is looked at


def with_equality(start: Given) -> tuple[Any, Any]:
    """Model and data, equality constraints on."""
    tree = start.tree
    assert isinstance(tree, MujocoTree)
    tree.model.opt.disableflags &= ~int(mujoco.mjtDisableBit.mjDSBL_EQUALITY)
    return tree.model, tree.data


def _forward(setting: str, tune: Callable[[MujocoTree], None], *, passes: int = 0, **more: Any) -> Contestant:
    def prepare(case: Case) -> Task:
        tree, file = load(case)
        start = given(case, tree, file)
        tune(tree)
        call = forward_call(*with_equality(start), start, passes)

        def read(array: Array) -> dict[str, Outcome]:
            return {_NAME: case.outcome(_NAME, array, tree.coordinates)}

        return Task(call, read, len(start.q))

    more_passes = ", then mj_forwardSkip for each pass" if passes else ""
    covers = f"from given q, v and true forces: mj_forward sample by sample{more_passes}; tree accelerations only"
    return Contestant(setting, (_NAME,), covers, prepare, given=True, **more)


def forward_call(model: Any, data: Any, start: Given, passes: int) -> Callable[[], Array]:
    """A call that finds the accelerations for the true forces. Returns shape (n, n_v)."""
    q, v, tau, stage = start.q, start.v, start.applied(), int(mujoco.mjtStage.mjSTAGE_VEL)

    def call() -> Array:
        out = np.empty_like(q)
        for i in range(len(q)):
            data.qpos[:], data.qvel[:], data.qfrc_applied[:] = q[i], v[i], tau[i]
            data.qacc_warmstart[:] = 0.0
            mujoco.mj_forward(model, data)
            for _ in range(passes):
                data.qfrc_applied[:] += data.qfrc_constraint
                mujoco.mj_forwardSkip(model, data, stage, 1)
            out[i] = data.qacc
        return out

    return call
