"""Names that two models give each other's joints and motors: the map follows what they are, and the swap is said."""

from __future__ import annotations

from collections.abc import Sequence

import pytest

from screwgauge import diagnose

INERTIAL = '<inertial pos="{} .1 .05" mass="{}" diaginertia=".01 .02 .03"/>'
#: A chain of three unlike hinges, and two fingers that slide along one line.
MODEL = f"""<mujoco model="m"><compiler angle="radian"/><worldbody>
<body name="l1"><joint name="j1" axis="0 0 1"/>{INERTIAL.format(0.1, 1)}
 <body name="l2" pos=".3 0 0"><joint name="j2" axis="0 1 0"/>{INERTIAL.format(0.2, 0.5)}
  <body name="l3" pos=".3 0 0"><joint name="j3" axis="1 0 0"/>{INERTIAL.format(0.1, 0.2)}</body></body></body>
<body name="f1" pos="0 0 1"><joint name="left" type="slide" axis="1 0 0"/>{INERTIAL.format(0.1, 0.3)}</body>
<body name="f2" pos="0 0 1"><joint name="right" type="slide" axis="1 0 0"/>{INERTIAL.format(-0.1, 0.3)}</body>
</worldbody><actuator>@</actuator></mujoco>"""
HINGES = '<joint name="u1" axis="{}"/><joint name="u2" axis="{}"/>'
MOTORS = '<motor name="m1" joint="j1" gear="2"/><motor name="m2" joint="j2" gear="2"/>'


def swapped(text: str, one: str, other: str) -> str:
    return text.replace(f'"{one}"', '"?"').replace(f'"{other}"', f'"{one}"').replace('"?"', f'"{other}"')


def both(write, a: str, b: str):
    return diagnose(write("a.xml", a), write("b.xml", b))


@pytest.mark.parametrize("names", [("j1", "j2"), ("j1", "j3"), ("left", "right")])
def test_joints_that_have_each_others_names_are_paired_by_what_they_are(names, write):
    found = both(write, text := MODEL.replace("@", ""), swapped(text, *names))
    one, other = names
    expected = {name: name for name in ("j1", "j2", "j3", "left", "right")} | {one: other, other: one}
    assert found.pairing.joints == expected
    assert found.pairing.how[one] == "geometry, against its name"
    assert found.exit_status == 1
    assert [(each.item_a, each.what, each.kind) for each in found.differences] == [
        (name, "name", "convention") for name in sorted(names)
    ]
    assert f"{one}: is called {other} in B, where {one} is another joint" in found.verdict


def test_more_than_names_may_differ(write):
    text = MODEL.replace("@", "")
    found = both(write, text, swapped(text, "j1", "j2").replace('mass="0.2"', 'mass="0.25"'))
    assert {(each.item_a, each.what) for each in found.differences} == {("j1", "name"), ("j2", "name"), ("l3", "mass")}
    assert found.proof is not None
    assert found.proof.agrees


def test_a_joint_that_is_moved_keeps_its_name(write):
    text = MODEL.replace("@", "")
    found = both(write, text, text.replace('<body name="l2" pos=".3 0 0">', '<body name="l2" pos="0 0 0">'))
    assert {(each.item_a, each.what) for each in found.differences} == {("j2", "placement")}


def test_a_joint_that_is_turned_onto_the_axis_of_the_next_keeps_its_name(write):
    """As those of a universal joint do, of which the orientation is lost."""
    text = MODEL.replace("@", "").replace('<joint name="j1" axis="0 0 1"/>', HINGES.format("0 0 1", "0 1 0"))
    found = both(write, text, text.replace(HINGES.format("0 0 1", "0 1 0"), HINGES.format("0 1 0", "0 0 1")))
    assert all(name == other for name, other in found.pairing.joints.items())


@pytest.mark.parametrize("ahead", [(0.1, -0.1), (-0.1, 0.1)])
def test_of_joints_on_one_line_what_they_carry_decides(ahead, write):
    text = MODEL.replace("@", "")
    other = text.replace('"left"', '"x"').replace('"right"', '"y"').replace('"f1"', '"u"').replace('"f2"', '"v"')
    x, y = (INERTIAL.format(com, 0.3) for com in (0.1, -0.1))
    if ahead[0] < 0:
        other = other.replace(x, "?").replace(y, x).replace("?", y)
    found = both(write, text, other)
    assert found.same, found.verdict
    assert found.pairing.joints["left"] == ("x" if ahead[0] > 0 else "y")


def test_motors_that_have_each_others_names_are_said_to_drive_other_joints(write):
    found = both(write, MODEL.replace("@", MOTORS), MODEL.replace("@", swapped(MOTORS, "m1", "m2")))
    assert [each.sentence for each in found.differences] == [
        "m1: drives j2 in B, j1 in A",
        "m2: drives j1 in B, j2 in A",
    ]


def test_motors_without_names_are_those_of_their_joints(write):
    first, second = ('<motor joint="j1" gear="2"/>', '<motor joint="j2" gear="3"/>')
    found = both(write, MODEL.replace("@", first + second), MODEL.replace("@", second + first))
    assert found.same, found.verdict


def test_closures_are_those_of_their_bodies_whatever_they_are_called(write):
    rows = ['<connect {}body1="l1" body2="f1" anchor="0 0 0"/>', '<connect {}body1="l2" body2="f2" anchor="0 .1 0"/>']
    texts = [
        MODEL.replace("@", "").replace("<actuator></actuator>", f"<equality>{a.format('')}{b.format('')}</equality>")
        for a, b in (rows, reversed(rows))
    ]
    found = both(write, *texts)
    assert found.same, found.verdict


#: A chain of six unlike hinges and links that keep their names.
LINKS = ("base", "upper", "elbow", "fore", "wrist", "tool")
AXES = ("0 0 1", "0 1 0", "0 1 0", "0 0 1", "0 1 0", "1 0 0")


def arm(names: Sequence[str], links: Sequence[str] = LINKS) -> str:
    """A serial arm of some of the links; where one is left out, the rest stays in its place."""
    text, way = "", 0.0
    for i, link in enumerate(LINKS):
        way += 0.1 + 0.05 * i
        if link in links:
            joint = f'<joint name="{names[links.index(link)]}" axis="{AXES[i]}"/>'
            text += f'<body name="{link}" pos="0 0 {way:.3f}">{joint}{INERTIAL.format(0.01 * i, 3 - 0.4 * i)}'
            way = 0.0
    return f'<mujoco model="arm"><worldbody>{text}{"</body>" * len(links)}</worldbody></mujoco>'


def numbered(first: int, n: int = 6) -> list[str]:
    return [f"j{first + i}" for i in range(n)]


@pytest.mark.parametrize("first", [0, 2, 3])
def test_joints_that_are_numbered_from_elsewhere_are_the_same_joints(first, write):
    found = both(write, arm(numbered(1)), arm(numbered(first)))
    assert found.pairing.joints == dict(zip(numbered(1), numbered(first), strict=True))
    assert {(each.what, each.kind) for each in found.differences} == {("name", "convention")}
    assert f"6 joints have other names in B, in part those of others: j1 is j{first}" in " ".join(found.verdict.split())


@pytest.mark.parametrize("back", [False, True])
@pytest.mark.parametrize("left_out", ["elbow", "wrist"])
def test_a_link_that_is_left_out_is_named_though_the_joints_behind_it_are_numbered_anew(left_out, back, write):
    links = [link for link in LINKS if link != left_out]
    models = [arm(numbered(1)), arm(numbered(1, 5), links)]
    found = both(write, *models[:: -1 if back else 1])
    i, side = LINKS.index(left_out), "A" if back else "B"
    lead = found.headline
    assert lead.startswith(f"j{i + 1}: missing in {side}, with {left_out} that it moves"), lead
    assert {each.what for each in found.differences} == {"link", "name"}
