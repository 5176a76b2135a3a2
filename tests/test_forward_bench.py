"""`screwgauge bench` of simulations."""

import sys
from dataclasses import replace
from types import ModuleType

import numpy as np
import pandas as pd
import pytest

import screwgauge
from screwgauge import ScrewgaugeError
from screwgauge.study.bench import forward_run as module
from support.bench import (
    ABSOLUTE,
    BESIDE,
    COLUMNS,
    CUT,
    FAILED,
    FULL,
    OK,
    QUICK_SIMULATIONS,
    TABLE,
    Contestant,
    absolute_table,
    bench,
    bench_table,
    pose_simulation,
    simulation,
    simulators,
)
from support.engines import ENGINES, Engine, Method, screw
from support.models import write_models
from support.report import SIMULATION, make_plots
from support.scene import InitialValue
from support.tasks import Processes

PLAN = replace(QUICK_SIMULATIONS, share=0.05, samples=5)


@pytest.fixture(scope="module")
def scene():
    return screwgauge.load_scene("a01-pendulum")


@pytest.fixture(scope="module")
def found(scene):
    return bench(scene, plan=PLAN, contestants=["screw"])


def test_tighter_tolerances_make_smaller_errors(found):
    assert {row.status for row in found.rows} == {OK}
    observable, energy = found.rows[::2], found.rows[1::2]
    errors = [row.error for row in observable if row.contestant.family == "screw-DOP853"]
    assert errors[0] < 1e-2
    assert errors[-1] < 1e-2 * errors[0]  # tolerances are 1e-4 and 1e-7, errors go with them
    for row, other in zip(observable, energy, strict=True):
        assert row.contestant is other.contestant
        assert row.cost.cpu_s > 0.0
        assert row.time_s == row.cost.wall_s > 0.0
        assert row.cost.steps > 0
        assert other.largest["J"] < 10.0 * max(row.error, 1e-12) * 9.81  # of m g L


def test_files_and_columns(found, tmp_path):
    out = SIMULATION.write(found, tmp_path / "out")
    table = pd.read_csv(out / "bench.csv")
    assert list(table.columns) == COLUMNS
    assert set(table["quantity"]) == {"observable", "energy"}
    assert len(table) == 2 * len({row.contestant for row in found.rows})
    assert list(pd.read_csv(out / "forward.csv").columns) == ABSOLUTE
    tables, pages = {"bench.csv", "forward.csv", "slopes.csv"}, {"report.md", "report.html", "plots"}
    assert {path.name for path in out.iterdir()} == tables | pages | {"environment.json", "report-files.json"}
    text = (out / "report.md").read_text(encoding="utf-8")
    for words in ("*published*", "OpenSim", "other machine", "first 5% of the motion"):
        assert words in text


def test_diagram_shows_what_others_have_published(found):
    observable, energy = make_plots(found)
    assert "Exudyn" in observable.svg + energy.svg
    assert "OpenSim" in observable.svg + energy.svg
    assert "other machines" in observable.svg


def test_what_takes_too_long_is_stopped(scene):
    (first, *_) = bench(scene, plan=replace(PLAN, each=1e-9), contestants=["screw-BDF"]).rows
    assert first.status == CUT
    assert first.reason.startswith("stopped after 1e-09 s")


def test_nothing_begins_when_the_budget_is_spent(scene):
    found = bench(scene, plan=replace(PLAN, budget=1e-9), contestants=["screw-BDF"])
    assert not found.complete
    assert {row.reason for row in found.rows} == {"the budget ran out before its turn"}
    assert make_plots(found) == []
    assert len(bench_table(found.rows)) == 2 * len({row.contestant for row in found.rows})


class Refuses:
    def solve(self, problem, progress=None):
        raise ValueError("no body without inertia")


class Stops(screw.ScrewModel):
    def solve(self, problem, progress=None):
        whole = super().solve(problem)
        return replace(whole, rows=np.arange(2), stopped="no step leads on")


def test_failures_and_early_ends_are_rows_with_their_reasons(scene, monkeypatch):
    loaded = ModuleType("odd_engines")
    loaded.refuses = lambda files: Refuses()
    loaded.stops = lambda files: Stops(screw.load(files).lay)
    monkeypatch.setitem(sys.modules, "odd_engines", loaded)
    for name in ("refuses", "stops"):
        engine = Engine(name, "", f"odd_engines:{name}", frozenset((InitialValue,)), "screwgauge")
        monkeypatch.setitem(ENGINES, name, engine)

    def some(method, duration, *, quick):
        return [
            Contestant(name, name, "a setting", Method(name), simulation, ("observable", "energy"), "")
            for name in ("refuses", "stops")
        ]

    monkeypatch.setattr(module, "simulators", some)
    refused, lost, stopped, _ = bench(scene, plan=PLAN).rows
    assert (refused.status, refused.reason) == (FAILED, "ValueError: no body without inertia")
    assert (stopped.status, stopped.reason) == (FAILED, "no step leads on")
    assert stopped.error < 5e-11  # what it computed is scored
    assert np.isnan(absolute_table([refused, lost])["max_abs"]).all()


@pytest.mark.parametrize("family", [stepper["family"] for stepper in TABLE["steppers"]])
def test_rows_of_steppers_say_what_their_engines_say(family, tmp_path):
    scene = screwgauge.load_scene("a02-fourbar-2").at([0.0, 0.01])
    write_models(scene.mechanism, tmp_path, gravity=scene.applied.g)
    everyone = simulators("DOP853", 0.01, quick=True)
    stepper = next(contestant for contestant in everyone if contestant.family == family)
    asked = stepper.ask(pose_simulation(scene, tmp_path))
    assert stepper.method.load(asked.files).solve(asked.problems[0]).setting == stepper.setting


def test_implicit_ladders_end_where_they_would_take_too_many_steps():
    everyone = simulators("Radau", 1.0, quick=False)
    assert len([c for c in everyone if c.family == "screw-DOP853"]) == 5
    implicit = [c.setting for c in everyone if c.family == "mujoco"]
    assert implicit == [f"Radau, rtol = atol = {rtol}" for rtol in ("1e-04", "1e-06", "1e-08")]


def test_without_a_reference_the_tightest_screw_is_one(scene):
    found = bench(replace(scene, known=None), plan=PLAN, contestants=["screw-Radau"])
    assert found.reference == "screw with DOP853, rtol = atol = 1e-12"
    assert found.rows[0].error < 1e-2


def test_bad_input_is_said(scene):
    with pytest.raises(ScrewgaugeError, match="no observable"):
        bench(replace(scene, observables=(), known=None), plan=PLAN)
    with pytest.raises(ScrewgaugeError, match=r"unknown contestant 'screw-RK45'"):
        bench(scene, plan=PLAN, contestants=["screw-RK45"])


def test_command_line(monkeypatch, tmp_path, command):
    monkeypatch.setattr(module, "QUICK", PLAN)
    arguments = ["bench", "a01-pendulum", "--quick", "--contestants", "screw-BDF", "--out", str(tmp_path)]
    said = command(*arguments).out
    assert "OpenSim" in said
    assert max(len(line) for line in said.splitlines()) <= 100 + len(str(tmp_path))


def test_energy_of_a_first_order_stepper_falls_with_its_step(scene):
    plan = replace(FULL, share=0.2, rounds=1, quick=True)
    found = bench(scene, plan=plan, contestants=["pinocchio-Euler"])
    (one,) = found.fits
    assert one.ok, one.slope


@pytest.mark.slow
def test_families_in_processes_of_their_own_have_the_same_errors(found, scene, isolated):
    there = bench(scene, plan=PLAN, contestants=["screw"], execute=Processes(2))
    here = {(row.contestant.setting, row.quantity): row.error for row in found.rows}
    assert {(row.contestant.setting, row.quantity): row.error for row in there.rows} == here
    assert there.notes[-1] == BESIDE
