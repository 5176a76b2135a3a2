import re
from pathlib import Path

import numpy as np
import pytest

import screwgauge
from support.data import data
from support.engines import IN_DOUBLES
from support.errors import DescriptionError
from support.judging import agreed
from support.mechanism import load_mechanism
from support.models import lay_out
from support.scene import GIVEN
from support.tolerances import LINEAR

ENGINES = (*IN_DOUBLES, "truth")
X, Y, Z = [1, 0, 0], [0, 1, 0], [0, 0, 1]
A, B, C, D = ["3/5", 0, "4/5"], [0, "5/13", "12/13"], ["2/3", "2/3", "1/3"], ["-6/7", "2/7", "3/7"]
#: Of a plane: an axis of the frame but for rounding, which engines and truth have to take for the same.
NEARLY = ["sin(pi)", 0, -1]


def u(first: object, second: object) -> list[list[object]]:
    """Orthogonal axes of a U joint."""
    c, s = f"cos({first})", f"sin({first})"
    return [[c, s, 0], [f"-({s})*cos({second})", f"({c})*cos({second})", f"sin({second})"]]


def legs(wrist: str, places: list[tuple[float, float]]) -> dict[str, tuple[object, ...]]:
    """Legs to a platform, with slides."""
    joints = {}
    for k, (low, high) in enumerate(places):
        base = np.array([0.6 * np.cos(low), 0.6 * np.sin(low), 0])
        top = np.array([0.3 * np.cos(high), 0.3 * np.sin(high), 0.6])
        along = (top - base) / np.linalg.norm(top - base)
        first = np.cross(along, Z) / np.linalg.norm(np.cross(along, Z))
        cross = [first.tolist(), np.cross(along, first).tolist()]
        joints[f"u{k}"] = "U", f"ground lower{k}", base.tolist(), cross
        joints[f"s{k}"] = "P*", f"lower{k} upper{k}", (0.5 * (base + top)).tolist(), [along.tolist()]
        joints[f"v{k}"] = wrist, f"upper{k} platform", top.tolist(), [X, Y, Z] if wrist == "S" else cross
    return joints


def planes() -> dict[str, tuple[object, ...]]:
    joints, sides = {}, ("high0 platform", "platform high1", "high2 platform")
    for k, (x, y) in enumerate(((5, 0), (-4, 3), (-2, -4))):
        joints[f"r{k}"] = "R*", f"ground low{k}", [x / 8, y / 8, 0], [(A, B, C)[k]]
        joints[f"b{k}"] = "R*", f"low{k} high{k}", [x / 10, y / 10, 0.2], [(Z, D, A)[k]]
        joints[f"e{k}"] = "E", sides[k], [x / 20, y / 20, 0.4], [(D, C, X)[k]]
    return joints


STEWART = {"pose": ("F", "ground platform", [0, 0, 0.7], [Z, Y, X])}
STEWART |= legs("S", [(0.2, 0.8), (1.9, 1.4), (2.3, 2.9), (4, 3.5), (4.4, 5), (-0.2, -0.8)])
#: Name -> independent coordinates, and joints with their points and axes at home, where frames are those of the world.
#: A star after the kind marks an actuator.
MECHANISMS = {
    "slider-crank": (
        ["a"],
        {
            "a": ("R*", "ground crank", [0, 0, 0], [Y]),
            "b": ("R", "crank rod", [0.1, 0, 0.2], [Y]),
            "c": ("R", "rod piston", [0.7, 0, 0], [Y]),
            "d": ("P", "ground piston", [0.7, 0, 0], [X]),
        },
    ),
    "five-bar": (
        ["a", "d"],
        {
            "a": ("R*", "ground one", [0, 0, 0], [Y]),
            "b": ("P", "one two", [0.1, 0, 0.3], [["3/5", 0, "4/5"]]),
            "c": ("R", "two three", [0.5, 0, 0.7], [Y]),
            "e": ("R", "four three", [0.7, 0, 0.4], [Y]),
            "d": ("P*", "ground four", [0.7, 0, 0], [["5/13", 0, "12/13"]]),
        },
    ),
    "driven everywhere": (
        ["a"],
        {
            "a": ("R*", "ground one", [0, 0, 0], [Y]),
            "b": ("R*", "one two", [0, 0, 0.2], [Y]),
            "c": ("R*", "three two", [0.5, 0, 0.4], [Y]),
            "d": ("R*", "ground three", [0.4, 0, 0], [Y]),
        },
    ),
    "rccc": (
        ["a"],
        {
            "a": ("R*", "ground one", [0, 0, 0], [A]),
            "b": ("C", "one two", [0.3, 0.1, 0.2], [B]),
            "c": ("C", "two three", [0.4, 0.6, 0.1], [C]),
            "d": ("C", "three ground", [0.1, 0.5, -0.3], [D]),
        },
    ),
    "uuuu": (
        ["a.q1", "b.q2"],
        {
            "a": ("U", "ground one", [0, 0, 0], u(0.3, 1.5)),
            "b": ("U", "one two", [0.1, 0.1, 0.4], u(1.1, -0.4)),
            "c": ("U", "two three", [0.6, 0.2, 0.5], u(-0.6, -0.9)),
            "d": ("U", "three ground", [0.5, -0.2, 0.1], u(2.0, 0.2)),
        },
    ),
    "3-upu": (["s0", "s1", "s2"], legs("U", [(0.1, 0.1), (2.2, 2.2), (4.1, 4.1)])),
    "planar loop": (
        ["a", "e.q3"],
        {
            "a": ("R*", "ground one", [0, 0, 0], [Y]),
            "b": ("R*", "one two", [0.1, 0, 0.4], [Y]),
            "e": ("E", "ground two", [0.6, 0, 0.2], [Y]),
        },
    ),
    "ruer": (
        ["a"],
        {
            "a": ("R*", "ground one", [0, 0, 0], [A]),
            "b": ("U", "one two", [0.3, 0.1, 0.2], u(0.3, 1.1)),
            "c": ("R", "two three", [0.4, 0.6, 0.1], [C]),
            "e": ("E", "ground three", [0.1, 0.5, -0.3], [NEARLY]),
        },
    ),
    "rcep": (
        ["e.q2"],
        {
            "a": ("R*", "ground one", [0, 0, 0], [A]),
            "b": ("C", "one two", [0.3, 0.1, 0.2], [B]),
            "e": ("E", "three two", [0.4, 0.6, 0.1], [C]),
            "d": ("P", "three ground", [0.1, 0.5, -0.3], [D]),
        },
    ),
    "3-rre": (["r0", "r1", "r2"], planes()),
    "stewart": ([f"pose.{name}" for name in ("x", "y", "z", "q1", "q2", "q3")], STEWART),
}


def described(name: str, order: tuple[str, ...], folder: Path) -> Path:
    chosen, joints = MECHANISMS[name]
    rng = np.random.default_rng(len(name))
    bodies = sorted({body for _, sides, _, _ in joints.values() for body in sides.split()} - {"ground"})
    lines = [f'name = "{name.replace(" ", "-")}"', "[independent]", *(f'y{i} = "{q}"' for i, q in enumerate(chosen))]
    for body in bodies:
        (a, b, c), (d, e, f) = rng.uniform(0.05, 0.09, 3).round(4), rng.uniform(-0.01, 0.01, 3).round(4)
        com = rng.uniform(-0.2, 0.6, 3).round(3).tolist()
        inertia = f"{{ xx = {a}, yy = {b}, zz = {c}, xy = {d}, xz = {e}, yz = {f} }}"
        lines += [f"[bodies.{body}]", f"mass = {rng.uniform(0.5, 2):.3f}", f"com = {com}", f"inertia = {inertia}"]
    for joint in order:
        kind, sides, point, axes = joints[joint]
        parent, child = sides.split()
        lines += [f"[joints.{joint}]", f'kind = "{kind[0]}"', f'parent = "{parent}"', f'child = "{child}"']
        lines += [f"axes = {axes}", f"actuated = {str('*' in kind).lower()}"]
        lines += [f"{side}_frame.position = {point}" for side in ("parent", "child")]
    (folder / "mechanism.toml").write_text("\n".join(lines))
    scene = ['mechanism = "mechanism.toml"', "gravity = [1, 2, -9]", "time = { duration = 0.4, step = 0.2 }"]
    scene += [f"motion.y{i} = {{ harmonics = [[3, 0, {0.04 - 0.01 * i}]] }}" for i in range(len(chosen))]
    scene += [f'[[loads]]\non = "{bodies[-1]}"\nby = "environment"\npoint = [0.1, 0, 0]\nforce = [3, -5, 2]']
    (folder / "scene.toml").write_text("\n".join(scene))
    return folder / "scene.toml"


def orders(name: str) -> list[tuple[str, ...]]:
    written = tuple(MECHANISMS[name][1])
    return [written, written[::-1], written[1:] + written[:1]]


def check(name: str, which: int, folder: Path) -> screwgauge.Results:
    scene = screwgauge.load_scene(described(name, orders(name)[which], folder))
    forceless = {"actuator_force", "reaction"} if not scene.mechanism.actuators else set()
    engines = ENGINES[: 3 if which else -1 if forceless else None]  # without actuators the truth knows no forces
    results = agreed(screwgauge.run(scene, engines=engines, quantities=[q for q in GIVEN if q not in forceless]))
    between = {
        frozenset(pair) for pair in results.pairs.loc[results.pairs["quantity"] == "tree_force", ["a", "b"]].values
    }
    assert {"screw", "pinocchio"} in between
    return results


@pytest.mark.sampled(3)
@pytest.mark.slow
@pytest.mark.parametrize(("name", "which"), [(name, which) for name in MECHANISMS for which in range(3)])
def test_every_joint_closes_a_loop_wherever_it_is_listed(name, which, tmp_path):
    check(name, which, tmp_path)


@pytest.mark.parametrize(
    ("name", "cut"),
    [
        ("slider-crank", "RRR"),
        ("driven everywhere", "R weld"),
        ("rccc", "C weld"),
        ("uuuu", "U weld"),
        ("3-upu", "U weld U weld"),
        ("planar loop", "E weld"),
        ("ruer", "R"),
        ("rcep", "E weld"),
        ("3-rre", "E weld E weld"),
        ("stewart", "S" * 6),
    ],
)
def test_points_close_what_they_can_and_copies_the_rest(name, cut, tmp_path):
    for order in orders(name):
        described(name, order, tmp_path)
        mechanism = load_mechanism(tmp_path / "mechanism.toml")
        closures = lay_out(mechanism, "minimal").closures
        said = [(mechanism.joint(c.joint).kind, c.type) for c in closures]
        assert all(kind in cut and (type == "weld") == ("weld" in cut) for kind, type in said)


def test_a_free_joint_counts_as_no_constraint(tmp_path):
    free = check("stewart", 1, tmp_path)
    assert free.mobility["kutzbach"] == free.mobility["mobility"] == 6
    assert free.mobility["overconstraints"] == 0
    assert not [name for name in free.components("reaction") if name.startswith("pose")]


FLYING = data("flying.toml")


TWIN = '[joints.twin]\nkind = "F"\nparent = "ground"\nchild = "stone"'


@pytest.mark.slow
def test_a_body_that_nothing_holds_flies(write):
    write("flying.toml", FLYING)
    text = (
        'mechanism = "flying.toml"\ntime = { duration = 0.4, step = 0.1 }\n[forward]\nrates = { x = 1, z = 3, b = 2 }\n'
    )
    body = '[[observables]]\nname = "z"\nbody = "stone"\naxis = "z"\npoint = [0.1, 0.2, 0]\n'
    spring = '[[motors]]\ncoordinate = "pose.q2"\noffset = 0.3\n[[springs]]\ncoordinate = "pose.x"\nstiffness = 20\n'
    falls = screwgauge.run(screwgauge.load_scene(write("falls.toml", text + body)))
    pulled = screwgauge.run(screwgauge.load_scene(write("pulled.toml", text + spring)))
    assert falls.ok
    assert pulled.ok, pulled.pairs.to_string()
    z, t = falls.values("observable")[:, 0], falls.times
    assert falls.mobility["kutzbach"] == falls.mobility["mobility"] == 6
    # as a stone flies: the second difference of its height is that of gravity, from any start
    assert np.diff(z, 2) == pytest.approx(-9.81 * np.diff(t)[1:] ** 2, abs=LINEAR)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('child = "stone"', 'child = "stone"\nactuated = true', "a F joint cannot be actuated"),
        ('child = "stone"', 'child = "stone"\naxes = [[0, 0, 1]]', "a F joint has 3 axes"),
        ("home =", "axes = [[1, 0, 0], [0, 1, 0], [1, 0, 0]]\nhome =", "not orthogonal"),
        ("[joints.pose]", f"{TWIN}\n[joints.pose]", "a loop consists of F joints only"),
    ],
)
def test_free_joints_that_make_no_sense_are_refused(old, new, said, write):
    assert FLYING.count(old) == 1
    with pytest.raises(DescriptionError, match=said):
        load_mechanism(write("flying.toml", FLYING.replace(old, new)))


def test_a_motion_that_starts_far_from_home_is_told(tmp_path):
    scene = described("slider-crank", orders("slider-crank")[0], tmp_path)
    told: list[str] = []
    text = scene.read_text()
    screwgauge.run(screwgauge.load_scene(scene), engines=["screw"], quantities=["joint_position"], warn=told.append)
    assert not told
    scene.write_text(text.replace("motion.y0 = {", "motion.y0 = { offset = 0.4,"))
    screwgauge.run(screwgauge.load_scene(scene), engines=["screw"], quantities=["joint_position"], warn=told.append)
    assert [re.findall(r"y0 = ([\d.]+)", line) for line in told] == [["0.4", "0"]]
    scene.write_text(text.replace("motion.y0 = {", "motion.y0 = { offset = 9,").replace('a"', 'd"'))
    (tmp_path / "mechanism.toml").write_text((tmp_path / "mechanism.toml").read_text().replace('y0 = "a"', 'y0 = "d"'))
    with pytest.raises(screwgauge.ScrewgaugeError, match=r"y0 = 9.*y0 = 0"):
        screwgauge.run(screwgauge.load_scene(scene), engines=["screw"])
