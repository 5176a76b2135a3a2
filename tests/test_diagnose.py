import re
import shutil
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pinocchio
import pytest

import screwgauge
from screwgauge import ScrewgaugeError, models
from support import robots, urdf
from support.claims import table
from support.command import main
from support.diagnosis import STATES, summary
from support.errors import ClosureError, OutputError
from support.mechanism import load_mechanism
from support.models import write_models
from support.readings import draw, read
from support.report import verdict
from support.trees import raw_queries

NAME = "five-bar"


@pytest.fixture(scope="module")
def arms(tmp_path_factory):
    return robots.write(tmp_path_factory.mktemp("arms"))


def test_a_seed_makes_states_reproducible(arms):
    one, two, three = (screwgauge.diagnose(*arms, seed=seed).found.agreement for seed in (1, 1, 2))
    assert one == two
    assert one != three
    reading = screwgauge.diagnose(*arms).a.reading
    states = draw(reading, 50)
    for name, joint in reading.joints.items():
        q = states.q[:, list(reading.joints).index(name)]
        assert joint.limits[0] <= q.min() < q.max() <= joint.limits[1]


@pytest.mark.slow
def test_an_engine_that_computes_another_torque_than_it_reads_is_told_from_a_model(arms, monkeypatch):
    ask = raw_queries.ask
    monkeypatch.setattr(raw_queries, "ask", lambda *given: replace(said := ask(*given), tau=said.tau * (1.0 + 1e-6)))
    found = screwgauge.diagnose(*arms)
    assert [each.library for each in found.found.witnesses if not each.agrees] == ["mujoco"]
    assert "The tau that mujoco computes" in found.verdict
    assert not found.same


def test_torques_that_differ_for_no_reason_that_is_read_are_not_the_same(arms, monkeypatch):
    ask = raw_queries.ask

    def faked(path, *rest):
        said, whole = ask(path, *rest), len(rest) > 3 and rest[3]
        return replace(said, tau=said.tau + 0.5) if whole and path.name == "copy.xml" else said

    monkeypatch.setattr(raw_queries, "ask", faked)
    found = screwgauge.diagnose(arms[1], shutil.copy(arms[1], arms[1].with_name("copy.xml")))
    assert (found.same, found.undecided, found.exit_status) == (False, False, 1)
    assert found.differences == ()
    assert found.found.together.row.value == pytest.approx(0.5)
    assert found.found.together.calls == ("mj_inverse", "mj_inverse")
    assert found.verdict.startswith("The libraries' own ")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "edit", "quantities", "word", "says"),
    [
        ("3ups-upu-s", ('mass="2.87"', 'mass="2.9"'), ("actuator_force",), "✗ DIFFER", "platform: mass"),
        ("slider-crank", ('pos="0.12 0 0"', 'pos="0.12 0 0.05"'), None, "✗ OUT OF TOLERANCE", "rod: centre of mass"),
        ("slider-crank", ('name="pin" type="hinge" axis="0 ', 'name="pin" axis="0.1 '), None, "✗ FAILED", "pin: in B"),
    ],
)
def test_a_run_that_does_not_agree_names_the_difference_of_the_models(name, edit, quantities, word, says, tmp_path):
    write_models(load_mechanism(name), tmp_path)
    own = robots.edited(tmp_path / f"{name}.xml", *edit, "own.xml")
    scene = replace(screwgauge.load_scene(name).at([0.0, 0.5]), models={"mujoco": own})
    found = verdict(screwgauge.run(scene, ("screw", "mujoco"), quantities))
    assert found.word == word
    assert says in found.text
    assert "(A: the description, B: own.xml)" in found.text


def test_the_difference_of_calls_is_that_of_the_libraries(arms):
    found = screwgauge.diagnose(f"{arms[0]}@mujoco", f"{arms[0]}@pinocchio", seed=3)
    said = re.search(r"differ by ([\d.]+) [N m]+ at (\w+)", next(n for n in found.notes if "casebook" in n))
    place = list(found.b.reading.joints).index(said[2])
    one, other = mujoco.MjModel.from_xml_path(str(arms[0])), pinocchio.buildModelFromUrdf(str(arms[0]))
    one.dof_frictionloss[:] = 0.0
    one.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONSTRAINT)
    states, data, apart = draw(found.b.reading, STATES, 3), mujoco.MjData(one), []
    for q, v, a in zip(states.q, states.qd, states.qdd, strict=True):
        data.qpos[:], data.qvel[:], data.qacc[:] = q, v, a
        mujoco.mj_inverse(one, data)
        apart.append(data.qfrc_inverse - pinocchio.rnea(other, other.createData(), q, v, a))
    assert float(said[1]) == pytest.approx(np.abs(apart)[:, place].max(), rel=1e-3)


def test_a_fix_has_what_the_library_of_b_does_not_read(write, tmp_path):
    text = table("diagnosis")["models"]["sprung"]
    bar, other = write("bar.xml", text), write("other.xml", text.replace('mass="2"', 'mass="2.02"'))
    screwgauge.diagnose(f"{bar}@mujoco", f"{other}@pinocchio").write_fix(tmp_path / "fixed.xml")
    assert screwgauge.diagnose(bar, tmp_path / "fixed.xml").same


@pytest.mark.parametrize("library", ["pinocchio", "yourdfpy"])
def test_a_joint_that_follows_a_fixed_one_is_held(library, write):
    links = (urdf.link("w"), *(urdf.link(name, 2, (0.01, 0.02, 0.02)) for name in "pqr"))
    mimic = '<mimic joint="b" offset="0.1" multiplier="2"/>'
    joints = (("a", "continuous", "w", "p"), ("b", "fixed", "p", "q"), ("c", "continuous", "q", "r", mimic))
    path = write("chain.urdf", urdf.robot(*links, *(urdf.joint(*each, axis="0 1 0") for each in joints)))
    (coupling,) = read(path, library).couplings.values()
    assert (coupling.joint, coupling.function.lead, coupling.function.polynomial.tolist()) == ("c", "", [0.1])


@pytest.fixture
def robot(tmp_path):
    write_models(load_mechanism(NAME), tmp_path)
    loops = shutil.move(tmp_path / f"{NAME}.loops.toml", tmp_path / "elsewhere.loops.toml")
    return tmp_path / f"{NAME}.urdf", loops


@pytest.mark.slow
def test_loops_elsewhere_are_named_for_each_side(robot, tmp_path, command):
    urdf, loops = robot
    out = ("--out", tmp_path / "out")
    assert screwgauge.diagnose(urdf, urdf, loops=(loops, loops)).found.mobility == (2, 2)
    assert screwgauge.diagnose(urdf, urdf, loops=loops).found.mobility == (2, 2)
    for one in ((loops, None), (None, loops)):
        assert not screwgauge.diagnose(urdf, urdf, loops=one).same
    assert screwgauge.diagnose(urdf, NAME, loops=loops).same
    command("diagnose", urdf, urdf, "--loops", f"{loops},{loops}", *out)
    command("diagnose", urdf, urdf, "--loops", f",{loops}", *out, status=1)
    command("diagnose", urdf, NAME, "--loops", loops, *out)


@pytest.mark.parametrize(
    ("sides", "given", "why"),
    [
        (("urdf", "xml"), (None, "loops"), "its own loop closures; omit"),
        (("urdf", NAME), (None, "loops"), "its own loop closures; omit"),
        (("xml", NAME), "loops", "their own loop closures; omit"),
        *((("urdf", NAME), bad, "pass one file") for bad in (("loops",), ("loops",) * 3, 3, [1, 2])),
    ],
)
def test_a_loops_file_that_no_side_needs_is_refused(sides, given, why, robot):
    urdf, loops = robot
    given = tuple(loops if one == "loops" else one for one in given) if isinstance(given, tuple) else given
    files = [one if one == NAME else urdf.with_suffix(f".{one}") for one in sides]
    with pytest.raises(ScrewgaugeError, match=why):
        screwgauge.diagnose(*files, loops=loops if given == "loops" else given)


def test_the_record_has_the_loops_file_with_its_digest_and_the_values_of_facts(robot):
    urdf, loops = robot
    heavier = urdf.with_name("heavier.urdf")
    heavier.write_text(urdf.read_text(encoding="utf-8").replace('<mass value="0.5"', '<mass value="0.7"', 1))
    record = summary(screwgauge.diagnose(heavier, NAME, loops=(loops, None)))
    assert record["models"]["A"]["loops"]["file"] == str(loops)
    assert len(record["models"]["A"]["loops"]["sha256"]) == 64
    assert record["models"]["B"]["loops"] is None
    assert [(each["what"], float(each["a"]), float(each["b"])) for each in record["differences"]] == [
        ("mass", 0.7, 0.5)
    ]


def test_gravity_of_an_import_is_that_of_its_scene(inside, write):
    inertial = '<inertial pos="0.1 0 0.02" mass="1" diaginertia="0.01 0.02 0.02"/>'
    body = f'<body><joint name="j" axis="0 1 0"/>{inertial}</body>'
    write("still.xml", f'<mujoco model="m"><option gravity="0 0 0"/><worldbody>{body}</worldbody></mujoco>')
    assert main(["import", "still.xml"]) == 0
    for made in ("still.toml", "still.xml"):
        assert main(["models", made, "--out", "made", "--check"]) == 0
        assert screwgauge.diagnose("still.xml", "made/m.xml").same
    assert screwgauge.diagnose("still.xml", "still.toml").same
    Path("still.scene.toml").unlink()
    notes = screwgauge.diagnose("still.xml", "still.toml").notes
    assert any(note.startswith("B: ") and "gravity" in note for note in notes)


@pytest.mark.parametrize("sides", [("open", "closed"), ("closed", "open"), ("open", "open")])
def test_a_description_that_closes_nowhere_is_refused_as_by_models(sides, write, refused):
    text = Path(models.__file__).parent.joinpath(NAME, f"{NAME}.toml").read_text(encoding="utf-8")
    open_ = 'extends = "five-bar"\nname = "open"\njoints.tip.child_frame.position = [9, 0.3, 0]\n'
    files = {"closed": write("closed.toml", text), "open": write("open.toml", open_)}
    said = refused("diagnose", *(files[side] for side in sides))
    assert said == refused("models", files["open"])
    assert "no pose closes its loops" in said


MJCF = (
    '<mujoco><worldbody><body><joint name="a" axis="0 1 0"/>{0}</body><body><joint name="c" axis="0 1 0"/>{0}</body>'
    "</worldbody>{{}}</mujoco>"
).format('<inertial pos="0.1 0 0.02" mass="1" diaginertia="0.01 0.02 0.02"/>')


def test_models_that_close_nowhere_are_refused_with_their_file(write):
    held = '<equality><joint joint1="a" polycoef="0.5 0 0 0 0"/><joint joint1="a"/></equality>'
    files = [write(name, MJCF.format(held)) for name in ("a.xml", "b.xml")]
    with pytest.raises(ClosureError, match=r"a\.xml: loops do not close"):
        screwgauge.diagnose(*files)


def test_a_file_that_no_value_mends_is_not_written(write, tmp_path):
    motor = '<actuator><motor name="m" joint="{}"/></actuator>'
    found = screwgauge.diagnose(*(write(f"{name}.xml", MJCF.format(motor.format(name))) for name in "ac"))
    assert found.not_fixed
    with pytest.raises(OutputError, match="can be written"):
        found.write_fix(tmp_path / "fixed.xml")
    assert not (tmp_path / "fixed.xml").exists()
