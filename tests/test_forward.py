from pathlib import Path

import numpy as np
import pytest

import screwgauge
from screwgauge import ScrewgaugeError
from support.acting import Applied, JointSpring, PointSpring
from support.data import DATA, data
from support.errors import DescriptionError, SingularPoseError, UnknownNameError
from support.mechanism import load_mechanism
from support.solve import NewtonEuler, layout, moved, under
from support.tolerances import DENSE, FORMULA, LINEAR, ROUND_TRIP, ROUNDING, SLOPE_OF_ENERGY

SCENES = [
    "3ups-upu-s",
    "3ups-upu-s-eq55",
    "3ups-upu-s-fast",
    "3ups-upu-s-offset",
    *(DATA / f"{name}-scene.toml" for name in ("four-bar", "rscr", "slider-crank", "pendulum")),
]


def at_rest_or_moving(scene, n=9):
    t = scene.t
    scene = scene.at(t[np.linspace(0, len(t) - 1, n).astype(int)])
    return scene, moved(layout(scene.mechanism), scene.motion.y, scene.motion.yd, applied=scene.applied)


@pytest.mark.slow
@pytest.mark.parametrize("name", SCENES, ids=lambda name: Path(name).stem)
def test_inverse_then_forward_returns_the_accelerations(name):
    scene, idle = at_rest_or_moving(screwgauge.load_scene(name))
    run = screwgauge.run(scene, engines=["screw"], quantities=["actuator_force", "joint_acceleration"])
    at = under(idle, scene.applied, actuators=run.values("actuator_force"))
    scale = np.abs(scene.motion.ydd).max()
    assert np.abs(at.ydd - scene.motion.ydd).max() < ROUND_TRIP * scale
    qdd = run.values("joint_acceleration")
    assert np.abs(NewtonEuler(at).response()[0] - qdd).max() < DENSE * np.abs(qdd).max()


def test_dense_route_returns_the_reactions_too():
    scene, idle = at_rest_or_moving(screwgauge.load_scene("3ups-upu-s-fast"))
    run = screwgauge.run(scene, engines=["screw"], quantities=["actuator_force", "reaction"])
    whole = NewtonEuler(under(idle, scene.applied, actuators=run.values("actuator_force")))
    reaction = run.values("reaction")
    assert whole.names == tuple(run.components("reaction"))
    assert np.abs(whole.response()[1] - reaction).max() < DENSE * np.abs(reaction).max()


def test_a_batch_is_its_samples_one_by_one():
    scene, at = at_rest_or_moving(screwgauge.load_scene(DATA / "rscr-scene.toml"))
    lay, y = at.loops.lay, at.q[:, at.mechanism.independent_columns]
    alone = [moved(lay, a[None], b[None], applied=scene.applied).ydd[0] for a, b in zip(y, at.yd, strict=True)]
    assert np.abs(at.ydd - alone).max() < LINEAR * np.abs(at.ydd).max()


@pytest.fixture(scope="module")
def pendulum():
    lay = layout(load_mechanism(DATA / "pendulum.toml"))
    y = np.array([[0.3, -0.2], [1.1, 0.4], [-0.7, 0.9]])
    return moved(lay, y, np.array([[1.0, 2.0], [-3.0, 0.5], [0.0, 4.0]]))


def test_a_joint_spring_is_the_motor_that_does_the_same(pendulum):
    spring = JointSpring("b", stiffness=30.0, rest=0.1, damping=2.0)
    tau = np.zeros_like(pendulum.q)
    tau[:, 1] = -30.0 * (pendulum.q[:, 1] - 0.1) - 2.0 * pendulum.yd[:, 1]
    by_spring, by_motor = under(pendulum, Applied(springs=(spring,))), under(pendulum, joints=tau)
    assert np.abs(by_spring.ydd - by_motor.ydd).max() < ROUNDING


def test_a_point_spring_pulls_along_its_line(pendulum):
    spring = PointSpring("ground", np.array([0.5, 0.2, 0.0]), "bob", np.array([0.1, 0.0, -1.0]), 40.0, 0.6)
    y, h = pendulum.q, 1e-6

    def stored(y):
        return moved(pendulum.loops.lay, y, np.zeros_like(y), applied=Applied(np.zeros(3), springs=(spring,))).energy

    slope = np.stack([(stored(y + h * e) - stored(y - h * e)) / (2 * h) for e in np.eye(2)], axis=1)
    with_spring, with_slope = under(pendulum, Applied(springs=(spring,))), under(pendulum, joints=-slope)
    assert np.abs(with_spring.ydd - with_slope.ydd).max() < SLOPE_OF_ENERGY
    qdd, _ = NewtonEuler(with_spring).response()
    assert np.abs(qdd - with_spring.ydd).max() < ROUND_TRIP * np.abs(qdd).max()


def test_energy_changes_by_the_power_of_dampers_and_motors(pendulum):
    """dE/dt = tau w - c (q')^2 - c (l')^2, by central differences of E."""
    damper = PointSpring("ground", np.array([1.0, 0.5, 0.0]), "bob", np.array([0.0, 0.0, -1.0]), 7.0, 0.3, 5.0)
    forces = {"applied": Applied(springs=(JointSpring("a", 10.0, 0.2, 3.0), damper)), "joints": np.array([0.7, -1.3])}
    y, yd = pendulum.q, pendulum.yd
    now, h = under(pendulum, **forces), 1e-5

    def later(s):
        return moved(now.loops.lay, y + s * yd + 0.5 * s * s * now.ydd, yd + s * now.ydd, **forces)

    def length(s):
        at = later(s).pose
        return np.linalg.norm(at.p[:, 2] + at.R[:, 2] @ [0.0, 0.0, -1.0] - [1.0, 0.5, 0.0], axis=1)

    def slope(f):
        return (f(h) - f(-h)) / (2 * h)

    expected = yd @ [0.7, -1.3] - 3.0 * yd[:, 0] ** 2 - 5.0 * slope(length) ** 2
    assert now.input_power == pytest.approx(expected, abs=SLOPE_OF_ENERGY)
    assert np.abs(slope(lambda s: later(s).energy) - expected).max() < SLOPE_OF_ENERGY


def test_inertia_matrix_is_that_of_the_kinetic_energy_of_a_four_bar():
    _, at = at_rest_or_moving(screwgauge.load_scene(DATA / "four-bar-scene.toml"))
    expected = 0.5 * at.inertia_matrix[:, 0, 0] * at.yd[:, 0] ** 2
    assert under(at, Applied(np.zeros(3))).energy == pytest.approx(expected, rel=FORMULA, abs=0)


def test_bad_springs_and_forces_are_said(pendulum):
    zero = np.zeros(3)
    with pytest.raises(DescriptionError, match="stiffness -1 is negative"):
        JointSpring("a", -1.0)
    with pytest.raises(DescriptionError, match="damping nan is not finite"):
        PointSpring("ground", zero, "bob", zero, damping=float("nan"))
    with pytest.raises(DescriptionError, match="rest length -1 m is negative"):
        PointSpring("ground", zero, "bob", zero, rest=-1.0)
    with pytest.raises(DescriptionError, match="connects a body to itself"):
        PointSpring("bob", zero, "bob", zero)
    with pytest.raises(UnknownNameError, match="unknown coordinate 'c'"):
        under(pendulum, Applied(springs=(JointSpring("c", 1.0),)))
    with pytest.raises(UnknownNameError, match="unknown body 'bobb'"):
        under(pendulum, Applied(springs=(PointSpring("ground", zero, "bobb", zero),)))
    meeting = under(pendulum, Applied(springs=(PointSpring("ground", zero, "upper", zero, 1.0),)))
    with pytest.raises(SingularPoseError, match="its end points coincide"):
        meeting.check()
    with pytest.raises(DescriptionError, match=r"\(3,\) .* 2 coordinates at 3"):
        under(pendulum, actuators=np.zeros(3))


def test_a_coordinate_that_moves_no_mass_is_named(write):
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
    at = moved(lay, np.zeros((1, 1)), np.zeros((1, 1)))
    with pytest.raises(ScrewgaugeError, match="the coordinate 'a' moves no mass"):
        at.check()


SLIDE_AND_WHEEL = data("slide-and-wheel.toml")
ELBOW = data("elbow.toml")


def response(path: Path, *y: tuple[float, float]):
    lay = layout(load_mechanism(path))
    forces = {"applied": Applied(np.zeros(3)), "actuators": np.array([2.0, 3.0])}
    return moved(lay, np.array(y), np.zeros((len(y), 2)), **forces)


def test_coordinates_in_metres_and_radians_of_any_size_have_an_inertia_matrix(write):
    """A slide of 1e12 kg carries a wheel of 1e-14 kg m^2."""
    found = response(write("m.toml", SLIDE_AND_WHEEL), (0.0, 0.0))
    assert found.inertia_matrix[0] == pytest.approx(np.diag([1e12, 1e-14]), rel=FORMULA, abs=0.0)
    assert found.ydd[0] == pytest.approx([2e-12, 3e14], rel=FORMULA, abs=0.0)


def test_coordinates_that_together_move_no_mass_are_refused_at_any_sample(write):
    """A massless arm with a point mass at its end, stretched."""
    path = write("m.toml", ELBOW)
    assert np.isfinite(response(path, (0.0, 1.0), (0.1, 1.0)).ydd).all()
    with pytest.raises(SingularPoseError, match=r"combination.*moves no mass"):
        response(path, (0.0, 0.1), (0.0, 0.0)).check()


@pytest.mark.parametrize("name", ["stewart", "rccc", "a02-fourbar-2"])
def test_forces_along_any_coordinate_do_the_same_in_both_routes(name):
    lay = layout(load_mechanism(name))
    home, columns = lay.mechanism.home, lay.mechanism.independent_columns
    y = home[columns] + 0.05 * np.cos(np.arange(2.0 * len(columns))).reshape(2, -1)
    forces = np.sin(1.0 + np.arange(float(len(home))))
    at = moved(lay, y, np.ones_like(y), joints=forces)
    assert np.abs(at.ydd - moved(lay, y, np.ones_like(y)).ydd).max() > 1e-3
    assert np.abs(NewtonEuler(at).response()[0] - at.joint_acceleration).max() < DENSE * np.abs(at.ydd).max()
