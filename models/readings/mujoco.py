"""What MuJoCo reads from a URDF or MJCF."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any

import numpy as np

from screwgauge.models.mjcf import LEAST
from screwgauge.models.readings.assemble import Assembly, Link, assemble, matrix, screw
from screwgauge.models.readings.reading import ClosureReading, CouplingReading, JointReading, Reading
from screwgauge.models.readings.source import Source
from screwgauge.reference.errors import ModelFileError
from screwgauge.reference.rotations import Array

#: By MuJoCo's numbers.
_KINDS = ("free", "ball", "slide", "hinge")
_CONNECT, _WELD, _JOINT = range(3)


def read_mujoco(source: Source, home: Mapping[str, float]) -> Reading:
    """Reads a URDF or MJCF by MuJoCo. Tensors are rebuilt from the principal axes that MuJoCo keeps.

    Raises:
        ModelFileError: MuJoCo refuses it.
    """
    import mujoco

    with _quiet():
        try:
            spec = mujoco.MjSpec.from_string(source.text)
            if source.form == "urdf":
                spec.compiler.fusestatic = False  # links keep their names
            model = spec.compile()
        except (ValueError, mujoco.FatalError) as error:
            raise ModelFileError(f"MuJoCo refuses it ({error})", str(source.path), "mend the file") from None
        data = mujoco.MjData(model)
        for i in range(model.njnt):
            if model.jnt_type[i] >= 2:
                data.qpos[model.jnt_qposadr[i]] = home.get(model.joint(i).name, model.qpos0[model.jnt_qposadr[i]])
        mujoco.mj_kinematics(model, data)
    assembly = assemble(_links(model, data, source), str(source.path))
    ignored = [*source.ignored]
    closures, couplings = _equalities(model, assembly, ignored)
    return Reading(
        source.name,
        "mujoco",
        assembly.bodies,
        {model.joint(i).name: _joint(model, data, i) for i in range(model.njnt)},
        assembly.fixed,
        closures,
        couplings,
        _actuators(model, ignored),
        _gravity(model, source),
        (float(model.opt.density), float(model.opt.viscosity)),
        tuple(ignored),
    )


@contextmanager
def _quiet() -> Iterator[None]:
    """MuJoCo's own handler of warnings writes MUJOCO_LOG.TXT into the working directory."""
    import mujoco

    mujoco.set_mju_user_warning(lambda text: None)
    try:
        yield
    finally:
        mujoco.set_mju_user_warning(None)


def _disabled(model: Any, flag: str) -> bool:
    import mujoco

    return bool(model.opt.disableflags & int(getattr(mujoco.mjtDisableBit, f"mjDSBL_{flag}")))


def _gravity(model: Any, source: Source) -> Array | None:
    if source.form == "urdf" and source.root.find("mujoco/option") is None:
        return None
    gravity: Array = np.zeros(3) if _disabled(model, "GRAVITY") else model.opt.gravity.copy()
    return gravity


def _links(model: Any, data: Any, source: Source) -> Iterator[Link]:
    names = [model.body(i).name for i in range(model.nbody)]
    root = source.root_link
    if root:  # MuJoCo merges the first link of a URDF into the world
        yield Link(root, "", (), 0.0, np.zeros(3), np.zeros((3, 3)), np.eye(4))
    for i in range(1, model.nbody):
        R = _rotation(model.body_iquat[i])
        above = model.body_parentid[i]
        first = model.body_jntadr[i]
        solid = model.body_mass[i] > LEAST
        yield Link(
            names[i],
            names[above] if above else root,
            tuple(model.joint(first + k).name for k in range(model.body_jntnum[i])),
            float(model.body_mass[i]) if solid else 0.0,
            model.body_ipos[i].copy() if solid else np.zeros(3),
            R @ np.diag(model.body_inertia[i]) @ R.T if solid else np.zeros((3, 3)),
            matrix(data.xpos[i], data.xmat[i].reshape(3, 3)),
            float(model.body_gravcomp[i]),
        )


def _rotation(quaternion: Array) -> Array:
    import mujoco

    R = np.zeros(9)
    mujoco.mju_quat2Mat(R, quaternion)
    return R.reshape(3, 3)


def _joint(model: Any, data: Any, i: int) -> JointReading:
    kind, at, dof = _KINDS[model.jnt_type[i]], model.jnt_qposadr[i], model.jnt_dofadr[i]
    single = kind in ("hinge", "slide")
    axis, anchor = data.xaxis[i].copy(), data.xanchor[i].copy()
    limited = single and model.jnt_limited[i] and not _disabled(model, "LIMIT")
    return JointReading(
        kind,
        screw(kind == "hinge", axis, anchor) if single else np.zeros(6),
        data.xpos[model.jnt_bodyid[i]].copy() if kind == "free" else anchor,
        float(data.qpos[at]) if single else 0.0,
        (float(model.jnt_range[i, 0]), float(model.jnt_range[i, 1])) if limited else (-math.inf, math.inf),
        float(model.dof_armature[dof]),
        0.0 if _disabled(model, "DAMPER") else float(model.dof_damping[dof]),
        0.0 if _disabled(model, "FRICTIONLOSS") else float(model.dof_frictionloss[dof]),
        0.0 if _disabled(model, "SPRING") else float(model.jnt_stiffness[i]),
        float(model.qpos_spring[at]) if single else 0.0,
    )


def _equalities(
    model: Any, assembly: Assembly, ignored: list[str]
) -> tuple[dict[str, ClosureReading], dict[str, CouplingReading]]:
    """Closures and couplings; what is neither is said in `ignored`."""
    closures, couplings = {}, {}
    for i in range(model.neq):
        name, kind = model.equality(i).name, int(model.eq_type[i])
        if not model.eq_active0[i] or _disabled(model, "EQUALITY") or _disabled(model, "CONSTRAINT"):
            ignored.append(f"equality {name}, which is not active")
        elif kind == _JOINT:
            couplings[name] = _coupling(model, i)
        elif kind in (_CONNECT, _WELD):
            sides = _sides(model, i, assembly)
            closures[name] = ClosureReading("weld" if kind == _WELD else "point", *sides[0], *sides[1])
        else:
            ignored.append(f"equality {name}, which is not of bodies or joints")
    return closures, couplings


def _sides(model: Any, i: int, assembly: Assembly) -> list[tuple[str, Array]]:
    """Bodies and the frames in them that an equality keeps together.

    MuJoCo has computed the second anchor at qpos0. Of a weld it keeps the anchor in the second body, then where the
    second body's axes and that anchor are in the first.
    """
    import mujoco

    first, second, data = model.eq_obj1id[i], model.eq_obj2id[i], model.eq_data[i]
    if model.eq_objtype[i] == mujoco.mjtObj.mjOBJ_SITE:
        sites = (first, second)
        frames = [matrix(model.site_pos[site], _rotation(model.site_quat[site])) for site in sites]
        first, second = (model.site_bodyid[site] for site in sites)
    elif model.eq_type[i] == _WELD:
        frames = [matrix(data[3:6], _rotation(data[6:10])), matrix(data[:3], np.eye(3))]
    else:
        frames = [matrix(data[:3], np.eye(3)), matrix(data[3:6], np.eye(3))]
    sides = []
    for body, frame in zip((first, second), frames, strict=True):
        whole, T = assembly.places[model.body(body).name] if body else ("ground", np.eye(4))
        sides.append((whole, T @ frame))
    return sides


def _coupling(model: Any, i: int) -> CouplingReading:
    """``y - y0 = P(x - x0)``, with the coordinates at qpos0, in powers of x itself."""
    one, other = model.eq_obj1id[i], model.eq_obj2id[i]
    start = float(model.qpos0[model.jnt_qposadr[one]])
    if other < 0:
        return CouplingReading(model.joint(one).name, "", np.array([start + model.eq_data[i, 0]]))
    shift = np.polynomial.Polynomial([-float(model.qpos0[model.jnt_qposadr[other]]), 1.0])
    powers = np.polynomial.Polynomial(model.eq_data[i, :5])(shift) + start
    return CouplingReading(model.joint(one).name, model.joint(other).name, np.trim_zeros(powers.coef, "b"))


def _actuators(model: Any, ignored: list[str]) -> dict[str, tuple[str, float]]:
    import mujoco

    through = mujoco.mjtTrn.mjTRN_JOINT, mujoco.mjtTrn.mjTRN_JOINTINPARENT
    found = {}
    for i in range(model.nu):
        joint, name = model.actuator_trnid[i, 0], model.actuator(i).name
        if model.actuator_trntype[i] in through and model.jnt_type[joint] >= 2:
            found[name] = model.joint(joint).name, float(model.actuator_gear[i, 0])
        else:
            ignored.append(f"actuator {name}, which drives no hinge or slide")
    return found
