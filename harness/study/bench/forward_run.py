"""A bench of a simulation: every contestant integrates the scene; its errors, energy and time become two rows."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from dataclasses import replace
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from time import time

import numpy as np

from screwgauge.environment import environment
from screwgauge.judging.answer import answer_at
from screwgauge.judging.residual import SizedResidual
from screwgauge.judging.residuals import energy_balance
from screwgauge.problem import Integration, Problem, Progress, Report, silent, spread
from screwgauge.processes import one_thread
from screwgauge.reference.errors import DescriptionError, check_choice
from screwgauge.reference.graph import Layout, layout
from screwgauge.scene.observables import known_values, observe
from screwgauge.scene.scene import Scene
from screwgauge.scene.simulation import EXPLICIT, check_start, stiff_warning, stiffness
from screwgauge.solution import REFERENCE, Cost, Failure, Solution
from screwgauge.study.bench.contestants import Contestant, simulators
from screwgauge.study.bench.run import BESIDE, Bench, Plan, check_generated, models_of
from screwgauge.study.bench.tables import CUT, FAILED, OK, BenchRow, Rule, fits, leaving_out_table
from screwgauge.study.comparison import provenance
from screwgauge.study.methods import Method
from screwgauge.study.reference_values import PreparedScene, Reference, deviation, score, sizes
from screwgauge.study.runner import Executor, Task, run_tasks
from screwgauge.study.solving import TooLongError, ask, generated, model_files, within

NAN = float("nan")
TIGHTEST = 1e-12  # tolerance of the solver where it is the reference
#: Below this [s] a contestant is measured again, `Plan.rounds` times in all, and the shortest time counts.
SHORT = 1.0
#: From one rung of a ladder to the next, at least so many times longer: what would take too long is not begun.
LONGER = 1.5
#: Orders where steps can show them: RK4's reach rounding before they are fine, MuJoCo's softness has a floor.
#: Observables may converge faster than that where errors average out over a period; the energy does not.
RULES = (Rule("pinocchio-Euler", "energy", 1.0),)


FULL = Plan(samples=41, rounds=3, budget=90.0, quick=False, each=45.0)
QUICK = Plan(samples=9, rounds=1, budget=25.0, quick=True, each=8.0, share=0.2)


def contest(
    scene: Scene,
    *,
    plan: Plan = FULL,
    contestants: Iterable[str] | None = None,
    progress: Report = silent,
    execute: Executor | None = None,
) -> Bench:
    """Measures errors, energy and run times of contestants on a simulated scene.

    Args:
        contestants: Families or engines; all by default.
        execute: Where families are measured, each from its coarsest setting on; by default in this process, the
            shortest first.

    Raises:
        ScrewgaugeError: Bad input. A contestant that fails is a row.
    """
    check_generated(scene)
    end, t = time() + plan.budget, scene.start.t
    if not scene.observables:
        raise DescriptionError("there is no observable to measure errors of", scene.name, "add [[observables]]")
    if plan.share < 1.0:
        t = t[t <= t[0] + plan.share * (t[-1] - t[0])]
    short = scene.at(t[spread(len(t), plan.samples)])
    lay, notes = check_start(short)
    if plan.share < 1.0:
        part = f"Only the first {plan.share:.0%} of the motion were integrated; published results are of all of it."
        notes = (*notes, part)
    chosen = _chosen(short, contestants, quick=plan.quick)
    slow = find_spec("llvmlite") is None and _stiff(short, lay)  # machine code takes very many steps in no time
    late = {f"screw-{name}" for name in EXPLICIT} if slow else set[str]()
    with generated(scene) as folder:
        progress(REFERENCE, 0.0)
        posed = simulated(short, folder)
        judged = provenance(short, models_of(chosen, posed))
        if execute is None:
            rows = _shortest_first(posed, plan, chosen, end, progress, late)
        else:
            rows = _by_family(posed, plan, chosen, end, execute, progress)
            notes = (*notes, BESIDE)
    names = list(dict.fromkeys(row.contestant.family for row in rows))
    rows.sort(key=lambda row: (row.contestant.method.engine != "screw", names.index(row.contestant.family)))
    return Bench(
        scene=short,
        plan=plan,
        rows=rows,
        # three points between saturation and rounding
        fits=[fit for fit in fits(rows, RULES) if np.isfinite(fit.slope)],
        leaving_out=leaving_out_table([]),
        reference=posed.reference.engine,
        notes=notes,
        environment={**environment(), "one_thread": one_thread()},
        provenance=judged,
    )


def _shortest_first(
    posed: PreparedScene,
    plan: Plan,
    chosen: Sequence[Contestant],
    end: float,
    progress: Report,
    late: Collection[str] = (),
) -> list[BenchRow]:
    """The rows of contestants, the shortest first, as foreseen from the last one of its family.

    Args:
        end: When nothing further begins [s since 1970].
        late: Families that are known to take very long: they come last.
    """
    rows, waiting = list[BenchRow](), [*chosen]
    while waiting:
        contestant = min(waiting, key=lambda one: (one.family in late, _foreseen(one, rows)))
        progress(contestant.family, 1.0 - len(waiting) / len(chosen))
        waiting.remove(contestant)
        rows += _turn(posed, plan, contestant, rows, end - time())
    return rows


def _by_family(
    posed: PreparedScene, plan: Plan, chosen: Sequence[Contestant], end: float, execute: Executor, progress: Report
) -> list[BenchRow]:
    """The rows of all contestants, family by family."""
    families: dict[str, list[Contestant]] = {}
    for contestant in chosen:
        families.setdefault(contestant.family, []).append(contestant)
    works = {name: partial(_of_family, posed, plan, some, end) for name, some in families.items()}
    rows: list[list[BenchRow]] = run_tasks(
        [Task(name, work, files=posed.written()) for name, work in works.items()],
        execute,
        lost=lambda name, reason: [row for one in families[name] for row in _lost(one, reason, FAILED)],
        progress=progress,
    )
    return [row for family in rows for row in family]


def _of_family(
    posed: PreparedScene, plan: Plan, family: Sequence[Contestant], end: float, progress: Progress
) -> list[BenchRow]:
    """The rows of a family as the work of a task."""
    return _shortest_first(posed, plan, family, end, silent)


def _lost(contestant: Contestant, reason: str, status: str = CUT) -> tuple[BenchRow, BenchRow]:
    """The rows of a contestant without numbers."""
    row = BenchRow("observable", reason=reason, contestant=contestant, status=status)
    return row, replace(row, quantity="energy")


def _stiff(scene: Scene, lay: Layout) -> bool:
    """Whether an explicit method would have to take very many steps."""
    start = scene.start
    fast = stiffness(lay, scene.applied, start)
    explicit = replace(start, integration=replace(start.integration, name=EXPLICIT[0]))
    return bool(stiff_warning(fast, explicit))


def _chosen(scene: Scene, names: Iterable[str] | None, *, quick: bool) -> list[Contestant]:
    start = scene.start
    everyone = simulators(start.integration.name, float(start.t[-1]) - start.since, quick=quick)
    if names is None:
        return everyone
    known = dict.fromkeys(name for c in everyone for name in (c.family, c.method.engine))
    wanted = check_choice("contestant", names, known, "--contestants")
    return [c for c in everyone if {c.family, c.method.engine} & set(wanted)]


def simulated(scene: Scene, folder: Path) -> PreparedScene:
    """A simulated scene ready for methods; its observables are measured.

    Args:
        folder: Where the generated model files are.

    Raises:
        ScrewgaugeError: There is no known solution, and the solver does not come to the end.
    """
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
                f"the motion stops early ({solution.stopped})", scene.name, "shorten it or give a [reference]"
            )
        known = observe(layout(scene.mechanism), scene.observables, solution.values["joint_position"].array)
    values = {"observable": known}
    return PreparedScene(scene, scene, folder, Reference.by_size(name, scene.mechanism, values))


def _foreseen(contestant: Contestant, before: Sequence[BenchRow]) -> float:
    """Estimated duration [s], from the previous setting of its family, or else the first of its engine."""
    same = [row for row in before if row.contestant.family == contestant.family]
    if not same:
        engine = contestant.method.engine
        ladders = [row for row in before if row.contestant.method.engine == engine and row.contestant.parameter is None]
        alike = [row.time_s for row in ladders if contestant.parameter is None and np.isfinite(row.time_s)]
        return max(alike[:1], default=0.0)
    last, longer = same[-1], LONGER
    if last.status == CUT:
        return np.inf
    if contestant.parameter and last.contestant.parameter:
        longer = last.contestant.parameter[1] / contestant.parameter[1]
    return last.time_s * longer if np.isfinite(last.time_s) else 0.0


def _turn(
    posed: PreparedScene, plan: Plan, contestant: Contestant, before: Sequence[BenchRow], left: float
) -> tuple[BenchRow, BenchRow]:
    """The rows of a contestant, unless the budget is spent or it would take too long anyway.

    Args:
        left: Of the budget [s].
    """
    if left <= 0.0:
        return _lost(contestant, "the budget was spent before its turn")
    known = any(row.contestant.family == contestant.family for row in before)
    if known and _foreseen(contestant, before) > plan.each:
        return _lost(contestant, f"the setting before tells that it would take more than {plan.each:g} s")
    trial, costs = contestant.ask(posed), list[Cost]()
    (problem,), most = trial.problems, min(plan.each, left)
    while True:
        try:
            with np.errstate(all="ignore"):
                answer = ask(contestant.method, trial.files, problem, within(most))
        except TooLongError as error:
            return _lost(contestant, str(error))
        if isinstance(answer, Failure):
            return _lost(contestant, answer.reason, FAILED)
        if answer.n_solved < 2:
            return _lost(contestant, f"stopped before the first sample: {answer.stopped}", FAILED)
        costs.append(answer.cost or Cost(NAN))
        if len(costs) >= plan.rounds or not costs[0].wall_s < SHORT:
            return _scored(posed, contestant, problem, answer, costs)


def _scored(
    posed: PreparedScene, contestant: Contestant, problem: Problem, solution: Solution, costs: Sequence[Cost]
) -> tuple[BenchRow, BenchRow]:
    """The rows of an answer up to where it stopped: error of the observables, and energy that is not accounted for.

    Args:
        costs: Of each integration; the shortest times count.
    """
    scene, m = posed.scene, solution.n_solved
    q, right = solution.values["joint_position"].array[:m], posed.reference.values["observable"].at(slice(m))
    off = deviation(observe(layout(scene.mechanism), scene.observables, q), right)
    error = score("observable", off, posed.reference.scales["observable"])
    balance = energy_balance(answer_at(scene.mechanism, problem, solution, np.arange(m)))
    energy = next(balance, SizedResidual("energy"))
    reason = solution.stopped or (f"only {m} of {len(scene.t)} samples" if m < len(scene.t) else error.reason)
    wall_s, cpu_s = np.min([(cost.wall_s, cost.cpu_s) for cost in costs], axis=0).tolist()
    cost, seconds = replace(costs[-1], wall_s=wall_s, cpu_s=cpu_s), (wall_s,) if np.isfinite(wall_s) else ()
    row = BenchRow(
        "observable",
        error=error.error,
        rms=error.rms,
        reason=reason,
        contestant=contestant,
        status=FAILED if reason else OK,
        n_sample=m,
        seconds=seconds,
        largest=sizes(off),
        cost=cost,
    )
    return row, replace(row, quantity="energy", error=energy.error, rms=NAN, largest={"J": energy.max_abs})
