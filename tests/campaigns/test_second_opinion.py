import pytest
from campaigns.rows import rows_of_mechanisms
from campaigns.second_opinion import COLUMNS, PAGE, measured

COUNT = 1000


@pytest.mark.campaign
def test_lagrange_confirms_screw_on_random_mechanisms(campaign):
    count, file = campaign.count or COUNT, campaign.reports / "second-opinion" / PAGE.NAME
    table = campaign.carry_out(
        PAGE,
        "second-opinion",
        lambda progress: rows_of_mechanisms(count, file, measured, COLUMNS, progress, campaign.execute),
        again=True,
    )
    assert {*table["verdict"]} == {"agree"}


@pytest.mark.slow
@pytest.mark.parametrize("family", ["rsur", "geared-loop"])
def test_a_row_has_all_that_both_give(family):
    row = measured((1, family))
    assert row["verdict"] == "agree"
    assert 0.0 < float(row["max_scaled"]) < float(row["tolerance"])
