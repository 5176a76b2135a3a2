"""Writes a mechanism as MJCF: composite joints as several joints of a body, loops and couplings as equalities.

Mass properties are written in a form that MuJoCo accepts: a full tensor, or principal moments and axes where MuJoCo
rejects the tensor. MuJoCo rejects a moving body whose mass or any principal moment is below `LEAST`, moments that
violate A + B >= C even by a rounding error, and a full tensor with an eigenvalue below 1e-14, which can arise from its
own rounding error of 1e-14 of the largest eigenvalue. Therefore, zero is written as `LEAST`, and `without_stand_ins`
restores zero in a loaded model.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence, Set
from typing import Any
from xml.etree import ElementTree as ET

import numpy as np

from screwgauge.models.formats import number_text, quaternion, tensor_text, vector_text
from screwgauge.models.layout import Closure, Freedom, Link, Tree, lay_out
from screwgauge.models.shapes import add_contact_pairs, add_geoms, add_sensors
from screwgauge.reference.couplings import Coupling
from screwgauge.reference.errors import UnknownNameError, first_few
from screwgauge.reference.mechanism import GROUND, SLACK, Body, Frame, Mechanism, triangle_excess
from screwgauge.reference.rigid import compose, inverse
from screwgauge.reference.rotations import Array

#: Smallest mass and moment of a moving body that MuJoCo accepts [kg, kg m^2]; it is written instead of zero.
LEAST = 1e-15
#: Margin between a tensor's moments and values that MuJoCo rejects, relative to the largest moment, and in kg m^2; with
#: a larger margin, the full tensor is written. Compilers before 3.14 rotate a tensor with nine digits.
ROOM, ABOVE = 1e-8, 1e-13
#: Errors in a moment of zero, relative to the largest moment: from rounding a tensor's six entries and rotating it, and
#: from the compiler; a moment below both the latter and `LEAST` is written as zero.
ROUNDING, NEGLIGIBLE = 8.0 * float(np.finfo(float).eps), 5e-14
#: Number of bodies that a sentence names.
SHOWN = 6


def inertial(body: Body) -> dict[str, str]:
    """Return the attributes of a body's ``<inertial>``."""
    attributes = {"pos": vector_text(body.com), "mass": number_text(body.mass or LEAST)}
    if not body.mass:
        return {**attributes, "diaginertia": vector_text([LEAST] * 3)}
    return {**attributes, **of_tensor(body.inertia, body.allowed)}


def of_tensor(I: Array, allowed: bool = False) -> dict[str, str]:
    """Format a tensor in the axes of its body as attributes of an ``<inertial>``. Shape (3, 3).

    Args:
        allowed: Replace a tensor that MuJoCo rejects with the nearest accepted tensor, see `mass_properties`.
    """
    least, middle, largest = np.linalg.eigvalsh(I)
    room, excess = max(ROOM * largest, ABOVE), largest - least - middle
    refused = max(-least, excess) > SLACK * np.trace(I) and not allowed
    if min(least, -excess) > room or refused:  # clearly accepted or clearly rejected
        return {"fullinertia": tensor_text(I)}
    moments, q = principal(I)
    turned = {} if q is None else {"quat": vector_text(q)}
    return {"diaginertia": vector_text(_acceptable(moments)), **turned}


def principal(I: Array) -> tuple[Array, Array | None]:
    """Compute the principal moments of a tensor, shape (3,), and the quaternion of the axes (None for body axes)."""
    if not np.any(I - np.diag(np.diag(I))):
        return np.diag(I).copy(), None
    moments, axes = np.linalg.eigh(I)
    axes[:, 2] *= np.sign(np.linalg.det(axes))
    return moments, quaternion(axes)


def _acceptable(moments: Array) -> Array:
    """Return the nearest moments that MuJoCo accepts. Shape (3,)."""
    taken = np.where(_is_zero(moments), LEAST, np.where(moments == LEAST, np.nextafter(LEAST, 1.0), moments))
    low, mid, high = np.argsort(taken)
    taken[high] = min(taken[high], taken[low] + taken[mid])  # exceeded only by rounding, see `Body`
    return taken


def _is_zero(moments: Array) -> Array:
    """Return True for moments that are written as `LEAST`. Shape (3,)."""
    return np.asarray((moments < LEAST) & (moments <= NEGLIGIBLE * float(moments.max())))


def without_stand_ins(mass: Array, moments: Array) -> tuple[Array, Array]:
    """Replace `LEAST` with zero in the masses, (n,), and principal moments, (n, 3), of a loaded model."""
    moments = np.where(moments <= LEAST, 0.0, moments)
    return np.where((mass <= LEAST) & ~moments.any(axis=1), 0.0, mass), moments


#: Prefix of custom numbers in an MJCF that contain the true principal moments of a body that MuJoCo rejects.
MOMENTS = "screwgauge.moments."


def mass_properties(model: Any) -> tuple[Array, Array]:
    """Return the true masses, (n,), and principal moments, (n, 3), of a loaded model, see `MOMENTS`."""
    masses, moments = without_stand_ins(model.body_mass, model.body_inertia)
    names = {model.body(i).name: i for i in range(model.nbody)}
    for k in range(model.nnumeric):
        name, its = model.numeric(k).name, model.numeric(k).data
        body = names.get(name.removeprefix(MOMENTS)) if name.startswith(MOMENTS) else None
        if body is not None and its.shape == (3,) and (its >= 0.0).all() and np.isfinite(its).all():
            moments[body] = its
    return masses, moments


def _is_refused(body: Body) -> bool:
    """Return True if MuJoCo rejects the tensor of a body."""
    return bool(body.mass and triangle_excess(body.inertia))


def stand_in_sentence(names: Sequence[str]) -> Iterator[str]:
    """Yield a message about small moments that are written instead of zero, and set to zero after loading."""
    if names:
        yield (
            f"MuJoCo rejects moments of inertia of zero: {LEAST:g} kg m^2 replaces them in "
            f"{first_few(names, SHOWN)}; the engine mujoco restores zero after loading, but other programs do not"
        )


def stand_ins(mechanism: Mechanism) -> Iterator[str]:
    """Yield messages about moments of inertia that MJCF cannot express, and their substitutes."""
    moments = {body.name: principal(body.inertia)[0] for body in mechanism.bodies if body.mass}
    for sentence in stand_in_sentence([name for name, its in moments.items() if _is_zero(its).any()]):
        yield f"MJCF: {sentence}"
    beyond = [body.name for body in mechanism.bodies if _is_refused(body)]
    if beyond:
        yield (
            f"MJCF: MuJoCo rejects A + B < C: the largest moment of {first_few(beyond, SHOWN)} is written as A + B; "
            f"the engine mujoco restores that moment ({MOMENTS}... of <custom>) after loading, "
            "but other programs do not"
        )
    for name, its in moments.items():
        if name in beyond:
            continue
        off = float(np.abs(without_stand_ins(np.ones(1), _acceptable(its)[None])[1] - its).max())
        if off > ROUNDING * float(its.max()):
            yield (
                f"MJCF: a principal moment of {name} differs from the description by {off:.2g} kg m^2, because MuJoCo "
                "rejects moments that are too small or violate A + B >= C"
            )


#: Value of a missing limit [rad, m].
FAR = 1e10
#: Number of coefficients of a joint equality.
POWERS = 5
#: Optional parts of a model in addition to its mechanics. Contacts require geoms.
PARTS = ("contacts", "limits", "geoms", "sensors")


def write_mjcf(
    mechanism: Mechanism,
    cut: str,
    *,
    gravity: Sequence[float] | Array = (0.0, 0.0, -9.81),
    include: Set[str] = frozenset(),
) -> str:
    """Write a cut mechanism, including its closures, as MJCF.

    Args:
        cut: ``minimal`` or ``full``.
        gravity: Gravity in world axes [m/s^2]. Shape (3,).
        include: Subset of `PARTS`; the remaining parts are not written, and their stages are disabled.

    Raises:
        UnknownNameError: The cut is not one of `CUTS`, or a part is not one of `PARTS`.
    """
    for part in sorted(include):
        if part not in PARTS:
            raise UnknownNameError("part", part, PARTS)
    if "contacts" in include:
        include = {*include, "geoms"}
    tree = lay_out(mechanism, cut)
    root = ET.Element("mujoco", model=mechanism.name)
    root.append(ET.Comment(f" {cut} cut; written by screwgauge models "))
    for sentence in stand_ins(mechanism):
        comment = sentence.removeprefix("MJCF: ").replace("--", "- -")  # a double hyphen would end a comment
        root.append(ET.Comment(f" {comment} "))
    _settings(root, gravity, include)
    bodies = _bodies(ET.SubElement(root, "worldbody"), tree, "limits" in include)
    if "geoms" in include:
        add_geoms(bodies, tree, solid="contacts" in include)
    _moments(root, [link.body for link in tree.links if _is_refused(link.body)])
    _closures(root, bodies, tree.closures)
    _couplings(root, mechanism.couplings)
    if "contacts" in include:
        add_contact_pairs(root, tree)
    _actuators(root, mechanism)
    if "sensors" in include:
        add_sensors(root, tree)
    if tree.links:
        home = vector_text([freedom.home for link in tree.links for freedom in link.moves])
        ET.SubElement(ET.SubElement(root, "keyframe"), "key", name="home", qpos=home)
    ET.indent(root)
    return ET.tostring(root, encoding="unicode") + "\n"


def site_names(closure: Closure) -> list[tuple[str, str]]:
    """Return the names of the sites on parent and child that the equality constraints of a closure join.

    A ``points`` closure also has ``@parent`` and ``@child`` sites at the frames of the joint.
    """
    near, far = ("weld", "copy") if closure.type == "weld" else ("parent", "child")
    numbers = ("1", "2") if closure.type == "points" else ("",)
    return [(f"{closure.joint}@{near}{i}", f"{closure.joint}@{far}{i}") for i in numbers]


def _settings(root: ET.Element, gravity: Sequence[float] | Array, include: Set[str]) -> None:
    # The compiler must not infer or repair anything: it must use the file's inertias, regardless of geoms or bounds.
    exact = {"angle": "radian", "inertiafromgeom": "false", "balanceinertia": "false"}
    exact |= {"boundmass": "0", "boundinertia": "0", "fusestatic": "false"}
    ET.SubElement(root, "compiler", exact)
    option = ET.SubElement(root, "option", gravity=vector_text(gravity), jacobian="dense")
    stages = {"contact": "contacts", "limit": "limits", "sensor": "sensors"}
    off = {stage: "disable" for stage, part in stages.items() if part not in include}
    if off:
        ET.SubElement(option, "flag", off)


def _bodies(world: ET.Element, tree: Tree, limited: bool) -> dict[str, ET.Element]:
    """Nest the bodies; the ground is a fixed body that carries all other bodies.

    Pinocchio reads only the first body below worldbody, and only bodies with an ``<inertial>``; therefore, the ground
    is written as a massless body.
    """
    bodies = {GROUND: ET.SubElement(world, "body", name=GROUND)}
    ET.SubElement(bodies[GROUND], "inertial", pos="0 0 0", mass="0", diaginertia="0 0 0")
    for link in tree.links:
        element = ET.SubElement(bodies[link.near], "body", name=link.name)
        _place(element, compose(link.near_frame, inverse(link.far_frame)))
        ET.SubElement(element, "inertial", inertial(link.body))
        for freedom in link.moves:
            _joint(element, freedom, link, limited)
        bodies[link.name] = element
    return bodies


def _moments(root: ET.Element, bodies: Sequence[Body]) -> None:
    """Write the principal moments of bodies whose tensors MuJoCo rejects."""
    custom = ET.SubElement(root, "custom") if bodies else root
    for body in bodies:
        ET.SubElement(custom, "numeric", name=f"{MOMENTS}{body.name}", data=vector_text(principal(body.inertia)[0]))


def _place(element: ET.Element, frame: Frame) -> None:
    """Set pos unless it is zero, and quat unless it is the identity."""
    if frame.p.any():
        element.set("pos", vector_text(frame.p))
    if not np.array_equal(frame.R, np.eye(3)):
        element.set("quat", vector_text(quaternion(frame.R)))


def _joint(element: ET.Element, freedom: Freedom, link: Link, limited: bool) -> None:
    """Add a joint to a body; MuJoCo applies the joints of a body in turn, each carried by the preceding joints.

    near X(q) far^-1 = (near far^-1) (far X(q) far^-1): axis and anchor of the joint are expressed in the body frame.
    """
    frame = link.far_frame
    joint = ET.SubElement(element, "joint", name=freedom.coordinate, type="hinge" if freedom.turns else "slide")
    if frame.p.any():
        joint.set("pos", vector_text(frame.p))
    joint.set("axis", vector_text(frame.R @ freedom.axis))
    for name, amount in (("armature", freedom.rotor), ("damping", freedom.damping), ("frictionloss", freedom.friction)):
        if amount:
            joint.set(name, number_text(amount))
    if limited and np.isfinite(freedom.limits).any():
        joint.set("limited", "true")
        joint.set("range", vector_text(np.clip(freedom.limits, -FAR, FAR)))


def _closures(root: ET.Element, bodies: dict[str, ET.Element], closures: Sequence[Closure]) -> None:
    if not closures:
        return
    equality = ET.SubElement(root, "equality")
    for closure in closures:
        pairs, weld = site_names(closure), closure.type == "weld"
        sides = bodies[closure.parent], bodies[closure.child]
        names = pairs[0] if weld else (f"{closure.joint}@parent", f"{closure.joint}@child")
        for body, name, frame in zip(sides, names, (closure.parent_frame, closure.child_frame), strict=True):
            _site(body, name, frame)
        for pair, (number, *frames) in zip(pairs, closure.pairs, strict=True):
            for body, site, frame in zip(sides, pair, frames, strict=True) if number else ():
                _site(body, site, frame)
            name = f"{closure.joint}.{number}".removesuffix(".")
            row = ET.SubElement(equality, "weld" if weld else "connect", name=name, site1=pair[0], site2=pair[1])
            if weld:
                row.set("torquescale", "1")


def left_out(mechanism: Mechanism) -> tuple[str, ...]:
    """List messages about properties of the mechanism that MJCF cannot express."""
    lacks = ((one.name, why_not(one)) for one in mechanism.couplings)
    couplings = (f"MJCF lacks coupling '{name}': {lack}" for name, lack in lacks if lack)
    cut = {one.joint for one in lay_out(mechanism, "minimal").closures if one.type != "weld"}
    open_ = {c for joint in mechanism.joints if joint.name in cut for c in joint.coordinates}
    resist = (one for one in mechanism.resistances if one.coordinate in open_)
    friction = (f"the MJCF of the minimal cut lacks {one.what} at '{one.coordinate}', which is cut" for one in resist)
    return *couplings, *friction, *stand_ins(mechanism)


def why_not(coupling: Coupling) -> str:
    """Return the reason why MJCF cannot express a coupling, or an empty string if MJCF can express it."""
    function = coupling.function
    if len(function.terms) > 1:
        return "" if function.linear else "MuJoCo does not support powers in an equality of several joints"
    return f"MuJoCo does not support powers above {POWERS - 1}" if len(function.polynomial) > POWERS else ""


def _couplings(root: ET.Element, couplings: Sequence[Coupling]) -> None:
    """Add couplings as equalities of joints, or of fixed tendons if several leading joints are involved.

    Coordinates and tendon lengths are zero at MuJoCo's qpos0, as in the description.
    """
    for one in couplings:
        if why_not(one) or one.fixing:
            continue
        several, function = len(one.function.terms) > 1, one.function
        if several:
            tendon = ET.SubElement(_section(root, "tendon"), "fixed", name=one.name)
            for name, slope in {one.coordinate: -1.0, **function.slopes}.items():
                ET.SubElement(tendon, "joint", joint=name, coef=number_text(-slope))
            row = ET.SubElement(_section(root, "equality"), "tendon", name=one.name, tendon1=one.name)
        else:
            row = ET.SubElement(_section(root, "equality"), "joint", name=one.name, joint1=one.coordinate)
        if function.terms and not several:
            row.set("joint2", function.lead)
        powers = [function.constant] if several else function.polynomial
        row.set("polycoef", vector_text([*powers, *[0.0] * (POWERS - len(powers))]))


def _section(root: ET.Element, tag: str) -> ET.Element:
    section = root.find(tag)
    return ET.SubElement(root, tag) if section is None else section


def _site(body: ET.Element, name: str, frame: Frame) -> None:
    _place(ET.SubElement(body, "site", name=name), frame)


def _actuators(root: ET.Element, mechanism: Mechanism) -> None:
    if not mechanism.actuators:
        return
    actuator = ET.SubElement(root, "actuator")
    for name, joint in zip(mechanism.actuator_names, mechanism.actuators, strict=False):
        ET.SubElement(actuator, "motor", name=name, joint=joint.coordinates[0])
