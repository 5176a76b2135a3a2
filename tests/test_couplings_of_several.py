import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np
import pytest

import screwgauge
from screwgauge import Results, Scene, ScrewgaugeError
from support.coupled import moving, started
from support.engines import IN_DOUBLES
from support.geometry import Array
from support.judging import agreed, faults
from support.mechanism import load_mechanism
from support.models import check_models, write_models
from support.tolerances import LINEAR

pytestmark = pytest.mark.slow

G = 9.81
#: Thigh and shank, or the two bones of a finger: length of the first; masses, centres of mass below the joint, moments
#: about these; moment of a motor's rotor, or mass of the slide that pulls a cable.
L, M1, M2, C1, C2, I1, I2, PULLED = 0.4, 3.0, 2.0, 0.21, 0.17, 0.05, 0.03, 0.7


def bone(name: str, mass: float, com: float, moment: float) -> str:
    tensor = f"{{ xx = {moment}, yy = {moment}, zz = {moment / 2} }}"
    return f"[bodies.{name}]\nmass = {mass}\ncom = [0, 0, {-com}]\ninertia = {tensor}\n"


def hinge(name: str, parent: str, child: str, home: float, more: str = "") -> str:
    sides = f'kind = "R"\nparent = "{parent}"\nchild = "{child}"\naxes = [[0, 1, 0]]\nhome = [{home!r}]\n'
    return f"[joints.{name}]\n{sides}{more}"


DRIVEN, AT_THE_END = "actuated = true\n", f"parent_frame.position = [0, 0, {-L}]\n"
BONES = bone("upper", M1, C1, I1) + bone("lower", M2, C2, I2)
ROTOR = f"[bodies.{{0}}]\nmass = 0.2\ninertia = {{{{ xx = {PULLED}, yy = {PULLED}, zz = {PULLED} }}}}\n"


def of_bones(y: Array, yd: Array, ydd: Array) -> Array:
    """Moments on two bones. Shape (2, n)."""
    d, pull = y[0] - y[1], M2 * L * C2
    first = (I1 + M1 * C1**2 + M2 * L**2) * ydd[0] + pull * (np.cos(d) * ydd[1] + np.sin(d) * yd[1] ** 2)
    second = (I2 + M2 * C2**2) * ydd[1] + pull * (np.cos(d) * ydd[0] - np.sin(d) * yd[0] ** 2)
    weight = np.stack([(M1 * C1 + M2 * L) * np.sin(y[0]), M2 * C2 * np.sin(y[1])])
    return np.stack([first, second]) + G * weight


def of_belt(y: Array, yd: Array, ydd: Array) -> dict[str, Array]:
    hip, shank = of_bones(y + np.array([[0.0], [0.1]]), yd, ydd)
    return {"hip": hip, "motor": shank + PULLED * ydd[1], "belt.coupling": shank}


BELT = (
    f'name = "knee"\nindependent = {{ hip = "hip", motor = "motor" }}\n{BONES}{ROTOR.format("rotor")}'
    + hinge("hip", "ground", "upper", 0.3, DRIVEN)
    + hinge("motor", "ground", "rotor", 0.8, DRIVEN)
    + hinge("knee", "upper", "lower", 0.6, AT_THE_END)
    + '[couplings.belt]\ncoordinate = "knee"\nterms = { motor = [0.06, 1], hip = [0.04, -1] }\n'
)


def of_wrist(y: Array, yd: Array, ydd: Array) -> dict[str, Array]:
    (a, b), (va, vb), (aa, ab) = (np.stack([x[0] + x[1], x[0] - x[1]]) / 2 for x in (y, yd, ydd))
    top, side, high = 0.04, 0.05 + 2.0 * 0.3**2, 2.0 * 0.3 * G  # zz, yy about the wrist, weight times height
    moment = side * np.cos(b) ** 2 + top * np.sin(b) ** 2
    change = 2.0 * (top - side) * np.sin(b) * np.cos(b)
    pitch = moment * aa + change * va * vb - high * np.sin(a) * np.cos(b)
    roll = (0.06 + 2.0 * 0.3**2) * ab - change * va**2 / 2 - high * np.cos(a) * np.sin(b)
    rotors = PULLED * ydd
    return {
        "left": (pitch + roll) / 2 + rotors[0],
        "right": (pitch - roll) / 2 + rotors[1],
        "pitch.coupling": pitch,
        "roll.coupling": roll,
    }


WRIST = (
    'name = "wrist"\nindependent = { left = "left", right = "right" }\n'
    "[bodies.hand]\nmass = 2\ncom = [0, 0, 0.3]\ninertia = { xx = 0.06, yy = 0.05, zz = 0.04 }\n"
    + ROTOR.format("one")
    + ROTOR.format("two")
    + hinge("left", "ground", "one", 0.5, DRIVEN)
    + hinge("right", "ground", "two", -0.1, DRIVEN)
    + '[joints.wrist]\nkind = "U"\nparent = "ground"\nchild = "hand"\naxes = [[0, 1, 0], [1, 0, 0]]\n'
    "home = [0.2, 0.3]\n"
    '[couplings.pitch]\ncoordinate = "wrist.q1"\nterms = { left = [0, 0.5], right = [0, 0.5] }\n'
    '[couplings.roll]\ncoordinate = "wrist.q2"\nterms = { left = [0, 0.5], right = [0, -0.5] }\n'
)


def of_cable(y: Array, yd: Array, ydd: Array, curve: float) -> dict[str, Array]:
    sums = np.array([[1.0, 0.0], [1.0, 1.0]])
    moments = sums.T @ of_bones(*(sums @ x for x in (y, yd, ydd)))
    arm = 0.06 + 2.0 * curve * y[1]
    slide = PULLED * (0.09 * ydd[0] + arm * ydd[1] + 2.0 * curve * yd[1] ** 2)
    pull = -moments[1] / arm
    return {"q1": moments[0] + 0.09 * pull, "cable": slide - pull, "tendon.coupling": pull}


def finger(curve: float) -> str:
    home = 0.02 + 0.09 * 0.3 + 0.06 * 0.4 + curve * 0.16
    terms = f"{{ q1 = [0.02, 0.09], q2 = [0, 0.06{f', {curve}' if curve else ''}] }}"
    return (
        f'name = "finger"\nindependent = {{ q1 = "q1", q2 = "q2" }}\n{BONES}'
        f"[bodies.slide]\nmass = {PULLED}\ninertia = {{}}\n"
        + hinge("q1", "ground", "upper", 0.3, DRIVEN)
        + hinge("q2", "upper", "lower", 0.4, AT_THE_END)
        + '[joints.cable]\nkind = "P"\nparent = "ground"\nchild = "slide"\naxes = [[1, 0, 0]]\nactuated = true\n'
        f'home = [{home!r}]\n[couplings.tendon]\ncoordinate = "cable"\nterms = {terms}\n'
    )


@dataclass(frozen=True)
class Case:
    text: str
    home: Mapping[str, float]
    body: str
    forces: Callable[[Array, Array, Array], dict[str, Array]]
    engines: tuple[str, ...] = (*IN_DOUBLES, "lagrange", "truth")


CASES = {
    "belt": Case(BELT, {"hip": 0.3, "motor": 0.8}, "lower", of_belt),
    "differential": Case(WRIST, {"left": 0.5, "right": -0.1}, "hand", of_wrist),
    "cable": Case(finger(0.0), {"q1": 0.3, "q2": 0.4}, "lower", lambda *y: of_cable(*y, curve=0.0)),
    "cable of growing arm": Case(
        finger(0.01),
        {"q1": 0.3, "q2": 0.4},
        "lower",
        lambda *y: of_cable(*y, curve=0.01),
        ("screw", "pinocchio", "truth"),
    ),
}


def unloaded(write, case: Case) -> Scene:
    scene = moving(write, case.text, case.home, case.body)
    return replace(scene, applied=replace(scene.applied, loads=()))


def component(results: Results, name: str, engine: str) -> Array:
    quantity = "reaction" if name.endswith(".coupling") else "actuator_force"
    return np.asarray(results.values(quantity, engine=engine)[:, results.components(quantity).index(name)])


@pytest.mark.parametrize("name", CASES)
def test_forces_are_those_of_closed_forms_in_every_engine(name, write):
    case, scene = CASES[name], unloaded(write, CASES[name])
    if "truth" in case.engines:
        pytest.importorskip("flint")
    results = agreed(screwgauge.run(scene, engines=case.engines))
    motion = scene.motion
    for what, values in case.forces(motion.y.T, motion.yd.T, motion.ydd.T).items():
        for engine in case.engines:
            assert np.abs(component(results, what, engine) - values).max() < LINEAR * np.abs(values).max(), engine


@pytest.mark.parametrize("name", CASES)
def test_simulations_agree_and_keep_the_energy(name, write):
    engines = tuple(engine for engine in ("screw", "pinocchio", "mujoco") if engine in CASES[name].engines)
    results = agreed(screwgauge.run(started(write, CASES[name].text, CASES[name].home), engines=engines))
    assert {*results.solutions} == {*engines}
    assert results.pairs["max_scaled"].max() < 1e-9


def test_a_coupling_of_several_by_powers_is_refused_by_name_where_mujoco_has_none(write):
    results = screwgauge.run(unloaded(write, CASES["cable of growing arm"]), engines=["screw", "mujoco"])
    assert "lacks coupling 'tendon': MuJoCo" in results.failures["mujoco"].reason


def test_a_file_of_ones_own_with_such_a_coupling_is_taken(write, tmp_path):
    scene = unloaded(write, CASES["belt"])
    write_models(scene.mechanism, tmp_path)
    own = (tmp_path / "knee.xml").read_text(encoding="utf-8")
    (tendon,) = re.findall(r"<fixed .*?</fixed>", own, re.DOTALL)
    coefficients = {"motor": -2, "hip": 2, "knee": 2}
    joints = (f'<joint joint="{joint}" coef="{coefficient}"/>' for joint, coefficient in coefficients.items())
    written = f'<fixed name="belt">{"".join(joints)}</fixed>'
    text = own.replace(tendon, written).replace('polycoef="0.1 ', 'polycoef="0.2 ')
    write("own.xml", text)
    plain = 'mechanism = "coupled.toml"\nmotion.hip.polynomial = [0.3, 1]\nmotion.motor.polynomial = [0.8, 2, 1]\n'
    given = write("own-scene.toml", f'{plain}time.times = [0, 0.1]\nmodels.mujoco = "own.xml"\n')
    results = screwgauge.run(screwgauge.load_scene(given), engines=["screw", "mujoco"])
    assert results.exit_status == 0
    assert not results.solutions["mujoco"].warnings


@pytest.mark.parametrize("name", ["belt", "differential", "cable"])
def test_linear_ones_survive_their_files(name, write, tmp_path):
    mechanism = load_mechanism(write("m.toml", CASES[name].text))
    write_models(mechanism, tmp_path)
    assert all(row.ok for row in check_models(mechanism, tmp_path))


def test_what_follows_and_what_leads_are_one_equation(write):
    belt = 'coordinate = "knee"\nterms = { motor = [0.06, 1], hip = [0.04, -1] }'
    instead = 'coordinate = "motor"\nterms = { knee = [-0.1, 1], hip = [0, 1] }'
    assert belt in BELT
    answers = [
        screwgauge.run(unloaded(write, replace(CASES["belt"], text=text)), engines=IN_DOUBLES)
        for text in (BELT, BELT.replace(belt, instead))
    ]
    for engine in IN_DOUBLES:
        first, second = (agreed(each).values("actuator_force", engine=engine) for each in answers)
        assert np.abs(first - second).max() < LINEAR * np.abs(first).max()


def test_the_judge_sees_a_wrong_pull_of_each_of_several(write):
    scene = unloaded(write, CASES["belt"])
    solution = screwgauge.run(scene, engines=["screw"]).solutions["screw"]
    assert faults(scene, solution, "reaction", "belt.coupling") == {"newton_euler"}
    for name in ("hip", "motor", "knee"):
        assert "loop_closure" in faults(scene, solution, "joint_position", name)
        assert "loop_rate" in faults(scene, solution, "joint_velocity", name)
        assert "loop_acceleration" in faults(scene, solution, "joint_acceleration", name)


GIVEN_TERMS = "terms = { motor = [0.06, 1], hip = [0.04, -1] }"


@pytest.mark.parametrize(
    ("instead", "said"),
    [
        ('terms = { motor = [0, 1] }\nof = "hip"', "has both 'terms' and 'of'"),
        ("terms = { motor = [0, 1] }\npolynomial = [0]", "has both 'terms' and 'polynomial'"),
        ("terms = {}", "'terms' has no entries"),
        ("terms = { motor = [0, 1], hop = [0, 1] }", "'hop'; did you mean 'hip'"),
        ("terms = { motor = [0, 1], hip = [1] }", "'knee' does not depend on 'hip'"),
        ("terms = { motor = [0, 1], knee = [0, 1] }", "couples 'knee' to itself"),
        ("terms = { motor = 1, hip = [0, 1] }", "1 is not a list of coefficients"),
        ("terms = { motor.q1 = [0, 1] }", "'motor' is followed by a dot"),
        ('terms = { "" = [0, 1] }', "is not text"),
        (f'{GIVEN_TERMS}\n[couplings.back]\ncoordinate = "hip"\nterms = {{ motor = [0, 1], knee = [0, 1] }}', "itself"),
    ],
)
def test_terms_that_cannot_be(instead, said, write):
    assert GIVEN_TERMS in BELT
    with pytest.raises(ScrewgaugeError, match=re.escape(said)) as error:
        load_mechanism(write("belt.toml", BELT.replace(GIVEN_TERMS, instead)))
    assert "couplings." in error.value.where
