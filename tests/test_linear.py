import numpy as np
import pytest

from support.geometry import linear

#: Relative to the condition: rounding of an inverse.
ROUNDING = 64 * linear.EPS


def along(n, m=6, step=1e-3, seed=0):
    rng = np.random.default_rng(seed)
    t = step * np.arange(n)[:, None, None]
    A, B, C = rng.normal(size=(3, m, m))
    return 3.0 * np.eye(m) + 0.3 * A + np.sin(5.0 * t) * B + t**2 * C


def off(found, A):
    right = np.linalg.pinv(A)
    size = np.linalg.norm(right, axis=(-2, -1))
    return (np.linalg.norm(found - right, axis=(-2, -1)) / size / linear.condition(A)).max()


@pytest.mark.parametrize("n", [0, 1, 7, 16, 127, 128, 129, 300])
def test_inverses_along_a_motion_are_those_of_each(n):
    A = along(n)
    found, condition = linear.invert_along(A)
    assert found.shape == A.shape
    if n:
        assert off(found, A) < ROUNDING
        assert np.abs(condition / linear.condition(A) - 1.0).max() < 1e-9


@pytest.mark.parametrize("at", [0, 8, 20, 199])
def test_a_jump_a_steep_change_or_bad_conditioning_costs_no_digit(at):
    A = along(200)
    A[at:] = along(200 - at, seed=1)
    assert off(linear.invert_along(A)[0], A) < ROUNDING
    A = along(200, step=0.05)
    assert off(linear.invert_along(A)[0], A) < ROUNDING
    A = along(200)
    A[at, 0] = A[at, 1] + 1e-9
    assert off(linear.invert_along(A)[0], A) < ROUNDING


def test_of_a_singular_one_and_of_no_number_there_is_no_inverse():
    A = along(40)
    A[17, 0] = A[17, 1]
    A[23] = np.nan
    found, condition = linear.invert_along(A)
    rest = np.delete(np.arange(40), [17, 23])
    assert off(found[rest], A[rest]) < ROUNDING
    assert condition[17] > linear.SINGULAR
    assert np.isnan(condition[23])
    assert np.isnan(found[23]).all()


@pytest.mark.parametrize("size", [1.0, 0.0])
def test_tall_systems_are_solved_by_least_squares_whatever_their_rank(size):
    A = np.random.default_rng(3).normal(size=(20, 8, 5))
    A[..., 4] = A[..., 0] + size * A[..., 4]
    found, condition = linear.invert(A)
    assert (condition > linear.SINGULAR).all() == (size == 0.0)
    b = A @ np.ones((5, 1))
    assert np.abs(A @ (found @ b) - b).max() < 1e-9
    if size == 1.0:
        assert off(found, A) < ROUNDING
