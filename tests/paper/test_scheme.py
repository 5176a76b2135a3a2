import numpy as np
import pytest
from paper import scheme
from paper.case import every
from paper.erratum import about

import screwgauge
from screwgauge.models.catalog import load_mechanism
from screwgauge.reference.closed.assembly_mode import positions
from screwgauge.reference.closed_motion import motion_at
from screwgauge.reference.equations.kinematics import pose
from screwgauge.reference.errors import DescriptionError, UnknownNameError
from screwgauge.reference.graph import layout
from screwgauge.study.bench.scheme import PARTS, chains, integrate, platform_screws
from support.data import DATA
from support.tolerances import ROUNDING

SCENE = screwgauge.load_scene("3ups-upu-s")
DURATION = 2.0


@pytest.fixture(scope="module", params=["3ups-upu-s", "3ups-upu-s-table2", "3ups-upu-s-offset"])
def lay(request):
    return layout(load_mechanism(request.param))


@pytest.mark.slow
def test_7_the_upu_chain_cannot_make_the_printed_twist(case):
    left_over, at_2_s, most = scheme.units(case)
    assert left_over.printed.value == about(1.86e-2)
    assert left_over.right.value < ROUNDING
    assert at_2_s.printed.value == pytest.approx(0.162, abs=5e-4)
    assert at_2_s.right.value == pytest.approx(0.182, abs=5e-4)
    assert most.effect > at_2_s.effect
    assert most.right.value < ROUNDING


@pytest.mark.slow
def test_8_a_shorter_step_mends_the_right_twist_only(runs):
    ups, attitude, order, upu, floor = scheme.steps_in_time(runs)
    assert ups.effect == about(4.4e-5)
    assert attitude.effect == about(1.07e-4)
    assert upu.effect == about(0.032)
    assert max(ups.right.value, attitude.right.value, upu.right.value) < 1e-11  # RK4 at 10 ms: 1e-12
    assert order.printed.value == pytest.approx(1.0, rel=0.1)
    assert order.right.value == pytest.approx(4.0, rel=0.1)
    assert floor.printed.value == pytest.approx(1.0, abs=0.1)
    assert floor.right.value == pytest.approx(0.1, rel=0.1)


def sampled(step, method, start=0.0):
    part = step / PARTS[method]
    return SCENE.moved(start + np.arange(round(DURATION / part) + 1) * part)


def closed(lay, t):
    motion = SCENE.moved(t)
    at = motion_at(lay, positions(lay, motion.y, t), motion.yd, motion.ydd)
    return at.q, at.joint_velocity, at.joint_acceleration


def errors(lay, steps, twist="right", method="euler"):
    motions = [sampled(step, method) for step in steps]
    runs = [(motion.t[:: PARTS[method]], integrate(lay, motion, twist=twist, method=method)[0]) for motion in motions]
    return np.array([np.abs(q - closed(lay, t)[0]).max() for t, q in runs])


@pytest.mark.slow
def test_euler_with_the_right_twist_is_of_order_one(lay):
    steps = [0.1, 0.05, 0.025]
    assert scheme.order(steps, errors(lay, steps)) == pytest.approx(1.0, rel=0.1)


@pytest.mark.slow
def test_rk4_with_the_right_twist_is_of_order_four(lay):
    steps = [0.2, 0.1, 0.05]
    assert scheme.order(steps, errors(lay, steps, method="rk4")) == pytest.approx(4.0, rel=0.1)


@pytest.mark.slow
@pytest.mark.parametrize("twist", ["printed", "literal"])
@pytest.mark.parametrize("method", ["euler", "rk4"])
def test_the_printed_twist_ends_on_a_floor(lay, twist, method):
    long, short = errors(lay, [0.02, 0.005], twist, method)
    assert min(long, short) > 5e-3
    assert long / short == pytest.approx(1.0, abs=0.1)


@pytest.mark.slow
@pytest.mark.parametrize("start", [0.0, 3.0])
def test_rates_and_accelerations_follow_the_positions(lay, start):
    motion = sampled(0.02, "rk4", start)
    for made, right in zip(integrate(lay, motion, method="rk4"), closed(lay, motion.t[::2]), strict=True):
        assert np.abs(made - right).max() < 5e-9


def test_every_chain_puts_the_platform_where_the_closed_mechanism_has_it(lay):
    t = every(1.0)
    q = positions(lay, SCENE.moved(t).y, t)
    at = pose(lay, q)
    side = chains(lay)
    S, R, p = side.walk(side.gather(q))
    assert np.abs(side.scatter(side.gather(q), q.shape[1]) - q).max() == 0.0
    assert np.abs(R - at.R[:, None, -1]).max() < 1e-14
    assert np.abs(p - at.p[:, None, -1]).max() < 1e-14
    for k in range(6):
        assert np.abs(side.scatter(S[..., k], q.shape[1]) - at.S[..., k]).max() < 1e-15


def test_the_right_twist_is_that_of_the_closed_mechanism(lay):
    motion = SCENE.moved(every(1.0))
    at = motion_at(lay, positions(lay, motion.y, motion.t), motion.yd, motion.ydd)
    V, A = platform_screws(lay, motion)
    assert np.abs(V - at.V[:, -1]).max() < 1e-15
    assert np.abs(A - at.A[:, -1]).max() < 1e-15


def test_unknown_names_are_refused(lay):
    with pytest.raises(UnknownNameError, match="rk4"):
        integrate(lay, sampled(0.1, "rk4"), method="rk5")
    with pytest.raises(UnknownNameError, match="printed"):
        integrate(lay, sampled(0.1, "euler"), twist="wrong")


@pytest.mark.parametrize(("method", "samples"), [("euler", 1), ("rk4", 1), ("rk4", 2), ("rk4", 4)])
def test_a_motion_of_no_whole_steps_is_refused(lay, method, samples):
    with pytest.raises(DescriptionError, match=f"{samples} samples do not make whole steps of {method}"):
        integrate(lay, SCENE.moved(0.1 * np.arange(samples)), method=method)


def test_a_mechanism_without_serial_chains_is_refused():
    with pytest.raises(DescriptionError, match="platform"):
        chains(layout(load_mechanism(DATA / "four-bar.toml")))
