"""What one model lacks is named as itself: a link in the middle with its own mass, not what hangs behind it."""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping

import numpy as np
import pytest

from screwgauge import diagnose

AXES = ("0 0 1", "0 1 0", "1 0 0")


def _text(values: Collection[float]) -> str:
    return " ".join(repr(float(value)) for value in values)


def urdf(lost: Collection[int] = (), fixed: Collection[int] = (), masses: Mapping[int, float] | None = None) -> str:
    """An arm of six links; what hung on those that are lost hangs in the same place on the one before."""
    random, parts, near, step = np.random.default_rng(3), ['<link name="base"/>'], "base", np.zeros(3)
    for i in range(1, 7):
        xyz, com = random.uniform((-0.05, -0.05, 0.2), (0.05, 0.05, 0.3)), random.uniform(-0.05, 0.05, 3)
        mass = {**MASSES, **(masses or {})}[i]
        step = step + xyz
        if i in lost:
            continue
        parts.append(
            f'<link name="l{i}"><inertial><origin xyz="{_text(com)}"/><mass value="{mass}"/>'
            '<inertia ixx="0.02" iyy="0.03" izz="0.025" ixy="0" ixz="0" iyz="0"/></inertial></link>'
            f'<joint name="j{i}" type="{"fixed" if i in fixed else "continuous"}"><origin xyz="{_text(step)}"/>'
            f'<parent link="{near}"/><child link="l{i}"/><axis xyz="{AXES[i % 3]}"/></joint>'
        )
        near, step = f"l{i}", np.zeros(3)
    return f'<robot name="r">{"".join(parts)}</robot>'


def mjcf(lost: Collection[int] = ()) -> str:
    """The same, nested."""
    random, heads, step = np.random.default_rng(3), [], np.zeros(3)
    for i in range(1, 7):
        step = step + random.uniform((-0.05, -0.05, 0.2), (0.05, 0.05, 0.3))
        if i not in lost:
            heads.append(
                f'<body name="l{i}" pos="{_text(step)}"><joint name="j{i}" axis="{AXES[i % 3]}"/>'
                f'<inertial pos="0.01 0.02 0.1" mass="{MASSES[i]}" diaginertia="0.02 0.03 0.025"/>'
                f'<geom name="g{i}" size=".1"/>'
            )
            step = np.zeros(3)
    motors = "".join(f'<motor name="m{i}" joint="j{i}"/>' for i in range(1, 7) if i not in lost)
    bodies = "".join(heads) + "</body>" * len(heads)
    return f"<mujoco><worldbody>{bodies}</worldbody><actuator>{motors}</actuator></mujoco>"


FORMS = {"urdf": urdf, "xml": mjcf}
MASSES = dict(enumerate(np.round(np.random.default_rng(4).uniform(1, 4, 7), 3)))


@pytest.fixture(params=FORMS)
def form(request):
    return request.param


@pytest.fixture
def both(write, form):
    """Diagnoses of a whole arm beside one that lacks links, and the other way round."""

    def diagnoses(lost):
        a, b = write(f"a.{form}", FORMS[form]()), write(f"b.{form}", FORMS[form](lost))
        return diagnose(a, b), diagnose(b, a)

    return diagnoses


@pytest.mark.parametrize("i", [2, 3, 5])
def test_a_link_in_the_middle_is_named_as_itself(i, both):
    missing, more = both([i])
    for found, side in ((missing, "B"), (more, "A")):
        (one,) = found.differences
        assert one.sentence.startswith(f"j{i}: missing in {side}, with l{i} that it moves (")
        assert f"; j{i + 1} hangs on l{i - 1} there" in one.sentence
        assert f"{MASSES[i]:.6g} kg" in one.sentence
    assert missing.attribution.before.scaled < 1e-12
    assert more.attribution.share == pytest.approx(1.0)
    assert more.proof.agrees
    assert more.proof.on == "file"


@pytest.mark.parametrize("i", [1, 3, 5])
def test_a_missing_link_is_named_where_names_say_nothing(i, write):
    a, b = write("a.urdf", urdf()), write("b.urdf", re.sub(r"\b([jl])(\d)\b", r"\1_of_\2", urdf([i])))
    missing, more = diagnose(a, b), diagnose(b, a)
    for found in (missing, more):
        (one,) = found.differences
        assert one.sentence.startswith(f"j{i}: missing in ")
        assert {*found.pairing.how.values()} == {"geometry"}
    assert missing.attribution.before.scaled < 1e-12
    assert more.attribution.left.scaled < 1e-12


def test_two_links_in_a_row_are_named_one_by_one(both):
    missing, more = both([3, 4])
    for found in (missing, more):
        first, second = found.differences
        assert first.sentence.startswith("j3: missing in ")
        assert second.sentence.startswith("j4: missing in ")
    assert missing.attribution.before.scaled < 1e-12
    assert more.attribution.share == pytest.approx(1.0)
    assert more.proof.agrees


def test_the_last_link_is_named_as_itself(both):
    missing, more = both([6])
    for found, side in ((missing, "B"), (more, "A")):
        (one,) = found.differences
        assert one.sentence.startswith(f"j6: missing in {side}, with all that it carries (1 body, {MASSES[6]:.6g} kg)")
    assert more.attribution.share == pytest.approx(1.0)


def test_the_first_link_is_named_as_itself(both):
    missing, more = both([1])
    for found, side in ((missing, "B"), (more, "A")):
        (one,) = found.differences
        assert one.sentence.startswith(f"j1: missing in {side}, with l1 that it moves (")
        assert "; j2 hangs on the ground there" in one.sentence


def test_a_change_beside_a_missing_link_is_named_too(write):
    a, b = write("a.urdf", urdf()), write("b.urdf", urdf([3], masses={5: 2.5}))
    for files in ((a, b), (b, a)):
        found = diagnose(*files)
        named = {(each.what, each.item_a or each.item_b) for each in found.differences}
        assert named == {("link", "j3"), ("mass", "l5")}
        assert found.attribution.share == pytest.approx(1.0)


def test_a_joint_that_is_fixed_in_one_model_is_not_missing(write):
    found = diagnose(write("a.urdf", urdf()), write("b.urdf", urdf(fixed=[3])))
    (one,) = found.differences
    assert one.sentence == "j3: does not move in B, where what it carries is part of what is before it"


def test_a_link_that_is_fixed_to_another_one_is_named_as_itself(write):
    a, b = write("a.urdf", urdf(fixed=[4])), write("b.urdf", urdf([4]))
    for files, sides in (((a, b), "BA"), ((b, a), "AB")):
        found = diagnose(*files)
        what = f"l4 ({MASSES[4]:.6g} kg), fixed to it in {sides[1]}, is missing in {sides[0]}"
        assert found.differences[0].sentence.startswith(f"l3: {what}: mass ")
        assert found.attribution.share == pytest.approx(1.0)
        assert found.proof.agrees
