"""Fixtures: an engine with a built-in mechanism loaded, problems for it, and its answers."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any, NoReturn

import numpy as np
import pytest

import screwgauge
from screwgauge.engines.registry import Engine, EngineModel, get_engine
from screwgauge.problem import GivenMotion, InitialValue, Integration, ModelFiles, Problem, States
from screwgauge.quantities import GIVEN
from screwgauge.reference.applied import GRAVITY
from screwgauge.reference.errors import DescriptionError, ModelFileError
from screwgauge.reference.mechanism import Mechanism
from screwgauge.scene.scene import Scene
from screwgauge.solution import Solution
from screwgauge.study.answers import declared_lacks
from screwgauge.study.methods import describe_import_error
from screwgauge.study.solving import generated_models, model_files

__all__ = ["answer", "entry", "fall", "fall_answer", "push", "question", "subject"]

#: Errors with which an engine rejects a mechanism or a problem.
REFUSALS = (DescriptionError, ModelFileError)
#: Scenes and sample times [s]; most tests use the first scene that the engine accepts.
SCENES = {"3ups-upu-s-fast": (0.1, 0.35), "slider-crank": (0.1, 0.35), "arm7": (0.1, 0.35)}
MOTION = frozenset(("joint_position", "joint_velocity", "joint_acceleration"))


@dataclass(frozen=True)
class Loaded:
    """An engine with a mechanism, loaded once for all tests.

    Attributes:
        quantities: Quantities that the engine computes for this mechanism by default.
    """

    engine: Engine
    files: ModelFiles
    model: EngineModel
    scene: Scene
    quantities: tuple[str, ...]

    @property
    def mechanism(self) -> Mechanism:
        return self.scene.mechanism

    def ask(self, problem: Problem, **more: Any) -> Solution:
        return self.model.solve(problem, **more)

    def has(self, *quantities: str) -> None:
        """Skip a test if the engine lacks quantities that the test needs."""
        for name in quantities:
            if name not in self.quantities:
                why = declared_lacks(self.model, self.engine).get(name, "the quantity is not part of its task")
                pytest.skip(f"{self.engine.name} lacks {name}: {why}")

    def takes(self, task: type[GivenMotion | InitialValue | States]) -> None:
        """Skip a test if the engine does not accept its task."""
        if task not in self.engine.tasks:
            pytest.skip(f"{self.engine.name} does not accept {task.__name__}")


@pytest.fixture(scope="session")
def entry(engine_name: str) -> Engine:
    """Return the registry entry of the engine."""
    return get_engine(engine_name)


def _reject(entry: Engine, what: str) -> NoReturn:
    pytest.fail(f"engine {entry.name} {what}", pytrace=False)


@pytest.fixture(scope="session")
def subject(entry: Engine) -> Iterator[Loaded]:
    """Yield the engine with the first scene that it accepts; fail if it accepts none."""
    if not entry.tasks:
        _reject(entry, "accepts no task; list GivenMotion, InitialValue or States in `tasks` of its Engine")
    refused = []
    for name, times in SCENES.items():
        scene = screwgauge.load_scene(name).under(gravity=np.array(GRAVITY)).at(times)
        with generated_models(scene) as folder:
            files = model_files(scene, entry.name, folder)
            try:
                model = entry.load(files)
                quantities = tuple(q for q in GIVEN if q not in declared_lacks(model, entry))
                if not quantities:
                    _reject(entry, "lacks every quantity; remove the quantities that it computes from `lacks`")
                if GivenMotion in entry.tasks:
                    model.solve(scene.problem(quantities, entry.name))
            except REFUSALS as error:
                refused.append(f"{name}: {error}")
                continue
            except ImportError as error:
                _reject(entry, describe_import_error(error, entry))
            yield Loaded(entry, files, model, scene, quantities)
            return
    _reject(entry, f"refuses all mechanisms that the fixtures try ({' '.join(refused)}); accept at least one of them")


@pytest.fixture(scope="session")
def question(subject: Loaded) -> Problem:
    """Return a problem that requests all quantities of the engine for a given motion."""
    subject.takes(GivenMotion)
    return subject.scene.problem(subject.quantities)


@pytest.fixture(scope="session")
def answer(subject: Loaded, question: Problem) -> Solution:
    return subject.ask(question)


@pytest.fixture(scope="session")
def fall(subject: Loaded) -> Problem:
    """Return a short simulation that starts from a state of the given motion, under the forces of its scene."""
    subject.takes(InitialValue)
    task = subject.scene.task
    assert isinstance(task, GivenMotion)
    t = np.array([0.0, 0.01, 0.03])
    return Problem(
        subject.scene.applied, InitialValue(task.y[0], task.yd[0], 0.0, t, Integration(rtol=1e-6, atol=1e-8)), MOTION
    )


@pytest.fixture(scope="session")
def fall_answer(subject: Loaded, fall: Problem) -> Solution:
    return subject.ask(fall)


@pytest.fixture(scope="session")
def push(subject: Loaded) -> Problem:
    """Return a problem that asks for accelerations at states of the given motion, under gravity and random forces."""
    subject.takes(States)
    subject.takes(GivenMotion)
    subject.has(*MOTION)
    names = subject.mechanism.coordinates
    if subject.engine.cut:
        subject.has("tree_force")
        names = subject.ask(subject.scene.problem(["tree_force"])).values["tree_force"].components
    motion = subject.ask(subject.scene.problem(MOTION)).values
    q, v = (motion[name].pick(names).array for name in ("joint_position", "joint_velocity"))
    task = States(names, q, v, tau=100.0 * np.cos(1.0 + np.arange(q.size).reshape(q.shape)))
    return Problem(replace(subject.scene.applied, loads=()), task, frozenset(("joint_acceleration",)))
