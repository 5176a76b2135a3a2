import pytest
from campaigns.alarms import COLUMNS, PAGE, measured, passed, sentence

pytestmark = pytest.mark.slow

COUNT = 1000


@pytest.mark.campaign
def test_the_gate_raises_no_false_alarm_and_misses_no_change(campaign):
    table = campaign.of_mechanisms(PAGE, "check", measured, COLUMNS, COUNT)
    assert passed(table), sentence(table)


@pytest.mark.slow
@pytest.mark.parametrize("family", ["serial", "planar-4", "rssr"])
def test_a_random_mechanism_is_quiet_and_a_small_change_of_its_dynamics_is_caught(family):
    row = measured((1, family))
    assert row["quiet"] == "yes", row["reason"]
    assert row["caught"] == "yes", f"{row['parameter']} by {row['share']}: {row['error']} of {row['tolerance']}"
    assert float(row["error"]) < 1e-6  # what a force of which this is a small part makes of 1e-9
