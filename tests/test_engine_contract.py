"""What every engine must do, those of the registry and engines of other packages alike.

An engine is loaded once and asked often: given motions, simulations and sampled states, as far as it takes them.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
import pytest

import screwgauge
from screwgauge import ScrewgaugeError
from support.acting import GRAVITY, Load, hold
from support.engines import (
    ENGINES,
    MOTION,
    Engine,
    EngineModel,
    ModelFiles,
    Problem,
    Solution,
    check_engines,
    check_same,
    further_engines,
    get_engine,
    model_files,
)
from support.errors import ModelFileError, UnknownNameError
from support.scene import BODY_UNITS, GIVEN, RATE, TABLE, GivenMotion, InitialValue, Integration, States
from support.tolerances import LINEAR

LIBRARIES = {"truth": "flint", "drake": "pydrake"}  # what is not installed with the package
FURTHER = {"toy": "support.toy_engine:TOY", "drake": "support.drake_engine:DRAKE"}
LEGS = ("leg1", "leg2", "leg3", "leg4")

#: Components of the 3-UPS-UPU-S, in the order that users rely on, and their units.
JOINTS = {
    **{f"{leg}.q{i}": "m" if i == 3 else "rad" for leg in LEGS for i in range(1, 6 if leg == "leg1" else 7)},
    **{f"s.q{i}": "rad" for i in (1, 2, 3)},
}
BODIES = [
    f"{body}.{x}" for body in (*(f"{g}.{h}" for g in LEGS for h in ("lower", "upper")), "platform") for x in "xyz"
]
TREES = {"minimal": [n for n in JOINTS if n.startswith("leg1") or (n[-2:] in ("q1", "q2", "q3") and n[0] == "l")]}
TREES |= {"full": [*JOINTS], "": TREES["minimal"]}
FORCE = {"rad": "N m", "m": "N"}
REACTIONS = {
    **{f"{leg}.base.{part}": "N m" if part == "m" else "N" for leg in LEGS for part in ("fx", "fy", "fz", "m")},
    **{f"{g}.slide.{p}": "N m" if p[0] == "m" else "N" for g in LEGS for p in ("fx", "fy", "mx", "my", "mz")},
    **{f"leg1.wrist.{part}": "N m" if part == "m" else "N" for part in ("fx", "fy", "fz", "m")},
    **{
        f"{joint}.{part}": "N"
        for joint in ("leg2.wrist", "leg3.wrist", "leg4.wrist", "s")
        for part in ("fx", "fy", "fz")
    },
}


def components(quantity: str, cut: str) -> dict[str, str]:
    """Name -> unit of the components of a quantity."""
    known = TABLE[quantity]
    if known.of == "joint":
        return {name: f"{unit}{RATE[known.needs]}" for name, unit in JOINTS.items()}
    if known.of == "body":
        return dict.fromkeys(BODIES, BODY_UNITS[known.body])
    if quantity.startswith("tree_force"):
        return {name: FORCE[JOINTS[name]] for name in TREES[cut]}
    return {
        "generalized_force": {"a": "N m", "b": "N m"},
        "actuator_force": dict.fromkeys(LEGS, "N"),
        "reaction": REACTIONS,
    }[quantity]


@dataclass(frozen=True)
class Loaded:
    """An engine with the model of the 3-UPS-UPU-S, loaded once for all tests, and quantities that it has."""

    engine: Engine
    files: ModelFiles
    model: EngineModel
    quantities: tuple[str, ...]

    def ask(self, problem: Problem, **more: object) -> Solution:
        return self.model.solve(problem, **more)


@pytest.fixture(scope="module", params=[*ENGINES, *FURTHER])
def loaded(request) -> Iterator[Loaded]:
    name = request.param
    if name in LIBRARIES:
        pytest.importorskip(LIBRARIES[name], reason=f"{LIBRARIES[name]} is not installed")
    with further_engines({name: FURTHER[name]} if name in FURTHER else {}):
        engine = get_engine(name)
        files = model_files("3ups-upu-s", name)
        yield Loaded(engine, files, engine.load(files), tuple(q for q in GIVEN if q not in engine.lacks))


@pytest.fixture(scope="module")
def scene():
    return screwgauge.load_scene("3ups-upu-s-fast").at([0.1, 0.35])


@pytest.fixture(scope="module")
def given(loaded, scene) -> Problem:
    """All quantities that the engine has, of a fast motion under a load."""
    return scene.problem(loaded.quantities)


@pytest.fixture(scope="module")
def answered(loaded, given) -> Solution:
    return loaded.ask(given)


@pytest.fixture(scope="module")
def fall(loaded, scene) -> Problem:
    """A short fall of the loaded platform, held by constant forces that are not enough."""
    if InitialValue not in loaded.engine.tasks:
        pytest.skip(f"{loaded.engine.name} does not integrate")
    applied = replace(scene.applied, motors=hold({"leg2.q3": -500.0, "leg4.q3": 500.0}))
    start, rates, t = np.array([0.1, 0.05]), np.array([0.3, -0.2]), np.array([0.0, 0.01, 0.03])
    return Problem(applied, InitialValue(start, rates, 0.0, t, Integration(rtol=1e-6, atol=1e-8)), MOTION)


@pytest.fixture(scope="module")
def fallen(loaded, fall) -> Solution:
    return loaded.ask(fall)


@pytest.fixture(scope="module")
def pushed(loaded, scene, given) -> Problem:
    """Accelerations at the states of the given motion, under its gravity and any forces."""
    if States not in loaded.engine.tasks:
        pytest.skip(f"{loaded.engine.name} takes no states")
    names = tuple(JOINTS) if not loaded.engine.cut else tuple(TREES[loaded.engine.cut])
    motion = loaded.ask(scene.problem(MOTION)).values
    q, v = (motion[name].pick(names).array for name in ("joint_position", "joint_velocity"))
    task = States(names, q, v, tau=100.0 * np.cos(1.0 + np.arange(q.size).reshape(q.shape)))
    return Problem(replace(scene.applied, loads=()), task, frozenset(("joint_acceleration",)))


def test_entry_says_what_the_engine_is(loaded):
    engine = loaded.engine
    assert engine.installed
    assert engine.meaning
    assert engine.reads in (".toml", ".urdf", ".xml")
    assert engine.tasks <= {GivenMotion, InitialValue, States}
    for task in (GivenMotion, InitialValue, States):
        if task in engine.tasks:
            assert check_engines([engine.name], task=task) == (engine.name,)
        else:
            with pytest.raises(ScrewgaugeError, match=rf"engine '{engine.name}' does not .*; choose from screw"):
                check_engines([engine.name], task=task)


def test_components_units_and_shapes_are_those_of_the_contract(loaded, answered):
    solution = answered
    assert {*solution.values} == {*loaded.quantities}
    assert solution.version
    assert solution.condition.shape == (2,)
    for name, values in solution.values.items():
        expected = components(name, loaded.engine.cut)
        assert dict(zip(values.components, values.units, strict=True)) == expected, name
        assert values.components == tuple(expected), name
        assert values.array.shape == (2, len(expected)), name
        assert np.isfinite(values.array).all(), name


@pytest.mark.slow
def test_a_simulation_has_joint_motions_work_and_cost(fall, fallen):
    solution = fallen
    assert {*solution.values} == MOTION
    for name, values in solution.values.items():
        assert dict(zip(values.components, values.units, strict=True)) == components(name, "")
        assert values.array.shape == (3, 26)
        assert np.isfinite(values.array).all()
    assert solution.work.shape == solution.condition.shape == (3,)
    assert (solution.stopped, solution.rows, solution.n_solved) == ("", None, 3)
    assert "DOP853, rtol 1e-06, atol 1e-08" in solution.setting
    assert solution.cost.steps > 0
    assert solution.cost.evaluations > solution.cost.steps
    assert solution.cost.wall_s > 0.0
    start = dict(
        zip(solution.values["joint_position"].components, solution.values["joint_position"].array[0], strict=True)
    )
    assert [start["s.q1"], start["s.q2"]] == pytest.approx(fall.task.start, abs=1e-12)


def test_states_are_taken_in_the_order_of_their_names(loaded, pushed):
    solution, task = loaded.ask(pushed), pushed.task
    values = solution.values["joint_acceleration"]
    assert {*solution.values} == {"joint_acceleration"}
    assert values.components == task.coordinates
    assert values.units == tuple(f"{JOINTS[name]}/s^2" for name in task.coordinates)
    assert values.array.shape == task.q.shape
    assert solution.cost.wall_s > 0.0
    if not loaded.engine.cut:
        return
    turned = States(task.coordinates[::-1], *(x[:, ::-1] for x in (task.q, task.v)), tau=task.tau[:, ::-1])
    other = loaded.ask(replace(pushed, task=turned)).values["joint_acceleration"]
    assert other.components == task.coordinates[::-1]
    assert np.array_equal(other.array[:, ::-1], values.array)


def test_states_with_accelerations_give_forces_of_the_tree(loaded, scene, pushed):
    if not loaded.engine.cut:
        with pytest.raises(ModelFileError, match="with the forces along them"):
            loaded.ask(replace(pushed, task=replace(pushed.task, tau=None, a=pushed.task.q)))
        return
    wanted = frozenset(("tree_force", "actuator_force"))
    motion = loaded.ask(scene.problem([*MOTION, *wanted])).values
    a = motion["joint_acceleration"].pick(pushed.task.coordinates).array
    answer = loaded.ask(replace(pushed, applied=scene.applied, task=replace(pushed.task, tau=None, a=a), wanted=wanted))
    assert {*answer.values} == wanted
    for name in wanted:
        found, expected = answer.values[name], motion[name]
        assert (found.components, found.units) == (expected.components, expected.units)
        assert np.abs(found.array - expected.array).max() < LINEAR * np.abs(expected.array).max()


@pytest.mark.slow
@pytest.mark.parametrize("quantity", ["joint_position", "body_angular_velocity", "com_acceleration", "actuator_force"])
def test_nothing_but_what_is_wanted_is_computed(loaded, scene, answered, quantity):
    alone = loaded.ask(scene.problem([quantity]))
    assert {*alone.values} == {quantity}
    assert {*alone.errors} <= {quantity}
    if loaded.engine.name == "truth":  # encloses what is asked for, no tighter than that needs
        return
    assert {timing.stage for timing in alone.timings} < {timing.stage for timing in answered.timings}
    assert np.array_equal(alone.values[quantity].array, answered.values[quantity].array)


def test_the_input_stays_as_it_is_and_may_be_read_only(loaded, given, answered):
    motion = given.task
    mine = [x.copy() for x in (motion.t, motion.y, motion.yd, motion.ydd, given.applied.gravity)]
    for array in mine:
        array.setflags(write=False)
    applied = replace(given.applied, gravity=mine[4])
    loads = [load.numbers() for load in applied.loads]
    check_same(answered, loaded.ask(replace(given, applied=applied, task=GivenMotion(*mine[:4]))))
    for array, before in zip(mine, (motion.t, motion.y, motion.yd, motion.ydd, given.applied.gravity), strict=True):
        assert np.array_equal(array, before)
    assert [load.numbers() for load in applied.loads] == loads


def test_what_is_answered_cannot_be_changed(answered):
    for values in answered.values.values():
        with pytest.raises(ValueError, match="read-only"):
            values.array[0, 0] = 1.0


@pytest.mark.slow
def test_a_loaded_model_may_be_asked_anything_in_any_order(loaded, given, request):
    """Twice the same, with other tasks and other gravity between: not one bit differs."""
    problems = [given, replace(given, applied=replace(given.applied, gravity=np.array([1.0, 2.0, 3.0])))]
    for task, fixture in ((InitialValue, "fall"), (States, "pushed")):
        if task in loaded.engine.tasks:
            problems.append(request.getfixturevalue(fixture))
    first = [loaded.ask(problem) for problem in problems]
    for problem, solution in reversed([*zip(problems, first, strict=True)]):
        check_same(solution, loaded.ask(problem))
    fresh = loaded.engine.load(loaded.files)
    check_same(first[0], fresh.solve(problems[0]))


@pytest.mark.slow
def test_gravity_may_be_left_to_the_model_file(loaded, scene):
    problem = scene.under(gravity=np.array(GRAVITY)).problem(["generalized_force"])
    left = replace(problem, applied=replace(problem.applied, gravity=None))
    said, kept = (loaded.ask(one).values["generalized_force"].array for one in (problem, left))
    assert np.array_equal(said, kept)


@pytest.mark.slow
def test_forces_are_linear_in_the_accelerations(loaded, scene):
    def force(factor: float) -> np.ndarray:
        motion = replace(scene.motion, ydd=factor * scene.motion.ydd)
        return loaded.ask(replace(scene, task=motion).problem(["generalized_force"])).values["generalized_force"].array

    still, once, twice = (force(factor) for factor in (0.0, 1.0, 2.0))
    assert np.abs(once - still).max() > 1.0
    assert np.abs((twice - still) - 2.0 * (once - still)).max() < LINEAR * np.abs(twice).max()


def test_progress_goes_from_nothing_to_all(loaded, given):
    shares: list[float] = []
    loaded.ask(replace(given, task=given.task.part(slice(0, 1))), progress=shares.append)
    assert shares == sorted(shares)
    assert all(0.0 <= share <= 1.0 for share in shares)


def test_what_progress_raises_ends_the_work(loaded, scene):
    def stop(share: float) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        loaded.ask(scene.at([0.217]).problem(["joint_position"]), progress=stop)  # no truth of this time is kept


def test_another_number_of_independent_coordinates_is_refused(loaded, given):
    wide = GivenMotion(given.task.t, *(np.zeros((2, 3)) for _ in range(3)))
    with pytest.raises(ScrewgaugeError, match="has 2 independent coordinates, the motion 3"):
        loaded.ask(replace(given, task=wide))


def test_a_start_of_another_number_of_coordinates_is_refused(loaded, fall):
    wide = replace(fall.task, start=np.zeros(3), rates=np.zeros(3))
    with pytest.raises(ScrewgaugeError, match="2 independent coordinates"):
        loaded.ask(replace(fall, task=wide))


def test_a_load_on_an_unknown_body_is_refused(loaded, given):
    load = Load("platfrom", None, np.array([0.0, 0.0, 1.0]), np.zeros(3))
    with pytest.raises(ModelFileError, match="has no body 'platfrom'; keep the names of the"):
        loaded.ask(replace(given, applied=replace(given.applied, loads=(load,))))


def test_states_of_other_coordinates_are_refused(loaded, pushed):
    task = pushed.task
    other = States(("x", *task.coordinates[1:]), task.q, task.v, tau=task.tau)
    with pytest.raises(ModelFileError, match="takes states of"):
        loaded.ask(replace(pushed, task=other))


def test_a_model_without_its_loops_file_is_refused(loaded, tmp_path):
    if not loaded.engine.cut:
        return  # it reads a description, which says all
    with pytest.raises(ModelFileError, match=r"has no loops file; put NAME.loops.toml beside it"):
        loaded.engine.load(ModelFiles(loaded.files.model))
    with pytest.raises(ModelFileError, match=r"gone.loops.toml: cannot be read"):
        loaded.engine.load(ModelFiles(loaded.files.model, tmp_path / "gone.loops.toml"))


def test_a_task_that_it_does_not_take_is_refused(loaded, given):
    kinds = {
        InitialValue: InitialValue(np.zeros(2), np.zeros(2), 0.0, np.array([0.0, 0.1])),
        States: States(tuple(TREES["minimal"]), np.zeros((1, 14)), np.zeros((1, 14)), a=np.zeros((1, 14))),
    }
    for kind in kinds.keys() - loaded.engine.tasks:
        if loaded.engine.cut == "full":  # its model could, but it says nothing of joints at rest in its loops
            continue
        with pytest.raises(ScrewgaugeError, match="given motions only"):
            loaded.ask(replace(given, task=kinds[kind]))


def test_settings_that_it_does_not_have_are_refused(loaded):
    with pytest.raises(UnknownNameError, match=f"^engine {loaded.engine.name}: unknown setting 'nonsense'; "):
        loaded.engine.load(loaded.files, nonsense=1)
