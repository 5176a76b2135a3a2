"""Work that a request leaves out."""

from collections import Counter

import pytest

import screwgauge
from screwgauge.engines.screw import inverse as screw
from screwgauge.engines.tree import closed_forces, inverse
from screwgauge.judging.residual import JUDGE_COLUMNS, frame
from support.at_origin import BodyAccelerations
from support.bench import Plan, bench
from support.equations import Dynamics, Ops

pytestmark = pytest.mark.slow


@pytest.fixture
def calls(monkeypatch) -> Counter[str]:
    """Count executions of each stage."""
    found: Counter[str] = Counter()

    def count(owner: object, name: str, stage: str) -> None:
        original = getattr(owner, name)

        def counted(*args, **kwargs):
            found[stage] += 1
            return original(*args, **kwargs)

        monkeypatch.setattr(owner, name, counted)

    count(screw.Work, "close", "positions")
    for name in ("velocities", "accelerations", "virtual_power", "constraint_forces"):
        count(Dynamics, name, {"velocities": "rates"}.get(name, name))
    count(BodyAccelerations, "needs", "inertia")
    count(Ops, "square", "actuators")
    count(inverse._Pass, "_velocities", "rates")
    count(closed_forces, "min_norm", "min_norm")
    count(closed_forces, "joint_reactions", "reactions")
    from support.trees import MujocoTree, PinocchioTree

    for tree in (MujocoTree, PinocchioTree):
        for name in ("bias", "com_accelerations", "tree_force", "soft_force", "transmitted"):
            count(tree, name, name)
    return found


def run(engine: str, *quantities: str) -> None:
    scene = screwgauge.load_scene("3ups-upu-s").at([0.5])
    results = screwgauge.run(scene, engines=[engine], quantities=quantities)
    assert set(results.solutions[engine].values) == set(quantities)


def executed(calls: Counter[str]) -> set[str]:
    return {stage for stage, n in calls.items() if n}


SCREW = [
    (["joint_position"], {"positions"}),
    (["joint_velocity"], {"positions", "rates"}),
    (["joint_acceleration"], {"positions", "rates", "accelerations"}),
    (["com_acceleration"], {"positions", "rates", "accelerations"}),
]
FORCES = {"positions", "rates", "accelerations", "inertia"}


@pytest.mark.parametrize(
    ("asked", "stages"),
    [
        *SCREW,
        (["tree_force"], FORCES),
        (["generalized_force"], FORCES | {"virtual_power"}),
        (["actuator_force"], FORCES | {"virtual_power", "actuators"}),
        (["reaction"], FORCES | {"virtual_power", "actuators", "constraint_forces"}),
    ],
)
def test_screw_executes_only_what_is_needed(calls, monkeypatch, asked, stages):
    monkeypatch.setattr("screwgauge.study.run.judge", lambda *_, **__: frame((), JUDGE_COLUMNS))
    run("screw", *asked)
    assert executed(calls) == stages
    assert all(n == 1 for n in calls.values())


@pytest.mark.slow
@pytest.mark.parametrize("engine", ["pinocchio", "mujoco"])
@pytest.mark.parametrize(
    ("asked", "stages"),
    [
        (["joint_position"], set()),
        (["joint_velocity"], set()),
        (["joint_acceleration"], {"bias"}),
        (["com_acceleration"], {"bias", "com_accelerations"}),
        (["tree_force"], {"bias", "tree_force"}),
        (["tree_force_soft"], {"bias", "soft_force"}),
        (["generalized_force"], {"bias", "tree_force"}),
        (["actuator_force"], {"bias", "tree_force", "min_norm"}),
        (["reaction"], {"bias", "tree_force", "min_norm", "transmitted", "reactions"}),
    ],
)
def test_tree_engines_execute_only_what_is_needed(calls, engine, asked, stages):
    run(engine, *asked)
    found = executed(calls) - {"rates"}
    # Pinocchio's constraints are rigid: its soft joint forces are the plain ones
    assert found - {"tree_force"} == stages - {"tree_force"} if "soft_force" in stages else found == stages


@pytest.mark.parametrize("asked", ["actuator_force", "joint_acceleration"])
def test_velocity_products_are_asked_for_once(calls, asked):
    run("pinocchio", asked)
    assert calls["bias"] == 1


@pytest.fixture(scope="module")
def table():
    plan = Plan(samples=3, rounds=1, budget=1e9, quick=True)
    scene = screwgauge.load_scene("3ups-upu-s-fast")
    return bench(scene, plan=plan, contestants=["leaving-out"]).leaving_out


def test_what_is_left_is_the_same_to_the_last_bit(table):
    assert table["ratio"].notna().all()
    asked = table[table["group"].isin(["asked for", "absent"])]
    assert len(asked) == 27
    assert (asked["max_difference"] == 0.0).all()
