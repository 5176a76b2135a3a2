import tomllib
from dataclasses import replace
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import pytest
import tomli_w

import screwgauge
from screwgauge import Scene
from support.data import DATA
from support.geometry import number
from support.judging import agreed
from support.mechanism import load_mechanism, mechanism_path, read_tables
from support.models import check_file, check_table, write_models
from support.scene import GIVEN
from support.solve import ScrewModel, layout

pytestmark = pytest.mark.slow

TREES = ["pinocchio", "mujoco", "pinocchio-full", "mujoco-full"]


def few(scene: Scene, n: int = 3) -> Scene:
    return scene.at(scene.t[:: len(scene.t) // n][:n])


def resized(scene: Scene, folder: Path, length: float, mass: float) -> Scene:
    tables = read_tables(scene.mechanism_file, mechanism_path)

    def times(values: Any, factor: float) -> Any:
        return [repr(number(value, "description") * factor) for value in values]

    for body in tables["bodies"].values():
        (body["mass"],) = times([body["mass"]], mass)
        body["com"] = times(body["com"], length)
        body["inertia"] = dict(zip(body["inertia"], times(body["inertia"].values(), mass * length**2), strict=True))
    for joint in tables["joints"].values():
        for frame in (joint[key] for key in ("parent_frame", "child_frame") if key in joint):
            frame["position"] = times(frame["position"], length)
        for key in {"home"} & {*joint} if joint["kind"] == "P" else ():
            joint[key] = times(joint[key], length)
    path = folder / "resized.toml"
    path.write_text(tomli_w.dumps(tables))
    return replace(scene, mechanism=load_mechanism(path), mechanism_file=path).under(loads=())


@pytest.mark.sampled(3)
@pytest.mark.slow
@pytest.mark.parametrize("mechanism", ["four-bar-scene.toml", "3ups-upu-s"])
@pytest.mark.parametrize(
    ("length", "mass"), [(1e-9, 1.0), (1e-8, 1e12), (1e-9, 1e12), (1e5, 1.0), (1e9, 1e-12), (1e9, 1e12), (1.0, 1e-12)]
)
def test_the_verdict_is_the_same_from_a_nanometre_to_a_million_kilometres(mechanism, length, mass, tmp_path):
    scene = few(screwgauge.load_scene(DATA / mechanism if mechanism.endswith(".toml") else mechanism))
    results = screwgauge.run(resized(scene, tmp_path, length, mass), engines=["screw", *TREES])
    assert {name.removesuffix("-full") for name in results.failures} <= {"mujoco"}
    # MuJoCo takes no moments of inertia below 1e-15 kg m^2, and says so
    assert bool(results.failures) == (mass * length**2 < 1e-10)
    assert all("MuJoCo" in failure.reason and "inertia" in failure.reason for failure in results.failures.values())
    said = results.pairs[~results.pairs["b"].isin(list(results.failures))]
    assert said["ok"].all(), said[~said["ok"]].to_string()
    assert results.judge["ok"].all(), results.judge[~results.judge["ok"]].to_string()
    assert max(error.largest for error in results.guard.values()) < 1e-9


@pytest.mark.slow
@pytest.mark.parametrize("backend", ["array", "numpy"])
def test_estimates_do_not_know_the_unit_of_mass(backend, tmp_path):
    scene, found = few(screwgauge.load_scene("3ups-upu-s")), []
    for mass in (1.0, 1e9):
        heavy = resized(scene, tmp_path, 1.0, mass)
        model = ScrewModel(layout(heavy.mechanism), backend=backend)
        found.append({name: error.scaled for name, error in model.solve(heavy.problem(GIVEN)).errors.items()})
    light, heavy = found
    for name in light:
        assert heavy[name] == pytest.approx(light[name], rel=0.5), name


def reordered(path: Path) -> None:
    said = tomllib.loads(path.read_text())
    for key in ("bodies", "tree", "closures"):
        said[key].reverse()
    for key in ("joints", "independent"):
        said[key] = dict(reversed(said[key].items()))
    for closure in said["closures"]:
        for key in [key for key in closure if key.startswith("parent")]:
            other = key.replace("parent", "child")
            closure[key], closure[other] = closure[other], closure[key]
    path.write_text(tomli_w.dumps(said))


def turned(path: Path) -> None:
    root = ET.parse(path).getroot()
    for row in root.find("equality"):
        first, second = row.get("site1"), row.get("site2")
        row.set("site1", second)
        row.set("site2", first)
    path.write_text(ET.tostring(root, encoding="unicode"))


@pytest.mark.slow
def test_model_files_that_say_the_same_in_another_order_agree(tmp_path):
    scene = few(screwgauge.load_scene("3ups-upu-s-offset"))
    name = scene.mechanism.name
    write_models(scene.mechanism, tmp_path, gravity=scene.applied.g)
    for path in tmp_path.glob("*.loops.toml"):
        reordered(path)
    for path in tmp_path.glob("*.xml"):
        turned(path)
    for cut, base in (("minimal", name), ("full", f"{name}-full")):
        for reader, ending in (("loops", ".loops.toml"), ("mujoco", ".xml")):
            rows = check_file(scene.mechanism, cut, tmp_path / f"{base}{ending}", reader)
            assert all(row.ok for row in rows), check_table(rows)
    own = {engine: tmp_path / f"{name}{engine[len(engine.split('-')[0]) :]}.xml" for engine in TREES}
    own = {engine: path if "mujoco" in engine else path.with_suffix(".urdf") for engine, path in own.items()}
    results = agreed(screwgauge.run(replace(scene, models=own), engines=["screw", *TREES]))
    assert len(results.pairs) > 50


@pytest.mark.slow
def test_a_description_of_ones_own_in_another_order_agrees(write):
    scene = few(screwgauge.load_scene("3ups-upu-s"))
    tables = read_tables(scene.mechanism_file, mechanism_path)
    for key in ("bodies", "joints", "independent"):
        tables[key] = dict(reversed(tables[key].items()))
    path = write("backwards.toml", tomli_w.dumps(tables))
    agreed(screwgauge.run(replace(scene, models={"screw": path}), engines=["screw", "pinocchio", "truth"]))
