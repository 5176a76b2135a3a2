import sys
from dataclasses import replace
from types import ModuleType

import numpy as np
import pytest

import screwgauge
from screwgauge.engines.rounding import operations, rounding_errors
from screwgauge.engines.screw.model import ScrewModel
from screwgauge.engines.screw.traced import TracedWork
from screwgauge.quantities import FLOAT32, GIVEN
from screwgauge.reference.equations.recursion import MOVING, BodyAccelerations
from screwgauge.reference.equations.screws import cross, times
from screwgauge.reference.graph import layout
from screwgauge.report.pages import bench as page
from support.bench import Plan, bench, choose
from support.engines import ENGINES, Error
from support.errors import DescriptionError
from support.mechanism import load_mechanism
from support.report import verdict
from support.scene import scene_names

MOVED = [name for name in scene_names() if not screwgauge.load_scene(name).simulated]
FORCES = ("generalized_force", "actuator_force")


def few(scene, n=7):
    return scene.at(np.linspace(scene.t[0], scene.t[-1], n + 2)[1:-1])


def tolerances(results):
    return results.pairs.set_index(["quantity", "unit"])["tolerance"].to_dict()


@pytest.fixture
def toy(monkeypatch):
    """Makes the engine ``toy``, which computes in float32 whatever it is asked in, of a mechanism, problem and answer
    that are changed."""

    def put(mechanism=lambda given: given, problem=lambda given: given, answer=lambda given: given):
        class Toy(ScrewModel):
            def solve(self, given, progress=None):
                return answer(super().solve(problem(given)))

        def load(files, precision="float64"):
            return Toy(layout(mechanism(load_mechanism(files.model))), precision="float32")

        module = ModuleType("toy_of_number_types")
        module.load = load
        monkeypatch.setitem(sys.modules, module.__name__, module)
        monkeypatch.setitem(ENGINES, "toy", replace(ENGINES["screw"], name="toy", source=f"{module.__name__}:load"))

    return put


def with_masses(mechanism):
    return replace(mechanism, bodies=tuple(replace(body, mass=1.01 * body.mass) for body in mechanism.bodies))


def with_inertia(mechanism):
    return replace(mechanism, bodies=tuple(replace(body, inertia=1.01 * body.inertia) for body in mechanism.bodies))


def with_loads(problem):
    loads = tuple(replace(x, force=1.01 * x.force, torque=1.01 * x.torque) for x in problem.applied.loads)
    return replace(problem, applied=replace(problem.applied, loads=loads))


MASSES, INERTIA, LOADS = {"mechanism": with_masses}, {"mechanism": with_inertia}, {"problem": with_loads}


@pytest.mark.sampled(4)
@pytest.mark.parametrize("name", ["3ups-upu-s", *MOVED])
def test_a_right_program_agrees_on_built_in_mechanisms(name):
    results = screwgauge.run(few(screwgauge.load_scene(name)), engines=["screw", "screw@float32"])
    assert results.ok, verdict(results).text
    assert "as float32 to" in verdict(results).text


@pytest.mark.sampled(4)
@pytest.mark.parametrize("seed", range(16))
def test_a_right_program_agrees_on_random_mechanisms(seed):
    results = screwgauge.run(few(screwgauge.random(seed)), engines=["screw", "screw@float32"])
    assert results.ok, verdict(results).text


@pytest.mark.parametrize(
    ("name", "mistake"),
    [
        ("3ups-upu-s", MASSES),
        ("3ups-upu-s", LOADS),
        ("delta", MASSES),
        ("slider-crank", LOADS),
        ("five-bar", INERTIA),
        ("arm7", INERTIA),
    ],
    ids=lambda x: x if isinstance(x, str) else next(iter(x.values())).__name__,
)
def test_a_mistake_of_a_hundredth_is_found(name, mistake, toy):
    toy(**mistake)
    scene = few(screwgauge.load_scene(name))
    results = screwgauge.run(scene, engines=["screw", "toy@float32"], quantities=FORCES)
    assert {"differ", "faulted"} <= {*results.outcomes}
    alone = screwgauge.run(scene, engines=["toy@float32"], quantities=FORCES)
    assert alone.outcome == "faulted"


def test_the_sign_of_gyroscopic_moments_is_found(toy, monkeypatch):
    right = BodyAccelerations.needs

    def wrong(self, g):
        needs, w = right(self, g), self.bodies.turning.w
        gyroscopic = cross(w, times(self.pose.lay.mechanism.inertias, w))
        needs[..., MOVING, 3:] = needs[..., MOVING, 3:] - 2.0 * gyroscopic
        return needs

    class Planted(ScrewModel):
        def solve(self, problem, progress=None):
            with pytest.MonkeyPatch.context() as patch:
                patch.setattr(BodyAccelerations, "needs", wrong)
                return super().solve(problem)

    toy()
    monkeypatch.setattr(
        sys.modules["toy_of_number_types"],
        "load",
        lambda files, precision: Planted(layout(load_mechanism(files.model)), precision=precision),
    )
    results = screwgauge.run(few(screwgauge.load_scene("arm7")), engines=["screw", "toy@float32"], quantities=FORCES)
    assert {"differ", "faulted"} <= {*results.outcomes}


def test_who_is_asked_in_float64_and_answers_in_float32_is_out_of_tolerance(toy):
    toy()
    results = screwgauge.run(few(screwgauge.load_scene("five-bar")), engines=["screw", "toy"], quantities=GIVEN)
    assert not results.pairs["ok"].any()


def test_the_word_of_the_engine_admits_nothing(toy):
    scene, answers = few(screwgauge.load_scene("five-bar")), []
    for admitted in (0.0, 0.1):
        wide = Error(np.full(len(scene.t), admitted), {"N m": admitted, "N": admitted})
        toy(answer=lambda given, wide=wide: replace(given, errors=dict.fromkeys(given.values, wide)))
        answers.append(tolerances(screwgauge.run(scene, engines=["screw", "toy@float32"])))
    assert answers[0] == answers[1]
    assert 0.0 < max(answers[0].values()) < FLOAT32.limit


def test_tolerances_do_not_depend_on_who_is_compared():
    scene, quantities = few(screwgauge.load_scene("delta")), ("actuator_force",)
    pairs = [tolerances(screwgauge.run(scene, [other, "screw@float32"], quantities)) for other in ("screw", "mujoco")]
    assert pairs[0] == pytest.approx(pairs[1])


def test_errors_grow_with_the_condition():
    scene = screwgauge.load_scene("slider-crank")
    errors = rounding_errors(scene.mechanism, scene.problem(["joint_acceleration"]), FLOAT32)["joint_acceleration"]
    double = rounding_errors(scene.mechanism, scene.problem(["joint_acceleration"]), replace(FLOAT32, eps=2e-8))
    assert errors.scaled == pytest.approx(double["joint_acceleration"].scaled * FLOAT32.eps / 2e-8, rel=0.1)
    assert errors.scaled.max() > 2.0 * errors.scaled.min()


@pytest.mark.parametrize("name", ["3-upu", "bennett", "double-cardan", "delta", "slider-crank"])
def test_operations_are_those_of_programs_or_some_more(name):
    scene = few(screwgauge.load_scene(name))
    wanted = [quantity for quantity in GIVEN if quantity != "mass_matrix"]
    work = TracedWork(layout(scene.mechanism), scene.problem(wanted), scene.motion, "numpy")
    assert len(work.traced.program.code) < operations(scene.mechanism) < 10 * len(work.traced.program.code)


@pytest.mark.parametrize("name", ["pinocchio@float32", "screw@float16", "screw@float64", "screw@"])
def test_a_number_type_that_an_engine_does_not_compute_in_is_refused(name):
    with pytest.raises(DescriptionError, match="computes in"):
        screwgauge.run(screwgauge.load_scene("slider-crank"), engines=["mujoco", name])


@pytest.mark.parametrize("name", ["3ups-upu-s", "slider-crank"])
def test_machine_code_in_float32_says_what_numpy_says(name):
    scene = few(screwgauge.load_scene(name), 37)
    lay, problem = layout(scene.mechanism), scene.problem(("actuator_force", "joint_position"))
    right, *narrow = (
        ScrewModel(lay, backend=backend, precision=precision).solve(problem)
        for backend, precision in (("array", "float64"), ("numpy", "float32"), ("llvm", "float32"))
    )
    for quantity, values in right.values.items():
        size = np.abs(values.array).max()
        errors = [np.abs(one.values[quantity].array - values.array).max() / size for one in narrow]
        assert all(1e-9 < error < 2e-6 for error in errors), quantity


def test_simulations_have_one_number_type():
    with pytest.raises(DescriptionError, match="integrate"):
        screwgauge.run(screwgauge.load_scene("a01-pendulum"), engines=["screw@float32"])


def test_a_gate_names_it_in_its_scene(tmp_path):
    scene = tmp_path / "narrow.toml"
    scene.write_text(
        'mechanism = "five-bar"\nengines = ["screw", "screw@float32"]\nquantities = ["actuator_force"]\n'
        "time = { duration = 1.0, step = 0.25 }\n[motion]\nleft.harmonics = [[3, 0, 0.4]]\n"
        "right = { harmonics = [[4, -0.3, 0.2]], offset = 0.3 }\n"
    )
    checked = screwgauge.check(scene)
    checked.assert_ok()
    assert FLOAT32.name in checked.rows[0].worst.reason


def test_a_bench_says_how_many_digits_float32_may_leave():
    plan = Plan(samples=9, rounds=1, budget=1e9, quick=True)
    measured = bench(few(screwgauge.load_scene("slider-crank"), 21), plan=plan, contestants=["screw-float32"])
    rows = page.PAGE.values["narrow"](measured)
    assert [row["quantity"] for row in rows] == ["actuator_force"] * 2
    for row in rows:
        assert float(row["digits"]) > float(row["allowed"]) > 3.0


def test_a_bench_leaves_out_engines_of_extras_that_are_not_installed(monkeypatch):
    monkeypatch.setattr(type(ENGINES["mjx"]), "installed", False)
    assert not {one.name for one in choose(None)} & {"mjx-path", "mjwarp-float32"}
    assert {one.name for one in choose(["mjx"])} == {"mjx-path"}
