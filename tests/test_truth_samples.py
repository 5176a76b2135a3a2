from dataclasses import replace

import numpy as np
import pytest

import screwgauge
from support.engines import ENGINES, common_rows
from support.truth import NotCertified, Sampler

QUANTITIES = ["joint_position", "joint_velocity", "actuator_force", "generalized_force"]


@pytest.fixture(scope="module")
def results():
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(ENGINES, "truth", replace(ENGINES["truth"], most=11))
        patch.setattr("screwgauge.truth.engine.MOST", 11)
        scene = screwgauge.load_scene("3ups-upu-s").at(np.linspace(0, 2, 101))
        yield screwgauge.run(scene, engines=["truth", "screw", "pinocchio"], quantities=QUANTITIES)


@pytest.mark.slow
def test_chosen_samples_are_spread_evenly_over_the_scene(results):
    truth = results.solutions["truth"]
    assert truth.rows.tolist() == list(range(0, 101, 10))
    for array in (results.values("actuator_force", "truth"), results.radius("actuator_force")):
        assert array.shape == (101, 4)
        assert np.isfinite(array[truth.rows]).all()
        assert np.isnan(np.delete(array, truth.rows, axis=0)).all()


def test_pairs_are_compared_at_the_samples_that_both_solved(results):
    assert results.ok
    assert set(results.pairs["a"]) == {"truth", "screw"}
    assert len(common_rows(101, results.solutions["truth"], results.solutions["screw"])) == 11
    error = np.abs(results.values("actuator_force", "screw") - results.values("actuator_force", "truth"))
    row = results.pairs.set_index(["quantity", "a", "b"]).loc[("actuator_force", "truth", "screw")]
    assert row["max_abs"] == np.nanmax(error)


def test_scale_of_every_pair_is_that_of_the_truth(results):
    force = results.errors[results.errors["quantity"] == "actuator_force"]
    assert len(force) == 3 * 4
    assert set(force["scale"]) == {np.nanmax(np.abs(results.values("actuator_force", "truth")))}


@pytest.mark.slow
def test_report_is_written_with_its_plots(results, tmp_path):
    out = results.write(tmp_path / "out")
    assert "11 of 101 samples were enclosed" in (out / "report.md").read_text()
    assert "Gap:" not in (out / "report.md").read_text()
    for plot in (out / "plots").glob("*.svg"):
        assert "no number" not in plot.read_text()


def test_short_scene_is_solved_at_every_sample():
    scene = screwgauge.load_scene("3ups-upu-s").at([0.0, 0.1])
    assert screwgauge.run(scene, engines=["truth"], quantities=["joint_position"]).solutions["truth"].rows is None


def test_only_what_is_asked_for_is_computed(monkeypatch):
    def never(*_):
        raise AssertionError("not asked for")

    monkeypatch.setattr("screwgauge.truth.samples.state", never)
    scene = screwgauge.load_scene("3ups-upu-s").at([0.123])
    results = screwgauge.run(scene, engines=["truth"], quantities=["joint_position"])
    assert list(results.solutions["truth"].values) == ["joint_position"]


def test_samples_without_a_proof_are_left_out_and_named(monkeypatch):
    sample = Sampler.sample

    def sometimes(self, y, *given):
        if 0.15 < float(y[1][0].mid()) / 0.1 < 0.25:  # b = 0.1 sin t at t = 0.2
            raise NotCertified("Krawczyk's test does not hold", "", "")
        return sample(self, y, *given)

    monkeypatch.setattr(Sampler, "sample", sometimes)
    scene = screwgauge.load_scene("3ups-upu-s").at([0.1, 0.2, 0.3])
    results = screwgauge.run(replace(scene, name="x"), engines=["screw", "truth"], quantities=["joint_velocity"])
    truth = results.solutions["truth"]
    assert results.pairs["ok"].all()
    assert (results.outcomes, results.exit_status) == (("partly",), 1)
    assert truth.rows.tolist() == [0, 2]
    assert any(note.startswith("1 samples could not be certified") and "t = 0.2 s" in note for note in truth.notes)
