import pytest
from campaigns.second_opinion import COLUMNS, PAGE, measured

COUNT = 1000


@pytest.mark.campaign
def test_lagrange_confirms_screw_on_random_mechanisms(campaign):
    table = campaign.of_mechanisms(PAGE, "second-opinion", measured, COLUMNS, COUNT)
    assert {*table["verdict"]} == {"agree"}


@pytest.mark.slow
@pytest.mark.parametrize("family", ["rsur", "geared-loop"])
def test_a_row_has_all_that_both_give(family):
    row = measured((1, family))
    assert row["verdict"] == "agree"
    assert 0.0 < float(row["max_scaled"]) < float(row["tolerance"])
