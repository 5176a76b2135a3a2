import numpy as np
import pytest

import screwgauge
from screwgauge import ScrewgaugeError, load_scene
from support.errors import ClosureError, DescriptionError, UnknownNameError
from support.parameters import COSTS, along_a_path, complex_numbers, gaps_open
from support.tolerances import AGREE

#: Mechanism -> numbers of its geometry that leave it mobile.
PLACED = {
    "3ups-upu-s": ["leg*.base.parent.[xyz]", "leg*.wrist.child.[xyz]"],
    "stewart": ["leg*.base.parent.[xyz]", "leg*.ball.child.[xyz]"],
    "delta": ["*.elbow-*.parent.[xyz]", "*.wrist-*.child.[xyz]"],
    "five-bar": ["*.parent.[xy]"],
    "arm7": ["joint*.parent.*"],
    "rccc": ["*.parent.*"],
}
#: Largest difference of a variant to a program of its own, over the largest value.
OWN = 1e-14


def few(name, n=5):
    scene = load_scene(name)
    return scene.at(np.linspace(scene.t[0], scene.t[-1], n))


def scattered(variants, size, count, seed=0):
    rng = np.random.default_rng(seed)
    share = [
        size if name.startswith("joints.") else size * abs(x)
        for name, x in zip(variants.names, variants.nominal, strict=True)
    ]
    return {
        name: x + s * rng.normal(size=count) for name, x, s in zip(variants.names, variants.nominal, share, strict=True)
    }


def assert_own(scene, variants, given, rows=(0, 1), tolerance=OWN):
    motion = scene.motion
    found = variants(motion.y, motion.yd, motion.ydd, parameters=given)
    assert (found.why == "").all()
    for i in rows:
        own = scene.with_({name: float(values[i]) for name, values in given.items()})
        alone = screwgauge.compile(own, variants.quantities, backend="numpy")(motion.y, motion.yd, motion.ydd)
        for name in variants.quantities:
            assert np.abs(found[name][i] - alone[name]).max() < tolerance * np.abs(alone[name]).max()


# scenes with other numbers


@pytest.mark.parametrize(
    ("rule", "expected"), [(2.5, 2.5), ("1.01 x", 1.01), ("x + 0.25", 1.25), ("2*x - 0.5", 1.5), ("sqrt(4)", 2.0)]
)
def test_a_number_is_given_or_made_of_the_present_one(rule, expected):
    scene = load_scene("five-bar").with_({"left.crank.mass": 1.0})
    assert scene.with_({"left.crank.mass": rule}).mechanism.body("left.crank").mass == pytest.approx(expected, abs=0)


@pytest.mark.parametrize("name", ["joints.left.parent.x", "left.parent.x", "joints.left.parent_frame.position[0]"])
def test_names_are_paths_of_the_file_or_short(name):
    changed = load_scene("five-bar").with_({name: "x - 0.01"})
    moved = (
        changed.mechanism.joint("left").parent_frame.p - load_scene("five-bar").mechanism.joint("left").parent_frame.p
    )
    assert moved == pytest.approx([-0.01, 0.0, 0.0])


def test_patterns_name_many():
    before, after = load_scene("five-bar"), load_scene("five-bar").with_({"*.mass": "1.5 x", "gravity.z": "0.5 x"})
    assert after.mechanism.masses == pytest.approx(1.5 * before.mechanism.masses)
    assert after.applied.g == pytest.approx(0.5 * before.applied.g)


@pytest.mark.parametrize("name", ["left.crank.weight", "left.crnk.mass", "*.weight"])
def test_an_unknown_number_is_refused(name):
    with pytest.raises(UnknownNameError):
        load_scene("five-bar").with_({name: 1.0})


@pytest.mark.parametrize("rule", ["y + 1", "", None, "x x", [1.0], "1/0"])
def test_what_is_no_number_is_refused(rule):
    with pytest.raises(DescriptionError):
        load_scene("five-bar").with_({"left.crank.mass": rule})


def test_a_body_that_cannot_exist_is_refused():
    with pytest.raises(DescriptionError):
        load_scene("five-bar").with_({"left.crank.mass": -1.0})


def test_loops_that_cannot_close_are_refused():
    with pytest.raises(ClosureError):
        load_scene("five-bar").with_({"left.parent.x": "x + 5"})
    with pytest.raises(ClosureError):
        load_scene("five-bar").with_({"left.parent.tilt1": 0.1})


@pytest.mark.sampled(2)
@pytest.mark.parametrize("name", ["3ups-upu-s", "stewart", "delta", "five-bar"])
def test_home_stays_on_its_assembly(name):
    scene, rng = load_scene(name), np.random.default_rng(1)
    variants = screwgauge.compile(scene, ["joint_velocity"], parameters=PLACED[name], backend="numpy")
    nominal = dict(zip(variants.names, variants.nominal, strict=True))
    goal = {key: x + 0.01 * rng.normal() for key, x in nominal.items()}
    slowly = scene
    for share in np.linspace(0.01, 1.0, 100):
        slowly = slowly.with_({key: x + share * (goal[key] - x) for key, x in nominal.items()})
    assert scene.with_(goal).mechanism.home == pytest.approx(slowly.mechanism.home, abs=1e-9)


def test_engines_take_a_changed_scene():
    scene = few("five-bar").with_({"*.mass": "1.2 x", "right.parent.x": "x + 0.01"})
    results = screwgauge.run(scene, engines=("screw", "pinocchio", "mujoco", "truth"))
    assert results.exit_status == 0
    assert results.pairs["max_scaled"].max() < AGREE


# variants


@pytest.mark.parametrize("name", PLACED)
def test_variants_answer_as_programs_of_their_own(name):
    scene = few(name)
    variants = screwgauge.compile(scene, ["actuator_force"], parameters=PLACED[name], backend="numpy")
    if costs := variants.cannot_change:
        kept = [key for key in variants.names if key not in costs]
        variants = screwgauge.compile(scene, ["actuator_force"], parameters=kept, backend="numpy")
    assert_own(scene, variants, scattered(variants, 1e-3, 9))


def test_variants_have_reactions_motions_and_all_numbers():
    scene = few("3ups-upu-s")
    wanted = ["joint_position", "joint_acceleration", "com_acceleration", "actuator_force", "reaction"]
    every = ["*.mass", "*.com.*", "*.inertia.*", *PLACED["3ups-upu-s"]]
    variants = screwgauge.compile(scene, wanted, parameters=every, backend="numpy")
    assert_own(scene, variants, scattered(variants, 1e-3, 3))


@pytest.mark.parametrize("name", ["3ups-upu-s", "stewart", "five-bar"])
def test_matter_alone_is_a_product(name):
    scene = few(name)
    variants = screwgauge.compile(scene, ["actuator_force", "reaction"], parameters=["bodies.*"], backend="numpy")
    given = {key: x for key, x in scattered(variants, 1e-3, 4).items() if ".inertia." not in key}
    assert_own(scene, variants, given)


def test_loads_springs_rotors_and_gravity_are_numbers():
    scene = few("five-bar").under(
        loads=[{"on": "left.rod", "by": "environment", "force": [1, 2, 0]}],
        springs=[{"coordinate": "left", "stiffness": 3.0, "rest": 0.1, "damping": 0.2}],
    )
    changes = {"loads.1.force.y": 3.0, "springs.1.stiffness": 4.0, "gravity.y": -5.0, "left.damping": 0.3}
    variants = screwgauge.compile(scene, ["actuator_force"], parameters=[*changes], backend="numpy")
    assert_own(scene, variants, {name: np.array([x]) for name, x in changes.items()}, rows=[0])


@pytest.mark.parametrize(("name", "size"), [("3ups-upu-s", 1e-2), ("stewart", 1e-2), ("delta", 4e-3)])
def test_no_variant_is_in_another_assembly(name, size):
    """Reference: forty small changes."""
    scene = few(name, 3)
    variants = screwgauge.compile(scene, ["actuator_force"], parameters=PLACED[name], backend="numpy")
    given = scattered(variants, size, 64)
    found = variants(scene.motion.y, scene.motion.yd, scene.motion.ydd, parameters=given)
    good = found.why == ""
    assert good.mean() > 0.9
    path = along_a_path(variants, scene.motion, given, 40)
    away = np.abs(found["actuator_force"] - path).max(axis=(1, 2))
    assert (away[good] < 1e-12 * np.abs(path[good]).max(axis=(1, 2))).all()


def test_each_variant_without_values_has_its_reason():
    scene = few("five-bar")
    motion = scene.motion
    variants = screwgauge.compile(scene, ["actuator_force"], parameters=["*.parent.*", "*.mass"], backend="numpy")

    def reasons(**given):
        found = variants(motion.y, motion.yd, motion.ydd, parameters={k.replace("_", "."): v for k, v in given.items()})
        assert (np.isnan(found["actuator_force"]).all(axis=(1, 2)) == (found.why != "")).all()
        return found.why.tolist()

    assert reasons(left_parent_tilt1=np.array([0.0, 1e-3])) == ["", "rows open"]
    assert reasons(left_crank_mass=np.array([-1.0, 1.0])) == ["impossible body", ""]
    assert reasons(left_parent_x=np.array([9.0, 0.0]))[0] == "does not close"


def test_statistics_are_those_of_all_samples():
    scene = few("stewart", 9)
    motion = scene.motion
    variants = screwgauge.compile(scene, ["actuator_force"], parameters=["*.mass"], backend="numpy")
    given = scattered(variants, 0.1, 300)
    every = variants(motion.y, motion.yd, motion.ydd, parameters=given)["actuator_force"]
    some = variants.statistics(motion.y, motion.yd, motion.ydd, ["peak", "rms"], parameters=given)
    assert some["peak"]["actuator_force"] == pytest.approx(np.abs(every).max(axis=1))
    assert some["rms"]["actuator_force"] == pytest.approx(np.sqrt((every**2).mean(axis=1)))


@pytest.mark.parametrize("given", [{"*.mass": np.ones((2, 2))}, {"a.mass": 1.0}, {"*.mass": np.array([np.nan])}])
def test_values_that_cannot_be_are_refused(given):
    scene = few("five-bar")
    motion = scene.motion
    variants = screwgauge.compile(scene, ["actuator_force"], parameters=["*.mass"], backend="numpy")
    with pytest.raises(ScrewgaugeError):
        variants(motion.y, motion.yd, motion.ydd, parameters=given)


@pytest.mark.parametrize("names", ["*.mass", [], ["nothing.here"]])
def test_names_of_inputs_are_checked(names):
    with pytest.raises(ScrewgaugeError):
        screwgauge.compile(few("five-bar"), ["actuator_force"], parameters=names)


# mobility


@pytest.mark.parametrize(
    "name", ["five-bar", "sarrus", "bennett", "3ups-upu-s", "delta", "rccc", "stewart", "slider-crank", "3-rrr"]
)
def test_numbers_that_cost_mobility_are_known_before_any_variant(name):
    scene = few(name)
    variants = screwgauge.compile(scene, ["joint_velocity"], parameters=["joints.*.parent.*"], backend="numpy")
    worst = gaps_open(scene, variants.names)
    assert {*variants.cannot_change} == {key for key, x in worst.items() if x > 1e-5}
    assert all(x > 1e-2 for key, x in worst.items() if key in variants.cannot_change)
    assert min(variants.cannot_change.values(), default=1.0) > 1e6 * COSTS


def test_a_planar_machine_may_be_shifted_and_tilted_as_a_whole():
    scene = few("five-bar")
    variants = screwgauge.compile(scene, ["joint_velocity"], parameters=["joints.*.parent.*"], backend="numpy")
    together = variants.can_change_together
    assert len(together) == 6
    assert {"joints.left.parent.tilt1", "joints.right.parent.tilt1"} in [{*one} for one in together]


# derivatives


@pytest.mark.parametrize("name", ["3ups-upu-s", "stewart"])
def test_derivatives_are_those_of_the_whole_program(name):
    scene = few(name)
    motion = scene.motion
    names = ["*.mass", "*.com.z", *PLACED[name]]
    variants = screwgauge.compile(scene, ["actuator_force"], parameters=names, backend="numpy")
    J = variants.jacobian("actuator_force", motion.y, motion.yd, motion.ydd)
    for k in range(0, len(variants.names), 7):
        expected = complex_numbers(variants, motion, k)
        size = np.abs(expected).max()
        assert np.abs(J[..., k] - expected).max() < 1e-12 * max(size, 1e-3 * np.abs(J[..., k]).max(initial=1e-9))


def test_a_gradient_is_the_weighted_sum_of_derivatives():
    scene = few("five-bar")
    motion = scene.motion
    variants = screwgauge.compile(scene, ["actuator_force"], parameters=["*.mass", "left.parent.x"], backend="numpy")
    weights = np.random.default_rng(3).normal(size=(5, 2))
    found = variants.gradient({"actuator_force": weights}, motion.y, motion.yd, motion.ydd)
    J = variants.jacobian("actuator_force", motion.y, motion.yd, motion.ydd)
    assert found == pytest.approx(np.einsum("nm,nmp->np", weights, J), rel=1e-12, abs=1e-12)
