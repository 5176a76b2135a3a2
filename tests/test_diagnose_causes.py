"""Slips of convention are named from two values; torques tell which differences matter and cannot be told apart."""

from __future__ import annotations

import numpy as np
import pytest
from campaigns.lookalikes import renamed

from screwgauge import diagnose
from support.causes import (
    Group,
    Pair,
    Torques,
    attribute,
    com_slips,
    gravity_slips,
    mass_slips,
    placement_slips,
    tensor_slips,
    vector,
)
from support.geometry import rotation
from support.mechanics import Matter
from support.readings import matrix, steiner
from support.robots import mjcf, tree, urdf

R = rotation(np.array([0.6, 0.0, 0.8]), np.array(0.7))
MOMENTS = np.diag([1.0, 2.0, 2.7])
PRODUCTS = np.array([[2.0, 0.1, -0.2], [0.1, 3.0, 0.3], [-0.2, 0.3, 4.0]])
COM = np.array([0.1, -0.2, 0.05])


@pytest.mark.parametrize(
    ("a", "b", "slip"),
    [
        (R @ MOMENTS @ R.T, MOMENTS, "is not turned by its orientation in A"),
        (R @ MOMENTS @ R.T, R.T @ MOMENTS @ R, "is turned by its orientation in A transposed"),
        (PRODUCTS, 2.0 * np.diag(np.diag(PRODUCTS)) - PRODUCTS, "has products of inertia of the other sign"),
        (PRODUCTS, np.diag(np.diag(PRODUCTS)), "has no products of inertia"),
        (MOMENTS, np.diag([2.7, 1.0, 2.0]), "has its principal moments on other axes"),
        (PRODUCTS, PRODUCTS + 2.0 * steiner(COM), "is about the origin of the link, not the centre of mass"),
        (PRODUCTS, 1e9 * PRODUCTS, "is in g mm^2"),
        (PRODUCTS, 1e-6 * PRODUCTS, "is as if A were in kg mm^2"),
        (MOMENTS, R @ MOMENTS @ R.T, "is turned by its orientation in A once too often"),
    ],
)
def test_a_slip_with_a_tensor_is_named(a, b, slip):
    assert slip in tensor_slips(Pair(a, b, Matter(2.0, COM, a), {"A": R, "B": np.eye(3)}))


def test_a_tensor_on_axes_of_its_own_is_told_by_the_angle():
    assert tensor_slips(Pair(MOMENTS, R @ MOMENTS @ R.T, Matter(2.0, COM, MOMENTS), {"B": np.eye(3)})) == [
        "is turned by 40.11 degrees"
    ]


def test_what_is_no_slip_has_no_name():
    other = PRODUCTS + np.diag([0.01, 0.0, 0.0])
    assert tensor_slips(Pair(PRODUCTS, other, Matter(2.0, COM, PRODUCTS), {"A": R})) == []
    assert com_slips(Pair(COM, 1.01 * COM, turns={"B": np.eye(3)})) == []
    assert mass_slips(Pair(np.array(1.0), np.array(1.0))) == []


@pytest.mark.parametrize(
    ("b", "slip"),
    [
        (1000.0 * COM, "is in mm"),
        (COM * [1.0, -1.0, 1.0], "is mirrored in y"),
        (np.zeros(3), "is left out"),
        (COM[[1, 0, 2]], "has its entries in the order yxz"),
        (R @ COM, "is turned by the orientation of its inertial"),
    ],
)
def test_a_slip_with_a_centre_of_mass_is_named(b, slip):
    assert slip in com_slips(Pair(COM, b, turns={"B": R}))


def test_slips_with_placements_and_gravity_are_named():
    T = matrix(COM, R)
    assert placement_slips(Pair(T, matrix(1000.0 * COM, R))) == ["is in mm"]
    assert placement_slips(Pair(T, matrix(COM, np.eye(3)))) == ["has no rotation"]
    assert placement_slips(Pair(T, matrix(COM, R.T))) == ["has its rotation transposed"]
    g = np.array([0.0, 0.0, -9.81])
    assert gravity_slips(Pair(g, -g)) == ["is upside down"]
    assert gravity_slips(Pair(g, np.zeros(3))) == ["is left out"]
    assert gravity_slips(Pair(g, np.array([0.0, -9.81, 0.0]))) == ["is turned by 90 degrees"]


def models(folder, change, full=False):
    """A random robot, and one that is changed by a function of its text."""
    a, b = folder / "a.xml", folder / "b.xml"
    a.write_text(mjcf(tree(0), full=full))
    b.write_text(change(a.read_text()))
    assert a.read_text() != b.read_text()
    return a, b


def test_two_causes_share_the_torque_difference(tmp_path):
    parts = tree(0)
    damping, mass = f'damping="{parts[0].passive[0]!r}"', f'mass="{parts[1].mass!r}"'
    found = diagnose(*models(tmp_path, lambda text: text.replace(damping, 'damping="5"').replace(mass, 'mass="9"')))
    why = found.attribution
    assert {cause.name.split(" of ")[0] for cause in why.causes} == {"damping", "mass properties"}
    assert 1.0 > why.causes[0].share > why.causes[1].share > 0.0
    assert sum(cause.share for cause in why.causes) == pytest.approx(1.0)
    assert why.share == pytest.approx(1.0, rel=1e-9, abs=0)
    assert why.complete
    assert found.proof.on == "file"
    assert found.proof.agrees


def test_a_base_that_stands_turned_cannot_be_told_from_gravity(tmp_path):
    g = 'gravity="0 0 -9.81"'
    found = diagnose(*models(tmp_path, lambda text: text.replace(g, 'gravity="9.81 0 0"'), full=True))
    (cause,) = found.causes
    assert cause.name == "gravity"
    assert "gravity is that of a base, which carries joint0, that is turned" in cause.slips


def test_a_difference_that_no_torque_shows_is_told_beside(tmp_path):
    found = diagnose(*models(tmp_path, lambda text: text.replace('range="-1.5 2"', 'range="-1.5 1"', 1)))
    assert not found.attribution.seen
    assert [(cause.kind, cause.name) for cause in found.causes] == [("unseen", "limits of joint0")]
    assert not found.same


def test_masses_that_are_all_scaled_are_one_cause(tmp_path):
    (tmp_path / "a.urdf").write_text(urdf(tree(0)))
    parts, text = tree(0), urdf(tree(0))
    for part in parts:
        text = text.replace(f'value="{part.mass!r}"', f'value="{1.25 * part.mass!r}"')
    (tmp_path / "b.urdf").write_text(text)
    (cause,) = diagnose(tmp_path / "a.urdf", tmp_path / "b.urdf").causes
    assert "1.25 times those of A" in cause.sentence


def test_what_changes_nothing_has_no_share(tmp_path):
    """The one difference has a change that no torque shows: nothing is explained."""
    found = diagnose(*models(tmp_path, lambda text: text.replace('range="-1.5 2"', 'range="-1.5 1"', 1)))
    torques = Torques(np.ones((3, 2)), lambda reading: np.full((3, 2), 2.0), ("i", "j"), ("N m", "N m"))
    group = Group("limits", "limits differ", (0,), "limits differ", "limits")
    why = attribute(torques, found.b.reading, found.differences, lambda weight: [group])
    assert not why.seen
    assert [cause.kind for cause in why.causes] == ["unseen"]
    assert (why.before.scaled, why.left.scaled, why.share) == (1.0, 1.0, 0.0)


def test_what_is_not_a_number_is_a_difference():
    torques = Torques(np.ones((3, 1)), lambda reading: np.full((3, 1), np.nan), ("i",), ("N m",))
    why = attribute(torques, None, [], lambda weight: [])
    assert why.before.scaled == np.inf
    assert not why.complete


def test_names_that_all_have_a_prefix_are_the_same_names(tmp_path):
    """Read by libraries that order joints in ways of their own, and with no name in common."""
    text = urdf(tree(3))
    (tmp_path / "a.urdf").write_text(text)
    (tmp_path / "b.urdf").write_text(renamed(text, np.random.default_rng(0)))
    assert diagnose(f"{tmp_path / 'a.urdf'}@pinocchio", f"{tmp_path / 'b.urdf'}@yourdfpy").same


def test_rounding_beside_the_largest_entry_is_not_printed():
    gravity = np.array([3.8e-16, -7.1e-17, 9.81])
    assert vector(gravity, np.array([0.0, 0.0, -9.81])) == "(0, 0, 9.810)"


def test_masses_that_a_compiler_bounds_are_not_swapped(tmp_path):
    body = '<body name="{0}"><joint axis="0 1 0"/><inertial pos="0.1 0 0.1" mass="1" diaginertia="1 1 1"/>{1}</body>'
    text = f"<mujoco>@<worldbody>{body.format('a', body.format('b', ''))}</worldbody></mujoco>"
    for name, bound in (("a", ""), ("b", '<compiler boundmass="2"/>')):
        (tmp_path / f"{name}.xml").write_text(text.replace("@", bound), encoding="utf-8")
    found = diagnose(tmp_path / "a.xml", tmp_path / "b.xml")
    assert "mass 2.000 kg in B" in found.verdict
    assert "swapped" not in found.verdict
