"""What a file says and a reading does not hold is said by name."""

from __future__ import annotations

import pytest

from support.models import INERTIAL, MATTER, mjcf
from support.readings import read

LINK = f'<link name="@">{MATTER}</link>'
ARM = f"""<robot name="r"><link name="a"/>{LINK.replace("@", "b")}{LINK.replace("@", "c")}
<joint name="j" type="revolute"><parent link="a"/><child link="b"/><limit lower="-1" upper="1" effort="3" velocity="4"/>
<dynamics damping="1" friction="2"/></joint>
<joint name="k" type="revolute"><parent link="b"/><child link="c"/><limit lower="-1" upper="1" effort="5" velocity="4"/>
<mimic joint="j"/></joint></robot>"""
TURNED = ARM.replace("<dynamics", '<origin quat_xyzw="1 0 0 0"/><dynamics')
PLANAR = f"""<robot name="r"><link name="a"/>{LINK.replace("@", "b")}
<joint name="j" type="planar"><parent link="a"/><child link="b"/><axis xyz="0 1 0"/></joint></robot>"""
JOINT = '<joint name="j" armature="0.1" damping="1" frictionloss="2" stiffness="3" range="-1 1"/>'
FIXED = f'<body name="tool">{INERTIAL}</body></body>'
BODY = f'<body name="a" gravcomp="0.5">{JOINT}{INERTIAL}</body>'


EFFORT = ("limit effort of joint j, k", "limit velocity of joint j, k")
CASES = [
    ("pinocchio", ARM, (*EFFORT, "mimic of joint k")),
    ("mujoco", ARM, EFFORT),
    ("yourdfpy", ARM, EFFORT),
    ("pinocchio", ARM.replace("</robot>", "<transmission/><gazebo/></robot>"), ("transmission", "gazebo")),
    ("pinocchio", TURNED, ("origin quat_xyzw, as the file is not of version 1.1",)),
    ("mujoco", TURNED.replace('name="r"', 'name="r" version="1.1"'), ("origin quat_xyzw of joint j",)),
    ("yourdfpy", TURNED, ("origin quat_xyzw of joint j",)),
    ("yourdfpy", ARM.replace('"j"', '"joint 1"'), ("limit effort of joint joint 1, k",)),
    ("pinocchio", ARM.replace("<dynamics", "<new/><dynamics"), ("new of joint j",)),
    ("mujoco", mjcf(BODY), ()),
    (
        "mujoco",
        mjcf(BODY.replace("</body>", FIXED).replace(' gravcomp="0.5"', ""), '<compiler fusestatic="true"/>'),
        (),
    ),
    ("mujoco", mjcf(BODY, '<option wind="1 0 0" density="1"/>'), ("option wind",)),
    ("mujoco", mjcf(BODY.replace("range", 'solreflimit="0.1 1" range')), ("softness of stops of joint j",)),
    ("mujoco", mjcf(BODY.replace(INERTIAL, '<geom size="0.1"/>')), ("contacts of geoms",)),
    ("pinocchio", mjcf(BODY), ("gravcomp of body a", "stiffness of joint j")),
    ("pinocchio", mjcf(BODY, '<option gravity="0 0 -1"/>'), ("option gravity",)),
    ("pinocchio", mjcf(BODY, '<compiler settotalmass="3"/>'), ("compiler settotalmass",)),
    ("pinocchio", mjcf(f"{BODY}<frame><body name='b'/></frame>"), ("body b, which pinocchio drops", "frame")),
    ("pinocchio", mjcf(BODY + "<replicate count='2'><geom size='1'/></replicate>"), ("replicate",)),
    ("mujoco", mjcf(BODY.replace('damping="1"', 'damping="1 2"')), ("higher powers of damping of joint j",)),
    (
        "mujoco",
        mjcf(BODY.replace(JOINT, '<joint type="ball" range="0 1" name="j"/>')),
        ("range of rotation of joint j",),
    ),
    ("pinocchio", PLANAR, ("axis 0 1 0 of planar joint j: Pinocchio takes 0 0 1",)),
    ("pinocchio", PLANAR.replace('<axis xyz="0 1 0"/>', ""), ("axis 1 0 0 of planar joint j: Pinocchio takes 0 0 1",)),
    (
        "pinocchio",
        mjcf(BODY).replace("</mujoco>", "<actuator><motor name='m' joint='j'/></actuator></mujoco>"),
        ("actuator",),
    ),
]


@pytest.mark.parametrize(("library", "text", "said"), CASES)
def test_what_is_not_read_is_said(library, text, said, write):
    ignored = read(write("model", text), library).ignored
    assert [phrase for phrase in said if phrase not in ignored] == []
    if not said:
        assert ignored == ()


def test_branches_that_pinocchio_drops_are_named(write):
    """It keeps the first tree below the world only."""
    root = f'<body name="@">{INERTIAL}<joint name="@1"/><body name="@tip">{INERTIAL}<joint name="@2"/></body></body>'
    path = write("roots.xml", mjcf("".join(root.replace("@", name) for name in "abcd")))
    assert len(read(path, "mujoco").bodies) == 8
    reading = read(path, "pinocchio")
    assert list(reading.bodies) == ["a", "atip"]
    assert reading.ignored[:2] == (
        "body b, btip, c and 3 more, which pinocchio drops",
        "joint b1, b2, c1 and 3 more, which pinocchio drops",
    )


def test_includes_meshes_and_files_are_said(write):
    write("joints.xml", '<mujoco><default><default class="x"><joint armature="7"/></default></default></mujoco>')
    further = '<include file="joints.xml"/><asset><mesh name="m" file="missing.stl"/></asset>'
    further += '<contact><pair name="p"/></contact>'
    body = BODY.replace("<joint", '<geom mesh="m" type="mesh"/><joint class="x"').replace('armature="0.1"', "")
    fixed = '<body name="stand"><geom type="mesh" mesh="m"/></body>'
    for library in ("mujoco", "pinocchio"):
        reading = read(write("model.xml", mjcf(body + fixed, further)), library)
        assert reading.joints["j"].armature == 7.0
        assert reading.bodies["a"].mass == 1.0
        said = [
            "include joints.xml, put in its place before a library reads it",
            "contact pairs",
            "mass of body stand, which is fixed and has it from meshes",
        ]
        assert [phrase for phrase in said if phrase not in reading.ignored] == []


def test_a_mesh_from_which_mujoco_would_take_a_mass_is_said(write):
    mesh = '<collision><geometry><mesh filename="package://x/y.stl"/></geometry></collision>'
    path = write("shell.urdf", ARM.replace('<link name="a"/>', f'<link name="a">{mesh}</link>'))
    assert "mesh of link a, from which MuJoCo would take its mass" in read(path, "mujoco").ignored


PLUGIN = """<mujoco><extension><plugin plugin="{name}"><instance name="i"/></plugin></extension>
<asset><mesh name="m"><plugin instance="i"/></mesh></asset>
<worldbody><body name="a"><joint name="j"/><inertial pos="0 0 0.1" mass="1" diaginertia="1 1 1"/>{geom}
</body></worldbody></mujoco>"""
GEOM = '<geom type="sdf" mesh="m"><plugin instance="i"/></geom>'


def test_plugins_of_collisions_are_left_out_by_name_though_mujoco_knows_none_of_that_name(tmp_path):
    (tmp_path / "m.xml").write_text(PLUGIN.format(name="soil.grains", geom=GEOM), encoding="utf-8")
    assert "plugin soil.grains" in read(tmp_path / "m.xml", "mujoco").ignored


def test_a_declaration_may_stand_below_an_empty_line(tmp_path):
    text = PLUGIN.format(name="soil.grains", geom=GEOM)
    (tmp_path / "m.xml").write_text(f'\n <?xml version="1.0"?>\n{text}', encoding="utf-8")
    assert list(read(tmp_path / "m.xml", "mujoco").bodies) == ["a"]
