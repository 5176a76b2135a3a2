"""Converts model-file content that descriptions cannot express to forces that a run measures, or rejects the file."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from screwgauge.models.content import kinds
from screwgauge.models.machine import Machine
from screwgauge.models.mjcf import mass_properties
from screwgauge.models.readings.compiled import collect_phrases, coupled_joints, shares, sites_along
from screwgauge.models.readings.mujoco import is_disabled, load_mujoco, turn
from screwgauge.models.readings.read import read_source
from screwgauge.models.readings.reading import FREEDOMS, ActuatorReading, JointReading, Reading
from screwgauge.models.readings.source import Source
from screwgauge.reference.errors import ModelFileError, first_few
from screwgauge.reference.left_out import (
    BorneWeight,
    Drag,
    LeftOut,
    Powers,
    StrokeResistance,
    TurnResistance,
)
from screwgauge.reference.mechanism import GROUND, Frame, Joint, Mechanism
from screwgauge.reference.resistance import RESISTS
from screwgauge.reference.rotations import Array

#: Number of items of a kind that a sentence names.
NAMED = 3
#: Moments of inertia per mass below which MuJoCo's equivalent box has zero size [m^2].
NO_WIDTH = 1e-15
#: Entries of rotations below this value are rounding errors of zero.
ROUNDING = 4e-16
#: Equalities that every library reads as closures; support for other equalities depends on the library.
CLOSURES = ("connect", "weld")


def check_whole(reading: Reading, source: Source) -> None:
    """Reject a file whose content has effects that neither a description can express nor a run can measure.

    Raises:
        ModelFileError: Such content exists; the message names it and the remedy.
    """
    where = str(source.path)
    for kind in kinds().values():
        named = [each.sentence for each in reading.content if each.kind == kind.name] if kind.run == "refused" else []
        if named:
            raise ModelFileError(f"{first_few(named, NAMED)}: {kind.why}", where, kind.remedy)
    other = [] if reading.library == "mujoco" or source.form != "mjcf" else _equalities(source)
    if other:
        what = f"equality {first_few(other, NAMED)}, which {reading.library} does not read, would be left out"
        raise ModelFileError(what, where, "read it with mujoco (--reader mujoco)")


def _equalities(source: Source) -> list[str]:
    """List the active equalities of an MJCF that are neither connect nor weld."""
    root = source.root
    if any(flag.get(name) == "disable" for flag in root.iter("flag") for name in ("equality", "constraint")):
        return []
    rows = (row for section in root.iterfind("equality") for row in section)
    return [row.get("name", row.tag) for row in rows if row.tag not in CLOSURES and row.get("active") != "false"]


def left_out_of(source: Source, reading: Reading) -> tuple[LeftOut, ...]:
    """Return the forces of a file that do not stem from rigid bodies, closures and gravity; use MuJoCo for an MJCF.

    Raises:
        ModelFileError: A run cannot measure one of these forces.
    """
    where = str(source.path)
    if source.form != "mjcf":
        return _all_forces(reading, None, where)
    try:
        own = reading if reading.library == "mujoco" else read_source(source, "mujoco")
    except ModelFileError:  # a different library read the file; only its reading is available
        return _all_forces(reading, None, where)
    check_whole(own, source)
    with collect_phrases():
        return _all_forces(replace(reading, joints=own.joints), load_mujoco(source), where)


def left_out_of_model(reading: Reading, where: str) -> tuple[LeftOut, ...]:
    """Return the forces of a model without a file that do not stem from rigid bodies, closures and gravity."""
    return _all_forces(reading, None, where)


def _all_forces(reading: Reading, model: Any | None, where: str) -> tuple[LeftOut, ...]:
    """Return all omitted forces, named as in the file.

    Args:
        reading: Reading of the file.
        model: The file as compiled by MuJoCo; None if MuJoCo does not read it.
        where: Name of the file, for error messages.
    """
    found = list[LeftOut]()
    for name, joint in reading.joints.items():
        found += _of_joint(name, joint, model, where)
    if model is None:
        weightless = ((name, body) for name, body in reading.bodies.items() if body.gravcomp)
        found += (BorneWeight(f"body {n}", n, body.gravcomp * body.mass, body.com) for n, body in weightless)
    else:
        found += _of_tendons(model, reading, where)
        found += _of_actuators(model, where)
        found += _of_bodies(model, reading, where)
    return tuple(found)


def _of_joint(name: str, joint: JointReading, model: Any | None, where: str) -> Iterator[LeftOut]:
    of, stiffness, damping = f"joint {name}", _powers([joint.stiffness]), _powers([joint.damping])
    if model is not None:
        i = model.joint(name).id
        stiffness, damping = _spring(model, "jnt", i), _damper(model, "dof", model.jnt_dofadr[i])
    laws: dict[str, Any] = {"armature": joint.armature, "damping": damping, "friction": joint.friction}
    if FREEDOMS[joint.kind] == 1:
        if any(laws.values()) or stiffness:
            yield StrokeResistance(of, {name: 1.0}, **laws, stiffness=stiffness, rest=(joint.rest, joint.rest))
        return
    if stiffness:
        what = f"joint {name} is a {joint.kind} joint with a spring, which cannot be measured"
        raise ModelFileError(what, where, "replace it with three hinges, or remove its stiffness")
    if any(laws.values()):
        yield TurnResistance(of, name, **laws)


def _spring(model: Any, owner: str, i: int) -> Powers:
    """Return the polynomial of a joint's or tendon's spring; empty if springs are disabled."""
    return () if is_disabled(model, "SPRING") else _law(model, f"{owner}_stiffness", i)


def _damper(model: Any, owner: str, i: int) -> Powers:
    """Return the damper polynomial of a degree of freedom, tendon or actuator; empty if dampers are disabled."""
    return () if is_disabled(model, "DAMPER") else _law(model, f"{owner}_damping", i)


def _law(model: Any, array: str, i: int) -> Powers:
    """Return the coefficients of a force law, of which MuJoCo has several since version 4.0."""
    arrays = [getattr(model, name) for name in (array, f"{array}poly") if hasattr(model, name)]
    return _powers(float(x) for values in arrays for x in np.ravel(values[i]))


def _powers(values: Iterable[float]) -> Powers:
    """Return the coefficients of a force law without trailing zeros."""
    return tuple(np.trim_zeros(np.array([*values], dtype=float), "b").tolist())


def _of_tendons(model: Any, reading: Reading, where: str) -> Iterator[LeftOut]:
    """Yield the tendons that exert forces."""
    for i in range(model.ntendon):
        low, high = np.broadcast_to(model.tendon_lengthspring[i], 2).tolist()
        rubs = not is_disabled(model, "FRICTIONLOSS")
        laws: dict[str, Any] = {
            "armature": float(model.tendon_armature[i]) if hasattr(model, "tendon_armature") else 0.0,
            "damping": _damper(model, "tendon", i),
            "friction": float(model.tendon_frictionloss[i]) if rubs else 0.0,
            "stiffness": _spring(model, "tendon", i),
        }
        of, fixed = f"tendon {model.tendon(i).name}", shares(model, i)
        if any(laws.values()):
            path = _path(model, i, reading, where) if fixed is None else ()
            yield StrokeResistance(of, _coordinates(model, fixed or {}), path, **laws, rest=(low, high))


def _path(model: Any, tendon: int, reading: Reading, where: str) -> tuple[tuple[str, Array], ...]:
    """Return the points through which a tendon runs, each with its body in the reading."""
    sites = sites_along(model, tendon)
    if sites is None:
        what = (
            f"tendon {model.tendon(tendon).name} runs over geoms or pulleys and exerts forces, which cannot be measured"
        )
        raise ModelFileError(
            what, where, "route it through sites only, or remove its stiffness, damping, friction and armature"
        )
    path = list[tuple[str, Array]]()
    for site in sites:
        body = model.body(model.site_bodyid[site]).name if model.site_bodyid[site] else ""
        whole, T = (reading.place(body) if body else None) or (GROUND, np.eye(4))
        path.append((whole, _transform_point(T, model.site_pos[site])))
    return tuple(path)


def _coordinates(model: Any, shares_of: Mapping[int, float], factor: float = 1.0) -> dict[str, float]:
    return {model.joint(joint).name: factor * share for joint, share in shares_of.items() if share}


def _of_actuators(model: Any, where: str) -> Iterator[LeftOut]:
    """Yield rotors and dampers of actuators, with coefficients multiplied by the square of the gear ratio."""
    for i in range(model.nu if hasattr(model, "actuator_armature") else 0):
        armature, damping = float(model.actuator_armature[i]), _damper(model, "actuator", i)
        if not (armature or damping):
            continue
        name, joints = model.actuator(i).name, coupled_joints(model, i)
        if not joints:
            what = f"actuator {name} has armature or damping, but drives no hinge, slide or fixed tendon"
            raise ModelFileError(what, where, "remove its armature and damping")
        square = float(model.actuator_gear[i, 0]) ** 2
        along = _coordinates(model, joints)
        scaled = tuple(square * c for c in damping)
        yield StrokeResistance(f"actuator {name}", along, armature=square * armature, damping=scaled)


def _of_bodies(model: Any, reading: Reading, where: str) -> Iterator[LeftOut]:
    """Yield the compensated weight and the drag of every moving body of the file."""
    masses, moments = mass_properties(model)
    weighs = not is_disabled(model, "GRAVITY")
    density, viscosity = float(model.opt.density), float(model.opt.viscosity)
    for i in range(1, model.nbody):
        name, mass = model.body(i).name, float(masses[i])
        place = reading.place(name)
        if place is None or place[0] == GROUND or not mass:
            continue
        body, T = place
        centre = T @ np.append(model.body_ipos[i], 1.0)
        share = float(model.body_gravcomp[i]) if weighs else 0.0
        if share and not _borne_by_actuators(model, i, where):
            yield BorneWeight(f"body {name}", body, share * mass, centre[:3])
        if density or viscosity:
            box = np.sqrt(np.maximum(NO_WIDTH, moments[i].sum() - 2.0 * moments[i]) / mass * 6.0)
            frame = Frame(centre[:3], _clean(T[:3, :3] @ turn(model.body_iquat[i])))
            yield Drag(f"body {name}", body, density, viscosity, model.opt.wind.copy(), box, frame)


def _borne_by_actuators(model: Any, body: int, where: str) -> bool:
    """Return True if actuators compensate a body's weight along all its ancestor joints; then no force is omitted.

    Raises:
        ModelFileError: Actuators compensate the weight along some but not all of these joints.
    """
    borne, name = set[bool](), model.body(body).name
    while body:
        first = model.body_jntadr[body]
        borne |= {bool(model.jnt_actgravcomp[first + k]) for k in range(model.body_jntnum[body])}
        body = model.body_parentid[body]
    if len(borne) > 1:
        what = f"actuators compensate the weight of body {name} along only some of its joints, which cannot be measured"
        raise ModelFileError(what, where, "set actuatorgravcomp on all of them, or on none")
    return borne == {True}


def convert(
    left_out: Iterable[LeftOut],
    mechanism: Mechanism,
    graph: Machine,
    names: Mapping[str, Mapping[str, str]],
    where: str,
) -> tuple[LeftOut, ...]:
    """Convert omitted forces to names and frames of the description; drop forces of joints that `graph` lacks.

    Args:
        left_out: Forces, named as in the file.
        graph: Machine from which the mechanism was made.
        names: ``bodies`` and ``joints`` -> name in the file -> name in the description.

    Raises:
        ModelFileError: A force acts along a coordinate that the description lacks.
    """
    found = list[LeftOut]()
    for one in left_out:
        if isinstance(one, BorneWeight | Drag):
            found += _on_part(one, names["bodies"].get(one.body, one.body), graph)
        elif isinstance(one, StrokeResistance) and one.path:
            path = ((names["bodies"].get(body, body), point) for body, point in one.path)
            moved = tuple(_point_on_part(body, point, graph, f"{where}, {one.of}") for body, point in path)
            found.append(replace(one, path=moved))
        elif isinstance(one, TurnResistance):
            found += _of_turning_joint(one, names["joints"].get(one.joint, one.joint), mechanism)
        else:
            found += _along_coordinates(one, names["joints"], mechanism, graph, where)
    return tuple(found)


def with_resistance(
    mechanism: Mechanism, left_out: Sequence[LeftOut], actuators: Mapping[str, ActuatorReading]
) -> tuple[Mechanism, list[str]]:
    """Add forces along a single coordinate to the joints of the mechanism; keep the remaining forces separate.

    Args:
        left_out: See `convert`.
        actuators: Actuators of the file.

    Returns:
        The mechanism, and a sentence for each rotor behind a gear.
    """
    amounts = {name: dict.fromkeys(RESISTS, 0.0) for name in mechanism.coordinates}
    rest, gears = list[LeftOut](), list[str]()
    for one in left_out:
        if not isinstance(one, StrokeResistance) or len(one.along) != 1:
            rest.append(one)
            continue
        ((name, share),) = one.along.items()
        linear = len(one.damping) <= 1
        taken = {"rotor": share**2 * one.armature, "friction": abs(share) * one.friction}
        taken["damping"] = share**2 * sum(one.damping) if linear else 0.0
        amounts[name] = {what: amounts[name][what] + taken[what] for what in RESISTS}
        if one.stiffness or not linear:
            rest.append(replace(one, armature=0.0, friction=0.0, damping=() if linear else one.damping))
        actuator = actuators.get(one.of.removeprefix("actuator "))
        if one.armature and one.of.startswith("actuator ") and actuator:
            own = f"armature {one.armature / actuator.gear**2:g} of {one.of} times its gear {actuator.gear:g} squared"
            unit = mechanism.units[mechanism.coordinates.index(name)]
            gears.append(f"Rotor of {name}: {taken['rotor']:g} {'kg m^2' if unit == 'rad' else 'kg'}, {own}.")
    joints = (_add_resistance(joint, amounts) for joint in mechanism.joints)
    return replace(mechanism, joints=tuple(joints), left_out=tuple(rest)), gears


def _add_resistance(joint: Joint, amounts: Mapping[str, Mapping[str, float]]) -> Joint:
    """Add resistances to the coordinates of a joint."""
    more = {what: np.array([amounts[name][what] for name in joint.coordinates]) for what in RESISTS}
    return replace(joint, **{what: getattr(joint, what) + added for what, added in more.items()})


def _of_turning_joint(one: TurnResistance, name: str, mechanism: Mechanism) -> Iterator[LeftOut]:
    """Map the forces on a ball or free joint in the file to the joint into which the import converted that joint."""
    made = (joint for joint in mechanism.joints if joint.angles == 3)  # the coordinates identify the original joint
    yield from (replace(one, of=f"joint {name}", joint=j.name) for j in made if j.coordinates[-1] == f"{name}.q3")


def _along_coordinates(
    one: StrokeResistance, joints: Mapping[str, str], mechanism: Mechanism, graph: Machine, where: str
) -> Iterator[LeftOut]:
    single = {name for name, joint in graph.reading.joints.items() if FREEDOMS[joint.kind] == 1}
    there = single & {name for link in graph.links for name in link.joints}  # a loops file turns hinges into balls
    along = {joints.get(name, name): share for name, share in one.along.items()}
    along = {name: share for name, share in along.items() if name in there}
    if missing := [name for name in along if name not in mechanism.coordinates]:
        what = f"{one.of} acts along '{missing[0]}', which is not a coordinate of the description"
        raise ModelFileError(what, where, "remove its armature, damping, friction and springs")
    if along:
        noun, _, name = one.of.partition(" ")
        yield replace(one, of=f"joint {joints.get(name, name)}" if noun == "joint" else one.of, along=along)


def _on_part(one: BorneWeight | Drag, body: str, graph: Machine) -> Iterator[LeftOut]:
    """Express a force in the frame of the machine's body; omit the force if that body is the ground."""
    part = graph.part_of(body)
    if part == GROUND:
        return
    T = np.linalg.inv(graph.bodies[part].pose) @ graph.reading.bodies[body].pose if part != body else np.eye(4)
    if isinstance(one, BorneWeight):
        yield replace(one, body=part, point=_transform_point(T, one.point))
    else:
        yield replace(one, body=part, frame=Frame(_transform_point(T, one.frame.p), _clean(T[:3, :3] @ one.frame.R)))


def _point_on_part(body: str, point: Array, graph: Machine, where: str) -> tuple[str, Array]:
    """Convert a point on a body of the reading to a point on the machine's body."""
    if body == GROUND:
        return GROUND, point
    part = next((name for name, each in graph.bodies.items() if body in each.members), None)
    if part is None:
        raise ModelFileError(
            f"runs through a site of body {body}, which has no mass", where, "add mass to that body, or move the site"
        )
    if part == body:
        return part, point
    return part, _transform_point(np.linalg.inv(graph.bodies[part].pose) @ graph.reading.bodies[body].pose, point)


def _clean(R: Array) -> Array:
    """Set nearly zero entries of a rotation matrix to zero, as the reader of descriptions does."""
    return np.where(np.abs(R) < ROUNDING, 0.0, R)


def _transform_point(T: Array, point: Array) -> Array:
    return np.asarray(T[:3, :3] @ point + T[:3, 3])
