import multiprocessing
import pickle
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from functools import partial

import numpy as np
import pytest

import screwgauge
from support.bench import contestants, simulators
from support.engines import Method, Solution, check_same, model_files, put
from support.scene import scene_names
from support.stress import CASES


def difference(one: object, other: object, at: str = "") -> str:
    if type(one) is not type(other):
        return f"{at}: {type(one)} and {type(other)}"
    if isinstance(one, np.ndarray):
        return "" if np.array_equal(one, other, equal_nan=one.dtype.kind == "f") else f"{at}: {one} and {other}"
    if isinstance(one, partial):
        parts = {name: (getattr(one, name), getattr(other, name)) for name in ("func", "args", "keywords")}
    elif is_dataclass(one):
        parts = {field.name: (getattr(one, field.name), getattr(other, field.name)) for field in fields(one)}
    elif isinstance(one, Mapping) and [*one] == [*other]:
        parts = {key: (one[key], other[key]) for key in one}
    elif isinstance(one, tuple | list) and len(one) == len(other):
        parts = dict(enumerate(zip(one, other, strict=True)))
    else:
        alike = one == other or (one != one and other != other)  # NaN
        return "" if alike else f"{at}: {one} and {other}"
    return next(filter(None, (difference(*pair, f"{at}.{name}") for name, pair in parts.items())), "")


def check_travels(thing: object) -> None:
    assert difference(thing, pickle.loads(pickle.dumps(thing))) == ""


@pytest.mark.parametrize("name", scene_names())
def test_every_scene_and_its_problem_travel(name):
    scene = screwgauge.load_scene(name)
    check_travels(scene)
    check_travels(scene.problem(scene.quantities))
    copy, later = pickle.loads(pickle.dumps(scene)), scene.t[1 : 1 + len(scene.t) // 2]
    assert difference(scene.at(later).problem(()), copy.at(later).problem(())) == ""  # still a function of time


@pytest.mark.parametrize("quick", [True, False])
def test_every_contestant_of_a_bench_travels(quick):
    everyone = contestants(quick=quick)
    assert everyone
    check_travels(everyone)


@pytest.mark.parametrize("quick", [True, False])
@pytest.mark.parametrize("method", ["Radau", "DOP853"])
def test_every_contestant_of_a_bench_of_simulations_travels(method, quick):
    everyone = simulators(method, 1.0, quick=quick)
    assert everyone
    check_travels(everyone)


@pytest.mark.sampled(3)
@pytest.mark.slow
@pytest.mark.parametrize("name", CASES)
def test_every_stress_case_with_its_questions_and_methods_travels(name, tmp_path):
    check_travels(CASES[name])
    case = pickle.loads(pickle.dumps(CASES[name]))
    assert case.name == name
    last = case.quick[1 if case.whole else -1]  # more loops or samples are more of the same
    for severity in (case.quick[0], last):
        folder = tmp_path / str(severity)
        folder.mkdir()
        with np.errstate(all="ignore"):
            questions = list(case.ask(severity, True, folder))
        assert any(question.methods for question in questions)
        check_travels(questions)


def test_what_does_not_travel_is_noticed():
    scene = screwgauge.load_scene("3ups-upu-s").at([0.0])
    other = scene.under(gravity=np.nextafter(scene.applied.g, 1.0))
    assert difference(scene, other).startswith(".applied.gravity: ")
    assert difference(scene.applied.loads, 2 * scene.applied.loads).startswith(": (Load(")
    with pytest.raises((AttributeError, pickle.PicklingError)):
        check_travels(lambda: None)


@pytest.fixture(scope="module")
def asked() -> dict[str, tuple]:
    given = screwgauge.load_scene("3ups-upu-s-fast").at([0.1, 0.35])
    falling = screwgauge.load_scene("a02-fourbar-2").at([0.0, 0.05, 0.2])
    steps = {"pinocchio": {"dt": 1e-3}, "mujoco": {"dt": 1e-3, "solimp": 0.9999, "passes": 5}}
    cases = {}
    for engine in ("screw", "pinocchio", "mujoco"):
        problems = {"given": (given, {}), "simulated": (falling, {}), "stepped": (falling, steps.get(engine))}
        for what, (scene, settings) in problems.items():
            if settings is not None:
                files = model_files(scene.mechanism.name, engine)
                problem = scene.problem([name for name in scene.quantities if name != "observable"])
                cases[f"{engine} {what}"] = Method(engine, settings), files, problem
    return cases


@pytest.fixture(scope="module")
def elsewhere(asked) -> dict[str, Solution]:
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        return dict(zip(asked, pool.starmap(put, asked.values()), strict=True))


ENGINES_AND_TASKS = [
    *(f"{engine} {what}" for engine in ("screw", "pinocchio", "mujoco") for what in ("given", "simulated")),
    *("pinocchio stepped", "mujoco stepped"),
]


@pytest.mark.sampled(3)
@pytest.mark.slow
@pytest.mark.parametrize("name", ENGINES_AND_TASKS)
def test_a_spawned_process_gives_the_same_bits(name, asked, elsewhere):
    assert [*asked] == sorted(ENGINES_AND_TASKS, key=[*asked].index)
    here = put(*asked[name])
    assert isinstance(here, Solution), here
    assert here.stopped == ""
    check_same(here, elsewhere[name])
