"""Nothing in the writers knows the paper's mechanism: other joints, other directions, other names."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from support.data import data
from support.errors import DescriptionError
from support.geometry import Array
from support.mechanism import GROUND, Frame, Joint, Mechanism, load_mechanism, mechanism_names
from support.models import (
    check_models,
    check_table,
    home_poses,
    installed_readers,
    joint_transform,
    lay_out,
    read_loops,
    write_mjcf,
    write_models,
)
from support.readings import collapse, read
from support.tolerances import CLOSED, PLACED

FOUR_BAR = data("leaning-four-bar.toml")

REVERSED = data("reversed.toml")

BALL = data("ball-part.toml")


@pytest.fixture
def four_bar(write) -> Mechanism:
    return load_mechanism(write("four-bar.toml", FOUR_BAR))


@pytest.fixture
def reversed_chain(write) -> Mechanism:
    return load_mechanism(write("reversed.toml", REVERSED))


@pytest.fixture
def reversed_loop(write) -> Mechanism:
    mechanism = load_mechanism(write("loop.toml", REVERSED + BALL))
    ball = mechanism.joint("ball")
    T = home_poses(lay_out(mechanism, "minimal"))["tip"] @ joint_transform(ball, ball.home)
    closed = replace(ball, child_frame=Frame(p=T[:3, 3], R=T[:3, :3]))
    return replace(mechanism, joints=(*mechanism.joints[:-1], closed))


def closing_errors(mechanism: Mechanism) -> dict[str, float]:
    poses = home_poses(lay_out(mechanism, "minimal"))
    return {
        joint.name: float(np.abs(poses[joint.parent] @ joint_transform(joint, joint.home) - poses[joint.child]).max())
        for joint in mechanism.joints
    }


def check(mechanism: Mechanism, folder: Path) -> None:
    write_models(mechanism, folder)
    rows = check_models(mechanism, folder)
    assert {row.reading for row in rows} == set(installed_readers())
    assert all(row.ok for row in rows), check_table(rows)


@pytest.mark.parametrize("name", mechanism_names())
def test_built_in_mechanisms_close_at_home(name: str) -> None:
    errors = closing_errors(load_mechanism(name))
    assert max(errors.values()) <= PLACED, errors


def test_four_bar_is_cut_at_a_hinge_as_two_points(four_bar: Mechanism, tmp_path: Path) -> None:
    assert max(closing_errors(four_bar).values()) <= PLACED
    check(four_bar, tmp_path / "out")
    (closure,) = read_loops(tmp_path / "out" / "four-bar.loops.toml").closures
    assert (closure.joint, closure.type, closure.parent, closure.child) == (
        "sole",
        "points",
        "rocker",
        GROUND,
    )
    np.testing.assert_array_equal(closure.parent_points, [[0, 0.25, 0], [0, -0.25, 0]])  # half the longest length
    np.testing.assert_array_equal(closure.child_points, [[0.5, 0.25, 0], [0.5, -0.25, 0]])


@pytest.mark.parametrize("cut", ["minimal", "full"])
def test_four_bar_closures_leave_one_freedom(four_bar: Mechanism, cut: str) -> None:
    mujoco = pytest.importorskip("mujoco")
    model = mujoco.MjModel.from_xml_string(write_mjcf(four_bar, cut))
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_forward(model, data)
    J = data.efc_J.reshape(-1, model.nv)
    assert J.shape == (6, 3 if cut == "minimal" else 4)
    assert model.nv - np.linalg.matrix_rank(J, tol=1e-9) == 1
    assert np.abs(data.efc_pos).max() <= PLACED


def test_copy_of_the_parent_where_the_child_is_ground(four_bar: Mechanism) -> None:
    copy = lay_out(four_bar, "full").links[-1]
    assert (copy.name, copy.near, copy.reverse) == ("rocker@sole", GROUND, True)
    assert copy.body.mass == 0.2


def test_reversed_joints_keep_names_and_values(reversed_chain: Mechanism, tmp_path: Path) -> None:
    tree = lay_out(reversed_chain, "minimal")
    assert tree.coordinates == ("u.q2", "u.q1", "c.q1", "c.q2", "p")
    assert [link.reverse for link in tree.links] == [True, False, True]
    assert not tree.closures
    check(reversed_chain, tmp_path / "out")


def test_reversed_cut_joint(reversed_loop: Mechanism, tmp_path: Path) -> None:
    assert max(closing_errors(reversed_loop).values()) <= PLACED
    check(reversed_loop, tmp_path / "out")
    closure = read_loops(tmp_path / "out" / "reversed-full.loops.toml").closures[0]
    assert (closure.type, closure.parent, closure.child) == ("weld", "tip", "tip@ball")


@pytest.mark.parametrize("cut", ["minimal", "full"])
def test_engines_agree_on_a_reversed_chain_away_from_home(reversed_loop: Mechanism, tmp_path: Path, cut: str) -> None:
    """The coordinates mean the same in URDF, MJCF and description at any value."""
    write_models(reversed_loop, tmp_path)
    stem = "reversed" if cut == "minimal" else "reversed-full"
    values = dict(zip(reversed_loop.coordinates, np.random.default_rng(5).uniform(-1, 1, 8), strict=True))
    moved = replace(
        reversed_loop,
        joints=tuple(
            replace(joint, home=np.array([values[name] for name in joint.coordinates]))
            for joint in reversed_loop.joints
        ),
    )
    expected = home_poses(lay_out(moved, cut))  # the loop is open there: a copy hangs on the ball
    for reading in (
        collapse(read(tmp_path / f"{stem}.urdf", "pinocchio", home=values)),
        read(tmp_path / f"{stem}.xml", "mujoco", home=values),
    ):
        assert set(reading.bodies) == set(expected) - {GROUND}
        for name, body in reading.bodies.items():
            np.testing.assert_allclose(body.pose, expected[name], rtol=0, atol=CLOSED)


def test_a_joint_that_points_cannot_hold_leads_to_a_welded_copy(write) -> None:
    """With one more slide to ground, no S and no R joint is in the loop: of U and C, the last by name closes it."""
    rail = '[joints.rail]\nkind = "P"\nparent = "ground"\nchild = "tip"\naxes = [[1, 0, 0]]\n'
    mechanism = load_mechanism(write("rail.toml", REVERSED + rail))
    for cut in ("minimal", "full"):
        assert [(closure.joint, closure.type) for closure in lay_out(mechanism, cut).closures] == [("u", "weld")]


def test_a_name_that_the_models_need_is_refused(four_bar: Mechanism) -> None:
    body = replace(four_bar.body("coupler"), name="rocker@sole")
    joints = tuple(
        replace(
            joint,
            parent=joint.parent.replace("coupler", "rocker@sole"),
            child=joint.child.replace("coupler", "rocker@sole"),
        )
        for joint in four_bar.joints
    )
    bodies = (four_bar.bodies[0], body, four_bar.bodies[2])
    with pytest.raises(DescriptionError, match=r"'rocker@sole' is reserved"):
        lay_out(replace(four_bar, bodies=bodies, joints=joints), "full")


def _chain_pose(joints: list[Joint], q: Array) -> Array:
    T, used = np.eye(4), 0
    for joint in joints:
        n = len(joint.coordinates)
        T, used = T @ joint_transform(joint, q[used : used + n]), used + n
    return T


@pytest.mark.parametrize(("name", "least", "most"), [("3ups-upu-s", 0.0, CLOSED), ("3ups-upu-s-offset", 1e-3, 0.1)])
def test_third_rotation_is_zero_only_without_offset(name: str, least: float, most: float) -> None:
    """Leg 1 and the S joint at O reach the same pose: Newton for leg 1 and c at given (a, b)."""
    mechanism = load_mechanism(name)
    leg, ball = (
        [mechanism.joint(f"leg1.{role}") for role in ("base", "slide", "wrist")],
        [mechanism.joint("s")],
    )

    def gap(x: Array) -> Array:
        difference = _chain_pose(leg, x[:5]) - _chain_pose(ball, np.array([0.15, -0.1, x[5]]))
        return difference[:3].ravel()

    x = np.concatenate([*(joint.home for joint in leg), [0.0]])
    for _ in range(20):
        h = 1e-6
        J = np.stack([(gap(x + h * e) - gap(x - h * e)) / (2 * h) for e in np.eye(6)], axis=1)
        x = x - np.linalg.lstsq(J, gap(x), rcond=None)[0]
    assert np.abs(gap(x)).max() < CLOSED
    assert least <= abs(x[5]) <= most, x[5]
