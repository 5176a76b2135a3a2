"""Static differences in physical terms: each property is found as itself, and its change makes B as A."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from screwgauge import diagnose
from screwgauge.diagnosis import notes
from support import robots
from support.diagnosis import ALL, Change, Model, applied, differences, digits_of, marked, without
from support.geometry import rotation
from support.mechanics import brought, held, inverse_dynamics, missing, paired, placed
from support.mechanism import load_mechanism
from support.models import write_models
from support.readings import draw, matrix, plant, read, rehomed, renamed

TILT = rotation(np.array([0.0, 0.6, 0.8]), np.array(1e-3))
STEP = np.array([1e-3, 2e-3, -1e-3])


@pytest.fixture(scope="module")
def arms(tmp_path_factory):
    urdf, mjcf = robots.write(tmp_path_factory.mktemp("arm"))
    return read(urdf, "pinocchio"), read(mjcf, "mujoco")


def found(a, b):
    common = brought(a, b, paired(a, b))
    return differences(common)[0]


def off(a, b):
    """Scaled difference of torques at random states, B in the terms of A."""
    common = brought(a, b, paired(a, b))
    states = draw(common.a, 20)
    one, two = (inverse_dynamics(plant(each), states) for each in (common.a, common.b))
    return np.abs(one - two).max() / np.abs(one).max()


def test_two_formats_of_one_arm_say_the_same(arms):
    assert found(*arms) == []
    assert off(*arms) < 1e-14


CHANGES = {
    "mass": ("link3", lambda b: b.bodies["link3"].mass * 1.01),
    "com": ("link6", lambda b: b.bodies["link6"].com + STEP),
    "inertia": ("link2", lambda b: TILT @ b.bodies["link2"].inertia @ TILT.T),
    "gravcomp": ("link4", lambda b: 0.1),
    "placement": ("joint3", lambda b: matrix(STEP, TILT)),
    "axis": ("joint4", lambda b: TILT @ b.joints["joint4"].screw[:3]),
    "centre": ("joint2", lambda b: b.joints["joint2"].centre + STEP),
    "zero": ("joint1", lambda b: 0.02),
    "sign": ("joint4", lambda b: -1.0),
    "limits": ("joint0", lambda b: (-1.0, 1.0)),
    "armature": ("joint5", lambda b: 0.01),
    "damping": ("joint2", lambda b: 0.2),
    "friction": ("joint3", lambda b: 0.0),
    "stiffness": ("joint6", lambda b: 2.0),
    "gravity": ("", lambda b: (0.0, 0.0, -9.8)),
}


@pytest.mark.slow
@pytest.mark.parametrize("what", CHANGES)
def test_a_change_is_found_as_itself_and_undone_by_its_change(arms, what):
    a, b = arms
    item, value = CHANGES[what]
    changed = applied(b, [Change(item, what, np.asarray(value(b), dtype=float))])
    said = found(a, changed)
    assert [(each.what, each.item_a) for each in said] == [(what, item)], [each.sentence for each in said]
    assert said[0].size > 1e-6
    again = applied(changed, [each.change for each in said])
    assert found(a, again) == []
    assert off(a, again) < 1e-13


@pytest.mark.slow
@pytest.mark.parametrize("joint", ["joint0", "joint3", "joint5", "joint6"])
@pytest.mark.parametrize("size", [1e-2, 1e-6])
def test_a_joint_that_sits_elsewhere_is_told_from_one_whose_axis_is_another(arms, joint, size):
    a, b = arms
    turn = rotation(np.array([0.0, 0.6, 0.8]), np.array(size))
    axis = b.joints[joint].screw[3:] if joint == "joint5" else b.joints[joint].screw[:3]
    for what, value in (("placement", matrix(size * STEP, turn)), ("axis", turn @ axis), ("zero", size)):
        said = found(a, applied(b, [Change(joint, what, np.asarray(value))]))
        assert [(each.what, each.item_a) for each in said] == [(what, joint)], [each.sentence for each in said]


def test_several_at_once_are_all_found(arms):
    a, b = arms
    done = [("link1", "mass"), ("link5", "com"), ("joint2", "placement"), ("joint4", "axis"), ("joint6", "zero")]
    values = [2.0, b.bodies["link5"].com + STEP, matrix(STEP, TILT), TILT.T @ b.joints["joint4"].screw[:3], 0.1]
    changes = [Change(item, what, np.asarray(v)) for (item, what), v in zip(done, values, strict=True)]
    changed = applied(b, changes)
    said = found(a, changed)
    assert {(each.item_a, each.what) for each in said} == set(done), [each.sentence for each in said]
    assert off(a, applied(changed, [each.change for each in said])) < 1e-13


@pytest.mark.parametrize(
    ("one", "other", "differs"),
    [(1e3, math.inf, 0), (1e10, 1e3, 0), (1e3, 1e3, 0), (1e3, 1000.2, 1), (1e3, 90.0, 1), (90.0, math.inf, 1)],
)
def test_wide_limits_are_those_of_a_joint_without_any_and_not_of_each_other(one, other, differs, arms):
    changes = [[Change("joint0", "limits", np.array([-q, q]))] for q in (one, other)]
    a, b = map(applied, arms, changes)
    assert [each.what for each in found(a, b)] == ["limits"] * differs


def test_where_home_is_changes_nothing(arms):
    a, b = arms
    q = {name: 0.1 * (i + 1) for i, name in enumerate(b.joints)}
    there = rehomed(b, q)[0]
    assert found(a, there) == []
    changed = applied(there, [Change("joint3", "placement", matrix(STEP, TILT))])
    said = found(a, changed)
    assert [(each.what, each.item_a) for each in said] == [("placement", "joint3")]
    assert off(a, applied(changed, [said[0].change])) < 1e-13


def test_a_model_that_stands_elsewhere_under_other_names_is_the_same(arms):
    a, b = arms
    turn = matrix(np.array([0.2, -0.4, 0.9]), rotation(np.array([0.0, 0.0, 1.0]), np.array(0.7)))
    elsewhere = renamed(
        placed(b, turn),
        {
            "joints": {name: f"axis_{i}" for i, name in enumerate(b.joints)},
            "bodies": {name: f"part_{i}" for i, name in enumerate(b.bodies)},
        },
    )
    elsewhere = replace(elsewhere, fixed={})
    pairing = paired(a, elsewhere)
    assert pairing.joints == {f"joint{i}": f"axis_{i}" for i in range(7)}
    assert set(pairing.how.values()) == {"geometry"}
    assert np.abs(pairing.placement @ turn - np.eye(4)).max() < 1e-9
    assert [each.what for each in found(a, elsewhere)] == []
    changed = applied(elsewhere, [Change("axis_2", "axis", TILT @ elsewhere.joints["axis_2"].screw[:3])])
    (said,) = found(a, changed)
    assert (said.item_a, said.item_b, said.what) == ("joint2", "axis_2", "axis")
    assert found(a, applied(changed, [said.change])) == []


def test_a_joint_that_is_held_is_told_from_a_branch_that_is_missing(arms):
    a, b = arms
    for other, word in ((held(b, ["joint6"]), "does not move"), (without(b, "joint6"), "missing in B")):
        pairing = paired(a, other)
        assert pairing.only_a == ("joint6",)
        (said,) = missing(a, other, pairing)
        assert word in said.sentence
    assert found(a, held(b, ["joint6"])) == []


def test_printed_digits_are_told_as_such(arms):
    a, b = arms
    third = {name: replace(body, mass=body.mass / 3) for name, body in a.bodies.items()}
    rounded = {name: replace(body, mass=float(f"{body.mass / 3:.6g}")) for name, body in b.bodies.items()}
    said = marked(found(replace(a, bodies=third), replace(b, bodies=rounded)), (ALL, 6))
    assert said
    assert {each.kind for each in said} == {"digits"}
    assert "B has 6 digits" in said[0].sentence
    more = {**rounded, "link3": replace(rounded["link3"], mass=rounded["link3"].mass * 1.00001)}
    kinds = {
        each.item_a: each.kind for each in marked(found(replace(a, bodies=third), replace(b, bodies=more)), (ALL, 6))
    }
    assert kinds["link3"] == "model"
    text = "".join(f'<x mass="{1 / n:.6g}" pos="{n / 7:.6g} 0 1"/>' for n in range(3, 30))
    assert digits_of(text) == 6
    assert digits_of(text + f'<x mass="{1 / 3!r}"/>') == ALL
    assert digits_of('<x mass="1.42" pos="0.1 0.25 0"/>') == ALL


@pytest.mark.parametrize(("size", "kind"), [(1e-6, "digits"), (1e-4, "convention")])
def test_a_zero_that_a_printed_orientation_has_moved_is_digits(arms, size, kind):
    a, b = arms
    (said,) = marked(found(a, applied(b, [Change("joint3", "zero", np.asarray(size))])), (ALL, 6))
    assert (said.what, said.kind) == ("zero", kind)
    assert ("rounding, B has 6 digits" in said.sentence) == (kind == "digits")


@pytest.mark.parametrize(
    ("angle", "shown", "kind"),
    [(1e-7, True, "digits"), (1e-7, False, "model"), (1e-4, True, "model")],
)
def test_a_tensor_that_mujoco_turns_inexactly_is_told_as_such(arms, angle, shown, kind, monkeypatch):
    a, b = arms
    tilt = rotation(np.array([0.0, 0.6, 0.8]), np.array(angle))
    turned = replace(b.bodies["link2"], inertia=tilt @ b.bodies["link2"].inertia @ tilt.T)
    b = replace(b, bodies={**b.bodies, "link2": turned})
    monkeypatch.setattr(notes, "shown_here", lambda case: shown)
    models = Model("a.urdf", None, "pinocchio", a), Model("b.xml", None, "mujoco", b)
    (said,) = notes.compiled(models, found(a, b))
    assert (said.what, said.kind) == ("inertia", kind)
    assert ("casebook: mj-axes-before-3.14" in said.sentence) == (kind == "digits")


def test_limits_of_a_description_are_compared_where_the_model_file_has_some(tmp_path, inside):
    text = """name = "arm"
    independent.a = "a"
    bodies.one = { mass = 1, com = [0.1, 0, 0], inertia = { xx = 1e-2, yy = 1e-2, zz = 1e-2 } }
    [joints]
    a = { kind = "R", parent = "ground", child = "one", axes = [[0, 1, 0]], actuated = true, limits = [[-1, 1]] }
    """
    Path("arm.toml").write_text(text, encoding="utf-8")
    mechanism = load_mechanism("arm.toml")
    for include in (frozenset[str](), frozenset({"limits"})):
        write_models(mechanism, tmp_path, include=include)
        assert diagnose("arm.toml", "arm.urdf").same
    urdf = Path("arm.urdf").read_text(encoding="utf-8")
    Path("other.urdf").write_text(urdf.replace('upper="1"', 'upper="0.5"'), encoding="utf-8")
    found = diagnose("arm.toml", "other.urdf")
    assert not found.same
    assert found.verdict.startswith("a: limits (-1, 0.5")
