"""Every kind of content that acts on dynamics is compared, or two models that have it are not called the same."""

from __future__ import annotations

import re
from dataclasses import replace

import mujoco
import pytest

import screwgauge
from screwgauge.models.content import Content, kinds, table
from support.diagnosis import read_here
from support.models import MATTER

INERTIAL = '<inertial pos="0.2 0 0.1" mass="{}" diaginertia="0.01 0.02 0.02"/>'


def mjcf(*, option="", further="", top="", a="", ball="", tip="", gravcomp="", world="", motor='gear="1"'):
    """Three hinges in a row with a stop, friction and a spring, and a ball joint."""
    return (
        f'<mujoco><compiler angle="radian"/><option {option}>{further}</option>{top}<worldbody>'
        f'<body name="one"><joint name="a" axis="0 1 0" range="-1 1" limited="true" frictionloss="0.1" '
        f'stiffness="2" {a}/>'
        f'{INERTIAL.format(2)}<geom name="g" size="0.1" contype="0" conaffinity="0" {tip}/>'
        f'<body name="two" pos="0.4 0 0"><joint name="b" axis="0 1 0"/>{INERTIAL.format(1)}'
        '<site name="s" pos="0.1 0 0.3"/><geom name="h" size="0.1" contype="0" conaffinity="0"/>'
        f'<body name="three" pos="0.3 0 0"><joint name="c" axis="1 0 0"/>{INERTIAL.format(1)}'
        f'<body name="four" pos="0.3 0 0" {gravcomp}><joint name="d" type="ball" {ball}/>{INERTIAL.format(0.5)}'
        f"@</body></body></body></body>{world}"
        f'</worldbody><actuator><motor name="m" joint="a" {motor}/></actuator></mujoco>'
    )


def with_(text, end="", leaf=""):
    """More at the end of the file, and in its last body."""
    return text.replace("@", leaf).replace("</mujoco>", f"{end}</mujoco>")


PLAIN = with_(mjcf())


def tendon(attributes, joints=("a", "b"), kind=""):
    row = "".join(f'<joint joint="{name}" coef="{i + 1}"/>' for i, name in enumerate(joints))
    return f'<tendon><fixed name="t" {attributes}>{row}</fixed></tendon>{kind}'


def tied(attributes):
    return with_(mjcf(), tendon(attributes))


SPATIAL = '<tendon><spatial name="r" stiffness="5"><site site="w"/><site site="s"/></spatial></tendon>'
SITE = '<site name="w" pos="0 0 1"/>'
TWO = (
    '<tendon><fixed name="t"><joint joint="a" coef="1"/><joint joint="b" coef="1"/><joint joint="c" coef="2"/></fixed>'
    '<fixed name="u"><joint joint="b" coef="2"/></fixed></tendon>'
)
BY_POWERS = '<tendon tendon1="u" tendon2="t" polycoef="0 1 1 0 0"/>'
PAIR = '<contact><pair geom1="g" geom2="h"/></contact>'
FLEX = (
    '<body name="cloth"><flexcomp name="f" type="grid" count="3 3 1" spacing="0.1 0.1 0.1" dim="2" radius="0.01" '
    'mass="0.1"><contact contype="0" conaffinity="0"/><elasticity young="1e3" thickness="0.01"/></flexcomp></body>'
)
PID = '<extension><plugin plugin="mujoco.pid"/></extension>'
HELD = '<equality><weld name="hold" body1="grip" body2="four"/></equality>'
FIXED = f'<body name="part">{INERTIAL.format(0.5)}</body>'
PART = f'<body name="part" gravcomp="{{}}">{INERTIAL.format(0.5)}</body>'
LIMIT = 'lower="-1" upper="1" effort="{}" velocity="{}"'


def urdf(*, base="", effort=3, velocity=4, end="", kind="revolute", axis="0 0 1", version="1.0"):
    limit = f"<limit {LIMIT.format(effort, velocity)}/>" if kind == "revolute" else ""
    return (
        f'<robot name="r" version="{version}"><link name="base">{base}</link><link name="b">{MATTER}</link>'
        f'<link name="t"/><joint name="f" type="fixed"><parent link="b"/><child link="t"/></joint>'
        f'<joint name="j" type="{kind}"><origin xyz="0.1 0 0"/><parent link="base"/><child link="b"/>'
        f'<axis xyz="{axis}"/>{limit}</joint>{end}</robot>'
    )


TRANSMISSION = (
    '<transmission name="x"><joint name="j"/><actuator name="m"><mechanicalReduction>{}</mechanicalReduction>'
    "</actuator></transmission>"
)
MESH = '<collision><geometry><mesh filename="package://x/y.stl"/></geometry></collision>'
ROOTS = "".join(f'<body name="{n}">{INERTIAL.format(1)}<joint name="{n}1"/></body>' for n in "pq")
PINOCCHIO = "@pinocchio"
#: Kind -> name of a case -> ending, file without it, file with it.
#: A hinge on the world of an SDF, and what the inertial of its link says besides.
SDF = (
    '<sdf version="1.11"><model name="m"><link name="a"><inertial><pose>0 0 1 0 0 0</pose>{}</inertial></link>'
    '<joint name="j" type="revolute"><parent>world</parent><child>a</child><axis><xyz>1 0 0</xyz></axis></joint>'
    "</model></sdf>"
)
CASES: dict[str, dict[str, tuple[str, str, str]]] = {
    "joint properties": {"damping": (".xml", PLAIN, with_(mjcf(a='damping="1"')))},
    "matter": {"gravcomp": (".xml", PLAIN, with_(mjcf(gravcomp='gravcomp="0.5"')))},
    "gravity and medium": {
        "density": (".xml", PLAIN, with_(mjcf(option='density="1000"'))),
        "viscosity": (".xml", PLAIN, with_(mjcf(option='viscosity="1"'))),
        "gravity off": (".xml", PLAIN, with_(mjcf(further='<flag gravity="disable"/>'))),
    },
    "closures and couplings": {
        "joint": (".xml", PLAIN, with_(mjcf(), '<equality><joint joint1="a" joint2="b"/></equality>'))
    },
    "gears": {"gear": (".xml", PLAIN, with_(mjcf(motor='gear="3"')))},
    "range of rotation": {"ball": (".xml", PLAIN, with_(mjcf(ball='range="0 1" limited="true"')))},
    "higher powers of damping": {"quadratic": (".xml", with_(mjcf(a='damping="1"')), with_(mjcf(a='damping="1 0.5"')))},
    "higher powers of stiffness": {"cubic": (".xml", PLAIN, PLAIN.replace('stiffness="2"', 'stiffness="2 0 3"'))},
    "yield of springs": {"yield": (".xml", PLAIN, with_(mjcf(a='springyield="0.3"')))},
    "softness of stops": {
        "solref": (".xml", PLAIN, with_(mjcf(a='solreflimit="0.1 1"'))),
        "margin": (".xml", PLAIN, with_(mjcf(a='margin="0.1"'))),
    },
    "softness of friction": {"solimp": (".xml", PLAIN, with_(mjcf(a='solimpfriction="0.5 0.9 0.001"')))},
    "force limits": {
        "range": (".xml", PLAIN, with_(mjcf(a='actuatorfrcrange="-3 3"'))),
        "effort": (".urdf", urdf(), urdf(effort=5)),
        "effort in MuJoCo": (".urdf@mujoco", urdf(), urdf(effort=5)),
    },
    "weight borne by actuators": {"one": (".xml", PLAIN, with_(mjcf(a='actuatorgravcomp="true"')))},
    "fixed tendons": {
        what: (".xml", PLAIN, tied(f'{what}="{value}"'))
        for what, value in (
            ("stiffness", 3),
            ("damping", 3),
            ("frictionloss", 2),
            ("armature", 1),
            ("range", '-1 1" limited="true'),
        )
    }
    | {
        "springlength": (".xml", tied('stiffness="3"'), tied('stiffness="3" springlength="0.1 0.3"')),
        "coefficient": (".xml", tied('stiffness="3"'), tied('stiffness="3"').replace('coef="2"', 'coef="1.5"')),
        "other joint": (".xml", tied('stiffness="3"'), with_(mjcf(), tendon('stiffness="3"', ("a", "c")))),
    },
    "spatial tendons": {"spring": (".xml", with_(mjcf(world=SITE)), with_(mjcf(world=SITE), SPATIAL))},
    "other equalities": {
        "powers": (".xml", PLAIN, with_(mjcf(), f"{TWO}<equality>{BY_POWERS}</equality>")),
    },
    "force laws of actuators": {
        "servo": (".xml", PLAIN, PLAIN.replace('<motor name="m"', '<position kp="5" name="m"')),
        "gain": (".xml", PLAIN, PLAIN.replace('<motor name="m"', '<general gainprm="2" name="m"')),
        "lag": (".xml", PLAIN, PLAIN.replace('<motor name="m"', '<general dyntype="filter" name="m"')),
        "control": (".xml", PLAIN, with_(mjcf(motor='ctrlrange="-1 1" ctrllimited="true"'))),
        "force": (".xml", PLAIN, with_(mjcf(motor='forcerange="-1 1" forcelimited="true"'))),
    },
    "actuators of several freedoms": {
        "tendon": (".xml", PLAIN, with_(mjcf(), f'{tendon("")}<actuator><motor tendon="t"/></actuator>')),
        "ball": (".xml", PLAIN, with_(mjcf(), '<actuator><motor joint="d" gear="1 2 3"/></actuator>')),
    },
    "actuators of other transmissions": {
        "site": (".xml", PLAIN, with_(mjcf(), '<actuator><motor site="s" gear="0 0 1"/></actuator>'))
    },
    "contact pairs": {"one": (".xml", PLAIN, with_(mjcf(), PAIR))},
    "contacts of geoms": {
        "sphere": (".xml", PLAIN, with_(mjcf(tip="").replace('contype="0" conaffinity="0"', ""))),
        "none": (".xml", re.sub("<geom[^>]*>", "", PLAIN), PLAIN),
    },
    "wind": {"wind": (".xml", with_(mjcf(option='density="1"')), with_(mjcf(option='density="1" wind="1 2 3"')))},
    "fluid shape of geoms": {
        "ellipsoid": (
            ".xml",
            with_(mjcf(option='density="1"')),
            with_(mjcf(option='density="1"', tip='fluidshape="ellipsoid"')),
        )
    },
    "switched off": {
        flag: (".xml", PLAIN, with_(mjcf(further=f'<flag {flag}="disable"/>')))
        for flag in ("actuation", "clampctrl", "refsafe")
    }
    | {"group": (".xml", PLAIN, with_(mjcf(option='actuatorgroupdisable="0"')))},
    "switched on": {
        flag: (".xml", PLAIN, with_(mjcf(further=f'<flag {flag}="enable"/>'))) for flag in ("override", "invdiscrete")
    },
    "flexible bodies": {"cloth": (".xml", PLAIN, with_(mjcf(world=FLEX)))},
    "plugins": {
        "pid": (
            ".xml",
            PLAIN,
            with_(mjcf(top=PID), '<actuator><plugin name="p" plugin="mujoco.pid" joint="b"/></actuator>'),
        )
    },
    "bodies moved from outside": {
        "held": (
            ".xml",
            with_(mjcf(world='<body name="grip"/>'), HELD),
            with_(mjcf(world='<body name="grip" mocap="true"/>'), HELD),
        )
    },
    "parts compensated otherwise": {
        "half": (
            ".xml",
            with_(mjcf(gravcomp='gravcomp="0.5"'), leaf=PART.format(0.5)),
            with_(mjcf(gravcomp='gravcomp="1"'), leaf=PART.format(0)),
        )
    },
    "transmissions": {
        "one": (".urdf", urdf(), urdf(end=TRANSMISSION.format(50))),
        "another ratio": (".urdf", urdf(end=TRANSMISSION.format(50)), urdf(end=TRANSMISSION.format(30))),
        "gazebo": (".urdf", urdf(), urdf(end='<gazebo reference="j"><springStiffness>1</springStiffness></gazebo>')),
    },
    "velocity limits": {"faster": (".urdf", urdf(), urdf(velocity=9))},
    "dropped by the library": {"tree": (f".xml{PINOCCHIO}", PLAIN, with_(mjcf(world=ROOTS)))},
    "read otherwise by the library": {
        "quaternion": (
            f".urdf{PINOCCHIO}",
            urdf(),
            urdf().replace('xyz="0.1 0 0"', 'xyz="0.1 0 0" quat_xyzw="0 0 .6 .8"'),
        )
    },
    "mass from meshes": {"base": (".urdf@mujoco", urdf(), urdf(base=MESH))},
    "not held by the reading": {
        "new element": (".urdf", urdf(), urdf(end="<new/>")),
        "spring": (f".xml{PINOCCHIO}", PLAIN.replace('stiffness="2"', ""), PLAIN),
    },
    "inactive equalities": {
        "off": (".xml", PLAIN, with_(mjcf(), '<equality><joint joint1="a" joint2="b" active="false"/></equality>'))
    },
    "put in place": {"include": (".xml", PLAIN, PLAIN.replace("<worldbody>", '<include file="more.xml"/><worldbody>'))},
    "solver and time step": {"step": (".xml", PLAIN, with_(mjcf(option='timestep="0.01" integrator="implicitfast"')))},
    "added mass": {
        "of a link": (".sdf", SDF.format(""), SDF.format("<fluid_added_mass><xx>1</xx></fluid_added_mass>"))
    },
}
#: Kinds that do not come from the text of a model file alone, or of which MuJoCo 4 has none.
FROM_ELSEWHERE = {"drives", "warnings of the library", "entries of loops files", "plugins of bodies"}


@pytest.fixture
def diagnosed(tmp_path, inside):

    def of(ending, a, b):
        suffix = ending.partition("@")[0]
        (tmp_path / "more.xml").write_text("<mujoco><statistic extent='1'/></mujoco>", encoding="utf-8")
        for name, text in (("a", a), ("b", b)):
            (tmp_path / f"{name}{suffix}").write_text(text, encoding="utf-8")
        return screwgauge.diagnose(f"a{ending}", f"b{ending}")

    return of


def test_every_kind_has_a_fate_a_reason_and_a_file():
    assert CASES.keys() | FROM_ELSEWHERE == kinds().keys()
    assert {kind.fate for kind in kinds().values()} == {"held", "compared", "withheld", "aside", "irrelevant"}
    assert all(kind.note for kind in kinds().values())
    assert {kind.run for kind in kinds().values()} == {"held", "measured", "refused", "idle"}
    assert all(bool(kind.why and kind.remedy) == (kind.run == "refused") for kind in kinds().values())
    assert {kind.alone for kind in kinds().values()} == {"", "withheld", "aside"}


ALL = [(kind, case) for kind, cases in CASES.items() for case in cases]


@pytest.mark.sampled(3)
@pytest.mark.slow
@pytest.mark.parametrize(("kind", "case"), ALL, ids=[f"{kind}: {case}" for kind, case in ALL])
def test_content_of_one_model_alone_is_never_the_same(kind, case, diagnosed):
    ending, without, with_it = CASES[kind][case]
    for pair in ((without, with_it), (with_it, without)):
        found = diagnosed(ending, *pair)
        idle = kinds()[kind].fate in ("irrelevant", "aside")
        assert (found.same, found.exit_status) == ((True, 0) if idle else (False, 1)), found.verdict
        if found.undecided:
            assert found.verdict.startswith("Not all compared: ")
            assert found.not_compared
            assert found.differences == ()
        elif not idle:
            assert found.differences or not found.together.agrees


@pytest.mark.sampled(3)
@pytest.mark.slow
@pytest.mark.parametrize(("kind", "case"), ALL, ids=[f"{kind}: {case}" for kind, case in ALL])
def test_what_both_models_have_is_the_same_where_it_is_compared_and_withheld_where_not(kind, case, diagnosed):
    ending, _, with_it = CASES[kind][case]
    found = diagnosed(ending, with_it, with_it)
    withheld = kinds()[kind].fate == "withheld" and case != "new element"  # which both say in the same words
    assert (found.same, found.undecided) == (not withheld, withheld), found.verdict
    assert found.headline.startswith("Not all compared: ") is bool(withheld)
    assert found.found.agreement.scaled < 1e-12


RICH = with_(
    mjcf(
        option='density="1.2" wind="1 0 0"',
        a='damping="1 0.5" solreflimit="0.1 1" actuatorfrcrange="-3 3" actuatorgravcomp="true"',
        ball='range="0 1" limited="true"',
        gravcomp='gravcomp="0.5"',
        motor='gear="3" forcerange="-1 1" forcelimited="true"',
    ),
    tendon('stiffness="3" damping="2" range="-1 1" limited="true"')
    + PAIR
    + '<actuator><motor tendon="t" gear="2"/><motor joint="d" gear="1 2 3"/></actuator>',
)


def test_two_rich_files_are_the_same_whatever_their_joints_are_called(diagnosed):
    other = RICH
    for name, new in (("a", "z"), ("b", "y"), ("c", "x"), ("d", "w")):
        other = other.replace(f'joint name="{name}"', f'joint name="{new}"').replace(
            f'joint="{name}"', f'joint="{new}"'
        )
    found = diagnosed(".xml", RICH, other)
    assert {name: other.name for name, other in found.found.pair.joints.items()} == {
        "a": "z",
        "b": "y",
        "c": "x",
        "d": "w",
    }
    assert found.same, found.verdict
    for old, new in (('stiffness="3"', 'stiffness="3.1"'), ('gear="2"', 'gear="2.1"'), ('0.5" solref', '0.6" solref')):
        assert other.count(old) == 1
        found = diagnosed(".xml", RICH, other.replace(old, new))
        assert len(found.differences) == 1, found.verdict
        assert not found.same


def test_what_a_format_cannot_say_is_not_compared_and_not_different(diagnosed, tmp_path):
    joint = '<joint name="j" axis="0 0 1" pos="0 0 0" range="-1 1" limited="true"/>'
    body = f'<body name="b" pos="0.1 0 0">{joint}<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/></body>'
    text = f'<mujoco><compiler angle="radian"/><worldbody>{body}</worldbody>@</mujoco>'
    servo = '<actuator><position name="m" joint="j" kp="5"/></actuator>'
    (tmp_path / "r.urdf").write_text(urdf(), encoding="utf-8")
    for end, same in (("", True), (servo, False)):
        (tmp_path / "r.xml").write_text(text.replace("@", end), encoding="utf-8")
        found = screwgauge.diagnose("r.urdf", "r.xml")
        assert (found.same, found.undecided) == (same, not same), found.verdict
        assert "Outside the comparison: limit effort of joint j in A" in found.verdict
    assert found.verdict.startswith("Not all compared: force law of actuator m in B. All else is the same: ")


def test_contacts_are_said_to_be_no_part_of_the_same(diagnosed):
    verdict = diagnosed(".xml", PLAIN, PLAIN).verdict
    assert verdict.startswith("4 joints and 4 bodies agree, their torques to ")
    assert verdict.endswith(" Outside the comparison: contacts of geoms in A and B.")


def test_the_medium_is_seen_by_the_libraries_own_torques(diagnosed):
    """Own dynamics know no medium, and `no torque shows it` would be false."""
    found = diagnosed(".xml", PLAIN, with_(mjcf(option='density="1000"')))
    assert [(each.what, each.a, each.b, each.unit) for each in found.differences] == [("density", 0, 1000, "kg/m^3")]
    assert "Torques of bodies and joints leave out density" in found.verdict
    assert "no torque" not in found.verdict
    both = diagnosed(".xml", PLAIN, with_(mjcf(option='density="1000"')).replace('mass="2"', 'mass="2.1"'))
    assert "Torques of bodies and joints leave out density" in both.verdict


def test_warnings_of_a_library_withhold_the_same_where_one_model_alone_has_them(diagnosed):
    diagnosed(".xml", PLAIN, PLAIN)
    warning = Content("warnings of the library", "what MuJoCo warns of: something", values=())

    def load(file, library, floating):
        reading = read_here(file, library, floating)
        return replace(reading, content=(*reading.content, warning)) if file.name == "b.xml" else reading

    assert screwgauge.diagnose("b.xml", "b.xml", load=load).same
    assert screwgauge.diagnose("a.xml", "b.xml", load=load).not_compared == (f"{warning.what} in B",)


def test_entries_of_loops_files_that_are_not_applied_withhold_the_same(tmp_path):
    file, loops = tmp_path / "r.urdf", tmp_path / "loops.yaml"
    file.write_text(urdf(), encoding="utf-8")
    for text, same in (("name_mot: [j]\n", True), ("name_mot: [j]\nfurther: 3\n", False)):
        loops.write_text(text, encoding="utf-8")
        found = screwgauge.diagnose(file, file, loops=loops)
        assert (found.same, found.undecided) == (same, not same), found.verdict


def test_not_all_compared_is_told_apart_in_banner_report_and_json(diagnosed, tmp_path, command):
    diagnosed(".xml", *CASES["spatial tendons"]["spring"][1:])
    said = " ".join(command("diagnose", "b.xml", "b.xml", "--out", "out", status=1).out.split())
    assert said.startswith("✗ NOT ALL COMPARED: Not all compared: spatial tendon r in A and B. All else is the same: ")
    assert "**✗ NOT ALL COMPARED**" in (tmp_path / "out" / "report.md").read_text(encoding="utf-8")
    assert '"not_all_compared": true' in command("diagnose", "b.xml", "b.xml", "--out", "out", "--json", status=1).out


def test_every_array_of_a_compiled_model_is_of_some_kind():
    """One of a newer MuJoCo has to be given a kind, or be said to be derived or a name."""
    known = {array for kind in kinds().values() for array in kind.arrays}
    known |= {array for names in table()["arrays"].values() for array in names.split()}
    model = mujoco.MjModel.from_xml_string("<mujoco/>")
    groups = ("body", "jnt", "dof", "geom", "tendon", "actuator", "eq", "pair", "exclude", "plugin", "wrap")
    arrays = {name for name in dir(model) if name.partition("_")[0] in groups and "_" in name}
    assert arrays - known == set()


def test_shapes_of_meshes_which_are_not_read_are_contacts_all_the_same(diagnosed):
    with_mesh = urdf().replace(MATTER, f"{MATTER}{MESH}")
    verdict = diagnosed(".urdf", with_mesh, with_mesh).verdict
    assert "Outside the comparison: collision of link b in A and B" in verdict
    bare = re.sub("<geom[^>]*>", "", PLAIN)
    mesh = bare.replace("<worldbody>", '<asset><mesh name="x" file="x.stl"/></asset><worldbody>')
    mesh = mesh.replace("<body name=", '<geom type="mesh" mesh="x"/><body name=', 1)
    found = diagnosed(".xml", bare, mesh)
    assert found.same
    assert found.verdict.endswith(" Outside the comparison: contacts of geoms in B.")


def test_what_nobody_knows_is_the_same_where_both_files_have_it_in_the_same_words(diagnosed):
    strange = urdf(end='<robot_state tag="1"/>')
    assert diagnosed(".urdf", strange, strange).same
    assert not diagnosed(".urdf", strange, urdf(end='<robot_state tag="2"/>')).same
    assert not diagnosed(".urdf", strange, urdf()).same


def test_namespaces_are_no_content(diagnosed):
    named = urdf().replace("<robot ", '<robot xmlns:xacro="http://ros.org/wiki/xacro" ')
    assert diagnosed(".urdf", urdf(), named).same
