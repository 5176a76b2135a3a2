from dataclasses import replace

import numpy as np
import pytest

import screwgauge
from support.data import data
from support.engines import Values
from support.geometry import MIDDLE, rotation, sequence_angles
from support.judging import agreed, compared, in_one_chart
from support.tolerances import LINEAR, ROUNDING

#: In the plane, so that the middle angle of the ball passes a right angle and the other two stay zero.
CRANK = data("ball-crank.toml")
LOCK = "atan(3)"  # crank angle at which the rod stands across the crank
RATES = ("joint_velocity", "joint_acceleration")


@pytest.fixture
def scene(write):
    write("ball-crank.toml", CRANK)
    text = 'mechanism = "ball-crank.toml"\nmotion.crank.polynomial = [0.1, 3]\ntime = { duration = 1, step = 0.1 }\n'
    return screwgauge.load_scene(write("scene.toml", text))


def test_engines_agree_after_a_gimbal_lock_in_whatever_triple_they_read(scene):
    results = agreed(screwgauge.run(scene))
    middle = results.values("joint_position")[:, results.components("joint_position").index("ball.q2")]
    assert middle.min() < -2.0  # well beyond the lock
    said = [note for one in results.solutions.values() for note in one.notes if "converted to the triple" in note]
    assert len(said) == 2
    assert all(note.startswith("the angles of ball") for note in said)
    assert not results.pairs["reason"].str.contains("turn").any()


def test_plots_and_samples_show_what_was_compared(scene):
    results = screwgauge.run(scene, engines=["screw", "pinocchio"])
    for quantity in ("joint_position", *RATES):
        one, other = (results.values(quantity, engine) for engine in results.solutions)
        assert np.abs(one - other).max() < LINEAR * np.abs(one).max(), quantity


@pytest.mark.slow
def test_a_simulation_agrees_there_too(write):
    write("ball-crank.toml", CRANK)
    text = 'mechanism = "ball-crank.toml"\ntime.times = [0, 0.1, 0.2, 0.3]\n[forward]\nstart.crank = 0.8\n'
    scene = screwgauge.load_scene(write("scene.toml", f"{text}rates.crank = 4\n"))
    results = screwgauge.run(scene, engines=["screw", "pinocchio"])
    assert results.ok, results.pairs.to_string()


def test_at_a_lock_positions_agree_and_the_rates_are_named(scene, write):
    text = f'mechanism = "ball-crank.toml"\nmotion.crank.polynomial = ["{LOCK}", 3]\ntime.times = [-0.1, 0, 0.1]\n'
    results = screwgauge.run(screwgauge.load_scene(write("lock.toml", text)))
    rows = results.pairs.set_index("quantity")
    assert rows.loc["joint_position", "ok"].all()
    assert {one.quantities for one in results.refusals} == {RATES}
    assert all("ball is in gimbal lock" in one.sentence for one in results.refusals)
    withheld = "of ball.q1, ball.q2, ball.q3 cannot"
    assert all(withheld in one.sentence for one in results.refusals)
    for quantity in RATES:
        rows = results.errors[(results.errors["quantity"] == quantity) & ~results.errors["ok"]]
        assert {*rows["component"]} == {"ball.q1", "ball.q2", "ball.q3"}


@pytest.mark.parametrize("lock", [np.pi / 2, -np.pi / 2])
def test_angles_read_in_a_lock_give_the_orientation_back(lock):
    """Only the sum of the first and last angle is determined."""
    axes = np.eye(3)
    angles = np.random.default_rng(0).uniform(-3.0, 3.0, (50, 3))
    angles[:, 1] = lock

    def turned(angles):
        R = np.tile(axes, (len(angles), 1, 1))
        for axis, angle in zip(axes, angles.T, strict=True):
            R = R @ rotation(axis, angle)
        return R

    B = rotation(np.array([0.6, 0.0, 0.8]), np.array(0.7))
    R = B.T @ (B @ turned(angles) @ B.T) @ B  # rounded, as what engines give
    assert np.abs(turned(sequence_angles(R)) - R).max() < ROUNDING


@pytest.fixture(scope="module")
def paper_results():
    scene = screwgauge.load_scene("3ups-upu-s").at([0.0, 0.5])
    return screwgauge.run(scene, engines=["screw", "pinocchio"], quantities=["joint_position", *RATES])


def rewritten(results, *changes):
    scene, (one, other) = results.scene, results.solutions.values()
    values = {**other.values}
    for quantity, names, change in changes:
        found = values[quantity]
        columns, array = [found.components.index(name) for name in names], found.array.copy()
        array[:, columns] = change(array[:, columns])
        values[quantity] = Values(found.components, found.units, array)
    both = in_one_chart(scene.mechanism, {"screw": one, "pinocchio": replace(other, values=values)})
    pairs = compared(scene, both)[1]
    return {quantity: bool(rows["ok"].all()) for quantity, rows in pairs.groupby("quantity")}, both["pinocchio"].notes


WRIST = ("leg2.q4", "leg2.q5", "leg2.q6")


def swap(angles):
    return MIDDLE * angles + np.pi * np.array([1.0, 1.0, -3.0])


def test_whole_turns_are_no_difference_and_no_remark(paper_results):
    ok, notes = rewritten(paper_results, ("joint_position", ["leg2.q2"], lambda q: q - 4 * np.pi))
    assert ok["joint_position"]
    assert not any("turn" in note for note in notes)
    for off in (np.pi, 2 * np.pi + 1e-9):
        assert not rewritten(paper_results, ("joint_position", ["leg2.q2"], lambda q, off=off: q + off))[0][
            "joint_position"
        ]


def test_the_other_triple_with_its_own_rates_is_no_difference(paper_results):
    rates = [(quantity, WRIST, lambda x: MIDDLE * x) for quantity in RATES]
    ok, notes = rewritten(paper_results, ("joint_position", WRIST, swap), *rates)
    assert all(ok.values())
    assert any("triple of" in note and "2 of 2" in note for note in notes)


def test_forces_along_the_other_triple_are_no_difference_either(paper_results):
    one = paper_results.solutions["screw"]
    force = Values(WRIST, ("N m",) * 3, np.array([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]))
    swapped = one.values["joint_position"].array.copy()
    columns = [one.values["joint_position"].components.index(name) for name in WRIST]
    swapped[:, columns] = swap(swapped[:, columns])
    position = replace(one.values["joint_position"], array=swapped)
    given = {"joint_position": position, "tree_force": Values(WRIST, force.units, MIDDLE * force.array)}
    both = {"a": replace(one, values={**one.values, "tree_force": force}), "b": replace(one, values=given)}
    found = in_one_chart(paper_results.scene.mechanism, both)["b"]
    assert np.array_equal(found.values["tree_force"].array, force.array)


def test_the_other_triple_with_the_rates_of_the_first_differs(paper_results):
    ok, _ = rewritten(paper_results, ("joint_position", WRIST, swap))
    assert ok == {"joint_position": True, "joint_velocity": False, "joint_acceleration": False}


def test_three_angles_of_another_orientation_differ(paper_results):
    for k in range(3):
        off = 1e-9 * np.eye(3)[k]
        assert not rewritten(paper_results, ("joint_position", WRIST, lambda q, off=off: swap(q) + off))[0][
            "joint_position"
        ]
    assert not rewritten(paper_results, ("joint_position", WRIST, lambda q: MIDDLE * q))[0]["joint_position"]


def test_what_is_no_number_on_one_side_leaves_the_other_as_it_is(paper_results):
    one, other = paper_results.solutions.values()
    lost = one.values["joint_position"]
    lost = Values(lost.components, lost.units, np.where([[True], [False]], np.nan, lost.array))
    both = {"screw": replace(one, values={**one.values, "joint_position": lost}), "pinocchio": other}
    found = in_one_chart(paper_results.scene.mechanism, both)["pinocchio"].values["joint_position"].array
    assert np.array_equal(found, other.values["joint_position"].array)


@pytest.mark.parametrize("lock", [np.pi / 2, -np.pi / 2])
@pytest.mark.parametrize("name", ["leg2.wrist", "s"])
def test_in_a_lock_any_split_of_the_same_sum_is_no_difference(paper_results, name, lock):
    mechanism = paper_results.scene.mechanism
    joint = mechanism.joint(name)

    def turned(angles):
        R = np.eye(3)
        for axis, angle in zip(joint.axes, angles, strict=True):
            R = R @ rotation(axis, np.array(angle))
        return R

    one, other = np.array([0.3, lock, -0.4]), np.array([1.1, lock, -0.4])
    hand = np.sign(np.linalg.det(joint.axes))
    other[2] -= np.sign(lock) * hand * 0.8
    assert np.abs(turned(one) - turned(other)).max() < ROUNDING
    whole = paper_results.solutions["screw"].values["joint_position"]
    columns = [whole.components.index(c) for c in joint.coordinates]

    def solution(angles):
        array = whole.array.copy()
        array[:, columns] = angles
        values = {"joint_position": Values(whole.components, whole.units, array)}
        return replace(paper_results.solutions["screw"], values=values)

    found = in_one_chart(mechanism, {"a": solution(one), "b": solution(other)})["b"]
    assert np.abs(found.values["joint_position"].array[:, columns] - one).max() < ROUNDING
    wrong = in_one_chart(mechanism, {"a": solution(one), "b": solution(other + np.array([0.0, 0.0, 0.01]))})["b"]
    assert np.abs(wrong.values["joint_position"].array[:, columns] - one).max() == pytest.approx(0.01)
