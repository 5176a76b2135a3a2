"""A bench of a simulation: every contestant integrates the scene; its errors, energy and time become a row."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from time import perf_counter

import numpy as np

from screwgauge.environment import environment
from screwgauge.reference.errors import DescriptionError, check_choice
from screwgauge.reference.forward import forces_at
from screwgauge.reference.pose import Layout
from screwgauge.scene.scene import Scene
from screwgauge.scene.simulation import EXPLICIT, check_start, stiff_warning, stiffness
from screwgauge.solution import REFERENCE, Failure
from screwgauge.study.ask import Report, TooLongError, ask, generated, silent, within
from screwgauge.study.bench.contestant import Contestant
from screwgauge.study.bench.forward_contestants import contestants as all_contestants
from screwgauge.study.bench.forward_score import Outcome, outcome, simulated
from screwgauge.study.bench.leaving_out import table as leaving_out
from screwgauge.study.bench.rows import CUT, FAILED
from screwgauge.study.bench.run import Bench, Plan, check_generated, models_of
from screwgauge.study.bench.slopes import Rule, fits
from screwgauge.study.bench.threads import one_thread
from screwgauge.study.posed import Posed, compared_rows
from screwgauge.study.provenance import provenance

#: Below this [s] a contestant is measured again, `Plan.rounds` times in all, and the shortest time counts.
SHORT = 1.0
#: From one rung of a ladder to the next, at least so many times longer: what would take too long is not begun.
LONGER = 1.5
#: Of what has not run yet [s]: screw runs under Python throughout.
FIRST = {"screw": 2.0}
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
) -> Bench:
    """Measures errors, energy and run times of contestants on a simulated scene.

    Args:
        contestants: Families or engines; all by default.

    Raises:
        ScrewgaugeError: Bad input. A contestant that fails is a row.
    """
    check_generated(scene)
    begin, t = perf_counter(), scene.start.t
    if not scene.observables:
        raise DescriptionError("there is no observable to measure errors of", scene.name, "add [[observables]]")
    if plan.share < 1.0:
        t = t[t <= t[0] + plan.share * (t[-1] - t[0])]
    short = scene.at(t[compared_rows(len(t), plan.samples)])
    lay, notes = check_start(short)
    if plan.share < 1.0:
        part = f"Only the first {plan.share:.0%} of the motion were integrated; published results are of all of it."
        notes = (*notes, part)
    stiff = _stiff(short, lay)
    waiting = _chosen(short, contestants, stiff=stiff, quick=plan.quick)
    late = {f"screw-{name}" for name in EXPLICIT} if stiff else set[str]()
    outcomes: list[Outcome] = []
    with generated(scene) as folder:
        progress(REFERENCE, 0.0)
        posed, n = simulated(short, folder), len(waiting)
        judged = provenance(short, models_of(waiting, posed))
        while waiting:
            # the shortest first, as far as the family's last one tells; what is known to take very long comes last
            contestant = min(waiting, key=lambda one: (one.family in late, _foreseen(one, outcomes)))
            waiting.remove(contestant)
            progress(contestant.family, 1.0 - (len(waiting) + 1) / n)
            outcomes.append(_turn(posed, plan, contestant, outcomes, plan.budget - perf_counter() + begin))
    names = list(dict.fromkeys(o.contestant.family for o in outcomes))
    outcomes.sort(key=lambda o: (o.contestant.method.engine != "screw", names.index(o.contestant.family)))
    rows = [row for outcome in outcomes for row in outcome.rows]
    return Bench(
        scene=short,
        plan=plan,
        rows=rows,
        outcomes=outcomes,
        # three points between saturation and rounding
        fits=[fit for fit in fits(rows, RULES) if np.isfinite(fit.slope)],
        leaving_out=leaving_out([]),
        reference=posed.reference.engine,
        notes=notes,
        environment={**environment(), "one_thread": one_thread()},
        provenance=judged,
    )


def _stiff(scene: Scene, lay: Layout) -> bool:
    """Whether an explicit method would have to take very many steps."""
    start = scene.start
    fast = stiffness(lay, forces_at(scene.mechanism, scene.applied, start.since), start)
    explicit = replace(start, integration=replace(start.integration, name=EXPLICIT[0]))
    return bool(stiff_warning(fast, explicit))


def _chosen(scene: Scene, names: Iterable[str] | None, *, stiff: bool, quick: bool) -> list[Contestant]:
    start = scene.start
    everyone = all_contestants(start.integration.name, float(start.t[-1]) - start.since, stiff=stiff, quick=quick)
    if names is None:
        return everyone
    known = dict.fromkeys(name for c in everyone for name in (c.family, c.method.engine))
    wanted = check_choice("contestant", names, known, "--contestants")
    return [c for c in everyone if {c.family, c.method.engine} & set(wanted)]


def _foreseen(contestant: Contestant, before: Sequence[Outcome]) -> float:
    """How long it will last [s]: from the setting before it of its family, or the first of its engine."""
    same = [o for o in before if o.contestant.family == contestant.family]
    if not same:
        engine = contestant.method.engine
        ladders = [o for o in before if o.contestant.method.engine == engine and o.contestant.parameter is None]
        alike = [o.wall for o in ladders if contestant.parameter is None and np.isfinite(o.wall)]
        return max([FIRST.get(engine, 0.0), *alike[:1]])
    last, longer = same[-1], LONGER
    if last.status == CUT:
        return np.inf
    if contestant.parameter and last.contestant.parameter:
        longer = last.contestant.parameter[1] / contestant.parameter[1]
    return last.wall * longer if np.isfinite(last.wall) else 0.0


def _turn(posed: Posed, plan: Plan, contestant: Contestant, before: Sequence[Outcome], left: float) -> Outcome:
    """The outcome of a contestant, unless the budget is spent or it would take too long anyway.

    Args:
        left: Of the budget [s].
    """
    if left <= 0.0:
        return Outcome(contestant, CUT, "the budget was spent before its turn")
    known = any(o.contestant.family == contestant.family for o in before)
    if known and _foreseen(contestant, before) > plan.each:
        return Outcome(contestant, CUT, f"the setting before tells that it would take more than {plan.each:g} s")
    asked, times = contestant.ask(posed), list[tuple[float, float]]()
    (problem,), most = asked.problems, min(plan.each, left)
    while True:
        try:
            with np.errstate(all="ignore"):
                answer = ask(contestant.method, asked.files, problem, within(most))
        except TooLongError as error:
            return Outcome(contestant, CUT, str(error))
        if isinstance(answer, Failure):
            return Outcome(contestant, FAILED, answer.reason)
        times.append((answer.cost.wall_s, answer.cost.cpu_s) if answer.cost else (np.nan, np.nan))
        if len(times) >= plan.rounds or not times[0][0] < SHORT:
            return outcome(posed, contestant, problem, answer, np.array(times))
