"""No number of a compiled program is wrong by more than its estimate: random states, mechanisms built in and drawn."""

import pytest
from campaigns.compiled import compiled


@pytest.mark.campaign
def test_no_number_is_wrong_by_more_than_its_estimate(campaign):
    rows = compiled(campaign.reports / "compiled" / "compiled.csv", campaign.count)
    assert (rows["ok"] == "True").any()
    wrong = rows[rows["ok"] == "False"]
    assert wrong.empty, wrong.to_string()
