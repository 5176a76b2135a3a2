from dataclasses import replace

import numpy as np
import pytest

from support.equations import JointPose, components, constraint_wrenches
from support.geometry import rotation, screws
from support.judging import exerted, judge
from support.mechanism import KINDS, Frame, Joint
from support.models import read_loops, stem, write_models
from support.scene import GIVEN, sampled
from support.solve import ScrewModel, layout
from support.tolerances import AGREE, FORMULA
from support.trees import MujocoTree, PinocchioTree, TreeModel, close_tree

pytestmark = pytest.mark.slow

X, Y, Z = np.eye(3)
TURNED = rotation(np.array([2.0, 3.0, 6.0]) / 7, np.array(0.7))
OTHER = rotation(np.array([6.0, -2.0, 3.0]) / 7, np.array(1.1))
PARENT = Frame(np.array([0.1, 0.2, -0.3]), rotation(Y, np.array(0.4)))
CHILD = Frame(np.array([-0.3, 0.5, 0.2]), rotation(X, np.array(-0.8)))
WORLD = {"fx": X, "fy": Y, "fz": Z}
IN_CHILD = dict(zip("xyz", (TURNED @ CHILD.R).T, strict=True))
OBLIQUE = np.array([0.0, 0.6, 0.8])
NORMAL = {"1": TURNED @ CHILD.R @ np.array([0.0, 0.8, -0.6]), "2": TURNED @ CHILD.R @ -X}
MOMENTS = {f"m{name}": axis for name, axis in IN_CHILD.items()}
#: Kind, axes -> name of each component and its direction in the world, a moment if the name begins with m.
COMPONENTS = {
    "R about z": ("R", [Z], {**WORLD, "mx": IN_CHILD["x"], "my": IN_CHILD["y"]}),
    "R oblique": ("R", [OBLIQUE], {**WORLD, "m1": NORMAL["1"], "m2": NORMAL["2"]}),
    "P along x": ("P", [X], {"fy": IN_CHILD["y"], "fz": IN_CHILD["z"], **MOMENTS}),
    "P oblique": ("P", [OBLIQUE], {"f1": NORMAL["1"], "f2": NORMAL["2"], **MOMENTS}),
    "C along y": ("C", [Y], {f"{what}{axis}": IN_CHILD[axis] for what in "fm" for axis in "xz"}),
    "U": ("U", [X, Y], {**WORLD, "m": np.cross(OTHER @ PARENT.R @ X, TURNED @ CHILD.R @ Y)}),
    "S": ("S", [X, Y, Z], WORLD),
    "F": ("F", [X, Y, Z], {}),
    "E normal to z": ("E", [Z], {"fz": IN_CHILD["z"], "mx": IN_CHILD["x"], "my": IN_CHILD["y"]}),
    "E normal to -y": ("E", [-Y], {"fy": IN_CHILD["y"], "mx": IN_CHILD["x"], "mz": IN_CHILD["z"]}),
    "E oblique": ("E", [OBLIQUE], {"f": TURNED @ CHILD.R @ OBLIQUE, "m1": NORMAL["1"], "m2": NORMAL["2"]}),
}


def joint_of(kind: str, axes) -> Joint:
    n = len(KINDS[kind])
    names, free = tuple(f"j.q{i}" for i in range(n)), np.tile([-np.inf, np.inf], (n, 1))
    return Joint("j", kind, "ground", "body", np.array(axes), names, np.zeros(n), free, PARENT, CHILD)


@pytest.mark.parametrize(("kind", "axes", "expected"), COMPONENTS.values(), ids=COMPONENTS)
def test_engines_and_judge_mean_the_same_by_a_name(kind, axes, expected):
    joint, p = joint_of(kind, axes), np.array([[1.0, 2.0, 3.0]])
    point = p + TURNED @ CHILD.p
    at = JointPose(joint, (OTHER @ PARENT.R)[None], point, (TURNED @ CHILD.R)[None], point)
    wrenches, named = constraint_wrenches(at)[0], {name: k for k, (name, _) in enumerate(components(joint))}
    seen = exerted(joint, (OTHER @ PARENT.R)[None], (TURNED @ CHILD.R)[None])
    assert list(named) == list(seen) == list(expected)
    for name, direction in expected.items():
        pushes = name[0] == "f"
        acting = screws.force(direction, point[0]) if pushes else screws.couple(direction)
        assert np.allclose(wrenches[named[name]], acting, rtol=0, atol=FORMULA)
        assert components(joint)[named[name]][1] == ("N" if pushes else "N m")
        assert np.allclose(seen[name][0], direction, rtol=0, atol=FORMULA)


def reframed(mechanism, kinds: str):
    turn, shift = rotation(np.array([2.0, -1.0, 2.0]) / 3, np.array(0.9)), np.array([0.07, -0.04, 0.05])

    def moved(frame: Frame) -> Frame:
        return Frame(frame.p + frame.R @ shift, frame.R @ turn)

    joints = tuple(
        replace(j, parent_frame=moved(j.parent_frame), child_frame=moved(j.child_frame), axes=j.axes @ turn)
        if j.kind in kinds
        else j
        for j in mechanism.joints
    )
    return replace(mechanism, joints=joints)


def solved(scene, mechanism, engine: str, folder):
    model, (name, _, cut) = ScrewModel(layout(mechanism)), engine.partition("-")
    if engine != "screw":
        write_models(mechanism, folder, gravity=scene.applied.g)
        base = folder / stem(mechanism.name, cut or "minimal")
        kind, suffix = (PinocchioTree, ".urdf") if name == "pinocchio" else (MujocoTree, ".xml")
        file = read_loops(base.with_suffix(".loops.toml"))
        model = TreeModel(close_tree(kind(base.with_suffix(suffix), file), file))
    problem = scene.problem(frozenset(GIVEN))
    solution = model.solve(problem)
    rows = judge(mechanism, problem, solution)
    assert rows["ok"].all(), rows[~rows["ok"]].to_string()
    return {quantity: values.array for quantity, values in solution.values.items()}


@pytest.fixture
def scene():
    return sampled("3ups-upu-s-fast", slice(205, 2000, 500))


@pytest.mark.slow
@pytest.mark.parametrize("engine", ["screw", "pinocchio", "mujoco"])
def test_frames_of_slides_that_are_turned_and_moved_change_only_where_reactions_are_taken(scene, engine, tmp_path):
    right, found = (solved(scene, it, engine, tmp_path) for it in (scene.mechanism, reframed(scene.mechanism, "P")))
    assert np.abs(right["reaction"] - found["reaction"]).max() > 1.0
    for quantity in set(GIVEN) - {"reaction"}:
        assert np.abs(right[quantity] - found[quantity]).max() < AGREE * np.abs(right[quantity]).max(), quantity


@pytest.mark.slow
def test_the_axial_rule_of_another_mechanism(scene, tmp_path):
    usual = scene.mechanism.joint("s")
    other = replace(
        usual,
        parent=usual.child,
        child=usual.parent,
        parent_frame=usual.child_frame,
        child_frame=usual.parent_frame,
        **{name: getattr(usual, name)[::-1] for name in ("coordinates", "home", "limits")},
        axes=-usual.axes[::-1],
    )
    joints = tuple(other if joint is usual else joint for joint in scene.mechanism.joints)
    mechanism = replace(scene.mechanism, joints=joints, axial=("s", np.array([2.0, 3.0, 6.0]) / 7))
    scene, engines = replace(scene, rule="spherical_axial"), ("screw", "pinocchio", "pinocchio-full", "mujoco")
    right, *others = (solved(scene, mechanism, engine, tmp_path) for engine in engines)
    assert (
        np.abs(right["actuator_force"] - solved(scene, scene.mechanism, "screw", tmp_path)["actuator_force"]).min() > 1
    )
    for quantity in set(GIVEN) - {"tree_force", "tree_force_soft"}:
        for found in others:
            assert np.abs(right[quantity] - found[quantity]).max() < AGREE * np.abs(right[quantity]).max(), quantity
