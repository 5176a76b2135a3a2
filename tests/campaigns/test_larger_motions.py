import pytest
from campaigns.larger_motions import rows_of_larger_motions

COUNT = 300


@pytest.mark.campaign
def test_the_truth_confirms_every_difference_in_larger_motions(campaign):
    file = campaign.reports / "larger-motions" / "larger-motions.csv"
    table = rows_of_larger_motions(campaign.count or COUNT, file)
    assert [row for row in table if row["verdict"] == "differ" and row["confirmed"] != "True"] == []
