import ast
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest

import screwgauge
from screwgauge.engines import registry
from support.data import data
from support.engines import ENGINES, get_engine, model_files
from support.errors import ModelFileError
from support.solve import ScrewModel, layout

ROOM = Path(registry.__file__).parent
#: Engines in one file of their own, of which nothing but `screwgauge.plugins` is imported.
GUESTS = ("exudyn", "drake")


def few(name, n=4):
    scene = screwgauge.load_scene(name)
    return scene.at(np.linspace(scene.t[0], scene.t[-1], n).tolist())


def test_guests_import_nothing_of_the_package_but_the_kit():
    rooms = {
        engine.source.partition(":")[0].split(".")[2] for engine in ENGINES.values() if ".engines." in engine.source
    }
    guests = rooms - {"screw", "pinocchio", "mujoco"}
    assert {*GUESTS} <= guests
    own = {"lagrange": {"screwgauge.engines.virtual_work"}}  # which is a guest's, too
    for name in guests | {"virtual_work"}:
        nodes = [*ast.walk(ast.parse((ROOM / f"{name}.py").read_text(encoding="utf-8")))]
        names = {alias.name for node in nodes if isinstance(node, ast.Import) for alias in node.names}
        names |= {node.module for node in nodes if isinstance(node, ast.ImportFrom)}
        allowed = {"screwgauge.plugins"} | own.get(name, set())
        assert {one for one in names if one.startswith("screwgauge")} == allowed, name


@pytest.mark.skipif(find_spec("exudyn") is None, reason="exudyn is not installed")
def test_exudyn_prints_nothing_and_leaves_its_switch_and_the_folder(capfd, tmp_path, monkeypatch):
    import exudyn

    monkeypatch.chdir(tmp_path)
    told, scene = exudyn.config.printToConsole, few("slider-crank", 2)
    get_engine("exudyn").load(model_files("slider-crank", "exudyn")).solve(scene.problem(["reaction"]))
    assert capfd.readouterr() == ("", "")
    assert exudyn.config.printToConsole is told
    assert not [*tmp_path.iterdir()]


def integrated(scene, integrator, dt):
    from screwgauge.engines.exudyn import ExudynModel

    problem = scene.problem(["joint_position", "joint_velocity", "joint_acceleration"])
    return ExudynModel(scene.mechanism, "model", integrator, dt).solve(problem)


PUSHED = data("pushed-slider-crank-scene.toml")


@pytest.mark.skipif(find_spec("exudyn") is None, reason="exudyn is not installed")
def test_the_integrator_of_exudyn_is_of_second_order_and_knows_loads_and_springs(write):
    scene = screwgauge.load_scene(write("pushed.toml", PUSHED))
    right = ScrewModel(layout(scene.mechanism)).solve(scene.problem(["joint_position", "joint_acceleration"])).values
    errors = []
    for dt in (2e-3, 1e-3):
        found = integrated(scene, "GeneralizedAlpha", dt)
        assert found.cost.steps == round(0.2 / dt)
        difference = found.values["joint_position"].array - right["joint_position"].array
        errors.append(np.abs(difference).max())
        assert np.isfinite(found.values["joint_acceleration"].array).all()
    assert 3.5 < errors[0] / errors[1] < 4.5
    start = found.values["joint_acceleration"].array[0]  # where nothing has been integrated yet
    assert np.abs(start - right["joint_acceleration"].array[0]).max() < 1e-10 * np.abs(start).max()


@pytest.mark.skipif(find_spec("exudyn") is None, reason="exudyn is not installed")
def test_the_integrator_of_exudyn_refuses_what_acts_along_joints():
    scene = screwgauge.load_scene("a03-andrews-ivp")
    with pytest.raises(ModelFileError, match=r"has a motor"):
        integrated(scene, "GeneralizedAlpha", 1e-4)
