"""Smoke tests: a few samples of a scene, by engines that see more than the usual ones, and a planted difference."""

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
from screwgauge.study.gate.measure import GateSettings, compared

#: Samples of an exciting motion, out of 101, that a smoke test looks at, and how large that is [rad or lengths]: what
#: takes time is the way there.
SMOKE, LARGEST = np.arange(7, 22, 7), 0.25
#: Share of its duration that a smoke test integrates of a simulation.
BEGINNING = 1e-2
#: Compared of the full cuts: what all loops, and how they move, come into; and redundant actuators of the rule
#: `spherical_axial`.
OF_FULL_CUTS, AXIAL = "joint_acceleration", 2
#: A planted difference as a multiple of its tolerance, and how exactly the comparison has to say how large it is.
PLANTED, EXACTLY = 4.0, 1e-3
TWIN = "planted"
#: Stands for that of the mechanism: no component is left open.
_ALL_DETERMINED = Mobility(0, 0, 0, 0, 0, 0, 0, 0, (), (), ())


def smoke_row(scene: Scene, settings: GateSettings, progress: Callable[..., None]) -> GateRow:
    """A few samples of a scene; if they pass, a test of the comparison itself, then full cuts, Lagrange and truth."""
    scene, note = smoked(scene)
    row, results = compared(scene, settings, progress)
    row = replace(row, coverage=f"{note}{row.coverage}")
    if not row.ok:
        return row
    if unseen := blind(results):
        return replace(row, status="failed", sentence=f"the comparison would see no difference: {unseen}")
    others = {"full cuts": full_cuts, "second formulation": with_lagrange, "truth": with_truth}
    for what, other_of in others.items():
        if not row.ok or (other := other_of(scene)) is None:
            continue
        further, results = compared(other, settings, progress, covered=False)
        said = f"{row.coverage} {what.capitalize()}: {_asked(other, scene)} of {', '.join(results.scene.engines)}."
        row = replace(row, errors=(*row.errors, *further.errors), versions={**row.versions, **further.versions})
        row = replace(row, coverage=said)
        if not further.ok:
            row = replace(row, status=further.status, sentence=f"of the {what}: {further.sentence}")
    return row


def _asked(other: Scene, scene: Scene) -> str:
    """Quantities of a copy of a scene, in words."""
    left = [name for name in scene.quantities if name not in other.quantities]
    if len(left) > len(other.quantities):
        return " and ".join(other.quantities)
    return f"all but {' and '.join(left)}" if left else "all"


def smoked(scene: Scene) -> tuple[Scene, str]:
    """A scene with a few samples, and a sentence on them.

    A few samples of an exciting motion; of its own where there is no room for one; the beginning of a simulation.
    """
    if scene.simulated:
        since = scene.start.since
        end = since + BEGINNING * (float(scene.t[-1]) - since)
        return scene.at([since, end]), f"The first {end - since:.3g} s. "
    try:
        moving = exciting(scene, samples=int(SMOKE[-1]) + 1, largest=LARGEST)
        return replace(moving, name=scene.name, task=moving.motion.part(SMOKE)), f"{len(SMOKE)} samples. "
    except DescriptionError as error:
        # of the times that each table has
        every = [same_times(scene.t, table.t)[0] for table in scene.tables.values()] or [np.arange(len(scene.t))]
        rows = np.unique([one[np.linspace(0, len(one) - 1, len(SMOKE)).astype(np.intp)] for one in every])
        return replace(scene, task=scene.motion.part(rows)), f"{len(rows)} samples of its own motion ({error.what}). "


def full_cuts(scene: Scene) -> Scene | None:
    """A copy of a scene for `screw` and its engines' full cuts, all on the description, and one quantity.

    Terms that only a full cut has, such as those of welded copies of moving bodies, are seen by nothing else; and so is
    the rule `spherical_axial`, where the mechanism can have it and the scene has another. None where there are no full
    cuts, or they run anyway, or nothing is given that they could solve.
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
    """A built-in scene for `screw` and `lagrange`, whose formulation shares nothing, and all that this one gives.

    None where `lagrange` runs anyway, or takes no such scene. A user's scene names it where it is wanted.
    """
    quantities = tuple(name for name in scene.quantities if name not in ENGINES["lagrange"].lacks)
    if not (_built_in_for("lagrange", scene) and quantities):
        return None
    return replace(scene, engines=("screw", "lagrange"), quantities=quantities, models={}, tables={})


def _built_in_for(engine: str, scene: Scene) -> bool:
    """True for a given motion of a built-in scene that an engine has not taken part in yet."""
    known = scene.file is not None and built_in(scene.file)
    return known and not scene.simulated and engine not in scene.engines and ENGINES[engine].installed


def with_truth(scene: Scene) -> Scene | None:
    """Reduce a built-in scene to one sample for `screw` and `truth`, without springs and motors, which truth refuses.

    Truth reads the text of the scene where loads act, else doubles: both ways are to be seen. None where truth runs
    anyway, is not installed, or takes no such scene. A user's scene names `truth` where it is wanted.
    """
    if not _built_in_for("truth", scene):
        return None
    some, applied = scene.motion.part(np.array([-1])), replace(scene.applied, springs=(), motors=())
    other = replace(scene, engines=("screw", "truth"), task=some, applied=applied, models={}, tables={})
    return other if applied.loads else replace(other, text={})


def blind(results: Comparison) -> str:
    """Why a comparison without differences would mean nothing: a planted difference that it misses or missizes.

    An answer is compared with a copy in which one number of each quantity and unit is off by a known amount.

    Returns:
        A sentence; empty if every planted difference is seen, and its size is right.
    """
    scene, answer = results.scene, next(iter(results.solutions.values()), None)
    if answer is None:
        return ""
    first = replace(answer, errors={})
    twin, planted = _planted(first, scene)
    both, problem = {one.engine: one for one in (first, twin)}, scene.problem(tuple(first.values))
    pairs = compare(scene.mechanism, problem, both, {}, _ALL_DETERMINED, Allowance(scene.tolerance))[1]
    records = pairs.to_dict("records")
    for (quantity, unit), size in planted.items():
        rows = [row for row in records if (row["quantity"], row["unit"]) == (quantity, unit)]
        what = f"{quantity} [{unit}]: a planted difference of {size:.3g} scaled"
        if len(rows) != 1:
            return f"{what} was not compared"
        (row,) = rows
        if not abs(row["max_scaled"] - size) <= EXACTLY * size:
            return f"{what} was compared as {row['max_scaled']:.3g}"
        if row["ok"]:
            return f"{what} passes a tolerance of {scene.tolerance(quantity):.3g}"
    return ""


def _planted(solution: Solution, scene: Scene) -> tuple[Solution, dict[tuple[str, str], float]]:
    """A copy of an answer in which numbers are off; and by how much, scaled, of each quantity and unit.

    What is zero throughout, or not a number, is no measure of anything and left out.
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
