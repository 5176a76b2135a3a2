import json
from dataclasses import replace

import numpy as np
import pytest

import screwgauge
from support.data import data
from support.engines import Values, ask, model_files, stopped_after
from support.mechanism import load_mechanism
from support.scene import check_start, eigenvalues
from support.solve import layout
from support.tolerances import NINE_DIGITS, PUBLISHED, STEPPED

OBSERVABLES = {
    "a01-pendulum": ("x", "y"),
    "a02-fourbar-2": ("B0.x", "B0.y"),
    "a02-fourbar-40": ("B0.x", "B0.y"),
    "a03-andrews-ivp": ("F.x", "F.y", "beta"),
    "a03-andrews-iftomm": ("F.x", "F.y", "beta"),
    "a04-bricard-thin": ("P3.x", "P3.y", "P3.z"),
    "a04-bricard-box": ("P3.x", "P3.y", "P3.z"),
    "a05-governor": ("s",),
}
SPRUNG = data("sprung-scene.toml")


@pytest.fixture
def sprung(write):
    def make(**entries: object):
        usual = {"mechanism": "a01-pendulum", "duration": 1, "forward": "start = { angle = 0.5 }"}
        usual |= {"coordinate": "pivot", "stiffness": 4, "damping": 0}
        return screwgauge.load_scene(write("sprung.toml", SPRUNG.format(**usual | entries)))

    return make


def pendulum(problem):
    return ask("screw", model_files("a01-pendulum", "screw"), problem)


@pytest.mark.parametrize("name", OBSERVABLES)
def test_established_problems_are_scenes_with_a_reference(name):
    scene = screwgauge.load_scene(name)
    assert tuple(item.name for item in scene.observables) == OBSERVABLES[name]
    assert np.array_equal(scene.known.t, scene.t)
    assert scene.published


def test_times_after_the_start_may_be_asked_for():
    scene = screwgauge.load_scene("a01-pendulum")
    late = screwgauge.run(scene.at([0.5, 1.0]), engines=["screw"])
    assert late.ok
    assert len(late.times) == 2


def test_spring_swings_as_its_closed_form(sprung):
    """1 kg at 1 m on 4 N m/rad: 0.5 cos 2 t."""
    results = screwgauge.run(sprung())
    error = results.values("observable", "screw")[:, 0] - 0.5 * np.cos(2.0 * results.times)
    assert np.abs(error).max() < STEPPED
    assert results.ok


def test_work_of_a_damper_is_in_the_balance_of_energy(sprung):
    results = screwgauge.run(sprung(damping=1.0))
    assert results.judge.set_index("residual").loc["energy_balance", "ok"]


@pytest.mark.slow
def test_judge_faults_a_motion_whose_energy_grows(stand_in):
    def wrong(problem):
        solution = pendulum(problem)
        v = solution.values["joint_velocity"]
        faster = Values(v.components, v.units, v.array * (1.0 + 1e-6 * np.arange(len(v.array))[:, None]))
        return replace(solution, values={**solution.values, "joint_velocity": faster})

    stand_in(pinocchio=wrong)
    scene = screwgauge.load_scene("a01-pendulum").at([0.0, 0.5, 1.0])
    results = screwgauge.run(scene, engines=["screw", "pinocchio"])
    faulted = results.judge[~results.judge["ok"]]
    assert list(faulted["engine"]) == ["pinocchio"]
    assert list(faulted["residual"]) == ["energy_balance"]
    assert not results.ok


def test_an_engine_that_stops_early_is_compared_so_far_and_has_a_row(stand_in):
    stand_in(mujoco=lambda problem: stopped_after(pendulum(problem), 2, "no step leads on"))
    scene = screwgauge.load_scene("a01-pendulum").at([0.0, 0.5, 1.0])
    results = screwgauge.run(scene, engines=["screw", "mujoco"])
    lost = results.pairs[results.pairs["reason"] != ""]
    assert lost["reason"].str.contains("mujoco.* after t = 0.5 s").all()
    known = results.pairs[(results.pairs["a"] == "mujoco") & (results.pairs["b"] == "reference")]
    assert known["max_abs"].min() < NINE_DIGITS  # what it did compute is compared
    assert results.exit_status == 1
    assert np.isnan(results.values("observable", "mujoco")[2]).all()


def test_an_engine_that_refuses_is_a_row_with_its_reason(stand_in):
    def refuses(problem):
        raise ValueError("no body without inertia")

    stand_in(mujoco=refuses)
    results = screwgauge.run(screwgauge.load_scene("a01-pendulum").at([0.0, 0.5]), engines=["screw", "mujoco"])
    assert results.exit_status == 3
    assert "no body without inertia" in results.failures["mujoco"].reason
    assert (results.pairs["reason"] == "ValueError: no body without inertia").sum() == 2


def test_a_motion_beyond_the_limits_of_a_joint_is_no_plain_agreement(sprung, write):
    write("m.toml", 'extends = "a01-pendulum"\nname = "m"\n[joints.pivot]\nlimits = [["-pi/2", 0.2]]\n')
    results = screwgauge.run(sprung(mechanism="m.toml", forward="start = { angle = -0.5 }"))
    (note,) = [note for note in results.solutions["screw"].notes if "outside" in note]
    assert note.startswith("'pivot' = 0.208")  # -0.5 cos 2 t
    assert "limits [-1.5708, 0.2] at t = 1 s" in note
    said = " ".join(str(results).split())
    assert said.startswith("✓ WITHIN TOLERANCE, but: 'pivot' = 0.208")
    assert said.count("limits do not act as stops") == 1


def test_stiff_scene_with_an_explicit_method_is_warned_of(sprung):
    """1e4 N m s/rad on 1 kg m^2 limits DOP853 to steps of 0.6 ms."""
    scene = sprung(damping=1e4, duration=1)
    (warning,) = check_start(scene)[1]
    assert "fastest eigenvalue at the start, -1e+04 1/s" in warning
    assert "0.0006 s, i.e. 1.7e+03 steps" in warning
    assert check_start(scene.at([0.0, 0.006]))[1] == ()
    implicit = sprung(damping=1e4, duration=1, forward='method = "BDF"')
    assert check_start(implicit)[1] == ()


def test_eigenvalues_of_the_governor_are_the_known_ones():
    """Published with its reference: -8117, -1450, -20.30, -20.05, +-7.346i, and zeros of the spin."""
    scene = screwgauge.load_scene("a05-governor")
    lay = layout(load_mechanism("a05-governor"))
    found = eigenvalues(lay, scene.applied, scene.start.start, scene.start.rates)
    found = found[np.abs(found) > 1.0]
    known = np.array([-8117.0, -1450.0, -20.30, -20.05, 7.346j, -7.346j])
    for value in known:
        assert np.abs(found - value).min() < PUBLISHED[0] * abs(value) + PUBLISHED[1]


@pytest.mark.slow
def test_report_tells_of_start_springs_and_published_results(tmp_path):
    scene = screwgauge.load_scene("a05-governor").at([0.0, 0.05])
    results = screwgauge.run(scene, engines=["screw"])
    results.write(tmp_path)
    text = (tmp_path / "report.md").read_text(encoding="utf-8")
    for words in (
        "from slider (0.05, 0, 0) to right (0.5, 0, 0)",
        "Radau, rtol 1e-7",
        "## Published results",
        "OpenSim",
        "other machines",
    ):
        assert words in text
    summary = json.loads((tmp_path / "summary.json").read_text(encoding="utf-8"))
    assert summary["engines"].keys() == {"screw"}
    assert summary["warnings"] == []


@pytest.mark.slow
def test_command_line_runs_a_forward_scene(write, tmp_path, command):
    path = write(
        "short.toml",
        SPRUNG.format(
            mechanism="a01-pendulum",
            duration=0.3,
            forward="rtol = 1e-8",
            coordinate="pivot",
            stiffness=4,
            damping=0,
        ),
    )
    assert "energy balance" in command("run", path, "--out", tmp_path / "out").out
