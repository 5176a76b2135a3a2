from __future__ import annotations

import re
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import screwgauge
from support.arms import Arm, Joint, X, write

pytest.importorskip("pxr", reason="usd-core (extra: usd)")

Change = Callable[[Arm], Any]
PAIRS = [
    ("usda", "xml"),
    ("xml", "usda"),
    ("sdf", "xml"),
    ("xml", "sdf"),
    ("usda", "sdf"),
    ("sdf", "urdf"),
    ("usda", "urdf"),
]


def link(name: str, **values: Any) -> Change:
    return lambda arm: [setattr(arm.links[name], key, value) for key, value in values.items()]


def joint(name: str, **values: Any) -> Change:
    return lambda arm: [setattr(arm.joints[name], key, value) for key, value in values.items()]


def joints(change: Callable[[Joint], Any], kinds: tuple[str, ...] = ("hinge", "slide")) -> Change:
    return lambda arm: [change(one) for one in arm.joints.values() if one.kind in kinds]


def without_finger(arm: Arm) -> None:
    del arm.joints["g2"], arm.links["finger"]


def masses_exchanged(arm: Arm) -> None:
    one, other = arm.links["thumb"], arm.links["finger"]
    one.mass, other.mass = other.mass, one.mass


def heavier(arm: Arm) -> None:
    for one in arm.links.values():
        one.mass, one.moments = 1000 * one.mass, tuple(1000 * x for x in one.moments)


def higher(arm: Arm) -> None:
    for name in ("thumb", "finger"):
        x, y, z = arm.links[name].at
        arm.links[name].at = (x, y, z + 0.05)


def in_millimetres(arm: Arm) -> None:
    for one in arm.links.values():
        one.at, one.com = (tuple(1000 * x for x in each) for each in (one.at, one.com))
        one.moments = tuple(1e6 * x for x in one.moments)
    for each in arm.joints.values():
        each.at = each.at and tuple(1000 * x for x in each.at)
        if each.kind == "slide" and each.limits:
            each.limits = each.limits[0] * 1000, each.limits[1] * 1000


#: Loss -> how B is changed, and what its first sentence names.
LOSSES: dict[str, tuple[Change, str]] = {
    "inertia turned back": (link("upper", turn=(1, 0, 0, 0)), "upper: inertia .*turned by 73.74"),
    "inertia turned the other way": (link("upper", turn=(0.8, -0.6, 0, 0)), "upper: inertia .*other sign"),
    "products dropped": (link("fore", products=False), "fore: inertia .*none in B"),
    "products of all dropped": (
        lambda arm: [setattr(one, "products", False) for one in arm.links.values()],
        "(upper|fore): inertia ",
    ),
    "moments in another order": (
        link("strut", moments=(0.0002, 0.0012, 0.0011)),
        "strut: inertia .*(other axes|another order)",
    ),
    "moments times ten": (link("fore", moments=(0.031, 0.042, 0.022)), "fore: inertia"),
    "moments of a placeholder": (link("fore", moments=(1, 1, 1)), "fore: inertia .*1.000, 1.000, 1.000"),
    "armature of all": (joints(lambda one: setattr(one, "armature", 0.0)), "armature of 3 joints is 0 in B"),
    "armature of one": (joint("j2", armature=0.0), "j2: armature 0"),
    "damping of one": (joint("j2", damping=0.0), "j2: damping 0"),
    "damping of all": (joints(lambda one: setattr(one, "damping", 0.0)), "damping of 4 joints is 0 in B"),
    "damping per degree": (
        joints(lambda one: setattr(one, "damping", float(np.degrees(one.damping))), ("hinge",)),
        "damping of 3 joints .*57.29",
    ),
    "friction": (joint("j1", friction=0.0), "j1: dry friction 0"),
    "friction for damping": (joint("j1", friction=0.5, damping=0.1), "j1.*damping.*friction|j1.*friction.*damping"),
    "mimic": (joint("g2", mimic=None), "g2 follows g1 in [AB] only"),
    "sign of the mimic": (joint("g2", mimic=("g1", 1.0, 0.0)), "g2: its coupling .*other sign"),
    "multiplier of the mimic": (joint("g2", mimic=("g1", -2.0, 0.0)), "g2: its coupling to g1"),
    "offset of the mimic": (joint("g2", mimic=("g1", -1.0, -0.01)), r"g2: its coupling to g1 .*-0\.01"),
    "leader of the mimic": (joint("g2", mimic=("j3", -0.02, 0.0)), "g2 follows j3 in B"),
    "limits": (joint("j3", limits=None), "j3: no limits in B"),
    "limits in degrees": (joint("j3", limits=(-114.591559, 57.2957795)), "j3: limits .*in degrees"),
    "one limit": (joint("j2", limits=(0, 2)), "j2: limits"),
    "mass": (link("upper", mass=1.5), "upper: mass 1.500 kg in B"),
    "masses exchanged": (masses_exchanged, "mass of (thumb|finger) and that of (thumb|finger) are exchanged"),
    "masses in grams": (heavier, "masses and inertias of all bodies"),
    "centre of mass": (link("upper", com=(0, 0, 0)), "upper: .*centre of mass is left out"),
    "centre of mass mirrored": (link("upper", com=(0.02, 0.015, 0.11)), "upper: .*mirrored in y"),
    "centre of mass further out": (link("strut", com=(0, 0, 0.11)), "strut: centre of mass"),
    "sense of an axis": (joint("j2", axis=(0, -1, 0)), "j2 counts the other way"),
    "axis along x": (joint("j2", axis=X), "j2: in B its axis is tilted by [+-]90 deg"),
    "axis tilted": (joint("j1", axis=(0, 0.0998334, 0.995004)), "j1: in B its axis is tilted by [+-]5.72"),
    "place of the gripper": (higher, "g[12] sits elsewhere in B"),
    "gravity": (lambda arm: setattr(arm, "gravity", (0, 0, 0)), "gravity is left out"),
    "up axis": (lambda arm: setattr(arm, "gravity", (0, -9.81, 0)), "gravity is turned by 90"),
    "a digit of gravity": (lambda arm: setattr(arm, "gravity", (0, 0, -9.8)), "gravity .*9.80"),
    "a loop": (lambda arm: arm.joints.pop("t"), r"^t(\.0/t\.1)? is in A only"),
    "place of a loop": (joint("t", at=(0.1, 0.05, 0.6)), "^t.*shifted by [+-]50 mm"),
    "a finger": (without_finger, "g2 is missing from B"),
    "a hinge welded": (joint("j3", kind="fixed"), "j3 does not move in B"),
    "a hinge that slides": (joint("j3", kind="slide"), "j3 is a slide in B"),
    "millimetres": (in_millimetres, "B as a whole is in other units"),
}
#: What a format does not state, so that it cannot lose it.
LACKS = {"sdf": ("armature",), "urdf": ("armature", "loop", "gravity", "up axis", "millimetres"), "usda": (), "xml": ()}


def pair(forms: tuple[str, str], change: Change | None, tmp_path) -> Any:
    def common(arm: Arm) -> None:
        if "urdf" in forms:
            del arm.joints["t"]
        if {"sdf", "urdf"} & {*forms}:
            for one in arm.joints.values():
                one.armature = 0.0

    a = write(tmp_path, "a", forms[0], common)
    b = write(tmp_path, "b", forms[1], lambda arm: (common(arm), change and change(arm)))
    return screwgauge.diagnose(a, b)


@pytest.mark.parametrize("forms", PAIRS)
def test_the_same_machine_in_two_formats_is_the_same_but_for_rounding(forms, tmp_path):
    found = pair(forms, None, tmp_path)
    assert not [fact for fact in found.differences if fact.kind != "digits"], found.verdict
    assert not found.not_compared
    assert found.same or "usda" in forms


CASES = [
    (name, forms)
    for name in LOSSES
    for forms in PAIRS
    if not any(word in name for form in forms for word in LACKS[form])
]


@pytest.mark.sampled(5)
@pytest.mark.parametrize(("name", "forms"), CASES, ids=[f"{name}: {'-'.join(forms)}" for name, forms in CASES])
def test_a_loss_is_named_in_the_first_sentence(name, forms, tmp_path):
    change, words = LOSSES[name]
    found = pair(forms, change, tmp_path)
    assert re.search(words, found.headline), found.verdict
    assert found.exit_status == 1


@pytest.mark.parametrize("forms", [("usda", "xml"), ("sdf", "usda"), ("sdf", "xml")])
def test_a_lost_bound_of_force_is_listed(forms, tmp_path):
    found = pair(forms, joint("j2", effort=0.0), tmp_path)
    assert "limit effort of joint j2" in " ".join((*found.notes, *found.not_compared))


@pytest.mark.parametrize("form", ["sdf", "usda"])
def test_a_file_that_is_not_changed_is_refused_by_its_format(form, tmp_path, command):
    a, b = write(tmp_path, "a", "xml"), write(tmp_path, "b", form, link("upper", mass=1.5))
    said = command("diagnose", a, b, "--fix", tmp_path / f"c.{form}", status=2).err
    assert f"B is {form.removesuffix('a').upper()}" in said
    assert not (tmp_path / f"c.{form}").exists()
