"""Answers to a given motion: names, units, shapes, repeatability, and no side effects."""

from __future__ import annotations

from dataclasses import fields, replace

import numpy as np
import pytest

from screwgauge.contract.fixtures import Loaded
from screwgauge.problem import GivenMotion, Problem
from screwgauge.quantities import FORCE, description_names, number_type
from screwgauge.reference.rotations import Array
from screwgauge.solution import Solution

#: Fraction of the explainable rounding up to which forces must be linear in accelerations.
LINEAR = 0.1
SLOWEST = 1e-3  # smallest share of inertia in the largest force for which a test of linearity is meaningful


def arrays(solution: Solution) -> dict[str, Array]:
    """Return all arrays of an answer except times."""
    found = {f"values of {name}": values.array for name, values in solution.values.items()}
    found |= {f.name: one for f in fields(solution) if isinstance(one := getattr(solution, f.name), np.ndarray)}
    for name, error in solution.errors.items():
        each = {"scaled": error.scaled, "condition": error.condition, "radius": error.radius, **error.absolute}
        found |= {f"{what} error of {name}": np.asarray(x) for what, x in each.items() if x is not None}
    return found


def check_same(one: Solution, other: Solution) -> None:
    """Fail unless two answers are bitwise equal."""
    first, second = arrays(one), arrays(other)
    assert first.keys() == second.keys(), "a repeated call returns different arrays"
    for name, array in first.items():
        same = np.array_equal(array, second[name], equal_nan=True)
        assert same, f"{name} differ in a repeated call; make `solve` independent of earlier calls"


def test_components_units_and_shapes(subject: Loaded, question: Problem, answer: Solution) -> None:
    assert {*answer.values} == {*question.wanted}, "return all wanted quantities, or list missing quantities in `lacks`"
    assert answer.version, "Solution.version is empty; set it to the library's version"
    n, known = len(question.task), description_names(subject.mechanism)
    assert answer.condition.shape == (n,), "Solution.condition must have a number for each sample, or 1 if unknown"
    coordinates = dict(zip(subject.mechanism.coordinates, subject.mechanism.units, strict=True))
    for name, values in answer.values.items():
        components, units = known[name]
        if name.startswith("tree_force"):  # for the joints in the engine's tree
            components = tuple(c for c in coordinates if c in values.components)
            units = tuple(FORCE[coordinates[c]] for c in components)
        assert values.components == components, f"components of {name} must equal those in names(mechanism)"
        assert values.units == units, f"units of {name} must equal those in names(mechanism)"
        assert values.array.shape == (n, len(components)), f"{name} must have shape (n_sample, n_component)"
        assert np.isfinite(values.array).all(), f"{name} has NaN or infinite values"


@pytest.mark.parametrize("quantity", ["joint_position", "body_angular_velocity", "com_acceleration", "actuator_force"])
def test_nothing_but_what_is_wanted_is_answered(
    subject: Loaded, question: Problem, answer: Solution, quantity: str
) -> None:
    subject.has(quantity)
    alone = subject.ask(subject.scene.problem([quantity]))
    assert {*alone.values} == {quantity}, "return only the quantities that `problem.wanted` names"
    assert {*alone.errors} <= {quantity}
    if subject.engine.name != "truth":  # truth encloses only the requested values, as tightly as they need
        same = np.array_equal(alone.values[quantity].array, answer.values[quantity].array)
        assert same, f"{quantity} depends on which other quantities are wanted"


def test_the_input_stays_as_it_is_and_may_be_read_only(subject: Loaded, question: Problem, answer: Solution) -> None:
    motion, gravity = question.task, question.applied.g
    assert isinstance(motion, GivenMotion)
    copies = [x.copy() for x in (motion.t, motion.y, motion.yd, motion.ydd, gravity)]
    for array in copies:
        array.setflags(write=False)
    applied = replace(question.applied, gravity=copies[4])
    loads = [load.numbers() for load in applied.loads]
    t, y, yd, ydd, _ = copies
    check_same(answer, subject.ask(replace(question, applied=applied, task=GivenMotion(t, y, yd, ydd))))
    for array, before in zip(copies, (motion.t, motion.y, motion.yd, motion.ydd, gravity), strict=True):
        assert np.array_equal(array, before), "the engine writes into the problem; copy its arrays first"
    assert [load.numbers() for load in applied.loads] == loads


def test_what_is_answered_cannot_be_changed(answer: Solution) -> None:
    for values in answer.values.values():
        with pytest.raises(ValueError, match="read-only"):
            values.array[0, 0] = 1.0


def test_questions_may_come_in_any_order(subject: Loaded, question: Problem, request: pytest.FixtureRequest) -> None:
    """A task gives bitwise equal answers when repeated after different tasks and gravity, and with a reloaded model."""
    problems = [question, replace(question, applied=replace(question.applied, gravity=np.array([1.0, 2.0, 3.0])))]
    for task, fixture in (("InitialValue", "fall"), ("States", "push")):
        if task in {kind.__name__ for kind in subject.engine.tasks} and subject.engine.cut != "full":
            problems.append(request.getfixturevalue(fixture))
    first = [subject.ask(problem) for problem in problems]
    for problem, solution in reversed([*zip(problems, first, strict=True)]):
        check_same(solution, subject.ask(problem))
    check_same(first[0], subject.engine.load(subject.files).solve(question))


def test_nothing_is_printed(subject: Loaded, question: Problem, capfd: pytest.CaptureFixture[str]) -> None:
    subject.engine.load(subject.files).solve(question)
    printed = "".join(capfd.readouterr())
    assert not printed, "the engine prints; turn off the output of its library, or move it to `Solution.notes`"


def test_gravity_may_be_left_out(subject: Loaded, question: Problem) -> None:
    """If gravity is None, engines use the gravity of the model file, or else `GRAVITY`, the gravity of the scene."""
    quantity = _force_of(subject)
    problem = replace(question, wanted=frozenset((quantity,)))
    left = replace(problem, applied=replace(problem.applied, gravity=None))
    said, kept = (subject.ask(one).values[quantity].array for one in (problem, left))
    assert np.array_equal(said, kept), "use problem.applied.g if `gravity` is None and the model file has no gravity"


def _force_of(subject: Loaded) -> str:
    """Return a force quantity that the engine computes; skip the test if it computes none."""
    for name in ("generalized_force", "actuator_force", "tree_force"):
        if name in subject.quantities:
            return name
    subject.has("generalized_force")
    raise AssertionError


def test_forces_are_linear_in_the_accelerations(subject: Loaded, question: Problem) -> None:
    quantity, motion = _force_of(subject), question.task
    assert isinstance(motion, GivenMotion)

    def force(factor: float) -> Array:
        task = replace(motion, ydd=factor * motion.ydd, drive=None)
        return subject.ask(replace(subject.scene, task=task).problem([quantity])).values[quantity].array

    rest, once, twice = (force(factor) for factor in (0.0, 1.0, 2.0))
    assert np.abs(once - rest).max() > SLOWEST * np.abs(once).max(), f"accelerations do not affect {quantity}"
    rounding = LINEAR * number_type(subject.engine.name).limit * np.abs(twice).max()
    assert np.abs((twice - rest) - 2.0 * (once - rest)).max() < rounding, f"{quantity} is not linear in accelerations"


def test_progress_goes_from_nothing_to_all(subject: Loaded, question: Problem) -> None:
    shares: list[float] = []
    subject.ask(replace(question, task=_part(question)), progress=shares.append)
    assert shares == sorted(shares), "progress goes back"
    assert all(0.0 <= share <= 1.0 for share in shares), "progress must be a fraction from 0 to 1"


def _part(question: Problem) -> GivenMotion:
    assert isinstance(question.task, GivenMotion)
    return question.task.part(slice(0, 1))


def test_what_progress_raises_ends_the_work(subject: Loaded, question: Problem) -> None:
    """An exception raised in the progress function stops the run, so it must be called at least once."""

    def stop(share: float) -> None:
        raise KeyboardInterrupt

    problem = subject.scene.at([0.217]).problem([subject.quantities[0]])  # a time without a cached answer
    with pytest.raises(KeyboardInterrupt):
        subject.ask(problem, progress=stop)
