from dataclasses import replace
from pathlib import Path

import pytest

import screwgauge
from screwgauge import ScrewgaugeError, load_scene
from support.bench import QUICK, bench
from support.engines import ENGINES, Method, ask, model_files, put
from support.questions import findings
from support.report import summary
from support.scene import GivenMotion
from support.stress import CASES, REFUSED

QUANTITIES = ["joint_position", "joint_velocity", "generalized_force", "actuator_force"]
SAID = "did not return the requested generalized_force, actuator_force"


def only(*names: str, of: str = "3ups-upu-s"):

    def solve(problem):
        found = ask("screw", model_files(of, "screw"), problem)
        return replace(found, values={name: found.values[name] for name in names if name in found.values})

    return solve


def test_a_run_names_what_is_missing(stand_in, scene):
    stand_in(mujoco=only("joint_position", "joint_velocity"))
    results = screwgauge.run(scene, engines=["screw", "mujoco"], quantities=QUANTITIES)
    assert not results.ok
    assert results.exit_status == 1
    assert f"mujoco: {SAID}." in repr(results)
    lost = results.pairs[~results.pairs["ok"]]
    assert [*lost["quantity"]] == QUANTITIES[2:]
    assert lost["max_scaled"].isna().all()
    assert lost["reason"].str.contains(f"mujoco {SAID}", regex=False).all()
    assert set(results.pairs[results.pairs["ok"]]["quantity"]) == set(QUANTITIES[:2])


def test_an_engine_alone_that_leaves_out_is_no_success(stand_in, scene):
    stand_in(mujoco=only("joint_position", "joint_velocity"))
    results = screwgauge.run(scene, engines=["mujoco"], quantities=QUANTITIES)
    assert results.exit_status == 1
    assert repr(results).startswith(f"✗ PARTLY: mujoco: {SAID}.")
    (refused,) = summary(results)["refused"]
    assert refused == {"engine": "mujoco", "quantities": QUANTITIES[2:], "samples": 2, "reason": SAID}


def test_what_nobody_gives_is_named_of_everyone(stand_in, scene):
    stand_in(mujoco=only("joint_position"), pinocchio=only("joint_position"))
    results = screwgauge.run(scene, engines=["pinocchio", "mujoco"], quantities=["joint_position", "reaction"])
    assert results.exit_status == 1
    assert {(one.engine, one.quantities) for one in results.refusals} == {
        ("pinocchio", ("reaction",)),
        ("mujoco", ("reaction",)),
    }


@pytest.mark.slow
@pytest.mark.parametrize("given", [("joint_position",), ("joint_velocity", "joint_acceleration"), ()])
def test_a_simulation_without_all_joint_motions_is_no_agreement(given, stand_in):
    stand_in(mujoco=only(*given, of="a01-pendulum"))
    results = screwgauge.run(load_scene("a01-pendulum").at([0.0, 0.1]), engines=["screw", "mujoco"])
    assert results.exit_status == 1
    assert not results.pairs["ok"].all()
    assert "mujoco: did not return " in " ".join(repr(results).split())


def test_observables_alone_need_joint_positions_alone_and_rates_to_be_judged(stand_in):
    scene = load_scene("a01-pendulum").at([0.0, 0.1])
    stand_in(mujoco=only("joint_position", "joint_velocity", "joint_acceleration", of="a01-pendulum"))
    assert screwgauge.run(scene, engines=["screw", "mujoco"], quantities=["observable"]).ok
    stand_in(mujoco=only("joint_position", of="a01-pendulum"))
    results = screwgauge.run(scene, engines=["screw", "mujoco"], quantities=["observable"])
    assert (results.outcome, results.unjudged) == ("unjudged", ("mujoco",))


def test_what_an_engine_cannot_give_is_said_and_no_failure(monkeypatch, stand_in, scene):
    entry = replace(ENGINES["mujoco"], lacks={"actuator_force": "its motors are sealed"})
    monkeypatch.setitem(ENGINES, "mujoco", entry)
    stand_in(mujoco=only("joint_position", "joint_velocity", "generalized_force"))
    results = screwgauge.run(scene, engines=["screw", "mujoco"], quantities=QUANTITIES)
    assert results.ok
    (note,) = results.solutions["mujoco"].notes
    assert note.endswith("actuator_force: its motors are sealed")
    alone = screwgauge.run(scene, engines=["screw", "mujoco"], quantities=["generalized_force"])
    assert not any("sealed" in note for note in alone.solutions["mujoco"].notes)


@pytest.mark.slow
@pytest.mark.parametrize("name", ENGINES)
def test_entries_say_what_their_engines_cannot_give(name, scene):
    """`ask` refuses whatever lacks something."""
    if not ENGINES[name].installed:
        pytest.skip(f"{name} is not installed")
    results = screwgauge.run(scene, engines=[name], quantities=scene.quantities)
    assert not results.refusals
    assert {*results.solutions[name].values} == {*scene.quantities} - {*ENGINES[name].lacks}


def test_the_bench_has_rows_that_say_so(stand_in):
    stand_in(mujoco=only())
    scene = load_scene("3ups-upu-s").at([0.0, 0.5])
    rows = bench(scene, plan=replace(QUICK, rounds=1, samples=2), contestants=["mujoco-path"]).rows
    assert {row.status for row in rows} == {"failed"}
    assert [row.reason for row in rows if "did not return the requested" not in row.reason] == []


def test_a_stress_case_has_rows_that_say_so(stand_in, tmp_path: Path):
    stand_in(mujoco=only("joint_position"))
    case = CASES["speed"]
    question = next(iter(case.ask(case.quick[0], True, tmp_path)))
    found = list(findings(replace(question, methods=(Method("mujoco"),))))
    assert found
    assert {one.verdict for one in found} == {REFUSED}
    assert all("did not return the requested" in one.reason for one in found)


def test_a_stream_stops_there(stand_in):
    stand_in(mujoco=only("joint_position"))
    scene = load_scene("3ups-upu-s")
    assert isinstance(scene.task, GivenMotion)
    with pytest.raises(ScrewgaugeError, match="did not return the requested actuator_force"):
        next(screwgauge.stream(scene, [scene.t[:2]], engine="mujoco", quantities=["actuator_force"]))


def test_a_method_that_leaves_out_fails(stand_in, scene):
    stand_in(mujoco=only("joint_position"))
    found = put(Method("mujoco"), model_files("3ups-upu-s", "mujoco"), scene.problem(QUANTITIES))
    assert found.reason.endswith("did not return the requested joint_velocity, generalized_force, actuator_force")


@pytest.mark.parametrize("how", [SystemExit(0), SystemExit("enough")])
def test_an_engine_that_exits_is_a_row(how, stand_in, scene):
    def leave(problem):
        raise how

    stand_in(mujoco=leave)
    results = screwgauge.run(scene, engines=["screw", "mujoco"], quantities=QUANTITIES)
    assert results.exit_status == 3
    assert results.failures["mujoco"].reason.startswith("SystemExit: ")


@pytest.mark.slow
def test_what_one_engine_gives_alone_is_said_to_be_compared_with_none(scene):
    results = screwgauge.run(scene, engines=["pinocchio", "mujoco-full"], quantities=["tree_force", "actuator_force"])
    said = " ".join(repr(results).split())
    assert all(f"Not compared: tree_force of {name}," in said for name in ("pinocchio", "mujoco-full"))
    both = screwgauge.run(scene, engines=["screw", "mujoco"], quantities=["tree_force", "actuator_force"])
    assert "no other engine" not in repr(both)


def test_no_times_are_said_to_be_none(scene):
    with pytest.raises(ScrewgaugeError, match="the list of times is empty; add"):
        scene.at([])
