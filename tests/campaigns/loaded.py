"""Inverse dynamics of MuJoCo on a file as it loads it, against those of the imported machine, joint by joint."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np

from screwgauge.models.importing.model import Imported
from screwgauge.models.readings.compiled import heard
from screwgauge.models.readings.mujoco import is_single, loaded
from screwgauge.models.readings.source import prepare
from screwgauge.reference.errors import ScrewgaugeError
from screwgauge.reference.resistance import without_resistance
from screwgauge.reference.rotations import Array
from screwgauge.scene.scene import Scene
from screwgauge.solution import Solution
from screwgauge.study.run import run

MOTION = ("joint_position", "joint_velocity", "joint_acceleration")


def apart(file: Path, imported: Imported, scene: Scene) -> float:
    """Largest difference over the largest force, constraints and dry friction off; NaN where it cannot be told.

    Compared are forces along the hinges and slides of the open tree: inertia, gravity, rotors, damping and springs. It
    cannot be told where MuJoCo refuses the file, or a body moves freely.
    """
    try:
        with heard():
            model = loaded(prepare(file))
    except ScrewgaugeError:
        return np.nan
    if not all(is_single(model, i) for i in range(model.njnt)):
        return np.nan
    scene = replace(scene, mechanism=without_resistance(scene.mechanism, "friction"))
    answer = run(scene, ["screw"], (*MOTION, "tree_force", "resistance")).solutions["screw"]
    names = [imported.names.get(model.joint(i).name, model.joint(i).name) for i in range(model.njnt)]
    ours = _forces(answer, scene)
    columns = [(i, name) for i, name in enumerate(names) if name in ours]
    there = [(model.jnt_dofadr[i], ours[name]) for i, name in columns]
    theirs = _inverse(model, answer, names)
    difference = max((float(np.abs(theirs[:, dof] - force).max()) for dof, force in there), default=np.nan)
    return difference / max(float(np.abs(theirs).max()), np.finfo(float).tiny)


def _forces(answer: Solution, scene: Scene) -> dict[str, Array]:
    """Coordinate of the tree -> force along it. Shape (n,)."""
    table = {quantity: dict(zip(v.components, v.array.T, strict=True)) for quantity, v in answer.values.items()}
    damping, forces = table["resistance"], dict(table["tree_force"])
    for name, force in forces.items():
        forces[name] = force + damping.get(f"{name}.damping", 0.0)
    for spring in scene.applied.springs:
        if spring.coordinate in forces:
            forces[spring.coordinate] = forces[spring.coordinate] + spring.pull(
                table["joint_position"][spring.coordinate], table["joint_velocity"][spring.coordinate]
            )
    return forces


def _inverse(model: mujoco.MjModel, answer: Solution, names: list[str]) -> Array:
    """``mj_inverse`` at all samples. Shape (n, n_v)."""
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONSTRAINT)
    data, out = mujoco.MjData(model), []
    q, qd, qdd = (dict(zip(answer.values[of].components, answer.values[of].array.T, strict=True)) for of in MOTION)
    for k in range(len(answer.condition)):
        for i, name in enumerate(names):
            if name in q:
                dof = model.jnt_dofadr[i]
                data.qpos[model.jnt_qposadr[i]] = q[name][k]
                data.qvel[dof], data.qacc[dof] = qd[name][k], qdd[name][k]
        mujoco.mj_inverse(model, data)
        out.append(data.qfrc_inverse.copy())
    return np.array(out)
