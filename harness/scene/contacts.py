"""Contacts: joints between bodies and ground that are added to the mechanism for the whole scene."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from screwgauge.models.importing.assemble import DEAD, OWN_SHARE, PREFERRED, motions
from screwgauge.models.straight import why_singular
from screwgauge.reference.couplings import Coupling, PolynomialSum
from screwgauge.reference.description import fixings
from screwgauge.reference.equations.kinematics import pose
from screwgauge.reference.errors import DescriptionError, SingularPoseError, first_few
from screwgauge.reference.graph import check_connected, layout
from screwgauge.reference.linear import EPS
from screwgauge.reference.mechanism import GROUND, KINDS, Frame, Joint, Mechanism
from screwgauge.reference.rotations import Array
from screwgauge.reference.tables import check_name, read_items, require
from screwgauge.scene.keys import read_keys

#: Kind of a contact -> kind of its joint.
CONTACTS = {"weld": "fixed", "hinge": "R", "point": "S"}
#: Largest difference from a rotation by quarter turns that counts as rounding.
ROUNDING = 1e-12
#: Number of names listed in a sentence.
SHOWN = 6


@dataclass(frozen=True, slots=True, eq=False)
class Contact:
    """Attachment of a body to the ground.

    Attributes:
        kind: One of `CONTACTS`.
        point: Point of contact in the frame of the body [m]. Shape (3,).
        axis: Axis of a hinge: unit vector in the frame of the body. Shape (3,).
    """

    name: str
    body: str
    kind: str
    point: Array
    axis: Array
    where: str

    @property
    def held(self) -> Array:
        """Directions of the body that the contact keeps fixed, as columns in the frame of the body. Shape (3, n)."""
        return {"weld": np.eye(3), "hinge": self.axis[:, None], "point": np.zeros((3, 1))}[self.kind]

    def joint(self, R: Array, p: Array) -> Joint:
        """Return the joint between ground and the body at a pose, shapes (3, 3), (3,). A weld uses world axes."""
        kind, place = CONTACTS[self.kind], p + R @ self.point
        n, turned = len(KINDS[kind]), (np.eye(3), R.T) if self.kind == "weld" else (R, np.eye(3))
        return Joint(
            name=self.name,
            kind=kind,
            parent=GROUND,
            child=self.body,
            axes=np.eye(3) if self.kind == "point" else self.axis[None],
            coordinates=(self.name,) if n == 1 else tuple(f"{self.name}.q{i + 1}" for i in range(n)),
            home=np.zeros(n),
            limits=np.tile([-np.inf, np.inf], (n, 1)),
            parent_frame=Frame(place, turned[0]),
            child_frame=Frame(self.point, turned[1]),
            where=self.where,
        )

    def coupling(self, coordinate: str, value: float) -> Coupling:
        """Return the coupling that locks a coordinate of the free joint between ground and the body."""
        name = f"{self.name}.{coordinate.rpartition('.')[2]}"
        return Coupling(name, coordinate, PolynomialSum(float(value), {}), self.where)


def read_contact(mechanism: Mechanism, table: Any, where: str) -> Contact:
    """Read an entry of ``[[contacts]]``.

    Raises:
        ScrewgaugeError: A name or kind is unknown, a name is already in use, an axis is invalid, or a contact other
            than a hinge has an axis.
    """
    given = read_keys("contacts", table, where)
    body, kind = check_name("body", given["body"], [body.name for body in mechanism.bodies], where), given["kind"]
    name = given["name"] or f"{body}.contact"
    taken = {*mechanism.coordinates, *mechanism.independent}
    taken |= {joint.name for joint in mechanism.joints} | {one.name for one in mechanism.couplings}
    if name in taken:
        what = f"'{name}' is already a joint, coordinate or coupling of {mechanism.name}"
        raise DescriptionError(what, where, "rename the contact")
    if "axis" in table and kind != "hinge":
        raise DescriptionError(f"a {kind} has no axis", where, "remove it, or set kind = 'hinge'")
    if kind == "hinge":
        require(table, "axis", where)
    axis = np.eye(3)[2] if given["axis"] is None else given["axis"]
    return Contact(name, body, kind, given["point"], axis, where)


def read_contacts(mechanism: Mechanism, data: dict[str, Any], where: str) -> tuple[Contact, ...]:
    contacts = read_items(data, "contacts", where, partial(read_contact, mechanism))
    names = [contact.name for contact in contacts]
    if again := [name for name in names if names.count(name) > 1]:
        raise DescriptionError(f"two contacts have the name '{again[0]}'", f"{where}, contacts", "rename one")
    if contacts and (models := data.get("models")):
        files = first_few([str(file) for file in models.values()], SHOWN)
        what = f"contacts {first_few(names, SHOWN)} are not in {files}"
        remedy = "use generated model files, or describe the contacts as joints in the mechanism and the model files"
        raise DescriptionError(what, f"{where}, models", remedy)
    return contacts


def add_contacts(mechanism: Mechanism, contacts: Sequence[Contact], q: Array, where: str) -> Mechanism:
    """Return the mechanism with contacts and with the given joint coordinates as its home pose, shape (n_q,).

    A weld of a body on a free joint locks the coordinates of that joint instead of closing a loop.
    """
    at, couplings = pose(layout(mechanism), q[None]), list[Coupling]()
    joints = [replace(joint, home=q[mechanism.columns(joint.coordinates)]) for joint in mechanism.joints]
    free = {joint.child: joint for joint in joints if not joint.constrains and joint.parent == GROUND}
    for contact in contacts:
        i = mechanism.body_index[contact.body]
        if contact.kind == "weld" and (base := free.get(contact.body)) is not None:
            couplings += [contact.coupling(*pair) for pair in zip(base.coordinates, base.home, strict=True)]
        else:
            joints.append(contact.joint(_exact(at.R[0, i]), at.p[0, i]))
    couplings += fixings(joints[len(mechanism.joints) :])
    touching = replace(mechanism, joints=tuple(joints), couplings=(*mechanism.couplings, *couplings), independent={})
    check_connected(touching, where)
    return touching


def _exact(R: Array) -> Array:
    """Round a rotation to exact quarter turns if it differs from them only by rounding. Shape (3, 3)."""
    return np.round(R) if np.abs(R - np.round(R)).max() < ROUNDING else np.where(np.abs(R) < EPS, 0.0, R)


def choose_independent(
    touching: Mechanism, mechanism: Mechanism, named: Sequence[str], where: str
) -> tuple[dict[str, str], tuple[str, ...]]:
    """Return label -> independent coordinate of a mechanism with contacts, and the named coordinates left dependent.

    The order of preference is: named coordinates, actuated coordinates, other independent coordinates of the
    description, contacts, coordinates of the base.

    Raises:
        ScrewgaugeError: The contacts leave no degree of freedom, or attach at a singular pose.
    """
    K, names = motions(touching)[0], touching.coordinates
    if not K.shape[1]:
        raise DescriptionError(
            "the contacts leave no degree of freedom", where, "remove a contact, or set its kind to 'point'"
        )
    if why := why_singular(touching):
        remedy = "start the motion with bent legs, because contacts hold the bodies where they are at the start"
        raise SingularPoseError(f"the contacts attach at a singular pose: {why}", where, remedy)
    labels = {**{name: name for name in touching.moving}, **mechanism.independent}
    base = {name for joint in mechanism.joints if not joint.constrains for name in joint.coordinates}
    first = [names.index(labels[label]) for label in named]
    own = mechanism.columns(name for name in mechanism.independent.values() if name not in base)
    contacts = [i for i in range(len(mechanism.coordinates), len(names)) if names[i] in touching.moving]
    rest = [*own, *contacts, *range(len(names))]
    chosen = _first_of(K, [([*first, *touching.actuated_columns], OWN_SHARE), (rest, PREFERRED), (rest, 0.0)])
    by_name = {name: label for label, name in mechanism.independent.items()}
    found = {by_name.get(names[i], names[i]): names[i] for i in sorted(chosen)}
    return found, tuple(label for label, i in zip(named, first, strict=True) if i not in chosen)


def _first_of(K: Array, tiers: Iterable[tuple[Sequence[int], float]]) -> list[int]:
    """Select rows by priority; skip a row if too small a share of it is independent of selected rows. Shape (n, k)."""
    rest, sizes, chosen = K.copy(), np.linalg.norm(K, axis=1), list[int]()
    for rows, least in tiers:
        for row in rows:
            size = np.linalg.norm(rest[row])
            if len(chosen) < K.shape[1] and row not in chosen and size > max(least * sizes[row], DEAD):
                along = rest[row] / size
                rest = rest - np.outer(rest @ along, along)
                chosen.append(row)
    return chosen
