import difflib
import re

import numpy as np
import pytest

import screwgauge
from support.causes import XmlText, change_file, write_fix
from support.diagnosis import Change, apply_changes
from support.errors import DescriptionError, OutputError
from support.geometry import rotation
from support.mechanics import inverse_dynamics
from support.readings import draw, read, tree_of
from support.robots import mjcf, tree, urdf

#: Torques of a file that was changed and read again, over the largest: 17 digits, and MuJoCo's principal axes.
AGAIN = 1e-13
FORMS = {"urdf": ("model.urdf", "pinocchio", urdf), "mjcf": ("model.xml", "mujoco", lambda p: mjcf(p, full=True))}
TURN = np.eye(4)
TURN[:3, :3], TURN[:3, 3] = rotation(np.array([0.6, 0.0, 0.8]), np.array(0.1)), [0.01, -0.02, 0.005]
PASSIVE = ("armature", "damping", "friction", "stiffness", "rest")
AXIS = np.array([0.36, 0.48, 0.8])


@pytest.fixture(params=FORMS)
def model(request, tmp_path):
    name, library, write = FORMS[request.param]
    file = tmp_path / name
    file.write_text(write(tree(0)), encoding="utf-8")
    return file, library, read(file, library)


def torques(reading, states=None):
    own = (
        apply_changes(reading, [Change("", "gravity", np.array([0.0, 0.0, -9.81]))])
        if reading.gravity is None
        else reading
    )
    return inverse_dynamics(tree_of(own), states or draw(own, 8))


def changes_of(reading):
    hinges = [name for name, joint in reading.joints.items() if joint.kind == "hinge"]
    (body, *_), joint = reading.bodies, hinges[1]
    old, held = reading.bodies[body], reading.joints[joint]
    return {
        "mass": Change(body, "mass", np.array(1.1 * old.mass)),
        "com": Change(body, "com", old.com + 0.02 * AXIS),
        "inertia": Change(body, "inertia", 1.05 * old.inertia + 1e-4 * np.diag([1.0, 2.0, 2.5])),
        "pose": Change(body, "pose", old.pose @ TURN),
        "placement": Change(joint, "placement", TURN),
        "axis": Change(joint, "axis", AXIS),
        "centre": Change(joint, "centre", held.centre + 0.02 * TURN[:3, 0]),
        "zero": Change(joint, "zero", np.array(0.2)),
        "sign": Change(joint, "sign", np.array(-1.0)),
        "limits": Change(joint, "limits", np.array([-0.3, 0.4])),
        **{
            what: Change(joint, what, np.array(0.7))
            for what in ("armature", "damping", "friction", "stiffness", "rest")
        },
        "gravcomp": Change(body, "gravcomp", np.array(0.5)),
        "gravity": Change("", "gravity", np.array([0.1, 0.0, -9.8])),
        "gear": Change(next(iter(reading.actuators), ""), "gear", np.array(7.0)),
        "branch": Change(list(reading.joints)[-1], "branch", np.array(0.0)),
    }


NOT_IN_A_URDF = ("armature", "stiffness", "rest", "gravcomp", "gravity", "gear")


PROPERTIES = [
    *("mass", "com", "inertia", "pose", "placement", "axis", "centre", "zero", "sign", "limits", *PASSIVE),
    *("gravcomp", "gravity", "gear", "branch"),
]


@pytest.mark.slow
@pytest.mark.parametrize("what", PROPERTIES)
def test_a_changed_file_is_read_as_the_changed_reading(model, what):
    file, library, reading = model
    change = changes_of(reading)[what]
    changed, left = change_file(file.read_text(), reading, [change])
    if file.suffix == ".urdf" and what in NOT_IN_A_URDF:
        assert changed == file.read_text()
        assert left[0][1] == f"URDF cannot express {what}"
        return
    assert not left
    file.write_text(changed)
    again, wanted = read(file, library), apply_changes(reading, [change])
    if what == "gear":
        assert again.actuators == wanted.actuators
    if what == "limits":
        assert again.joints[change.item].limits == pytest.approx((-0.3, 0.4))
    assert list(again.joints) == list(wanted.joints)
    states = draw(wanted, 8)
    a, b = torques(wanted, states), torques(again, states)
    assert np.abs(a - b).max() <= AGAIN * np.abs(a).max()
    if what not in ("limits", "gear", "branch"):
        assert np.abs(a - torques(reading, states)).max() > 1e-6 * np.abs(a).max()


def test_nothing_else_in_the_text_changes(model):
    file, _, reading = model
    text = file.read_text().replace("\n", "\n<!-- é -->\n")
    joint = list(reading.joints)[1]
    changed, _ = change_file(text, reading, [Change(joint, "damping", np.array(0.5))])
    lines = [line for line in difflib.ndiff(text.splitlines(), changed.splitlines()) if line[0] in "+-"]
    assert len(lines) == 2
    assert 'damping="0.5"' in lines[1]


def test_numbers_are_those_of_the_file_that_is_followed(write):
    """What passes through frames has rounding in its last digits; A's own 17 digits are kept."""
    text = (
        '<mujoco><worldbody><body name="a" pos="0 0 {up}"><joint name="j" axis="0 1 0"/>{inertial}'
        '<body name="b" pos="{out} 0 0.1"><joint name="k"/>{inertial}</body></body></worldbody></mujoco>'
    ).replace("{inertial}", '<inertial pos=".1 0 .02" mass="{mass}" diaginertia=".01 .02 .02"/>')
    exact = "0.30000000000000004"
    a = write("a.xml", text.format(up="0.3", out="0.3", mass=exact))
    b = write("b.xml", text.format(up="0.1", out="0.1", mass="0.9"))
    fixed = screwgauge.diagnose(a, b).found.fix.text
    assert fixed.count(f'mass="{exact}"') == 2
    long = {number for number in re.findall(r"[\d.]+", fixed) if len(number) > 5}
    assert long == {exact}


def test_a_link_that_is_fixed_to_another_one_is_changed_itself(tmp_path):
    """Its body has one mass, one centre and one tensor, all of which its mass alone changes."""
    file, parts = tmp_path / "model.urdf", tree(0)
    fixed = next(i for i, part in enumerate(parts) if part.kind == "fixed" and part.near >= 0)
    file.write_text(urdf(parts))
    heavier = file.read_text().replace(f'<mass value="{parts[fixed].mass!r}"/>', '<mass value="3.25"/>')
    (tmp_path / "other.urdf").write_text(heavier)
    a, b = read(tmp_path / "other.urdf", "pinocchio"), read(file, "pinocchio")
    body = next(name for name, other in b.bodies.items() if f"link{fixed}" in other.fixed)
    changes = [Change(body, what, np.asarray(getattr(a.bodies[body], what))) for what in ("mass", "com", "inertia")]
    changed, _ = change_file(file.read_text(), b, changes)
    lines = [line for line in difflib.ndiff(file.read_text().splitlines(), changed.splitlines()) if line[0] == "+"]
    assert len(lines) == 1
    assert float(lines[0].split('"')[1]) == pytest.approx(3.25, rel=1e-12, abs=0)


def test_a_body_of_two_links_that_have_to_lose_inertia_is_written_in_shares(write):
    """No change of one of the links does: the other one alone has more inertia than the whole is to have."""
    file = write(
        "model.xml",
        """<mujoco><worldbody><body name="arm"><joint name="hinge" axis="0 1 0"/>
<inertial pos="0 0 0.08" mass="0.5" diaginertia="0.05 0.05 0.05"/>
<body name="hand" pos="0 0 0.1"><inertial pos="0 0 0" mass="0.5" diaginertia="0.05 0.05 0.05"/></body>
</body></worldbody></mujoco>""",
    )
    reading = read(file, "mujoco")
    wanted = {"mass": 1.5, "com": [0.002, 0.001, 0.1], "inertia": np.diag([0.006, 0.014, 0.017])}
    changes = [Change("arm", what, np.asarray(value)) for what, value in wanted.items()]
    changed, left = change_file(file.read_text(), reading, changes)
    assert not left
    file.write_text(changed)
    a, b = torques(apply_changes(reading, changes)), torques(read(file, "mujoco"), draw(reading, 8))
    assert np.abs(a - b).max() <= AGAIN * np.abs(a).max()


def test_what_geoms_or_the_compiler_say_is_not_written(tmp_path):
    file = tmp_path / "model.xml"
    text = '<mujoco><compiler settotalmass="3"/><worldbody><body><joint/><geom size="0.1"/></body></worldbody></mujoco>'
    file.write_text(text)
    reading = read(file, "mujoco")
    changed, left = change_file(text, reading, [Change(next(iter(reading.bodies)), "mass", np.array(2.0))])
    assert changed == text
    assert 'settotalmass="3"' in left[0][1]


def test_b_itself_is_never_overwritten(tmp_path, write):
    b = write("b.urdf", "old")
    (tmp_path / "link.urdf").symlink_to(b)
    for out in (b, tmp_path / "link.urdf", tmp_path):
        with pytest.raises(OutputError):
            write_fix(out, "new", b)
    assert b.read_text() == "old"
    write_fix(tmp_path / "below" / "fixed.urdf", "new", b)
    assert [path.name for path in (tmp_path / "below").iterdir()] == ["fixed.urdf"]


@pytest.mark.parametrize(
    ("text", "why"),
    [("<robot><link></robot>", "well-formed"), ('<!DOCTYPE r [<!ENTITY a "b">]><robot>&a;</robot>', "document type")],
)
def test_what_is_no_plain_xml_is_refused(text, why):
    with pytest.raises(DescriptionError, match=why):
        XmlText(text, "model.urdf")
