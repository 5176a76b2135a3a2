"""Runs a scene: every engine on its own model file, then comparison and judgement."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from pathlib import Path

import pandas as pd

from screwgauge.assemble import component_names
from screwgauge.compare import compare
from screwgauge.engines import GENERATED, check_engines, load_engine
from screwgauge.environment import environment
from screwgauge.judging.judge import COLUMNS, judge
from screwgauge.models.generate import stem, write_models
from screwgauge.preflight import check_actuation, check_scene
from screwgauge.quantities import check_quantities
from screwgauge.reference.errors import DescriptionError, ModelFileError, UnknownNameError
from screwgauge.reference.mechanism import Mechanism
from screwgauge.reference.mobility import Mobility
from screwgauge.refusals import refusals
from screwgauge.results import Results
from screwgauge.scene import Scene
from screwgauge.solution import Failure, Problem, Solution

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
) -> Results:
    """Drives the engines with a scene, compares all pairs and judges each.

    Args:
        engines: Names; those of the scene by default.
        quantities: Names; those of the scene by default. Nothing else is computed.
        progress: Called as work goes on.

    Raises:
        ScrewgaugeError: Bad input. An engine that fails is no error but a row of the results.
    """
    names = check_engines(scene.engines if engines is None else engines)
    wanted = check_quantities(scene.quantities if quantities is None else quantities)
    progress("preflight", 0.0)
    mobility = check_scene(scene)
    check_actuation(scene, mobility, wanted)
    expected = _expected(scene.mechanism, mobility)
    solutions: dict[str, Solution] = {}
    failures: dict[str, Failure] = {}
    with tempfile.TemporaryDirectory(prefix="screwgauge-") as folder:
        write_models(scene.mechanism, Path(folder), gravity=scene.gravity)
        for name in names:
            outcome = _solve(scene, name, frozenset(wanted), expected, Path(folder), progress)
            if isinstance(outcome, Solution):
                solutions[name] = outcome
            else:
                failures[name] = outcome
    progress("comparison", 0.0)
    refused = tuple(one for solution in solutions.values() for one in refusals(scene, solution))
    for one in refused:
        solution = solutions[one.engine]
        solutions[one.engine] = replace(solution, notes=(*solution.notes, one.sentence))
    errors, pairs = compare(scene, solutions, failures, mobility, refused)
    judged = [judge(scene, solution, refused=refused) for solution in solutions.values()]
    return Results(
        scene=scene,
        solutions=solutions,
        failures=failures,
        errors=errors,
        pairs=pairs,
        judge=pd.concat(judged, ignore_index=True) if judged else pd.DataFrame(columns=COLUMNS),
        mobility=_facts(mobility),
        environment=environment(),
        refusals=refused,
    )


def _facts(found: Mobility) -> dict[str, object]:
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
    except ImportError as error:
        package = (error.name or name).split(".")[0]
        return Failure(name, f"not installed ({error}); pip install {_PACKAGES.get(package, package)}")
    except Exception as error:
        if name in scene.models and isinstance(error, DescriptionError | ModelFileError | UnknownNameError):
            raise  # the user's own file is bad input
        text = " ".join(str(error).split()).replace(f"{folder}/", "")  # generated files go with the folder
        return Failure(name, f"{type(error).__name__}: {text}")
    return solution


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
    return {
        quantity: names for quantity, (names, _) in table.items() if not quantity.startswith("tree_force")
    }


def _problem(scene: Scene, name: str, quantities: frozenset[str], folder: Path, progress: Report) -> Problem:
    own = scene.models.get(name)
    model, loops, keeps_gravity = own or scene.mechanism_file, None, False
    if name in GENERATED:
        cut, ending = GENERATED[name]
        generated = stem(scene.mechanism.name, cut)
        model = own or folder / f"{generated}{ending}"
        beside = model.with_suffix(".loops.toml")
        loops = beside if beside.is_file() else folder / f"{generated}.loops.toml"
        # a model file of one's own keeps its own gravity, if its format has one: that, too, is judged
        keeps_gravity = own is not None and ending == ".xml"
    return Problem(
        model=model,
        loops=loops,
        gravity=None if keeps_gravity else scene.gravity,
        loads=scene.loads,
        rule=scene.rule,
        motion=scene.motion,
        quantities=quantities,
        progress=lambda share: progress(name, share),
        wording=scene.wording(),
    )
