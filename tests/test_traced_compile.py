import importlib.util
import re
import sys

import numpy as np
import pytest

import screwgauge
from screwgauge.truth import cache
from support.acting import Course, Motor, hold
from support.scene import sampled
from support.solve import ScrewModel, layout
from support.traced import native

needs_llvm = pytest.mark.skipif(not importlib.util.find_spec("llvmlite"), reason="llvmlite is not installed")
FORCES = ("generalized_force", "actuator_force")
#: Relative: the same equations in another order.
SAME = 1e-12


@pytest.fixture(scope="module")
def scene():
    return sampled("3ups-upu-s", slice(0, 500, 5))


@pytest.fixture(scope="module")
def solver(scene):
    return screwgauge.compile(scene, FORCES, backend="numpy")


def motion(scene):
    return scene.motion.y.copy(), scene.motion.yd.copy(), scene.motion.ydd.copy()


def expected(scene, quantity="actuator_force"):
    return ScrewModel(layout(scene.mechanism)).solve(scene.problem([quantity])).values[quantity].array


def far(a, b):
    return np.abs(a - b).max() / np.abs(b).max()


def test_it_answers_as_the_engine_does(scene, solver):
    answer = solver(*motion(scene))
    assert far(answer["actuator_force"], expected(scene)) <= SAME
    assert answer.by_array == {}
    assert solver.components["actuator_force"] == ("leg1", "leg2", "leg3", "leg4")


def test_many_samples_go_through_in_parts(scene, solver):
    y, yd, ydd = (np.tile(x, (50, 1)) for x in motion(scene))
    assert far(solver(y, yd, ydd)["actuator_force"], np.tile(expected(scene), (50, 1))) <= SAME


def test_loads_of_the_samples_replace_those_of_the_scene(scene, solver):
    load = np.array([5.0, -70.0, 300.0, 20.0, 0.0, -3.0])
    (old,) = scene.applied.loads
    other = scene.under(loads=(type(old)(old.body, old.point, load[:3], load[3:]),))
    for given in (load, np.tile(load, (100, 1))):
        assert far(solver(*motion(scene), load=given)["actuator_force"], expected(other)) <= SAME


def test_estimates_cover_the_difference(scene, solver):
    answer = solver(*motion(scene), estimates=True)
    away = np.abs(answer["actuator_force"] - expected(scene)).max(axis=1)
    assert (away <= answer.estimate["actuator_force"][:, 0]).all()


def test_threads_share_the_samples(scene):
    both = screwgauge.compile(scene, FORCES, backend="numpy", threads=2)
    assert far(both(*motion(scene))["actuator_force"], expected(scene)) <= SAME


def test_singular_samples_are_counted(scene, solver):
    y, yd, ydd = motion(scene)
    y[7] = 1e-9 - np.arctan2(0.3 * 3**0.5, 0.5), 0.0  # the base of leg 2 locks
    assert solver(y, yd, ydd).by_array == {"badly conditioned": 1}


@pytest.mark.parametrize("which", ["t", "load"])
def test_what_is_no_number_is_refused_by_its_row(scene, solver, which):
    y, yd, ydd = motion(scene)
    given = {"t": np.arange(100.0), "load": np.zeros((100, 6 * len(scene.applied.loads)))}[which]
    out = solver.buffers(len(y))
    solver(y, yd, ydd, **{which: given}, out=out)
    given[7] = np.nan
    with pytest.raises(screwgauge.ScrewgaugeError, match=f"{which}: row 7 contains a non-finite number"):
        solver(y, yd, ydd, **{which: given}, out=out)


def test_a_pose_of_an_open_tree_that_is_no_number_is_refused():
    """No loop residual reveals it."""
    arm = screwgauge.load_scene("arm7")
    y, yd, ydd = motion(arm)
    solver = screwgauge.compile(arm, ["actuator_force"], backend="numpy")
    solver(y, yd, ydd)
    y[7, 0] = np.nan
    with pytest.raises(screwgauge.ScrewgaugeError, match="y: row 7 contains a non-finite number"):
        solver(y, yd, ydd)


def test_bad_loads_are_refused(scene, solver):
    for load in (np.zeros(5), np.zeros((99, 6)), [0.0] * 6, np.float64(1.0), np.ma.zeros(6)):
        with pytest.raises(screwgauge.ScrewgaugeError, match="load: expected"):
            solver(*motion(scene), load=load)
    bare = screwgauge.compile(scene.under(loads=()), ["actuator_force"], backend="numpy")
    with pytest.raises(screwgauge.ScrewgaugeError, match="no load"):
        bare(*motion(scene), load=np.zeros(6))


@pytest.mark.parametrize(
    ("settings", "message"),
    [({"backend": "jax"}, "backend"), ({"threads": 0}, "0 threads"), ({"quantities": ["x"]}, "x")],
)
def test_bad_settings_are_refused(scene, settings, message):
    with pytest.raises(screwgauge.ScrewgaugeError, match=message):
        screwgauge.compile(scene, **{"quantities": FORCES, "backend": "numpy", **settings})


@pytest.mark.slow
def test_what_cannot_be_traced_is_answered_by_arrays_and_said():
    scene = screwgauge.random(2, "underactuated")
    solver = screwgauge.compile(scene, ["actuator_force"], backend="numpy")
    (note,) = solver.notes
    assert re.match("all samples.*: .*fewer actuators", note)
    answer = solver(*motion(scene))
    assert far(answer["actuator_force"], expected(scene)) <= SAME
    assert sum(answer.by_array.values()) == len(scene.t)


def test_motors_that_change_over_time_ask_for_the_times(scene):
    waving = scene.under(motors=(Motor("leg1.q3", Course(np.zeros(1), np.array([[5.0, 1.0, 2.0]]))),))
    solver = screwgauge.compile(waving, FORCES, backend="numpy")
    with pytest.raises(screwgauge.ScrewgaugeError, match=r"a motor depends on time.*pass t"):
        solver(*motion(scene))
    assert far(solver(*motion(scene), t=scene.t.copy())["actuator_force"], expected(waving)) <= SAME
    screwgauge.compile(scene.under(motors=hold({"leg1.q3": 2.0})), FORCES, backend="numpy")(*motion(scene))


def test_without_llvmlite_numpy_runs_the_program_and_that_is_said(scene, monkeypatch):
    monkeypatch.setitem(sys.modules, "llvmlite.binding", None)
    if "screwgauge.reference.traced.native" in sys.modules:
        sys.modules["screwgauge.reference.traced.native"]._host.cache_clear()
    solver = screwgauge.compile(scene, FORCES, backend="llvm")
    (note,) = solver.notes
    assert note.startswith("llvmlite is not installed")
    assert "'fast'" in note
    assert far(solver(*motion(scene))["actuator_force"], expected(scene)) <= SAME


@pytest.mark.slow
@needs_llvm
@pytest.mark.parametrize("n", [1, 7, 8, 100])
def test_machine_code_answers_any_number_of_samples(scene, n):
    solver = screwgauge.compile(scene, FORCES)
    found = solver(*(x[:n] for x in motion(scene)))["actuator_force"]
    assert far(found, expected(scene)[:n]) <= SAME


@pytest.mark.slow
@needs_llvm
def test_machine_code_is_kept_and_a_damaged_file_is_made_anew(scene, tmp_path, monkeypatch):
    monkeypatch.setenv(cache.VARIABLE, str(tmp_path))
    assert screwgauge.compile(scene, FORCES).notes == ()
    (file,) = (path for path in tmp_path.iterdir() if path.name != cache.SECRET)
    with monkeypatch.context() as patch:
        patch.delattr(native, "machine_code")
        assert screwgauge.compile(scene, FORCES).notes == ()
    file.write_bytes(file.read_bytes()[:-5] + b"break")
    solver = screwgauge.compile(scene, FORCES)
    assert [*solver.notes] == [cache.DAMAGED]
    assert far(solver(*motion(scene))["actuator_force"], expected(scene)) <= SAME
    assert screwgauge.compile(scene, FORCES).notes == ()


def test_the_program_can_be_read(solver):
    text = solver.as_c()
    assert text.startswith("void sample(const double *x, double *out)\n{\n    double v6 = ")
    assert len(re.findall("out\\[", text)) >= 6
