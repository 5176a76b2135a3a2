"""What Pinocchio counts among forces and masses, and in which frame it gives velocities."""

from __future__ import annotations

import math

import numpy as np
import pinocchio as pin

from screwgauge.engines.pinocchio.discrepancies.probe import inverse, load_urdf, mass
from screwgauge.engines.toy_models import ARM, INERTIA, MASS, WEIGHT, Evidence, joint, link, robot
from screwgauge.models.readings.pinocchio import overheard

_BAR = robot(link("a"), joint("a"))
_ALIGNED = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED


def damping_ignored() -> Evidence:
    """Torque of a level bar at 1 rad/s with damping and friction in its hinge: of `rnea`, and both added by hand."""
    model = load_urdf(robot(link("a"), joint("a", inside='<dynamics damping="2" friction="0.5"/>')))
    raw = float(inverse(model, v=1.0)[0])
    mended = raw + model.damping[0] + model.upperDryFrictionLimit[0]
    return Evidence(raw, WEIGHT + 2.0 + 0.5, float(mended), "N m")


def rotor_ignored() -> Evidence:
    """Moment of inertia at a hinge with a rotor behind a gear: by rotor and gear, and by their armature."""
    rotor, ratio = 1e-4, 50.0
    model = load_urdf(_BAR)

    def moment() -> float:
        return float(inverse(model, a=1.0)[0] - inverse(model)[0])

    model.rotorInertia[:], model.rotorGearRatio[:] = rotor, ratio
    raw = moment()
    model.armature[:] = model.rotorInertia * model.rotorGearRatio**2
    return Evidence(raw, INERTIA + rotor * ratio**2, moment(), "kg m^2")


def mimic_ignored() -> Evidence:
    """Degrees of freedom of two joints of which one mimics the other, and read with mimic joints."""
    follower = joint("b", inside='<mimic joint="a" multiplier="2" offset="0"/>')
    text = robot(link("a"), link("b"), joint("a"), follower)
    return Evidence(load_urdf(text).nv, 1, pin.buildModelFromXML(text, mimic=True).nv, "")


def massless_tip() -> Evidence:
    """Acceleration of a level bar that falls, with a link without mass on a joint at its end, and on a fixed one."""
    accelerations = []
    for kind in ("revolute", "fixed"):
        model = load_urdf(robot(link("a"), joint("a"), '<link name="tip"/>', joint("tip", "a", kind=kind)))
        zero = np.zeros(model.nv)
        accelerations.append(float(pin.aba(model, model.createData(), zero, zero, zero)[0]))
    return Evidence(accelerations[0], -WEIGHT / INERTIA, accelerations[1], "rad/s^2")


def frame_mass() -> Evidence:
    """Mass of a link as its frame has it, and as its joint has it."""
    model = load_urdf(_BAR)
    frame = model.frames[model.getFrameId("a", pin.FrameType.BODY)]
    return Evidence(float(frame.inertia.mass), MASS, float(model.inertias[frame.parentJoint].mass), "kg")


def base_mass() -> Evidence:
    """Mass of a robot whose base of 5 kg stands on the ground, as Pinocchio adds it up, and with that of the ground."""
    model = load_urdf(_BAR.replace('<link name="base"/>', link("base", mass=5.0)))
    return Evidence(mass(model), 5.0 + MASS, mass(model) + float(model.inertias[0].mass), "kg")


def base_fixed() -> Evidence:
    """Degrees of freedom of a URDF whose base is meant to float, and with a root joint."""
    text = _BAR.replace('<link name="base"/>', link("base"))
    return Evidence(load_urdf(text).nv, 7, load_urdf(text, pin.JointModelFreeFlyer()).nv, "")


def continuous_joint() -> Evidence:
    """Torque of the weight of a bar that hangs 0.5 rad below level on a continuous joint: the angle as the first of
    its coordinates, and as cosine and sine."""
    model = load_urdf(robot(link("a"), joint("a", kind="continuous")))
    torques = [float(inverse(model, q)[0]) for q in ([0.5, 0.0], [math.cos(0.5), math.sin(0.5)])]
    return Evidence(torques[0], WEIGHT * math.cos(0.5), torques[1], "N m")


def _turning() -> tuple[pin.Model, pin.Data, int]:
    """A bar that turns at 2 rad/s, a right angle down, and the frame at its centre of mass."""
    tip = joint("tip", "a", kind="fixed", origin=f'xyz="{ARM} 0 0"')
    model = load_urdf(robot(link("a"), joint("a"), '<link name="tip"/>', tip))
    data = model.createData()
    pin.forwardKinematics(model, data, np.array([math.pi / 2]), np.array([2.0]), np.zeros(1))
    pin.updateFramePlacements(model, data)
    return model, data, model.getFrameId("tip", pin.FrameType.BODY)


def local_velocity() -> Evidence:
    """Velocity along the world's x of a point of a turning bar: as `getFrameVelocity` has it, and in world axes."""
    model, data, frame = _turning()
    velocities = [float(pin.getFrameVelocity(model, data, frame, *axes).linear[0]) for axes in ((), (_ALIGNED,))]
    return Evidence(velocities[0], -2.0 * ARM, velocities[1], "m/s")


def spatial_acceleration() -> Evidence:
    """Upward acceleration of a point of a turning bar that hangs: spatial, and classical."""
    model, data, frame = _turning()
    calls = (pin.getFrameAcceleration, pin.getFrameClassicalAcceleration)
    accelerations = [float(call(model, data, frame, _ALIGNED).linear[2]) for call in calls]
    return Evidence(accelerations[0], 2.0**2 * ARM, accelerations[1], "m/s^2")


def error_goes_on() -> Evidence:
    """Torque of the weight of a bar in a URDF with a misprint, which Pinocchio loads, and corrected."""
    with overheard() as messages:
        value = float(inverse(load_urdf(_BAR.replace(f'xyz="{ARM} 0 0"', f'xyz="{ARM} 0 O"')))[0])
    return Evidence(value, WEIGHT, float(inverse(load_urdf(_BAR))[0]), "N m", next(iter(messages), ""))
