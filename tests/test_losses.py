from collections.abc import Mapping
from typing import Any

import pytest

import screwgauge
from support.arms import Arm, write
from support.claims import table
from support.facts import fits, matches, told

pytest.importorskip("pxr", reason="usd-core (extra: usd)")

PAIRS = [("usda", "xml"), ("xml", "usda"), ("sdf", "xml"), ("xml", "sdf")]
PAIRS += [("usda", "sdf"), ("sdf", "urdf"), ("usda", "urdf")]
LOSSES = {row["name"]: row for row in table("losses")["loss"]}
CASES = [(name, forms) for name in LOSSES for forms in PAIRS if not {*LOSSES[name].get("lacks", ())} & {*forms}]


def spoil(arm: Arm, row: Mapping[str, Any]) -> None:
    """Make a loss of the table."""
    for room in ("links", "joints"):
        for key, values in row.get(room, {}).items():
            for name, part in getattr(arm, room).items():
                if key in ("*", name, getattr(part, "kind", "")):
                    change(part, values)
    for name in row.get("gone", ()):
        (arm.joints if name in arm.joints else arm.links).pop(name)
    arm.gravity = row.get("gravity", arm.gravity)


def change(part: object, values: Mapping[str, Any]) -> None:
    for key, value in values.items():
        if key != "times":
            setattr(part, key, None if value is False and key != "products" else value)
    for key, factor in values.get("times", {}).items():
        if old := getattr(part, key):
            setattr(part, key, tuple(factor * x for x in old) if isinstance(old, tuple) else factor * old)


def pair(forms: tuple[str, str], row: Mapping[str, Any], tmp_path) -> Any:
    def without(arm: Arm) -> None:
        if "urdf" in forms:
            del arm.joints["t"]
        if {"sdf", "urdf"} & {*forms}:
            for one in arm.joints.values():
                one.armature = 0.0

    a = write(tmp_path, "a", forms[0], without)
    return screwgauge.diagnose(a, write(tmp_path, "b", forms[1], lambda arm: (without(arm), spoil(arm, row))))


@pytest.mark.parametrize("forms", PAIRS)
def test_the_same_machine_in_two_formats_is_the_same_but_for_rounding(forms, tmp_path):
    found = pair(forms, {}, tmp_path)
    assert not [fact for fact in found.differences if fact.kind != "digits"], found.verdict
    assert not found.not_compared
    assert found.same or "usda" in forms


@pytest.mark.sampled(5)
@pytest.mark.parametrize(("name", "forms"), CASES, ids=[f"{name}: {'-'.join(forms)}" for name, forms in CASES])
def test_a_loss_is_named_first(name, forms, tmp_path):
    row = LOSSES[name]
    diagnosis = pair(forms, row, tmp_path)
    assert diagnosis.exit_status == 1
    facts = diagnosis.found.causes[0].facts
    first = next((fact for fact in facts if any(fits(fact, claim) for claim in row["lead"])), None)
    assert first, told(facts)
    assert len(facts) == row.get("count", len(facts))
    assert first.part in diagnosis.headline or len(facts) > 2
    slips = [[each.slip, *each.values] for each in diagnosis.found.reasons if first in each.facts]
    assert "slips" not in row or any(matches(slip, claim) for slip in slips for claim in row["slips"]), slips


@pytest.mark.parametrize("forms", [("usda", "xml"), ("sdf", "usda"), ("sdf", "xml")])
def test_a_lost_bound_of_force_is_listed(forms, tmp_path):
    found = pair(forms, {"joints": {"j2": {"effort": 0.0}}}, tmp_path)
    assert "limit effort of joint j2" in " ".join((*found.notes, *found.not_compared))


@pytest.mark.parametrize("form", ["sdf", "usda"])
def test_a_file_that_is_not_changed_is_refused_by_its_format(form, tmp_path, command):
    a, b = write(tmp_path, "a", "xml"), write(tmp_path, "b", form, lambda arm: setattr(arm.links["upper"], "mass", 1.5))
    said = command("diagnose", a, b, "--fix", tmp_path / f"c.{form}", status=2).err
    assert f"B is {form.removesuffix('a').upper()}" in said
    assert not (tmp_path / f"c.{form}").exists()
