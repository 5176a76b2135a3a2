"""The casebook with several versions of the engines: ``casebook/shown.toml``, which the package's is a copy of."""

from itertools import product

import pytest

from casebook.record import measured, text
from screwgauge.casebook.book import SHOWN

#: Versions of pin and of mujoco.
PAIRS = [*product(("3.4.0", "3.9.0", "4.1.0"), ("3.3.0", "3.6.0", "4.0.0"))]


@pytest.mark.campaign
def test_casebook_with_each_pair_of_versions(campaign, tmp_path):
    cases = measured(PAIRS[: campaign.count], tmp_path)
    assert all(case.shown or case.not_shown for case in cases.values() if case.numbers)
    file = campaign.reports / "casebook" / SHOWN.name
    file.parent.mkdir(exist_ok=True)
    file.write_text(text(cases.values()), encoding="utf-8")
