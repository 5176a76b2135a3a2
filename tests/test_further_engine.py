from dataclasses import replace

import numpy as np
import pytest

import screwgauge
from support import toy_engine as toy
from support.command import printed_by
from support.engines import ENGINES, ModelFiles, check_engines, engines, further_engines, get_engine, model_files
from support.errors import DescriptionError, UnknownNameError
from support.scene import InitialValue
from support.trees import smallest_model


@pytest.fixture(scope="module", autouse=True)
def installed():
    with further_engines({"toy": "support.toy_engine:TOY"}):
        yield


@pytest.fixture(scope="module")
def results(installed):
    scene = screwgauge.load_scene("3ups-upu-s-fast").at(np.linspace(0.0, 1.0, 41))
    return screwgauge.run(scene, engines=["screw", "toy", "pinocchio"])


@pytest.mark.slow
def test_comparison_names_quantity_component_and_size(results):
    assert results.exit_status == 1
    bad = results.pairs[~results.pairs["ok"]]
    assert set(bad["quantity"]) == {"joint_acceleration", "actuator_force"}
    assert set(bad["worst_component"]) == {toy.ACCELERATION, toy.FORCE}
    assert "toy" in (set(bad["a"]) & set(bad["b"])) or all(
        "toy" in pair for pair in zip(bad["a"], bad["b"], strict=True)
    )
    assert bad["max_scaled"].to_numpy() == pytest.approx(toy.ERROR, rel=1e-3)


def test_all_other_components_agree(results):
    bad = results.errors[~results.errors["ok"]]
    assert set(bad["component"]) == {toy.ACCELERATION, toy.FORCE}


def test_judge_alone_names_loop_body_and_size(results):
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


def test_further_engine_is_listed(command):
    said = command("list", "engines").out
    assert [line.split()[0] for line in said.splitlines()] == [
        name for engine in engines().values() for name in engine.methods
    ]
    assert said.splitlines()[-1].split() == ["toy", "a", "toy"]


def test_further_engine_stands_after_those_of_this_package():
    assert list(engines())[-1] == "toy"
    assert get_engine("toy") == replace(toy.TOY, apart=True)
    assert check_engines(["toy", "screw", "toy"]) == ("toy", "screw")


def test_further_engine_says_what_it_does_not_do():
    with pytest.raises(DescriptionError, match=r"s.toml: engine 'toy'.* choose from screw"):
        check_engines(["toy"], "s.toml", InitialValue)
    with pytest.raises(UnknownNameError, match=r"'tot'; did you mean 'toy'"):
        check_engines(["tot"])


def test_settings_of_a_further_engine_are_the_keywords_of_its_loader():
    scene = screwgauge.load_scene("3ups-upu-s-fast").at([0.3])
    problem, files = scene.problem(["actuator_force"]), ModelFiles(scene.mechanism_file)
    right, toys = (get_engine("toy").load(files, error=error).solve(problem) for error in (0.0, 0.5))
    f, g = (solution.values["actuator_force"].array for solution in (right, toys))
    assert np.abs(g - f).max() == pytest.approx(0.5 * np.abs(f).max())
    with pytest.raises(UnknownNameError, match=r"'eror'; did you mean 'error'"):
        get_engine("toy").load(files, eror=1.0)


def test_one_that_cannot_be_loaded_harms_nobody_else():
    with further_engines({"bad": "no_such_module:ENGINE", "toy": "support.toy_engine:TOY"}):
        scene = screwgauge.load_scene("3ups-upu-s-fast").at([0.3])
        results = screwgauge.run(scene, engines=["screw", "bad"], quantities=["joint_position"])
        assert results.failures["bad"].reason.startswith("not installed (No module named")
        assert engines()["bad"].meaning == "cannot be loaded"
        assert engines()["toy"].meaning == toy.TOY.meaning


def test_a_name_of_this_package_is_not_taken_over():
    with further_engines({"screw": "support.toy_engine:TOY"}):
        assert get_engine("screw") is ENGINES["screw"]


def test_five_methods_make_an_open_tree():
    scene = screwgauge.load_scene("3ups-upu-s-fast").at([0.0, 0.4])
    problem, files = scene.problem(scene.quantities), model_files("3ups-upu-s", "mujoco")
    small, whole = (model.solve(problem) for model in (smallest_model(files), get_engine("mujoco").load(files)))
    assert set(small.values) == set(whole.values)
    for name, values in whole.values.items():
        if name != "tree_force_soft":  # nothing is soft by default
            size = np.abs(values.array).max()
            assert small.values[name].array == pytest.approx(values.array, rel=0, abs=1e-12 * size), name


def test_engines_load_no_integrator_before_they_integrate() -> None:
    models = ", ".join(f"screwgauge.engines.{engine}.model" for engine in ("screw", "pinocchio", "mujoco"))
    code = f"import sys, {models}\nprint({{'scipy', 'pandas'}} & set(sys.modules))"
    assert printed_by(code).strip() == "set()"
