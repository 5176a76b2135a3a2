"""Runs a scene: every engine on its own model file, then comparison and judgement."""

from __future__ import annotations

import tempfile
import traceback
from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from datetime import datetime
from pathlib import Path

import pandas as pd

from screwgauge.engines.parts import component_names
from screwgauge.engines.registry import GENERATED, check_engines, load_engine
from screwgauge.environment import environment
from screwgauge.judging.compare import compare
from screwgauge.judging.judge import COLUMNS, judge
from screwgauge.judging.refusals import refusals
from screwgauge.models.generate import stem, write_models
from screwgauge.problem import OldProblem
from screwgauge.quantities import INVERSE, check_quantities
from screwgauge.reference.errors import DescriptionError, ModelFileError, UnknownNameError
from screwgauge.reference.mechanism import Mechanism
from screwgauge.reference.mobility import Mobility
from screwgauge.scene.preflight import check_actuation, check_scene
from screwgauge.scene.scene import Scene
from screwgauge.solution import Failure, Solution
from screwgauge.study.comparison import Comparison
from screwgauge.study.provenance import provenance

#: Distributions that are not called like their module.
_PACKAGES = {"pinocchio": "pin", "flint": "python-flint"}

Report = Callable[[str, float], None]
"""Takes the name of a step and the share of it that is done, 0 to 1."""


def run(
    scene: Scene,
    engines: Iterable[str] | None = None,
    quantities: Iterable[str] | None = None,
    *,
    progress: Report = lambda step, share: None,
    warn: Callable[[str], None] = lambda sentence: None,
    date: datetime | None = None,
) -> Comparison:
    """Drives the engines with a scene, compares all pairs and judges each. A forward scene is integrated.

    Args:
        engines: Names; those of the scene by default.
        quantities: Names; those of the scene by default. Nothing else is computed.
        progress: Called as work goes on.
        warn: Called with a sentence on what may take long or go wrong, before it begins.
        date: That the report bears; now by default.

    Raises:
        ScrewgaugeError: Bad input. An engine that fails is no error but a row of the results.
    """
    if scene.forward is not None:
        from screwgauge.study.forward import run_forward

        return run_forward(scene, engines, quantities, progress=progress, warn=warn, date=date)
    names = check_engines(scene.engines if engines is None else engines)
    wanted = check_quantities(scene.quantities if quantities is None else quantities, known=INVERSE)
    progress("preflight", 0.0)
    mobility = check_scene(scene)
    check_actuation(scene, mobility, wanted)
    with tempfile.TemporaryDirectory(prefix="screwgauge-") as folder:
        expected = _expected(scene.mechanism, mobility)
        solutions, failures = _solve_all(scene, names, wanted, expected, Path(folder), progress)
        judged_files = provenance(scene, {name: model_files(scene, name, Path(folder))[0] for name in names}, date=date)
    progress("comparison", 0.0)
    refused = tuple(one for solution in solutions.values() for one in refusals(scene, solution))
    for one in refused:
        solution = solutions[one.engine]
        solutions[one.engine] = replace(solution, notes=(*solution.notes, one.sentence))
    errors, pairs = compare(scene, solutions, failures, mobility, refused)
    judged = [judge(scene, solution, refused=refused) for solution in solutions.values()]
    return Comparison(
        scene=scene,
        solutions=solutions,
        failures=failures,
        errors=errors,
        pairs=pairs,
        judge=pd.concat(judged, ignore_index=True) if judged else pd.DataFrame(columns=COLUMNS),
        mobility=facts(mobility),
        environment=environment(),
        refusals=refused,
        provenance=judged_files,
    )


def solve(
    scene: Scene,
    engines: Iterable[str],
    quantities: Iterable[str],
    *,
    expected: Mapping[str, tuple[str, ...]] | None = None,
    progress: Report = lambda step, share: None,
) -> tuple[dict[str, Solution], dict[str, Failure]]:
    """Drives the engines with a scene as it is: nothing is checked before, nothing compared after.

    Args:
        expected: Quantity -> component names that an answer must have.

    Returns:
        What each engine answered, and why the others did not.
    """
    with tempfile.TemporaryDirectory(prefix="screwgauge-") as folder:
        return _solve_all(scene, engines, quantities, expected or {}, Path(folder), progress)


def _solve_all(
    scene: Scene,
    engines: Iterable[str],
    quantities: Iterable[str],
    expected: Mapping[str, tuple[str, ...]],
    folder: Path,
    progress: Report,
) -> tuple[dict[str, Solution], dict[str, Failure]]:
    """Writes the model files into the folder, and drives the engines."""
    solutions: dict[str, Solution] = {}
    failures: dict[str, Failure] = {}
    write_models(scene.mechanism, folder, gravity=scene.gravity)
    for name in engines:
        outcome = _solve(scene, name, frozenset(quantities), expected, folder, progress)
        if isinstance(outcome, Solution):
            solutions[name] = outcome
        else:
            failures[name] = outcome
    return solutions, failures


def facts(found: Mobility) -> dict[str, object]:
    """Counts for the report, and which forces are unique whatever the rule."""
    counts = {
        "moving bodies": found.bodies,
        "joint freedoms": found.joint_freedoms,
        "kutzbach": found.kutzbach,
        "mobility": found.mobility,
        "constraint components": found.constraints,
        "their rank": found.constraint_rank,
        "overconstraints": found.overconstraints,
        "actuation redundancy": found.actuation_redundancy,
    }
    return {**counts, "unique forces": dict(zip(found.names, found.unique, strict=True))}


def _solve(
    scene: Scene,
    name: str,
    quantities: frozenset[str],
    expected: Mapping[str, tuple[str, ...]],
    folder: Path,
    progress: Report,
) -> Solution | Failure:
    """One engine. Whatever it raises becomes a row, so that the others go on.

    Args:
        expected: Component names that the description gives each quantity.
    """
    progress(name, 0.0)
    try:
        engine = load_engine(name)
        solution = replace(engine(_problem(scene, name, quantities, folder, progress)), engine=name)
        _check_answer(solution, len(scene.motion), expected)
    except Exception as error:
        return failed(scene, name, error, folder)
    return solution


def missing(error: ImportError, name: str = "it") -> str:
    """What to install for a module that could not be imported; `name` where the error has none."""
    package = (error.name or name).split(".")[0]
    return f"not installed ({error}); pip install {_PACKAGES.get(package, package)}"


def failed(scene: Scene, name: str, error: Exception, folder: Path) -> Failure:
    """The row of an engine that raised.

    Args:
        folder: Where the generated model files are.

    Raises:
        ScrewgaugeError: The error itself, if the user's own model file is bad input.
    """
    trace = "".join(traceback.format_exception(error))
    if isinstance(error, ImportError):
        return Failure(name, missing(error, name), trace)
    if name in scene.models and isinstance(error, DescriptionError | ModelFileError | UnknownNameError):
        raise error
    text = " ".join(str(error).split()).replace(f"{folder}/", "")  # generated files go with the folder
    return Failure(name, f"{type(error).__name__}: {text}", trace)


def _check_answer(solution: Solution, n: int, expected: Mapping[str, tuple[str, ...]]) -> None:
    """Refuses an answer with other samples or components than the description has."""
    for quantity, values in solution.values.items():
        if len(values.array) != n:
            raise ValueError(f"{len(values.array)} samples of {quantity} for {n} times")
        odd = [name for name in {*values.components} ^ {*expected.get(quantity, values.components)} if name]
        if odd:
            raise ModelFileError(
                f"its {quantity} and that of the description differ in '{min(odd)}'",
                f"model of {solution.engine}",
                "describe the same joints, bodies and actuators in the model, its loops file and the description",
            )


def _expected(mechanism: Mechanism, found: Mobility) -> dict[str, tuple[str, ...]]:
    """Component names by quantity; those of a tree are the engine's own."""
    table = component_names(
        mechanism.joints,
        [body.name for body in mechanism.bodies],
        mechanism.independent,
        (),
        mechanism.actuator_names,
        (found.names[: found.constraints], ()),
    )
    return {quantity: names for quantity, (names, _) in table.items() if not quantity.startswith("tree_force")}


def model_files(scene: Scene, name: str, folder: Path) -> tuple[Path, Path | None]:
    """The model file of an engine, generated in `folder` or the user's own, and its loops file."""
    own = scene.models.get(name)
    if name not in GENERATED:
        return own or scene.mechanism_file, None
    cut, ending = GENERATED[name]
    generated = stem(scene.mechanism.name, cut)
    model = own or folder / f"{generated}{ending}"
    beside = model.with_suffix(".loops.toml")
    return model, beside if beside.is_file() else folder / f"{generated}.loops.toml"


def _problem(scene: Scene, name: str, quantities: frozenset[str], folder: Path, progress: Report) -> OldProblem:
    model, loops = model_files(scene, name, folder)
    # a model file of one's own keeps its own gravity, if its format has one: that, too, is judged
    keeps_gravity = name in scene.models and name in GENERATED and GENERATED[name][1] == ".xml"
    return OldProblem(
        model=model,
        loops=loops,
        gravity=None if keeps_gravity else scene.gravity,
        loads=scene.loads,
        rule=scene.rule,
        motion=scene.motion,
        quantities=quantities,
        progress=lambda share: progress(name, share),
        wording=scene.wording(),
        springs=scene.springs,
        motors=scene.motors,
    )
