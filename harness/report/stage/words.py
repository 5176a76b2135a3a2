"""How a platform is held, in words."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from screwgauge.reference import linear
from screwgauge.reference.kinematics import velocities
from screwgauge.reference.pose import Layout, Pose
from screwgauge.reference.reciprocal import Element, Held
from screwgauge.reference.rotations import Array

NUMBERS = ("no", "one", "two", "three", "four", "five", "six")
#: What an element is called by its pitch: none, infinite, another one.
FORCES, TWISTS = ("force", "couple", "wrench"), ("rotation", "translation", "screw")


def sentences(motion_lay: Layout, at: Pose, found: Sequence[Held], t: Array) -> list[str]:
    """What the legs do, what they leave, what actuators leave open, and whether that stays so on the way.

    Args:
        found: At each of the samples of `at`; told is the first.
        t: Their times [s].
    """
    first, places = found[0], _places(motion_lay, at)
    said = [_legs(first, places)] if len(first.legs) > 1 else [_one_leg(first, places)]
    free = listed(first.twists, TWISTS, places)
    said.append(f"{'They leave' if len(first.legs) > 1 else 'This leaves'} the body {first.body} {free}.")
    if first.overconstraints:
        said.append(
            f"{_many(first.overconstraints, 'of these constraints')} repeat{'s' * (first.overconstraints == 1)} what the others do."
        )
    said += _actuation(motion_lay, at)
    kinds = [_kinds(one) for one in found]
    changes = [f"t = {t[k]:.3g} s" for k in range(1, len(kinds)) if kinds[k] != kinds[k - 1]]
    if changes:
        said.append(
            f"That is the first pose; on the way their kind changes near {', '.join(changes[:3])}{', ...' * (len(changes) > 3)}."
        )
    elif len(kinds) > 1:
        said.append(
            f"Points and directions are those of the first pose; the kinds are the same at {len(kinds)} poses on the way."
        )
    return said


def _kinds(one: Held) -> tuple[tuple[int, ...], ...]:
    return tuple(tuple(_kind(e) for e in system) for system in (*one.wrenches, one.twists))


def _kind(one: Element) -> int:
    return 0 if one.pitch == 0.0 else 1 if np.isinf(one.pitch) else 2


def _legs(first: Held, places: dict[str, Array]) -> str:
    """What each leg does; legs that do the same are told together."""
    does: dict[str, list[str]] = {}
    for leg, system in zip(first.legs, first.wrenches, strict=True):
        name = f"{leg.name} ({leg.kinds})" if leg.kinds and leg.kinds != leg.name.upper() else leg.name
        does.setdefault(listed(system, FORCES, places), []).append(name)
    parts = [f"{_and(names)} take{'s' * (len(names) == 1)} {what}" for what, names in does.items()]
    return f"The body {first.body} hangs on {_many(len(first.legs), 'legs')}: {'; '.join(parts)}."


def _one_leg(first: Held, places: dict[str, Array]) -> str:
    if not first.legs:
        return f"Nothing holds the body {first.body}: it moves freely."
    leg, system = first.legs[0], first.wrenches[0]
    way = f"the joints {leg.name}" if len(leg.joints) > 1 else f"the joint {leg.name}"
    return f"The body {first.body} hangs on ground by {way} alone, which take{'s' * (len(leg.joints) == 1)} {listed(system, FORCES, places)}."


def listed(system: Sequence[Element], names: tuple[str, str, str], places: dict[str, Array]) -> str:
    """A system of screws in words, such as ``two rotations through s, about x and about y``."""
    groups = {k: [one for one in system if _kind(one) == k] for k in range(3)}
    lines, directions, others = groups[0], groups[1], groups[2]
    if len(system) == 6:
        return "all six freedoms" if names is TWISTS else "every force and couple"
    said = []
    if lines:
        shared = all(np.allclose(one.point, lines[0].point, rtol=0.0, atol=1e-9) for one in lines) and len(lines) > 1
        what = _many(len(lines), f"{names[0]}s")
        word = "along" if names is FORCES else "about"
        if shared and len(lines) == 3:
            said.append(f"{what} through {_place(lines[0].point, places)}")
        elif shared:
            said.append(
                f"{what} through {_place(lines[0].point, places)}, {word} {_and([_way(one.direction) for one in lines])}"
            )
        else:
            said.append(
                f"{what} {word} "
                + _and([f"{_way(one.direction)} through {_place(one.point, places)}" for one in lines])
            )
    said += [
        f"a {names[2]} about {_way(one.direction)} through {_place(one.point, places)} with a pitch of {1e3 * one.pitch:.3g} mm/rad"
        for one in others
    ]
    if directions:
        word = "about" if names is FORCES else "along"
        ways = "every axis" if len(directions) == 3 else _and([_way(one.direction) for one in directions])
        said.append(f"{_many(len(directions), f'{names[1]}s')} {word} {ways}")
    return "; ".join(said) if len(said) > 2 else " and ".join(said) or "nothing"


def _many(n: int, what: str) -> str:
    return f"{NUMBERS[n] if n < len(NUMBERS) else n} {what.replace('legs', 'leg').removesuffix('s') if n == 1 and 'of' not in what else what}"


def _and(parts: Sequence[str]) -> str:
    return parts[0] if len(parts) == 1 else f"{', '.join(parts[:-1])} and {parts[-1]}"


def _way(e: Array) -> str:
    k = int(np.argmax(np.abs(e)))
    return "xyz"[k] if abs(e[k]) > 1.0 - 1e-9 else f"({', '.join(_short(x) for x in e)})"


def _short(x: float) -> str:
    return f"{x + 0.0:.3g}" if abs(x) > 5e-7 else "0"


def _places(lay: Layout, at: Pose) -> dict[str, Array]:
    """Points that have a name."""
    index = lay.mechanism.body_index
    joints = [joint for joint in lay.mechanism.joints if joint.kind not in "PF"]
    return {j.name: at.p[0, index[j.child]] + at.R[0, index[j.child]] @ j.child_frame.p for j in joints}


def _place(point: Array, places: dict[str, Array]) -> str:
    near = [name for name, there in places.items() if np.abs(point - there).max() < 1e-6]
    return near[0] if near else f"({', '.join(_short(x) for x in point)}) m"


def _actuation(lay: Layout, at: Pose) -> list[str]:
    """Forces of actuators that do no work together, where there are more of these than freedoms."""
    mechanism = lay.mechanism
    if not mechanism.actuators:
        return []
    k = len(mechanism.independent)
    rates = np.array([velocities(lay, at.rows([0]), e[None]).w[0] for e in np.eye(k)])
    idle = linear.null_space(rates[:, mechanism.actuated_columns])
    if not idle.shape[1]:
        return []
    n = len(mechanism.actuators)
    return [
        f"{n} actuators for {_many(k, 'freedoms')}: {_many(idle.shape[1], 'combinations')} of their forces"
        f" move{'s' * (idle.shape[1] == 1)} nothing and only stress{'es' * (idle.shape[1] == 1)} the mechanism; a rule has to fix them."
    ]
