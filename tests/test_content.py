import re
from dataclasses import replace

import mujoco
import pytest

import screwgauge
from screwgauge.models.content import Content, kinds, table
from support import claims
from support.claims import edited, filled
from support.diagnosis import read_here

TABLE = claims.table("content")
PLAIN, URDF = (filled(TABLE["texts"][name], TABLE["texts"]) for name in ("plain", "urdf"))
MATTER = TABLE["texts"]["matter"]
DENSE = edited(PLAIN, [["<option >", '<option density="1000">']])


def files_of(case: dict) -> tuple[str, str, str]:
    ending = case.get("file", ".xml")
    text = filled(TABLE["texts"][{"x": "plain", "u": "urdf", "s": "sdf"}[ending[1]]], TABLE["texts"])
    without = edited(text, case.get("without", []))
    return ending, without, edited(without, case["with"])


CASES = {(kind, case["case"]): files_of(case) for kind, some in TABLE["kinds"].items() for case in some}
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
    assert TABLE["kinds"].keys() | FROM_ELSEWHERE == kinds().keys()
    assert {kind.fate for kind in kinds().values()} == {"held", "compared", "withheld", "aside", "irrelevant"}
    assert all(kind.note for kind in kinds().values())
    assert {kind.run for kind in kinds().values()} == {"held", "measured", "refused", "idle"}
    assert all(bool(kind.why and kind.remedy) == (kind.run == "refused") for kind in kinds().values())
    assert {kind.alone for kind in kinds().values()} == {"", "withheld", "aside"}


@pytest.mark.sampled(3)
@pytest.mark.slow
@pytest.mark.parametrize(("kind", "case"), CASES, ids=map(": ".join, CASES))
def test_content_of_one_model_alone_is_never_the_same(kind, case, diagnosed):
    ending, without, with_it = CASES[kind, case]
    for pair in ((without, with_it), (with_it, without)):
        found = diagnosed(ending, *pair)
        idle = kinds()[kind].fate in ("irrelevant", "aside")
        assert (found.same, found.exit_status) == ((True, 0) if idle else (False, 1)), found.verdict
        if found.undecided:
            assert found.verdict.startswith("Not all compared: ")
            assert found.not_compared
            assert found.differences == ()
        elif not idle:
            assert found.differences or not found.found.together.agrees


@pytest.mark.sampled(3)
@pytest.mark.slow
@pytest.mark.parametrize(("kind", "case"), CASES, ids=map(": ".join, CASES))
def test_what_both_models_have_is_the_same_where_it_is_compared_and_withheld_where_not(kind, case, diagnosed):
    ending, _, with_it = CASES[kind, case]
    found = diagnosed(ending, with_it, with_it)
    withheld = kinds()[kind].fate == "withheld" and case != "new element"  # which both say in the same words
    assert (found.same, found.undecided) == (not withheld, withheld), found.verdict
    assert found.headline.startswith("Not all compared: ") is bool(withheld)
    assert found.found.agreement.scaled < 1e-12


def test_two_rich_files_are_the_same_whatever_their_joints_are_called(diagnosed):
    rich = other = edited(PLAIN, TABLE["rich"]["with"])
    for name, new in (("a", "z"), ("b", "y"), ("c", "x"), ("d", "w")):
        other = other.replace(f'joint name="{name}"', f'joint name="{new}"').replace(
            f'joint="{name}"', f'joint="{new}"'
        )
    found = diagnosed(".xml", rich, other)
    assert {name: one.name for name, one in found.found.pair.joints.items()} == dict(zip("abcd", "zyxw", strict=True))
    assert found.same, found.verdict
    for old, new in (('stiffness="3"', 'stiffness="3.1"'), ('gear="2"', 'gear="2.1"'), ('0.5" solref', '0.6" solref')):
        assert other.count(old) == 1
        found = diagnosed(".xml", rich, other.replace(old, new))
        assert len(found.differences) == 1, found.verdict
        assert not found.same


def test_what_a_format_cannot_say_is_not_compared_and_not_different(diagnosed, tmp_path):
    joint = '<joint name="j" axis="0 0 1" pos="0 0 0" range="-1 1" limited="true"/>'
    body = f'<body name="b" pos="0.1 0 0">{joint}<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/></body>'
    text = f'<mujoco><compiler angle="radian"/><worldbody>{body}</worldbody>@</mujoco>'
    servo = '<actuator><position name="m" joint="j" kp="5"/></actuator>'
    (tmp_path / "r.urdf").write_text(URDF, encoding="utf-8")
    for end, same in (("", True), (servo, False)):
        (tmp_path / "r.xml").write_text(text.replace("@", end), encoding="utf-8")
        found = screwgauge.diagnose("r.urdf", "r.xml")
        assert (found.same, found.undecided) == (same, not same), found.verdict
        assert "limit effort of joint j in A" in found.verdict
    assert found.not_compared == ("force law of actuator m in B",)


def test_contacts_are_said_to_be_no_part_of_the_same(diagnosed):
    verdict = diagnosed(".xml", PLAIN, PLAIN).verdict
    assert verdict.startswith("4 joints and 4 bodies agree")
    assert "contacts of geoms in A and B" in verdict


def test_the_medium_is_seen_by_the_libraries_own_torques(diagnosed):
    """Own dynamics know no medium, and `no torque shows it` would be false."""
    found = diagnosed(".xml", PLAIN, DENSE)
    assert [(each.what, each.a, each.b, each.unit) for each in found.differences] == [("density", 0, 1000, "kg/m^3")]
    assert "leave out density" in found.verdict
    assert "no torque" not in found.verdict
    both = diagnosed(".xml", PLAIN, DENSE.replace('mass="2"', 'mass="2.1"'))
    assert "leave out density" in both.verdict


def test_warnings_of_a_library_withhold_the_same_where_one_model_alone_has_them(diagnosed):
    diagnosed(".xml", PLAIN, PLAIN)
    warning = Content("warnings of the library", "warning of MuJoCo: something", values=())

    def load(file, library, floating):
        reading = read_here(file, library, floating)
        return replace(reading, content=(*reading.content, warning)) if file.name == "b.xml" else reading

    assert screwgauge.diagnose("b.xml", "b.xml", load=load).same
    assert screwgauge.diagnose("a.xml", "b.xml", load=load).not_compared == (f"{warning.what} in B",)


def test_entries_of_loops_files_that_are_not_applied_withhold_the_same(tmp_path):
    file, loops = tmp_path / "r.urdf", tmp_path / "loops.yaml"
    file.write_text(URDF, encoding="utf-8")
    for text, same in (("name_mot: [j]\n", True), ("name_mot: [j]\nfurther: 3\n", False)):
        loops.write_text(text, encoding="utf-8")
        found = screwgauge.diagnose(file, file, loops=loops)
        assert (found.same, found.undecided) == (same, not same), found.verdict


def test_not_all_compared_is_told_apart_in_banner_report_and_json(diagnosed, tmp_path, command):
    diagnosed(".xml", *CASES["spatial tendons", "spring"][1:])
    said = " ".join(command("diagnose", "b.xml", "b.xml", "--out", "out", status=1).out.split())
    assert said.startswith("✗ NOT ALL COMPARED: ")
    assert "spatial tendon r in A and B" in said
    assert "**✗ NOT ALL COMPARED**" in (tmp_path / "out" / "report.md").read_text(encoding="utf-8")
    assert '"not_all_compared": true' in command("diagnose", "b.xml", "b.xml", "--out", "out", "--json", status=1).out


def test_every_array_of_a_compiled_model_is_of_some_kind():
    """Give an array of a newer MuJoCo a kind, or list it as derived or a name."""
    known = {array for kind in kinds().values() for array in kind.arrays}
    known |= {array for names in table()["arrays"].values() for array in names.split()}
    model = mujoco.MjModel.from_xml_string("<mujoco/>")
    groups = ("body", "jnt", "dof", "geom", "tendon", "actuator", "eq", "pair", "exclude", "plugin", "wrap")
    arrays = {name for name in dir(model) if name.partition("_")[0] in groups and "_" in name}
    assert arrays - known == set()


def test_shapes_of_meshes_which_are_not_read_are_contacts_all_the_same(diagnosed):
    mesh = '<collision><geometry><mesh filename="package://x/y.stl"/></geometry></collision>'
    with_mesh = URDF.replace(MATTER, f"{MATTER}{mesh}")
    verdict = diagnosed(".urdf", with_mesh, with_mesh).verdict
    assert "collision of link b in A and B" in verdict
    bare = re.sub("<geom[^>]*>", "", PLAIN)
    mesh = bare.replace("<worldbody>", '<asset><mesh name="x" file="x.stl"/></asset><worldbody>')
    mesh = mesh.replace("<body name=", '<geom type="mesh" mesh="x"/><body name=', 1)
    found = diagnosed(".xml", bare, mesh)
    assert found.same
    assert "contacts of geoms in B" in found.verdict


def test_what_nobody_knows_is_the_same_where_both_files_have_it_in_the_same_words(diagnosed):
    strange = URDF.replace("</robot>", '<robot_state tag="1"/></robot>')
    assert diagnosed(".urdf", strange, strange).same
    assert not diagnosed(".urdf", strange, strange.replace('tag="1"', 'tag="2"')).same
    assert not diagnosed(".urdf", strange, URDF).same


def test_namespaces_are_no_content(diagnosed):
    named = URDF.replace("<robot ", '<robot xmlns:xacro="http://ros.org/wiki/xacro" ')
    assert diagnosed(".urdf", URDF, named).same
