from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import screwgauge
from support.command import main
from support.errors import OutputError, UnknownNameError
from support.report import EXPORTED

ASKED = ("joint_position", "joint_velocity", "actuator_force", "reaction")


@pytest.fixture(scope="module")
def results():
    scene = screwgauge.load_scene("slider-crank").at(np.linspace(0.0, 1.0, 7))
    return screwgauge.run(scene, ["screw", "pinocchio"], ASKED)


def test_a_file_has_times_positions_and_forces_with_units_to_the_last_bit(results, tmp_path):
    (file,) = results.to_csv(tmp_path / "values.csv")
    read = pd.read_csv(file, dtype=str).astype(float)
    assert read.columns[0] == "t [s]"
    assert (read["t [s]"] == results.times).all()
    expected = {
        f"{quantity}/{name} [{unit}]{' not unique' * (name in results.not_unique.get(quantity, ()))}": column
        for quantity in (set(ASKED) & set(EXPORTED))
        for values in [results.quantity(quantity, "screw")]
        for name, unit, column in zip(values.components, values.units, values.array.T, strict=True)
    }
    assert {*read.columns} == {"t [s]", *expected}
    assert all((read[name] == column).all() for name, column in expected.items())
    assert any(name.endswith("] not unique") for name in read)


def test_each_engine_has_a_file_in_a_folder(results, tmp_path):
    files = results.to_csv(tmp_path / "new" / "values", quantities=["joint_velocity"])
    assert [file.name for file in files] == ["screw.csv", "pinocchio.csv"]
    for file, engine in zip(files, ("screw", "pinocchio"), strict=True):
        read = pd.read_csv(file, dtype=str).astype(float)
        assert (read.to_numpy()[:, 1:] == results.values("joint_velocity", engine)).all()
    (one,) = results.to_csv(tmp_path / "p.csv", engine="pinocchio", quantities=["joint_velocity"])
    assert one.read_bytes() == files[1].read_bytes()


@pytest.mark.slow
def test_what_a_run_writes_a_scene_reads_as_a_table_of_one_s_own(results, tmp_path, inside):
    results.to_csv("mine.csv")
    Path("own.toml").write_text(
        (Path(screwgauge.__file__).parent / "scenes" / "slider-crank.toml")
        .read_text(encoding="utf-8")
        .replace("mechanism", 'tables.mine = "mine.csv"\nmechanism', 1),
        encoding="utf-8",
    )
    scene = screwgauge.load_scene("own.toml").at(results.times)
    again = screwgauge.run(scene, ["screw", "mine"], EXPORTED[:3])
    assert {*again.pairs["quantity"]} == {*EXPORTED[:3]}
    assert again.ok
    assert (again.pairs["max_abs"] == 0.0).all()


def test_samples_that_an_engine_did_not_solve_have_no_row(results, tmp_path):
    partly = replace(results.solutions["screw"], rows=np.array([1, 2]))
    (file,) = replace(results, solutions={"screw": partly}).to_csv(tmp_path / "v.csv")
    assert pd.read_csv(file)["t [s]"].tolist() == pytest.approx(results.times[[1, 2]])


def test_nothing_that_is_there_is_replaced_without_leave(results, tmp_path):
    (tmp_path / "pinocchio.csv").write_text("mine", encoding="utf-8")
    with pytest.raises(OutputError, match=r"pinocchio\.csv: already exists"):
        results.to_csv(tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["pinocchio.csv"]
    results.to_csv(tmp_path, force=True)
    assert (tmp_path / "pinocchio.csv").read_text(encoding="utf-8").startswith("t [s],")


def test_values_that_nobody_changed_are_written_again(results, tmp_path):
    (file,) = results.to_csv(tmp_path / "v.csv", quantities=["joint_velocity"])
    results.to_csv(file)
    text = file.read_text(encoding="utf-8")
    assert "actuator_force/" in text
    file.write_text(f"{text}9.0\n", encoding="utf-8")
    with pytest.raises(OutputError, match=r"force=True"):
        results.to_csv(file)
    assert file.read_text(encoding="utf-8") == f"{text}9.0\n"


@pytest.mark.parametrize("asked", [{"engine": "scew"}, {"quantities": ["reactions"]}])
def test_names_that_are_not_there_are_said(asked, results, tmp_path):
    with pytest.raises(UnknownNameError, match="did you mean"):
        results.to_csv(tmp_path / "v.csv", **asked)
    assert [*tmp_path.iterdir()] == []


@pytest.mark.slow
def test_the_command_writes_them_beside_its_report(tmp_path, inside, command):
    asked = ["run", "slider-crank", "--engines", "screw", "--quantities", "actuator_force", "--out", "out"]
    said = command(*asked, "--csv", "values")
    assert said.out.endswith("values: values/screw.csv\n")
    assert Path("values/screw.csv").read_text(encoding="utf-8").startswith("t [s],actuator_force/crank [N m]\n0.0,")
    assert main([*asked, "--csv", "values"]) == 0  # as nobody changed them
    assert main([*asked, "--csv", "out/errors.csv"]) == 2
