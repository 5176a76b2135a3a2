from dataclasses import replace

import numpy as np
import pytest

import screwgauge
from screwgauge import load_scene
from support.acting import Applied
from support.engines import Problem, solve
from support.errors import SingularPoseError
from support.near import BASE, UPU, WRIST, before_upu, errors, moving_at
from support.scene import check_scene
from support.solve import ScrewModel, home_equations, layout, whole_system, wide_force_matrix

THIRTEEN = 1e-13  # scaled; promised of forces that are found by virtual power
FORCES = ("generalized_force", "actuator_force")
CLOSE = 1e-6  # [rad] from the pose where the constraint of leg 1 is lost


@pytest.fixture(scope="module")
def close():
    return screwgauge.run(moving_at(before_upu(CLOSE, 4)), engines=["screw", "truth"])


def test_the_third_rotation_of_the_symmetric_leg_is_held(paper):
    lay = layout(paper)
    assert [paper.coordinates[i] for i in home_equations(lay).fixed] == ["s.q3"]


def test_nothing_is_held_where_it_moves():
    for name in ("3ups-upu-s-offset", "3ups-upu-s-asymmetric"):
        mechanism = screwgauge.models.catalog.load_mechanism(name)
        held = [mechanism.coordinates[i] for i in home_equations(layout(mechanism)).fixed]
        assert held == ([] if name.endswith("offset") else ["s.q3"])


@pytest.mark.slow
@pytest.mark.parametrize(
    "quantity", [*FORCES, "joint_velocity", "joint_acceleration", "com_acceleration", "joint_position"]
)
def test_a_lost_constraint_costs_neither_motion_nor_forces(close, quantity):
    truth, screw = close.solutions["truth"], close.solutions["screw"]
    assert errors(screw, truth, quantity).max() <= THIRTEEN


def test_reactions_lose_what_the_distance_says(close):
    truth, screw = close.solutions["truth"], close.solutions["screw"]
    worst = errors(screw, truth, "reaction").max()
    assert worst <= 4 * np.finfo(float).eps / CLOSE * 10  # they grow as 1 / distance, and it is known to eps


@pytest.mark.slow
def test_the_newton_euler_system_has_the_same_forces():
    scene = moving_at(np.stack([np.linspace(-0.4, 0.4, 4), np.full(4, UPU - CLOSE)], axis=1), speed=0.1)
    read = whole_system(layout(scene.mechanism), scene.problem(["actuator_force"])).values["actuator_force"].array
    true = np.concatenate([alone(scene, i) for i in range(len(read))])
    digits = -np.log10(np.abs(read - true).max(axis=1) / np.abs(true).max())
    # the wrist moment of leg 1 is 2e8 N m; eps of it is 6e-11 of the forces, and the system knows no better
    assert digits.min() > 10.2
    assert np.median(digits) > 10.6


def alone(scene, i: int) -> np.ndarray:
    one = replace(scene, task=scene.motion.part(slice(i, i + 1)))
    return screwgauge.run(one, engines=["truth"], quantities=["actuator_force"]).values("actuator_force", "truth")


@pytest.mark.parametrize("size", [1e-3, 1e3])
def test_size_does_not_matter(size):
    """Gravity s times as strong: forces grow by s^4, moments by s^5."""
    scene = load_scene("3ups-upu-s")
    motion = moving_at([[0.1, 0.2], [-0.3, 0.1], [0.2, -0.3]]).motion

    def forces(s: float) -> tuple[np.ndarray, np.ndarray]:
        loads = tuple(replace(x, force=s**4 * x.force, torque=s**5 * x.torque) for x in scene.applied.loads)
        quantities = frozenset({"generalized_force", "actuator_force"})
        problem = Problem(Applied(gravity=s * scene.applied.g, loads=loads), motion, quantities)
        found = ScrewModel(layout(enlarged(scene.mechanism, s))).solve(problem).values
        return found["generalized_force"].array / s**5, found["actuator_force"].array / s**4

    for own, other in zip(forces(size), forces(1.0), strict=True):
        assert np.abs(own - other).max() <= THIRTEEN * np.abs(other).max()


def enlarged(mechanism, s: float):
    def frame(old):
        return replace(old, p=s * old.p)

    def lengths(joint, values):
        return np.array(values) * (s if joint.kind == "P" else 1.0)

    bodies = [replace(b, mass=s**3 * b.mass, com=s * b.com, inertia=s**5 * b.inertia) for b in mechanism.bodies]
    joints = [
        replace(
            j,
            home=lengths(j, j.home),
            limits=lengths(j, j.limits),
            parent_frame=frame(j.parent_frame),
            child_frame=frame(j.child_frame),
        )
        for j in mechanism.joints
    ]
    return replace(mechanism, bodies=tuple(bodies), joints=tuple(joints))


ENGINES = ["screw", "pinocchio", "mujoco", "truth"]
DYNAMICS = ["joint_acceleration", "com_acceleration", "tree_force", "generalized_force", "actuator_force"]


@pytest.mark.slow
@pytest.mark.parametrize("ratio", [1e-6, 1e6])
def test_mass_ratios_cost_no_engine_its_digits(ratio, changed_scene):
    legs = [f"leg{k}.{half}" for k in range(1, 5) for half in ("lower", "upper")]
    inertia = f"{{ xx = {1.16e-2 * ratio!r}, yy = {1.14e-2 * ratio!r}, zz = {5.56e-4 * ratio!r} }}"
    changes = "\n".join(f'[bodies."{x}"]\nmass = {1.42 * ratio!r}\ninertia = {inertia}' for x in legs)
    scene = moving_at([[0.1, 0.2], [-0.3, 0.1], [0.2, -0.3]], scene=load_scene(changed_scene(changes)))
    results = screwgauge.run(scene, engines=ENGINES, quantities=DYNAMICS)
    assert results.pairs["max_scaled"].max() <= THIRTEEN, results.pairs.to_string()


@pytest.mark.slow
@pytest.mark.parametrize("speed", [0.0, 1e3])
def test_speed_costs_no_engine_its_digits(speed):
    scene = moving_at([[0.1, 0.2], [-0.3, 0.1], [0.2, -0.3]])
    motion = scene.motion
    scene = replace(scene, task=replace(motion, yd=speed * motion.yd, ydd=speed**2 * motion.ydd))
    results = screwgauge.run(scene, engines=ENGINES, quantities=DYNAMICS)
    assert results.pairs["max_scaled"].max() <= THIRTEEN, results.pairs.to_string()


def test_a_chart_lock_costs_nothing_but_its_own_angles():
    scene = moving_at([[WRIST + d, 0.0] for d in (1e-5, 1e-7, 1e-9)])
    results = screwgauge.run(scene, engines=["screw", "truth"])
    truth, screw = results.solutions["truth"], results.solutions["screw"]
    for quantity in (*FORCES, "com_acceleration", "body_angular_acceleration", "body_angular_velocity"):
        assert errors(screw, truth, quantity).max() <= THIRTEEN, quantity
    assert errors(screw, truth, "reaction").max() <= 1e-12  # of a system of condition 1e3
    assert errors(screw, truth, "joint_acceleration").max() > 1e-11


def test_a_motion_beyond_a_singular_pose_is_refused(paper_scene, refused):
    said = refused("run", paper_scene(motion="motion = { a = { offset = 0.1 }, b = { offset = 0.5 } }"))
    for fact in ("t = 0 s", "a = 0.1, b = 0.5", "platform gains a freedom", "leg1.wrist is lost"):
        assert fact in said


@pytest.mark.slow
@pytest.mark.parametrize(
    ("y", "what"),
    [
        ([0.1, UPU - 1e-13], "platform gains a freedom"),
        ([0.0, BASE], "leg3.base locks: leg3.lower, leg3.upper"),
    ],
)
def test_a_singular_pose_is_named(y, what):
    with pytest.raises(SingularPoseError) as caught:
        check_scene(moving_at([y]))
    assert what in str(caught.value)
    assert f"a = {y[0]:.6g}, b = {y[1]:.6g} is singular (condition " in str(caught.value)


def test_the_system_of_all_bodies_keeps_eleven_digits_when_its_residual_is_wide():
    """2e8 N m in leg 1's wrist cancel in actuator forces of 700 N."""
    for seed in (0, 1):
        scene = moving_at(before_upu(CLOSE, 4, seed), seed=seed)
        truth = solve(scene, ["truth"], ["actuator_force"])[0]["truth"].values["actuator_force"].array
        problem = scene.problem(["actuator_force"])
        force = whole_system(layout(scene.mechanism), problem, refined=True).values["actuator_force"].array
        assert np.abs(force - truth).max() / np.abs(truth).max() < THIRTEEN


def test_nothing_is_refined_where_no_closed_form_closes_the_loops():
    scene = load_scene("3ups-upu-s-offset").at([0.3])
    assert wide_force_matrix(layout(scene.mechanism), scene.motion.y) is None
