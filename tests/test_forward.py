"""Forward dynamics: what inverse dynamics asked for brings back the motion, by two routes."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import screwgauge
from screwgauge import ScrewgaugeError
from support.acting import Forces, JointSpring, PointSpring, energy
from support.errors import DescriptionError, SingularPoseError, UnknownNameError
from support.mechanism import DATA, load_mechanism
from support.solve import forward, forward_dense, inertia_matrix, layout, moved, positions, velocities
from support.tolerances import DENSE, FORMULA, LINEAR, ROUND_TRIP, ROUNDING, SLOPE_OF_ENERGY

SCENES = [
    "3ups-upu-s",
    "3ups-upu-s-eq55",
    "3ups-upu-s-fast",
    "3ups-upu-s-offset",
    *(DATA / f"{name}-scene.toml" for name in ("four-bar", "rscr", "slider-crank", "pendulum")),
]


def at_rest_or_moving(scene, n=9):
    """Some samples of a scene: layout, rates and the forces that act besides the actuators."""
    t = scene.t
    scene = scene.at(t[np.linspace(0, len(t) - 1, n).astype(int)])
    lay = layout(scene.mechanism)
    rate = velocities(lay, positions(lay, scene.motion.y, scene.t), scene.motion.yd)
    return scene, lay, rate, Forces(gravity=scene.applied.g, loads=scene.applied.loads)


@pytest.mark.slow
@pytest.mark.parametrize("name", SCENES, ids=lambda name: Path(name).stem)
def test_inverse_then_forward_returns_the_accelerations(name):
    scene, lay, rate, forces = at_rest_or_moving(screwgauge.load_scene(name))
    run = screwgauge.run(scene, engines=["screw"], quantities=["actuator_force", "joint_acceleration"])
    forces = replace(forces, actuators=run.values("actuator_force"))
    scale = np.abs(scene.motion.ydd).max()
    found = forward(lay, rate, forces)
    assert np.abs(found.ydd - scene.motion.ydd).max() < ROUND_TRIP * scale
    dense = forward_dense(lay, rate, forces)
    qdd = run.values("joint_acceleration")
    assert np.abs(dense.qdd - qdd).max() < DENSE * np.abs(qdd).max()


def test_dense_route_returns_the_reactions_too():
    scene, lay, rate, forces = at_rest_or_moving(screwgauge.load_scene("3ups-upu-s-fast"))
    run = screwgauge.run(scene, engines=["screw"], quantities=["actuator_force", "reaction"])
    dense = forward_dense(lay, rate, replace(forces, actuators=run.values("actuator_force")))
    reaction = run.values("reaction")
    assert dense.names == tuple(run.components("reaction"))
    assert np.abs(dense.reactions - reaction).max() < DENSE * np.abs(reaction).max()


def test_a_batch_is_its_samples_one_by_one():
    _, lay, rate, forces = at_rest_or_moving(screwgauge.load_scene(DATA / "rscr-scene.toml"))
    together = forward(lay, rate, forces).ydd
    y, yd = rate.pose.q[:, lay.mechanism.independent_columns], rate.w[:, lay.mechanism.independent_columns]
    t = np.zeros(1)
    alone = [
        forward(lay, velocities(lay, positions(lay, a[None], t), b[None]), forces).ydd[0]
        for a, b in zip(y, yd, strict=True)
    ]
    assert np.abs(together - alone).max() < LINEAR * np.abs(together).max()


@pytest.fixture(scope="module")
def pendulum():
    """The double pendulum at three poses that move."""
    lay = layout(load_mechanism(DATA / "pendulum.toml"))
    y = np.array([[0.3, -0.2], [1.1, 0.4], [-0.7, 0.9]])
    return lay, moved(lay, y, np.array([[1.0, 2.0], [-3.0, 0.5], [0.0, 4.0]]))


def test_a_joint_spring_is_the_motor_that_does_the_same(pendulum):
    lay, rate = pendulum
    spring = JointSpring("b", stiffness=30.0, rest=0.1, damping=2.0)
    tau = np.zeros_like(rate.w)
    tau[:, 1] = -30.0 * (rate.pose.q[:, 1] - 0.1) - 2.0 * rate.w[:, 1]
    by_spring, by_motor = forward(lay, rate, Forces(springs=[spring])), forward(lay, rate, Forces(joints=tau))
    assert np.abs(by_spring.ydd - by_motor.ydd).max() < ROUNDING


def test_a_point_spring_pulls_along_its_line(pendulum):
    """Against the force found from the derivative of its own energy, and both routes against each other."""
    lay, rate = pendulum
    spring = PointSpring("ground", np.array([0.5, 0.2, 0.0]), "bob", np.array([0.1, 0.0, -1.0]), 40.0, 0.6)
    y, h = rate.pose.q, 1e-6

    def stored(y):
        still = moved(lay, y, np.zeros_like(y))
        return energy(lay, still, Forces(gravity=np.zeros(3), springs=[spring]))

    slope = np.stack([(stored(y + h * e) - stored(y - h * e)) / (2 * h) for e in np.eye(2)], axis=1)
    with_spring = forward(lay, rate, Forces(springs=[spring]))
    with_slope = forward(lay, rate, Forces(joints=-slope))
    assert np.abs(with_spring.ydd - with_slope.ydd).max() < SLOPE_OF_ENERGY
    dense = forward_dense(lay, rate, Forces(springs=[spring]))
    assert np.abs(dense.qdd - with_spring.ydd).max() < ROUND_TRIP * np.abs(dense.qdd).max()


def test_energy_changes_by_the_power_of_dampers_and_motors(pendulum):
    """dE/dt = tau w - c (q')^2 - c (l')^2, E by central differences along the motion."""
    lay, rate = pendulum
    columns = [0, 1]
    damper = PointSpring("ground", np.array([1.0, 0.5, 0.0]), "bob", np.array([0.0, 0.0, -1.0]), 7.0, 0.3, 5.0)
    springs = [JointSpring("a", 10.0, 0.2, 3.0), damper]
    forces = Forces(joints=np.array([0.7, -1.3]), springs=springs)
    y, yd = rate.pose.q[:, columns], rate.w
    ydd = forward(lay, rate, forces).ydd
    h = 1e-5

    def later(s):
        return moved(lay, y + s * yd + 0.5 * s * s * ydd, yd + s * ydd)

    def length(s):
        at = later(s).pose
        return np.linalg.norm(at.p[:, 2] + at.R[:, 2] @ [0.0, 0.0, -1.0] - [1.0, 0.5, 0.0], axis=1)

    def slope(f):
        return (f(h) - f(-h)) / (2 * h)

    expected = yd @ [0.7, -1.3] - 3.0 * yd[:, 0] ** 2 - 5.0 * slope(length) ** 2
    assert np.abs(slope(lambda s: energy(lay, later(s), forces)) - expected).max() < SLOPE_OF_ENERGY


def test_inertia_matrix_is_that_of_the_kinetic_energy_of_a_four_bar():
    _, lay, rate, _ = at_rest_or_moving(screwgauge.load_scene(DATA / "four-bar-scene.toml"))
    forces = Forces(gravity=np.zeros(3))
    yd = rate.w[:, lay.mechanism.independent_columns]
    M = inertia_matrix(lay, rate)
    assert np.array_equal(M, forward(lay, rate, forces).M)
    assert energy(lay, rate, forces) == pytest.approx(0.5 * M[:, 0, 0] * yd[:, 0] ** 2, rel=FORMULA, abs=0)


def test_bad_springs_and_forces_are_said(pendulum):
    lay, rate = pendulum
    zero = np.zeros(3)
    with pytest.raises(DescriptionError, match="stiffness -1 is negative"):
        JointSpring("a", -1.0)
    with pytest.raises(DescriptionError, match="damping nan is not finite"):
        PointSpring("ground", zero, "bob", zero, damping=float("nan"))
    with pytest.raises(DescriptionError, match="rest length -1 m is negative"):
        PointSpring("ground", zero, "bob", zero, rest=-1.0)
    with pytest.raises(DescriptionError, match="joins a body to itself"):
        PointSpring("bob", zero, "bob", zero)
    with pytest.raises(UnknownNameError, match="unknown coordinate 'c'"):
        forward(lay, rate, Forces(springs=[JointSpring("c", 1.0)]))
    with pytest.raises(UnknownNameError, match="unknown body 'bobb'"):
        forward(lay, rate, Forces(springs=[PointSpring("ground", zero, "bobb", zero)]))
    with pytest.raises(SingularPoseError, match="its points meet"):
        forward(lay, rate, Forces(springs=[PointSpring("ground", zero, "upper", zero, 1.0)]))
    with pytest.raises(DescriptionError, match=r"actuator forces of shape \(3,\) for 2 of them at 3 poses"):
        forward(lay, rate, Forces(actuators=np.zeros(3)))


def test_a_coordinate_that_moves_no_mass_is_named(write):
    """A point mass on the axis about which it turns."""
    path = write(
        "idle.toml",
        """
name = "idle"
[independent]
a = "a"
[bodies.bob]
mass = 1
inertia = { xx = 0, yy = 0, zz = 0 }
[joints.a]
kind = "R"
parent = "ground"
child = "bob"
axes = [[0, 0, 1]]
""",
    )
    lay = layout(load_mechanism(path))
    rate = moved(lay, np.zeros((1, 1)), np.zeros((1, 1)))
    with pytest.raises(ScrewgaugeError, match="the coordinate 'a' moves no mass"):
        forward(lay, rate, Forces())


SLIDE_AND_WHEEL = """
name = "slide-and-wheel"
independent = { x = "slide", a = "axle" }
[bodies.cart]
mass = 1e12
inertia = { xx = 1, yy = 1, zz = 1 }
[bodies.wheel]
mass = 1e-12
inertia = { xx = 1e-14, yy = 1e-14, zz = 1e-14 }
[joints]
slide = { kind = "P", parent = "ground", child = "cart", axes = [[1, 0, 0]], actuated = true }
axle = { kind = "R", parent = "cart", child = "wheel", axes = [[0, 0, 1]], actuated = true }
"""
ELBOW = """
name = "elbow"
independent = { a = "shoulder", b = "elbow" }
[bodies.arm]
mass = 0
[bodies.bob]
mass = 1
com = [1, 0, 0]
inertia = {}
[joints]
shoulder = { kind = "R", parent = "ground", child = "arm", axes = [[0, 0, 1]], actuated = true }
[joints.elbow]
kind = "R"
parent = "arm"
child = "bob"
axes = [[0, 0, 1]]
parent_frame = { position = [1, 0, 0] }
actuated = true
"""


def response(path: Path, *y: tuple[float, float]):
    lay = layout(load_mechanism(path))
    rate = moved(lay, np.array(y), np.zeros((len(y), 2)))
    return forward(lay, rate, Forces(actuators=np.array([2.0, 3.0]), gravity=np.zeros(3)))


def test_coordinates_in_metres_and_radians_of_any_size_have_an_inertia_matrix(write):
    """A slide of 1e12 kg carries a wheel of 1e-14 kg m^2: 26 powers of ten that are no linear dependence."""
    found = response(write("m.toml", SLIDE_AND_WHEEL), (0.0, 0.0))
    assert found.M[0] == pytest.approx(np.diag([1e12, 1e-14]), rel=FORMULA, abs=0.0)
    assert found.ydd[0] == pytest.approx([2e-12, 3e14], rel=FORMULA, abs=0.0)


def test_coordinates_that_together_move_no_mass_are_refused_at_any_sample(write):
    """An arm without mass and a point mass at its end: stretched, it cannot be moved along."""
    path = write("m.toml", ELBOW)
    assert np.isfinite(response(path, (0.0, 1.0), (0.1, 1.0)).ydd).all()
    with pytest.raises(SingularPoseError, match="some combination of the independent coordinates moves no mass"):
        response(path, (0.0, 0.1), (0.0, 0.0))
