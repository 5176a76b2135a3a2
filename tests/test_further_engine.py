"""A further engine is one file and one line, and what is wrong with it is named."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path

import numpy as np
import pytest

import screwgauge
from screwgauge.engines.registry import ENGINES


@pytest.fixture(scope="module")
def toy():
    spec = importlib.util.spec_from_file_location("toy_engine", Path(__file__).with_name("toy_engine.py"))
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture
def results(toy, monkeypatch):
    monkeypatch.setitem(sys.modules, "toy_engine", toy)
    monkeypatch.setitem(ENGINES, "toy", "toy_engine:solve")  # the one line
    scene = screwgauge.load_scene("3ups-upu-s-fast").at(np.linspace(0.0, 1.0, 41))
    return screwgauge.run(scene, engines=["screw", "toy", "pinocchio"])


def test_comparison_names_quantity_component_and_size(results, toy):
    assert results.exit_status == 1
    bad = results.pairs[~results.pairs["ok"]]
    assert set(bad["quantity"]) == {"joint_acceleration", "actuator_force"}
    assert set(bad["worst_component"]) == {toy.ACCELERATION, toy.FORCE}
    assert "toy" in (set(bad["a"]) & set(bad["b"])) or all(
        "toy" in pair for pair in zip(bad["a"], bad["b"], strict=True)
    )
    assert bad["max_scaled"].to_numpy() == pytest.approx(toy.ERROR, rel=1e-3)


def test_all_other_components_agree(results, toy):
    bad = results.errors[~results.errors["ok"]]
    assert set(bad["component"]) == {toy.ACCELERATION, toy.FORCE}


def test_judge_alone_names_loop_body_and_size(results, toy):
    bad = results.judge[~results.judge["ok"]]
    assert set(bad["engine"]) == {"toy"}
    worst = bad.set_index(["residual", "unit"])
    loop = worst.loc[("loop_acceleration", "m/s^2")]
    assert loop["worst_component"].startswith("leg2.wrist")
    assert 0.3 * toy.ERROR < loop["max_scaled"] < 3 * toy.ERROR
    balance = worst.loc[("newton_euler", "N")]
    assert balance["worst_component"].startswith("leg3.")
    size = toy.ERROR * np.abs(results.values("actuator_force", "screw")).max()
    assert 0.5 * size < balance["max_abs"] <= 1.01 * size


def test_further_engine_is_listed(results, capsys):
    from screwgauge.report.listing import listing

    assert "toy" in listing("engines")
