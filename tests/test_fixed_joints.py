import numpy as np
import pytest

import screwgauge
from screwgauge.reference.graph import layout
from screwgauge.reference.mobility import mobility
from screwgauge.reference.reciprocal import end_body
from screwgauge.reference.rigid import without_fixed_joints
from support.data import data
from support.engines import Solution, Values
from support.errors import DescriptionError
from support.mechanism import Mechanism, load_mechanism
from support.models import CUTS, check_models, description, lay_out, loops_of, read_loops, write_models
from support.scene import load_scene

G = np.array([0.0, 0.0, -9.81])
COMPONENTS = ("fx", "fy", "fz", "mx", "my", "mz")

ARM = data("held-arm.toml")
#: The load is turned by 0.7 rad about x of the arm, and held 10 mm beside its own origin.
HOLD = """[joints.hold]
kind = "fixed"
parent = "arm"
child = "load"
parent_frame = { position = [0.6, 0, 0], rotation = { axis = [1, 0, 0], angle = 0.7 } }
child_frame.position = [0, 0.01, 0]
"""
BACK = """[joints.hold]
kind = "fixed"
parent = "load"
child = "arm"
child_frame = { position = [0.6, 0, 0], rotation = { axis = [1, 0, 0], angle = 0.7 } }
parent_frame.position = [0, 0.01, 0]
"""
SCENE = 'mechanism = "arm.toml"\nmotion.q.harmonics = [[5, 0.3, 0.6]]\ntime = { duration = 1, step = 0.1 }\n'
ENGINES = ("screw", "pinocchio", "mujoco", "pinocchio-full", "mujoco-full", "lagrange")


def about(e: np.ndarray, angle: float) -> np.ndarray:
    """Rotation matrix, by Rodrigues' formula."""
    K = np.cross(np.eye(3), e)
    return np.eye(3) + np.sin(angle) * K + (1.0 - np.cos(angle)) * K @ K


def wrench_on_load(q: float, v: float, a: float) -> np.ndarray:
    """Newton-Euler, in the joint's frame. Shape (6,)."""
    y, x = np.array([0.0, 1.0, 0.0]), np.array([1.0, 0.0, 0.0])
    arm = about(y, q)
    R = arm @ about(x, 0.7)
    w, dw = v * y, a * y
    joint, com = arm @ np.array([0.6, 0.0, 0.0]), R @ np.array([0.05, 0.01, 0.01])
    r = joint + com
    force = 0.5 * (np.cross(dw, r) + np.cross(w, np.cross(w, r)) - G)
    I = R @ np.array([[1e-3, 1e-4, 0], [1e-4, 2e-3, 0], [0, 0, 2.2e-3]]) @ R.T
    return np.concatenate([force, R.T @ (I @ dw + np.cross(w, I @ w) + np.cross(com, force))])


def held(results: screwgauge.Results, engine: str) -> np.ndarray:
    names = results.components("reaction")
    return results.values("reaction", engine=engine)[:, [names.index(f"hold.{each}") for each in COMPONENTS]]


@pytest.mark.parametrize(("hold", "sign"), [(HOLD, 1.0), (BACK, -1.0)], ids=["on the arm", "from the load"])
def test_a_payload_is_held_by_the_force_and_moment_of_newton_and_euler(hold, sign, write):
    write("arm.toml", ARM + hold)
    results = screwgauge.run(load_scene(write("move.toml", SCENE)), engines=ENGINES)
    assert results.ok
    motion = results.scene.motion
    states = zip(motion.y[:, 0], motion.yd[:, 0], motion.ydd[:, 0], strict=True)
    expected = np.array([wrench_on_load(*state) for state in states])
    if sign < 0.0:  # moments are given about the joint in the frame on the arm, which stands as the other one does
        expected = -expected
    for engine in ENGINES:
        for part in (slice(3), slice(3, 6)):
            off = np.abs(held(results, engine)[:, part] - expected[:, part]).max()
            assert off < 1e-12 * np.abs(expected[:, part]).max()


def test_truth_knows_it(write):
    pytest.importorskip("flint")
    write("arm.toml", ARM + HOLD)
    scene = load_scene(write("move.toml", SCENE)).at([0.0, 0.5])
    results = screwgauge.run(scene, engines=["screw", "truth"])
    assert results.ok
    assert {f"hold.{each}" for each in COMPONENTS} <= {*results.components("reaction", engine="truth")}


def test_two_bodies_held_together_move_as_one(write, tmp_path):
    R, c = about(np.array([1.0, 0.0, 0.0]), 0.7), np.array([0.6, 0.0, 0.0])
    com = c + R @ np.array([0.05, 0.01, 0.01])
    I = R @ np.array([[1e-3, 1e-4, 0], [1e-4, 2e-3, 0], [0, 0, 2.2e-3]]) @ R.T
    middle = (1.0 * np.array([0.3, 0.0, 0.0]) + 0.5 * com) / 1.5
    whole = np.diag([1e-3, 2e-2, 2e-2]) + I
    for m, at in ((1.0, np.array([0.3, 0.0, 0.0])), (0.5, com)):
        r = at - middle
        whole = whole + m * ((r @ r) * np.eye(3) - np.outer(r, r))
    entries = ", ".join(f"{'xyz'[i]}{'xyz'[j]} = {float(whole[i, j])}" for i in range(3) for j in range(i, 3))
    one = f'name = "one"\n[independent]\nq = "a"\n[bodies.arm]\nmass = 1.5\ncom = {middle.tolist()}\n'
    write("one.toml", one + f"inertia = {{ {entries} }}\n" + ARM[ARM.index("[joints.a]") :])
    write("arm.toml", ARM + HOLD)
    forward = '[forward]\nstart.q = 0.3\n[time]\ntimes = [0, 0.5, 1]\n[[observables]]\nname = "q"\ncoordinate = "a"\n'
    both = [
        screwgauge.run(load_scene(write(f"{n}-f.toml", f'mechanism = "{n}.toml"\n{forward}'))) for n in ("arm", "one")
    ]
    assert all(each.ok for each in both)
    for engine in ("screw", "pinocchio", "mujoco"):
        paths = [each.values("observable", engine=engine) for each in both]
        assert np.abs(paths[0] - paths[1]).max() < 1e-9


LOOP = data("loop.toml")


def test_loads_and_bases_of_closed_loops_are_held(write):
    write("loop.toml", LOOP)
    motion = 'mechanism = "loop.toml"\nmotion.crank = { offset = 1.0, harmonics = [[6, 0, 0.5]] }\n'
    results = screwgauge.run(load_scene(write("move.toml", motion + "time = { duration = 1, step = 0.1 }\n")))
    assert results.ok
    names = results.components("reaction")
    assert {f"{joint}.{each}" for joint in ("stand", "hold") for each in COMPONENTS} <= {*names}
    still = 'mechanism = "loop.toml"\nmotion.crank.offset = 1.0\ntime.times = [0]\n'
    forces = screwgauge.run(load_scene(write("still.toml", still))).frame("reaction").iloc[0]
    whole = 9.81 * (3 + 0.5 + 0.8 + 0.6 + 0.4)
    for engine in ("screw", "pinocchio", "mujoco"):  # ground bears all weight
        assert forces[engine, "stand.fz"] == pytest.approx(whole, rel=1e-13, abs=0)


@pytest.fixture
def arm(write) -> Mechanism:
    return load_mechanism(write("arm.toml", ARM + HOLD))


def test_it_is_no_coordinate_of_the_user(arm, write):
    write("arm.toml", ARM + HOLD)
    scene = load_scene(write("move.toml", SCENE))
    results = screwgauge.run(scene, engines=["screw", "mujoco"])
    for quantity in ("joint_position", "joint_velocity", "joint_acceleration", "tree_force"):
        assert results.components(quantity) == ("a",)
    for spoilt in (SCENE + '[[springs]]\ncoordinate = "hold"\nstiffness = 1\n',):
        with pytest.raises(screwgauge.ScrewgaugeError, match="unknown coordinate 'hold'"):
            load_scene(write("bad.toml", spoilt))
    assert arm.moving == ("a",)
    assert "hold (fixed: arm - load)" in repr(arm)
    assert "couplings    0" in repr(arm)


def test_tables_need_no_column_of_it(write, tmp_path):
    write("arm.toml", ARM + HOLD)
    scene = load_scene(write("move.toml", SCENE))
    screwgauge.run(scene, engines=["screw"]).to_csv(tmp_path / "mine.csv")
    beside = load_scene(write("beside.toml", f'{SCENE}tables.mine = "mine.csv"\n'))
    results = screwgauge.run(
        beside, engines=["screw", "mine"], quantities=["joint_position", "actuator_force", "reaction"]
    )
    assert results.ok
    assert not [one for one in results.warnings if "mine" in one]


def test_engines_of_others_need_not_know_it(write, stand_in):
    write("arm.toml", ARM + HOLD)
    scene = load_scene(write("move.toml", SCENE))

    def formula(problem) -> Solution:
        y = problem.task.y
        return Solution("pinocchio", "1", {"joint_position": Values(("a",), ("rad",), y)}, condition=np.ones(len(y)))

    stand_in(pinocchio=formula)
    results = screwgauge.run(scene, engines=["screw", "pinocchio"], quantities=["joint_position"])
    assert results.ok
    assert results.components("joint_position", engine="pinocchio") == ("a",)


def test_it_counts_as_six_constraints_and_no_freedom(arm):
    counted = mobility(layout(arm), arm.home[None])
    assert (counted.joint_freedoms, counted.kutzbach, counted.mobility, counted.constraints) == (1, 1, 1, 11)
    assert counted.overconstraints == 0


def test_it_is_no_letter_of_a_leg(write):
    rigid = without_fixed_joints(load_mechanism(write("loop.toml", LOOP)))
    body, legs = end_body(rigid)
    assert body == "coupler"
    assert {leg.kinds for leg in legs} == {"RR"}


def test_bodies_that_it_holds_are_one_body_of_a_picture(arm):
    rigid = without_fixed_joints(arm)
    (body,) = rigid.bodies
    assert body.name == "arm"
    assert rigid.coordinates == arm.moving
    com = np.array([0.6, 0.0, 0.0]) + about(np.array([1.0, 0.0, 0.0]), 0.7) @ np.array([0.05, 0.01, 0.01])
    assert body.mass == 1.5
    assert body.com == pytest.approx((np.array([0.3, 0.0, 0.0]) + 0.5 * com) / 1.5, abs=1e-15)


WRONG = {
    "axes": ("axes = [[0, 0, 1]]\n", "axes"),
    "home": ("home = [1]\n", "home"),
    "driven": ("actuated = true\n", "actuated"),
    "limits": ("limits = [[0, 1]]\n", "limits"),
    "followed": ('[couplings.c]\ncoordinate = "a"\nof = "hold"\npolynomial = [0, 1]\n', "unknown coordinate 'hold'"),
    "coupled": ('[couplings.c]\ncoordinate = "hold"\npolynomial = [0.1]\n', "unknown coordinate 'hold'"),
}


@pytest.mark.parametrize("case", WRONG)
def test_it_has_neither_axes_nor_coordinates(case, write):
    more, reason = WRONG[case]
    with pytest.raises(screwgauge.ScrewgaugeError, match=reason):
        load_mechanism(write("arm.toml", ARM + HOLD + more))


def test_it_cannot_be_independent(write):
    with pytest.raises(screwgauge.ScrewgaugeError, match="unknown coordinate 'hold'"):
        load_mechanism(write("arm.toml", (ARM + HOLD).replace('q = "a"', 'q = "hold"')))


def test_a_loop_of_fixed_joints_alone_is_refused(write):
    twice = HOLD.replace("joints.hold", "joints.again")
    with pytest.raises(DescriptionError, match="fixed"):
        load_mechanism(write("arm.toml", ARM + HOLD + twice))


def test_it_is_written_as_it_is_read(arm, write, tmp_path):
    again = load_mechanism(write("again.toml", description(arm)))
    assert [joint.kind for joint in again.joints] == ["R", "fixed"]
    assert again.moving == arm.moving
    write_models(arm, tmp_path)
    for cut in CUTS:
        suffix = "" if cut == "minimal" else f"-{cut}"
        file = read_loops(tmp_path / f"arm{suffix}.loops.toml")
        assert [joint.kind for joint in file.joints] == ["R", "fixed"]
        assert len(file.couplings) == len(loops_of(arm, cut).couplings) == 1
    assert all(row.ok for row in check_models(arm, tmp_path))


@pytest.mark.parametrize("text", [ARM + HOLD, ARM + BACK, LOOP], ids=["on the arm", "from the load", "in a loop"])
def test_other_programs_read_it_as_fixed(text, write, tmp_path):
    pinocchio, mujoco = pytest.importorskip("pinocchio"), pytest.importorskip("mujoco")
    mechanism = load_mechanism(write("machine.toml", text))
    write_models(mechanism, tmp_path, include=frozenset({"sensors", "limits", "geoms", "contacts"}))
    moving = len(lay_out(mechanism, "minimal").coordinates) - sum(joint.fixed for joint in mechanism.joints)
    assert pinocchio.buildModelFromUrdf(str(tmp_path / f"{mechanism.name}.urdf")).nv == moving
    model = mujoco.MjModel.from_xml_path(str(tmp_path / f"{mechanism.name}.xml"))
    assert model.nv == moving
    assert model.body_mass.sum() == pytest.approx(mechanism.mass, rel=1e-15, abs=0)
    assert all(row.ok for row in check_models(mechanism, tmp_path))


def test_files_of_ones_own_may_hold_it(write, tmp_path):
    arm = load_mechanism(write("arm.toml", ARM + HOLD))
    write_models(arm, tmp_path)
    own = 'models.mujoco = "arm.xml"\nmodels.pinocchio = "arm.urdf"\n'
    scene = write("own.toml", SCENE + own)
    results = screwgauge.run(load_scene(scene))
    assert results.ok
    assert {f"hold.{each}" for each in COMPONENTS} <= {*results.components("reaction", engine="mujoco")}
    file = tmp_path / "arm.xml"
    file.write_text(file.read_text(encoding="utf-8").replace('mass="0.5"', 'mass="0.6"'), encoding="utf-8")
    heavier = screwgauge.run(load_scene(scene))
    assert not heavier.ok
    assert "arm.mass" in heavier.mismatches


def test_a_fixed_joint_that_stands_elsewhere_in_a_urdf_is_refused(write, tmp_path):
    arm = load_mechanism(write("arm.toml", ARM + HOLD))
    write_models(arm, tmp_path)
    text = (tmp_path / "arm.urdf").read_text(encoding="utf-8")
    text = text.replace('<child link="load@hold.frame" />', '<child link="load" />', 1)
    start, end = text.index('<link name="load@hold.frame" />'), text.index('<link name="load">')
    (tmp_path / "arm.urdf").write_text(text[:start] + text[end:], encoding="utf-8")
    scene = load_scene(write("own.toml", f'{SCENE}models.pinocchio = "arm.urdf"\n'))
    with pytest.raises(screwgauge.ScrewgaugeError, match="fixed joint 'hold'"):
        screwgauge.run(scene, engines=["screw", "pinocchio"])


def test_a_description_and_its_files_are_the_same_machine(write, tmp_path, command):
    path = write("loop.toml", LOOP)
    write_models(load_mechanism(path), tmp_path)
    for ending in ("urdf", "xml"):
        said = command("diagnose", path, tmp_path / f"loop.{ending}", "--out", tmp_path / ending)
        assert "SAME" in said.out


def test_pictures_and_reports_show_it_as_fixed(write, tmp_path, inside, command):
    write("arm.toml", ARM + HOLD)
    scene = write("move.toml", SCENE)
    command("run", scene, "--engines", "screw,mujoco", "--out", tmp_path / "out")
    picture = tmp_path / "arm.svg"
    command("view", scene, "--svg", picture)
    assert ">fixed<" in picture.read_text(encoding="utf-8")
    assert "hold.mz" in (tmp_path / "out" / "errors.csv").read_text(encoding="utf-8")
