import xml.etree.ElementTree as ET
from collections.abc import Callable
from math import radians

import numpy as np
from campaigns.corpus import mjcf_frames
from campaigns.corpus.parts import NoPlaceError, Parts, child, pick
from campaigns.corpus.planted import Planted
from campaigns.corpus.poses import EYE, Array, Random, inverse, numbers, pose, text, turn
from campaigns.corpus.urdf_scrambler import MOVING, origin, put_axis, put_origin

Edit = Callable[[Parts, Random], Planted]


def _share(rng: Random, least: float = 0.02, most: float = 0.5) -> float:
    """A relative size with its sign."""
    return float(rng.choice([-1.0, 1.0]) * rng.uniform(least, most))


def _along(rng: Random, least: float = 1e-3, most: float = 3e-2) -> Array:
    """A step along an axis. Shape (3,)."""
    return np.asarray(EYE[rng.integers(3)] * rng.choice([-1.0, 1.0]) * rng.uniform(least, most))


# --- matter


def _of_body(parts: Parts, rng: Random) -> tuple[ET.Element, ET.Element, list[str], bool]:
    """A body, its inertial, other names for it, and whether it moves as one with others that have mass."""
    body = pick(parts.bodies(), rng)
    inertial = body.find("inertial")
    if inertial is None:
        raise NoPlaceError
    also = [f"body {parts.carrier(body)}"]
    return body, inertial, also, len(parts.lump(body)) > 1


def _scaled_mass(factor: Callable[[Random], float], kind: str) -> Edit:
    def edit(parts: Parts, rng: Random) -> Planted:
        body, inertial, also, lump = _of_body(parts, rng)
        place, name = (child(inertial, "mass"), "value") if parts.urdf else (inertial, "mass")
        old = float(place.get(name, "0"))
        new = old * factor(rng)
        place.set(name, text(new))
        may = ("com", "inertia") if lump else ()
        return Planted(kind, f"body {body.get('name')}", "mass", old, new, also=also, may=may)

    return edit


def com(parts: Parts, rng: Random) -> Planted:
    body, inertial, also, lump = _of_body(parts, rng)
    place, name = (child(inertial, "origin"), "xyz") if parts.urdf else (inertial, "pos")
    step = _along(rng)
    old = numbers(place.get(name, "0 0 0"))
    place.set(name, text(old + step))
    share = _share_of_mass(parts, body)
    may = ("inertia",) if lump else ()
    label = str(body.get("name"))
    return Planted("com", f"body {label}", "com", delta=step, at=label, also=also, may=may, share=share)


def _share_of_mass(parts: Parts, body: ET.Element) -> float:
    lump = parts.lump(body)
    return parts.mass(body) / sum(parts.mass(other) for other in parts.bodies() if other.get("name") in lump)


def inertia(parts: Parts, rng: Random) -> Planted:
    """The whole tensor times a factor, of what moves alone: of a lump its own part would not be told."""
    body, inertial, also, lump = _of_body(parts, rng)
    if lump:
        raise NoPlaceError
    factor = 1.0 + _share(rng)
    if parts.urdf:
        place = inertial.find("inertia")
        if place is None:
            raise NoPlaceError
        names = ["ixx", "iyy", "izz", "ixy", "ixz", "iyz"]
        values = np.array([float(place.get(name, "0")) for name in names])
        for name, value in zip(names, values, strict=True):
            place.set(name, text(factor * value))
    else:
        name = next((n for n in ("diaginertia", "fullinertia") if inertial.get(n)), "")
        if not name:
            raise NoPlaceError
        values = numbers(inertial.get(name, ""))
        inertial.set(name, text(factor * values))
    old = float(np.abs(values[:3]).max())
    if old < 1e-9:
        raise NoPlaceError
    return Planted("inertia", f"body {body.get('name')}", "inertia", old, factor * old, also=also)


def gravcomp(parts: Parts, rng: Random) -> Planted:
    if parts.urdf:
        raise NoPlaceError
    body, _, also, _ = _of_body(parts, rng)
    old, new = float(body.get("gravcomp", "0")), float(rng.uniform(0.2, 1.0))
    body.set("gravcomp", text(new))
    share = _share_of_mass(parts, body)
    return Planted("gravcomp", f"body {body.get('name')}", "gravcomp", old, new, also=also, share=share)


# --- where joints are


def _seen(parts: Parts, some: list[ET.Element]) -> list[ET.Element]:
    """Joints that do not carry the whole machine: where that stands is no part of it."""
    count = len(parts.joints())
    return [joint for joint in some if len(parts.behind(joint)) < count]


def _placed(parts: Parts, joint: ET.Element) -> tuple[Array, Callable[[Array], None]]:
    if parts.urdf:
        return origin(joint), lambda T: put_origin(joint, T)
    body = parts.parents[joint]
    return mjcf_frames.pose_of(body, parts.root), lambda T: mjcf_frames.put_pose(body, T)


def shift(parts: Parts, rng: Random) -> Planted:
    joint = pick(_seen(parts, parts.single()), rng)
    T, put = _placed(parts, joint)
    step = _along(rng, most=5e-2)
    put(pose(T[:3, :3], T[:3, 3] + step))
    return _moved(parts, joint, "shift", T[:3, :3].T @ step, False)


def rpy(parts: Parts, rng: Random) -> Planted:
    joint = pick(_seen(parts, parts.single()), rng)
    T, put = _placed(parts, joint)
    step = radians(1.0) * _along(rng, 1.0, 15.0)
    put(T @ pose(turn(step, float(np.linalg.norm(step)))))
    return _moved(parts, joint, "rpy", step, True)


def _moved(parts: Parts, joint: ET.Element, kind: str, step: Array, turns: bool) -> Planted:
    owner = parts.owner(joint)
    _check_own(parts, joint, step, turns)
    also = [] if parts.urdf else [f"body {owner}"]  # an MJCF has the placement at the body
    name = f"joint {joint.get('name')}"
    axis, slides, may = parts.axis(joint), parts.slides(joint), ["zero", "axis"]
    about = axis if turns != slides else None
    along = (slides and not turns) or bool(np.linalg.norm(np.cross(axis, step)) < 1e-9 * np.linalg.norm(step))
    if along and len(parts.behind(joint)) < 2:  # nothing tells it from a step of the matter that it carries
        also, may = [f"body {owner}"], [*may, "com", *(["inertia"] if turns else [])]
    return Planted(kind, name, "placement", delta=step, at=owner, also=also, may=may, axis=about, turns=turns)


def _check_own(parts: Parts, joint: ET.Element, step: Array, turns: bool) -> None:
    """True if a step is no motion of the joint before it, which would be a zero on a round body.

    Raises:
        NoPlaceError: It is.
    """
    before = parts.previous(joint)
    if before is None or turns == parts.slides(before):
        return
    (p, axis), T = parts.line(before), parts.placed(parts.owner(joint))
    along = T[:3, :3] @ step / np.linalg.norm(step)
    off = np.linalg.norm(np.cross(axis, T[:3, 3] - p)) if turns else 0.0
    if np.linalg.norm(np.cross(axis, along)) < 1e-3 and off < 1e-3:
        raise NoPlaceError


def tilt(parts: Parts, rng: Random) -> Planted:
    joint = pick([j for j in parts.joints() if parts.urdf or j.get("axis")], rng)
    axis = parts.axis(joint)
    across = np.cross(axis, EYE[int(np.argmin(np.abs(axis)))])
    step = radians(rng.uniform(1.0, 12.0)) * rng.choice([-1.0, 1.0]) * across / np.linalg.norm(across)
    new = turn(step, float(np.linalg.norm(step))) @ axis
    if parts.urdf:
        put_axis(joint, new)
    else:
        joint.set("axis", text(new))
    return Planted(
        "tilt",
        f"joint {joint.get('name')}",
        "axis",
        delta=step,
        at=parts.owner(joint),
        may=("placement",),
        turns=True,
    )


def sign(parts: Parts, rng: Random) -> Planted:
    some = [j for j in parts.joints() if parts.urdf or j.get("axis")]
    joint = pick([j for j in some if j.get("name") not in parts.referred()], rng)
    if parts.urdf:
        put_axis(joint, -parts.axis(joint))
    else:
        joint.set("axis", text(-numbers(joint.get("axis", ""))))
    return Planted("sign", f"joint {joint.get('name')}", "sign", may=("limits", "axis"))


def fixed(parts: Parts, rng: Random) -> Planted:
    joint = pick([j for j in parts.joints() if j.get("name") not in parts.referred()], rng)
    if not parts.urdf:
        motors = {m.get("joint") for m in parts.root.iterfind("actuator/*")}
        if joint.get("name") in motors or len(parts.joints()) < 2:
            raise NoPlaceError
        parts.parents[joint].remove(joint)
        for keyframes in parts.root.findall("keyframe"):  # which count coordinates
            parts.root.remove(keyframes)
    else:
        joint.set("type", "fixed")
    return Planted("fixed", f"joint {joint.get('name')}", "kind", also=[f"body {parts.owner(joint)}"])


# --- numbers of joints


def _passive(what: str, urdf: str, mjcf: str, least: float, most: float) -> Edit:
    def edit(parts: Parts, rng: Random) -> Planted:
        if parts.urdf and not urdf:
            raise NoPlaceError
        joint = pick([j for j in parts.joints() if parts.urdf or j.get(mjcf) or what not in _inherited(parts)], rng)
        place, name = (child(joint, "dynamics"), urdf) if parts.urdf else (joint, mjcf)
        old = float(place.get(name, "0"))
        new = old * (1.0 + _share(rng, 0.05)) if old and rng.random() < 0.5 else old + float(rng.uniform(least, most))
        place.set(name, text(new))
        return Planted(what, f"joint {joint.get('name')}", what, old, new)

    return edit


def _inherited(parts: Parts) -> set[str]:
    attributes = {name for joint in parts.root.iterfind("default//joint") for name in joint.attrib}
    return {{"frictionloss": "friction"}.get(name, name) for name in attributes}


def limits(parts: Parts, rng: Random) -> Planted:
    step = 0.0
    if parts.urdf:
        some = [j for j in parts.joints() if j.get("type") != "continuous" and j.find("limit") is not None]
        joint = pick(some, rng)
        place, scale = child(joint, "limit"), 1.0
        low, high = (float(place.get(name, "0")) for name in ("lower", "upper"))
    else:
        joint = pick([j for j in parts.joints() if j.get("range") and j.get("limited", "true") == "true"], rng)
        place, scale = joint, 1.0
        if mjcf_frames.in_degrees(parts.root) and not parts.slides(joint):
            scale = radians(1.0)
        low, high = scale * numbers(place.get("range", ""))
    if high <= low or high > 3.1:
        raise NoPlaceError
    step = 0.1 * (high - low) * float(rng.uniform(0.3, 1.0) * rng.choice([-1.0, 1.0]))
    if parts.urdf:
        place.set("upper", text(high + step))
    else:
        place.set("range", text([low / scale, (high + step) / scale]))
    return Planted("limits", f"joint {joint.get('name')}", "limits", high, high + step)


def gear(parts: Parts, rng: Random) -> Planted:
    motor = pick([m for m in parts.root.iterfind("actuator/*") if m.get("joint") and m.get("name")], rng)
    values = numbers(motor.get("gear", "1"))
    old, new = float(values[0]), float(values[0] * (1.0 + _share(rng, 0.05, 0.9)))
    motor.set("gear", text([new, *values[1:]]))
    return Planted("gear", f"actuator {motor.get('name')}", "gear", old, new, also=[f"joint {motor.get('joint')}"])


# --- loops and couplings


def point(parts: Parts, rng: Random) -> Planted:
    """Shift the closure of a loop along an axis of its first body; two points of a hinge together, across its axis."""
    some = [p for p in parts.root.iterfind("equality/connect") if p.get("anchor") and p.get("name")]
    part = pick(some, rng)
    ends = part.get("body1", ""), part.get("body2", "")
    both = [p for p in some if (p.get("body1"), p.get("body2")) == ends]
    places = [numbers(p.get("anchor", "")) for p in both]
    axes = [e for e in EYE if all(abs(e @ (place - places[0])) < 1e-9 for place in places)]
    step = pick(axes, rng) * rng.choice([-1.0, 1.0]) * rng.uniform(1e-3, 5e-3)
    for each, place in zip(both, places, strict=True):
        each.set("anchor", text(place + step))
    also = [*(f"equality {p.get('name')}" for p in both), *(f"body {name}" for name in ends)]
    return Planted(
        "point", f"equality {part.get('name')}", "closure", delta=step, at=ends[0], also=also, may=("axis", "placement")
    )


def coupling(parts: Parts, rng: Random) -> Planted:
    if parts.urdf:
        moving = [j for j in parts.root.iterfind("joint") if j.get("type") in MOVING]
        joint = pick([j for j in moving if j.find("mimic") is not None], rng)
        place = child(joint, "mimic")
        old = float(place.get("multiplier", "1"))
        new = old * (1.0 + _share(rng, 0.05))
        place.set("multiplier", text(new))
        return Planted("mimic", f"joint {joint.get('name')}", "coupling", old, new)
    part = pick([p for p in parts.root.iterfind("equality/joint") if p.get("joint2")], rng)
    values = numbers(part.get("polycoef", "0 1 0 0 0"))
    old = float(values[1])
    new = old * (1.0 + _share(rng, 0.05))
    part.set("polycoef", text([values[0], new, *values[2:]]))
    also = [f"joint {part.get('joint1')}", f"joint {part.get('joint2')}"]
    return Planted("polycoef", f"equality {part.get('name', part.get('joint1'))}", "coupling", old, new, also=also)


# --- slips


def degrees(parts: Parts, rng: Random) -> Planted:
    if not parts.urdf:
        raise NoPlaceError
    some = [j for j in _seen(parts, parts.joints()) if np.linalg.norm(origin(j)[:3, :3] - EYE) > 1e-2]
    joint = pick(some, rng)
    T = origin(joint)
    place = child(joint, "origin")
    place.set("rpy", text(np.degrees(numbers(place.get("rpy", "0 0 0")))))
    D = (inverse(T) @ origin(joint))[:3, :3]
    angle = float(np.arccos(np.clip((np.trace(D) - 1.0) / 2.0, -1.0, 1.0)))
    v = np.array([D[2, 1] - D[1, 2], D[0, 2] - D[2, 0], D[1, 0] - D[0, 1]])
    if angle < 0.05 or angle > 3.0:
        raise NoPlaceError
    step = angle * v / np.linalg.norm(v)
    return _moved(parts, joint, "degrees", step, True)


def gravity(parts: Parts, rng: Random) -> Planted:
    if parts.urdf:
        raise NoPlaceError
    option = child(parts.root, "option")
    old = numbers(option.get("gravity", "0 0 -9.81"))
    step = np.array([0.0, 0.0, rng.uniform(0.1, 1.0)])
    for other in parts.root.iterfind("option"):
        other.attrib.pop("gravity", None)
    option.set("gravity", text(old + step))
    return Planted("gravity", "", "gravity", delta=step)


EDITS: dict[str, Edit] = {
    "mass": _scaled_mass(lambda rng: 1.0 + _share(rng, 0.02, 0.8), "mass"),
    "grams": _scaled_mass(lambda rng: 1000.0, "grams"),
    "com": com,
    "inertia": inertia,
    "shift": shift,
    "rpy": rpy,
    "tilt": tilt,
    "sign": sign,
    "limits": limits,
    "damping": _passive("damping", "damping", "damping", 0.1, 3.0),
    "friction": _passive("friction", "friction", "frictionloss", 0.1, 3.0),
    "armature": _passive("armature", "", "armature", 0.01, 0.3),
    "stiffness": _passive("stiffness", "", "stiffness", 0.5, 5.0),
    "gear": gear,
    "point": point,
    "coupling": coupling,
    "degrees": degrees,
    "gravcomp": gravcomp,
    "fixed": fixed,
    "gravity": gravity,
}
