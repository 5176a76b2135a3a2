"""The declarations of an engine are true, and it rejects unsupported problems with an error message."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from screwgauge.contract.fixtures import Loaded
from screwgauge.engines.features import FEATURES, TASKS
from screwgauge.engines.registry import CUTS, Engine, get_engine
from screwgauge.problem import GivenMotion, InitialValue, ModelFiles, Problem, States, Task
from screwgauge.quantities import AS, QUANTITIES
from screwgauge.reference.applied import Load
from screwgauge.reference.errors import ModelFileError, ScrewgaugeError, UnknownNameError

FITS = "call check_fits(problem, mechanism, where) of screwgauge.plugins first"


def test_the_entry_says_what_the_engine_is(entry: Engine) -> None:
    assert entry.installed, (
        f"`package` is '{entry.package}', which is not installed; set it to the engine's distribution"
    )
    assert entry.meaning, "`meaning` is empty; describe the engine in a few words"
    assert entry.reads in (".toml", ".urdf", ".xml"), "`reads` must be the file extension of its model file"
    assert entry.cut in CUTS
    assert bool(entry.cut) == (entry.reads != ".toml"), "`cut` must name the generated URDF or MJCF that it reads"
    assert entry.tasks, "`tasks` is empty"
    assert entry.tasks <= {GivenMotion, InitialValue, States}
    unknown = {*entry.lacks} - {*QUANTITIES}
    assert not unknown, f"`lacks` names unknown quantities: {', '.join(sorted(unknown))}"
    assert all(why.strip() for why in entry.lacks.values()), "`lacks` must give a reason for each quantity"
    unknown = {*entry.refuses} - {*FEATURES, *TASKS}
    assert not unknown, (
        f"`refuses` names unknown features: {', '.join(sorted(unknown))}; choose from {', '.join((*FEATURES, *TASKS))}"
    )
    both = {*entry.refuses} & {task.__name__ for task in entry.tasks}
    assert not both, f"`tasks` and `refuses` both name {', '.join(sorted(both))}"
    assert all(why.strip() for why in entry.refuses.values()), "`refuses` must give a reason for each feature"


def test_it_takes_something_and_gives_nothing_that_it_lacks(subject: Loaded, question: Problem) -> None:
    assert subject.quantities
    every = replace(question, wanted=frozenset((*question.wanted, *subject.engine.lacks)))
    given_though = {*subject.ask(every).values} & {*subject.engine.lacks}
    assert not given_though, f"`lacks` names quantities that the engine computes: {', '.join(sorted(given_though))}"


def test_another_number_of_independent_coordinates_is_refused(subject: Loaded, question: Problem) -> None:
    n, k = len(question.task), len(subject.mechanism.independent)
    none = np.zeros((n, k + 1))
    wide = GivenMotion(subject.scene.t, none, none, none)
    with pytest.raises(ScrewgaugeError, match=rf"has {k} independent coordinates, .*motion .*{k + 1}"):
        subject.ask(replace(question, task=wide))


def test_a_start_of_another_number_of_coordinates_is_refused(subject: Loaded, fall: Problem) -> None:
    assert isinstance(fall.task, InitialValue)
    k = len(fall.task.start)
    wide = replace(fall.task, start=np.zeros(k + 1), rates=np.zeros(k + 1))
    with pytest.raises(ScrewgaugeError, match=f"{k} independent coordinates"):
        subject.ask(replace(fall, task=wide))


def test_a_load_on_an_unknown_body_is_refused(subject: Loaded, question: Problem) -> None:
    load = Load("platfrom", None, np.array([0.0, 0.0, 1.0]), np.zeros(3))
    with pytest.raises(ModelFileError, match="has no body 'platfrom'"):
        subject.ask(replace(question, applied=replace(question.applied, loads=(load,))))


def test_a_task_that_it_does_not_take_is_refused(subject: Loaded, question: Problem) -> None:
    k, n = len(subject.mechanism.independent), len(subject.mechanism.coordinates)
    kinds: dict[type[Task], Task] = {
        InitialValue: InitialValue(np.zeros(k), np.zeros(k), 0.0, np.array([0.0, 0.1])),
        States: States(subject.mechanism.coordinates, np.zeros((1, n)), np.zeros((1, n)), a=np.zeros((1, n))),
    }
    takes = get_engine(subject.engine.name.partition(AS)[0]).tasks  # in every number type
    for kind in kinds.keys() - takes:
        if subject.engine.cut != "full":  # its model could answer, but not about joints at rest in its loops
            try:
                subject.ask(replace(question, task=kinds[kind]))
            except ScrewgaugeError:
                continue
            pytest.fail(
                f"the engine answers {kind.__name__}, which `tasks` does not list; list it, or reject it: {FITS}"
            )


def test_settings_that_it_does_not_have_are_refused(subject: Loaded) -> None:
    with pytest.raises(UnknownNameError, match=f"^engine {subject.engine.name}: unknown setting 'nonsense'; "):
        subject.engine.load(subject.files, nonsense=1)


def test_a_model_without_its_loops_file_is_refused(subject: Loaded, tmp_path: Path) -> None:
    if not subject.engine.cut:
        pytest.skip("the engine reads a description, which needs no loops file")
    with pytest.raises(ModelFileError, match="has no loops file"):
        subject.engine.load(ModelFiles(subject.files.model))
    with pytest.raises(ModelFileError, match=r"gone.loops.toml: cannot be read"):
        subject.engine.load(ModelFiles(subject.files.model, tmp_path / "gone.loops.toml"))


def test_a_file_that_is_no_model_is_refused(subject: Loaded, tmp_path: Path) -> None:
    path = tmp_path / f"none{subject.engine.reads}"
    path.write_text("no model\n", encoding="utf-8")
    with pytest.raises(ScrewgaugeError):
        subject.engine.load(replace(subject.files, model=path))
