"""What a file may say in several ways is read and put right in each: orientations, frames, free and ball joints."""

from __future__ import annotations

import math

import pytest

import screwgauge

pytestmark = pytest.mark.slow

INERTIAL = '<inertial pos="{at}" mass="{mass}" fullinertia="0.02 0.03 0.04 0.003 -0.002 0.001"/>'
TURNED = math.radians(40.0)
C, S = math.cos(TURNED), math.sin(TURNED)
#: The same quarter of a turn and less, about an axis across the vertical, in all the ways that an MJCF has.
ORIENTATIONS = {
    "quat": f'quat="{math.cos(TURNED / 2)!r} {math.sin(TURNED / 2)!r} 0 0"',
    "euler": 'euler="40 0 0"',
    "axisangle": 'axisangle="2 0 0 40"',
    "xyaxes": f'xyaxes="3 0 0 0.5 {2 * C!r} {2 * S!r}"',
    "zaxis": f'zaxis="0 {-5 * S!r} {5 * C!r}"',
}
AGAIN = 1e-12
STAND = (
    '<body name="stand" pos="1 0 0"><joint name="s" axis="0 1 0"/>' + INERTIAL.format(at="0 0 0.1", mass=3) + "</body>"
)
LOOSE = f'<body name="box" pos="2 0 0"><freejoint name="f"/>{INERTIAL.format(at="0 0 0", mass=4)}</body>'


def arm(orientation: str, mass: float = 1.5, base: str = '<joint name="a" axis="0 1 0"/>', wrist: str = "") -> str:
    wrist = wrist or '<joint name="b" axis="0 0.6 0.8"/>'
    return (
        '<mujoco><compiler autolimits="true"/><worldbody><body name="one" pos="0 0 0.1">'
        f"{base}{INERTIAL.format(at='0.01 0.02 0.03', mass=2)}"
        f'<frame pos="0.1 0 0" euler="0 0 20"><body name="two" pos="0.1 0 0.2" {orientation}>{wrist}'
        f"{INERTIAL.format(at='0 0.1 0', mass=mass)}</body></frame></body></worldbody></mujoco>"
    )


def proved(found, tmp_path, ending="xml"):
    """The one change explains all, and the file with it made is A."""
    (sentence,) = [each.sentence for each in found.differences]
    assert found.proof.on == "file"
    assert found.proof.left.scaled < AGAIN
    found.write_fix(tmp_path / f"fixed.{ending}")
    assert screwgauge.diagnose(tmp_path / f"a.{ending}", tmp_path / f"fixed.{ending}").same
    return sentence


@pytest.mark.slow
@pytest.mark.parametrize("form", ORIENTATIONS)
def test_an_orientation_is_the_same_in_every_form_and_beside_each_a_mass_is_put_right(form, diagnosed, tmp_path):
    assert diagnosed(arm(ORIENTATIONS["quat"]), arm(ORIENTATIONS[form])).same
    found = diagnosed(arm(ORIENTATIONS["quat"]), arm(ORIENTATIONS[form], mass=1.6))
    assert proved(found, tmp_path) == "two: mass 1.600 kg in B, 1.500 kg in A (+6.67 %)"


FREE, BALL = '<freejoint name="a"/>', '<joint name="b" type="ball"/>'


@pytest.mark.slow
@pytest.mark.parametrize(("base", "wrist"), [(FREE, ""), ("", BALL), (FREE, BALL)])
def test_free_and_ball_joints_have_their_mass_put_right(base, wrist, diagnosed, tmp_path):
    joints = {key: value for key, value in (("base", base), ("wrist", wrist)) if value}
    right, wrong = (arm(ORIENTATIONS["euler"], mass, **joints) for mass in (1.5, 1.6))
    assert diagnosed(right, right).same
    found = diagnosed(right, wrong)
    assert proved(found, tmp_path) == "two: mass 1.600 kg in B, 1.500 kg in A (+6.67 %)"


@pytest.mark.parametrize("base", [FREE, '<joint name="a" type="ball"/>'])
def test_a_body_that_is_described_in_another_frame_is_the_same_body(base, diagnosed):
    """Coordinates of a free or ball joint then mean other placements: they are taken over with the frame."""
    inner = '<body name="one" pos="0 0 0.1"{turn}>{base}<inertial pos="{com}" mass="2" diaginertia="{moments}"/></body>'
    world = "<mujoco><worldbody>{}</worldbody></mujoco>"
    a = world.format(inner.format(turn="", base=base, com="0.01 0.02 0.03", moments="0.02 0.03 0.04"))
    turn = ' euler="0 0 90"'
    b = world.format(inner.format(turn=turn, base=base, com="0.02 -0.01 0.03", moments="0.03 0.02 0.04"))
    found = diagnosed(a, b)
    assert found.same, found.verdict


@pytest.mark.slow
@pytest.mark.parametrize("turn", ["euler='40 0 0'", "euler='180 0 0'", "quat='0 0.6 0 0.8'", "euler='90 0 0'"])
@pytest.mark.parametrize("base", ["", '<joint name="a" type="slide" axis="0 1 0"/><joint name="c" type="ball"/>'])
def test_a_base_that_stands_turned_is_one_difference_and_no_gravity(turn, base, diagnosed, tmp_path):
    a = arm(ORIENTATIONS["quat"], base=base or '<joint name="a" axis="0 0 1"/>')
    found = diagnosed(a, a.replace('name="one"', f'name="one" {turn}'))
    assert proved(found, tmp_path).startswith("a: sits elsewhere in B, with all that it carries, turned by ")


@pytest.mark.slow
@pytest.mark.parametrize("beside", [STAND, LOOSE])
@pytest.mark.parametrize("first", [False, True])
def test_a_free_base_stands_where_its_coordinates_say_whatever_else_there_is(beside, first, diagnosed):
    free = arm(ORIENTATIONS["quat"], base='<freejoint name="a"/>')
    where = ("<worldbody>", f"<worldbody>{beside}") if first else ("</worldbody>", f"{beside}</worldbody>")
    a = free.replace(*where)
    found = diagnosed(a, a.replace('name="one"', "name='one' euler='0 45 0'"))
    assert found.same
    assert any(
        note.startswith("a stands elsewhere at home in B (turned by -45 deg about y of ") for note in found.notes
    )
