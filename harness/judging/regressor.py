"""What every body needs of its joints, term by term, and its derivatives by what the description says of the body."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from screwgauge.judging.visible import Needed
from screwgauge.problem import GivenMotion
from screwgauge.reference import screws
from screwgauge.reference.along import joint_wrenches
from screwgauge.reference.applied import Applied, Load
from screwgauge.reference.dynamics import BodyMotion, body_motion, required_wrench
from screwgauge.reference.equations.kinematics import Bracket
from screwgauge.reference.kinematics import Velocities, accelerations, velocities
from screwgauge.reference.layout import Layout
from screwgauge.reference.pose import Pose, length
from screwgauge.reference.rotations import Array, cross
from screwgauge.reference.springs import springs_and_motors

_AXES = "xyz"
_Wrench = tuple[Array | float, Array | float]
_NONE: _Wrench = (0.0, 0.0)
_Column = tuple[str, int, _Wrench, _Wrench]
"""Name, body, and what it needs by the parameter: force and moment, own and applied, see `Needed`."""


def _products(first: Array, second: Array) -> dict[str, Array]:
    """The terms of the Lie bracket of two twists, eq. (36)."""
    w1, v1, w2, v2 = first[..., :3], first[..., 3:], second[..., :3], second[..., 3:]
    return {
        "w1 x w2": screws.revolute(cross(w1, w2), np.zeros(3)),
        "w1 x v2": screws.prismatic(cross(w1, v2)),
        "w2 x v1": screws.prismatic(-cross(w2, v1)),
    }


#: The bracket, and each of its products.
BRACKET = ("bracket", "w1 x w2", "w1 x v2", "w2 x v1")


def _without(term: str) -> Bracket:
    """The Lie bracket, one of its products or all of them left out."""

    def bracket(first: Array, second: Array) -> Array:
        parts = _products(first, second)
        return sum((part for name, part in parts.items() if term not in (name, "bracket")), np.zeros_like(first))

    return bracket


@dataclass(frozen=True, slots=True, eq=False)
class Moved:
    """A mechanism at n samples of a motion.

    Attributes:
        qdd: Joint accelerations. Shape (n, n_q).
        bodies: Motion of the bodies.
    """

    lay: Layout
    t: Array
    rate: Velocities
    qdd: Array
    bodies: BodyMotion


def moved(lay: Layout, at: Pose, motion: GivenMotion) -> dict[str, Moved]:
    """The mechanism in motion, and the same with each part of the Lie bracket left out; the first has no name."""
    rate = velocities(lay, at, motion.yd)

    def one(bracket: Bracket | None) -> Moved:
        qdd, A = accelerations(lay, rate, motion.ydd, bracket)
        return Moved(lay, motion.t, rate, qdd, body_motion(lay, at, rate.V, A))

    return {"": one(None), **{term: one(_without(term)) for term in BRACKET}}


def terms(versions: Mapping[str, Moved], applied: Applied) -> tuple[tuple[str, ...], Needed]:
    """Names of the kinds of terms, and what bodies need by each. The parts of the bracket are parts of `inertial`."""
    now = versions[""]
    lay, rate, bodies, none = now.lay, now.rate, now.bodies, np.zeros(3)
    still = replace(bodies, **{name: np.zeros_like(bodies.a) for name in ("omega", "beta", "a")})

    def needed(motion: BodyMotion, gravity: Array = none, loads: Sequence[Load] = ()) -> Array:
        return np.concatenate(required_wrench(lay, rate.pose, motion, gravity, loads), axis=2)

    own, outside = {"gravity": needed(still, applied.g)}, dict[str, Array]()
    if applied.loads:
        outside["loads"] = needed(still, loads=applied.loads)
    if applied.springs or applied.motors:
        pulls, loads = springs_and_motors(lay, rate, applied, now.t)
        along = joint_wrenches(lay, rate.pose, bodies.com, pulls).reshape(own["gravity"].shape)
        outside["springs and motors"] = needed(still, loads=loads) - along
    whole, turning = needed(bodies), needed(replace(still, omega=bodies.omega))
    own |= {"inertial": whole - turning, "gyroscopic": turning}
    own |= {term: whole - needed(versions[term].bodies) for term in BRACKET}
    names = tuple(dict.fromkeys([*own, *outside]))
    zero = np.zeros_like(whole)
    return names, Needed(*(np.stack([part.get(name, zero) for name in names], axis=3) for part in (own, outside)))


def parameters(now: Moved, applied: Applied) -> tuple[tuple[str, ...], Needed]:
    """Names of the inertial parameters and load points, and the derivatives of what bodies need by each.

    By mass, centre of mass and inertia about it, all else that the description says being kept, each as large as the
    body's own: its mass (that of the mechanism where it has none), the length of the mechanism, its largest moment of
    inertia. A body without mass has neither centre nor inertia.
    """
    found = [*_of_bodies(now, applied), *_of_loads(now, applied)]
    parts = np.zeros((2, *now.bodies.a.shape[:2], 6, len(found)))
    for column, (_, body, *wrenches) in enumerate(found):
        for part, (force, moment) in zip(parts, wrenches, strict=True):
            part[:, body, :3, column], part[:, body, 3:, column] = force, moment
    return tuple(name for name, *_ in found), Needed(*parts)


def _of_bodies(now: Moved, applied: Applied) -> Iterator[_Column]:
    bodies, L, mechanism = now.bodies, length(now.lay), now.lay.mechanism
    for i, body in enumerate(mechanism.bodies):
        R, w, b = now.rate.pose.R[:, i + 1], bodies.omega[:, i], bodies.beta[:, i]
        weight = (body.mass or mechanism.mass) * (bodies.a[:, i] - applied.g)
        yield f"mass of {body.name}", i, (weight, 0.0), _NONE
        if not body.mass:
            continue
        # what acts at the centre of mass goes with it
        carried = sum((load.force for load in applied.loads if load.body == body.name and load.point is None), 0.0 * w)
        for axis, r in zip(_AXES, np.moveaxis(L * R, 2, 0), strict=True):
            force = body.mass * (cross(b, r) + cross(w, cross(w, r)))
            yield f"com {axis} of {body.name}", i, (force, cross(r, weight)), (0.0, -cross(r, carried))
        size = float(np.abs(body.inertia).max()) or body.mass * L**2
        for pair in ("xx", "yy", "zz", "xy", "xz", "yz"):
            j, k = (_AXES.index(axis) for axis in pair)
            unit = np.zeros((3, 3))
            unit[j, k] = unit[k, j] = size
            J = R @ unit @ R.swapaxes(1, 2)
            Jb, Jw = ((J @ v[..., None])[..., 0] for v in (b, w))
            yield f"inertia {pair} of {body.name}", i, (0.0, Jb + cross(w, Jw)), _NONE


def _of_loads(now: Moved, applied: Applied) -> Iterator[_Column]:
    for number, load in enumerate(applied.loads, 1):
        i, which = now.lay.mechanism.body_index[load.body], f" {number}" if len(applied.loads) > 1 else ""
        if np.any(load.force):
            for axis, r in zip(_AXES, np.moveaxis(length(now.lay) * now.rate.pose.R[:, i], 2, 0), strict=True):
                moment = -cross(r, np.broadcast_to(load.force, r.shape))
                yield f"point {axis} of load{which} on {load.body}", i - 1, _NONE, (0.0, moment)
