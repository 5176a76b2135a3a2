"""Machines of the corpus in closed form, so that each is there in any of its poses."""

from math import acos, atan2, cos, pi, sin, sqrt

import numpy as np
from campaigns.corpus.linkage import GROUND, Body, Joint, Linkage, plate, rod
from campaigns.corpus.poses import EYE, Array, direction, turn, unit

X, Y, Z = EYE


def _xz(x: float, z: float, y: float = 0.0) -> Array:
    return np.array([x, y, z])


def _circles(a: Array, r: float, b: Array, s: float, side: float) -> Array:
    d = b - a
    l = float(np.linalg.norm(d))
    along = (r * r - s * s + l * l) / (2.0 * l)
    high = sqrt(r * r - along * along)
    return np.asarray(a + along * d / l + side * high * np.cross(d / l, Y))


def four_bar(crank: float = 1.2) -> Linkage:
    O, C = _xz(0.0, 0.0), _xz(0.5, 0.0)
    A = _xz(0.15 * cos(crank), 0.15 * sin(crank))
    B = _circles(A, 0.45, C, 0.35, -1.0)
    return Linkage(
        "four-bar",
        (rod("crank", 0.6, (O, A), Y), rod("coupler", 1.1, (A, B), Y, aside=0.01), rod("rocker", 0.9, (C, B), Y)),
        (
            Joint("crank_joint", "R", GROUND, "crank", O, (Y,), actuated=True),
            Joint("coupler_joint", "R", "crank", "coupler", A, (Y,)),
            Joint("rocker_joint", "R", GROUND, "rocker", C, (Y,)),
            Joint("tip_joint", "R", "coupler", "rocker", B, (Y,)),
        ),
        cut=("tip_joint",),
        independent=("crank_joint",),
    )


def five_bar(left: float = 2.0, right: float = 1.1) -> Linkage:
    O, C = _xz(-0.15, 0.0), _xz(0.15, 0.0)
    A, B = O + 0.2 * _xz(cos(left), sin(left)), C + 0.2 * _xz(cos(right), sin(right))
    P = _circles(A, 0.3, B, 0.32, -1.0)
    return Linkage(
        "five-bar",
        (
            *(rod("left_crank", 0.5, (O, A), Y), rod("left_rod", 0.4, (A, P), Y, aside=0.005)),
            *(rod("right_crank", 0.55, (C, B), Y), rod("right_rod", 0.45, (B, P), Y, aside=-0.004)),
        ),
        (
            Joint("left", "R", GROUND, "left_crank", O, (Y,), actuated=True),
            Joint("left_elbow", "R", "left_crank", "left_rod", A, (Y,)),
            Joint("right", "R", GROUND, "right_crank", C, (Y,), actuated=True),
            Joint("right_elbow", "R", "right_crank", "right_rod", B, (Y,)),
            Joint("tip", "R", "left_rod", "right_rod", P, (Y,)),
        ),
        cut=("tip",),
        independent=("left", "right"),
    )


def three_rrr(x: float = 0.02, y: float = 0.03, turned: float = 0.1) -> Linkage:
    bodies, joints = list[Body](), list[Joint]()
    centre, R = np.array([x, y, 0.0]), turn(Z, turned)
    for i in range(3):
        angle = 2.0 * pi * i / 3.0 - pi / 2.0
        base, corner = 0.4 * np.array([cos(angle), sin(angle), 0.0]), centre + 0.1 * R @ [cos(angle), sin(angle), 0.0]
        d = corner - base
        l = float(np.linalg.norm(d))
        bend = acos((0.2**2 + l * l - 0.22**2) / (2.0 * 0.2 * l))
        elbow = base + 0.2 * turn(Z, bend) @ d / l
        bodies.append(rod(f"upper{i}", 0.5 + 0.05 * i, (base, elbow), Z))
        bodies.append(rod(f"lower{i}", 0.4, (elbow, corner), Z, aside=0.004))
        joints += [
            Joint(f"base{i}", "R", GROUND, f"upper{i}", base, (Z,), actuated=True),
            Joint(f"elbow{i}", "R", f"upper{i}", f"lower{i}", elbow, (Z,)),
            Joint(f"corner{i}", "R", f"lower{i}", "platform", corner, (Z,)),
        ]
    bodies.append(plate("platform", 1.3, centre, R, 0.1))
    return Linkage(
        "three-rrr",
        tuple(bodies),
        tuple(joints),
        cut=("corner1", "corner2"),
        independent=tuple(f"base{i}" for i in range(3)),
    )


def delta(x: float = 0.02, y: float = -0.03, z: float = -0.5) -> Linkage:
    """Clavel's robot with one rod an arm, between universal joints, by the place of its platform."""
    bodies, joints = list[Body](), list[Joint]()
    centre = np.array([x, y, z])
    for i in range(3):
        out = np.array([cos(2.0 * pi * i / 3.0), sin(2.0 * pi * i / 3.0), 0.0])
        hip, wrist = 0.2 * out, centre + 0.06 * out
        axis = np.cross(Z, out)
        v = wrist - hip
        across = float(v @ axis)
        reach = 0.5**2 - across**2 - 0.22**2 - float(v @ v) + across**2
        a, b = -2.0 * 0.22 * float(v @ out), -2.0 * 0.22 * float(v @ Z)
        angle = atan2(b, a) - acos(reach / sqrt(a * a + b * b))
        elbow = hip + 0.22 * (cos(angle) * out + sin(angle) * Z)
        along = unit(wrist - elbow)
        second = unit(np.cross(axis, along))
        bodies.append(rod(f"arm{i}", 0.8, (hip, elbow), axis, aside=0.003))
        bodies.append(rod(f"rod{i}", 0.2 + 0.01 * i, (elbow, wrist), second))
        joints += [
            Joint(f"hip{i}", "R", GROUND, f"arm{i}", hip, (axis,), actuated=True),
            Joint(f"elbow{i}", "U", f"arm{i}", f"rod{i}", elbow, (axis, second)),
            Joint(f"wrist{i}", "U", f"rod{i}", "platform", wrist, (second, axis)),
        ]
    bodies.append(plate("platform", 0.7, centre, np.eye(3), 0.06))
    return Linkage("delta", tuple(bodies), tuple(joints), cut=(), independent=tuple(f"hip{i}" for i in range(3)))


def delta_balls(x: float = 0.02, y: float = -0.03, z: float = -0.5) -> Linkage:
    """Clavel's robot with two rods an arm, universal joints at the elbows and balls at the wrists."""
    bodies, joints = list[Body](), list[Joint]()
    one = delta(x, y, z)
    wide, platform = 0.05, one.bodies[-1]
    for i in range(3):
        hip, elbow, wrist = one.joints[3 * i : 3 * i + 3]
        axis = hip.axes[0]
        bodies.append(one.bodies[2 * i])
        joints.append(hip)
        for side, way in (("a", wide), ("b", -wide)):
            ends = elbow.point + way * axis, wrist.point + way * axis
            bodies.append(rod(f"rod{i}{side}", 0.15, ends, elbow.axes[1], aside=0.002))
            joints += [
                Joint(f"elbow{i}{side}", "U", f"arm{i}", f"rod{i}{side}", ends[0], elbow.axes),
                Joint(f"wrist{i}{side}", "S", f"rod{i}{side}", "platform", ends[1]),
            ]
    cut = tuple(f"wrist{i}{side}" for i in range(3) for side in "ab")[1:]
    return Linkage("delta-balls", (*bodies, platform), tuple(joints), cut=cut, independent=one.independent)


def stewart(x: float = 0.02, y: float = -0.01, z: float = 0.5, turned: float = 0.1) -> Linkage:
    place, R = np.array([x, y, z]), turn(unit([1.0, 2.0, 0.5]), turned)
    bodies, joints = list[Body](), list[Joint]()
    for i in range(6):
        k, side = divmod(i, 2)
        below, above = (
            2.0 * pi * k / 3.0 + (side - 0.5) * 0.5,
            2.0 * pi * (k + 0.5) / 3.0 + (side - 0.5) * 0.5 - pi / 3.0,
        )
        foot = 0.4 * np.array([cos(below), sin(below), 0.0])
        top = place + R @ (0.25 * np.array([cos(above), sin(above), 0.0]))
        along = unit(top - foot)
        first = np.array([-sin(below), cos(below), 0.0])
        second = unit(np.cross(first, along))
        middle, length = foot + 0.3 * along, float(np.linalg.norm(top - foot))
        bodies.append(rod(f"lower{i}", 0.6, (foot, middle), second, aside=0.002))
        bodies.append(rod(f"upper{i}", 0.4, (top - 0.3 * along, top), second))
        joints += [
            Joint(f"foot{i}", "U", GROUND, f"lower{i}", foot, (first, second)),
            Joint(
                f"slide{i}",
                "P",
                f"lower{i}",
                f"upper{i}",
                middle,
                (along,),
                limits=(0.35 - length, 0.8 - length),
                actuated=True,
            ),
            Joint(f"top{i}", "S", f"upper{i}", "platform", top),
        ]
    bodies.append(plate("platform", 2.0, place, R, 0.25))
    return Linkage(
        "stewart",
        tuple(bodies),
        tuple(joints),
        cut=tuple(f"top{i}" for i in range(1, 6)),
        independent=tuple(f"slide{i}" for i in range(6)),
    )


def arm(seed: int, count: int = 6, slide: int = 3) -> Linkage:
    rng = np.random.default_rng([seed, 77])
    p, near = np.zeros(3), GROUND
    bodies, joints = list[Body](), list[Joint]()
    for i in range(count):
        end = p + rng.uniform(0.15, 0.35) * direction(rng)
        axis = direction(rng)
        kind = "P" if i == slide else "R"
        bodies.append(rod(f"link{i}", rng.uniform(0.3, 3.0), (p, end), direction(rng), 0.05, 0.01))
        limits = (-0.2, 0.3) if kind == "P" else (-1.5 - 0.1 * i, 1.2 + 0.1 * i)
        joints.append(Joint(f"axis{i}", kind, near, f"link{i}", p, (axis,), 0.1 + 0.05 * i, limits, True))
        p, near = end, f"link{i}"
    return Linkage(f"arm{seed}", tuple(bodies), tuple(joints), independent=tuple(j.name for j in joints))


def tree(seed: int, count: int = 8) -> Linkage:
    """A branched machine at random."""
    rng = np.random.default_rng([seed, 78])
    ends, names = [np.zeros(3)], [GROUND]
    bodies, joints = list[Body](), list[Joint]()
    for i in range(count):
        k = int(rng.integers(max(0, len(ends) - 3), len(ends)))
        end = ends[k] + rng.uniform(0.15, 0.35) * direction(rng)
        bodies.append(rod(f"limb{i}", rng.uniform(0.3, 3.0), (ends[k], end), direction(rng), 0.05, 0.01))
        joints.append(
            Joint(f"knee{i}", "R", names[k], f"limb{i}", ends[k], (direction(rng),), 0.2 + 0.03 * i, (-1.0, 1.4), True)
        )
        ends.append(end)
        names.append(f"limb{i}")
    return Linkage(f"tree{seed}", tuple(bodies), tuple(joints), independent=tuple(j.name for j in joints))
