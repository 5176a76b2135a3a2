"""MuJoCo's accelerations on loops with redundant constraints, closed by points and by whole frames."""

from __future__ import annotations

from time import perf_counter
from typing import Any
from xml.etree import ElementTree as ET

import mujoco
import numpy as np

from screwgauge.reference import linear
from screwgauge.reference.rotations import Array
from screwgauge.study.bench.case import Case
from screwgauge.study.bench.contestants_mujoco import STIFFEST, load, with_equality
from screwgauge.study.bench.projection import Given, given
from screwgauge.study.stress.case import Finding
from screwgauge.study.stress.driven.loaded import finding
from screwgauge.study.stress.driven.mujoco_steps import Setting, refined, soften
from screwgauge.study.stress.driven.redundant import locked

PASSES = 10  # of refinement: the softness is not what is looked at here


def connects(case: Case) -> Finding:
    """Every cut hinge held by two points on its axis."""
    start = given(case, *load(case))
    return _measure(case, "mujoco connect", start, with_equality(start)[0])


def welds(case: Case) -> Finding:
    """Every cut hinge held by a weld of its two frames, which agree at each pose: only the lock is looked at."""
    start = given(case, *load(case))
    root = ET.parse(case.problem("mujoco", ()).model).getroot()
    equality = root.find("equality")
    assert equality is not None
    equality.clear()
    for closure in start.tree.closures:
        sides = {"site1": f"{closure.joint}@parent", "site2": f"{closure.joint}@child"}
        ET.SubElement(equality, "weld", {"name": closure.joint, **sides})
    model = mujoco.MjModel.from_xml_string(ET.tostring(root, encoding="unicode"))
    return _measure(case, "mujoco weld", start, model)


def _measure(case: Case, label: str, start: Given, model: Any) -> Finding:
    soften(model, Setting(impedance=STIFFEST, passes=PASSES))
    data, tau, found = mujoco.MjData(model), start.applied(), np.empty_like(start.q)
    seconds = 0.0
    for i in range(len(found)):
        data.qpos[:], data.qvel[:], data.qfrc_applied[:] = start.q[i], start.v[i], tau[i]
        data.qacc_warmstart[:] = 0.0
        _align(model, data)
        clock = perf_counter()
        refined(model, data, PASSES)
        seconds += perf_counter() - clock
        found[i] = data.qacc
    J = data.efc_J[: data.nefc * model.nv].reshape(-1, model.nv).copy()
    return finding(
        case,
        label,
        start.tree.coordinates,
        found,
        seconds=seconds,
        condition=_condition(model, data, J),
        cause=locked(J),
    )


def _align(model: Any, data: Any) -> None:
    """Turns the second frame of every weld so that it agrees with the first."""
    mujoco.mj_kinematics(model, data)
    for e in range(model.neq):
        if model.eq_type[e] == mujoco.mjtEq.mjEQ_WELD:
            first, second = model.eq_obj1id[e], model.eq_obj2id[e]
            body = data.xmat[model.site_bodyid[second]].reshape(3, 3)
            turn = body.T @ data.site_xmat[first].reshape(3, 3)
            mujoco.mju_mat2Quat(model.site_quat[second], turn.ravel())


def _condition(model: Any, data: Any, J: Array) -> float:
    """Of ``J M^-1 J^T + R`` with MuJoCo's regularisation R."""
    moved = np.empty_like(J)
    mujoco.mj_solveM(model, data, moved, J)
    return float(linear.condition(J @ moved.T + np.diag(data.efc_R[: len(J)])))
