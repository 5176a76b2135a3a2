"""Shares of edits in a torque difference, by Pinocchio or MuJoCo on the edited files."""

import copy
import xml.etree.ElementTree as ET
from collections.abc import Sequence

import numpy as np
from campaigns.corpus.parts import NoPlaceError
from campaigns.corpus.poses import Array

STATES = 12


def torques(root: ET.Element, speed: float) -> Array:
    """At random states, friction and damping included. Shape (states, freedoms).

    Args:
        speed: How fast these are, and, squared, how large their accelerations [rad/s].
    """
    rng = np.random.default_rng(5)
    return _of_urdf(root, rng, speed) if root.tag == "robot" else _of_mjcf(root, rng, speed)


def _of_urdf(root: ET.Element, rng: np.random.Generator, speed: float) -> Array:
    import pinocchio

    bare = copy.deepcopy(root)
    for link in bare.iterfind("link"):
        for tag in ("visual", "collision"):
            for part in link.findall(tag):
                link.remove(part)
    model = pinocchio.buildModelFromXML(ET.tostring(bare, encoding="unicode"))
    data = model.createData()
    damping, friction = _by_joint(bare, model)
    rows = []
    for _ in range(STATES):
        q = pinocchio.integrate(model, pinocchio.neutral(model), rng.uniform(-1.0, 1.0, model.nv))
        v, a = np.array([[speed], [speed**2]]) * rng.normal(size=(2, model.nv))
        rows.append(pinocchio.rnea(model, data, q, v, a) + damping * v + friction * np.sign(v))
    return np.array(rows)


def _by_joint(root: ET.Element, model: object) -> tuple[Array, Array]:
    values = np.zeros((2, model.nv))  # type: ignore[attr-defined]
    for joint in root.iterfind("joint"):
        dynamics = joint.find("dynamics")
        if dynamics is not None and model.existJointName(joint.get("name")):  # type: ignore[attr-defined]
            k = model.joints[model.getJointId(joint.get("name"))].idx_v  # type: ignore[attr-defined]
            values[:, k] = [float(dynamics.get(name, "0")) for name in ("damping", "friction")]
    return values[0], values[1]


def bare_mjcf(root: ET.Element) -> ET.Element:
    bare = copy.deepcopy(root)
    for tag in ("asset", "contact", "sensor", "keyframe"):
        for room in bare.findall(tag):
            bare.remove(room)
    for parent in [*bare.iter()]:
        for part in [*parent]:
            if part.tag == "geom" and parent.tag in ("body", "worldbody"):
                parent.remove(part)
            elif part.tag == "geom":
                for name in ("material", "mesh"):
                    part.attrib.pop(name, None)
            elif part.tag == "site":
                part.attrib.pop("material", None)
    return bare


def _of_mjcf(root: ET.Element, rng: np.random.Generator, speed: float) -> Array:
    import mujoco

    model = mujoco.MjModel.from_xml_string(ET.tostring(bare_mjcf(root), encoding="unicode"))
    model.opt.disableflags |= int(
        mujoco.mjtDisableBit.mjDSBL_CONSTRAINT  # limits and contacts; friction is added below
    )
    data = mujoco.MjData(model)
    rows = []
    for _ in range(STATES):
        qpos = model.qpos0.copy()
        mujoco.mj_integratePos(model, qpos, rng.uniform(-1.0, 1.0, model.nv), 1.0)
        v, a = np.array([[speed], [speed**2]]) * rng.normal(size=(2, model.nv))
        data.qpos[:], data.qvel[:], data.qacc[:] = qpos, v, a
        mujoco.mj_inverse(model, data)
        rows.append(data.qfrc_inverse + model.dof_frictionloss * np.sign(data.qvel))
    return np.array(rows)


def shares(original: ET.Element, alone: Sequence[ET.Element], speed: float = 1.0) -> Array:
    first = torques(original, speed)
    steps = np.array([torques(root, speed) - first for root in alone])
    total = steps.sum(axis=0)
    if not np.any(total):
        raise NoPlaceError  # no torque shows them
    return np.asarray((steps * total).sum(axis=(1, 2)) / (total * total).sum())
