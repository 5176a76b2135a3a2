"""Reads a URDF or MJCF with MuJoCo."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from screwgauge.models.content import Content
from screwgauge.models.mjcf import POWERS, mass_properties
from screwgauge.models.poses import matrix, screw
from screwgauge.models.readings.assemble import assemble
from screwgauge.models.readings.compiled import (
    collect_phrases,
    compile_text,
    content,
    coupling_of,
    single_joint,
    tendon_equality,
)
from screwgauge.models.readings.reading import (
    BARE,
    ActuatorReading,
    BodyReading,
    ClosureReading,
    CouplingReading,
    JointReading,
    Reading,
)
from screwgauge.models.readings.source import Source
from screwgauge.reference.errors import ModelFileError
from screwgauge.reference.files import read_file
from screwgauge.reference.rotations import Array

#: Kinds of joints, in the order of MuJoCo's enumeration.
_KINDS = ("free", "ball", "slide", "hinge")
_CONNECT, _WELD, _JOINT, _TENDON = range(4)
_BODY = 1  # mjtObj of an equality between bodies, not sites
#: Stages that are disabled together with all constraints.
_CONSTRAINTS = ("EQUALITY", "FRICTIONLOSS", "LIMIT")


def read_mujoco(source: Source, home: Mapping[str, float]) -> Reading:
    """Read a URDF or MJCF with MuJoCo; rebuild tensors from the principal moments and axes that MuJoCo stores.

    Raises:
        ModelFileError: MuJoCo rejects the file.
    """
    import mujoco

    with collect_phrases() as warnings:
        model = load_mujoco(source)
        data = mujoco.MjData(model)
        for i in range(model.njnt):
            at = model.jnt_qposadr[i]
            if is_single(model, i):
                data.qpos[at] = home.get(model.joint(i).name, model.qpos0[at])
        mujoco.mj_kinematics(model, data)
    says_gravity = source.form == "mjcf" or source.root.find("mujoco/option") is not None
    gravity = np.zeros(3) if is_disabled(model, "GRAVITY") else model.opt.gravity.copy()
    reading = assemble(
        dict(_links(model, data, source.root_link)),
        {model.joint(i).name: _joint(model, data, i) for i in range(model.njnt)},
        str(source.path),
        name=source.name,
        library="mujoco",
        actuators=_actuators(model),
        gravity=gravity if says_gravity else None,
        medium=(float(model.opt.density), float(model.opt.viscosity)),
    )
    unread = [Content("warnings of the library", text, values=()) for text in warnings]
    unread += content(model, reading)
    closures, couplings = _equalities(model, reading, unread)
    return replace(reading, closures=closures, couplings=couplings, content=tuple(unread))


def load_mujoco(source: Source) -> Any:
    """Compile a model file without merging bodies that are fixed to each other.

    Raises:
        ModelFileError: MuJoCo rejects the file.
    """
    try:
        return compile_text(source.text, str(source.path), source.models)
    except ModelFileError as error:
        numbered = enumerate(read_file(source.path).splitlines(), 1)
        lines = [str(n) for n, line in numbered if "<plugin" in line or "<extension" in line]
        if "plugin" not in error.what or not lines:
            raise
        remedy = f"remove the plugins (line {', '.join(lines)}) if they exert no forces on bodies"
        raise ModelFileError(error.what, error.where, remedy) from None


def is_disabled(model: Any, flag: str) -> bool:
    """Return True if the file disables a stage of MuJoCo, such as ``GRAVITY`` or ``DAMPER``."""
    import mujoco

    flags = mujoco.mjtDisableBit
    older = flag in ("SPRING", "DAMPER") and not hasattr(flags, f"mjDSBL_{flag}")  # one flag for both
    names = ["PASSIVE" if older else flag, *(["CONSTRAINT"] if flag in _CONSTRAINTS else [])]
    return any(model.opt.disableflags & int(getattr(flags, f"mjDSBL_{name}")) for name in names)


def is_single(model: Any, joint: int) -> bool:
    """Return True if a joint is a hinge or slide."""
    return _KINDS[model.jnt_type[joint]] in ("hinge", "slide")


def _links(model: Any, data: Any, root: str) -> Iterator[tuple[str, BodyReading]]:
    """Yield all links. `root` is the root link of a URDF, which MuJoCo merges into the world unless it has mass."""
    names = [root, *(model.body(i).name for i in range(1, model.nbody))]
    if root and root not in names[1:]:
        yield root, BARE
    masses, moments = mass_properties(model)
    for i in range(1, model.nbody):
        R, near, first = turn(model.body_iquat[i]), names[model.body_parentid[i]], model.body_jntadr[i]
        mass = float(masses[i])
        body = BodyReading(
            mass,
            model.body_ipos[i].copy() if mass else np.zeros(3),
            R @ np.diag(moments[i]) @ R.T,
            near if near != names[i] else "",
            tuple(model.joint(first + k).name for k in range(model.body_jntnum[i])),
            matrix(data.xpos[i], data.xmat[i].reshape(3, 3)),
            float(model.body_gravcomp[i]),
        )
        yield names[i], body


def turn(quaternion: Array) -> Array:
    """Compute the rotation matrix of a quaternion with MuJoCo's own function. Shape (4,) -> (3, 3)."""
    import mujoco

    R = np.zeros(9)
    mujoco.mju_quat2Mat(R, quaternion)
    return R.reshape(3, 3)


def _joint(model: Any, data: Any, i: int) -> JointReading:
    kind, single, at, dof = _KINDS[model.jnt_type[i]], is_single(model, i), model.jnt_qposadr[i], model.jnt_dofadr[i]
    axis, centre = data.xaxis[i].copy(), data.xanchor[i].copy()
    limited = single and model.jnt_limited[i] and not is_disabled(model, "LIMIT")
    low, high = model.jnt_range[i] if limited else (-math.inf, math.inf)
    return JointReading(
        kind=kind,
        screw=screw(kind == "hinge", axis, centre) if single else np.zeros(6),
        centre=centre,
        home=float(data.qpos[at]) if single else 0.0,
        limits=(float(low), float(high)),
        armature=float(model.dof_armature[dof]),
        damping=0.0 if is_disabled(model, "DAMPER") else float(model.dof_damping[dof]),
        friction=0.0 if is_disabled(model, "FRICTIONLOSS") else float(model.dof_frictionloss[dof]),
        stiffness=0.0 if is_disabled(model, "SPRING") else float(model.jnt_stiffness[i]),
        rest=float(model.qpos_spring[at]) if single else 0.0,
    )


def _equalities(
    model: Any, reading: Reading, unread: list[Content]
) -> tuple[dict[str, ClosureReading], dict[str, CouplingReading]]:
    """Return closures and couplings; add all other equalities to `unread`."""
    closures, couplings = {}, {}
    off = is_disabled(model, "EQUALITY")
    for i in range(model.neq):
        # equalities that MuJoCo generates from a URDF's <mimic> are unnamed
        name, kind = model.equality(i).name or model.joint(model.eq_obj1id[i]).name, int(model.eq_type[i])
        if off or not model.eq_active0[i]:
            unread.append(Content("inactive equalities", f"equality {name}, which is not active"))
        elif coupling := coupling_reading(model, i):
            couplings[name] = replace(coupling, softness=_softness(model, i))
        elif kind in (_CONNECT, _WELD):
            sides = _sides(model, i, reading)
            joint = "weld" if kind == _WELD else "point"
            derived = kind == _CONNECT and model.eq_objtype[i] == _BODY
            closures[name] = ClosureReading(joint, *sides[0], *sides[1], _softness(model, i), derived)
        else:
            what = f"equality {name}, which neither joins bodies nor couples joints by a sum of polynomials"
            unread.append(Content("other equalities", what))
    return closures, couplings


def _softness(model: Any, i: int) -> tuple[float, ...]:
    scale = model.eq_data[i, 10:11].tolist() if model.eq_type[i] == _WELD else []
    return (*model.eq_solref[i].tolist(), *model.eq_solimp[i].tolist(), *scale)


def _sides(model: Any, i: int, reading: Reading) -> list[tuple[str, Array]]:
    """Return the two bodies of an equality, each with the frame of the equality in that body.

    MuJoCo computes the second anchor of a connect at qpos0. For a weld, it stores the anchor in the second body; for
    the first body, it stores the pose of a frame at that anchor with the axes of the second body.
    """
    import mujoco

    first, second, kept = model.eq_obj1id[i], model.eq_obj2id[i], model.eq_data[i]
    if model.eq_objtype[i] == mujoco.mjtObj.mjOBJ_SITE:
        sites = (first, second)
        frames = [matrix(model.site_pos[site], turn(model.site_quat[site])) for site in sites]
        first, second = (model.site_bodyid[site] for site in sites)
    elif model.eq_type[i] == _WELD:
        frames = [matrix(kept[3:6], turn(kept[6:10])), matrix(kept[:3], np.eye(3))]
    else:
        frames = [matrix(kept[:3], np.eye(3)), matrix(kept[3:6], np.eye(3))]
    sides = []
    for body, frame in zip((first, second), frames, strict=True):
        whole, T = reading.end_on(model.body(body).name if body else "")
        sides.append((whole, T @ frame))
    return sides


def coupling_reading(model: Any, i: int) -> CouplingReading | None:
    """Convert an equality of joints or fixed tendons to a coupling; None if this is impossible."""
    if int(model.eq_type[i]) == _TENDON:
        return tendon_equality(model, i)
    return joint_equality(model, i) if int(model.eq_type[i]) == _JOINT else None


def joint_equality(model: Any, i: int) -> CouplingReading:
    """Convert ``y - y0 = P(x - x0)`` to a coupling, where x0 and y0 are the coordinates at qpos0."""
    one, other = (int(joints[i]) for joints in (model.eq_obj1id, model.eq_obj2id))
    return coupling_of(model, one, {other: model.eq_data[i, : POWERS if other >= 0 else 1]})


def _actuators(model: Any) -> dict[str, ActuatorReading]:
    """Return the actuators of hinges and slides; `compiled.content` lists further actuators and force laws."""
    return {
        model.actuator(i).name: ActuatorReading(model.joint(joint).name, float(model.actuator_gear[i, 0]))
        for i in range(model.nu)
        if (joint := single_joint(model, i)) is not None
    }
