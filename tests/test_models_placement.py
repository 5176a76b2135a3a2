import numpy as np
import pytest

from support.geometry import Array, number_text, quaternion, rotation, rpy
from support.tolerances import PLACED, TAKEN_APART

X, Y, Z = np.eye(3)


def from_rpy(angles: Array) -> Array:
    roll, pitch, yaw = angles
    return rotation(Z, yaw) @ rotation(Y, pitch) @ rotation(X, roll)


def from_quaternion(q: Array) -> Array:
    w, v = q[0], q[1:]
    K = np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])
    return np.eye(3) + 2.0 * w * K + 2.0 * K @ K


def rotations() -> list[Array]:
    rng = np.random.default_rng(7)
    some = [rotation(v / np.linalg.norm(v), np.array(rng.uniform(-4, 4))) for v in rng.normal(size=(200, 3))]
    for away in (0.0, 1e-17, 1e-12, 1e-9, 1e-8, 1e-6, -1e-12, -1e-8):
        for side in (1.0, -1.0):
            some.append(from_rpy(np.array([0.7, side * (np.pi / 2 + away), -1.9])))
    return [*some, np.eye(3), np.diag([1.0, -1, -1]), np.diag([-1.0, 1, -1]), np.diag([-1.0, -1, 1])]


@pytest.mark.parametrize(
    ("there", "back", "bound"), [(rpy, from_rpy, PLACED), (quaternion, from_quaternion, TAKEN_APART)]
)
def test_rotation_round_trip(there, back, bound) -> None:
    worst = max(float(np.abs(back(there(R)) - R).max()) for R in rotations())
    assert worst <= bound, f"worst {worst:.1e}"


def test_numbers_read_back_as_they_were() -> None:
    values = [*np.random.default_rng(3).normal(size=100), 0.1, 1e-300, 3.0, -0.0, 5e22]
    assert [float(number_text(value)) for value in values] == values
    assert number_text(-0.0) == "0"
    assert number_text(3.0) == "3"
