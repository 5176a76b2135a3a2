from pathlib import Path

import numpy as np
import pytest

import screwgauge
from screwgauge import ScrewgaugeError
from support.command import main
from support.data import data
from support.engines import get_engine, model_files, stopped_after
from support.errors import ClosureError
from support.judging import LIMIT
from support.pages import markdown
from support.report import report, verdict
from support.scene import check_start, doubts

FALL = data("fall-scene.toml")
SQUARE = "a02-fourbar-2"


@pytest.fixture
def scene(write):
    def make(**entries: str) -> Path:
        usual = {"mechanism": SQUARE, "gravity": "[0, -9.81, 0]", "time": "duration = 0.4\nstep = 0.1"}
        usual |= {"start": "", "rates": "crank = -1", "method": "", "more": ""}
        return write("fall.toml", FALL.format(**usual | entries))

    return make


def run(path: Path, **more: object):
    return screwgauge.run(screwgauge.load_scene(path), **more)


@pytest.mark.slow
def test_a_motion_through_a_singular_pose_says_so_and_is_flagged_from_there_on(scene):
    """Beyond b = 0.3568 rad the platform's third rotation is free."""
    results = run(
        scene(mechanism="3ups-upu-s", gravity="[0, 0, -9.81]", start="b = 0.3", rates="b = 1",
              time="times = [0, 0.02, 0.04, 0.06, 0.08, 0.1]")
    )  # fmt: skip
    (note,) = [note for note in results.solutions["screw"].notes if "singular pose" in note]
    assert "platform gains a freedom" in note
    assert "leg1.wrist" in note
    b = results.values("joint_position")[:, results.components("joint_position").index("s.q2")]
    estimate = results.solutions["screw"].errors["joint_position"].scaled
    assert b[0] < 0.3568 < b[-1]
    assert (estimate[b > 0.3568] > LIMIT).all()
    assert (estimate[b < 0.34] < LIMIT).all()
    flagged = {quantity for (_, quantity), error in results.guard.items() if not error.ok}
    assert flagged >= {"joint_position", "joint_acceleration"}


def test_a_motion_far_from_singular_poses_is_not_flagged(scene):
    results = run(scene())
    assert results.guard
    assert all(error.ok for error in results.guard.values())
    assert not [note for note in results.solutions["screw"].notes if "passes" in note]


def test_a_start_at_a_branch_point_is_called_singular(scene, refused):
    assert "singular" in refused("run", scene(start='crank = "-pi/2"'))


@pytest.mark.parametrize(
    ("entries", "words"),
    [
        ({"time": "times = [0.0]"}, "the only time"),
        ({"start": "crank = 1e20"}, "away from the home pose"),
        ({"gravity": "[0, 0, 0]", "more": '[[motors]]\ncoordinate = "a0"\noffset = 0'}, "nothing exerts a force"),
    ],
)  # fmt: skip
def test_what_cannot_be_integrated_is_refused_before_any_engine(scene, refused, entries, words):
    assert words in refused("run", scene(**entries))


def test_a_start_beside_a_dead_point_is_not_refused(scene, monkeypatch):
    def beyond(*_: object) -> None:
        raise ClosureError("the loops cannot close", "beside the start", "look elsewhere")

    monkeypatch.setattr("screwgauge.scene.simulation.eigenvalues", beyond)
    assert check_start(screwgauge.load_scene(scene()))[1] == ()


def test_a_start_in_degrees_is_asked_about(scene):
    for start, said in (("crank = -1.5", False), ("crank = 30", True), ("crank = '30*deg'", False)):
        warnings = doubts(screwgauge.load_scene(scene(start=start)))
        sentence = "the start crank = 30 rad is more than a turn from home (degrees are written as '30*deg')"
        assert [*warnings] == [sentence] * said


@pytest.fixture
def no_engine(stand_in):
    order: list[str] = []

    def absent(problem) -> None:
        order.append("screw")
        raise ImportError("not wanted here")

    stand_in(screw=absent)
    return order


STIFF = '[[springs]]\ncoordinate = "a0"\ndamping = 1e6'


def test_the_warning_of_a_stiff_scene_comes_before_the_integration(scene, no_engine):
    run(scene(more=STIFF), warn=lambda sentence: no_engine.append(sentence[:18]))
    assert no_engine == ["The scene is stiff", "screw"]


def test_the_warning_goes_to_standard_error(scene, no_engine, capsys, tmp_path):
    assert main(["run", str(scene(more=STIFF)), "--out", str(tmp_path / "out")]) == 3
    assert capsys.readouterr().err.startswith("screwgauge: warning: The scene")


def test_an_engine_that_stops_is_not_said_to_have_run(scene, stand_in):
    def half(problem):
        return stopped_after(right.solve(problem), 2, "t = 0.1 s: no step leads on")

    right = get_engine("screw").load(model_files(SQUARE, "screw"))
    stand_in(screw=half)
    results = run(scene())
    assert "✗ stopped after t = 0.1 s" in markdown(report(results, []))
    assert "nothing after t = 0.1 s: t = 0.1 s" in verdict(results).text
    assert results.outcome == "partly"
    assert np.isinf(results.solutions["screw"].errors["joint_position"].scaled[2:]).all()


def test_a_start_that_is_too_far_names_the_distance(scene):
    with pytest.raises(ScrewgaugeError, match="check the units"):
        run(scene(start="crank = 2000"))
