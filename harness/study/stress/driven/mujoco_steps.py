"""A held scene in MuJoCo: loaded, set to its first state, and stepped by MuJoCo's own integrators."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from typing import Any

import mujoco
import numpy as np

from screwgauge.engines.mujoco.tree import MujocoTree
from screwgauge.models.generate import stem, write_models
from screwgauge.models.loops import read_loops
from screwgauge.reference.applied import JointSpring
from screwgauge.reference.rotations import Array
from screwgauge.scene.scene import Scene
from screwgauge.study.stress.driven.held import Held


@dataclass(frozen=True, slots=True)
class Setting:
    """How MuJoCo is set.

    Attributes:
        integrator: As in ``mjtIntegrator``, without its prefix.
        impedance: The constant d of solimp; the default ramp from 0.9 to 0.95 if None.
        constant: Time constant of solref [s]; the default, 0.02 s, if None.
        passes: Passes of proximal refinement at every step; needs the integrator EULER.
    """

    integrator: str = "EULER"
    impedance: float | None = None
    constant: float | None = None
    passes: int = 0


@dataclass(frozen=True, slots=True, eq=False)
class Stepped:
    """What stepping led to, at the times asked for.

    Attributes:
        coordinates: Of the tree.
        q: Their values [rad or m]. Shape (n, n_v).
        gap: Largest distance between two points that a constraint keeps together [m]. Shape (n,).
        force: Constraint forces by the names of the reactions [N], on the child side. Shape (n, m).
        names: Their names.
        energy: Kinetic and in gravity [J]. Shape (n,).
        seconds: Wall time of the steps alone.
        warning: What MuJoCo warned of, empty if nothing.
    """

    coordinates: tuple[str, ...]
    q: Array
    gap: Array
    force: Array
    names: tuple[str, ...]
    energy: Array
    seconds: float
    warning: str


def has_integrator(name: str) -> bool:
    """Whether this version of MuJoCo has an integrator."""
    return hasattr(mujoco.mjtIntegrator, f"mjINT_{name}")


def load_tree(scene: Scene) -> MujocoTree:
    """The MJCF of the minimal cut, loops closed by soft constraints."""
    with tempfile.TemporaryDirectory(prefix="screwgauge-") as folder:
        write_models(scene.mechanism, Path(folder), gravity=scene.gravity)
        name = stem(scene.mechanism.name, "minimal")
        file = read_loops(Path(folder) / f"{name}.loops.toml")
        return MujocoTree(Path(folder) / f"{name}.xml", file, scene.gravity)


def add_springs(model: Any, springs: Iterable[JointSpring]) -> None:
    """Springs and dampers as the joints' own, which implicit integrators see."""
    for spring in springs:
        joint = model.joint(spring.coordinate)
        model.jnt_stiffness[joint.id] = spring.stiffness
        model.qpos_spring[joint.qposadr[0]] = spring.rest
        model.dof_damping[joint.dofadr[0]] = spring.damping


def soften(model: Any, setting: Setting) -> None:
    """Sets integrator and softness; with refinement the solver's own error stays below what is looked at."""
    model.opt.integrator = getattr(mujoco.mjtIntegrator, f"mjINT_{setting.integrator}")
    if setting.impedance is not None:
        model.eq_solimp[:, :2] = setting.impedance
    if setting.constant is not None:
        model.eq_solref[:, 0] = setting.constant
    if setting.passes:
        model.opt.tolerance = 1e-15


def refined(model: Any, data: Any, passes: int) -> Array:
    """Proximal refinement: the last constraint force is applied from outside, and the step solved again.

    Returns:
        The constraint forces of all passes together. Shape (n_row,).
    """
    stage, given = int(mujoco.mjtStage.mjSTAGE_VEL), data.qfrc_applied.copy()
    mujoco.mj_forward(model, data)
    total = data.efc_force[: data.nefc].copy()
    for _ in range(passes):
        data.qfrc_applied[:] += data.qfrc_constraint
        mujoco.mj_forwardSkip(model, data, stage, 1)
        total += data.efc_force[: data.nefc]
    data.qfrc_applied[:] = given
    return np.asarray(total)


def step(held: Held, setting: Setting, dt: float) -> Stepped:
    """Steps a held scene through its times; dt is made a whole part of their distance."""
    tree = load_tree(held.scene)
    model, data = tree.model, tree.data
    soften(model, setting)
    model.opt.enableflags |= int(mujoco.mjtEnableBit.mjENBL_ENERGY)
    columns, start = held.columns(tree.coordinates), held.path.rates
    data.qpos[:], data.qvel[:] = start.pose.q[0, columns], start.w[0, columns]
    data.ctrl[:] = held.forces.actuators
    for load in held.scene.loads:  # at centres of mass, as in the default scene
        i = model.body(load.body).id
        data.xfrc_applied[i] += np.concatenate([load.force, load.torque])
    whole = float(held.t[1] - held.t[0])
    n = int(np.ceil(whole / dt * (1 - 1e-12)))
    model.opt.timestep = whole / n
    said: list[str] = []
    mujoco.set_mju_user_warning(said.append)
    try:
        rows, seconds = _walk(model, data, setting.passes, n, len(held.t))
    finally:
        mujoco.set_mju_user_warning(None)
    q, gap, force, energy = (np.array(part) for part in zip(*rows, strict=True))
    names = tuple(f"{model.equality(e).name}.f{axis}" for e in range(model.neq) for axis in "xyz")
    warning = "; ".join(dict.fromkeys(text.split(". ")[0] for text in said))
    return Stepped(tree.coordinates, q, gap, force, names, energy, seconds, warning)


_Row = tuple[Array, float, Array, float]


def _walk(model: Any, data: Any, passes: int, n: int, samples: int) -> tuple[list[_Row], float]:
    """Steps from sample to sample; what is looked at there costs no time."""
    advance = _refined_steps(model, data, passes) if passes else lambda: mujoco.mj_step(model, data, n)
    rows, seconds = [_look(model, data, passes)], 0.0
    for _ in range(samples - 1):
        start = perf_counter()
        for _ in range(n if passes else 1):
            advance()
        seconds += perf_counter() - start
        rows.append(_look(model, data, passes))
    return rows, seconds


def _refined_steps(model: Any, data: Any, passes: int) -> Callable[[], None]:
    def advance() -> None:
        refined(model, data, passes)
        mujoco.mj_Euler(model, data)

    return advance


def _look(model: Any, data: Any, passes: int) -> _Row:
    """Coordinates, loop gap, forces on the child side, energy."""
    total = refined(model, data, passes)
    here, there = data.site_xpos[model.eq_obj1id], data.site_xpos[model.eq_obj2id]
    gap = float(np.linalg.norm(here - there, axis=1).max())
    return data.qpos.copy(), gap, -total, float(data.energy.sum())
