import re
from pathlib import Path

import numpy as np
import pytest

import screwgauge

FILE = Path(__file__).parent / "data/tables/printed.toml"


@pytest.fixture(scope="module")
def results():
    return screwgauge.run(screwgauge.load_scene(FILE), ["screw", "printed", "equation-60", "exact"])


def of(results, table):
    return results.pairs[results.pairs["b"] == table].set_index(["quantity", "unit"])


def test_initial_angles_and_lengths_of_tables_1_and_2_are_right(results):
    pairs = of(results, "printed")
    assert [*pairs.index] == [("joint_position", "rad"), ("joint_position", "m")]
    assert pairs["ok"].all()
    assert pairs["max_scaled"].max() < 1e-15


def test_equation_60_is_no_motion_of_the_mechanism(results):
    """It lacks the term b' sin a, 0.04 rad/s."""
    pairs = of(results, "equation-60")
    assert not pairs["ok"].any()
    velocity = pairs.loc[("body_angular_velocity", "rad/s")]
    assert velocity["worst_component"] == "platform.z"
    t = np.linspace(0.0, 10.0, 21)
    missing = np.abs(0.1 * np.cos(t) * np.sin(0.2 - 0.2 * np.cos(t))).max()
    assert velocity["max_abs"] == pytest.approx(missing, rel=1e-9, abs=0)
    assert results.exit_status == 1
    assert re.match("✗ DIFFER: .*equation-60.*body_angular_velocity", repr(results))


def test_57_digits_agree_and_balance(results):
    pairs = of(results, "exact")
    assert [*pairs.index] == [("generalized_force", "N m"), ("actuator_force", "N")]
    assert pairs["max_scaled"].max() < 1e-14
    judged = results.judge[results.judge["engine"] == "exact"].set_index("residual")
    assert {*judged.index} == {"power_balance", "force_rule", "virtual_work"}
    assert judged["ok"].all()


def test_the_57_digits_are_those_of_the_truth(results):
    pytest.importorskip("flint", reason="python-flint is not installed")
    scene = screwgauge.load_scene(FILE).at(results.times[[0, 7]])
    truth = screwgauge.run(scene, ["truth", "exact"], ["generalized_force", "actuator_force"])
    assert truth.ok
    assert {*truth.pairs["max_abs"]} == {0.0}


def test_the_gate_judges_them():
    found = screwgauge.check(FILE, smoke=True)
    (row,) = found.rows
    assert (row.status, row.file) == ("differ", str(FILE))
    assert {error.b for error in row.errors if not error.ok} == {"equation-60"}
    assert {"printed", "exact"} < {error.b for error in row.errors if error.ok}
    with pytest.raises(AssertionError, match=r"angular_acceleration at platform.x, t = .* s: .*, equation-60 "):
        found.assert_ok()
