"""The reference of stiff motions."""

import numpy as np
import pytest

from screwgauge import ScrewgaugeError
from screwgauge.reference.idle_motion import rule
from screwgauge.study.bench.stiff import collocate


def test_weights_integrate_polynomials() -> None:
    c, _, A, _ = rule(10)
    for power in range(10):
        np.testing.assert_allclose(A @ c**power, c ** (power + 1) / (power + 1), rtol=0, atol=1e-14)


def test_a_stiff_linear_system_is_exact_to_rounding() -> None:
    # eigenvalues of -1e5 and -1, as at the hardest springs
    times = np.concatenate([[0.0], np.geomspace(1e-6, 1.0, 60)])
    matrix = np.array([[-1e5, 1e5 - 1.0], [0.0, -1.0]])
    found = collocate(lambda x: x @ matrix.T, np.array([2.0, 1.0]), times)
    right = np.column_stack([np.exp(-1e5 * times) + np.exp(-times), np.exp(-times)])
    np.testing.assert_allclose(found, right, rtol=0, atol=3e-14)


def test_a_nonlinear_oscillation_keeps_its_energy() -> None:
    found = collocate(
        lambda x: np.column_stack([x[:, 1], -np.sin(x[:, 0])]), np.array([2.0, 0.0]), np.linspace(0, 20, 21)
    )
    energy = 0.5 * found[:, 1] ** 2 - np.cos(found[:, 0])
    np.testing.assert_allclose(energy, energy[0], rtol=0, atol=1e-12)


def test_a_step_that_is_too_long_says_so() -> None:
    with pytest.raises(ScrewgaugeError, match="does not converge"):
        collocate(lambda x: np.exp(10.0 * x) * 100.0, np.array([1.0]), np.array([0.0, 10.0]))
