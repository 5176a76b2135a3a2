"""Whatever is deleted from a description or a scene, or replaced, it is read or refused; nothing else happens."""

from __future__ import annotations

import random
import tomllib

import pytest
from fuzz import FORMATS, attempted, document, mutate

import screwgauge
from screwgauge import ScrewgaugeError, load_scene
from screwgauge.models.catalog import load_mechanism, mechanism_names, mechanism_path
from screwgauge.scene.preflight import check_home
from screwgauge.scene.read import FOLDER, scene_names

TRIES = 60


def attempt(action, done: str) -> bool:
    """Whether it went through. Any error but our own fails the test and says what had been done to the file."""
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


@pytest.mark.parametrize("name", mechanism_names())
def test_a_mutated_mechanism_is_read_or_refused(name, write):
    chance = random.Random(f"mechanism {name}")
    table = tomllib.loads(mechanism_path(name).read_text(encoding="utf-8"))
    whole = write("m.toml", document(table))
    assert attempt(lambda: check_home(load_mechanism(whole)), "nothing")
    # forty four-bars have the entries of two, of which every kind is tried there, and take twenty times as long to read
    read, tries = 0, TRIES // 2 if name == "a02-fourbar-40" else TRIES
    for _ in range(tries):
        changed, done = mutate(table, chance)
        path = write("m.toml", document(changed))
        read += attempt(lambda path=path: check_home(load_mechanism(path)), done)
    assert read < tries


# the scene of forty four-bars has the entries of that of two, and a mechanism that takes long to read
@pytest.mark.parametrize("name", [name for name in scene_names() if name != "a02-fourbar-40"])
def test_a_mutated_scene_is_read_or_refused(name, write):
    chance = random.Random(f"scene {name}")
    table = tomllib.loads((FOLDER / f"{name}.toml").read_text(encoding="utf-8"))
    table["figures"] = table.pop("figures", [])[:1]
    table.pop("reference", None)  # a file beside the scene
    table["time"] = {"duration": 1, "step": 0.25}
    whole = write("s.toml", document(table))
    assert attempt(lambda: load_scene(whole), "nothing")
    read = 0
    for _ in range(TRIES):
        changed, done = mutate(table, chance)
        path = write("s.toml", document(changed))
        read += attempt(lambda path=path: load_scene(path), done)
    assert read < TRIES


def test_a_scene_of_a_mutated_mechanism_runs_or_is_refused(write, paper_scene):
    chance = random.Random("runs")
    table = tomllib.loads(mechanism_path("3ups-upu-s").read_text(encoding="utf-8"))
    path = paper_scene(mechanism='mechanism = "m.toml"')
    ran = 0
    for _ in range(TRIES // 2):
        changed, done = mutate(table, chance)
        write("m.toml", document(changed))
        ran += attempt(lambda: screwgauge.run(load_scene(path), engines=["screw"]), done)
    assert ran > 0


def test_a_mutated_scene_runs_or_is_refused(write):
    chance = random.Random("scenes")
    table = tomllib.loads((FOLDER / "3ups-upu-s.toml").read_text(encoding="utf-8"))
    table["time"] = {"times": [0, 0.5]}
    del table["figures"]
    ran = 0
    for _ in range(TRIES // 5):
        changed, done = mutate(table, chance)
        path = write("s.toml", document(changed))
        ran += attempt(lambda path=path: screwgauge.run(load_scene(path), engines=["screw"]), done)
    assert ran > 0


def test_a_mutated_forward_scene_runs_or_is_refused(write):
    """An integration that cannot go on is a row with its reason, and no error either."""
    chance = random.Random("forward")
    table = tomllib.loads((FOLDER / "a05-governor.toml").read_text(encoding="utf-8"))
    table |= {"time": {"times": [0, 0.002]}, "engines": ["screw"]}
    table["forward"] |= {"rtol": 1e-3, "atol": 1e-3}
    del table["reference"]
    ran = 0
    for _ in range(TRIES // 5):
        changed, done = mutate(table, chance)
        path = write("s.toml", document(changed))
        ran += attempt(lambda path=path: screwgauge.run(load_scene(path), engines=["screw"]), done)
    assert ran > 0


@pytest.mark.parametrize("first", range(0, 100, 20))
def test_a_scene_with_a_broken_file_runs_or_is_refused_in_one_sentence(first):
    found = [attempted(seed) for seed in range(first, first + 20)]
    assert len({case.file for case, _ in found}) > len(FORMATS) / 2
    for case, what in found:
        assert not what.startswith("WRONG"), f"{case}: {what}"
