import random
import tomllib
from pathlib import Path

import pytest
from fuzz import FORMATS, attempted, document, mutate

import screwgauge
from screwgauge import ScrewgaugeError, load_scene
from support.mechanism import load_mechanism, mechanism_names, mechanism_path
from support.scene import FOLDER, check_home, scene_names

pytestmark = pytest.mark.slow

TRIES = 30  # of the mechanisms together so many that what may be put in, and what may be hit, all occur


def attempt(action, done: str) -> bool:
    try:
        action()
    except ScrewgaugeError as error:
        refusal = str(error)
    except Exception as error:
        raise AssertionError(f"{done}: {type(error).__name__}: {error}") from error
    else:
        return True
    assert "\n" not in refusal, done
    return False


def accepted(table, chance: random.Random, tries: int, path: Path, action) -> int:
    path.write_text(document(table), encoding="utf-8")
    assert attempt(action, "nothing")
    count = 0
    for _ in range(tries):
        changed, done = mutate(table, chance)
        path.write_text(document(changed), encoding="utf-8")
        count += attempt(action, done)
    return count


@pytest.mark.sampled(4)
@pytest.mark.slow
@pytest.mark.parametrize("name", mechanism_names())
def test_a_mutated_mechanism_is_read_or_refused(name, tmp_path):
    chance, path = random.Random(f"mechanism {name}"), tmp_path / "m.toml"
    table = tomllib.loads(mechanism_path(name).read_text(encoding="utf-8"))
    # forty four-bars have the entries of two, of which every kind is tried there, and take twenty times as long to read
    tries = TRIES // 3 if name == "a02-fourbar-40" else TRIES
    assert accepted(table, chance, tries, path, lambda: check_home(load_mechanism(path))) < tries


# the scene of forty four-bars has the entries of that of two, and a mechanism that takes long to read
@pytest.mark.sampled(2)
@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name in scene_names() if name != "a02-fourbar-40"])
def test_a_mutated_scene_is_read_or_refused(name, tmp_path):
    chance, path = random.Random(f"scene {name}"), tmp_path / "s.toml"
    table = tomllib.loads((FOLDER / f"{name}.toml").read_text(encoding="utf-8"))
    table["figures"] = table.pop("figures", [])[:1]
    table.pop("reference", None)  # a file beside the scene
    table["time"] = {"duration": 1, "step": 0.25}
    assert accepted(table, chance, TRIES, path, lambda: load_scene(path)) < TRIES


@pytest.mark.slow
def test_a_scene_of_a_mutated_mechanism_runs_or_is_refused(tmp_path, paper_scene):
    table = tomllib.loads(mechanism_path("3ups-upu-s").read_text(encoding="utf-8"))
    path = paper_scene(mechanism='mechanism = "m.toml"')

    def run() -> None:
        screwgauge.run(load_scene(path), engines=["screw"])

    assert accepted(table, random.Random("runs"), TRIES, tmp_path / "m.toml", run) < TRIES


@pytest.mark.slow
def test_a_mutated_scene_runs_or_is_refused(tmp_path):
    path, table = tmp_path / "s.toml", tomllib.loads((FOLDER / "3ups-upu-s.toml").read_text(encoding="utf-8"))
    table["time"] = {"times": [0, 0.5]}
    del table["figures"]
    assert accepted(table, random.Random("scenes"), TRIES, path, lambda: screwgauge.run(load_scene(path), ["screw"]))


@pytest.mark.slow
def test_a_mutated_forward_scene_runs_or_is_refused(tmp_path):
    path, table = tmp_path / "s.toml", tomllib.loads((FOLDER / "a05-governor.toml").read_text(encoding="utf-8"))
    table |= {"time": {"times": [0, 0.002]}, "engines": ["screw"]}
    table["forward"] |= {"rtol": 1e-3, "atol": 1e-3}
    del table["reference"]
    assert accepted(table, random.Random("forward"), TRIES, path, lambda: screwgauge.run(load_scene(path), ["screw"]))


@pytest.mark.slow
@pytest.mark.parametrize("first", range(2254, 2314, 20))  # every way to break every format is among these
def test_a_scene_with_a_broken_file_runs_or_is_refused_in_one_sentence(first):
    found = [attempted(seed) for seed in range(first, first + 20)]
    assert len({case.file for case, _ in found}) > len(FORMATS) / 2
    for case, what in found:
        assert not what.startswith("WRONG"), f"{case}: {what}"
