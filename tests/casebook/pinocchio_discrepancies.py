"""Discrepancies that users of Pinocchio meet, each as a function that shows it on a small model.

First what Pinocchio counts among forces and masses, and in which frame it gives velocities; then closed loops: proximal
settings, kinds of contact, and whose force it is.
"""

import math
import subprocess
import tempfile
from collections.abc import Mapping
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

from casebook.toy_models import ARM, INERTIA, MASS, WEIGHT, Evidence, FourBar, joint, link, robot
from screwgauge.engines.pinocchio.tree import initialise
from screwgauge.models.readings.pinocchio import capture_errors
from screwgauge.processes import python
from screwgauge.reference.rotations import Array


def load_urdf(text: str, *more: Any) -> pin.Model:
    """Loads a URDF; `more`: a root joint."""
    return pin.buildModelFromXML(text, *more)


def load_mjcf(text: str, files: Mapping[str, str] | None = None) -> pin.Model:
    """Loads an MJCF, which has to be a file.

    Args:
        files: Name -> text of files in the same folder.
    """
    with tempfile.TemporaryDirectory() as folder:
        return pin.buildModelFromMJCF(_written(Path(folder), text, files or {}))


def load_closed(text: str) -> tuple[pin.Model, Any]:
    with tempfile.TemporaryDirectory() as folder:
        model, constraints, *_ = pin.buildModelAndConstraintsFromMJCF(_written(Path(folder), text, {}))
        return model, constraints


_GAPS = """
import sys, pinocchio
for file in sys.argv[1:]:
    model, constraints, *_ = pinocchio.buildModelAndConstraintsFromMJCF(file)
    first, second = constraints[0].joint1_placement, constraints[0].joint2_placement
    print(abs(first.translation - second.translation).max(), flush=True)
"""


def gaps(*texts: str) -> list[float]:
    """Gap of the first closure of each MJCF at home, where the frames of its two joints agree [m].

    They are read in a process of its own, which Pinocchio's reader may crash: NaN from that file on.
    """
    with ExitStack() as stack:
        folders = [Path(stack.enter_context(tempfile.TemporaryDirectory())) for _ in texts]
        files = [_written(folder, text, {}) for folder, text in zip(folders, texts, strict=True)]
        done = subprocess.run(python("-c", _GAPS, *files), capture_output=True, text=True, check=False)
    sizes = [float(line) for line in done.stdout.split()]
    return sizes + [math.nan] * (len(texts) - len(sizes))


def _written(folder: Path, text: str, files: Mapping[str, str]) -> str:
    for name, content in {"model.xml": text, **files}.items():
        (folder / name).write_text(content, encoding="utf-8")
    return str(folder / "model.xml")


def inverse(model: pin.Model, q: Any = None, v: Any = 0.0, a: Any = 0.0) -> Array:
    full = [np.zeros(model.nv) + x for x in (v, a)]
    q = pin.neutral(model) if q is None else np.asarray(q, dtype=float)
    return np.array(pin.rnea(model, model.createData(), q, *full))


def mass(model: pin.Model) -> float:
    """Total mass [kg]."""
    return float(pin.computeTotalMass(model))


def four_bar(bar: FourBar) -> pin.Model:
    """The tree of a four-bar."""
    model = pin.Model()
    model.gravity.linear[:] = [*bar.gravity, 0.0]
    joints = [0]
    for k, (name, parent, at) in enumerate([("a", 0, (0.0, 0.0)), ("b", 1, bar.elbow), ("d", 0, bar.base)]):
        joints.append(
            model.addJoint(joints[parent], pin.JointModelRZ(), pin.SE3(np.eye(3), np.array([*at, 0.0])), name)
        )
        com = np.array([*bar.along[k] * bar.lengths[k] / 2.0, 0.0])
        inertia = pin.Inertia(bar.masses[k], com, bar.moments[k] * np.eye(3))
        model.appendBodyToJoint(joints[-1], inertia, pin.SE3.Identity())
    return model


_BAR = robot(link("a"), joint("a"))
_ALIGNED = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED


def damping_ignored() -> Evidence:
    model = load_urdf(robot(link("a"), joint("a", inside='<dynamics damping="2" friction="0.5"/>')))
    raw = float(inverse(model, v=1.0)[0])
    mended = raw + model.damping[0] + model.upperDryFrictionLimit[0]
    return Evidence(raw, WEIGHT + 2.0 + 0.5, float(mended), "N m")


def rotor_ignored() -> Evidence:
    rotor, ratio = 1e-4, 50.0
    model = load_urdf(_BAR)

    def moment() -> float:
        return float(inverse(model, a=1.0)[0] - inverse(model)[0])

    model.rotorInertia[:], model.rotorGearRatio[:] = rotor, ratio
    raw = moment()
    model.armature[:] = model.rotorInertia * model.rotorGearRatio**2
    return Evidence(raw, INERTIA + rotor * ratio**2, moment(), "kg m^2")


def mimic_ignored() -> Evidence:
    follower = joint("b", inside='<mimic joint="a" multiplier="2" offset="0"/>')
    text = robot(link("a"), link("b"), joint("a"), follower)
    return Evidence(load_urdf(text).nv, 1, pin.buildModelFromXML(text, mimic=True).nv, "")


def massless_tip() -> Evidence:
    accelerations = []
    for kind in ("revolute", "fixed"):
        model = load_urdf(robot(link("a"), joint("a"), '<link name="tip"/>', joint("tip", "a", kind=kind)))
        zero = np.zeros(model.nv)
        accelerations.append(float(pin.aba(model, model.createData(), zero, zero, zero)[0]))
    return Evidence(accelerations[0], -WEIGHT / INERTIA, accelerations[1], "rad/s^2")


def frame_mass() -> Evidence:
    model = load_urdf(_BAR)
    frame = model.frames[model.getFrameId("a", pin.FrameType.BODY)]
    return Evidence(float(frame.inertia.mass), MASS, float(model.inertias[frame.parentJoint].mass), "kg")


def base_mass() -> Evidence:
    model = load_urdf(_BAR.replace('<link name="base"/>', link("base", mass=5.0)))
    return Evidence(mass(model), 5.0 + MASS, mass(model) + float(model.inertias[0].mass), "kg")


def base_fixed() -> Evidence:
    text = _BAR.replace('<link name="base"/>', link("base"))
    return Evidence(load_urdf(text).nv, 7, load_urdf(text, pin.JointModelFreeFlyer()).nv, "")


def continuous_joint() -> Evidence:
    model = load_urdf(robot(link("a"), joint("a", kind="continuous")))
    torques = [float(inverse(model, q)[0]) for q in ([0.5, 0.0], [math.cos(0.5), math.sin(0.5)])]
    return Evidence(torques[0], WEIGHT * math.cos(0.5), torques[1], "N m")


def _turning() -> tuple[pin.Model, pin.Data, int]:
    tip = joint("tip", "a", kind="fixed", origin=f'xyz="{ARM} 0 0"')
    model = load_urdf(robot(link("a"), joint("a"), '<link name="tip"/>', tip))
    data = model.createData()
    pin.forwardKinematics(model, data, np.array([math.pi / 2]), np.array([2.0]), np.zeros(1))
    pin.updateFramePlacements(model, data)
    return model, data, model.getFrameId("tip", pin.FrameType.BODY)


def local_velocity() -> Evidence:
    model, data, frame = _turning()
    velocities = [float(pin.getFrameVelocity(model, data, frame, *axes).linear[0]) for axes in ((), (_ALIGNED,))]
    return Evidence(velocities[0], -2.0 * ARM, velocities[1], "m/s")


def spatial_acceleration() -> Evidence:
    model, data, frame = _turning()
    calls = (pin.getFrameAcceleration, pin.getFrameClassicalAcceleration)
    accelerations = [float(call(model, data, frame, _ALIGNED).linear[2]) for call in calls]
    return Evidence(accelerations[0], 2.0**2 * ARM, accelerations[1], "m/s^2")


def error_goes_on() -> Evidence:
    with capture_errors() as messages:
        value = float(inverse(load_urdf(_BAR.replace(f'xyz="{ARM} 0 0"', f'xyz="{ARM} 0 O"')))[0])
    return Evidence(value, WEIGHT, float(inverse(load_urdf(_BAR))[0]), "N m", next(iter(messages), ""))


_SAFE = (0.0, 0.0, 1e-10, 3)  # accuracies 0: all iterations are made


class _Closed:
    """A four-bar that its motor drives.

    Attributes:
        force: Contact force after `accelerate`, [linear; angular] in the frame of the constraint. Shape (6,).
    """

    def __init__(self, kind: str = "CONTACT_3D", *, swapped: bool = False, turn: float = 0.0, twice: bool = False):
        self.bar = FourBar()
        self.model = four_bar(self.bar)
        self.data = self.model.createData()
        R = pin.rpy.rpyToMatrix(0.0, 0.0, turn)
        names = ("b", "d")
        sides = [(self.model.getJointId(n), pin.SE3(R, end)) for n, end in zip(names, self.bar.ends, strict=True)]
        first, second = sides[::-1] if swapped else sides
        self.contacts, self.datas = pin.StdVec_RigidConstraintModel(), pin.StdVec_RigidConstraintData()
        for _ in range(1 + twice):
            contact = pin.RigidConstraintModel(
                getattr(pin.ContactType, kind), self.model, *first, *second, pin.ReferenceFrame.LOCAL
            )
            self.contacts.append(contact)
            self.datas.append(contact.createData())
        initialise(self.model, self.data, self.contacts, self.datas)
        self.force = np.zeros(6)

    def accelerate(self, settings: Any) -> Array:
        tau = np.array([self.bar.torque, 0.0, 0.0])
        made = pin.constraintDynamics(
            self.model, self.data, np.zeros(3), self.bar.v, tau, self.contacts, self.datas, settings
        )
        self.force = np.array(self.datas[0].contact_force.vector)
        return np.array(made)

    def error(self, *settings: Any) -> float:
        return float(np.max(abs(self.accelerate(pin.ProximalSettings(*settings)) - self.bar.a)))


def default_settings() -> Evidence:
    closed = _Closed()
    return Evidence(closed.error(), 0.0, closed.error(*_SAFE), "rad/s^2")


def two_arguments() -> Evidence:
    closed, message = _Closed(), ""
    value = math.nan
    try:
        pin.initConstraintDynamics(closed.model, closed.data, closed.contacts)
        value = closed.error(*_SAFE)
    except Exception as error:  # Boost's ArgumentError, which has no name to import
        message = f"{type(error).__name__} of {pin.initConstraintDynamics.__name__}"
    return Evidence(value, 0.0, closed.error(*_SAFE), "rad/s^2", message)


def one_iteration() -> Evidence:
    closed = _Closed()
    return Evidence(closed.error(0.0, 0.0, 1e-3, 1), 0.0, closed.error(0.0, 0.0, 1e-3, 8), "rad/s^2")


def frame_locks_hinge() -> Evidence:
    return Evidence(_Closed("CONTACT_6D").error(*_SAFE), 0.0, _Closed().error(*_SAFE), "rad/s^2")


def _force(**how: Any) -> tuple[Array, Array]:
    closed = _Closed(**how)
    closed.accelerate(pin.ProximalSettings(*_SAFE))
    return closed.force[:3], _on_coupler(closed.bar)


def _on_coupler(bar: FourBar) -> Array:
    """Force on the coupler from the equations of the open tree: tau + J^T f = M a + h, J of coupler less rocker."""
    model = four_bar(bar)
    tau = pin.rnea(model, model.createData(), np.zeros(3), bar.v, bar.a)
    tau[0] -= bar.torque
    data = model.createData()
    pin.computeJointJacobians(model, data, np.zeros(3))
    columns = []
    for name, end in zip(("b", "d"), bar.ends, strict=True):
        J = pin.getFrameJacobian(model, data, model.getJointId(name), pin.SE3(np.eye(3), end), pin.LOCAL_WORLD_ALIGNED)
        columns.append(J[:3])
    return np.asarray(np.linalg.lstsq((columns[0] - columns[1]).T, tau, rcond=None)[0])


def force_sign() -> Evidence:
    force, expected = _force(swapped=True)
    return Evidence(float(force[0]), float(expected[0]), float(-force[0]), "N")


def force_frame() -> Evidence:
    force, expected = _force(turn=0.5)
    turned = pin.rpy.rpyToMatrix(0.0, 0.0, 0.5) @ force
    return Evidence(float(force[0]), float(expected[0]), float(turned[0]), "N")


def redundant_force() -> Evidence:
    closed = _Closed(twice=True)
    closed.accelerate(pin.ProximalSettings(*_SAFE))
    both = sum(float(data.contact_force.linear[0]) for data in closed.datas)
    return Evidence(float(closed.force[0]), float(_on_coupler(closed.bar)[0]), both, "N")
