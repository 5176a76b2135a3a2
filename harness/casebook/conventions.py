"""One machine, two engines: coordinates, armatures and dampers that only one side knows."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from screwgauge.engines.mujoco.discrepancies import probe as mujoco
from screwgauge.engines.pinocchio.discrepancies import probe as pinocchio
from screwgauge.engines.samples import MASS, body, joint, link, mjcf, robot
from screwgauge.engines.shown import Evidence

#: A free body at the origin, a right angle about y from upright: MuJoCo's coordinates, their order in Pinocchio, and
#: the rotation.
_AT = np.array([0.0, 0.0, 0.0, math.cos(math.pi / 4), 0.0, math.sin(math.pi / 4), 0.0])
_SCALAR_LAST = [0, 1, 2, 4, 5, 6, 3]
_TURN = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])


def armature() -> Evidence:
    """Moment of inertia at a hinge that the MJCF gives an armature, of Pinocchio on the URDF, and with it told."""
    model, other = (
        pinocchio.load_urdf(robot(link("a"), joint("a"))),
        mujoco.load(mjcf(body("a", joint='armature="0.5"'))),
    )

    def moment() -> float:
        return float(pinocchio.inverse(model, a=1.0)[0] - pinocchio.inverse(model)[0])

    raw = moment()
    model.armature = np.array(other.dof_armature)
    return Evidence(raw, mujoco.moment(other), moment(), "kg m^2")


def damping() -> Evidence:
    """Torque at 1 rad/s against a damper in a URDF, which both engines read and MuJoCo alone applies."""
    text = robot(link("a"), joint("a", inside='<dynamics damping="2"/>'))
    model = pinocchio.load_urdf(text)
    raw = float(pinocchio.inverse(model, v=1.0)[0])
    right = float(mujoco.inverse(mujoco.load(text), v=1.0)[0])
    return Evidence(raw, right, raw + float(model.damping[0]), "N m")


def _free() -> tuple[Any, Any]:
    """A free body in both engines."""
    inertial = f'<inertial pos="0 0 0" mass="{MASS}" diaginertia="0.1 0.2 0.3"/>'
    text = mjcf(f'<body name="a"><freejoint/>{inertial}</body>')
    return pinocchio.load_mjcf(text), mujoco.load(text)


def quaternion_order() -> Evidence:
    """Force that holds a free body a right angle from upright along its own x: MuJoCo's coordinates handed over, and
    with the scalar last."""
    model, other = _free()
    right = _TURN.T @ mujoco.inverse(other, _AT)[:3]
    found = [float(pinocchio.inverse(model, q)[0]) for q in (_AT, _AT[_SCALAR_LAST])]
    return Evidence(found[0], float(right[0]), found[1], "N")


def free_velocity() -> Evidence:
    """Upward force on a free body that moves and turns without accelerating: MuJoCo's velocities handed over, and
    turned into the body's own axes."""
    model, other = _free()
    v, omega = np.array([0.0, 3.0, 0.0]), np.array([0.0, 0.0, 2.0])
    right = float(mujoco.inverse(other, _AT, [*v, *omega])[2])
    own = _TURN.T @ v
    spatial = [*-np.cross(omega, own), 0.0, 0.0, 0.0]  # of a point that does not accelerate
    raw, mended = (
        float((_TURN @ pinocchio.inverse(model, _AT[_SCALAR_LAST], [*linear, *omega], a)[:3])[2])
        for linear, a in ((v, 0.0), (own, spatial))
    )
    return Evidence(raw, right, mended, "N")
