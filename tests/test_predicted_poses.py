"""Claim: poses of a smooth motion are predicted from those around them to rounding, so that each is hardly asked for
more than once."""

import numpy as np
import pytest

from support.solve import Continuation, knots, predict_unknowns

EVERY, STEP = 16, 0.1


def arm(y):
    z = np.hstack([np.sin(y), np.cos(2.0 * y), np.exp(0.3 * y)])
    return z, np.stack([np.cos(y), -2.0 * np.sin(2.0 * y), 0.3 * np.exp(0.3 * y)], axis=1)


def away(y):
    rows = knots(y, EVERY, STEP)
    z, K = arm(y[rows])
    return np.abs(predict_unknowns(y, rows, z, K) - arm(y)[0]).max()


def test_a_smooth_motion_is_predicted_to_rounding():
    y = 0.3 * np.sin(np.linspace(0.0, 3.0, 1200))[:, None]
    assert away(y) < 1e-13


def test_uneven_and_few_samples_are_predicted_roughly():
    t = np.sort(np.random.default_rng(1).uniform(0.0, 3.0, 1200))
    assert away(0.3 * np.sin(t)[:, None]) < 1e-3
    for n in (2, 3, 4):
        assert away(np.linspace(0.0, 0.05, n)[:, None]) < 1e-5


def test_followed_samples_have_the_ends_among_them_and_none_is_far_from_the_next():
    y = np.cumsum(np.random.default_rng(2).uniform(0.0, 0.03, 500))[:, None]
    rows = knots(y, EVERY, STEP)
    assert (rows[0], rows[-1]) == (0, 499)
    assert np.diff(rows).max() <= EVERY
    assert np.diff(y[rows, 0]).max() <= STEP + 0.03


@pytest.mark.parametrize("n", [1000, 3000])
def test_continuation_asks_for_most_poses_once(n):
    asked = []

    def evaluate(z, y):
        asked.append(len(z))
        residual = np.stack([z[:, 0] - np.sin(z[:, 1]), z[:, 1] - y[:, 0]], axis=1)
        matrix = np.tile(np.eye(2), (len(z), 1, 1))
        matrix[:, 0, 1] = -np.cos(z[:, 1])
        return residual, matrix

    path = Continuation(evaluate, (np.zeros(2), np.zeros(1)), (np.ones(2, bool), np.ones(1, bool)))
    y = 0.4 * np.sin(np.linspace(0.0, 2.0, n))[:, None]
    z = path.follow(y, np.arange(float(n)))[0]
    assert np.abs(z[:, 0] - np.sin(y[:, 0])).max() < 1e-15
    assert sum(asked) < 1.7 * n


def square_root(z, y):
    """Residuals of ``(w1 + i w2)^2 = z1 + i z2`` and ``z = y``, whose two branches exchange around the origin."""
    a, b, u, v = z.T
    J = np.zeros((len(z), 4, 4))
    J[:, 0, 0] = J[:, 1, 1] = -1.0
    J[:, 0, 2], J[:, 0, 3], J[:, 1, 2], J[:, 1, 3] = 2.0 * u, -2.0 * v, 2.0 * v, 2.0 * u
    J[:, 2, 0] = J[:, 3, 1] = 1.0
    return np.stack([u * u - v * v - a, 2.0 * u * v - b, *(z[:, :2] - y).T], axis=1), J


@pytest.mark.parametrize("known", [True, False])
def test_a_motion_that_returns_on_the_other_branch_stays_there(known):
    """After two rounds the anchors of both branches are known, and none has to be added between their samples."""
    t = np.arange(0.0, 8.0 * np.pi, 0.2)
    y, w = (np.stack([np.cos(angle), np.sin(angle)], axis=1) for angle in (t, 0.5 * t))
    home = np.concatenate([y[0], w[0]]), y[0]
    path = Continuation(square_root, home, (np.zeros(4, bool), np.zeros(2, bool)), np.ones(2))
    rates = (np.stack([-y[:, 1], y[:, 0]], axis=1), -y) if known else None
    assert np.abs(path.follow(y, t, rates)[0][:, 2:] - w).max() < 1e-12
