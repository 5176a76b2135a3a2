import numpy as np
import pytest

from support.at_origin import acceleration_at
from support.geometry import screws
from support.mechanism import load_mechanism, serial_chains
from support.solve import assembly_mode, chain_acceleration, chain_screws, gaps, layout, moved, positions
from support.tolerances import CLOSED, DIFFERENCE, ROUNDING, TWENTY_DIGITS


def motion(t):
    """Eq. (59)."""
    y = np.stack([0.2 - 0.2 * np.cos(t), 0.1 * np.sin(t)], axis=1)
    yd = np.stack([0.2 * np.sin(t), 0.1 * np.cos(t)], axis=1)
    ydd = np.stack([0.2 * np.cos(t), -0.1 * np.sin(t)], axis=1)
    return y, yd, ydd


@pytest.fixture(params=["3ups-upu-s", "3ups-upu-s-offset", "3ups-upu-s-table2"])
def lay(request):
    return layout(load_mechanism(request.param))


T = np.linspace(0.0, 10.0, 23)


def joints(lay, t):
    return positions(lay, motion(t)[0], t)


def at(lay, t):
    return moved(lay, *motion(t))


def test_loops_close_to_rounding(lay):
    assert np.abs(gaps(lay, joints(lay, T))).max() < CLOSED


def test_home_pose_is_the_start_of_the_path(lay):
    assert joints(lay, np.zeros(1))[0] == pytest.approx(lay.mechanism.home, abs=ROUNDING)


def test_newton_and_closed_form_agree(lay, monkeypatch):
    closed = joints(lay, T)
    monkeypatch.setattr(assembly_mode, "closed_form", lambda *given: None)
    assert np.abs(joints(lay, T) - closed).max() < ROUNDING


def test_third_rotation_vanishes_only_for_the_symmetric_leg(lay):
    c = joints(lay, T)[:, lay.mechanism.coordinates.index("s.q3")]
    if lay.mechanism.name == "3ups-upu-s-offset":
        assert np.abs(c).max() > 1e-3
    else:
        assert np.abs(c).max() < TWENTY_DIGITS


def test_rates_are_derivatives_of_positions(lay):
    h = 1e-5
    found = at(lay, T).joint_velocity
    assert np.abs((joints(lay, T + h) - joints(lay, T - h)) / (2 * h) - found).max() < DIFFERENCE


def test_accelerations_are_derivatives_of_rates(lay):
    def w(t):
        return at(lay, t).joint_velocity

    h = 1e-5
    found = at(lay, T).joint_acceleration
    assert np.abs((w(T + h) - w(T - h)) / (2 * h) - found).max() < DIFFERENCE


def chain_velocities(S, V):
    """Joint velocities of a serial chain from its end's twist, eq. (15), and the residual. Shapes (n, 6, m), (n, 6) ->
    (n, m), (n,).
    """
    w = (np.linalg.pinv(S) @ V[..., None])[..., 0]
    return w, np.linalg.norm((S @ w[..., None])[..., 0] - V, axis=-1)


def test_every_chain_carries_the_platform_by_eq_15_and_eq_44(lay):
    now = at(lay, T)
    platform = lay.mechanism.body_index["platform"]
    for chain in serial_chains(lay.mechanism):
        S = chain_screws(lay, now.q, chain)
        columns = [column for edge in chain for column in lay.columns[edge.joint.name]]
        w, residual = chain_velocities(S, now.V[:, platform])
        assert residual.max() < ROUNDING
        assert np.abs(w - now.joint_velocity[:, columns]).max() < ROUNDING
        found = chain_acceleration(S, now.joint_velocity[:, columns], now.joint_acceleration[:, columns])
        assert np.abs(found - now.A[:, platform]).max() < ROUNDING


def test_a_twist_outside_the_range_of_a_chain_is_reported(paper):
    """Eq. (60) as printed: the UPU leg does not allow its platform twist."""
    lay = layout(paper)
    t = np.linspace(0.1, 6.0, 50)
    y, yd, _ = motion(t)
    printed = np.zeros((len(t), 6))
    printed[:, :2] = yd
    leg1 = serial_chains(paper)[0]
    _, residual = chain_velocities(chain_screws(lay, positions(lay, y, t), leg1), printed)
    assert residual.max() > 1e-3


def test_point_accelerations_are_derivatives_of_point_velocities(paper):
    lay = layout(paper)

    def point_velocity(t):
        now = at(lay, t)
        r = now.pose.p[:, 3] + now.pose.R[:, 3] @ np.array([0.1, -0.2, 0.3])
        return now.V[:, 3], r, now.A[:, 3]

    h = 1e-5
    V, r, A = point_velocity(T)
    found = acceleration_at(V, A, r)
    ahead, behind = (screws.velocity_at(*point_velocity(T + s)[:2]) for s in (h, -h))
    assert np.abs((ahead - behind) / (2 * h) - found).max() < DIFFERENCE
