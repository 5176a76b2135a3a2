"""Engines that share neither tree, cut nor formulas with the others agree with them, and keep to themselves."""

from __future__ import annotations

import ast
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest

import screwgauge
from screwgauge.engines import registry
from support.engines import ENGINES, get_engine, model_files
from support.judging import agreed
from support.tolerances import AGREE

ROOM = Path(registry.__file__).parent
#: Engines in one file of their own, of which nothing but `screwgauge.plugins` is imported.
GUESTS = ("exudyn", "drake")
MECHANISMS = (
    "3ups-upu-s",
    "slider-crank",
    "screw-press",
    "double-cardan",
    "3-rps",
    "belt-leg",
    "bennett",
    "delta",
    "geared-five-bar",
    "planetary-gear",
    "rccc",
    "ruse",
    "stewart",
)


def few(name, n=4):
    scene = screwgauge.load_scene(name)
    return scene.at(np.linspace(scene.t[0], scene.t[-1], n).tolist())


@pytest.fixture(params=GUESTS)
def engine(request):
    engine = get_engine(request.param)
    if not engine.installed:
        pytest.skip(f"{engine.package} is not installed")
    return engine


@pytest.mark.slow
@pytest.mark.parametrize("name", MECHANISMS)
def test_every_pair_is_within_1e_11_and_the_judge_faults_nobody(engine, name):
    results = agreed(screwgauge.run(few(name), engines=["screw", "pinocchio", engine.name]))
    assert results.pairs["max_scaled"].max() < AGREE


def test_guests_import_nothing_of_the_package_but_the_kit():
    rooms = {
        engine.source.partition(":")[0].split(".")[2] for engine in ENGINES.values() if ".engines." in engine.source
    }
    guests = rooms - {"screw", "pinocchio", "mujoco"}
    assert {*GUESTS} <= guests
    for name in guests:
        nodes = [*ast.walk(ast.parse((ROOM / f"{name}.py").read_text(encoding="utf-8")))]
        names = {alias.name for node in nodes if isinstance(node, ast.Import) for alias in node.names}
        names |= {node.module for node in nodes if isinstance(node, ast.ImportFrom)}
        assert {one for one in names if one.startswith("screwgauge")} == {"screwgauge.plugins"}, name


@pytest.mark.skipif(find_spec("exudyn") is None, reason="exudyn is not installed")
def test_exudyn_prints_nothing_and_leaves_its_switch_and_the_folder(capfd, tmp_path, monkeypatch):
    import exudyn

    monkeypatch.chdir(tmp_path)
    told, scene = exudyn.config.printToConsole, few("slider-crank", 2)
    get_engine("exudyn").load(model_files("slider-crank", "exudyn")).solve(scene.problem(["reaction"]))
    assert capfd.readouterr() == ("", "")
    assert exudyn.config.printToConsole is told
    assert not [*tmp_path.iterdir()]
