"""Constraints and freedoms of a platform, in words."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from screwgauge.reference.equations.kinematics import Pose
from screwgauge.reference.graph import Layout
from screwgauge.reference.reciprocal import Element, Held, idle_forces, normal_of_plane
from screwgauge.reference.rotations import Array
from screwgauge.report import formatting

NUMBERS = ("no", "one", "two", "three", "four", "five", "six")
#: What elements are called by their `kind`, how a line and a direction are told, and all six of them.
WRENCHES = ("force", "couple", "wrench", "along", "about", "every force and couple")
TWISTS = ("rotation", "translation", "screw", "about", "along", "all six freedoms")


def kind(one: Element) -> int:
    """0 without pitch, 1 with an infinite one, 2 with another."""
    return 0 if one.pitch == 0.0 else 1 if np.isinf(one.pitch) else 2


def sentences(lay: Layout, at: Pose, found: Sequence[Held], t: Array) -> list[str]:
    """Constraints of the legs, remaining freedoms, redundancy of actuators, and whether they change during the motion.

    Args:
        found: At each of the samples of `at`; the first is described.
        t: Their times [s].
    """
    first, mechanism = found[0], lay.mechanism
    joints = [joint for joint in mechanism.joints if joint.constrains and joint.angles]
    places = {joint.name: at.joint(joint).p_child[0] for joint in joints}
    sides = [side for joint in mechanism.joints for side in (joint.parent, joint.child)]
    tips = sum(sides.count(body.name) == 1 for body in mechanism.bodies)
    text = [f"An open tree with {tips} ends; {first.body} is the farthest."] if tips > 1 and not lay.cuts else []
    normal = normal_of_plane(at.S[0])
    text += filter(None, [_constraints(first, places, normal)])
    text.append(f"Remaining freedoms of {first.body}: {listed(first.twists, TWISTS, places)}.")
    if (n := first.overconstraints) and normal is not None and n == 3 * (len(first.legs) - 1):
        each = "leg" if _has_legs(first) else "chain"
        text.append(
            f"Each {each} by itself keeps {first.body} in the plane, so that {_many(n, 'constraint')} are redundant."
        )
    elif n:
        text.append(f"{_many(n, 'of these', '').capitalize()} constraints {'is' if n == 1 else 'are'} redundant.")
    if n := idle_forces(lay, at.rows([0])).shape[1]:
        freedoms = _many(len(mechanism.independent), "degree of freedom", "degrees of freedom", whole=True)
        idle = "does no work and only preloads" if n == 1 else "do no work and only preload"
        text.append(
            f"{len(mechanism.actuators)} actuators for {freedoms}: {_many(n, 'combination')} of their forces"
            f" {idle} the mechanism, so that a rule has to choose {'it' if n == 1 else 'them'}."
        )
    kinds = [[[*map(kind, system)] for system in (*one.wrenches, one.twists)] for one in found]
    if changes := [f"{t[k]:.3g} s" for k in range(1, len(kinds)) if kinds[k] != kinds[k - 1]]:
        times = ", ".join(changes[:3]) + ", ..." * (len(changes) > 3)
        text.append(f"This is the first pose; the kind or number of constraints changes near t = {times}.")
    elif len(kinds) > 1:
        samples = f"all {len(kinds)} samples tried"
        text.append(f"Points and directions are those of the first pose; kinds are the same at {samples}.")
    return text


def _constraints(first: Held, places: Mapping[str, Array], normal: Array | None) -> str:
    """Forces and couples by which each leg, or chain of joints, constrains a body; those alike in one clause.

    Of a planar mechanism (`normal` of its plane) only forces and couples that act in the plane are listed.
    """
    if not first.legs:
        return f"Nothing constrains {first.body}."
    alike: dict[str, list[str]] = {}
    for leg, system in zip(first.legs, first.wrenches, strict=True):
        acting = [one for one in system if normal is None or _acts_in_plane(one, normal)]
        alike.setdefault(listed(acting, WRENCHES, places), []).append(leg.name + f" ({leg.kinds})" * bool(leg.kinds))
    if [*alike] == ["none"] and len(first.legs) == 1:  # a hand at the end of an arm of six joints or more
        return ""
    clauses = [f"{formatting.listed(names)}: {what}" for what, names in alike.items()]
    plane = "" if normal is None else f" in the plane normal to {_way(normal)}"
    lead = f"Forces on {first.body} that each leg constrains{plane}"
    if not _has_legs(first):
        lead = f"Constraint forces on {first.body}{plane}" + ", by chain of joints" * (len(first.legs) > 1)
    return f"{lead}: {'; '.join(clauses)}."


def _has_legs(first: Held) -> bool:
    """Whether it is a platform: what holds it are legs by name, not just the ways to ground of some link."""
    names = {joint.name for leg in first.legs for joint in leg.joints}
    return len(first.legs) > 1 and any(leg.name not in names and " to " not in leg.name for leg in first.legs)


def _acts_in_plane(one: Element, normal: Array) -> bool:
    """A force in the plane, or a couple about its normal."""
    along = abs(float(one.direction @ normal))
    return along > 0.5 if kind(one) == 1 else along < 0.5


def listed(system: Sequence[Element], nouns: tuple[str, ...], places: Mapping[str, Array]) -> str:
    """A system of screws in words, such as ``two rotations through s, about x and y``."""
    force, couple, wrench, along, about, all_six = nouns
    lines, ways, screws = ([one for one in system if kind(one) == k] for k in range(3))
    said, many = [], _many(len(lines), force)
    if len(lines) > 1 and all(np.allclose(one.point, lines[0].point, rtol=0.0, atol=1e-9) for one in lines):
        directions = f", {along} {formatting.listed([_way(one.direction) for one in lines])}" if len(lines) == 2 else ""
        said.append(f"{many} through {_place(lines[0], places)}{directions}")
    elif lines:
        each = [f"{_way(one.direction)} through {_place(one, places)}" for one in lines]
        said.append(f"{many} {along} {formatting.listed(each)}")
    for one in screws:
        pitch = f"{1e3 * one.pitch:.3g} mm/rad"
        said.append(f"a {wrench} about {_way(one.direction)} through {_place(one, places)} of {pitch}")
    if ways:
        directions = "every axis" if len(ways) == 3 else formatting.listed([_way(one.direction) for one in ways])
        said.append(f"{_many(len(ways), couple)} {about} {directions}")
    return all_six if len(system) == 6 else formatting.listed(said) if said else "none"


def _many(n: int, what: str, plural: str = "s", *, whole: bool = False) -> str:
    return f"{NUMBERS[n] if n < len(NUMBERS) else n} {what if n == 1 else plural if whole else what + plural}"


def _way(direction: Array) -> str:
    k = int(np.argmax(np.abs(direction)))
    return "xyz"[k] if abs(direction[k]) > 1.0 - 1e-9 else _vector(direction)


def _vector(v: Array) -> str:
    return f"({', '.join(f'{x:.3g}' if abs(x) > 5e-7 else '0' for x in v)})"


def _place(one: Element, places: Mapping[str, Array]) -> str:
    """The name of a joint at the point, else the point."""
    near = [name for name, there in places.items() if np.abs(one.point - there).max() < 1e-6]
    return near[0] if near else f"{_vector(one.point)} m"
