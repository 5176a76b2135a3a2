"""Refused scenes, a row each of ``claims/refused_scenes.toml``."""

import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import screwgauge
from screwgauge import ScrewgaugeError, load_scene
from support.command import main
from support.repository import scene as repository_scene
from support.scene import scene_names

TABLE = tomllib.loads((Path(__file__).parent / "claims" / "refused_scenes.toml").read_text(encoding="utf-8"))


def cases() -> Iterator[Any]:
    for name, group in TABLE["refused"].items():
        for i, row in enumerate(group["rows"]):
            yield pytest.param(group, row, id=f"{name}-{i}")


@pytest.mark.parametrize(("group", "row"), [*cases()])
def test_bad_input_is_refused_at_its_place_with_a_remedy(group, row, write, refused):
    given, *facts = row
    entries = TABLE["scenes"][group.get("scene", "paper")] | group.get("entries", {})
    files, options = dict(TABLE["files"]), []
    if "command" in group:
        options = given
    elif name := group.get("file"):
        files[name] = given if isinstance(given, str) else files[name].replace(*given)
        assert files[name] != TABLE["files"][name]
    else:
        entries |= given if isinstance(given, dict) else entry(group, given)
    for name, text in files.items():
        write(name, text)
    order = sorted(entries, key=lambda key: "\n[" in f"\n{entries[key]}")  # tables end what stands above them
    said = refused("run", write("scene.toml", "".join(f"{entries[key]}\n" for key in order)), *options)
    assert [fact for fact in (group.get("place", ""), *facts) if fact not in said] == [], said


def entry(group: dict[str, Any], given: str) -> dict[str, str]:
    text = group.get("entry", "{}").replace("{}", given, 1)
    return {text.partition(" ")[0]: text}


@pytest.mark.slow
@pytest.mark.parametrize(("options", "text", "fact"), TABLE["gate"]["rows"])
def test_a_check_of_bad_input_is_refused(options, text, fact, theirs, refused):
    for folder in ("empty", "other"):
        (theirs / folder).mkdir()
    (theirs / "other" / "turn.toml").write_text(repository_scene(), encoding="utf-8")
    (theirs / "t.toml").write_text(text, encoding="utf-8")
    assert fact in refused("check", *options.split())


@pytest.mark.parametrize("name", ["3ups", "scene.json", "x" * 5000, "", ".", "\udcff"])
def test_unknown_scene_is_refused(name, refused):
    said = refused("run", name)
    assert "unknown scene '" in said
    assert any(name in said for name in scene_names())
    assert "the path of a TOML file" in said


@pytest.mark.parametrize("names", ["screw", 3, [], [None]])
def test_python_refuses_names_that_are_none(names):
    scene = load_scene("3ups-upu-s").at([0.0])
    for key in ("engines", "quantities"):
        with pytest.raises(ScrewgaugeError):
            screwgauge.run(scene, **{key: names})


def test_names_given_twice_count_once(paper_scene):
    results = screwgauge.run(
        load_scene(paper_scene()), engines=["screw", "screw"], quantities=["joint_position", "joint_position"]
    )
    assert list(results.solutions) == ["screw"]
    assert list(results.solutions["screw"].values) == ["joint_position"]
    assert results.pairs.empty


NO_TIMES = [5, "0", [], [[0.0, 1.0]], [True], [None], [float("nan")], [0.0, float("inf")], ["a", 0.5], [1j], {0.0: 1}]


@pytest.mark.parametrize("times", NO_TIMES)
def test_python_refuses_times_that_are_none(times):
    with pytest.raises(ScrewgaugeError, match=r"^times: "):
        load_scene("3ups-upu-s").at(times)


@pytest.mark.parametrize("times", [[0, 0.5], (0.0,), np.array([0.0, 0.5]), np.array([1, 2]), ["1/3"], [np.float64(1)]])
def test_python_takes_times_of_any_number_type(times):
    assert len(load_scene("3ups-upu-s").at(times).motion) == len(times)


@pytest.mark.parametrize("below", ["", "below", "below/that"])
def test_output_below_a_file_is_refused_and_the_file_kept(below, tmp_path, paper_scene, refused):
    (tmp_path / "file").write_text("mine", encoding="utf-8")
    out = tmp_path / "file" / below
    said = refused("run", paper_scene(), "--engines", "screw", out=out)
    assert f"{out}: cannot write to the folder" in said
    assert "choose another" in said
    said = refused("models", "3ups-upu-s", out=out)
    assert str(out) in said
    assert "cannot be written" in said


@pytest.mark.slow
def test_a_refused_run_leaves_an_earlier_report_untouched(tmp_path, paper_scene, capfd):
    out = tmp_path / "out"
    command = ["run", str(paper_scene()), "--engines", "screw", "--quantities", "generalized_force", "--out", str(out)]
    assert main(command) == 0
    before = {path: path.read_bytes() for path in out.rglob("*") if path.is_file()}
    assert out / "summary.json" in before
    paper_scene(motion="motion = { a = {}, b = { polynomial = [0.3, 1] } }")
    assert main(command) == 2
    assert {path: path.read_bytes() for path in out.rglob("*") if path.is_file()} == before


@pytest.mark.parametrize(
    "arguments",
    [["run", "--out", ""], ["check", ""], ["diagnose", "", "b"], ["import", ""], ["view", "a", "--png", ""]],
)
def test_an_empty_path_is_not_the_current_folder(arguments, tmp_path, inside, capfd):
    with pytest.raises(SystemExit) as caught:
        main(arguments)
    assert caught.value.code == 2
    assert "is empty; pass a file" in capfd.readouterr().err
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("arguments", [["run", "--out"], ["run", "--engine"], ["list", "colours"], ["run", "a", "b"]])
def test_wrong_usage_exits_with_2(arguments, capfd):
    with pytest.raises(SystemExit) as caught:
        main(arguments)
    assert caught.value.code == 2
    assert "usage: screwgauge" in capfd.readouterr().err


def test_unknown_part_of_a_model_is_refused(refused):
    assert "bogus" in refused("models", "3ups-upu-s", "--include", "bogus")
