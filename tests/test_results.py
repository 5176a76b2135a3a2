import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import screwgauge
from screwgauge import ScrewgaugeError
from support.command import main, printed_by
from support.errors import OutputError, UnknownNameError
from support.mechanism import load_mechanism
from support.report import LINES


@pytest.fixture(scope="module")
def results():
    scene = screwgauge.load_scene("3ups-upu-s").at([0.0, 0.5, 1.0])
    return screwgauge.run(replace(scene, figures=scene.figures[:3]), engines=["screw", "pinocchio"])


def test_it_shows_itself_in_one_screen(results):
    lines = repr(results).splitlines()
    assert lines[0].startswith("✓ AGREE: screw and pinocchio agree")
    assert len(lines) <= LINES
    assert max(map(len, lines)) <= 100
    assert "joint_position" in repr(results)


def test_a_long_one_says_that_there_is_more(results, monkeypatch):
    monkeypatch.setattr("screwgauge.report.text.LINES", 5)
    assert len(repr(results).splitlines()) == 5
    assert repr(results).splitlines()[-1] == "... `write` saves the whole report"


@pytest.mark.slow
def test_a_notebook_shows_tables_and_pictures(results):
    shown = results._repr_html_()
    assert shown.startswith('<div class="banner agree">')
    assert "<table>" in shown
    pictures = results.plot()
    assert repr(pictures).splitlines() == [picture.title for picture in pictures]
    assert pictures._repr_html_().count("<svg ") == len(pictures) == 5  # the mechanism, and that of the condition


@pytest.mark.slow
def test_the_page_alone_can_be_written_and_leaves_the_rest(results, tmp_path):
    (tmp_path / "plots").mkdir()
    (tmp_path / "plots" / "mine.svg").write_text("mine")
    page = results.to_html(tmp_path / "page.html")
    assert page.read_text(encoding="utf-8").startswith("<!DOCTYPE html>")
    assert sorted(path.name for path in tmp_path.rglob("*")) == ["mine.svg", "page.html", "plots"]
    with pytest.raises(OutputError, match="is a folder; choose a file name"):
        results.to_html(tmp_path)


def test_an_empty_path_is_not_the_current_folder(results):
    with pytest.raises(OutputError, match=r"is empty, .*; choose a folder"):
        results.write("")
    with pytest.raises(ScrewgaugeError, match="'' is not a name or path"):
        screwgauge.check("")


def test_a_frame_has_times_engines_and_components(results):
    frame = results.frame("actuator_force")
    assert frame.index.name == "t"
    assert frame.index.tolist() == [0.0, 0.5, 1.0]
    assert frame.columns.names == ["engine", "component"]
    for engine in ("screw", "pinocchio"):
        assert (frame[engine].to_numpy() == results.values("actuator_force", engine)).all()
        assert tuple(frame[engine].columns) == results.components("actuator_force")
    with pytest.raises(UnknownNameError, match="did you mean 'actuator_force'"):
        results.frame("actuator_forces")


@pytest.mark.slow
def test_the_page_is_text_without_a_path(results, inside):
    assert results.to_html().startswith("<!DOCTYPE html>")
    assert [*inside.iterdir()] == []


def test_a_scene_shows_itself_in_one_screen():
    for name in ("3ups-upu-s", "a02-fourbar-40", "3ups-upu-s-fast"):
        scene = screwgauge.load_scene(name)
        lines = repr(scene).splitlines()
        assert lines[0] == f"Scene {name}"
        assert len(lines) <= LINES
        assert max(map(len, lines)) <= 100 + len(str(scene.file))
        assert f"<caption>Scene {name}</caption>" in scene._repr_html_()


@pytest.mark.parametrize("name", ["slider-crank", "3ups-upu-s", "a02-fourbar-40", "ruse"])
def test_a_mechanism_shows_itself_in_one_screen(name):
    mechanism = load_mechanism(name)
    lines = repr(mechanism).splitlines()
    counts = {line.split()[0]: int(line.split()[1]) for line in lines if re.match(r"  [a-z]+ +\d", line)}
    sizes = {"bodies": len(mechanism.bodies), "joints": len(mechanism.joints), "freedoms": len(mechanism.independent)}
    sizes |= {"loops": len(mechanism.joints) - len(mechanism.bodies), "actuators": len(mechanism.actuators)}
    assert counts == sizes | {"couplings": len(mechanism.couplings)}
    assert mechanism.bodies[0].name in repr(mechanism)
    assert len(lines) <= LINES
    assert max(map(len, lines)) <= 100


@pytest.mark.slow
def test_a_diagnosis_shows_itself_in_one_screen_and_can_be_written(tmp_path):
    found = screwgauge.diagnose("slider-crank", "slider-crank")
    assert isinstance(found, screwgauge.Diagnosis)
    assert repr(found).startswith("✓ SAME")
    assert len(repr(found).splitlines()) <= LINES
    assert "<table>" in found._repr_html_()
    assert found.to_html().startswith("<!DOCTYPE html>")
    found.write(tmp_path / "out")
    assert {"diagnosis.json", "report.html"} <= {path.name for path in (tmp_path / "out").iterdir()}


@pytest.mark.slow
def test_a_figure_is_found_by_its_name(results):
    assert {picture.of for picture in results.figure("joint_position")} == {"joint_position"}
    assert [picture.name for picture in results.figure("mechanism")] == ["mechanism"]
    assert [picture.name for picture in results.figure("condition")] == ["04-condition"]
    with pytest.raises(UnknownNameError, match=r"'conditions'.*did you mean '04-condition'"):
        results.figure("conditions")


def test_panels_of_figures_that_no_component_matches_are_said(results):
    assert "figure '" not in str(results)
    (first, *_) = results.scene.figures
    wrong = replace(first, title="Mine", panels=(("A", ("leg9.*", *first.panels[0][1])),))
    drawn = replace(results, scene=replace(results.scene, figures=(wrong,)))
    said = f"figure 'Mine': no component of {first.quantity} in {first.unit} matches leg9.*"
    assert said in " ".join(str(drawn).split())
    unasked = replace(first, title="Forces", quantity="observable")
    drawn = replace(results, scene=replace(results.scene, figures=(first, unasked)))
    said = "figure 'Forces' is left out: observable "
    assert said in " ".join(str(drawn).split())


def test_names_that_are_not_there_are_said(results):
    with pytest.raises(UnknownNameError, match="unknown engine 'mujoco'"):
        results.values("joint_position", "mujoco")
    with pytest.raises(UnknownNameError, match="did you mean 'joint_position'"):
        results.values("joint_positon")
    with pytest.raises(UnknownNameError, match="engine truth was not run"):
        results.radius("joint_position")


@pytest.mark.parametrize("what", ["slider-crank", Path("slider-crank.toml"), None])
@pytest.mark.parametrize("call", ["run", "compile", "exciting", "stream"])
def test_what_is_no_scene_is_refused(call, what):
    with pytest.raises(screwgauge.ScrewgaugeError, match=rf"{call}: .* is not a scene; .*load_scene"):
        next(screwgauge.stream(what, [[0.0]])) if call == "stream" else getattr(screwgauge, call)(what)


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        (lambda s: s.under(gravity=[0, 0]), "gravity: .* list of 3 numbers"),
        (lambda s: s.under(gravity=[0, 0, float("nan")]), "gravity: "),
        (lambda s: s.under(gravitty=[0, 0, -9.81]), "'gravitty'.*did you mean 'gravity'"),
        (lambda s: s.under(loads={"on": "rod"}), "under: 'loads' is not a list"),
        (lambda s: s.under(loads=["rod"]), "under, loads: 'rod' is not"),
        (lambda s: s.under(loads=[{"on": "rodd", "by": "environment", "force": [0, 0, 1]}]), "did you mean 'rod'"),
        (lambda s: s.under(springs=[{"coordinate": "a"}]), "springs: .* neither stiffness nor damping"),
        (lambda _: screwgauge.diagnose("slider-crank", "slider-crank", map=3), "map: 3 is neither a file"),
    ],
)
def test_arguments_of_another_type_are_refused(wrong, said):
    with pytest.raises(screwgauge.ScrewgaugeError, match=said):
        wrong(screwgauge.load_scene("slider-crank"))


@pytest.mark.parametrize("force", [[-50, 0, 0], (-50.0, 0.0, 0.0), np.array([-50.0, 0.0, 0.0])])
def test_a_scene_is_put_under_loads_as_a_file_writes_them(force):
    scene = screwgauge.load_scene("slider-crank").at([0.0, 0.1])  # with just this load
    load = {"on": "piston", "by": "environment", "force": force}

    def torque(changed: screwgauge.Scene) -> np.ndarray:
        results = screwgauge.run(changed, engines=["screw"], quantities=["actuator_force"])
        return results.values("actuator_force", engine="screw")

    assert np.array_equal(torque(scene.under(loads=[load])), torque(scene))
    assert np.abs(torque(scene.under(loads=())) - torque(scene)).max() > 0.1  # [N m], of 0.17


def test_a_scene_in_the_place_of_its_name_is_refused():
    with pytest.raises(screwgauge.ScrewgaugeError, match=r"check: Scene .* not a name or path"):
        screwgauge.check(screwgauge.load_scene("slider-crank"))


@pytest.mark.parametrize("seed", [-1, "one", 1.5])
def test_what_is_no_seed_is_refused(seed):
    scene = screwgauge.load_scene("slider-crank")
    for call in (
        lambda: screwgauge.random(seed),
        lambda: screwgauge.exciting(scene, seed),
        lambda: screwgauge.diagnose("slider-crank", "slider-crank", seed=seed),
    ):
        with pytest.raises(screwgauge.ScrewgaugeError, match="is not a seed; "):
            call()


@pytest.mark.parametrize(
    "arguments",
    [
        ["run", "slider-crank", "--exciting", "--seed", "-1"],
        ["diagnose", "slider-crank", "slider-crank", "--seed", "-3"],
    ],
)
def test_counts_of_nothing_and_seeds_that_are_none_are_usage(arguments, capsys):
    with pytest.raises(SystemExit) as ended:
        main(arguments)
    assert ended.value.code == 2
    assert f"argument {arguments[-2]}: {arguments[-1]} is less than" in capsys.readouterr().err


@pytest.mark.slow
def test_the_package_lists_its_public_names_and_only_those():
    code = "import screwgauge; screwgauge.load_scene('3ups-upu-s'); print(*dir(screwgauge))"
    names = [name for name in printed_by(code).split() if not re.fullmatch("__.*__", name)]
    assert names == sorted(screwgauge.__all__)
    for name in names:
        assert getattr(screwgauge, name) is not None
