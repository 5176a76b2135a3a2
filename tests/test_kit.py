from dataclasses import replace

import numpy as np
import pytest

import screwgauge
from screwgauge import plugins as kit
from screwgauge.families.draw import families
from screwgauge.reference.graph import spanning_tree
from screwgauge.witness.joints import mechanism_tree
from screwgauge.witness.kinematics import move
from screwgauge.witness.tree import TreeStates
from support.data import data
from support.engines import further_engines, get_engine
from support.frozen_engine import Bodies, FrozenModel
from support.judging import agreed
from support.solve import ScrewModel, layout
from support.tolerances import AGREE, LINEAR, ROUNDING

#: Joints of all kinds, couplings, rotors, redundant constraints.
BUILT_IN = ("3ups-upu-s", "bennett", "geared-five-bar", "planetary-gear", "rccc", "ruse", "screw-press", "stewart")
SPRINGS = data("springs-scene.toml")


def solved(scene, *quantities):
    """Answer of the solver."""
    return ScrewModel(layout(scene.mechanism)).solve(scene.problem(quantities)).values


def body_motions(scene):
    values = solved(scene, "joint_position", "joint_velocity", "joint_acceleration")
    q, v, a = (values[name].array for name in ("joint_position", "joint_velocity", "joint_acceleration"))
    tree = mechanism_tree(scene.mechanism, spanning_tree(scene.mechanism))
    at = move(tree, TreeStates(q, v, a)).bodies
    ground = np.zeros((len(q), 1, 6))
    V, A = (np.concatenate([ground, np.concatenate(pair, axis=2)], axis=1) for pair in ((at.w, at.v), (at.b, at.a)))
    return (q, v, a), V, A


def whole_turns_apart(a, b, units):
    """Difference, angles less whole turns."""
    turns = np.array(units) == "rad"
    return np.where(turns, (a - b + np.pi) % (2.0 * np.pi) - np.pi, a - b)


@pytest.fixture(scope="module", params=[*families(), *BUILT_IN])
def scene(request):
    if request.param in BUILT_IN:
        whole = screwgauge.load_scene(request.param)
        return whole.at(np.linspace(whole.t[0], whole.t[-1], 4).tolist())
    return screwgauge.random(7, request.param)


@pytest.mark.slow
def test_joint_coordinates_and_their_derivatives_are_read_from_bodies(scene):
    mechanism, ((q, v, a), V, A) = scene.mechanism, body_motions(scene)
    R, p = kit.body_poses(mechanism, q)
    near = np.full_like(q, np.nan)
    near[:, mechanism.independent_columns] = scene.motion.y
    read = kit.follow_joints(mechanism, R, p, near)
    assert np.abs(whole_turns_apart(read.q, q, mechanism.units)).max() < LINEAR
    rates = np.einsum("nqbs,nbs->nq", read.matrix, V)
    for found, right in ((read.rates(V), v), (rates, v), (read.accelerations(V, A), a)):
        assert np.abs(found - right).max() < LINEAR * max(np.abs(right).max(), 1.0)


@pytest.mark.parametrize("name", ["frozen", "exudyn", "drake"])
@pytest.mark.parametrize("rule", ["min_norm", "spherical_axial"])
def test_both_rules_with_loads_springs_and_motors(write, rule, name):
    scene = screwgauge.load_scene(write("sprung.toml", SPRINGS.format(rule=rule)))
    with further_engines({"frozen": "support.frozen_engine:FROZEN"}):
        if not get_engine(name).installed:
            pytest.skip(f"{name} is not installed")
        results = screwgauge.run(scene, engines=["screw", name])
    agreed(results)
    assert {"actuator_force", "reaction"} <= {*results.pairs["quantity"]}
    assert results.pairs["max_scaled"].max() < AGREE


def test_loads_may_change_from_sample_to_sample(write):
    scene = screwgauge.load_scene(write("sprung.toml", SPRINGS.format(rule="min_norm")))
    problem = scene.problem(["generalized_force"])
    model = FrozenModel(scene.mechanism, "")
    (load,) = problem.applied.loads
    factors = np.array([1.0, 0.0, -2.0])

    def forces(load):
        return (
            model.solve(replace(problem, applied=replace(problem.applied, loads=(load,))))
            .values["generalized_force"]
            .array
        )

    changing = forces(replace(load, force=factors[:, None] * load.force, torque=factors[:, None] * load.torque))
    for i, factor in enumerate(factors):
        held = forces(replace(load, force=factor * load.force, torque=factor * load.torque))
        assert np.array_equal(changing[i], held[i])


def test_what_acts_has_the_virtual_work_of_the_solver(write):
    """Without inertia and weight, forces along y are minus the generalized force."""
    scene = screwgauge.load_scene(write("sprung.toml", SPRINGS.format(rule="min_norm")))
    (q, *_), V, _ = body_motions(scene)
    acts, none = (
        solved(some, "generalized_force")["generalized_force"].array
        for some in (scene, scene.under(loads=(), springs=(), motors=()))
    )
    R, p = kit.body_poses(scene.mechanism, q)
    joints = kit.JointReading(scene.mechanism, R, p, q)
    wrenches, along = kit.acting(scene.applied, scene.motion.t, joints, V)
    for k in range(2):
        motion = replace(scene.motion, yd=np.tile(np.eye(2)[k], (3, 1)), drive=None)
        (_, qd, _), moved, _ = body_motions(replace(scene, task=motion))
        work = np.einsum("nbs,nbs->n", wrenches[..., [3, 4, 5, 0, 1, 2]], moved) + np.einsum("nq,nq->n", along, qd)
        assert np.abs(work - (none - acts)[:, k]).max() < LINEAR * np.abs(acts).max()


def test_wrenches_summed_inwards_are_the_reactions_of_an_arm():
    scene = screwgauge.load_scene("arm7").at([0.1, 0.4])
    mechanism, ((q, _, _), V, A) = scene.mechanism, body_motions(scene)
    R, p = kit.body_poses(mechanism, q)
    needed = kit.required_wrenches(kit.matter_of(mechanism), R, V, A, scene.applied.g)
    joints = kit.JointReading(mechanism, R, p, q)
    needed -= kit.acting(scene.applied, scene.motion.t, joints, V)[0]
    index = mechanism.body_index
    carriers = {index[joint.child]: index[joint.parent] for joint in mechanism.joints}
    through = kit.summed_inwards([carriers[i] for i in range(1, len(index))], p, needed)
    wrenches = np.stack([through[:, index[joint.child]] for joint in mechanism.joints], axis=1)
    for i, joint in enumerate(mechanism.joints):
        child = index[joint.child]
        arm = R[:, child] @ joint.child_frame.p
        wrenches[:, i, 3:] -= np.cross(arm, wrenches[:, i, :3])
    right = solved(scene, "reaction")["reaction"].array
    assert np.abs(kit.reactions(mechanism, R, p, wrenches) - right).max() < ROUNDING * np.abs(right).max()


def test_a_rule_that_a_mechanism_does_not_name_is_refused():
    scene = screwgauge.load_scene("slider-crank").at([0.1])
    problem = replace(scene.problem(["actuator_force"]), rule="spherical_axial")
    with pytest.raises(kit.ModelFileError, match=r"has no table \[spherical_axial\]"):
        FrozenModel(scene.mechanism, "").solve(problem)


NEAR = """
mechanism = "3ups-upu-s"
time.times = [0.0, 0.5, 1.0]
motion.a = {{ harmonics = [[2, 0, 0.05]] }}
motion.b = {{ offset = {}, harmonics = [[3, 0, {}]] }}
"""


@pytest.mark.parametrize("distance", [1e-3, 5e-5])
def test_next_to_a_singular_pose_no_engine_of_the_kit_is_faulted(write, distance):
    scene = screwgauge.load_scene(write("near.toml", NEAR.format(0.3568 - distance, 0.1 * distance)))
    with further_engines({"frozen": "support.frozen_engine:FROZEN"}):
        results = screwgauge.run(scene, engines=["screw", "pinocchio", "frozen"])
    assert not results.failures
    for table in (results.pairs, results.judge):
        beyond = table[~table["ok"].astype(bool)]
        assert (beyond["undecided"] > 0).all(), beyond.to_string()
    assert results.solutions["frozen"].errors["reaction"].largest > 1e-11


def test_where_nothing_is_singular_the_kit_admits_no_more_than_the_tolerance():
    scene = screwgauge.load_scene("slider-crank").at([0.1, 0.4])
    solution = FrozenModel(scene.mechanism, "").solve(scene.problem(["joint_position", "reaction"]))
    assert {*solution.errors} == {"joint_position", "reaction"}
    assert max(error.largest for error in solution.errors.values()) < AGREE


def _other(name, **changes):
    right = getattr(Bodies, name)

    def wrong(self, *arguments):
        found = right(self, *arguments)
        if isinstance(found, tuple):
            return tuple(change(x) for change, x in zip(changes.values(), found, strict=True))
        return replace(found, **{field: change(getattr(found, field)) for field, change in changes.items()})

    return {name: wrong}


def _same(x):
    return x


#: What an engine has wrong, and what the sentence names.
SLIPS = {
    "place: R": _other("place", R=lambda R: R[:, 1:]),
    "place: p": _other("place", p=lambda p: np.full_like(p, np.nan)),
    "place: gaps": _other("place", gaps=lambda gaps: gaps[:, :-1]),
    "place, T: its first three rows": _other("place", T=lambda T: T[:, :, [1, 0, 2, 3, 4, 5]]),
    "place, T: its last three rows": _other("place", T=lambda T: T * [[1], [1], [1], [1], [1], [-1]]),
    "place, G: it is not the derivative": _other("place", G=lambda G: -G),
    "bias: its first array": _other("bias", gaps=lambda gaps: gaps + 1.0, bodies=_same),
    "bias: its second array": _other("bias", gaps=_same, bodies=lambda bodies: bodies + 1.0),
    "bias must return two arrays": {"bias": lambda self, x, xd: xd},
    "dynamics: M must have shape": _other("dynamics", M=lambda M: M[0], f=_same),
    "dynamics, M: it is not symmetric": _other("dynamics", M=lambda M: M + np.triu(np.ones_like(M), 1), f=_same),
    "dynamics: f": _other("dynamics", M=_same, f=lambda f: f[0]),
    "units must have shape": {"units": property(lambda self: np.ones(3), lambda self, units: None)},
    "rows must .* got 0": {"rows": property(lambda self: [], lambda self, rows: None)},
}


@pytest.mark.parametrize("word", SLIPS)
def test_an_engine_that_contradicts_itself_is_told_where(word):
    scene = screwgauge.load_scene("rccc").at([0.2])
    wrong = type("Wrong", (Bodies,), SLIPS[word])(scene.mechanism)
    with pytest.raises(ValueError, match=f"^{word}"):
        kit.solve_constrained(("wrong", "1", ""), wrong, scene.problem(["generalized_force"]))


def test_an_answer_without_estimates_has_the_requested_values_and_no_errors():
    scene = screwgauge.load_scene("five-bar")
    values = solved(scene, "joint_position", "actuator_force")
    arrays = {name: x.array for name, x in values.items()}

    def part(motion, applied):
        some = {name: array[np.isin(scene.t, motion.t)] for name, array in arrays.items()}
        return kit.SolvedPart(some, kit.Trust.unknown(len(motion)), np.zeros(0, np.intp), {})

    problem = scene.problem(["actuator_force"])
    solution = kit.answer(("other", "1", ""), scene.mechanism, problem, part)
    assert {*solution.values} == {"actuator_force"}
    assert np.array_equal(solution.values["actuator_force"].array, arrays["actuator_force"])
    assert (solution.errors, solution.assembly) == ({}, None)
