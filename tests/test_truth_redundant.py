import math
import re

import numpy as np
import pytest
import tomli_w
from flint import arb, arb_mat, ctx

import screwgauge
from support.data import data
from support.errors import DescriptionError
from support.geometry import rotation
from support.mechanism import load_mechanism, mechanism_tables
from support.singular import four_bar
from support.tolerances import LINEAR, ROUNDING
from support.truth import Certifier, Linkage, newton_euler, notes, number, required_wrenches, state, widen_decimals

#: Radii where doubles of the geometry are read as rounded: 1e-15 times what is lost on the way to accelerations of 10.
RADIUS_OF_ROUNDED = 1e-8


@pytest.fixture
def scene(write):
    def make(text):
        write("m.toml", text)
        label = re.search(r"\[independent\]\n(\w+)", text)[1]
        motion = '["pi/4", 0.5, 1]' if "Sarrus" in text else '["pi/2", 1, 2]'  # one that ends below pi/2, stretched out
        given = f'mechanism = "m.toml"\nmotion.{label}.polynomial = {motion}\ntime.times = [0.1, 0.5]\n'
        return screwgauge.load_scene(write("s.toml", given))

    return make


def decimals(text, digits):
    names = {name: getattr(math, name) for name in ("pi", "sin", "cos", "sqrt", "atan")}

    def rounded(match):
        return f"{eval(match[1], {}, names):.{digits}g}"

    return re.sub(r'"([^"]*(?:pi|sqrt)[^"]*)"', rounded, text)


def turned(text):
    rng = np.random.default_rng(5)
    axes = rng.normal(size=(4, 3))
    axes /= np.linalg.norm(axes, axis=1)[:, None]
    bodies = ("ground", "crank", "coupler", "rocker")
    frames = {body: rotation(axis, np.array(0.7)) for body, axis in zip(bodies, axes, strict=True)}
    joints = re.split(r"(?=\[joints)", text)
    out = joints[0]
    for joint in joints[1:]:
        for side in ("parent", "child"):
            R = frames[re.search(rf'{side} = "(\w+)"', joint)[1]]
            found = re.search(rf"{side}_frame = {{ position = (.*?) }}\n", joint)
            p = [float(x) for x in R @ (eval(found[1]) if found else [0, 0, 0])]
            joint = joint.replace(found[0], "") if found else joint
            rows = [[float(x) for x in row] for row in R]
            joint = f"{joint.rstrip()}\n{side}_frame = {{ position = {p}, rotation = {{ matrix = {rows} }} }}\n"
        out += joint + "\n"
    return out


@pytest.mark.parametrize("name", ["bennett", "sarrus"])
def test_redundant_loops_of_exact_text_close(name, scene):
    results = screwgauge.run(scene(data(f"{name}.toml")), engines=["truth", "screw"])
    assert results.pairs["max_scaled"].max() < LINEAR, results.failures
    assert "overconstrained" in notes(results)
    assert "rounded" not in notes(results)
    assert max(results.radius(name).max() for name in results.solutions["truth"].values) < 1e-46


def test_bennett_linkage_moves_as_its_closed_form_says(scene):
    motion = scene(data("bennett.toml"))
    results = screwgauge.run(motion, engines=["truth"], quantities=["joint_position"])
    j1, j2, j3, j4 = results.values("joint_position").T
    assert j2 == pytest.approx(2 * np.arctan(np.sin(np.pi / 4) / np.sin(np.pi / 12) / np.tan(j1 / 2)), abs=ROUNDING)
    assert np.array([j3, j4]) == pytest.approx(-np.array([j1, j2]), abs=ROUNDING)


@pytest.mark.slow
@pytest.mark.parametrize("digits", [15, 16, 17])
def test_redundant_loops_of_long_decimals_are_read_as_rounded(digits, scene):
    text = data("bennett.toml")
    exact = screwgauge.run(scene(text), engines=["truth"])
    results = screwgauge.run(scene(decimals(text, digits)), engines=["truth", "screw"])
    assert results.pairs["max_scaled"].max() < LINEAR, results.failures
    assert "round to these decimals" in notes(results)
    for name, values in exact.solutions["truth"].values.items():
        radius = results.radius(name)
        assert radius.max() < RADIUS_OF_ROUNDED
        if name != "reaction":  # which of them are zero is a choice
            assert (np.abs(results.values(name, "truth") - values.array) <= radius + exact.radius(name) + 1e-15).all()


def test_planar_four_bar_in_turned_frames_is_read_as_rounded(scene):
    results = screwgauge.run(scene(turned(data("four-bar.toml"))), engines=["truth", "screw"])
    assert results.pairs["max_scaled"].max() < LINEAR, results.failures
    assert "round to these decimals" in notes(results)


@pytest.mark.parametrize("quantity", ["joint_position", "reaction"])
def test_redundant_loops_that_stay_open_say_so_and_what_to_do(quantity, scene):
    motion = scene(decimals(data("bennett.toml"), 12))
    results = screwgauge.run(motion, engines=["truth"], quantities=[quantity])
    reason = results.failures["truth"].reason
    assert re.search(r"at least \de-1\d \(rad, m.* 'sqrt\(2\)', .*15 digits", reason)


def test_a_regular_pose_is_not_blamed_for_redundant_rows_that_decimals_leave_open(write):
    """100 m from the origin, 16 digits are coarse for a flat parallelogram."""
    angle, R = 3e-4, rotation(np.array([1.0, 2.0, 2.0]) / 3.0, np.array(2.0))
    table = {"name": "flat", **four_bar(0.3, 0.5, 0.3, 0.5, angle, side=-1.0)}
    for joint in table["joints"].values():
        if joint["parent"] == "ground":
            at = R @ joint["parent_frame"]["position"] + 100.0
            joint["parent_frame"] = {"position": at.tolist(), "rotation": {"matrix": R.tolist()}}
    write("m.toml", tomli_w.dumps(table))
    given = f'mechanism = "m.toml"\nmotion.a.polynomial = [{angle}]\ntime.times = [0.0]\n'
    scene = screwgauge.load_scene(write("s.toml", given))
    results = screwgauge.run(scene, engines=["truth", "screw"], quantities=["joint_position"])
    reason = results.failures["truth"].reason
    assert "3 redundant closing equations" in reason
    assert "singular" not in reason
    assert results.solutions["screw"].condition.max() < 1e6


def test_only_long_decimals_are_widened():
    short, long, text = widen_decimals({"position": ["0.5", "0.3333333333333333", "1/3"]})["position"]
    assert (short, text) == ("0.5", "1/3")
    assert 1e-16 < float(long.rad()) < 1e-15
    assert long.contains(number("1/3"))
    tiny = widen_decimals([["6.123233995736766e-17", "1.0"], [0, 1]])[0][0]
    assert tiny.contains(0)


def scaled(text, size):
    def vector(match):
        entries = [entry.strip(' "') for entry in match[2].split(",")]
        return f"{match[1]}{[f'{size}*({entry})' for entry in entries]}"

    text = re.sub(r"((?:position|com) = )\[(.*?)\]", vector, text)
    return re.sub(r"((?:xx|yy|zz|xy|yz) = )([-.e\d]+)", rf'\1"\2*{size}**2"', text)


@pytest.mark.parametrize("size", ["1e-9", "1e9"])
@pytest.mark.parametrize("name", ["four-bar", "bennett"])
def test_size_does_not_matter(name, size, write):
    forces = []
    for factor in ("1", size):
        path = write("m.toml", scaled(data(f"{name}.toml"), factor))
        mechanism = load_mechanism(path)
        with ctx.workprec(192):
            linkage = Linkage(mechanism, mechanism_tables(path))
            now = state(Certifier(linkage), [[number("1.6"), arb(1), arb(2)]], mechanism.home.tolist())
            B = arb_mat([[now.partial[i, 0]] for i in mechanism.actuated_columns])
            need = required_wrenches(linkage, now, [arb(0)] * 3, ())
            forces.append(newton_euler(linkage, now, B, need, (), axial=False)[1][0, 0])
    with ctx.workprec(192):
        assert (forces[0] * number(size) ** 2).overlaps(forces[1])
        assert float(forces[1].rel_accuracy_bits()) > 100


@pytest.mark.slow
@pytest.mark.parametrize("name", ["slider-crank", "four-bar"])
def test_motion_that_nothing_drives_has_a_truth(name, scene):
    motion = scene(re.sub(r"actuated = true\n", "", data(f"{name}.toml")))
    wanted = ["joint_position", "joint_acceleration", "com_acceleration", "generalized_force"]
    results = screwgauge.run(motion, engines=["truth", "screw", "pinocchio"], quantities=wanted)
    assert not results.failures
    assert results.pairs["max_scaled"].max() < LINEAR
    with pytest.raises(DescriptionError, match="0 of 1 freedoms"):
        screwgauge.run(motion, engines=["truth"], quantities=["actuator_force"])
