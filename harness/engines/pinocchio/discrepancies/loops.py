"""Closed loops in Pinocchio: proximal settings, kinds of contact, and whose force it is."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pinocchio as pin

from screwgauge.engines.pinocchio.discrepancies.probe import four_bar
from screwgauge.engines.pinocchio.tree import initialise
from screwgauge.engines.toy_models import Evidence, FourBar
from screwgauge.reference.rotations import Array

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
        """Largest error of its accelerations [rad/s^2]; NaN where one is none."""
        return float(np.max(abs(self.accelerate(pin.ProximalSettings(*settings)) - self.bar.a)))


def default_settings() -> Evidence:
    """Largest error of the accelerations of a planar four-bar closed by a point, one of whose rows is empty."""
    closed = _Closed()
    return Evidence(closed.error(), 0.0, closed.error(*_SAFE), "rad/s^2")


def two_arguments() -> Evidence:
    """The same with constraints initialised as Pinocchio 3 wants it, without their data, and with them."""
    closed, message = _Closed(), ""
    value = math.nan
    try:
        pin.initConstraintDynamics(closed.model, closed.data, closed.contacts)
        value = closed.error(*_SAFE)
    except Exception as error:  # Boost's ArgumentError, which has no name to import
        message = f"{type(error).__name__} of {pin.initConstraintDynamics.__name__}"
    return Evidence(value, 0.0, closed.error(*_SAFE), "rad/s^2", message)


def one_iteration() -> Evidence:
    """The same after one proximal iteration at mu = 1e-3, and after eight."""
    closed = _Closed()
    return Evidence(closed.error(0.0, 0.0, 1e-3, 1), 0.0, closed.error(0.0, 0.0, 1e-3, 8), "rad/s^2")


def frame_locks_hinge() -> Evidence:
    """Acceleration error of a four-bar whose hinge is closed by a whole frame, and by a point."""
    return Evidence(_Closed("CONTACT_6D").error(*_SAFE), 0.0, _Closed().error(*_SAFE), "rad/s^2")


def _force(**how: Any) -> tuple[Array, Array]:
    """Force on the coupler at the cut [N], as Pinocchio has it and as the equations of the open tree have it."""
    closed = _Closed(**how)
    closed.accelerate(pin.ProximalSettings(*_SAFE))
    return closed.force[:3], _on_coupler(closed.bar)


def _on_coupler(bar: FourBar) -> Array:
    """From the equations of motion of the tree: tau + J^T f = M a + h, J of coupler less rocker."""
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
    """Force along x on the coupler, of a constraint that names the rocker first; and turned round."""
    force, expected = _force(swapped=True)
    return Evidence(float(force[0]), float(expected[0]), float(-force[0]), "N")


def force_frame() -> Evidence:
    """The same of a constraint whose frames are turned by 0.5 rad, and rotated into the world."""
    force, expected = _force(turn=0.5)
    turned = pin.rpy.rpyToMatrix(0.0, 0.0, 0.5) @ force
    return Evidence(float(force[0]), float(expected[0]), float(turned[0]), "N")


def redundant_force() -> Evidence:
    """The same of one of two equal constraints, and of both together."""
    closed = _Closed(twice=True)
    closed.accelerate(pin.ProximalSettings(*_SAFE))
    both = sum(float(data.contact_force.linear[0]) for data in closed.datas)
    return Evidence(float(closed.force[0]), float(_on_coupler(closed.bar)[0]), both, "N")
