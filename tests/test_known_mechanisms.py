from dataclasses import replace
from functools import cache

import numpy as np
import pytest

import screwgauge
from support.engines import IN_DOUBLES
from support.judging import agreed
from support.mechanism import load_mechanism
from support.scene import GivenMotion
from support.solve import layout, pose
from support.tolerances import LINEAR

CLOSED = 1e-13  # of angles and lengths of order one
FALLING = 1e-9  # what rounding makes of a momentum that is the difference of two a million times as large
NAMES = [
    *("slider-crank", "five-bar", "bennett", "sarrus", "rccc", "3-rrr", "3-rps", "3-upu"),
    *("stewart", "stewart-legs", "delta", "double-cardan", "arm7", "planetary-gear", "screw-press", "ruse"),
    "belt-leg",
    "geared-five-bar",
]


@cache
def solved(name: str):
    scene = screwgauge.load_scene(name)
    return screwgauge.run(scene.at(scene.t[:: len(scene.t) // 6]), engines=IN_DOUBLES)


def moved(name: str):
    results, mechanism = solved(name), load_mechanism(name)
    q = results.values("joint_position")
    at = pose(layout(mechanism), q)

    def point(body: str, p) -> np.ndarray:
        i = mechanism.body_index[body]
        return at.p[:, i] + at.R[:, i] @ np.array(p, dtype=float)

    return dict(zip(mechanism.coordinates, q.T, strict=True)), point, at.R[:, mechanism.body_index.get("platform", 0)]


@pytest.mark.sampled(3)
@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_all_engines_agree(name):
    agreed(solved(name))


def test_slider_crank():
    q, _, _ = moved("slider-crank")
    assert np.ptp(q["crank"]) > 2 * np.pi
    x = 0.1 * np.cos(q["crank"]) + np.sqrt(0.3**2 - (0.1 * np.sin(q["crank"])) ** 2)
    assert q["slide"] == pytest.approx(x, abs=CLOSED)


def falling(name: str) -> tuple[dict[str, np.ndarray], np.ndarray]:
    results = screwgauge.run(screwgauge.load_scene(name), engines=["screw"])
    q = results.values("joint_position")
    return dict(zip(results.components("joint_position"), q.T, strict=True)), results.values("observable")


@pytest.mark.slow
def test_spatial_slider_crank():
    q, slider = falling("spatial-slider-crank")
    assert np.ptp(q["crank"]) > np.pi
    x = 0.15 * np.cos(q["crank"]) + np.sqrt(0.35**2 - (0.15 * np.sin(q["crank"])) ** 2)
    assert q["slide"] == pytest.approx(x, abs=CLOSED)
    assert slider[:, 0] == pytest.approx(x, abs=CLOSED)


def test_the_centre_of_mass_of_a_cart_pole_falls_in_a_vertical_line():
    q, bob = falling("cart-pole")
    assert q["rail"] == pytest.approx((1.0 - np.sin(q["hinge"])) / (1.0 + 1e-6), abs=FALLING)
    assert 1e-6 * q["rail"] + bob[:, 0] == pytest.approx(np.ones(len(bob)), abs=FALLING)
    assert bob[:, 1] == pytest.approx(-np.cos(q["hinge"]), abs=CLOSED)


def test_five_bar():
    q, point, _ = moved("five-bar")
    left, right = (
        [x, 0] + 0.2 * np.stack([-np.sin(a), np.cos(a)], 1) for x, a in ((-0.15, q["left"]), (0.15, q["right"]))
    )
    half, middle = (right - left) / 2, (right + left) / 2
    size = np.linalg.norm(half, axis=1)[:, None]
    tip = middle + np.stack([-half[:, 1], half[:, 0]], 1) / size * np.sqrt(0.3**2 - size**2)
    assert point("left.rod", [0, 0.3, 0])[:, :2] == pytest.approx(tip, abs=CLOSED)


def test_bennett():
    q, _, _ = moved("bennett")
    ratio = np.sin(np.pi / 4) / np.sin(np.pi / 12)
    assert np.tan(q["j1"] / 2) * np.tan(q["j2"] / 2) == pytest.approx(np.full(len(q["j1"]), ratio), rel=CLOSED, abs=0)
    assert q["j3"] == pytest.approx(-q["j1"], abs=CLOSED)


def test_sarrus():
    q, point, R = moved("sarrus")
    rise = 2 * (0.1 * np.sin(q["a1"]) + 0.2 * np.cos(q["a1"])) - 0.4
    assert point("platform", [0, 0, 0]) == pytest.approx(np.outer(rise, [0, 0, 1]), abs=CLOSED)
    assert pytest.approx(np.tile(np.eye(3), (len(R), 1, 1)), abs=CLOSED) == R


def test_rccc():
    """Angles by Rodrigues' formula on directions, slides by one linear system."""
    q, _, _ = moved("rccc")
    axes = np.array([[0, 0, 1], [2 / 3, -1 / 3, 2 / 3], [2 / 7, 3 / 7, 6 / 7], [-4 / 9, 1 / 9, 8 / 9]])
    points = np.array([[0, 0, 0], [0.2, 0.3, 0.1], [0.5, 0.3, 0.3], [0.6, 0, 0.1]])

    def about(e, angle, v):
        return v * np.cos(angle) + np.cross(e, v) * np.sin(angle) + e * (e @ v) * (1 - np.cos(angle))

    for crank, rocker, slides in zip(
        q["crank"], q["fourth.q1"], np.stack([q["second.q2"], q["third.q2"], q["fourth.q2"]], 1), strict=True
    ):
        second, third = about(axes[0], crank, axes[1]), about(axes[3], rocker, axes[2])
        assert second @ third == pytest.approx(axes[1] @ axes[2], abs=CLOSED)  # the spherical four-bar
        start = about(axes[0], crank, points[1])
        end = points[3] + about(axes[3], rocker, points[2] - points[3])
        normal = np.cross(second, third) / np.linalg.norm(np.cross(axes[1], axes[2]))
        # the coupler, as its two axes say how it is turned
        turned = np.stack([second, third, normal], 1) @ np.linalg.inv(
            np.stack([axes[1], axes[2], np.cross(axes[1], axes[2]) / np.linalg.norm(np.cross(axes[1], axes[2]))], 1)
        )
        right = end - start - turned @ (points[2] - points[1])
        found = np.linalg.solve(np.stack([second, third, -axes[3]], 1), right)
        assert slides == pytest.approx(found, abs=CLOSED)


def spin(k: int) -> np.ndarray:
    c, s = np.cos(2 * np.pi * k / 3), np.sin(2 * np.pi * k / 3)
    return np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])


def test_planar_3_rrr():
    q, point, _ = moved("3-rrr")
    for k in range(3):
        base, elbow, tip = (spin(k) @ p for p in ([0.5, 0, 0], [0.3, 0.2, 0], [0.15, 0, 0]))
        way = point("platform", tip) - base
        l1, l2, far = np.linalg.norm(elbow - base), np.linalg.norm(tip - elbow), np.linalg.norm(way, axis=1)
        bend = np.arccos((l1**2 + far**2 - l2**2) / (2 * l1 * far))
        heading = np.arctan2(way[:, 1], way[:, 0]) - bend
        angle = heading - np.arctan2(*(elbow - base)[1::-1])
        assert np.angle(np.exp(1j * (q[f"leg{k + 1}.base"] - angle))) == pytest.approx(0 * angle, abs=CLOSED)


def test_3_rps_moves_sideways_as_it_tilts():
    q, point, R = moved("3-rps")
    x, y, _ = point("platform", [0, 0, 0.6]).T
    assert np.abs(y).max() > 1e-3
    assert R[:, 1, 0] == pytest.approx(R[:, 0, 1], abs=CLOSED)
    assert x == pytest.approx(0.15 * (R[:, 0, 0] - R[:, 1, 1]), abs=CLOSED)
    assert y == pytest.approx(-0.3 * R[:, 1, 0], abs=CLOSED)
    for k in range(3):
        length = np.linalg.norm(point("platform", spin(k) @ [0.3, 0, 0.6]) - spin(k) @ [0.5, 0, 0], axis=1)
        assert q[f"leg{k + 1}.slide"] == pytest.approx(length, abs=CLOSED)


def spheres(centres: np.ndarray, radii: np.ndarray, side: float) -> np.ndarray:
    """Intersection above (1) or below (-1). Shapes (3, 3), (3,)."""
    a, b, c = centres
    e = (b - a) / np.linalg.norm(b - a)
    f = c - a - e * (e @ (c - a))
    f /= np.linalg.norm(f)
    x = (radii[0] ** 2 - radii[1] ** 2 + (b - a) @ (b - a)) / (2 * np.linalg.norm(b - a))
    y = (radii[0] ** 2 - radii[2] ** 2 + (c - a) @ (c - a) - 2 * x * (e @ (c - a))) / (2 * (f @ (c - a)))
    n = np.cross(e, f)
    return a + x * e + y * f + side * np.sign(n[2]) * np.sqrt(radii[0] ** 2 - x**2 - y**2) * n


def test_3_upu_does_not_turn():
    q, point, R = moved("3-upu")
    assert pytest.approx(np.tile(np.eye(3), (len(R), 1, 1)), abs=CLOSED) == R
    centres = np.array([spin(k) @ [0.2, 0, 0] for k in range(3)])
    lengths = np.stack([q[f"leg{k}.slide"] for k in (1, 2, 3)], 1)
    met = np.array([spheres(centres, row, 1.0) for row in lengths])
    assert point("platform", [0, 0, 0.6]) == pytest.approx(met, abs=CLOSED)


@pytest.mark.parametrize("name", ["stewart", "stewart-legs"])
def test_stewart_has_the_leg_lengths_of_its_pose(name):
    q, point, _ = moved(name)
    mechanism = load_mechanism(name)
    for k in range(1, 7):
        base, top = (mechanism.joint(f"leg{k}.{end}").child_frame.p for end in ("base", "ball"))
        length = np.linalg.norm(point("platform", top) - base, axis=1)
        assert q[f"leg{k}.slide"] == pytest.approx(length, abs=CLOSED)


def test_delta_does_not_turn():
    q, point, R = moved("delta")
    assert pytest.approx(np.tile(np.eye(3), (len(R), 1, 1)), abs=CLOSED) == R
    for i, row in enumerate(np.stack([q[f"arm{k}.hip"] for k in (1, 2, 3)], 1)):
        c, s = np.cos(row), np.sin(row)  # about the tangent, which turns z towards the radius
        elbows = [spin(k) @ [0.2 + 0.24 * c[k] - 0.18 * s[k] - 0.08, 0, -0.18 * c[k] - 0.24 * s[k]] for k in range(3)]
        met = spheres(np.array(elbows), np.full(3, 0.6), -1.0)
        assert point("platform", [0, 0, -0.66])[i] == pytest.approx(met, abs=CLOSED)


def test_hooke_joints_in_z_cancel():
    q, point, _ = moved("double-cardan")
    turns = np.exp(1j * (q["output"] - q["input"]))
    assert turns == pytest.approx(np.ones(len(turns)), abs=CLOSED)
    # the middle shaft turns about its own axis: how far its fork across it has come round
    along, fork = np.array([np.sqrt(3) / 2, 0.5, 0]), np.array([-0.5, np.sqrt(3) / 2, 0])
    now = point("middle", fork) - point("middle", [0, 0, 0])
    middle = np.arctan2(now @ np.cross(along, fork), now @ fork)
    assert np.tan(middle) == pytest.approx(np.tan(q["input"]) * np.cos(np.pi / 6), rel=1e-10, abs=0)


def test_arm_of_seven_joints_holds_its_weight():
    """Moments of the weights about axes, from published Denavit-Hartenberg parameters."""
    scene = screwgauge.load_scene("arm7")
    y = np.array([0.3, -0.4, 0.2, -1.8, 0.5, 1.4, -0.6])
    zero = np.zeros((1, 7))
    results = screwgauge.run(replace(scene, task=GivenMotion(np.zeros(1), y[None], zero, zero)), engines=IN_DOUBLES)
    assert results.ok
    T, axes, origins, centres = np.eye(4), [], [], []
    for angle, alpha, a, d, body in zip(
        y,
        [0, -np.pi / 2, np.pi / 2, np.pi / 2, -np.pi / 2, np.pi / 2, np.pi / 2],
        [0, 0, 0, 0.0825, -0.0825, 0, 0.088],
        [0.333, 0, 0.316, 0, 0.384, 0, 0],
        scene.mechanism.bodies,
        strict=True,
    ):
        ca, sa, ct, st = np.cos(alpha), np.sin(alpha), np.cos(angle), np.sin(angle)
        T = T @ [[ct, -st, 0, a], [st * ca, ct * ca, -sa, -d * sa], [st * sa, ct * sa, ca, d * ca], [0, 0, 0, 1]]
        axes.append(T[:3, 2])
        origins.append(T[:3, 3])
        centres.append(T[:3, :3] @ body.com + T[:3, 3])
    weights = scene.mechanism.masses[:, None] * [0, 0, 9.81]
    torques = [sum(axes[i] @ np.cross(centres[k] - origins[i], weights[k]) for k in range(i, 7)) for i in range(7)]
    assert results.values("actuator_force")[0] == pytest.approx(np.array(torques), abs=1e-12)


def relative(found, wanted) -> float:
    return np.abs(found - wanted).max() / np.abs(wanted).max()


def by_name(name: str, quantity: str) -> dict[str, np.ndarray]:
    results = solved(name)
    return dict(zip(results.components(quantity), results.values(quantity).T, strict=True))


def test_belt_leg():
    q, _, _ = moved("belt-leg")
    assert q["hip"] + q["knee"] == pytest.approx(q["motor"] + np.pi / 20, abs=CLOSED)
    assert q["hip"] + q["knee"] + q["pitch"] == pytest.approx((q["left"] + q["right"]) / 2, abs=CLOSED)
    assert q["roll"] == pytest.approx((q["left"] - q["right"]) / 2, abs=CLOSED)
    a, pulls = by_name("belt-leg", "joint_acceleration"), by_name("belt-leg", "reaction")
    torques = by_name("belt-leg", "actuator_force")
    belt, pitch, roll = (pulls[f"{name}.coupling"] for name in ("belt", "sum", "difference"))
    assert relative(torques["left"], 1.5e-4 * a["left"] + (pitch + roll) / 2) < LINEAR
    assert relative(torques["right"], 1.5e-4 * a["right"] + (pitch - roll) / 2) < LINEAR
    balance = 3.5e-4 * a["motor"] + 0.3 * (0.002**2 * a["motor"] - 9.81 * 0.002 * np.cos(q["motor"]))
    assert relative(torques["motor"], balance + belt) < LINEAR


def test_planetary_gear():
    q, _, _ = moved("planetary-gear")
    k, planet = 20 / (20 + 80), 1 - 80 / 30  # of the carrier by the sun, of a planet by the carrier
    assert relative(q["carrier"], k * q["sun"]) < LINEAR
    assert relative(20 * (q["sun"] - q["carrier"]), -30 * q["planet1"]) < LINEAR  # Willis: as the carrier sees it
    s, pulls = by_name("planetary-gear", "joint_acceleration")["sun"], by_name("planetary-gear", "reaction")
    carrier = 1.1e-3 + 0.8 * 0.004**2 + 3 * 0.4 * 0.05**2
    inertia = 6e-5 + k**2 * (carrier + 3 * 1.8e-4 * planet**2)
    torque = inertia * s - 0.8 * 9.81 * 0.004 * k * np.cos(q["carrier"]) + 5 * k
    assert relative(by_name("planetary-gear", "actuator_force")["sun"], torque) < LINEAR
    assert relative(pulls["planet3.coupling"], 1.8e-4 * planet * k * s) < LINEAR
    assert relative(pulls["carrier.coupling"], (torque - 6e-5 * s) / k) < LINEAR


def elbows(left, right) -> np.ndarray:
    """Intersections of two circles. Shape (3, n)."""
    first = -0.15 - 0.2 * np.sin(left), 0.2 * np.cos(left)
    second = 0.15 - 0.2 * np.sin(right), 0.2 * np.cos(right)
    x, y = second[0] - first[0], second[1] - first[1]
    up = np.sqrt(0.3**2 / (x * x + y * y) - 0.25)
    along = np.arctan(-(0.5 * x - up * y) / (0.5 * y + up * x))  # rods from the vertical
    back = np.arctan(-(-0.5 * x - up * y) / (-0.5 * y + up * x))
    return np.array([along - left, back - right, back - along])


def test_geared_five_bar(write):
    masses, centres = np.array([0.4, 0.3]), np.array([[0, 0.14, 0.005], [0.03, 0.1, 0.02]])
    com = masses @ centres / masses.sum()
    arms = centres - com
    J = np.diag([0.003 + 1e-4, 0.0002 + 2e-4, 0.0031 + 2e-4])
    J = J + sum(m * (r @ r * np.eye(3) - np.outer(r, r)) for m, r in zip(masses, arms, strict=True))
    tensor = ", ".join(f"{a}{b} = {J[i, j]}" for i, a in enumerate("xyz") for j, b in enumerate("xyz") if i <= j)
    body = f"mass = 0.7\ncom = {com.tolist()}\ninertia = {{ {tensor} }}\n"
    write("rigid.toml", f'extends = "five-bar"\nname = "rigid"\n[bodies."left.rod"]\n{body}')
    scene = screwgauge.load_scene("geared-five-bar")
    text = "mechanism = 'rigid.toml'\nmotion.left.harmonics = [[3, 0, 0.4]]\nmotion.right.offset = 0.3\n"
    text += "motion.right.harmonics = [[4, -0.3, 0.2]]\ntime = { duration = 2, step = 0.01 }\n"
    rigid = screwgauge.load_scene(write("move.toml", text)).at(scene.t[:: len(scene.t) // 6])
    torques = screwgauge.run(rigid, ["screw"], ["actuator_force"]).values("actuator_force")
    (left, right), rates = rigid.motion.y.T, rigid.motion.yd
    q, speed, acceleration = (
        by_name("geared-five-bar", f"joint_{of}") for of in ("position", "velocity", "acceleration")
    )
    slopes = np.moveaxis([elbows(left + 1e-30j, right).imag, elbows(left, right + 1e-30j).imag], 0, 2) / 1e-30
    cranks = {"left": [1.0, 0.0], "right": [0.0, 1.0], "wheel": [0.5, 0.5]}
    maps = {name: np.tile(slope, (len(rates), 1)) for name, slope in cranks.items()}
    for name, angle, slope in zip(("left.elbow", "right.elbow", "tip"), elbows(left, right), slopes, strict=True):
        assert q[name] == pytest.approx(angle, abs=CLOSED)
        maps[name] = slope
    rotor = {"left": 0.3e-4 * 12**2, "right": 0.3e-4 * 12**2, "left.elbow": 1e-4, "tip": 2e-4, "wheel": 1e-3 + 2e-4}
    damping = {"left": 0.02, "right": 0.02, "left.elbow": 4e-3, "right.elbow": 4e-3, "tip": 3e-3}
    friction = {"left": 0.05, "right": 0.05, "left.elbow": 0.01, "right.elbow": 0.01, "tip": 8e-3}
    for name, slope in maps.items():
        rate = np.einsum("nk,nk->n", slope, rates)
        assert speed[name] == pytest.approx(rate, abs=1e-11)
        taken = rotor.get(name, 0.0) * acceleration[name] + damping.get(name, 0.0) * rate
        torques = torques + (taken + friction.get(name, 0.0) * np.sign(rate))[:, None] * slope
    found = np.stack([by_name("geared-five-bar", "actuator_force")[name] for name in ("left", "right")], axis=1)
    assert relative(found, torques) < LINEAR


def test_screw_press():
    q, _, _ = moved("screw-press")
    p = 0.01 / (2 * np.pi)
    x = 0.2 - p * q["screw"]
    y = np.sqrt(0.25**2 - x**2)
    assert q["nut.slide"] == pytest.approx(x, abs=CLOSED)
    assert q["guide"] == pytest.approx(-y, abs=CLOSED)
    rate, a = (by_name("screw-press", f"joint_{of}")["screw"] for of in ("velocity", "acceleration"))
    up, along = 4 + 0.9 / 4, 0.5 + 0.9 / 4  # masses that move with the ram, and with the nut
    M = 3e-4 + p**2 * (along + up * x**2 / y**2 + 5e-3 / y**2)
    slope = -(p**3) * (up * 2 * x * 0.25**2 + 5e-3 * 2 * x) / y**4
    torque = M * a + 0.5 * slope * rate**2 + (2000 - 9.81 * (4 + 0.9 / 2)) * p * x / y
    assert relative(by_name("screw-press", "actuator_force")["screw"], torque) < LINEAR
    assert relative(by_name("screw-press", "reaction")["thread.coupling"], (3e-4 * a - torque) / p) < LINEAR


def test_ruse():
    """The ball is at B + R_y(theta) R_z(-cross.rod) d."""
    q, point, _ = moved("ruse")
    u, normal, home = q["crank"], np.array([0.0, -0.5, 0.75**0.5]), np.array([0.45, 0.1, 0.2])
    assert np.ptp(u) > 0.4
    assert q["cross.crank"] == pytest.approx(-0.4 * u + u**2 / 4, abs=CLOSED)
    theta = u - q["cross.crank"]
    B = np.stack([0.15 * np.cos(u) + 0.05 * np.sin(u), 0 * u, 0.05 * np.cos(u) - 0.15 * np.sin(u)], axis=1)
    a, b = -0.1 / 2 - 0.3 * normal[2] * np.sin(theta), 0.3 / 2 - 0.1 * normal[2] * np.sin(theta)
    c = 0.15 * normal[2] * np.cos(theta) + (B - home) @ normal
    rod = np.arctan2(b, a) - np.arccos(-c / np.hypot(a, b))  # a cos(rod) + b sin(rod) + c = 0
    assert q["cross.rod"] == pytest.approx(rod, abs=CLOSED)
    x, y = 0.3 * np.cos(rod) + 0.1 * np.sin(rod), 0.1 * np.cos(rod) - 0.3 * np.sin(rod)
    turned = [x * np.cos(theta) + 0.15 * np.sin(theta), y, 0.15 * np.cos(theta) - x * np.sin(theta)]
    ball = B + np.stack(turned, axis=1)
    assert point("plate", [0, 0, 0]) == pytest.approx(ball, abs=CLOSED)
    assert q["table.1"] == pytest.approx((ball - home) @ [0.0, normal[2], 0.5], abs=CLOSED)
    assert q["table.2"] == pytest.approx(home[0] - ball[:, 0], abs=CLOSED)
    assert q["table.turn"] == pytest.approx(8.0 * q["table.1"] ** 2, abs=CLOSED)
