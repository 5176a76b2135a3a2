from collections.abc import Iterator

import pytest

import screwgauge
from screwgauge.contract import test_mechanisms
from screwgauge.contract.fixtures import *  # noqa: F403
from screwgauge.contract.test_answers import *  # noqa: F403
from screwgauge.contract.test_mechanisms import *  # noqa: F403
from screwgauge.contract.test_mechanisms import (
    test_a_quantity_is_that_of_the_solver,
    test_a_random_mechanism_agrees,
    test_the_judge_faults_nothing,
)
from screwgauge.contract.test_refusals import *  # noqa: F403
from screwgauge.contract.test_tasks import *  # noqa: F403
from screwgauge.families.draw import families
from support.engines import ENGINES, IN_DOUBLES, Engine, check_engines, further_engines, get_engine
from support.mechanism import KINDS, load_mechanism
from support.scene import BODY_UNITS, GIVEN, RATE, TABLE, GivenMotion, InitialValue, States

FURTHER = {"toy": "support.toy_engine:TOY", "frozen": "support.frozen_engine:FROZEN"}
#: Which the tests of built-in and random mechanisms compare already, or which are wrong on purpose.
COMPARED = {*IN_DOUBLES, "truth", "toy"}
LEGS = ("leg1", "leg2", "leg3", "leg4")

#: Components of the 3-UPS-UPU-S, in the order that users rely on, and their units.
JOINTS = {
    **{f"{leg}.q{i}": "m" if i == 3 else "rad" for leg in LEGS for i in range(1, 6 if leg == "leg1" else 7)},
    **{f"s.q{i}": "rad" for i in (1, 2, 3)},
}
BODIES = [
    f"{body}.{x}" for body in (*(f"{g}.{h}" for g in LEGS for h in ("lower", "upper")), "platform") for x in "xyz"
]
TREES = {"minimal": [n for n in JOINTS if n.startswith("leg1") or (n[-2:] in ("q1", "q2", "q3") and n[0] == "l")]}
TREES |= {"full": [*JOINTS], "": TREES["minimal"]}
FORCE = {"rad": "N m", "m": "N"}
REACTIONS = {
    **{f"{leg}.base.{part}": "N m" if part == "m" else "N" for leg in LEGS for part in ("fx", "fy", "fz", "m")},
    **{f"{g}.slide.{p}": "N m" if p[0] == "m" else "N" for g in LEGS for p in ("fx", "fy", "mx", "my", "mz")},
    **{f"leg1.wrist.{part}": "N m" if part == "m" else "N" for part in ("fx", "fy", "fz", "m")},
    **{
        f"{joint}.{part}": "N"
        for joint in ("leg2.wrist", "leg3.wrist", "leg4.wrist", "s")
        for part in ("fx", "fy", "fz")
    },
}


def components(quantity: str, cut: str) -> dict[str, str]:
    known = TABLE[quantity]
    if known.of == "joint":
        return {name: f"{unit}{RATE[known.needs]}" for name, unit in JOINTS.items()}
    if known.of == "body":
        return dict.fromkeys(BODIES, BODY_UNITS[known.body])
    if quantity.startswith("tree_force"):
        return {name: FORCE[JOINTS[name]] for name in TREES[cut]}
    return {
        "generalized_force": {"a": "N m", "b": "N m"},
        "actuator_force": dict.fromkeys(LEGS, "N"),
        "reaction": REACTIONS,
    }[quantity]


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    if "engine_name" in metafunc.fixturenames:
        names = [*dict.fromkeys((*(next(iter(one.methods)) for one in ENGINES.values()), *FURTHER))]
        if metafunc.function.__module__ == test_mechanisms.__name__:
            marks = [
                pytest.mark.slow,
                *[pytest.mark.sampled(4)] * (metafunc.function is test_a_random_mechanism_agrees),
            ]
            there = [name for name in names if name in FURTHER or get_engine(name).installed]
            # of the engine that stays as it is: features and random mechanisms, all built-in ones in thorough runs
            late = [pytest.mark.thorough] * (
                metafunc.function in (test_a_quantity_is_that_of_the_solver, test_the_judge_faults_nothing)
            )
            names = [
                pytest.param(name, marks=[*marks, *(late if name == "frozen" else [])])
                for name in there
                if name not in COMPARED
            ]
        metafunc.parametrize("engine_name", names, scope="session")


@pytest.fixture(scope="session")
def entry(engine_name: str) -> Iterator[Engine]:
    with further_engines({engine_name: FURTHER[engine_name]} if engine_name in FURTHER else {}):
        engine = get_engine(engine_name)
        if not engine.installed:
            pytest.skip(f"{engine.package} is not installed")
        yield engine


def test_components_are_those_that_users_rely_on(answer, subject) -> None:
    if subject.mechanism.name != "3ups-upu-s-asymmetric":
        pytest.skip("it takes other mechanisms only")
    assert {*answer.values} == {*GIVEN} - {*subject.engine.lacks}
    for name, values in answer.values.items():
        expected = components(name, subject.engine.cut)
        assert dict(zip(values.components, values.units, strict=True)) == expected, name
        assert values.components == tuple(expected), name


def test_a_scene_is_put_to_engines_that_take_its_task(entry) -> None:
    for task in (GivenMotion, InitialValue, States):
        if task in entry.tasks:
            assert check_engines([entry.name], task=task) == (entry.name,)
        else:
            with pytest.raises(
                screwgauge.ScrewgaugeError, match=rf"engine '{entry.name}' does not .*; choose from screw"
            ):
                check_engines([entry.name], task=task)


def test_a_simulation_says_its_method(fall_answer) -> None:
    assert "DOP853, rtol 1e-06, atol 1e-08" in fall_answer.setting


def test_mechanisms_of_the_contract_have_all_that_there_is() -> None:
    known = [*map(load_mechanism, (screwgauge.load_scene(name).mechanism.where for name in test_mechanisms.MECHANISMS))]
    assert {joint.kind for one in known for joint in one.joints} >= {*KINDS}
    assert any(one.couplings for one in known)
    assert any(len(coupling.named) > 2 for one in known for coupling in one.couplings)
    assert {each.what for one in known for each in one.resistances} == {"rotor", "damping", "friction"}
    assert any(len(one.actuator_names) > len(one.independent) for one in known)
    scenes = [*map(screwgauge.load_scene, test_mechanisms.MECHANISMS)]
    for what in ("loads", "springs", "motors"):
        assert any(getattr(scene.applied, what) for scene in scenes), what
    assert families()
