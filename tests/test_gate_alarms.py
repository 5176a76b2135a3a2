"""The gate is quiet about random mechanisms and catches changes of 1e-9; what is counted is told, and fails."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from screwgauge.models.catalog import load_mechanism
from screwgauge.report.pages.alarms import PAGE, passed, sentence
from screwgauge.report.terminal import terminal as text
from screwgauge.study.gate.alarms import COLUMNS, changed, measured


@pytest.mark.parametrize("family", ["serial", "planar-4", "rssr"])
def test_a_random_mechanism_is_quiet_and_a_small_change_of_its_dynamics_is_caught(family):
    row = measured((1, family))
    assert row["quiet"] == "yes", row["reason"]
    assert row["caught"] == "yes", f"{row['parameter']} by {row['share']}: {row['error']} of {row['tolerance']}"
    assert float(row["error"]) < 1e-6  # what a force of which this is a small part makes of 1e-9


def test_what_is_changed_is_what_coverage_names():
    mechanism = load_mechanism("five-bar")
    body = mechanism.bodies[0]
    name = f"of {body.name}"
    assert changed(mechanism, f"mass {name}", 0.5).bodies[0].mass == pytest.approx(1.5 * body.mass, rel=1e-15, abs=0)
    moved = changed(mechanism, f"com y {name}", 1e-3).bodies[0].com - body.com
    assert np.flatnonzero(moved).tolist() == [1]
    turned = changed(mechanism, f"inertia xz {name}", 0.01).bodies[0].inertia - body.inertia
    assert np.argwhere(turned).tolist() == [[0, 2], [2, 0]]
    assert turned[0, 2] == pytest.approx(0.01 * np.abs(body.inertia).max(), rel=1e-12, abs=0)


@pytest.mark.parametrize(
    ("quiet", "caught", "counts", "ok"),
    [
        ("yes", "yes", "0 false alarms of 2 (0 refused); 0 of 2 changes", True),
        ("no", "yes", "1 false alarms of 2 (0 refused); 0 of 2 changes", False),
        ("yes", "no", "0 false alarms of 2 (0 refused); 1 of 2 changes", False),
        ("refused", "", "0 false alarms of 1 (1 refused); 0 of 1 changes", True),
    ],
)
def test_counts_are_told_and_decide(quiet, caught, counts, ok):
    usual = dict.fromkeys(COLUMNS, "x") | {"family": "a", "seed": 0, "quiet": "yes", "caught": "yes"}
    found = pd.DataFrame([usual, usual | {"seed": 1, "quiet": quiet, "caught": caught}])
    assert counts in sentence(found)
    assert passed(found) is ok
    assert ("a 1: " in text(PAGE.terminal(found))) is (quiet != "yes" or caught == "no")


def test_nothing_looked_at_is_no_pass():
    assert not passed(pd.DataFrame([dict.fromkeys(COLUMNS, "") | {"family": "a", "quiet": "refused"}]))
