"""What MuJoCo counts among forces and accelerations, and what it leaves out."""

from __future__ import annotations

import mujoco
import numpy as np

from screwgauge.engines.mujoco.discrepancies.probe import inverse, inverted, load, state
from screwgauge.engines.toy_models import ARM, INERTIA, MASS, WEIGHT, Evidence, FourBar, G, body, mjcf

_DISCRETE = int(mujoco.mjtEnableBit.mjENBL_INVDISCRETE)


def rne_armature() -> Evidence:
    """Torque of 1 rad/s^2 on a hinge with an armature: of `mj_rne`, and with the armature added by hand."""
    armature = 0.5
    model = load(mjcf(body("a", joint=f'armature="{armature}"')))
    data = inverted(model, a=1.0)
    force = np.empty(1)
    mujoco.mj_rne(model, data, 1, force)
    mended = force[0] + model.dof_armature[0] * data.qacc[0]
    return Evidence(float(force[0]), INERTIA + armature + WEIGHT, float(mended), "N m")


def passive_forces() -> Evidence:
    """Rigid-body torque of a level bar at 1 rad/s with damping, friction and a spring in its hinge."""
    model = load(mjcf(body("a", joint='damping="2" stiffness="3" springref="0.4" frictionloss="0.5"')))
    data = inverted(model, v=1.0)
    mended = data.qfrc_inverse + data.qfrc_passive + data.qfrc_constraint
    return Evidence(float(data.qfrc_inverse[0]), WEIGHT, float(mended[0]), "N m")


def limit_force() -> Evidence:
    """Torque of a bar at rest that hangs 0.1 rad past the limit of its hinge."""
    model = load(mjcf(body("a", joint='range="-0.3 0.3"')))
    data = inverted(model, 0.4)
    mended = data.qfrc_inverse + data.qfrc_constraint
    return Evidence(float(data.qfrc_inverse[0]), float(WEIGHT * np.cos(0.4)), float(mended[0]), "N m")


def contact_force() -> Evidence:
    """Force that lifts a ball of 1 kg, 1 mm deep in the floor."""
    ball = '<body pos="0 0 0.049"><joint type="slide" axis="0 0 1"/><geom size="0.05" mass="1"/></body>'
    model = load(mjcf(f'<geom type="plane" size="1 1 1"/>{ball}'))
    raw = inverse(model)[0]
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONTACT)
    return Evidence(float(raw), G, float(inverse(model)[0]), "N")


def applied_ignored() -> Evidence:
    """Torque that holds a level bar of which a load carries half the weight."""
    model = load(mjcf(body("a")))
    data = state(model)
    data.xfrc_applied[1, 2] = MASS * G / 2.0
    mujoco.mj_inverse(model, data)
    load_force = np.zeros(1)
    force, torque = np.split(data.xfrc_applied[1], 2)
    mujoco.mj_applyFT(model, data, force, torque, data.xipos[1], 1, load_force)
    raw = float(data.qfrc_inverse[0])
    return Evidence(raw, WEIGHT / 2.0, raw - float(load_force[0]), "N m")


def gravity_in_acceleration() -> Evidence:
    """Vertical acceleration of a bar at rest, by the sensor `framelinacc`."""
    sensor = '<sensor><framelinacc objtype="body" objname="a"/></sensor>'
    model = load(mjcf(body("a", joint='stiffness="1e3"'), after=sensor))
    data = state(model)
    data.qfrc_applied[0] = WEIGHT  # holds it
    mujoco.mj_forward(model, data)
    reading = float(data.sensordata[2])
    return Evidence(reading, 0.0, reading + float(model.opt.gravity[2]), "m/s^2")


def moment_about_centre() -> Evidence:
    """Moment about y by which the ground holds a level bar: of cfrc_int, and about the hinge."""
    model = load(mjcf(body("a")))
    data = inverted(model)
    mujoco.mj_rnePostConstraint(model, data)
    moment, force = np.split(data.cfrc_int[1], 2)
    arm = data.subtree_com[model.body_rootid[1]] - data.xanchor[0]
    return Evidence(float(moment[1]), WEIGHT, float((moment + np.cross(arm, force))[1]), "N m")


def gear() -> Evidence:
    """Torque of a motor with a gear whose control is the torque that is wanted, and that over its gear."""
    wanted, ratio = 2.0, 50.0
    motor = f'<actuator><motor joint="a" gear="{ratio}"/></actuator>'
    model = load(mjcf(body("a"), after=motor))
    torques = []
    for control in (wanted, wanted / model.actuator_gear[0, 0]):
        data = state(model)
        data.ctrl[0] = control
        mujoco.mj_forward(model, data)
        torques.append(float(data.qfrc_actuator[0]))
    return Evidence(torques[0], wanted, torques[1], "N m")


def inverse_of_a_step() -> Evidence:
    """Torque that `mj_inverse` gives back of a step of 10 ms with damping in which there was none."""
    model = load(mjcf(body("a", joint='damping="5"')), timestep=0.01)
    data = state(model, v=1.0)
    mujoco.mj_step(model, data)
    a = (data.qvel - 1.0) / model.opt.timestep
    raw = inverse(model, v=1.0, a=a)
    model.opt.enableflags |= _DISCRETE
    return Evidence(float(raw[0]), 0.0, float(inverse(model, v=1.0, a=a)[0]), "N m")


def stale_after_step() -> Evidence:
    """By how much body positions after `mj_step` lag behind the coordinates, at 10 rad/s and 10 ms."""
    model = load(mjcf(body("a")), timestep=0.01)
    data = state(model, v=10.0)
    mujoco.mj_step(model, data)

    def lag() -> float:
        q = data.qpos[0]
        return float(np.linalg.norm(data.xipos[1] - ARM * np.array([np.cos(q), 0.0, -np.sin(q)])))

    stale = lag()
    mujoco.mj_forward(model, data)
    return Evidence(stale, 0.0, lag(), "m")


def differentiated_motion() -> Evidence:
    """Largest torque error along a motion sampled at 100 Hz: accelerations from differences, and from the formula."""
    model, omega = load(mjcf(body("a"))), 4.0
    t = np.arange(0.0, 0.3, 0.01)
    q, v, a = np.sin(omega * t), omega * np.cos(omega * t), -(omega**2) * np.sin(omega * t)
    right = INERTIA * a + WEIGHT * np.cos(q)

    def error(accelerations: np.ndarray) -> float:
        torques = [inverse(model, *at)[0] for at in zip(q, v, accelerations, strict=True)]
        return float(abs(torques - right).max())

    return Evidence(error(np.gradient(np.gradient(q, t), t)), 0.0, error(a), "N m")


def many_motors() -> Evidence:
    """How far two right answers for motors at crank and rocker are apart: torques, and what they do at the crank."""
    bar = FourBar()
    data = inverted(load(bar.mjcf()), v=bar.v, a=bar.a)
    tree, J = data.qfrc_inverse + data.qfrc_constraint, data.efc_J.reshape(-1, 3).T
    moving = bar.v / bar.speed  # rates per rate of the crank
    answers = []
    for motors in (np.eye(3)[:, :1], np.eye(3)[:, [0, 2]]):
        solved = np.linalg.lstsq(np.hstack([motors, J]), tree, rcond=None)[0]
        torques = motors @ solved[: motors.shape[1]]
        answers.append((torques[0], torques @ moving))
    (first, of_first), (second, of_second) = answers
    return Evidence(float(abs(first - second)), 0.0, float(abs(of_first - of_second)), "N m")
