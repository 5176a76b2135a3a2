import numpy as np
import pytest

from support.tolerances import FOLLOWED_TO_THE_END

pytestmark = pytest.mark.slow


@pytest.mark.slow
def test_governor_follows_the_known_motion(answer):
    """Eigenvalues from -8117 to +-7.35i per second."""
    found, known = answer("a05-governor")
    s = found.observable[:, 0]
    assert np.abs(s - known["s"]).max() < FOLLOWED_TO_THE_END["a05-governor"]
    spin = found.trajectory.rates.joint_velocity[-1, 0]
    assert spin == pytest.approx(known["omega"].iloc[-1], abs=1e-6)
    lost = found.trajectory.energy[0] - found.trajectory.energy
    assert np.abs(lost - known["dissipated"]).max() < 1e-5
    assert np.abs(lost + found.trajectory.work).max() < 1e-5  # the dampers' work, integrated with the motion
    angles = found.trajectory.rates.q[:, 2:]
    assert np.abs(angles[:, 0] - angles[:, 1]).max() < 1e-12  # both rods alike
    assert np.abs(angles[:, 0] - known["alpha"]).max() < 1e-6
