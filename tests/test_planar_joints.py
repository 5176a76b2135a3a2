from itertools import combinations
from pathlib import Path

import numpy as np
import pytest
import tomli_w
from test_traced_engine import by_program, worst

import screwgauge
from support.command import main
from support.engines import IN_DOUBLES
from support.errors import DescriptionError
from support.geometry import rotation
from support.judging import agreed
from support.mechanism import KINDS, ROD, Frame, Joint, load_mechanism, spanning_tree
from support.scene import GIVEN
from support.solve import ScrewModel, layout

#: Name -> independent coordinates, and joints: kind, with a star where it is driven, parent and child.
MECHANISMS = {
    "ruer": (["a"], {"a": "R* ground one", "b": "U two one", "c": "R two three", "e": "E ground three"}),
    "puer": (["e.q3"], {"a": "P* ground one", "b": "U two one", "e": "E two three", "d": "R three ground"}),
    "3-rre": (
        ["r0", "e0.q1", "e1.q3"],
        {
            name: sides
            for k in range(3)
            for name, sides in {
                f"r{k}": f"R* ground low{k}",
                f"b{k}": f"R high{k} low{k}",
                f"e{k}": f"E high{k} platform" if k % 2 else f"E platform high{k}",
            }.items()
        },
    ),
}
#: Largest difference over the largest number, their condition numbers being about 100 at most.
AGREED = 1e-11
CASES = [("ruer", 1), ("ruer", 4), ("puer", 0), ("puer", 7), ("3-rre", 0), ("3-rre", 2)]


def drawn(name: str, seed: int, folder: Path) -> Path:
    chosen, joints = MECHANISMS[name]
    rng = np.random.default_rng([seed, len(name)])
    rows = [sides.split() for sides in joints.values()]
    poses = {body: (attitude(rng), rng.uniform(-0.5, 0.5, 3)) for row in rows for body in row[1:]}
    poses["ground"] = np.eye(3), np.zeros(3)
    tables = {"name": name, "bodies": {body: solid(rng) for body in poses if body != "ground"}, "joints": {}}
    for joint, (kind, parent, child) in zip(joints, rows, strict=True):
        turning = KINDS[kind[0]]
        axes, home = attitude(rng)[: max(1, sum(turning))], rng.uniform(-0.6, 0.6, len(turning))
        near, none = Frame(rng.uniform(-0.4, 0.4, 3), attitude(rng)), np.zeros((len(home), 2))
        (R, p), (R_child, p_child) = poses[parent], poses[child]
        p, R = p + R @ near.p, R @ near.R
        for (turns, axis), q in zip(
            Joint(joint, kind[0], parent, child, axes, (), home, none).freedoms, home, strict=True
        ):
            p, R = (p, R @ rotation(axis, q)) if turns else (p + R @ axis * q, R)
        far = Frame(R_child.T @ (p - p_child), R_child.T @ R)
        tables["joints"][joint] = {
            "kind": kind[0],
            "parent": parent,
            "child": child,
            "axes": axes.tolist(),
            "home": home.tolist(),
            "actuated": "*" in kind,
        } | {
            f"{side}_frame": {"position": frame.p.tolist(), "rotation": {"matrix": frame.R.tolist()}}
            for side, frame in (("parent", near), ("child", far))
        }
    tables["independent"] = {f"y{i}": coordinate for i, coordinate in enumerate(chosen)}
    (folder / "mechanism.toml").write_text(tomli_w.dumps(tables), encoding="utf-8")
    mechanism = load_mechanism(folder / "mechanism.toml")
    home = mechanism.home[mechanism.independent_columns].tolist()
    scene = {
        "mechanism": "mechanism.toml",
        "gravity": [1.0, 2.0, -9.0],
        "time": {"duration": 0.4, "step": 0.1},
        "motion": {f"y{i}": {"offset": q, "harmonics": [[3.0, 0.0, 0.02]]} for i, q in enumerate(home)},
        "loads": [{"on": rows[0][2], "by": "environment", "force": [3, -5, 2], "torque": [1, 0, 2]}],
    }
    (folder / "scene.toml").write_text(tomli_w.dumps(scene), encoding="utf-8")
    return folder / "scene.toml"


def attitude(rng: np.random.Generator) -> np.ndarray:
    Q = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    return np.asarray(Q * np.linalg.det(Q))


def solid(rng: np.random.Generator) -> dict[str, object]:
    cloud = 0.1 * rng.normal(size=(3, 6))
    J = np.trace(cloud @ cloud.T) * np.eye(3) - cloud @ cloud.T
    entries = {f"{'xyz'[i]}{'xyz'[j]}": float(J[i, j]) for i in range(3) for j in range(i, 3)}
    return {"mass": 1.0, "com": rng.uniform(-0.2, 0.2, 3).tolist(), "inertia": entries}


def trees(mechanism):
    names = [joint.name for joint in mechanism.joints]
    loops = len(names) - len(mechanism.bodies)
    found = {}
    for cut in combinations(names, loops):
        tree = spanning_tree(mechanism, [name for name in names if name not in cut])
        if {joint.name for joint in tree.cuts} == {*cut}:
            found[cut] = tree
    return found


@pytest.mark.slow
@pytest.mark.parametrize(("name", "seed"), CASES)
def test_all_engines_agree_and_satisfy_the_judge(name, seed, tmp_path):
    agreed(
        screwgauge.run(
            screwgauge.load_scene(drawn(name, seed, tmp_path)), engines=(*IN_DOUBLES, "truth"), quantities=GIVEN
        )
    )


@pytest.mark.sampled(3)
@pytest.mark.parametrize(("name", "seed"), CASES[::2])
def test_every_spanning_tree_has_the_same_motion_and_forces(name, seed, tmp_path):
    scene = screwgauge.load_scene(drawn(name, seed, tmp_path))
    problem = scene.problem(frozenset(GIVEN) - {"tree_force", "tree_force_soft"})
    usual = ScrewModel(layout(scene.mechanism)).solve(problem)
    found = trees(scene.mechanism)
    kinds = {cut: "".join(scene.mechanism.joint(joint).kind for joint in cut) for cut in found}
    assert any("E" in cut for cut in kinds.values())
    assert any("E" not in cut for cut in kinds.values())
    programs = {*{kind: cut for cut, kind in kinds.items()}.values()}  # one of each that differs in kinds
    for cut, tree in found.items():
        for backend in ("array", "numpy", "llvm") if cut in programs else ("array",):
            other = ScrewModel(tree, backend=backend).solve(problem)
            assert worst(other, usual)[1] < AGREED
            assert backend == "array" or by_program(other) == len(scene.t)


@pytest.mark.slow
@pytest.mark.parametrize(("name", "seed"), CASES[::2])
def test_engines_simulate_the_same_motion(name, seed, tmp_path):
    """Springs and motors act on tree coordinates of some engines."""
    scene = drawn(name, seed, tmp_path)
    mechanism = load_mechanism(tmp_path / "mechanism.toml")
    at_home = dict(zip(mechanism.coordinates, mechanism.home.tolist(), strict=True))
    joint = next(joint.name for joint in mechanism.joints if joint.kind == "E")
    tables = {
        "mechanism": "mechanism.toml",
        "time": {"duration": 0.2, "step": 0.1},
        "forward": {"start": {y: at_home[q] for y, q in mechanism.independent.items()}},
        "springs": [{"coordinate": f"{joint}.q{i}", "stiffness": 5.0, "damping": 0.3, "rest": 0.2} for i in (2, 3)],
        "motors": [{"coordinate": f"{joint}.q1", "offset": 1.5}],
        "observables": [{"name": f"{joint}.{i}", "coordinate": f"{joint}.q{i}"} for i in (1, 2, 3)],
    }
    scene.write_text(tomli_w.dumps(tables), encoding="utf-8")
    results = screwgauge.run(screwgauge.load_scene(scene))
    assert results.ok, str(results)
    assert {"screw", "pinocchio", "mujoco"} <= {*results.solutions}


@pytest.mark.slow
def test_commands_take_it(tmp_path):
    scene = drawn("3-rre", 0, tmp_path)
    assert main(["models", str(tmp_path / "mechanism.toml"), "--check", "--out", str(tmp_path / "models")]) == 0
    assert main(["run", str(scene), "--out", str(tmp_path / "run")]) == 0
    assert main(["check", str(scene)]) == 0
    assert main(["view", str(scene), "--png", str(tmp_path / "view.png")]) == 0


def test_it_is_read_as_it_is_described(write):
    text = (
        ROD.replace('kind = "R"', 'kind = "E"').replace("actuated = true", "home = [1, 2, 3]").replace('"h"', '"h.q3"')
    )
    (joint,) = load_mechanism(write("flat.toml", text)).joints
    assert [(turns, axis.tolist()) for turns, axis in joint.freedoms] == [
        (False, [0, 1, 0]),
        (False, [0, 0, 1]),
        (True, [1, 0, 0]),
    ]
    assert joint.coordinates == ("h.q1", "h.q2", "h.q3")
    with pytest.raises(DescriptionError, match="a E joint cannot be actuated"):
        load_mechanism(write("driven.toml", text.replace("home", "actuated = true, home")))
    with pytest.raises(DescriptionError, match="a E joint has 1 axes"):
        load_mechanism(write("axes.toml", text.replace("[[1, 0, 0]]", "[[1, 0, 0], [0, 1, 0]]")))
