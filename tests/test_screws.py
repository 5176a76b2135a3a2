import numpy as np
import pytest

from support.equations import triad
from support.geometry import revolute, rotation, screws, sequence_angles, skew, vee
from support.mechanism import Joint
from support.solve import chain_acceleration
from support.tolerances import DIFFERENCE, ROUNDING


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(20230319)


def test_revolute_screw_leaves_its_axis_at_rest(rng):
    e, r = np.array([0.6, 0.0, 0.8]), rng.normal(size=3)
    S = revolute(e, r)
    assert np.abs(screws.velocity_at(S, r + 2.5 * e)).max() < ROUNDING


def test_lie_bracket_satisfies_jacobi_and_antisymmetry(rng):
    a, b, c = rng.normal(size=(3, 6))
    bracket = screws.lie_bracket
    assert np.abs(bracket(a, b) + bracket(b, a)).max() < ROUNDING
    cycle = bracket(a, bracket(b, c)) + bracket(b, bracket(c, a)) + bracket(c, bracket(a, b))
    assert np.abs(cycle).max() < ROUNDING


def test_lie_bracket_is_the_rate_of_a_screw_carried_by_a_twist(rng):
    """d/dt Ad(exp(V t)) S = [V, S] at t = 0."""
    axis = np.array([0.0, 0.6, 0.8])
    V, e, r, h = (
        revolute(axis, rng.normal(size=3)),
        np.array([1.0, 0.0, 0.0]),
        rng.normal(size=3),
        1e-5,
    )
    at = np.cross(axis, V[3:])  # a point of the axis of V

    def carried(t: float) -> np.ndarray:
        R = rotation(axis, np.array(t))
        return revolute(R @ e, at + R @ (r - at))

    assert np.abs((carried(h) - carried(-h)) / (2 * h) - screws.lie_bracket(V, carried(0.0))).max() < 0.1 * DIFFERENCE


def test_reciprocal_product_is_power_at_any_point(rng):
    f, m, r, twist = rng.normal(size=3), rng.normal(size=3), rng.normal(size=3), rng.normal(size=6)
    wrench = screws.force(f, r) + screws.couple(m)
    power = f @ screws.velocity_at(twist, r) + m @ twist[:3]
    assert screws.power(wrench, twist) == pytest.approx(power, abs=ROUNDING)


def test_acceleration_of_a_chain_is_the_derivative_of_its_twist(rng):
    """Eqs. (44) and (48), two revolute axes."""
    first, second = np.array([0.0, 0.0, 1.0]), np.array([0.6, 0.8, 0.0])
    arm, w, beta, h = rng.normal(size=3), rng.normal(size=2), rng.normal(size=2), 1e-5

    def screw_matrix(t: float) -> np.ndarray:
        q = w * t + 0.5 * beta * t * t
        R = rotation(first, q[0])
        return np.stack([revolute(first, np.zeros(3)), revolute(R @ second, R @ arm)], axis=1)

    def twist(t: float) -> np.ndarray:
        return screw_matrix(t) @ (w + beta * t)

    expected = (twist(h) - twist(-h)) / (2 * h)
    found = chain_acceleration(screw_matrix(0.0)[None], w[None], beta[None])[0]
    assert np.abs(found - expected).max() < DIFFERENCE


def test_vee_undoes_skew(rng):
    v = rng.normal(size=(5, 3))
    assert np.array_equal(vee(skew(v)), v)


def ball(axes):
    coordinates, kind = tuple("abc"[: len(axes)]), {2: "U", 3: "S"}[len(axes)]
    return Joint("ball", kind, "ground", "body", axes, coordinates, np.zeros(len(axes)), np.zeros((len(axes), 2)))


@pytest.mark.parametrize("handed", [1.0, -1.0])
def test_angles_undo_three_rotations(rng, handed):
    axes = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    axes[2] *= handed * np.sign(np.linalg.det(axes))
    angles = rng.uniform(-1.5, 1.5, size=(20, 3))
    R = rotation(axes[0], angles[:, 0]) @ rotation(axes[1], angles[:, 1]) @ rotation(axes[2], angles[:, 2])
    basis, hand = triad(ball(axes))
    assert np.abs(sequence_angles(basis @ R @ basis.T, hand=hand) - angles).max() < ROUNDING


def test_two_angles_have_no_gimbal_lock(rng):
    """Near a right angle a third number would lose the first angle."""
    axes = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    angles = np.array([[0.7, 0.5 * np.pi], [-2.0, 0.5 * np.pi - 1e-6], [0.3, 2.9], [3.0, -1.7]])
    R = rotation(axes[0], angles[:, 0]) @ rotation(axes[1], angles[:, 1])
    basis, hand = triad(ball(axes[:2]))
    assert np.abs(sequence_angles(basis @ R @ basis.T, 2, hand) - angles).max() < ROUNDING
