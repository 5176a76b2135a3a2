"""Constraints and freedoms of a platform, in words."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from screwgauge.reference.equations.kinematics import Pose
from screwgauge.reference.graph import Layout
from screwgauge.reference.reciprocal import Element, Held, idle_forces
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
    text += [_legs(first, places), f"Remaining freedoms of {first.body}: {listed(first.twists, TWISTS, places)}."]
    if n := first.overconstraints:
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


def _legs(first: Held, places: Mapping[str, Array]) -> str:
    """Forces and couples that each leg constrains; legs that constrain the same in one clause."""
    does: dict[str, list[str]] = {}
    for leg, system in zip(first.legs, first.wrenches, strict=True):
        does.setdefault(listed(system, WRENCHES, places), []).append(leg.name + f" ({leg.kinds})" * bool(leg.kinds))
    clauses = [f"{formatting.listed(names)}: {what}" for what, names in does.items()]
    lead = f"Forces on {first.body} that each leg constrains"
    return f"{lead}: {'; '.join(clauses)}." if clauses else f"Nothing constrains {first.body}."


def listed(system: Sequence[Element], nouns: tuple[str, ...], places: Mapping[str, Array]) -> str:
    """A system of screws in words, such as ``two rotations through s, about x and y``."""
    force, couple, wrench, along, about, all_six = nouns
    lines, ways, screws = ([one for one in system if kind(one) == k] for k in range(3))
    said, many = [], _many(len(lines), force)
    if len(lines) > 1 and all(np.allclose(one.point, lines[0].point, rtol=0.0, atol=1e-9) for one in lines):
        directions = f", {along} {formatting.listed([_way(one) for one in lines])}" if len(lines) == 2 else ""
        said.append(f"{many} through {_place(lines[0], places)}{directions}")
    elif lines:
        each = [f"{_way(one)} through {_place(one, places)}" for one in lines]
        said.append(f"{many} {along} {formatting.listed(each)}")
    for one in screws:
        pitch = f"{1e3 * one.pitch:.3g} mm/rad"
        said.append(f"a {wrench} about {_way(one)} through {_place(one, places)} of {pitch}")
    if ways:
        directions = "every axis" if len(ways) == 3 else formatting.listed([_way(one) for one in ways])
        said.append(f"{_many(len(ways), couple)} {about} {directions}")
    return all_six if len(system) == 6 else formatting.listed(said) if said else "none"


def _many(n: int, what: str, plural: str = "s", *, whole: bool = False) -> str:
    return f"{NUMBERS[n] if n < len(NUMBERS) else n} {what if n == 1 else plural if whole else what + plural}"


def _way(one: Element) -> str:
    k = int(np.argmax(np.abs(one.direction)))
    return "xyz"[k] if abs(one.direction[k]) > 1.0 - 1e-9 else _vector(one.direction)


def _vector(v: Array) -> str:
    return f"({', '.join(f'{x:.3g}' if abs(x) > 5e-7 else '0' for x in v)})"


def _place(one: Element, places: Mapping[str, Array]) -> str:
    """The name of a joint at the point, else the point."""
    near = [name for name, there in places.items() if np.abs(one.point - there).max() < 1e-6]
    return near[0] if near else f"{_vector(one.point)} m"
