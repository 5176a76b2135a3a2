import numpy as np
import pytest

from support.tolerances import FOLLOWED_TO_THE_END

pytestmark = pytest.mark.slow


def change_of_energy(found):
    return np.abs(found.trajectory.energy - found.trajectory.energy[0]).max()


def test_two_four_bars_pass_their_singular_poses(answer):
    """Published solutions drift by 1e-3 to 0.1 J."""
    found, known = answer("a02-fourbar-2")
    assert change_of_energy(found) < 1.5e-6
    assert np.abs(found.observable - known[["B0.x", "B0.y"]]).to_numpy().max() < FOLLOWED_TO_THE_END["a02-fourbar-2"]
    crank = found.trajectory.rates.q[:, 0]
    assert np.abs(crank + known["phi"]).max() < FOLLOWED_TO_THE_END["a02-fourbar-2"]  # no turn is lost
    assert np.ptp(crank) > 4.0 * np.pi
    others = found.trajectory.rates.q[:, 1:3] - crank[:, None]
    assert np.abs(others).max() < 1e-13  # still parallelograms


@pytest.mark.slow
def test_forty_four_bars_pass_their_singular_poses(answer):
    found, known = answer("a02-fourbar-40")
    off = np.abs(found.observable - known[["B0.x", "B0.y"]]).to_numpy().max(axis=1)
    assert off.max() < FOLLOWED_TO_THE_END["a02-fourbar-40"]
    assert off[known["t"] <= 0.5].max() < 2.5e-8  # before the first of them
