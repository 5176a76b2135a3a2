"""The paper's own scheme: mended it converges, as printed it ends on a floor."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np
import pytest

import screwgauge
from screwgauge.models.catalog import load_mechanism
from screwgauge.reference.errors import DescriptionError, UnknownNameError
from screwgauge.reference.kinematics import accelerations, positions, velocities
from screwgauge.reference.paper import scheme as paper
from screwgauge.reference.paper import twist as paper_twist
from screwgauge.reference.pose import layout
from support.tolerances import CLOSED

DRIVE = screwgauge.load_scene("3ups-upu-s").drive
DATA = Path(__file__).parent / "data"
DURATION = 2.0


@pytest.fixture(scope="module", params=["3ups-upu-s", "3ups-upu-s-table2", "3ups-upu-s-offset"])
def lay(request):
    return layout(load_mechanism(request.param))


def closed(lay, t):
    """Joint coordinates, rates and accelerations of the closed mechanism."""
    motion = DRIVE(t)
    rate = velocities(lay, positions(lay, motion.y, t), motion.yd)
    return rate.pose.q, rate.w, accelerations(lay, rate, motion.ydd)[0]


def errors(lay, steps, **settings):
    """Largest error of the joint coordinates at each step."""
    runs = [paper.integrate(lay, DRIVE, step, DURATION, **settings) for step in steps]
    return np.array([np.abs(run.q - closed(lay, run.t)[0]).max() for run in runs])


def slope(steps, found):
    return np.polyfit(np.log(steps), np.log(found), 1)[0]


def test_euler_with_the_right_twist_is_of_order_one(lay):
    steps = [0.1, 0.05, 0.025]
    assert slope(steps, errors(lay, steps)) == pytest.approx(1.0, rel=0.1)


def test_rk4_with_the_right_twist_is_of_order_four(lay):
    steps = [0.2, 0.1, 0.05]
    assert slope(steps, errors(lay, steps, method="rk4")) == pytest.approx(4.0, rel=0.1)


@pytest.mark.parametrize("twist", ["printed", "literal"])
@pytest.mark.parametrize("method", ["euler", "rk4"])
def test_the_printed_twist_ends_on_a_floor(lay, twist, method):
    found = errors(lay, [0.02, 0.005], twist=twist, method=method)
    assert found.min() > 5e-3
    assert found[0] / found[1] == pytest.approx(1.0, abs=0.1)


def test_rates_and_accelerations_follow_the_positions(lay):
    run = paper.integrate(lay, DRIVE, 0.02, DURATION, method="rk4")
    for found, right in zip((run.q, run.w, run.beta), closed(lay, run.t), strict=True):
        assert np.abs(found - right).max() < 5e-9


def test_every_chain_puts_the_platform_where_the_closed_mechanism_has_it(lay):
    t = np.linspace(0.0, 10.0, 11)
    at = positions(lay, DRIVE(t).y, t)
    side = paper.chains(lay)
    S, R, p = side.walk(side.gather(at.q))
    assert np.abs(side.scatter(side.gather(at.q), at.q.shape[1]) - at.q).max() == 0.0
    assert np.abs(R - at.R[:, None, -1]).max() < 1e-14
    assert np.abs(p - at.p[:, None, -1]).max() < 1e-14
    for k in range(6):
        assert np.abs(side.scatter(S[..., k], at.q.shape[1]) - at.S[..., k]).max() < 1e-15


def test_the_right_twist_is_that_of_the_closed_mechanism(lay):
    t = np.linspace(0.0, 10.0, 11)
    motion = DRIVE(t)
    rate = velocities(lay, positions(lay, motion.y, t), motion.yd)
    V, A = paper_twist.platform_screws(lay, motion, t)
    assert np.abs(V - rate.V[:, -1]).max() < 1e-15
    assert np.abs(A - accelerations(lay, rate, motion.ydd)[1][:, -1]).max() < 1e-15


def test_every_chain_carries_its_bodies_as_the_closed_mechanism_moves_them(lay):
    t = np.linspace(0.0, 10.0, 11)
    motion = DRIVE(t)
    rate = velocities(lay, positions(lay, motion.y, t), motion.yd)
    right, A = accelerations(lay, rate, motion.ydd)
    side = paper.chains(lay)
    S = side.walk(side.gather(rate.pose.q))[0]
    beta, along = paper.chain_accelerations(side, S, side.gather(rate.w), A[:, -1])
    assert np.abs(side.scatter(beta, right.shape[1]) - right).max() < CLOSED
    assert np.abs(along[:, :, -1] - A[:, None, -1]).max() < CLOSED


def test_a_run_may_start_anywhere_and_finds_given_times(lay):
    run = paper.integrate(lay, DRIVE, 0.1, DURATION, start=3.0, method="rk4")
    assert run.t[0] == 3.0
    assert run.t[-1] == pytest.approx(5.0)
    mine, given = run.rows(np.array([2.0, 3.2, 3.25, 5.0]))
    assert given.tolist() == [1, 3]
    assert run.t[mine] == pytest.approx([3.2, 5.0])


def test_unknown_names_are_refused(lay):
    run = partial(paper.integrate, lay, DRIVE, 0.1, 1.0)
    with pytest.raises(UnknownNameError, match="rk4"):
        run(method="rk5")
    with pytest.raises(UnknownNameError, match="printed"):
        run(twist="wrong")


def test_a_mechanism_without_serial_chains_is_refused():
    with pytest.raises(DescriptionError, match="platform"):
        paper.chains(layout(load_mechanism(DATA / "four-bar.toml")))


@pytest.mark.parametrize("step", [0.0, -0.1, 2.0, float("nan")])
def test_a_step_that_is_none_is_refused(lay, step):
    with pytest.raises(DescriptionError, match="step"):
        paper.integrate(lay, DRIVE, step, 1.0)
