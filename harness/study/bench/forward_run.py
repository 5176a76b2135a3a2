"""Benches of simulations: each contestant integrates the scene, which yields a row of errors and a row of energy."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from screwgauge.judging.answer import answer_at
from screwgauge.judging.residual import SizedResidual
from screwgauge.judging.residuals import energy_balance
from screwgauge.problem import Integration, Problem, Report, spread
from screwgauge.reference.errors import DescriptionError, check_choice
from screwgauge.reference.graph import layout
from screwgauge.scene.observables import known_values, observe
from screwgauge.scene.scene import Scene
from screwgauge.scene.simulation import EXPLICIT, check_start, stiff_warning, stiffness
from screwgauge.solution import Cost, Failure, Solution
from screwgauge.study.bench.contestants import Contestant, simulators
from screwgauge.study.bench.tables import CUT, FAILED, OK
from screwgauge.study.bench.timing import Plan
from screwgauge.study.methods import Method
from screwgauge.study.reference_values import PreparedScene, Reference, deviation, score, sizes
from screwgauge.study.solving import TooLongError, ask, model_files, time_limit, write_scene_models
from screwgauge.study.store import Journal

NAN = float("nan")
TIGHTEST = 1e-12  # tolerance of `screw` as the reference
#: Duration [s] below which a contestant is measured up to `Plan.rounds` times; the shortest time counts.
SHORT = 1.0
#: Smallest assumed ratio of the durations of consecutive settings, to predict settings that would take too long.
LONGER = 1.5
FULL = Plan(samples=41, rounds=3, budget=90.0, quick=False, each=45.0)
QUICK = Plan(samples=9, rounds=1, budget=25.0, quick=True, each=8.0, share=0.2)


def shorten_motion(scene: Scene, plan: Plan) -> tuple[Scene, Sequence[str]]:
    """Return a simulated scene at the times of comparison, with notes on its start.

    Raises:
        ScrewgaugeError: The scene has no observable, or cannot start.
    """
    t = scene.start.t
    if not scene.observables:
        raise DescriptionError(
            "the scene has no observable, so there are no errors to measure", scene.name, "add [[observables]]"
        )
    if plan.share < 1.0:
        t = t[t <= t[0] + plan.share * (t[-1] - t[0])]
    short = scene.at(t[spread(len(t), plan.samples)])
    _, notes = check_start(short)
    if plan.share < 1.0:
        part = (
            f"Only the first {plan.share:.0%} of the motion was integrated; published results are for the whole motion."
        )
        notes = (*notes, part)
    return short, notes


def choose(scene: Scene, names: Iterable[str] | None, *, quick: bool) -> list[Contestant]:
    """Return the contestants of the given families and engines, by default all."""
    start = scene.start
    everyone = simulators(start.integration.name, float(start.t[-1]) - start.since, quick=quick)
    if names is None:
        return everyone
    known = dict.fromkeys(name for one in everyone for name in (one.family, one.method.engine))
    wanted = check_choice("contestant", names, known, "--contestants")
    return [one for one in everyone if {one.family, one.method.engine} & set(wanted)]


def measure(
    posed: PreparedScene,
    plan: Plan,
    chosen: Sequence[Contestant],
    kept: Journal,
    progress: Report,
) -> None:
    """Measure contestants within the budget, in the order of their expected durations."""
    took, waiting = dict[Contestant, float](), [*chosen]
    late = {f"screw-{name}" for name in EXPLICIT} if _is_slow(posed.scene) else set[str]()
    while waiting and not plan.over:
        contestant = min(waiting, key=lambda one: (one.family in late, _expected_duration(one, took)))
        progress(contestant.family, 1.0 - len(waiting) / len(chosen))
        waiting.remove(contestant)
        result = _result(posed, plan, contestant, _expected_duration(contestant, took), plan.left)
        seconds = result["cost"].wall_s if "cost" in result else np.nan
        took[contestant] = np.inf if result["status"] == CUT else seconds
        kept.keep(contestant.key, result)
        if np.isfinite(seconds):
            kept.time(contestant.key, seconds)


def _is_slow(scene: Scene) -> bool:
    """Return True if an explicit method needs so many steps for stability that it is slow without compiled code."""
    if find_spec("llvmlite") is not None:
        return False
    start = scene.start
    fast = stiffness(layout(scene.mechanism), scene.applied, start)
    explicit = replace(start, integration=replace(start.integration, name=EXPLICIT[0]))
    return bool(stiff_warning(fast, explicit))


def pose_simulation(scene: Scene, folder: Path) -> PreparedScene:
    """Prepare a simulated scene for methods that are compared by its observables.

    Args:
        folder: Folder for the model files.

    Raises:
        ScrewgaugeError: The scene lacks a known solution, and the solver stops early.
    """
    write_scene_models(scene, folder)
    if scene.known is not None:
        name = f"the known solution ({scene.known.source})"
        known = known_values(scene.known, scene.observables, scene.t, scene.name)[0]
    else:
        method = scene.start.integration
        name = f"screw with {method.name}, rtol = atol = {TIGHTEST:.0e}"
        task = replace(scene.start, integration=Integration(method.name, TIGHTEST, TIGHTEST, method.near))
        problem = Problem(scene.applied, task, frozenset(("joint_position",)))
        solution = Method("screw").load(model_files(scene, "screw", folder)).solve(problem)
        if solution.stopped:
            raise DescriptionError(
                f"the motion stops early ({solution.stopped})", scene.name, "shorten the motion or add a [reference]"
            )
        known = observe(layout(scene.mechanism), scene.observables, solution.values["joint_position"].array)
    values = {"observable": known}
    return PreparedScene(scene, scene, folder, Reference.by_size(name, scene.mechanism, values))


def _expected_duration(contestant: Contestant, took: Mapping[Contestant, float]) -> float:
    """Estimate a duration [s] from the previous setting of a family, or else from the first setting of its engine.

    Args:
        took: Durations of earlier contestants [s]; infinite if cut short, NaN if failed.
    """
    same = [one for one in took if one.family == contestant.family]
    if not same:
        engine = contestant.method.engine
        ladders = [took[one] for one in took if one.method.engine == engine and one.parameter is None]
        return max([seconds for seconds in ladders if np.isfinite(seconds)][:1], default=0.0)
    last, longer = same[-1], LONGER
    if contestant.parameter and last.parameter:
        longer = last.parameter[1] / contestant.parameter[1]
    return 0.0 if np.isnan(took[last]) else took[last] * longer


def _result(posed: PreparedScene, plan: Plan, contestant: Contestant, foreseen: float, left: float) -> dict[str, Any]:
    """Return scores and cost of a contestant, or the reason why it has no answer.

    Args:
        foreseen: Expected duration [s].
        left: Remaining budget [s].
    """
    if foreseen > plan.each:
        reason = f"the previous setting predicts that it would take more than {plan.each:g} s"
        return {"status": CUT, "reason": reason}
    trial, costs = contestant.ask(posed), list[Cost]()
    (problem,), most = trial.problems, min(plan.each, left)
    while True:
        try:
            with np.errstate(all="ignore"):
                answer = ask(contestant.method, trial.files, problem, time_limit(most))
        except TooLongError as error:
            return {"status": CUT, "reason": str(error)}
        if isinstance(answer, Failure):
            return {"status": FAILED, "reason": answer.reason}
        if answer.n_solved < 2:
            return {"status": FAILED, "reason": f"stopped before the first sample: {answer.stopped}"}
        costs.append(answer.cost or Cost(NAN))
        if len(costs) >= plan.rounds or not costs[0].wall_s < SHORT:
            break
    wall_s, cpu_s = np.min([(cost.wall_s, cost.cpu_s) for cost in costs], axis=0).tolist()
    return {**_scores(posed, problem, answer), "cost": replace(costs[-1], wall_s=wall_s, cpu_s=cpu_s)}


def _scores(posed: PreparedScene, problem: Problem, solution: Solution) -> dict[str, Any]:
    """Return the errors of the observables and of the energy balance, up to the end of an answer."""
    scene, m = posed.scene, solution.n_solved
    q, right = solution.values["joint_position"].array[:m], posed.reference.values["observable"].at(slice(m))
    off = deviation(observe(layout(scene.mechanism), scene.observables, q), right)
    error = score("observable", off, posed.reference.scales["observable"])
    balance = energy_balance(answer_at(scene.mechanism, problem, solution, np.arange(m)))
    energy = next(balance, SizedResidual("energy"))
    reason = solution.stopped or (f"only {m} of {len(scene.t)} samples" if m < len(scene.t) else error.reason)
    scores = {"observable": (error.error, error.rms, reason), "energy": (energy.error, NAN, reason)}
    largest = {"observable": sizes(off), "energy": {"J": energy.max_abs}}
    return {"status": OK, "n_sample": m, "scores": scores, "largest": largest}
