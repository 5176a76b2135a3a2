"""One rung of inverse dynamics: engines on a scene, each against the truth or, where there is none, the judge."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from importlib.util import find_spec

import numpy as np

from screwgauge.judging.compare import reference_scale
from screwgauge.judging.judge import judge
from screwgauge.judging.refusals import refusals
from screwgauge.problem import Motion
from screwgauge.quantities import QUANTITIES as KNOWN
from screwgauge.quantities import natural_scales
from screwgauge.reference.rotations import Array
from screwgauge.scene.scene import Scene
from screwgauge.solution import Failure, Solution
from screwgauge.study.run import solve
from screwgauge.study.stress.case import GOOD, SILENT, Finding

ENGINES = ("screw", "pinocchio", "mujoco")
QUANTITIES = ("joint_acceleration", "com_acceleration", "generalized_force", "actuator_force", "reaction")
#: What the judge needs.
JUDGED = tuple(name for name in KNOWN if not name.startswith("tree_force"))


def still(scene: Scene, y: Array, yd: Array | None = None, ydd: Array | None = None) -> Scene:
    """The scene at given states, the same doubles for every engine, one second apart.

    Args:
        y, yd, ydd: Independent coordinates and derivatives; zero by default. Shape (n, k).
    """
    zero = np.zeros_like(y)
    motion = Motion(np.arange(len(y), dtype=float), y.copy(), zero if yd is None else yd, zero if ydd is None else ydd)
    return replace(scene, motion=motion)


def measure(
    scene: Scene,
    *,
    engines: Sequence[str] = ENGINES,
    quantities: Sequence[str] = QUANTITIES,
    setting: str = "",
    cause: str = "",
) -> Iterator[Finding]:
    """What each engine makes of a scene: one finding for every quantity that has a truth.

    Where the truth cannot be had, the largest residual of the judge stands for all quantities.

    Args:
        setting: Follows the name of every engine.
        cause: Why an engine other than ours is wrong where it says nothing.
    """
    wanted = (*engines, "truth") if find_spec("flint") else tuple(engines)
    solutions, failures = solve(scene, wanted, quantities)
    truth = solutions.pop("truth", None)
    if truth is None or truth.rows is not None:  # the samples that it left out are the ones that matter
        solutions, failures = solve(scene, engines, JUDGED)
        truth = None
    for name in engines:
        found: Iterable[Finding]
        if name in failures:
            found = (_refused(failures[name], quantity) for quantity in quantities)
        elif truth is None:
            found = (_judged(scene, solutions[name]),)
        else:
            why = {
                q: one.what
                for one in refusals(scene.mechanism, scene.problem(quantities), solutions[name])
                for q in one.quantities
            }
            found = (
                replace(found, reason=why.get(found.quantity, found.reason))
                for found in (compared(scene, solutions[name], truth, quantity) for quantity in quantities)
            )
        for finding in found:
            silent = finding.verdict == SILENT and name != "screw"
            reason = "; ".join(filter(None, (cause if silent else "", finding.reason)))
            yield replace(finding, engine=f"{name} {setting}".strip(), reason=reason)


def _refused(failure: Failure, quantity: str) -> Finding:
    return Finding(failure.engine, quantity, reason=failure.reason)


def _judged(scene: Scene, solution: Solution) -> Finding:
    table = judge(scene.mechanism, scene.problem(JUDGED), solution)
    worst = float(table["max_scaled"].max(skipna=False))
    estimates = [_admitted(solution, quantity) for quantity in solution.estimate]
    return Finding(
        solution.engine,
        "judge",
        worst,
        max([GOOD, *estimates]),
        float(np.nanmax(solution.condition)),
        _time(solution),
        "largest residual of the judge: no truth could be had",
    )


def compared(scene: Scene, solution: Solution, truth: Solution, quantity: str) -> Finding:
    """The largest scaled error of one quantity, over units, components and samples, and what the guard admits."""
    mine, right = solution.values[quantity], truth.values[quantity]
    natural = natural_scales(scene.mechanism)
    error = 0.0
    for unit in dict.fromkeys(right.units):
        columns = [i for i, u in enumerate(right.units) if u == unit]
        difference = np.abs(mine.array[:, columns] - right.array[:, columns]).max(initial=0.0)
        error = max(error, difference / reference_scale(right, unit, natural[unit]), key=_nan_last)
    estimate = _admitted(solution, quantity)
    flag = ""
    if np.isinf(estimate):
        flag = "the guard says that not one digit may be right"
    elif estimate > GOOD:
        flag = f"the guard admits {estimate:.0e}"
    reason = flag if np.isfinite(error) else "; ".join(solution.notes) or flag
    return Finding(
        solution.engine,
        quantity,
        error,
        max(GOOD, estimate),
        float(np.max(solution.condition)),
        _time(solution),
        reason,
    )


def _admitted(solution: Solution, quantity: str) -> float:
    """Largest error that the guard estimates for a quantity; what cannot be estimated may be anything."""
    if quantity not in solution.estimate:
        return 0.0
    return float(np.nan_to_num(solution.estimate[quantity], nan=np.inf, posinf=np.inf).max(initial=0.0))


def _nan_last(value: float) -> float:
    return np.inf if np.isnan(value) else value


def _time(solution: Solution) -> float:
    return sum(timing.min_s for timing in solution.timings)
