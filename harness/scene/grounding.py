"""Attaches a mechanism to the ground in a scene by contacts, or by a prescribed motion of a floating base.

Such a scene uses a separate description that extends the given one, so that the engines and the judge treat the
attachment like any other joint.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from screwgauge.models.catalog import load_mechanism
from screwgauge.models.formats import joint_entries, key, lines, value_text
from screwgauge.models.home import check_home
from screwgauge.models.importing.model import scratch_folder
from screwgauge.problem import GivenMotion
from screwgauge.reference.closed.assembly_mode import positions
from screwgauge.reference.equations.kinematics import length, pose
from screwgauge.reference.errors import DescriptionError, first_few
from screwgauge.reference.expressions import number
from screwgauge.reference.graph import layout, root
from screwgauge.reference.mechanism import GROUND, Joint, Mechanism
from screwgauge.reference.rotations import Array
from screwgauge.reference.tables import check_keys, read_list, require
from screwgauge.scene.contacts import Contact, add_contacts, choose_independent, read_contacts
from screwgauge.scene.grid import is_grid
from screwgauge.scene.motion import moved_labels, read_drive
from screwgauge.scene.scene import RULES

#: Slip of a contact [lengths of the mechanism or rad]: rounding level, and the largest slip due to encoder errors.
CLOSED, FARTHEST = 1e-9, 1e-2
#: Number of names listed in a sentence.
SHOWN = 6

#: Function of a scene's tables, the mechanism, the times of motion samples, and the scene's file; returns the times.
Times = Callable[[dict[str, Any], Mechanism, Array | None, Path], Array]


def hold_to_ground(
    file: Path, mechanism: Mechanism, data: dict[str, Any], path: Path, times: Times
) -> tuple[Path, Mechanism, dict[str, Any]]:
    """Attach a mechanism to the ground in a scene by contacts, or by a prescribed motion of a floating base.

    Args:
        file: The description of `mechanism`.
        data: Tables of the scene.
        path: File of the scene.
        times: Function that reads the times of the scene.

    Returns:
        The extended description; its mechanism, with a remark on each assumption; and the tables with the motion of
        only the coordinates that remain independent.

    Raises:
        ScrewgaugeError: A contact cannot be read, the contacts leave no degree of freedom or attach at a singular
            pose, or the motion would make a contact slip.
    """
    if "stance" in data and not data.get("contacts"):
        raise DescriptionError("'stance' needs a contact", str(path), "add [[contacts]], or remove stance")
    if not data.get("contacts") and ("forward" in data or all(joint.constrains for joint in mechanism.joints)):
        read_list(data, "contacts", str(path))
        return file, mechanism, data
    if is_grid(data.get("motion"), mechanism):
        what = "a grid supports neither contacts nor a floating base"
        raise DescriptionError(what, f"{path}, motion", "describe the support of the mechanism with joints")
    contacts = read_contacts(mechanism, data, str(path))
    known = [*dict.fromkeys([*mechanism.independent, *mechanism.moving, *(contact.name for contact in contacts)])]
    labels = _moved_labels(mechanism, known, contacts, data, path) if "forward" not in data else []
    motion = _motion(mechanism, labels, data, path, times) if "forward" not in data else None
    start = _start(data, known, path) if motion is None else dict(zip(labels, motion.y[0].tolist(), strict=True))
    at, said = mechanism, list[str]()
    if contacts:
        at, said, data = _in_contact(mechanism, contacts, start, motion, data, path)
    if motion is not None:
        at = _with_base_held(at, [mechanism.independent.get(label, label) for label in labels])
    said += [_said_of_base(joint) for joint in at.joints if joint.held]
    if at is mechanism:
        return file, mechanism, data
    file = _write(file, mechanism, at)
    read = load_mechanism(file)
    return file, replace(read, where=mechanism.where, remarks=(*mechanism.remarks, *said)), data


def _in_contact(
    mechanism: Mechanism,
    contacts: Sequence[Contact],
    start: Mapping[str, float],
    motion: GivenMotion | None,
    data: dict[str, Any],
    path: Path,
) -> tuple[Mechanism, list[str], dict[str, Any]]:
    """Return the mechanism with contacts, the assumptions, and the tables without motions of dependent coordinates."""
    where = f"{path}, contacts"
    stance = _stance(mechanism, start, data.get("stance", {}), f"{path}, stance")
    touching = add_contacts(mechanism, contacts, stance, where)
    independent, surplus = choose_independent(touching, mechanism, [*start], where)
    touching = replace(touching, independent=independent)
    said = [
        _assumption(contacts),
        *_rule_note(touching, data),
        *_follow(mechanism, touching, [*start], motion, surplus, contacts, f"{path}, motion"),
    ]
    return touching, said, _drop_motion(data, surplus)


def _drop_motion(data: dict[str, Any], labels: Collection[str]) -> dict[str, Any]:
    """Remove the motion or the start of given labels from the tables; columns of a CSV file may remain."""
    if "forward" in data:
        start = {label: value for label, value in data["forward"].get("start", {}).items() if label not in labels}
        return {**data, "forward": {**data["forward"], "start": start}}
    if "csv" in data["motion"]:
        return data
    return {**data, "motion": {label: terms for label, terms in data["motion"].items() if label not in labels}}


def _with_base_held(mechanism: Mechanism, named: Collection[str]) -> Mechanism:
    """Let the ground hold the named coordinates of a floating base unless other joints connect the base to ground."""
    joints = list[Joint]()
    for joint in mechanism.joints:
        free = not joint.constrains and joint.parent == GROUND and not _is_led_to(mechanism, joint)
        held = tuple(name for name in joint.coordinates if name in named) if free else joint.held
        joints.append(replace(joint, held=held))
    return replace(mechanism, joints=tuple(joints)) if any(joint.held for joint in joints) else mechanism


def _said_of_base(base: Joint) -> str:
    """Return a sentence on the force that the prescribed motion of a base requires."""
    return (
        f"the motion of {base.child} is given and no actuator drives it, so actuator_force includes the force that the "
        f"ground would have to exert along {first_few(base.held, len(base.coordinates))}"
    )


def _is_led_to(mechanism: Mechanism, base: Joint) -> bool:
    """Return True if joints other than `base` connect its child to ground."""
    group = {name: name for name in mechanism.body_index}
    for joint in mechanism.joints:
        if joint is not base:
            group[root(group, joint.parent)] = root(group, joint.child)
    return root(group, GROUND) == root(group, base.child)


def _start(data: dict[str, Any], known: Collection[str], path: Path) -> dict[str, float]:
    """Read the start of a simulation: name of a coordinate -> value [rad or m].

    Raises:
        ScrewgaugeError: A name is unknown, or a value is not a number.
    """
    start = data["forward"].get("start", {}) if isinstance(data["forward"], dict) else {}
    check_keys(start, known, f"{path}, forward.start")
    return {label: number(value, f"{path}, forward.start.{label}") for label, value in start.items()}


def _moved_labels(
    mechanism: Mechanism, known: Collection[str], contacts: Sequence[Contact], data: dict[str, Any], path: Path
) -> list[str]:
    """Return the names of the coordinates for which the scene gives a motion, in the scene's order.

    Raises:
        ScrewgaugeError: The motion is missing, or a name is unknown.
    """
    motion, where = require(data, "motion", str(path)), f"{path}, motion"
    if isinstance(motion, dict) and "csv" in motion:
        names = [*mechanism.independent, *(contact.name for contact in contacts)]
        return moved_labels(motion, names, path.parent, where)
    check_keys(motion, known, where)
    return [*motion]


def _motion(mechanism: Mechanism, labels: list[str], data: dict[str, Any], path: Path, times: Times) -> GivenMotion:
    """Read the given motion of some coordinates, at the times of the scene."""
    drive, sampled = read_drive(data["motion"], labels, path.parent, f"{path}, motion")
    return drive(times(data, mechanism, sampled, path))


def _stance(mechanism: Mechanism, start: Mapping[str, float], table: Any, where: str) -> Array:
    """Return all coordinates of the description without contacts, at the pose where contacts attach. Shape (n_q,).

    Each coordinate has its value at the start of the motion, or else its value in ``[stance]``, or else its home value.
    """
    check_keys(table, mechanism.independent, where)
    if twice := [label for label in table if label in start]:
        raise DescriptionError(f"'{twice[0]}' has a motion, which determines its start", where, "remove the entry")
    home = mechanism.home[mechanism.independent_columns]
    given = {**start, **{label: number(value, f"{where}.{label}") for label, value in table.items()}}
    y = np.array([given.get(label, value) for label, value in zip(mechanism.independent, home, strict=True)])
    if np.array_equal(y, home):
        return mechanism.home
    check_home(mechanism)
    q: Array = positions(layout(mechanism), y[None], np.zeros(1))[0]
    q[mechanism.independent_columns] = y  # undo the rounding caused by dimensionless unknowns
    return q


def _assumption(contacts: Sequence[Contact]) -> str:
    """Return a sentence on the assumptions about contacts."""
    held = first_few([f"'{contact.name}' ({contact.kind} of {contact.body})" for contact in contacts], SHOWN)
    return f"these contacts hold bodies where they are at the start of the motion, and pull as well as push: {held}"


def _rule_note(touching: Mechanism, data: dict[str, Any]) -> Iterator[str]:
    """Yield a sentence on the rule for actuator forces if actuators can counteract each other through contacts."""
    if len(touching.actuators) > len(touching.independent) and "forward" not in data:
        yield (
            f"with contacts, {len(touching.actuators)} actuators drive {len(touching.independent)} freedoms and can "
            f"strain the mechanism against the ground; the rule {data.get('rule', RULES[0])} determines their forces"
        )


def _follow(
    mechanism: Mechanism,
    touching: Mechanism,
    labels: Sequence[str],
    motion: GivenMotion | None,
    surplus: Sequence[str],
    contacts: Sequence[Contact],
    where: str,
) -> list[str]:
    """Report given coordinates that depend on other coordinates, and how far the given motion makes contacts slip.

    Raises:
        DescriptionError: A contact would slip farther than rounding or encoder errors explain.
    """
    if not surplus:
        return []
    if beyond := [label for label in surplus if label not in mechanism.independent]:
        what = f"'{beyond[0]}' follows from {first_few([*touching.independent], SHOWN)}"
        raise DescriptionError(what, where, "remove it")
    leads = [label for label in touching.independent if label in labels]
    if not leads and motion is not None:
        what = f"contacts hold {first_few(surplus, SHOWN)}, so that no coordinate with a motion can move"
        raise DescriptionError(what, where, "remove a contact, or simulate with [forward]")
    said = f"with contacts, {first_few(surplus, SHOWN)} follow from {first_few(leads, SHOWN)}"
    if motion is None:
        return [said]
    if len(leads) < len(touching.independent):
        return [f"{said}; how far the given motion would slide the contacts depends on coordinates without an actuator"]
    ways, t = _slides(mechanism, touching, motion, labels, contacts), motion.t
    ways[:, :, 0] /= (size := length(layout(mechanism)))
    far = [
        f"'{contact.name}' by {1e3 * size * slide.max():.3g} mm and {1e3 * turn.max():.3g} mrad "
        f"(t = {t[np.maximum(slide, turn).argmax()]:g} s)"
        for contact, (slide, turn) in zip(contacts, ways.transpose(1, 2, 0), strict=True)
        if max(slide.max(), turn.max()) > CLOSED
    ]
    if not far:
        return [said]
    sentence = f"{said}; the given motion would slide {first_few(far, SHOWN)}"
    if ways.max() > FARTHEST:
        raise DescriptionError(sentence, where, f"remove {first_few(surplus, SHOWN)} from the motion, or correct it")
    return [sentence]


def _slides(
    mechanism: Mechanism, touching: Mechanism, motion: GivenMotion, labels: Sequence[str], contacts: Sequence[Contact]
) -> Array:
    """Return how far the given motion shifts each contact point [m] and turns its body [rad]. Shape (n, c, 2)."""
    chosen = [labels.index(label) for label in touching.independent]
    y, yd, ydd = (x[:, chosen] for x in (motion.y, motion.yd, motion.ydd))
    q = positions(layout(touching), y, motion.t, (yd, ydd))[:, : len(mechanism.coordinates)]
    free = q[:, mechanism.independent_columns]
    for i, label in enumerate(mechanism.independent):
        if label in labels:
            free[:, i] = motion.y[:, labels.index(label)]
    lay, start = layout(mechanism), touching.home[None, : len(mechanism.coordinates)]
    moved, at = pose(lay, positions(lay, free, motion.t)), pose(lay, start)
    found = np.empty((len(motion), len(contacts), 2))
    for ways, contact in zip(found.transpose(1, 2, 0), contacts, strict=True):
        i = mechanism.body_index[contact.body]
        turned = moved.R[:, i] - at.R[:, i]
        ways[0] = np.linalg.norm(moved.p[:, i] - at.p[:, i] + turned @ contact.point, axis=1)
        ways[1] = np.linalg.norm(turned @ contact.held, axis=(1, 2)) / np.sqrt(2.0)
    return found


def _write(file: Path, mechanism: Mechanism, changed: Mechanism) -> Path:
    """Write a scene's extension of the given description to a folder removed at the end of the process."""
    out = [f"extends = {value_text(str(file.resolve()))}", "", "[independent]", *lines(changed.independent)]
    for i, joint in enumerate(changed.joints):
        entries = joint_entries(joint)
        if i < len(mechanism.joints):
            old, entries = mechanism.joints[i], {}
            if not np.array_equal(old.home, joint.home) and not joint.fixed:
                entries["home"] = joint.home
            if joint.held != old.held:
                entries["held"] = joint.held
        out += ["", f"[joints.{key(joint.name)}]", *lines(entries)] if entries else []
    for one in changed.couplings[len(mechanism.couplings) :]:
        if not one.fixing:
            held = {"coordinate": one.coordinate, "polynomial": one.function.polynomial}
            out += ["", f"[couplings.{key(one.name)}]", *lines(held)]
    written = scratch_folder() / file.name
    written.write_text("\n".join(out) + "\n", encoding="utf-8")
    return written
