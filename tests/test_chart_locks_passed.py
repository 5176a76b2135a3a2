from functools import cache

import numpy as np
import pytest

from screwgauge.engines.tree.cut_joints import read_chart
from screwgauge.reference.equations.joint_types import SURE
from support.acting import GRAVITY, Applied, hold
from support.engines import MOTION, Problem, ask, model_files, simulate
from support.errors import ClosureError
from support.geometry import follow, rotation
from support.mechanism import load_mechanism
from support.scene import GivenMotion, InitialValue
from support.tolerances import BY_LOCK, FALLEN, FAST_DIFFERENCE, READ

pytestmark = pytest.mark.slow

NAME = "3ups-upu-s"


@cache
def fall(engine, start, rates, until, torque=0.0):
    applied = Applied(np.array(GRAVITY), motors=hold({"s.q2": torque} if torque else {}))
    times = np.linspace(0.0, until, 1 + round(until / 0.05))
    task = InitialValue(np.array(start), np.array(rates), 0.0, times)
    return simulate(engine, model_files(NAME, engine), applied, task)


def joint(name):
    return next(joint for joint in load_mechanism(NAME).joints if joint.name == name)


def column(coordinate):
    return load_mechanism(NAME).coordinates.index(coordinate)


def turned(axes, angles):
    R = np.tile(np.eye(3), (len(angles), 1, 1))
    for axis, angle in zip(axes, angles.T, strict=True):
        R = R @ rotation(axis, angle)
    return R


def read(joint, R):
    return read_chart(joint, np.tile(np.eye(3), (len(R), 1, 1)), joint.parent_frame.R @ R @ joint.child_frame.R.T)


#: Name -> start, rates, end [s] and torque [N m].
FALLS = {
    "through b = pi/2": ((0.0, 1.45), (0.0, 1.0), 0.15, 0.0),
    "aslant": ((0.1, 1.45), (0.4, 1.0), 0.15, 0.0),
    "from beyond": ((0.1, 2.0), (0.0, 1.0), 0.1, 0.0),
    "from beyond a wrist's lock": ((-0.0107, -0.77), (0.0, 1.0), 0.1, 0.0),
    "driven beyond": ((0.1, 2.0), (0.0, 0.5), 0.1, 20.0),
}


@pytest.mark.sampled(3)
@pytest.mark.slow
@pytest.mark.parametrize("engine", ["pinocchio", "mujoco"])
@pytest.mark.parametrize("name", FALLS)
def test_a_fall_through_the_lock_is_read_alike(name, engine):
    expected, found = fall("screw", *FALLS[name]), fall(engine, *FALLS[name])
    assert (expected.stopped, found.stopped) == ("", "")
    assert expected.q[:, [column("s.q2"), column("leg3.q5")]].max() > np.pi / 2  # middle angles
    for what, error in FALLEN.items():
        assert np.abs(getattr(found, what) - getattr(expected, what)).max() < error, what


def given(first, last):
    t, far = np.linspace(0.0, 1.0, 12), last - first
    y = np.stack([0.1 + 0.2 * t + 0.1 * t**2, first + far * (1.2 * t - 0.2 * t**2)], axis=1)
    yd, ydd = np.stack([0.2 + 0.2 * t, far * (1.2 - 0.4 * t)], axis=1), np.tile([0.2, -0.4 * far], (len(t), 1))
    return GivenMotion(t, y, yd, ydd)


@pytest.mark.sampled(3)
@pytest.mark.slow
@pytest.mark.parametrize("engine", ["pinocchio", "mujoco"])
@pytest.mark.parametrize("b", [(0.7, 0.9), (1.65, 1.9)])
def test_a_given_motion_that_starts_beyond_singular_poses_is_on_the_branch_that_goes_straight_on(b, engine):
    """The middle base joint has (a, b, 0)."""
    motion = given(*b)
    found = ask(engine, model_files(NAME, engine), Problem(Applied(), motion, MOTION)).values
    own = slice(column("s.q1"), column("s.q3") + 1)
    for what, known in (
        ("joint_position", motion.y),
        ("joint_velocity", motion.yd),
        ("joint_acceleration", motion.ydd),
    ):
        error = found[what].array[:, own] - np.column_stack([known, 0.0 * motion.t])
        assert np.abs(error).max() < 1e-12, what


@pytest.mark.slow
@pytest.mark.parametrize("engine", ["pinocchio", "mujoco"])
def test_a_given_motion_through_the_lock_of_its_own_angles_is_refused(engine):
    """At b = pi/2 any split of a between the first and last angle closes the loops."""
    with pytest.raises(ClosureError, match=r"beyond y = \[0.15.* 1.570"):
        ask(engine, model_files(NAME, engine), Problem(Applied(), given(1.35, 2.15), MOTION))


def path(n):
    t = np.linspace(-1.0, 1.0, n)
    q = np.stack([0.3 + 2.0 * t, np.pi / 2 + 2.2 * np.pi * t, -0.2 + np.sin(3.0 * t)], axis=1)
    v = np.stack([0.0 * t + 2.0, 0.0 * t + 2.2 * np.pi, 3.0 * np.cos(3.0 * t)], axis=1)
    return t, q, v, np.stack([0.0 * t, 0.0 * t, -9.0 * np.sin(3.0 * t)], axis=1)


@pytest.mark.parametrize("n", [9, 15, 201])
def test_a_sample_at_a_lock_spoils_no_later_one(n):
    """Nine samples 99 degrees apart: unpredicted, the second triples would be nearer."""
    ball = joint("s")
    t, q, v, _ = path(n)
    chart = read(ball, turned(ball.axes, q))
    sure = chart.condition < SURE
    assert list(np.flatnonzero(~sure)) == [n // 2]
    assert np.abs(chart.q - q)[sure].max() > 1.0
    rates = chart.rates(angular(ball, q, v)[..., None])[..., 0]
    rates[~sure] = np.nan
    found = follow(q[0], chart.q, sure, t + 50.0, rates)
    assert np.abs(found - q)[sure].max() < READ * BY_LOCK
    assert np.abs(found - q).max() < 2.0  # the lock leaves two angles open, but not whole turns
    assert np.abs(turned(ball.axes, found) - turned(ball.axes, q)).max() < 1e-13
    assert np.isfinite(found).all()


def angular(joint, q, v):
    omega, R = np.zeros((len(q), 3)), np.tile(np.eye(3), (len(q), 1, 1))
    for axis, angle, rate in zip(joint.axes, q.T, v.T, strict=True):
        omega += (R @ axis) * rate[:, None]
        R = R @ rotation(axis, angle)
    return omega @ joint.parent_frame.R.T


def test_rates_and_accelerations_belong_to_the_triple_chosen():
    ball, h = joint("s"), 1e-5
    _, q, v, a = path(20)  # no sample at a lock
    chart = read(ball, turned(ball.axes, q)).near(q)
    assert np.abs(chart.q - q).max() < READ * BY_LOCK
    omega = angular(ball, q, v)
    beta = (angular(ball, q + h * v, v + h * a) - angular(ball, q - h * v, v - h * a)) / (2.0 * h)
    rates = chart.rates(omega[..., None])[..., 0]
    assert np.abs(rates - v).max() < READ * BY_LOCK * 10.0
    assert np.abs(chart.bias(rates, np.zeros_like(omega), omega, beta) - a).max() < FAST_DIFFERENCE


def test_an_independent_angle_chooses_its_triple():
    ball = joint("s")
    _, q, _, _ = path(20)
    chart = read(ball, turned(ball.axes, q))
    for i in range(3):
        off = chart.with_angle(i, q[:, i]).q[:, i] - q[:, i]
        assert np.abs(off - 2.0 * np.pi * np.round(off / (2.0 * np.pi))).max() < READ * BY_LOCK
