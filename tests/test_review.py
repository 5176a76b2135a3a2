"""Faults of tables."""

import json
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

import screwgauge
from screwgauge import Recorded, ScrewgaugeError
from screwgauge.study.table_faults import last_place
from screwgauge.study.transformations import UNITS
from support.report import summary
from support.spoilt import DIGITS, SPOILT, noise, printed, right, scene_of
from support.spoilt import times as multiplied

RANDOM = {"noise": 0.15, "offset": 0.02}  # relative error of a size that is estimated from noise


def found_in(review: screwgauge.ReviewReport) -> dict[tuple[str, str], dict[str, float]]:
    """(kind, of what) -> column -> size."""
    faults: dict[tuple[str, str], dict[str, float]] = {}
    for column in review.columns:
        assert column.faults is not None, column
        for fault in column.faults:
            faults.setdefault((fault.kind, fault.of), {})[column.component] = fault.size
    return faults


@pytest.mark.slow
@pytest.mark.parametrize("case", SPOILT)
def test_a_spoilt_table_is_named_sized_and_proved(case):
    scene, table = SPOILT[case].make()
    review = screwgauge.review(table, scene, [SPOILT[case].quantity])
    faults = found_in(review)
    assert {*faults} == {*SPOILT[case].faults}
    for key, (size, columns) in SPOILT[case].faults.items():
        everywhere = {each.component for each in review.columns if each.error > 1e-6}
        assert {*faults[key]} == ({*columns} or everywhere), key
        assert all(each == pytest.approx(size, rel=RANDOM.get(key[0], 1e-4), abs=0) for each in faults[key].values()), (
            key
        )
    proof = 0.1 if ("noise", "") in faults else 10.0 ** (1 - DIGITS)
    assert max(column.left for column in review.columns) < proof
    assert not review.ok
    assert review.explained


@pytest.mark.parametrize(
    ("scene", "quantity"),
    [("slider-crank", "reaction"), ("arm7", "actuator_force"), ("five-bar", "joint_velocity")],
)
def test_a_right_table_is_said_to_be_right(scene, quantity):
    some = scene_of(scene)
    review = screwgauge.review(printed(right(some, quantity), quantity), some)
    assert review
    assert found_in(review) == {}
    assert repr(review).startswith("✓ AGREE: ")


@pytest.mark.parametrize(
    ("quantity", "unit", "factor"),
    [
        ("joint_position", "deg", 180.0 / np.pi),
        ("joint_acceleration", "deg/s^2", 180.0 / np.pi),
        ("actuator_force", "N mm", 1e3),
        ("mass_matrix", "kg cm²", 1e4),
    ],
)
def test_a_table_in_a_unit_that_its_header_says_is_right(quantity, unit, factor):
    some = scene_of("five-bar", 21)
    table = factor * right(some, quantity)
    columns = printed(table, quantity).columns
    plain = screwgauge.review(Recorded(some.t, columns), some, [quantity])
    assert not plain
    said = Recorded(some.t, {f"{name} [{unit}]": values for name, values in columns.items()})
    review = screwgauge.review(said, some, [quantity])
    assert review
    assert found_in(review) == {}
    assert next(iter(said.columns)) in review.verdict
    assert next(iter(said.columns)) not in plain.verdict


def other_masses(scene):
    bodies = [
        replace(body, mass=body.mass * factor, com=body.com + 0.02)
        for body, factor in zip(scene.mechanism.bodies, np.linspace(0.7, 1.6, len(scene.mechanism.bodies)), strict=True)
    ]
    return replace(scene, mechanism=replace(scene.mechanism, bodies=tuple(bodies)))


def other_motion(scene):
    terms = tuple(replace(one, harmonics=one.harmonics * [1.3, 0.8, 0.9]) for one in scene.drive.terms)
    drive = replace(scene.drive, terms=terms)
    return replace(scene, drive=drive, task=drive(scene.t), text={})


@pytest.mark.slow
@pytest.mark.parametrize("digits", [3, DIGITS])
@pytest.mark.parametrize("change", [other_masses, other_motion])
@pytest.mark.parametrize("name", ["five-bar", "3ups-upu-s", "arm7"])
def test_a_table_of_another_machine_is_not_explained(name, change, digits, monkeypatch):
    monkeypatch.setattr("support.spoilt.DIGITS", digits)
    scene = scene_of(name, 101)
    table = printed(right(change(scene), "actuator_force"), "actuator_force")
    review = screwgauge.review(table, scene, ["actuator_force"])
    assert not review.ok
    assert not review.explained
    assert not any(column.faults for column in review.columns)


def test_a_constant_apart_from_another_is_no_offset_of_a_sensor():
    # any two constants are an offset apart, and a factor: as much was fitted as agrees
    scene = screwgauge.load_scene("slider-crank")
    courses = [replace(one, polynomial=one.polynomial[:1], harmonics=one.harmonics[:0]) for one in scene.drive.terms]
    still = replace(scene.drive, terms=tuple(courses))
    scene = replace(scene, drive=still, task=still(np.linspace(0.0, 1.0, 40)), text={})
    table = printed(right(scene, "actuator_force") + 0.7, "actuator_force")
    assert not screwgauge.review(table, scene, ["actuator_force"]).explained


def test_rates_in_the_other_chart_of_a_joint_agree():
    # an S joint has two triples of angles
    scene = scene_of("3ups-upu-s", 41)
    q, v = (right(scene, name) for name in ("joint_position", "joint_velocity"))
    names = [f"leg2.q{k}" for k in (4, 5, 6)]
    columns = {f"joint_position/{name}": (q[name] + np.pi).to_numpy() for name in names}
    columns[f"joint_position/{names[1]}"] = (np.pi - q[names[1]]).to_numpy()
    columns |= {f"joint_velocity/{name}": v[name].to_numpy() for name in names}
    columns[f"joint_velocity/{names[1]}"] = -columns[f"joint_velocity/{names[1]}"]
    columns = {name: values.round(5) for name, values in columns.items()}
    review = screwgauge.review(Recorded(scene.t, columns), scene)
    assert review
    assert len(review.columns) == 6


@pytest.mark.parametrize("times", [[0.3], [0.1, 0.3]])
def test_a_sign_is_told_from_few_samples_and_an_offset_is_not(times):
    scene = scene_of("delta").at(times)
    table = right(scene, "actuator_force")
    negated, off = (screwgauge.review(printed(some, "actuator_force"), scene) for some in (-table, table + 0.5))
    assert {*found_in(negated)} == {("sign", "")}
    assert not any(column.faults for column in off.columns)


def test_a_load_on_the_other_body_is_reversed():
    scene = scene_of("3ups-upu-s", 101)
    other = scene_of("3ups-upu-s-eq55", 101)
    table = printed(right(other, "actuator_force"), "actuator_force")
    faults = found_in(screwgauge.review(table, scene, ["actuator_force"]))
    assert {*faults} == {("reversed", "load on platform")}


@pytest.mark.parametrize(
    ("centred", "of"), [(False, "mean of preceding samples"), (True, "mean of surrounding samples")]
)
def test_a_moving_mean_is_told_with_its_samples(centred, of):
    scene = scene_of("delta")
    table = right(scene, "actuator_force").rolling(7, min_periods=1, center=centred).mean().iloc[6:-6]
    review = screwgauge.review(printed(table, "actuator_force"), scene, ["actuator_force"])
    assert found_in(review) == {("mean", of): dict.fromkeys(table, 7.0)}


def test_a_plain_factor_is_stated_where_no_unit_has_it():
    scene = scene_of("delta")
    table = printed(multiplied(arm2=1.25)(scene, lambda some: right(some, "actuator_force")), "actuator_force")
    assert found_in(screwgauge.review(table, scene)) == {("factor", ""): {"arm2": pytest.approx(1.25)}}


@pytest.mark.parametrize("unit", UNITS)
def test_no_two_units_are_taken_for_each_other(unit):
    sizes = sorted([1.0, *UNITS[unit].values()])
    assert min(np.diff(np.log(sizes))) > 1e-5


@pytest.mark.parametrize(
    ("values", "place"),
    [
        ([1.25, 10.53, 0.01], [0.01] * 3),
        ([1.2345e-3, 12.345, 123.45], [1e-7, 1e-3, 1e-2]),
        ([149.0, 150.0, 3.0], [1.0] * 3),
        ([*np.float32([0.1, 0.2])], [*np.spacing(np.float32([0.1, 0.2]))]),
    ],
)
def test_last_place_is_that_which_was_printed(values, place):
    assert last_place(np.array(values, dtype=float)) == pytest.approx(place)


@pytest.fixture
def spoilt_file(tmp_path):
    """One column negated, one noisy."""
    scene = scene_of("five-bar")
    table = right(scene, "actuator_force")
    table = table.assign(left=-table["left"], right=table["right"] + 1e-3 * noise(len(table), 1))
    path = tmp_path / "mine.csv"
    table.rename_axis("t").rename(columns=lambda name: f"actuator_force/{name} [N m]").to_csv(path)
    return path


def test_command_ends_with_1_where_a_column_is_wrong(spoilt_file, command):
    said = command("review", spoilt_file, "five-bar", status=1).out
    assert said.startswith("✗ FAULTS: ")
    found = json.loads(command("review", spoilt_file, "five-bar", "--json", status=1).out)
    assert (found["ok"], found["explained"], found["name"]) == (False, True, "mine")
    assert [[fault["kind"] for fault in column["faults"]] for column in found["columns"]] == [["sign"], ["noise"]]


def test_command_ends_with_0_where_all_columns_agree(spoilt_file, command):
    table = right(scene_of("five-bar"), "actuator_force").rename_axis("t")
    table.rename(columns=lambda name: f"actuator_force/{name}").to_csv(spoilt_file, float_format="%.6g")
    said = command("review", spoilt_file, "five-bar").out
    assert said.startswith("✓ AGREE: ")
    assert "error.actuator_force" in said


def test_a_run_leads_with_the_fault(spoilt_file):
    columns = pd.read_csv(spoilt_file)
    scene = scene_of("five-bar").beside(mine=Recorded(columns.pop("t"), dict(columns)))
    results = screwgauge.run(scene, ["pinocchio", "mine"], ["actuator_force"])
    assert results.exit_status == 1
    assert repr(results).startswith("✗ DIFFER: mine: left is negated")
    assert [len(column["faults"]) for column in summary(results)["tables"]["mine"]["columns"]] == [1, 1]
    assert "Tables of your own" in results.to_html()


def test_an_engine_that_the_judge_faults_is_no_measure(spoilt_file, stand_in):
    scene = scene_of("five-bar", 21)
    values, q = right(scene, "actuator_force"), right(scene, "joint_position").to_numpy()
    table = Recorded(scene.t, {f"actuator_force/{name}": values[name].to_numpy() for name in values})

    def wrong(problem):
        from screwgauge.solution import Solution, Values

        array = -values.to_numpy()
        return Solution(
            "mujoco", "1", {"actuator_force": Values(tuple(values), ("N m",) * 2, array)}, np.ones(21), assembly=q
        )

    stand_in(mujoco=wrong)
    results = screwgauge.run(scene.beside(mine=table), ["mujoco", "mine"], ["actuator_force"])
    assert not results.reviews


@pytest.mark.parametrize(
    ("numbers", "scene", "said"),
    [
        ("t,left\n0,1\n", "five-bar", "column 'left' "),
        ("t,actuator_force/lef\n0,1\n", "five-bar", "unknown column"),
        ("t,actuator_force/left [N/mm]\n0,1\n", "five-bar", "must be in N m"),
        ("t,actuator_force/left\n0,1\n9,1\n", "five-bar", "is outside the scene"),
        ("t,a\n0,1\n", "a02-fourbar-2", "integrated"),
        ("t,a\n0,1\n", "no-such-scene", "no-such-scene"),
        ("a\n1\n", "five-bar", "column 't' is missing"),
    ],
)
def test_bad_input_is_refused_in_a_sentence(numbers, scene, said, write, command):
    path = write("mine.csv", numbers)
    err = command("review", path, scene, status=2).err
    assert said in err
    assert err.count("\n") == 1


def test_a_name_of_a_scene_is_read_and_another_object_is_refused():
    with pytest.raises(ScrewgaugeError):
        screwgauge.review("none.csv", "five-bar")
