"""From two files to one sentence: what differs, how much it explains, what is left when it is put right."""

from __future__ import annotations

import re

import numpy as np
import pytest

import screwgauge
from support import robots
from support.mechanism import load_mechanism
from support.models import write_models
from support.readings import draw
from support.report import verdict

#: Torques of two readings of one model, of own dynamics and of both libraries, over the largest.
AGREE = 1e-12


@pytest.fixture(scope="module")
def machine(tmp_path_factory):
    """The built-in mechanism as MJCF."""
    folder = tmp_path_factory.mktemp("machine")
    write_models(load_mechanism("3ups-upu-s"), folder)
    return folder / "3ups-upu-s-full.xml"


@pytest.fixture(scope="module")
def arms(tmp_path_factory):
    return robots.write(tmp_path_factory.mktemp("arms"))


def body(text, name):
    """The start tags of a body and its inertial."""
    return re.search(rf'<body name="{re.escape(name)}"[^>]*>\s*<inertial [^>]*>', text).group()


def changed(path, old, new, name="changed"):
    return robots.edited(path, old, new, f"{name}{path.suffix}")


def entry(path, link, attribute, change):
    """A copy of an MJCF with an attribute of a body's inertial changed."""
    start = body(path.read_text(encoding="utf-8"), link)
    was = re.search(rf'{attribute}="([^"]*)"', start[start.index("<inertial") :])
    new = " ".join(repr(float(v)) for v in change(np.array(was.group(1).split(), dtype=float)))
    head, tail = start[: start.index("<inertial")], start[start.index("<inertial") :]
    return changed(path, start, head + tail.replace(was.group(), f'{attribute}="{new}"'))


def of_joint(path, joint, text):
    return changed(path, f'name="{joint}"', f'name="{joint}" {text}')


def check(found, what, item, words):
    assert not found.same
    assert found.exit_status == 1
    assert [(each.what, each.item_b) for each in found.differences] == [(what, item)], found.verdict
    assert words in found.verdict
    (cause,) = found.causes
    assert cause.share == pytest.approx(1.0, abs=1e-9)
    assert found.found.fix.proved
    assert all(value <= AGREE for witness in found.found.witnesses for value in witness.scaled.values())
    assert found.found.witnesses


@pytest.mark.slow
def test_of_the_mechanism_five_changes_are_said_in_one_sentence_each(machine):
    def diagnosed(path):
        return screwgauge.diagnose(machine, path)

    mass = diagnosed(entry(machine, "leg3.upper", "mass", lambda m: 1.01 * m))
    check(mass, "mass", "leg3.upper", "leg3.upper: mass 1.4342 kg in B, 1.4200 kg in A (+1.00 %)")
    com = diagnosed(entry(machine, "leg2.upper", "pos", lambda p: p + np.array([1e-3, 0.0, 0.0])))
    check(com, "com", "leg2.upper", "(+1 mm along x)")
    armature = diagnosed(of_joint(machine, "leg2.q3", 'armature="0.01"'))
    check(armature, "armature", "leg2.q3", "armature 0.01 kg in B, 0 kg in A")
    damping = diagnosed(of_joint(machine, "leg4.q2", 'damping="0.1"'))
    check(damping, "damping", "leg4.q2", "damping 0.1 N m s/rad in B, 0 N m s/rad in A")
    gravity = diagnosed(changed(machine, 'gravity="0 0 -9.81"', 'gravity="0 0 -9.8"'))
    check(gravity, "gravity", "", "gravity (0, 0, -9.8000) m/s^2 in B, (0, 0, -9.8100) m/s^2 in A")


@pytest.mark.slow
def test_of_an_arm_in_another_format_too(arms):
    urdf, mjcf = arms

    def diagnosed(path):
        return screwgauge.diagnose(urdf, path)

    check(diagnosed(entry(mjcf, "link3", "mass", lambda m: 1.01 * m)), "mass", "link3", "(+1.00 %)")
    check(
        diagnosed(entry(mjcf, "link5", "pos", lambda p: p + np.array([0.0, 1e-3, 0.0]))),
        "com",
        "link5",
        "(+1 mm along y)",
    )
    check(
        diagnosed(of_joint(mjcf, "joint2", 'armature="0.01"')),
        "armature",
        "joint2",
        "armature 0.01 kg m^2 in B, 0 kg m^2 in A",
    )
    check(diagnosed(changed(mjcf, 'damping="0.14"', 'damping="0.24"')), "damping", "joint4", "0.24")
    silent = diagnosed(changed(mjcf, "0 0 -9.81", "0 0 -9.8"))  # a URDF cannot say gravity, and is not blamed
    assert silent.same
    assert "A: the file states no gravity; that of the other file is taken" in silent.notes


@pytest.mark.slow
def test_what_is_the_same_is_said_to_be(machine, arms):
    for pair in (arms, (machine, machine), ("3ups-upu-s", machine), (f"{arms[0]}@pinocchio", f"{arms[0]}@mujoco")):
        found = screwgauge.diagnose(*pair)
        assert found.same, found.verdict
        assert found.exit_status == 0
        assert found.differences == ()
        assert found.found.agreement.scaled <= AGREE
        assert found.found.together.row.scaled <= AGREE


def test_one_joint_and_one_body_are_counted_as_such(tmp_path):
    bar = tmp_path / "bar.xml"
    inertial = '<inertial pos="0.2 0 0.1" mass="2" diaginertia="0.01 0.02 0.02"/>'
    bar.write_text(f"<mujoco><worldbody><body><joint/>{inertial}</body></worldbody></mujoco>", encoding="utf-8")
    assert screwgauge.diagnose(bar, bar).verdict.startswith("1 joint and 1 body agree")


def test_a_spring_tendon_of_one_alone_is_a_difference_that_its_library_s_torque_shows(tmp_path):
    bar, tied = tmp_path / "bar.xml", tmp_path / "tied.xml"
    inertial = '<inertial pos="0.2 0 0.1" mass="2" diaginertia="0.01 0.02 0.02"/>'
    text = f'<mujoco><worldbody><body><joint name="a"/>{inertial}</body></worldbody>@</mujoco>'
    tendon = '<tendon><fixed name="t" stiffness="3"><joint joint="a" coef="1"/></fixed></tendon>'
    bar.write_text(text.replace("@", ""), encoding="utf-8")
    tied.write_text(text.replace("@", tendon), encoding="utf-8")
    for pair, side in (((bar, tied), "B"), ((tied, bar), "A")):
        found = screwgauge.diagnose(*pair)
        assert [(each.what, each.item_a or each.item_b) for each in found.differences] == [("fixed tendons", "t")]
        assert f"in {side} only" in found.headline
        assert (found.same, found.undecided, found.exit_status) == (False, False, 1)
    assert screwgauge.diagnose(tied, tied).same


def test_a_seed_is_what_makes_states_reproducible(arms):
    one, two, three = (screwgauge.diagnose(*arms, seed=seed).found.agreement for seed in (1, 1, 2))
    assert one == two
    assert one != three
    reading = screwgauge.diagnose(*arms).a.reading
    states = draw(reading, 50)
    for name, joint in reading.joints.items():
        q = states.q[:, list(reading.joints).index(name)]
        assert joint.limits[0] <= q.min() < q.max() <= joint.limits[1]


def test_different_machines_are_said_to_be_with_the_best_map(machine, arms):
    found = screwgauge.diagnose(machine, arms[1])
    assert not found.same
    assert not found.found.alike
    assert "models of different machines: none of the 26 joints of A has a partner among the 7 of B" in found.verdict
    assert found.differences == ()


def test_what_no_torque_shows_is_said_so(arms):
    found = screwgauge.diagnose(arms[1], changed(arms[1], 'range="-1.5 1.2"', 'range="-1 1.2"'))
    assert not found.same
    assert "joint0: limits" in found.verdict
    assert [each.kind for each in found.causes] == ["unseen"]
    assert "It changes no torque" in found.verdict


def test_a_file_that_two_libraries_read_differently_names_what_a_loader_drops(write):
    leg = '<body name="{0}" pos="{1} 0 0"><joint name="{0}.q" axis="0 1 0"/>'
    inertial = '<inertial pos="0 0 0.1" mass="1" diaginertia="0.01 0.02 0.03"/></body>'
    legs = "".join(leg.format(f"leg{i}", i) + inertial for i in range(3))
    path = write("roots.xml", f"<mujoco><worldbody>{legs}</worldbody></mujoco>")
    found = screwgauge.diagnose(f"{path}@mujoco", f"{path}@pinocchio")
    assert [each.item_a for each in found.differences] == ["leg1.q", "leg2.q"]
    assert {each.what for each in found.differences} == {"branch"}
    assert "joint leg1.q, leg2.q, which pinocchio drops in B" in " ".join(found.notes)
    assert "read differently by mujoco (A) and pinocchio (B)" in found.verdict


@pytest.mark.slow
def test_an_engine_that_computes_otherwise_than_it_reads_is_told_from_a_model(arms, monkeypatch):
    from dataclasses import replace

    from support.trees import raw_queries

    ask = raw_queries.ask

    def wrong(*given):
        said = ask(*given)
        return replace(said, tau=said.tau * (1.0 + 1e-6))

    monkeypatch.setattr(raw_queries, "ask", wrong)
    found = screwgauge.diagnose(*arms)
    assert "mujoco itself computes another tau for B" in found.verdict
    assert not found.same


def test_a_failed_run_names_the_static_difference_beside_the_quantity(machine, tmp_path):
    from dataclasses import replace as with_

    own = tmp_path / "own.xml"
    own.write_bytes(entry(machine.with_name("3ups-upu-s.xml"), "leg3.upper", "mass", lambda m: 1.01 * m).read_bytes())
    scene = with_(screwgauge.load_scene("3ups-upu-s").at([0.0, 0.5]), models={"mujoco": own})
    results = screwgauge.run(scene, ("screw", "mujoco"), ("actuator_force",))
    assert (
        "leg3.upper: mass 1.4342 kg in B, 1.4200 kg in A (+1.00 %) (A: the description, B: own.xml)"
        in verdict(results).text
    )


@pytest.mark.slow
@pytest.mark.parametrize(
    ("old", "new", "word", "said"),
    [
        (
            'pos="0.12 0 0"',
            'pos="0.12 0 0.05"',
            "✗ OUT OF TOLERANCE",
            "rod: centre of mass (0.12, 0, 0.05) m in B, (0.12, 0, 0) m in A",
        ),
        (
            'name="pin" type="hinge" axis="0 0 1"',
            'name="pin" type="hinge" axis="0.1 0 1"',
            "✗ FAILED",
            "pin: in B its axis is tilted",
        ),
    ],
)
def test_what_the_judge_alone_faults_and_what_stops_an_engine_is_named(old, new, word, said, tmp_path):
    from dataclasses import replace as with_

    write_models(load_mechanism("slider-crank"), tmp_path)
    own = changed(tmp_path / "slider-crank.xml", old, new, "own")
    scene = with_(screwgauge.load_scene("slider-crank").at([0.0, 0.5]), models={"mujoco": own})
    found = verdict(screwgauge.run(scene, ("screw", "mujoco")))
    assert found.word == word
    assert said in found.text


def test_of_many_causes_those_that_explain_the_most_are_named_first(tmp_path):
    """Not those that are the largest beside what stands in A: nothing is infinitely less than a trace of damping."""
    model = """<mujoco><worldbody><body name="upper"><joint name="shoulder" axis="0 1 0" {0}/>
<inertial pos="0.1 0.02 -0.2" mass="{1}" diaginertia="0.1 0.12 0.09"/><body name="lower" pos="0.3 0 0">
<joint name="elbow" axis="1 0 0" {0}/><inertial pos="0 0.1 0.05" mass="0.5" diaginertia="0.03 0.02 0.01"/>
</body></body></worldbody></mujoco>"""
    a, b = tmp_path / "a.xml", tmp_path / "b.xml"
    a.write_text(model.format("", "1"), encoding="utf-8")
    b.write_text(model.format('damping="1e-5" armature="1e-5"', "1.5"), encoding="utf-8")
    found = screwgauge.diagnose(a, b)
    assert len(found.differences) == 5
    assert found.verdict.startswith("upper: mass 1.500 kg in B, 1.000 kg in A")
    assert found.causes[0].share > 0.99
    assert found.found.fix.proved
