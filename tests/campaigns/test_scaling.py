import pandas as pd
import pytest
from campaigns import volume
from campaigns.rows import keep
from campaigns.scaling import Rung, climbed, exponent, rungs

from screwgauge.judging.residual import columns_of, frame


@pytest.mark.campaign
def test_scaling(campaign):
    ladders = rungs(campaign.count)
    table = frame([rung for ladder in ladders.values() for rung in ladder], columns_of(Rung))
    keep(campaign.reports / "compiled" / "scaling.csv", table.to_csv(index=False))
    assert not table["by_array"].any()
    powers = {name: exponent(ladder) for name, ladder in ladders.items() if len(ladder) > 1}
    assert max(powers.values()) < 1.25, powers


@pytest.mark.campaign
def test_volume(campaign):
    seconds = volume.measured(volume.contestants(["llvm", "numpy"]), campaign.count or volume.ROUNDS)
    rows = [(name, 1e6 * each, seconds["rnea"] / each) for name, each in seconds.items()]
    table = pd.DataFrame(rows, columns=["contestant", "sample_us", "rnea_ratio"])
    keep(campaign.reports / "compiled" / "volume.csv", table.to_csv(index=False))
    assert (table["rnea_ratio"][table["contestant"].str.startswith("llvm")] > 1.0).all(), table.to_string()


@pytest.mark.slow
@pytest.mark.parametrize("ladder", ["legs", "joints"])
def test_a_ladder_is_climbed_by_programs(ladder):
    small, large = climbed(ladder, (3, 4), "numpy", 1)
    assert 0 < small.operations < large.operations
    assert small.by_array == large.by_array == 0


@pytest.mark.parametrize("power", [0.5, 1.3])
def test_exponents_are_fitted(power):
    ladder = [Rung("legs", n, 0, 0, 0.0, 7.0 * n**power) for n in (3, 6, 12)]
    assert exponent(ladder) == pytest.approx(power, rel=1e-9, abs=0.0)
