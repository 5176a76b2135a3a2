from dataclasses import replace

import numpy as np
import pytest

import screwgauge
from screwgauge import stream
from support.engines import IN_DOUBLES
from support.judging import agreed
from support.mechanism import Coupling, PolynomialSum, load_mechanism, same_content
from support.models import description
from support.report import verdict
from support.scene import SOLVED, pose_scene, sampled

FORCE = ["actuator_force"]


def heavier(mechanism, share=1.5):
    first, *others = mechanism.bodies
    body = replace(first, mass=share * first.mass, inertia=share * first.inertia)
    return replace(mechanism, bodies=(body, *others))


@pytest.fixture
def scene():
    return sampled("slider-crank", slice(None, None, 40))


@pytest.fixture
def changed(scene):
    return replace(scene, mechanism=heavier(scene.mechanism))


@pytest.mark.slow
def test_all_engines_solve_the_mechanism_as_it_is(scene, changed):
    results = agreed(screwgauge.run(changed, engines=[*IN_DOUBLES, "truth"], quantities=FORCE))
    before = screwgauge.run(scene, engines=["screw"], quantities=FORCE).values("actuator_force")
    for engine in results.solutions:
        assert np.abs(results.values("actuator_force", engine) - before).max() > 1e-3 * np.abs(before).max(), engine


def test_engines_in_processes_of_their_own_do_so_too(changed):
    engines = ["screw", "pinocchio"]
    results = screwgauge.run(changed, engines=engines, quantities=FORCE, limits=screwgauge.Limits(60.0))
    assert results.ok


def test_a_simulation_does_so_too():
    scene = screwgauge.load_scene("a01-pendulum").at([0.0, 0.2])
    scene = replace(scene, mechanism=longer(scene.mechanism), known=None)
    results = screwgauge.run(scene, engines=["screw", "pinocchio"])
    assert results.ok


def longer(mechanism):
    (body,) = mechanism.bodies
    return replace(mechanism, bodies=(replace(body, com=1.5 * body.com),))


@pytest.mark.slow
def test_the_report_says_so(scene, changed):
    results = screwgauge.run(changed, engines=["screw"], quantities=FORCE)
    (warning,) = results.warnings
    assert "slider-crank.toml" in warning
    said = results.provenance["description"]
    assert said["file"] == "generated slider-crank.toml"
    assert said == results.provenance["models"]["screw"]
    usual = screwgauge.run(scene, engines=["screw"], quantities=FORCE)
    assert usual.warnings == ()
    assert usual.provenance["description"]["file"] == "built-in slider-crank.toml"
    assert verdict(usual).status == "agree"


@pytest.mark.slow
def test_other_times_streams_and_compiled_programs_are_of_the_changed_mechanism(changed):
    expected = screwgauge.run(changed, engines=["pinocchio"], quantities=FORCE).values("actuator_force")
    size = SOLVED * np.abs(expected).max()
    ((_, streamed),) = stream(changed, [changed.t], quantities=FORCE)
    assert np.abs(streamed.values["actuator_force"].array - expected).max() < size
    solver = screwgauge.compile(changed, quantities=FORCE, backend="numpy")
    motion = changed.motion
    assert np.abs(solver(motion.y, motion.yd, motion.ydd)["actuator_force"] - expected).max() < size
    some = screwgauge.run(changed.at(changed.t[1:]), engines=["screw"], quantities=FORCE)
    assert np.abs(some.values("actuator_force") - expected[1:]).max() < size


def test_a_bench_measures_methods_on_it(changed, tmp_path):
    posed = pose_scene(changed, tmp_path, samples=2)
    assert posed.files("screw").model == tmp_path / "slider-crank.toml"
    found = posed.files("screw").model.read_text(encoding="utf-8")
    assert same_content(load_mechanism(tmp_path / "slider-crank.toml"), changed.mechanism), found


def test_a_file_that_was_edited_after_it_was_read_changes_no_scene(write):
    text = description(load_mechanism("slider-crank"))
    write("m.toml", text)
    scene = screwgauge.load_scene(
        write("s.toml", 'mechanism = "m.toml"\nmotion.crank.polynomial = [0, 6, 3]\ntime.times = [0.1, 0.2]\n')
    )
    write("m.toml", description(heavier(load_mechanism("slider-crank"))))
    results = screwgauge.run(scene, engines=["screw", "pinocchio"], quantities=FORCE)
    assert results.ok
    assert any("read from m.toml" in warning for warning in results.warnings)


CHANGES = {
    "mass": heavier,
    "name": lambda m: replace(m, name="other"),
    "home": lambda m: replace(m, joints=(replace(m.joints[0], home=m.joints[0].home + 1e-9), *m.joints[1:])),
    "independent": lambda m: replace(m, independent={"y": next(iter(m.independent.values()))}),
    "couplings": lambda m: replace(m, couplings=(Coupling("c", m.coordinates[0], PolynomialSum(0.0, {})),)),
}


@pytest.mark.parametrize("change", CHANGES)
def test_any_change_is_a_change(change):
    mechanism = load_mechanism("slider-crank")
    assert not same_content(mechanism, CHANGES[change](mechanism))
    assert same_content(mechanism, replace(mechanism, title="another", where="elsewhere"))
