"""A scene that is none, or a command that asks for what does not exist, is refused in one sentence."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import screwgauge
from screwgauge import ScrewgaugeError, load_scene
from support.command import main
from support.scene import scene_names


@pytest.mark.parametrize("name", ["3ups", "scene.json", "x" * 5000, "", ".", "\udcff"])
def test_unknown_scene_is_refused(name, refused):
    said = refused("run", name)
    assert "unknown scene '" in said
    assert any(name in said for name in scene_names())
    assert "the path of a TOML file" in said


def test_folder_is_no_scene(tmp_path, refused):
    (tmp_path / "folder.toml").mkdir()
    assert "folder.toml: cannot be read (is a directory)" in refused("run", tmp_path / "folder.toml")


def test_scene_that_is_no_text_is_refused(tmp_path, refused):
    (tmp_path / "s.toml").write_bytes(b"\x80\x81")
    assert "s.toml: is not UTF-8 text" in refused("run", tmp_path / "s.toml")


@pytest.mark.parametrize("line", ["rule = ", "[time", "rule = 'min_norm", "rule = 'a'\nrule = 'b'"])
def test_toml_syntax_error_names_file_and_line(line, paper_scene, refused):
    said = refused("run", paper_scene(rule=line))
    assert "scene.toml: TOML syntax error" in said
    assert "at line" in said or "at end of document" in said


@pytest.mark.parametrize(("option", "kind"), [("--engines", "engine"), ("--quantities", "quantity")])
@pytest.mark.parametrize("names", ["nothing", "screw,joint_position,nothing", "Screw", "screw joint_position"])
def test_unknown_engine_or_quantity_on_the_command_line_is_refused(option, kind, names, paper_scene, refused):
    said = refused("run", paper_scene(), option, names)
    assert f"screwgauge: unknown {kind} " in said
    assert ("mujoco" if kind == "engine" else "tree_force") in said


@pytest.mark.parametrize(("key", "kind"), [("engines", "engine"), ("quantities", "quantity")])
@pytest.mark.parametrize("value", ['["nothing"]', "[1]", "[[]]", "[{}]", "[true]", '[""]'])
def test_unknown_engine_or_quantity_in_the_scene_is_refused(key, kind, value, paper_scene, refused):
    said = refused("run", paper_scene(names=f"{key} = {value}"))
    assert f"scene.toml: unknown {kind} " in said


@pytest.mark.parametrize("value", ['"screw"', "1", "true", "{}"])
@pytest.mark.parametrize("key", ["engines", "quantities"])
def test_names_that_are_no_list_are_refused(key, value, paper_scene, refused):
    said = refused("run", paper_scene(names=f"{key} = {value}"))
    assert "scene.toml: " in said
    assert "is not a list of names" in said or "no engine is named" in said or "no quantity is named" in said


@pytest.mark.parametrize(("option", "kind"), [("--engines", "engine"), ("--quantities", "quantity")])
@pytest.mark.parametrize("names", ["", ",", " , "])
def test_no_engine_or_no_quantity_is_refused(option, kind, names, paper_scene, refused):
    assert f"no {kind} is named; name at least one of: " in refused("run", paper_scene(), option, names)


@pytest.mark.parametrize(("key", "kind"), [("engines", "engine"), ("quantities", "quantity")])
def test_no_engine_or_no_quantity_in_the_scene_is_refused(key, kind, paper_scene, refused):
    assert f"scene.toml: no {kind} is named" in refused("run", paper_scene(names=f"{key} = []"))


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


@pytest.mark.parametrize(
    ("entry", "place", "hint"),
    [
        ("mechansim = 1", "scene.toml: ", "did you mean 'mechanism'?"),
        ("time = { duration = 1, steps = 1 }", "scene.toml, time: ", "did you mean 'step'?"),
        ("motion = { a = {}, b = {}, c = {} }", "scene.toml, motion: ", "a, b"),
        ("motion = { a = { ofset = 1 }, b = {} }", "scene.toml, motion.a: ", "did you mean 'offset'?"),
        ('motion = { csv = "m.csv", a = {} }', "scene.toml, motion: ", "csv"),
        (
            'loads = [{ on = "platform", by = "environment", forces = [0, 0, 1] }]',
            "loads: ",
            "did you mean 'force'?",
        ),
        (
            "tolerances = { joint_positions = 1e-9 }",
            "scene.toml, tolerances: ",
            "did you mean 'joint_position'?",
        ),
        ('models = { scrow = "x" }', "scene.toml, models: ", "did you mean 'screw'?"),
        ('figures = [{ titel = "x" }]', "scene.toml, figures: ", "did you mean 'title'?"),
    ],
)
def test_unknown_key_is_refused_with_the_nearest_known(entry, place, hint, paper_scene, refused):
    said = refused("run", paper_scene(**{entry.split(" ")[0]: entry}))
    assert place in said
    assert "unknown " in said
    assert hint in said


@pytest.mark.parametrize("key", ["mechanism", "motion"])
def test_missing_entry_is_named(key, paper_scene, refused):
    assert f"scene.toml: '{key}' is missing" in refused("run", paper_scene(**{key: ""}))


def test_missing_time_grid_is_refused(paper_scene, refused):
    assert "scene.toml, time: there is no time grid" in refused("run", paper_scene(time=""))


@pytest.mark.parametrize("missing", ["a", "b"])
def test_missing_motion_of_a_coordinate_is_named(missing, paper_scene, refused):
    other = "b" if missing == "a" else "a"
    said = refused("run", paper_scene(motion=f"motion = {{ {other} = {{}} }}"))
    assert f"scene.toml, motion: '{missing}' is missing" in said


@pytest.mark.parametrize("rule", ['"minimum"', "1", '["min_norm"]', "{}", '""'])
def test_unknown_rule_is_refused(rule, paper_scene, refused):
    said = refused("run", paper_scene(rule=f"rule = {rule}"))
    assert "scene.toml: unknown rule " in said
    assert "spherical_axial" in said


@pytest.mark.parametrize("name", ['"no-such"', '"."', '""', f'"{"x" * 5000}"'])
def test_unknown_mechanism_in_a_scene_is_refused(name, paper_scene, refused):
    said = refused("run", paper_scene(mechanism=f"mechanism = {name}"))
    assert "scene.toml: unknown mechanism '" in said


@pytest.mark.parametrize(
    ("load", "what"),
    [
        ('on = "platfrom", by = "environment"', "unknown body 'platfrom'; did you mean 'platform'?"),
        ('on = "environment", by = "ground"', "unknown body 'ground'"),
        ('on = "platform", by = "leg1.upper"', "one is a body, the other 'environment'"),
        ('on = "environment", by = "environment"', "one is a body, the other 'environment'"),
        ('on = "platform"', "'by' is missing"),
        ('by = "platform"', "'on' is missing"),
        ('on = ["platform"], by = "environment"', "is not text"),
        ('on = "platform", by = "environment"', "the load exerts nothing"),
        ('on = "platform", by = "environment", point = [0, 0, 1]', "the load exerts nothing"),
        ('on = "platform", by = "environment", force = 1000', "is not a list of 3 numbers"),
        ('on = "platform", by = "environment", force = [0, 1000]', "is not a list of 3 numbers"),
        ('on = "platform", by = "environment", force = [0, 0, nan]', "'nan' cannot be read as a number"),
        ('on = "platform", by = "environment", torque = [0, true, 0]', "True cannot be read as a number"),
        ('on = "platform", by = "environment", torque = "0"', "is not a list of 3 numbers"),
        ('on = "platform", by = "environment", point = "tip", force = [1, 0, 0]', "is not a list of 3 numbers"),
    ],
)
def test_a_load_that_is_none_is_refused(load, what, paper_scene, refused):
    said = refused("run", paper_scene(loads=f"loads = [{{ {load} }}]"))
    assert "scene.toml, loads" in said
    assert what in said


@pytest.mark.parametrize(
    ("time", "what"),
    [
        ("{ duration = 1 }", "'step' is missing"),
        ("{ step = 1 }", "'duration' is missing"),
        ("{ duration = -1, step = 0.1 }", "time.duration: -1 is not positive"),
        ("{ duration = 1, step = -0.1 }", "time.step: -0.1 is not positive"),
        ("{ duration = 1, step = 0 }", "time.step: 0 is not positive"),
        ("{ duration = 1, step = 5 }", "time: the step of 5 s is longer than the duration of 1 s; check their units"),
        ("{ duration = 0, step = 1 }", "time.duration: 0 is not positive"),
        ("{ duration = nan, step = 1 }", "time.duration: 'nan' cannot be read"),
        ("{ duration = inf, step = 1 }", "time.duration: 'inf' cannot be read"),
        ("{ duration = true, step = 1 }", "time.duration: True cannot be read"),
        ("{ duration = 1, step = 1, times = [0] }", "'times' is not a list on its own"),
        ("{ times = [] }", "at least one time"),
        ("{ times = 1 }", "'times' is not a list"),
        ('{ times = "0, 1" }', "'times' is not a list"),
        ("{ times = [[0], [1]] }", "cannot be read as a number"),
        ("{ times = [0, nan] }", "'nan' cannot be read as a number"),
        ("{ times = [0, true] }", "True cannot be read as a number"),
        ("{ times = [{}] }", "cannot be read as a number"),
        ("[0, 1]", "is not a table"),
        ("1", "is not a table"),
    ],
)
def test_a_time_grid_that_is_none_is_refused(time, what, paper_scene, refused):
    said = refused("run", paper_scene(time=f"time = {time}"))
    assert "scene.toml, time" in said
    assert what in said


@pytest.mark.parametrize("step", ["1e-12", "9.9e-7", '"1e-99"'])
def test_more_than_ten_million_samples_are_refused_at_once(step, paper_scene, refused):
    said = refused("run", paper_scene(time=f"time = {{ duration = 10, step = {step} }}"))
    assert "scene.toml, time" in said
    assert "samples, more than 1e+07" in said
    assert "take a longer step" in said


@pytest.mark.parametrize(
    "times",
    [
        5,
        "0",
        [],
        [[0.0, 1.0]],
        [True],
        [None],
        [float("nan")],
        [0.0, float("inf")],
        ["a", 0.5],
        [1j],
        {0.0: 1},
    ],
)
def test_python_refuses_times_that_are_none(times):
    with pytest.raises(ScrewgaugeError, match=r"^times: "):
        load_scene("3ups-upu-s").at(times)


@pytest.mark.parametrize("times", [[0, 0.5], (0.0,), np.array([0.0, 0.5]), np.array([1, 2]), ["1/3"], [np.float64(1)]])
def test_python_takes_times_of_any_number_type(times):
    assert len(load_scene("3ups-upu-s").at(times).motion) == len(times)


@pytest.mark.parametrize(
    "entry",
    [
        "title = 1",
        "title = []",
        "description = {}",
        "mechanism = 1",
        'mechanism = ["3ups-upu-s"]',
        "motion = 1",
        "motion = []",
        'motion = "slow"',
        "motion = { a = 1, b = {} }",
        "motion = { a = [], b = {} }",
        "motion = { a = { offset = [] }, b = {} }",
        "motion = { a = { offset = true }, b = {} }",
        "motion = { a = { offset = \"__import__('os')\" }, b = {} }",
        "motion = { a = { harmonics = 1 }, b = {} }",
        "motion = { a = { harmonics = [1, 0, 0] }, b = {} }",
        "motion = { a = { harmonics = [[1, 0]] }, b = {} }",
        "motion = { a = { harmonics = { omega = 1 } }, b = {} }",
        "motion = { a = { polynomial = [] }, b = {} }",
        "motion = { a = { polynomial = 1 }, b = {} }",
        "motion = { a = { polynomial = [[1]] }, b = {} }",
        "motion = { csv = 1 }",
        "motion = { csv = [] }",
        "gravity = 9.81",
        "gravity = [0, -9.81]",
        'gravity = "down"',
        "gravity = [0, 0, nan]",
        "gravity = [0, 0, false]",
        "gravity = {}",
        "loads = 1",
        "loads = {}",
        "loads = [1]",
        'loads = ["platform"]',
        "tolerances = 1",
        "tolerances = []",
        "tolerances = { reaction = 0 }",
        "tolerances = { reaction = -1e-9 }",
        "tolerances = { reaction = nan }",
        "tolerances = { reaction = [] }",
        "models = 1",
        "models = []",
        "models = { screw = 1 }",
        "models = { screw = [] }",
        "figures = 1",
        "figures = {}",
        "figures = [1]",
        'figures = [{ title = "t" }]',
        'figures = [{ title = 1, quantity = "reaction", unit = "N", panels = {} }]',
        'figures = [{ title = "t", quantity = [], unit = "N", panels = {} }]',
        'figures = [{ title = "t", quantity = "reaction", unit = 1, panels = {} }]',
        'figures = [{ title = "t", quantity = "reaction", unit = "N", panels = [] }]',
        'figures = [{ title = "t", quantity = "reaction", unit = "N", panels = { a = 1 } }]',
        'figures = [{ title = "t", quantity = "reaction", unit = "N", panels = { a = "leg*" } }]',
        'figures = [{ title = "t", quantity = "reaction", unit = "N", panels = { a = [1] } }]',
    ],
)
def test_a_value_of_the_wrong_type_is_refused(entry, paper_scene, refused):
    assert "scene.toml" in refused("run", paper_scene(**{entry.split(" ")[0]: entry}))


def test_rule_without_its_joint_is_refused(write, refused):
    pendulum = Path(__file__).with_name("data") / "pendulum.toml"
    text = f"mechanism = '{pendulum}'\nrule = 'spherical_axial'\nmotion = {{ a = {{}}, b = {{}} }}\n"
    text += "time = { times = [0] }"
    assert "rule 'spherical_axial' needs a spherical joint" in refused("run", write("s.toml", text))


@pytest.mark.parametrize("below", ["", "below", "below/that"])
def test_output_below_a_file_is_refused_and_the_file_kept(below, tmp_path, paper_scene, refused):
    (tmp_path / "file").write_text("mine", encoding="utf-8")
    out = tmp_path / "file" / below
    said = refused("run", paper_scene(), "--engines", "screw", out=out)
    assert f"{out}: the folder cannot be written" in said
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
    assert "is empty; name a file or folder, or leave it out" in capfd.readouterr().err
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("arguments", [["run", "--out"], ["run", "--engine"], ["list", "colours"], ["run", "a", "b"]])
def test_wrong_usage_exits_with_2(arguments, capfd):
    with pytest.raises(SystemExit) as caught:
        main(arguments)
    assert caught.value.code == 2
    assert "usage: screwgauge" in capfd.readouterr().err


def test_unknown_part_of_a_model_is_refused(refused):
    assert "bogus" in refused("models", "3ups-upu-s", "--include", "bogus")
