from functools import partial

import numpy as np
import pytest

from support.acting import Applied, Course, JointSpring, Motor
from support.data import DATA, data
from support.errors import DescriptionError, UnknownNameError
from support.mechanism import load_mechanism
from support.solve import METHODS, BranchPose, integrate, layout, positions
from support.tolerances import CLOSED, LINEAR

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def pendulum():
    return layout(load_mechanism(DATA / "pendulum.toml"))


@pytest.fixture(scope="module")
def sprung(pendulum):
    applied = Applied(springs=(JointSpring("b", 20.0, damping=1.0),))
    return partial(integrate, pendulum, applied, np.array([0.0, 0.1, 0.35]), start=np.array([0.4, 0.3]))


@pytest.fixture(scope="module")
def best(sprung):
    return sprung(rtol=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("method", METHODS)
def test_all_methods_give_the_same_motion(sprung, best, method):
    found, times = sprung(name=method, rtol=1e-7, atol=1e-8), [0.0, 0.1, 0.35]
    assert found.t.tolist() == times
    assert np.abs(found.rates.q - best.rates.q).max() < 2e-6
    assert np.array_equal(found.rates.q[0], [0.4, 0.3])


@pytest.mark.slow
def test_forces_may_depend_on_time(pendulum):
    """1 kg at 1 m: its angle integrates the torque twice."""
    torque = Motor("b", Course(np.zeros(1), np.array([[9.0, 0.0, 5.0]])))
    held = integrate(
        pendulum,
        Applied(gravity=np.zeros(3), motors=(torque,)),
        np.linspace(0.0, 1.0, 5),
        rtol=1e-11,
    )
    assert held.stopped == ""
    b = 5.0 / 9.0 * (held.t - np.sin(9.0 * held.t) / 9.0)
    assert np.abs(held.rates.q[:, 1] - b).max() < LINEAR


@pytest.mark.slow
def test_singular_poses_are_stepped_over_when_met():
    """With a wide margin, condition 1000 or 0.006 rad, steps do meet them."""
    found = integrate(
        layout(load_mechanism("a02-fourbar-2")),
        Applied(gravity=np.array([0.0, -9.81, 0.0])),
        np.array([0.0, 3.5]),
        yd=np.array([-1.0]),
        rtol=1e-9,
        atol=1e-9,
        near=1000.0,
    )
    assert found.stopped == ""
    assert found.stepped_over > 0
    assert abs(found.energy[-1] - found.energy[0]) < 3e-6


@pytest.mark.slow
def test_where_the_coordinate_turns_back_what_was_computed_is_kept(write):
    """At dead centre the piston no longer determines the crank."""
    lay = layout(load_mechanism(write("dead-centre.toml", data("dead-centre.toml"))))
    times = np.linspace(0.0, 2.0, 81)
    found = integrate(lay, Applied(gravity=np.zeros(3)), times, yd=np.array([1.0]), rtol=1e-8)
    assert found.stopped != ""
    assert 5 < len(found.t) < len(times)
    assert np.isfinite(found.rates.joint_velocity).all()
    assert found.rates.q[-1, -1] < 0.9  # crank and rod in line
    assert np.abs(found.energy - found.energy[0]).max() < 1e-6 * found.energy[0]


def test_a_branch_is_that_of_the_poses_followed_from_home(paper):
    lay = layout(paper)
    y = np.stack([np.linspace(0.0, 0.3, 7), np.linspace(0.0, -0.2, 7)], axis=1)
    found = BranchPose(lay, paper.home).joints(y)
    assert np.abs(found - positions(lay, y, np.zeros(7))).max() < CLOSED


def test_bad_input_is_said(pendulum):
    times = np.array([0.0, 1.0])
    with pytest.raises(UnknownNameError, match=r"unknown method 'RK45'"):
        integrate(pendulum, Applied(), times, name="RK45")
    with pytest.raises(DescriptionError, match="times must increase"):
        integrate(pendulum, Applied(), np.array([0.0, 0.0]))
    with pytest.raises(DescriptionError, match=r"shape \(2,\).* got shape \(3,\)"):
        integrate(pendulum, Applied(), times, start=np.zeros(3))
    with pytest.raises(DescriptionError, match="2 independent coordinates"):
        integrate(pendulum, Applied(), times, yd=np.array([0.0, np.nan]))
    with pytest.raises(DescriptionError, match=r"rtol = -1, atol = 1e-12; use"):
        integrate(pendulum, Applied(), times, rtol=-1.0)
