"""What a smoke test looks at: little of a scene's motion, the full cuts once, and whether the comparison can fail."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from screwgauge.engines.registry import ENGINES
from screwgauge.judging.compare import compare
from screwgauge.reference.errors import DescriptionError
from screwgauge.reference.mobility import Mobility
from screwgauge.scene.default import exciting
from screwgauge.scene.motion import same_times
from screwgauge.scene.scene import Scene
from screwgauge.solution import Solution, Values
from screwgauge.study.comparison import Comparison

#: Samples of an exciting motion, out of 101, that a smoke test looks at, and how large that is [rad or lengths]: what
#: takes time is the way there.
SMOKE, LARGEST = np.arange(7, 22, 7), 0.25
#: Share of its duration that a smoke test integrates of a simulation.
BEGINNING = 1e-2
#: Compared of the full cuts: what all loops, and how they move, come into.
OF_FULL_CUTS = "joint_acceleration"
#: A planted difference as a multiple of its tolerance, and how exactly the comparison has to say how large it is.
PLANTED, EXACTLY = 4.0, 1e-3
TWIN = "planted"
#: Stands for that of the mechanism: no component is left open.
_ALL_DETERMINED = Mobility(0, 0, 0, 0, 0, 0, 0, 0, (), (), ())


def smoked(scene: Scene) -> tuple[Scene, str]:
    """A scene of which little is looked at, and what that is.

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
    """The same scene for `screw` and the full cuts of its engines, all on the description, and one quantity.

    Terms that only a full cut has, such as those of welded copies of moving bodies, are seen by nothing else. None
    where there are none, or they run anyway, or nothing is given that they could solve.
    """
    names = [name for name in (f"{engine}-full" for engine in scene.engines) if name in ENGINES]
    if scene.simulated or not names or {*names} <= {*scene.engines}:
        return None
    return replace(scene, engines=("screw", *names), quantities=(OF_FULL_CUTS,), models={}, tables={})


def blind(results: Comparison) -> str:
    """Why a comparison that finds nothing would say nothing: a planted difference that it does not see as it is.

    An answer is compared with a copy in which one number of each quantity and unit is off by a known amount.

    Returns:
        A sentence; empty if every planted difference is seen, and its size is right.
    """
    scene = results.scene
    for quantity, unit, first, second, size in _planted(next(iter(results.solutions.values()), None), scene):
        both, problem = {one.engine: one for one in (first, second)}, scene.problem((quantity,))
        pairs = compare(scene.mechanism, problem, both, {}, _ALL_DETERMINED, scene.tolerance)[1]
        found = [row for row in pairs.to_dict("records") if row["unit"] == unit]
        what = f"{quantity} [{unit}]: a planted difference of {size:.3g} scaled"
        if len(found) != 1:
            return f"{what} was not compared"
        (row,) = found
        if not abs(row["max_scaled"] - size) <= EXACTLY * size:
            return f"{what} was compared as {row['max_scaled']:.3g}"
        if row["ok"]:
            return f"{what} passes a tolerance of {scene.tolerance(quantity):.3g}"
    return ""


def _planted(solution: Solution | None, scene: Scene) -> Iterator[tuple[str, str, Solution, Solution, float]]:
    """Quantity and unit, an answer with that quantity alone, its copy with a number that is off, and by how much.

    What is zero throughout, or not a number, is no measure of anything and left out.
    """
    if solution is None:
        return
    for quantity, values in solution.values.items():
        for unit in dict.fromkeys(values.units):
            array, of = values.array.copy(), [i for i, one in enumerate(values.units) if one == unit]
            largest = float(np.abs(array[:, of]).max(initial=0.0))
            if not 1e-3 < largest < np.inf:
                continue
            row, column = np.unravel_index(np.argmax(np.abs(array[:, of])), (len(array), len(of)))
            size = PLANTED * scene.tolerance(quantity)
            array[row, of[column]] -= np.sign(array[row, of[column]]) * size * largest
            other = Values(values.components, values.units, array)
            first = replace(solution, values={quantity: values}, tolerances={}, stated={}, radius={}, estimate={})
            yield quantity, unit, first, replace(first, engine=TWIN, values={quantity: other}), size
