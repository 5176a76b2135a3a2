import numpy as np
import pytest

from support.solve import NewtonEuler
from support.tolerances import CLOSED, FOLLOWED_TO_THE_END, NINE_DIGITS


@pytest.fixture(scope="module")
def solved(answer):
    return answer("a03-andrews-ivp", tolerance=1e-11)


def test_crank_angle_after_30_ms(solved):
    found, _ = solved
    assert found.trajectory.t[-1] == 0.03
    assert abs(found.observable[-1, 2] - 15.81077119515371) < FOLLOWED_TO_THE_END["a03-andrews-ivp"]


def test_path_of_the_crank_pin(solved):
    found, known = solved
    assert (
        np.abs(found.observable - known[["F.x", "F.y", "beta"]]).to_numpy().max()
        < FOLLOWED_TO_THE_END["a03-andrews-ivp"]
    )


def test_energy_is_the_motors_work(solved):
    """Without gravity; up to 0.5 J."""
    found, _ = solved
    energy, work, beta = found.trajectory.energy, found.trajectory.work, found.observable[:, 2]
    assert np.abs(work - 0.033 * (beta - beta[0])).max() < CLOSED
    assert np.abs(energy - energy[0] - work).max() < NINE_DIGITS


def test_first_multiplier_is_the_force_between_k2_and_k3(solved):
    found, _ = solved
    whole = NewtonEuler(found.trajectory.rates)
    force = whole.response()[1][-1, whole.names.index("e2.fx")]
    assert force == pytest.approx(199.1753481045386, rel=1e-6)


def test_the_other_start_at_rest_is_followed_too(answer):
    """The IFToMM library's start, beta = -0.062."""
    found, known = answer("a03-andrews-iftomm", tolerance=1e-11)
    assert (
        np.abs(found.observable - known[["F.x", "F.y", "beta"]]).to_numpy().max()
        < FOLLOWED_TO_THE_END["a03-andrews-iftomm"]
    )
