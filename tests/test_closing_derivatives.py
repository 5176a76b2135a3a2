"""The matrix of the loop equations is the derivative of their residuals, so that Newton's method arrives in one go."""

from __future__ import annotations

import numpy as np
import pytest

import screwgauge
from screwgauge.reference.closed.resting import home_equations
from screwgauge.reference.kinematics import positions
from screwgauge.reference.pose import layout

STEP = 1e-6


@pytest.mark.parametrize(("family", "seed"), [("rccc", 1), ("rscr", 0), ("6-pus", 0), ("mixed-loop", 0), ("rsur", 0)])
def test_the_matrix_is_the_derivative(family, seed, tmp_path):
    scene = screwgauge.random(seed, family, tmp_path)
    lay, motion = layout(scene.mechanism), scene.motion.part(slice(2, 3))
    system, columns = home_equations(lay), lay.mechanism.independent_columns
    at = positions(lay, motion.y, motion.t, (motion.yd, motion.ydd))
    z, y = (at.q / system.size)[:, system.unknown], motion.y / system.size[columns]
    ways = STEP * np.eye(z.shape[1])
    measured = [(system.evaluate(z + d, y)[0] - system.evaluate(z - d, y)[0])[0] / (2.0 * STEP) for d in ways]
    assert np.abs(np.transpose(measured) - system.evaluate(z, y)[1][0]).max() < 1e-7


def test_all_samples_close_to_rounding(tmp_path):
    """Where Newton's method makes a residual of 1e-12 larger before it makes it small, it takes that for rounding."""
    scene = screwgauge.random(1, "rccc", tmp_path)
    motion = scene.at(np.linspace(scene.t[0], scene.t[-1], 300)).motion
    lay = layout(scene.mechanism)
    at, system = positions(lay, motion.y, motion.t, (motion.yd, motion.ydd)), home_equations(lay)
    assert np.abs(system.residuals(system.rows(at.R, at.p))).max() < 1e-14
