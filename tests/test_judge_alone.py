from dataclasses import replace

import numpy as np
import pytest

from screwgauge.engines.tree import closed_forces
from support.engines import IN_DOUBLES, Solution, ask, model_files
from support.equations import Dynamics, across_direction, components, preload_space, reaction_names
from support.judging import judge
from support.planar import Bar, four_bar
from support.planar import moving as moving_bars
from support.scene import GIVEN, sampled
from support.solve import ScrewModel, layout
from support.tolerances import LINEAR
from support.trees import MujocoTree, PinocchioTree

NOT_ASKED = {
    "joint_position": {"loop_closure"},
    "joint_velocity": {"loop_closure", "loop_rate"},
    "joint_acceleration": {"loop_closure", "loop_acceleration"},
    "body_angular_velocity": {"loop_closure", "body_motion"},
    "body_angular_acceleration": {"loop_closure", "body_motion"},
    "com_acceleration": {"loop_closure", "body_motion"},
    "tree_force": {"loop_closure", "tree_force"},
    "tree_force_soft": {"loop_closure", "tree_force_soft"},
    "generalized_force": {"loop_closure", "virtual_work"},
    "actuator_force": {"loop_closure", "virtual_work", "power_balance", "force_rule"},
    "reaction": {"loop_closure", "newton_euler", "force_rule"},
}


def moving(name: str = "3ups-upu-s-fast", rule: str = "min_norm"):
    return replace(sampled(name, slice(205, 2000, 500)), rule=rule)


def answered(scene, engine: str, *quantities: str) -> Solution:
    files = model_files(scene.mechanism.name, engine)
    return ask(engine, files, scene.problem(frozenset(quantities or GIVEN)))


def judged(scene, solution: Solution, **settings):
    return judge(scene.mechanism, scene.problem(GIVEN), solution, **settings)


def faults(scene, solution: Solution, *quantities: str) -> set[str]:
    kept = replace(solution, values={name: solution.values[name] for name in quantities or GIVEN})
    rows = judged(scene, kept)
    return {*rows["residual"][~rows["ok"]]}


def shifted(solution: Solution, quantity: str, component: str, share: float) -> Solution:
    values = solution.values[quantity]
    array = values.array.copy()
    array[:, values.components.index(component)] += share * np.abs(array).max()
    return replace(solution, values={**solution.values, quantity: replace(values, array=array)})


@pytest.mark.slow
@pytest.mark.parametrize("rule", ["min_norm", "spherical_axial"])
@pytest.mark.parametrize("engine", IN_DOUBLES)
def test_each_quantity_is_judged_though_nothing_else_was_asked(engine, rule):
    scene = moving(rule=rule)
    everything = answered(scene, engine)
    for quantity in NOT_ASKED if rule == "min_norm" else ("actuator_force", "reaction"):
        rows = judged(scene, replace(everything, values={quantity: everything.values[quantity]}))
        assert {*rows["residual"]} == NOT_ASKED[quantity], quantity
        assert rows["ok"].all(), rows[~rows["ok"]].to_string()
        assert (rows["max_scaled"] < LINEAR).all(), rows.to_string()


@pytest.mark.parametrize(
    ("quantity", "component", "residual"),
    [
        ("com_acceleration", "leg1.upper.y", "body_motion"),
        ("generalized_force", "b", "virtual_work"),
        ("actuator_force", "leg3", "virtual_work"),
        ("reaction", "leg1.wrist.m", "newton_euler"),
        ("tree_force", "leg2.q1", "tree_force"),
    ],
)
def test_one_wrong_number_of_the_only_quantity_asked_is_found(quantity, component, residual):
    scene = moving()
    wrong = shifted(answered(scene, "screw", quantity), quantity, component, 1e-9)
    rows = judged(scene, wrong)
    assert residual in {*rows["residual"][~rows["ok"]]}


@pytest.mark.slow
@pytest.mark.parametrize("engine", IN_DOUBLES)
def test_the_sign_of_all_moments_of_universal_joints(engine, monkeypatch):
    right = closed_forces.components

    def turned(at, wrench, about):
        universal = [label == "m" for label, _ in components(at.joint)]
        return np.where(universal, -1.0, 1.0) * right(at, wrench, about)

    monkeypatch.setattr(closed_forces, "components", turned)
    of_the_solver = Dynamics.transmit

    def signed(self, x, need, along):
        found, tree = of_the_solver(self, x, need, along)
        universal = [name.endswith(".m") for name in reaction_names(self.mechanism.joints, ())[0]]
        return found * np.where(universal, -1.0, 1.0), tree

    monkeypatch.setattr(Dynamics, "transmit", signed)
    scene = moving()
    solution = answered(scene, engine)
    assert "newton_euler" in faults(scene, solution) & faults(scene, solution, "reaction")


@pytest.mark.slow
@pytest.mark.parametrize("engine", IN_DOUBLES)
def test_forces_that_are_not_the_smallest(engine, monkeypatch):
    """A newton of preload balances and does no work."""
    right = closed_forces.min_norm

    def preloaded(B, Q, idle=()):
        forces, condition = right(B, Q, idle)
        return forces + preload_space(B)[..., 0], condition

    smallest = Dynamics.actuator_force.func

    def with_preload(self):
        return smallest(self) + preload_space(self.B)[..., 0]

    monkeypatch.setattr(Dynamics, "actuator_force", property(with_preload))
    monkeypatch.setattr(closed_forces, "min_norm", preloaded)
    scene = moving()
    solution = answered(scene, engine)
    assert faults(scene, solution, "actuator_force") == {"force_rule"}
    assert faults(scene, solution) == {"force_rule"}


@pytest.mark.slow
@pytest.mark.parametrize("engine", IN_DOUBLES)
def test_a_spherical_joint_whose_force_lies_along_another_line(engine, monkeypatch):
    right = across_direction

    def elsewhere(R, direction):
        return right(R, np.array([0.6, 0.0, 0.8]))

    line = Dynamics._across_line
    monkeypatch.setattr(closed_forces, "across_direction", elsewhere)
    monkeypatch.setattr(Dynamics, "_across_line", lambda self, name, _: line(self, name, np.array([0.6, 0.0, 0.8])))
    scene = moving(rule="spherical_axial")
    solution = answered(scene, engine)
    for asked in ((), ("actuator_force",), ("reaction",)):
        assert faults(scene, solution, *asked) == {"force_rule"}


@pytest.mark.slow
@pytest.mark.parametrize("engine", IN_DOUBLES)
def test_a_sign_in_the_forces_of_the_open_tree(engine, monkeypatch):
    def signed(owner, name):
        right = getattr(owner, name)

        def wrong(*arguments):
            tau = right(*arguments).copy()
            tau[:, 3] *= -1.0
            return tau

        monkeypatch.setattr(owner, name, wrong)

    signed(Dynamics, "open_tree_force")
    for tree in (PinocchioTree, MujocoTree):
        signed(tree, "tree_force")
    scene = moving()
    solution = answered(scene, engine)
    assert "tree_force" in faults(scene, solution) & faults(scene, solution, "tree_force")


def test_forces_of_no_tree_fail_and_it_says_why():
    scene = moving()
    solution = answered(scene, "screw", "tree_force")
    values = solution.values["tree_force"]
    names = ("nonsense", *values.components[1:])
    rows = judged(scene, replace(solution, values={"tree_force": replace(values, components=names)}))
    row = rows.set_index("residual").loc["tree_force"]
    assert not row["ok"]
    assert "joint coordinates of a spanning tree" in row["reason"]


def test_the_tree_of_another_cut_is_judged_as_it_is(write):
    """Names decide the cut: the last joint is cut."""
    bars = [Bar(0.3, 1.0, (0.1, 0.02, 0.03)), Bar(0.9, 2.0, (0.4, 0.0, 0.1)), Bar(0.7, 1.5, (0.3, -0.05, 0.0))]
    text = four_bar(bars, 0.8, 1.0)
    answers = {}
    for name in ("d", "b0"):
        scene = moving_bars(write, text.replace("[joints.d]", f"[joints.{name}]"), [1.0, 1.4, 2.0], 3.0, 1.0)
        problem = scene.problem(frozenset(("joint_position", "tree_force")))
        answers[name] = scene, ScrewModel(layout(scene.mechanism)).solve(problem)
    (scene, right), (_, other) = answers["d"], answers["b0"]
    assert (*right.values["tree_force"].components, *other.values["tree_force"].components) == (*"abc", "a", "b", "b0")
    there = replace(other.values["tree_force"], components=("a", "b", "d"))
    found = replace(right, values={"tree_force": there})
    assert judged(scene, found)["ok"].all()
    rows = judged(scene, shifted(found, "tree_force", "d", 1e-9)).set_index("residual")
    assert not rows.loc["tree_force", "ok"]
    assert rows.loc["tree_force", "worst_component"] == "d"


def test_a_gate_that_admits_an_error_of_a_force_admits_it_in_every_residual_of_that_force():
    scene = moving()
    right = answered(scene, "screw", "actuator_force", "reaction")
    gate = {"actuator_force": 1e-3}
    for share, ok in ((0.9e-3, True), (1.5e-2, False)):
        wrong = shifted(right, "actuator_force", "leg3", share)
        rows = judged(scene, wrong, tolerance_of=lambda name: gate.get(name, LINEAR)).set_index("residual")
        assert rows["ok"].all() == ok
        assert (rows.loc[["newton_euler", "virtual_work", "power_balance", "force_rule"], "tolerance"] == 1e-3).all()
        assert (rows.loc[["loop_closure"], "tolerance"] == 1e-11).all()


def test_loops_close_to_rounding_unless_the_scene_admits_errors_of_positions():
    scene = moving()
    solution = answered(scene, "screw", "actuator_force")
    q = solution.assembly.copy()
    q[:, scene.mechanism.coordinates.index("leg2.q3")] += 1e-7
    wrong = replace(solution, assembly=q)
    for gate, ok in (({"actuator_force": 1e-3}, False), ({"actuator_force": 1e-3, "joint_position": 1e-5}, True)):
        rows = judged(scene, wrong, tolerance_of=lambda name, gate=gate: gate.get(name, LINEAR))
        assert rows["ok"].all() == ok
        assert rows.set_index("residual").loc[["loop_closure"], "ok"].all() == ok


def test_nothing_is_judged_stricter_than_usual_or_looser_than_the_scene_says():
    scene = moving()
    solution = answered(scene, "screw")
    rows = judged(scene, solution, tolerance_of=lambda name: 1e-15)
    assert (rows["tolerance"] == 1e-11).all()
