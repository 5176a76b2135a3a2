import re

import numpy as np
import pandas as pd
import pytest

import screwgauge
from screwgauge import Recorded, ScrewgaugeError, load_scene
from support.report import summary

SCENE = """mechanism = "five-bar"
motion = { left = { harmonics = [[3, 0, 0.2]] }, right = { harmonics = [[4, -0.3, 0.2]], offset = 0.3 } }
engines = ["screw", "pinocchio"]
"""
TIMES = [0.0, 0.25, 0.5, 0.75]


@pytest.fixture(scope="module")
def right(tmp_path_factory) -> pd.DataFrame:
    path = tmp_path_factory.mktemp("right") / "scene.toml"
    path.write_text(f"{SCENE}time.times = {TIMES}\n", encoding="utf-8")
    found = screwgauge.run(load_scene(path), ["screw"]).solutions["screw"].values
    columns = {
        f"{quantity}/{component} [{unit}]": column
        for quantity, values in found.items()
        if not quantity.startswith("tree_force")
        for component, unit, column in zip(values.components, values.units, values.array.T, strict=True)
    }
    return pd.DataFrame({"t [s]": TIMES, **columns})


@pytest.fixture
def scene(write, right, tmp_path):
    def make(table: pd.DataFrame | str = "", *, entries: str = "", name: str = "mine.csv") -> screwgauge.Scene:
        return load_scene(path(table, entries=entries, name=name))

    def path(table: pd.DataFrame | str = "", *, entries: str = "", name: str = "mine.csv"):
        if isinstance(table, str):
            write(name, table)
        elif name.endswith(".csv"):
            table.to_csv(tmp_path / name, index=False)
        else:
            table.to_parquet(tmp_path / name)
        return write("scene.toml", f'{SCENE}tables.mine = "{name}"\n{entries}\n')

    make.path = path
    return make


def forces(right: pd.DataFrame, scale: float = 1.0) -> pd.DataFrame:
    """Actuator forces, without their units."""
    names = {column: column.split(" ")[0] for column in right if column.startswith("actuator_force/")}
    return pd.DataFrame({"t": right["t [s]"], **{short: scale * right[column] for column, short in names.items()}})


def test_whole_table_is_compared_and_judged_like_an_engine(scene, right):
    results = screwgauge.run(scene(right))
    assert results.ok, results
    assert [*results.solutions] == ["screw", "pinocchio", "mine"]
    rows = results.pairs[results.pairs["b"] == "mine"]
    assert {*rows["a"]} == {"screw", "pinocchio"}
    assert {*rows["quantity"]} == {name for name in results.scene.quantities if not name.startswith("tree_force")}
    judged = results.judge.groupby("engine")["residual"].agg(set)
    assert judged["mine"] == {name for name in judged["screw"] if not name.startswith("tree_force")}
    found = summary(results)
    assert found["engines"]["mine"] == "mine.csv"
    assert len(found["models"]["mine"]["sha256"]) == 64
    assert repr(results).startswith("✓ AGREE:")
    assert any("has no tree_force" in note for note in results.solutions["mine"].notes)


@pytest.mark.parametrize(("header", "factor"), [("time", 1.0), ("t [ms]", 1e3), ("time [us]", 1e6)])
def test_times_have_the_name_and_unit_of_a_log(header, factor, scene, right):
    table = forces(right)
    table[header] = factor * table.pop("t")
    results = screwgauge.run(scene(table), quantities=["actuator_force"])
    assert {*results.pairs["quantity"]} == {"actuator_force"}
    assert results.ok
    said = [note for note in results.solutions["mine"].notes if header in note]
    assert bool(said) is (factor != 1.0)


def test_bare_names_will_do_where_only_one_quantity_has_them(scene, right):
    table = forces(right).rename(columns=lambda name: name.removeprefix("actuator_force/"))
    assert screwgauge.run(scene(table), quantities=["actuator_force", "com_acceleration"]).ok


def test_parquet_is_read_like_csv(scene, right):
    pytest.importorskip("pyarrow")
    results = screwgauge.run(scene(right, name="mine.parquet"), ["screw", "mine"], ["actuator_force", "reaction"])
    assert results.ok
    assert results.pairs["max_abs"].max() == 0.0


def test_one_wrong_number_is_found_where_it_stands(scene, right):
    wrong = right.copy()
    wrong.loc[2, "actuator_force/right [N m]"] *= 1.0 + 1e-6
    results = screwgauge.run(scene(wrong), ["screw", "mine"], ["actuator_force", "joint_position"])
    assert results.exit_status == 1
    (bad,) = results.pairs[~results.pairs["ok"]].to_dict("records")
    assert (bad["quantity"], bad["worst_component"], bad["worst_t"]) == ("actuator_force", "right", 0.5)
    assert {*results.judge[~results.judge["ok"]]["engine"]} == {"mine"}


def test_what_a_table_leaves_out_is_named_and_no_failure(scene, right):
    results = screwgauge.run(scene(forces(right)[["t", "actuator_force/right"]]))
    assert results.ok
    said = " ".join(repr(results).split())
    assert said.startswith("✓ AGREE, but: mine has no ")
    assert "1 of the 2 components" in said
    assert any(note == "has no left for actuator_force" for note in results.solutions["mine"].notes)
    assert not (results.judge["engine"] == "mine").any()
    assert {*results.pairs[results.pairs["b"] == "mine"]["quantity"]} == {"actuator_force"}
    assert results.errors[results.errors["b"] == "mine"]["component"].unique() == ["right"]


def test_scale_is_that_of_all_components(scene, right):
    results = screwgauge.run(scene(forces(right)[["t", "actuator_force/right"]]), ["mine", "screw"], ["actuator_force"])
    assert {*results.errors["scale"]} == {np.abs(results.values("actuator_force", "screw")).max()}


def test_forces_alone_are_judged_at_the_motion_of_the_scene(scene, right):
    good, bad = (screwgauge.run(scene(forces(right, scale)), ["mine"], ["actuator_force"]) for scale in (1.0, 1.001))
    assert good.ok
    assert bad.exit_status == 1
    assert {*bad.judge["residual"]} >= {"virtual_work"}
    assert "loop_closure" not in {*good.judge["residual"]}


def test_scene_is_evaluated_at_the_times_of_the_table(scene, right):
    results = screwgauge.run(scene(forces(right), entries="time = { duration = 1, step = 0.1 }"))
    assert results.ok, results
    assert results.times == pytest.approx([0, 0.1, 0.2, 0.25, 0.3, 0.4, 0.5, 0.6, 0.7, 0.75, 0.8, 0.9, 1.0])
    assert [*np.flatnonzero(np.isfinite(results.values("actuator_force", "mine")[:, 0]))] == [0, 3, 6, 9]
    assert "mine has only 4 of the 13" in " ".join(repr(results).split())


def test_times_rounded_otherwise_are_the_same(scene, right):
    table = forces(right).assign(t=[0.1, 0.2, 0.3, 0.7])
    assert len(scene(table, entries="time = { duration = 1, step = 0.1 }").t) == 11  # 3 * 0.1 is not 0.3


def test_other_times_leave_rows_out_and_say_so(scene, right):
    results = screwgauge.run(scene(forces(right)).at([0.0, 0.5]), ["screw", "mine"], ["actuator_force"])
    assert results.ok
    assert any("2 of its 4 times" in note for note in results.solutions["mine"].notes)
    with pytest.raises(ScrewgaugeError, match=r"mine.csv: contains none"):
        screwgauge.run(scene(forces(right)).at([0.1]))


def test_degrees_are_told_by_their_factor_and_whole_turns_do_not_count(scene, right):
    angles = ["t [s]", *(name for name in right if name.startswith("joint_position/"))]

    def ran(change):
        table = right[angles].copy()
        table[angles[1:]] = change(table[angles[1:]])
        return screwgauge.run(scene(table), ["screw", "mine"], ["joint_position"])

    assert ran(lambda q: q + 2.0 * np.pi).ok
    assert not ran(lambda q: q + np.pi).ok
    found = ran(np.rad2deg).reviews["mine"]
    assert {fault.of for column in found.columns for fault in column.faults} == {"degrees"}


@pytest.mark.parametrize(("factor", "faults"), [(-1.0, ["sign"]), (1e3, ["N mm"]), (-1e3, ["sign", "N mm"])])
def test_a_factor_throughout_is_named(factor, faults, scene, right):
    results = screwgauge.run(scene(forces(right, factor)), ["screw", "mine"], ["actuator_force"])
    columns = results.reviews["mine"].columns
    assert [[fault.of or fault.kind for fault in column.faults] for column in columns] == [faults, faults]


@pytest.mark.slow
def test_an_error_that_is_stated_is_admitted_of_the_table_alone(scene, right):
    table = forces(right).round(3)
    entries = "tables.mine = { file = 'mine.csv', error.actuator_force = 6e-4 }"
    usual = screwgauge.run(scene(table), quantities=["actuator_force"])
    assert usual.exit_status == 1
    path = scene.path(table)
    path.write_text(f"{SCENE}{entries}\n", encoding="utf-8")
    results = screwgauge.run(load_scene(path), quantities=["actuator_force"])
    assert results.ok, results
    assert results.pairs[results.pairs["b"] == "pinocchio"]["tolerance"].max() == 1e-11
    assert any("0.0006 N m" in reason for reason in results.pairs["reason"])
    (row,) = screwgauge.check(path, tolerances={"joint_position": 1e-9}).rows
    assert row.ok
    assert any(error.reason.endswith(", the error stated in mine") for error in row.errors if error.b == "mine")


def test_arrays_are_a_table_too(scene, right):
    plain = load_scene(scene.path(right)).at(TIMES)
    columns = {name: right[name] for name in right if name.startswith("actuator_force")}
    beside = plain.beside(theirs=Recorded(TIMES, columns))
    results = screwgauge.run(beside, ["screw", "mine", "theirs"], ["actuator_force"])
    assert results.ok
    assert results.pairs["b"].tolist() == ["mine", "theirs", "theirs"]


def test_an_exciting_motion_has_no_tables(scene, right, refused):
    assert "scene's motion" in refused("run", scene.path(right), "--exciting")


def test_the_bench_measures_no_tables(scene, right, refused):
    assert "not on your own" in refused("bench", scene.path(right))


@pytest.mark.parametrize(
    ("t", "columns", "said"),
    [
        ([0.0, 1.0], {"a": [1.0]}, r"column 'a' has shape \(1,\), but there are 2"),
        ([[0.0]], {"a": [1.0]}, "is not a list of times"),
        ([0.0], {"a": [np.nan]}, "finite number in data row 1"),
        ([0.0], {}, "has no column besides t"),
        ([0.0], {"a": ["x"]}, "column 'a' has no finite number"),
    ],
)
def test_arrays_that_are_no_table_are_refused(t, columns, said):
    with pytest.raises(ScrewgaugeError, match=said):
        Recorded(t, columns)


def test_a_table_that_is_not_asked_for_is_said(scene, right):
    results = screwgauge.run(scene(forces(right)), ["screw"])
    assert any("(tables.mine) is ignored" in text for text in results.warnings)


def test_a_table_of_some_positions_decides_nothing_on_what_is_zero(write):
    """Pin and guide share a point: the guide's moment is rounding."""
    hinge = 'kind = "R", axes = [[0, 0, 1]]'
    write(
        "crank.toml",
        f"""name = "crank"
independent = {{ crank = "a" }}
[bodies]
crank = {{ mass = 0.8, com = [0.06, 0, 0], inertia = {{ xx = 1e-4, yy = 2.5e-3, zz = 2.5e-3 }} }}
rod = {{ mass = 1.1, com = [0.2, 0, 0], inertia = {{ xx = 2e-4, yy = 1.6e-2, zz = 1.6e-2 }} }}
slider = {{ mass = 2.0, inertia = {{ xx = 2e-3, yy = 2e-3, zz = 2e-3 }} }}
[joints]
a = {{ {hinge}, parent = "ground", child = "crank", actuated = true }}
b = {{ {hinge}, parent = "crank", child = "rod", parent_frame.position = [0.12, 0, 0] }}
c = {{ {hinge}, parent = "rod", child = "slider", parent_frame.position = [0.4, 0, 0] }}
s = {{ kind = "P", axes = [[1, 0, 0]], parent = "ground", child = "slider", parent_frame.position = [0, 0.05, 0] }}
""",
    )
    text = """mechanism = "crank.toml"
gravity = [0, -9.81, 0]
motion.crank.polynomial = [0, "2*pi"]
time = { duration = 1, step = 0.01 }
"""
    found = screwgauge.run(load_scene(write("plain.toml", text)), ["screw"], ["joint_position"])
    positions = found.solutions["screw"].values["joint_position"]
    names = [f"joint_position/{name}" for name in positions.components]
    table = pd.DataFrame(positions.array, columns=names).drop(columns="joint_position/c")
    write("some.csv", table.assign(t=found.times).to_csv(index=False))
    results = screwgauge.run(load_scene(write("scene.toml", f'{text}tables.mine = "some.csv"\n')))
    assert results.ok
    assert results.pairs["quantity"].eq("reaction").any()


def test_the_pair_that_is_out_of_tolerance_is_shown_before_one_that_differs_more(right, scene):
    given = scene(forces(right, 1.0 + 1e-6))
    rough = forces(right, 1.0 + 1e-3)
    error = {"actuator_force": float(0.01 * rough.drop(columns="t").abs().max().max())}
    given = given.beside(rough=Recorded(rough.pop("t"), dict(rough), error=error))
    results = screwgauge.run(given, ["screw", "mine", "rough"], ["actuator_force"])
    assert re.search(r"^actuator_force .* screw - mine ", repr(results), re.MULTILINE)
