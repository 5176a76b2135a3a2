import numpy as np
import pytest
from test_any_cut import MECHANISMS, described

import screwgauge
from support.engines import Method, model_files
from support.equations import JointPose, closure_residual, constraint_wrenches
from support.geometry import rotation, screws
from support.mechanism import load_mechanism, spanning_tree
from support.solve import LoopEquations, home_equations, layout, posed, positions, read
from support.tolerances import CLOSED, DIFFERENCE, LINEAR

STEP = 1e-6
#: Mechanism, joint that is cut, its kind.
CASES = [
    ("slider-crank", "d", "P"),
    ("five-bar", "b", "P"),
    ("3-upu", "s1", "P"),
    ("3-upu", "v2", "U"),
    ("uuuu", "c", "U"),
    ("rccc", "c", "C"),
    ("stewart", "s3", "P"),
    ("planar loop", "e", "E"),
    ("ruer", "e", "E"),
    ("rcep", "e", "E"),
    ("3-rre", "e1", "E"),
]
#: Others that only compiled programs are asked about.
TRACED = [*CASES, ("rccc", "a", "R"), ("stewart", "v0", "S")]


@pytest.fixture(params=CASES, ids=lambda case: f"{case[0]}, {case[1]}")
def cut(request, tmp_path):
    name, joint, kind = request.param
    described(name, tuple(MECHANISMS[name][1]), tmp_path)
    mechanism = load_mechanism(tmp_path / "mechanism.toml")
    tree = spanning_tree(mechanism, [each.name for each in mechanism.joints if each.name != joint])
    assert joint in {each.name for each in tree.cuts}
    assert mechanism.joint(joint).kind == kind
    y = mechanism.home[mechanism.independent_columns] + 0.02 * np.arange(1, 1 + len(mechanism.independent))
    return LoopEquations(tree), posed(layout(mechanism), *y)


def test_errors_vanish_where_loops_close_and_change_as_their_derivative_says(cut):
    equations, q = cut
    independent = equations.lay.mechanism.independent_columns
    z, y = equations.unknowns(q), (q / equations.sizes)[:, independent]
    errors, matrix = equations.evaluate(z, y)
    assert np.abs(errors).max() < CLOSED
    steps = STEP * np.eye(z.shape[1])
    ahead, behind = (equations.evaluate(z + sign * steps, np.repeat(y, len(steps), axis=0))[0] for sign in (1, -1))
    assert np.abs((ahead - behind).T / (2 * STEP) - matrix[0]).max() < DIFFERENCE


def test_all_samples_close_to_rounding(tmp_path):
    """Newton's method first increases a residual of 1e-12."""
    scene = screwgauge.random(1, "rccc", tmp_path)
    motion = scene.at(np.linspace(scene.t[0], scene.t[-1], 300)).motion
    lay = layout(scene.mechanism)
    q, system = positions(lay, motion.y, motion.t, (motion.yd, motion.ydd)), home_equations(lay)
    assert np.abs(system.closing_system(q).residual(motion.y)).max() < 1e-14


def test_coordinates_of_the_cut_joint_are_read_from_its_two_bodies(cut):
    equations, q = cut
    lay, guess = equations.lay, q.copy()
    guess[:, lay.cut_columns] += 0.3
    assert np.abs(read(lay, guess) - q).max() < LINEAR
    assert np.abs(q[:, lay.cut_columns]).max() > 1e-3


def opened(joint, q, twist):
    M, d = np.eye(3), np.zeros(3)
    for (turns, axis), value in zip(joint.freedoms, q, strict=False):
        M, d = (M @ rotation(axis, np.array(value)), d) if turns else (M, d + M @ axis * value)
    angle = np.linalg.norm(twist[:3])
    turned = rotation(twist[:3] / angle, angle) if angle else np.eye(3)
    return JointPose(joint, np.eye(3), np.zeros(3), turned @ M, turned @ d + twist[3:])


@pytest.mark.parametrize(("name", "joint"), [(name, joint) for name, joint, _ in TRACED])
def test_every_type_of_joint_is_open_by_errors_whose_derivatives_are_its_wrenches(name, joint, tmp_path):
    described(name, tuple(MECHANISMS[name][1]), tmp_path)
    joint, q = load_mechanism(tmp_path / "mechanism.toml").joint(joint), [0.3, -0.4, 0.2]
    at = opened(joint, q, np.zeros(6))
    assert np.abs(closure_residual(at)).max() < CLOSED
    for twist in np.eye(6):
        ahead, behind = (closure_residual(opened(joint, q, sign * STEP * twist)) for sign in (1, -1))
        power = screws.power(constraint_wrenches(at), twist)
        assert (ahead - behind) / (2 * STEP) == pytest.approx(power, abs=DIFFERENCE)


@pytest.mark.parametrize("engine", ["pinocchio", "mujoco"])
def test_rows_of_engines_are_the_derivative_of_gaps_that_are_open(engine):
    """At a lock, rates would be unbounded."""
    closed = Method(engine, {}).load(model_files("3ups-upu-s", engine)).closed
    loops, poses = closed.loops, closed.tree.poses
    q = closed.home[None] + 0.1 * np.cos(np.arange(len(closed.home)))
    steps = STEP * np.eye(q.shape[1])
    change = (loops.gaps(poses(q + steps)) - loops.gaps(poses(q - steps))).T / (2 * STEP)
    points = np.repeat([not anchor.angular for anchor in loops.anchors], 3)
    assert points.any()
    assert np.abs(loops.gaps(poses(q))[:, points]).max() > 0.01
    assert np.abs(change - loops.jacobian(poses(q))[0])[points].max() < DIFFERENCE
