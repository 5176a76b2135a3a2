"""Smoke tests: a few samples of a scene, engines that cover more terms than the default engines, and planted errors."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from screwgauge.engines.registry import ENGINES
from screwgauge.judging.allowance import Allowance
from screwgauge.judging.compare import compare
from screwgauge.reference.courses import same_times
from screwgauge.reference.errors import DescriptionError
from screwgauge.reference.mobility import Mobility
from screwgauge.scene.default import exciting
from screwgauge.scene.scene import Scene
from screwgauge.solution import Solution, Values
from screwgauge.study.comparison import Comparison, built_in
from screwgauge.study.gate.items import GateRow
from screwgauge.study.gate.measure import GateSettings, compare_scene

#: Samples of an exciting motion, out of 101, that a smoke test solves, and the amplitude of the motion [rad or
#: lengths]. Following the motion up to these samples takes most of the time.
SMOKE, LARGEST = np.arange(7, 22, 7), 0.25
#: Fraction of a simulation that a smoke test integrates.
BEGINNING = 1e-2
#: Quantity compared for full cuts, which depends on all loops and their motion; and the number of redundant actuators
#: that the rule `spherical_axial` needs.
OF_FULL_CUTS, AXIAL = "joint_acceleration", 2
#: Size of a planted difference as a multiple of its tolerance, and the relative accuracy with which it must be found.
PLANTED, EXACTLY = 4.0, 1e-3
TWIN = "planted"
#: Mobility with which all components are determined, used instead of the actual mobility.
_ALL_DETERMINED = Mobility(0, 0, 0, 0, 0, 0, 0, 0, (), (), ())


def smoke_row(scene: Scene, settings: GateSettings, progress: Callable[..., None]) -> GateRow:
    """Check a few samples of a scene; if they pass, test the comparison itself, then full cuts, Lagrange and truth."""
    scene, note = reduce_scene(scene)
    row, results = compare_scene(scene, settings, progress)
    row = replace(row, coverage=f"{note}{row.coverage}")
    if not row.ok:
        return row
    if unseen := find_blind_spot(results):
        return replace(row, status="failed", sentence=f"the comparison would miss a difference: {unseen}")
    others = {"full cuts": full_cuts, "second formulation": with_lagrange, "truth": with_truth}
    for what, other_of in others.items():
        if not row.ok or (other := other_of(scene)) is None:
            continue
        further, results = compare_scene(other, settings, progress, covered=False)
        names = ", ".join(results.scene.engines)
        said = f"{row.coverage} {what.capitalize()}: {_name_quantities(other, scene)} of {names}."
        row = replace(row, errors=(*row.errors, *further.errors), versions={**row.versions, **further.versions})
        row = replace(row, coverage=said)
        if not further.ok:
            row = replace(row, status=further.status, sentence=f"{what}: {further.sentence}")
    return row


def _name_quantities(other: Scene, scene: Scene) -> str:
    """Describe the quantities of a reduced copy of a scene."""
    left = [name for name in scene.quantities if name not in other.quantities]
    if len(left) > len(other.quantities):
        return " and ".join(other.quantities)
    return f"all but {' and '.join(left)}" if left else "all"


def reduce_scene(scene: Scene) -> tuple[Scene, str]:
    """Reduce a scene to a few samples; return it, and a sentence that describes the samples.

    The samples are taken from an exciting motion, or from the scene's own motion if the limits leave no room for an
    exciting motion. Simulations are shortened.
    """
    if scene.simulated:
        since = scene.start.since
        end = since + BEGINNING * (float(scene.t[-1]) - since)
        return scene.at([since, end]), f"The first {end - since:.3g} s. "
    try:
        moving = exciting(scene, samples=int(SMOKE[-1]) + 1, largest=LARGEST)
        return replace(moving, name=scene.name, task=moving.motion.part(SMOKE)), f"{len(SMOKE)} samples. "
    except DescriptionError as error:
        # samples of each table
        every = [same_times(scene.t, table.t)[0] for table in scene.tables.values()] or [np.arange(len(scene.t))]
        rows = np.unique([one[np.linspace(0, len(one) - 1, len(SMOKE)).astype(np.intp)] for one in every])
        return replace(
            scene, task=scene.motion.part(rows)
        ), f"{len(rows)} samples of the scene's own motion ({error.what}). "


def full_cuts(scene: Scene) -> Scene | None:
    """Copy a scene for comparing `screw` with the full cuts of its engines, all based on the description.

    No other test covers terms that occur only in a full cut, such as those of welded copies of moving bodies, or the
    rule `spherical_axial`, which is used if the mechanism permits it. Return None if there are no full cuts, if they
    run anyway, or if the scene has no given motion.
    """
    names = [name for name in (f"{engine}-full" for engine in scene.engines) if name in ENGINES]
    if scene.simulated or not names or {*names} <= {*scene.engines}:
        return None
    mechanism, rule, quantities = scene.mechanism, scene.rule, [OF_FULL_CUTS]
    if mechanism.axial and len(mechanism.actuators) == len(mechanism.independent) + AXIAL:
        rule, quantities = "spherical_axial", [OF_FULL_CUTS, "actuator_force"]
    other = replace(scene, engines=("screw", *names), quantities=tuple(quantities), models={}, tables={})
    return replace(other, rule=rule)


def with_lagrange(scene: Scene) -> Scene | None:
    """Reduce a built-in scene to `screw` and the independent formulation `lagrange`, and to the quantities of both.

    Return None if `lagrange` runs anyway, or does not support the scene. Users can request `lagrange` in their own
    scenes.
    """
    quantities = tuple(name for name in scene.quantities if name not in ENGINES["lagrange"].lacks)
    if not (_built_in_for("lagrange", scene) and quantities):
        return None
    return replace(scene, engines=("screw", "lagrange"), quantities=quantities, models={}, tables={})


def _built_in_for(engine: str, scene: Scene) -> bool:
    """Return True if a scene is built in, has a given motion, and does not yet use the engine, which is installed."""
    known = scene.file is not None and built_in(scene.file)
    return known and not scene.simulated and engine not in scene.engines and ENGINES[engine].installed


def with_truth(scene: Scene) -> Scene | None:
    """Reduce a built-in scene to one sample for `screw` and `truth`, without springs and motors, which truth refuses.

    `truth` reads exact strings from scenes with loads, and doubles from other scenes, so that the smoke test covers
    both. Return None if `truth` runs anyway, is not installed, or does not support the scene. Users can request `truth`
    in their own scenes.
    """
    if not _built_in_for("truth", scene):
        return None
    some, applied = scene.motion.part(np.array([-1])), replace(scene.applied, springs=(), motors=())
    other = replace(scene, engines=("screw", "truth"), task=some, applied=applied, models={}, tables={})
    return other if applied.loads else replace(other, text={})


def find_blind_spot(results: Comparison) -> str:
    """Plant differences, and report the first difference that the comparison misses or quantifies wrongly.

    An answer is compared with a copy in which one value of each quantity and unit has a known error.

    Returns:
        A sentence; empty if every planted difference is found with the correct size.
    """
    scene, answer = results.scene, next(iter(results.solutions.values()), None)
    if answer is None:
        return ""
    first = replace(answer, errors={})
    twin, planted = _plant_errors(first, scene)
    both, problem = {one.engine: one for one in (first, twin)}, scene.problem(tuple(first.values))
    pairs = compare(scene.mechanism, problem, both, {}, _ALL_DETERMINED, Allowance(scene.tolerance))[1]
    records = pairs.to_dict("records")
    for (quantity, unit), size in planted.items():
        rows = [row for row in records if (row["quantity"], row["unit"]) == (quantity, unit)]
        what = f"{quantity} [{unit}]: a planted scaled difference of {size:.3g}"
        if len(rows) != 1:
            return f"{what} was not compared"
        (row,) = rows
        if not abs(row["max_scaled"] - size) <= EXACTLY * size:
            return f"{what} was found as {row['max_scaled']:.3g}"
        if row["ok"]:
            return f"{what} passes a tolerance of {scene.tolerance(quantity):.3g}"
    return ""


def _plant_errors(solution: Solution, scene: Scene) -> tuple[Solution, dict[tuple[str, str], float]]:
    """Return a copy of an answer with planted errors, and the scaled size of the error for each quantity and unit.

    Quantities that are zero throughout or not finite remain unchanged, because they have no scale.
    """
    changed, planted = dict[str, Values](), dict[tuple[str, str], float]()
    for quantity, values in solution.values.items():
        array = values.array.copy()
        for unit in dict.fromkeys(values.units):
            of = [i for i, one in enumerate(values.units) if one == unit]
            largest = float(np.abs(array[:, of]).max(initial=0.0))
            if not 1e-3 < largest < np.inf:
                continue
            row, column = np.unravel_index(np.argmax(np.abs(array[:, of])), (len(array), len(of)))
            size = planted[quantity, unit] = PLANTED * scene.tolerance(quantity)
            array[row, of[column]] -= np.sign(array[row, of[column]]) * size * largest
        changed[quantity] = Values(values.components, values.units, array)
    return replace(solution, engine=TWIN, values=changed), planted
