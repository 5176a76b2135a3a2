"""A forward bench: every entrant integrates the scene; its errors, energy and time become a row."""

from __future__ import annotations

import tempfile
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

from screwgauge.engines.screw.forward import forces_over_time
from screwgauge.environment import environment
from screwgauge.models.generate import write_models
from screwgauge.reference.errors import DescriptionError, check_choice
from screwgauge.reference.pose import Layout
from screwgauge.scene.scene import Scene
from screwgauge.scene.setting import EXPLICIT, Forward
from screwgauge.scene.start import check_start, make_problem
from screwgauge.scene.stiffness import stiff_warning, stiffness
from screwgauge.solution import REFERENCE
from screwgauge.study.bench.forward_entrants import Entrant, entrants
from screwgauge.study.bench.forward_work import Outcome, Plan, Work
from screwgauge.study.bench.rows import CUT
from screwgauge.study.bench.slopes import Fit, Rule, fit
from screwgauge.study.bench.threads import one_thread
from screwgauge.study.forward import started
from screwgauge.study.provenance import provenance
from screwgauge.study.run import Report, model_files

FULL = Plan(samples=41, rounds=3, budget=90.0, each=45.0, share=1.0)
QUICK = Plan(samples=9, rounds=1, budget=25.0, each=8.0, share=0.2)
#: From one rung of a ladder to the next, at least so many times longer: what would take too long is not begun.
LONGER = 1.5
FOREVER = 1e9  # [s]
#: Of what has not run yet [s]: screw runs under Python throughout.
FIRST = {"screw": 2.0}


@dataclass(frozen=True, slots=True, eq=False)
class Contest:
    """What a forward bench found.

    Attributes:
        reference: What errors are measured against, in words.
        provenance: Files that were judged, and the date.
    """

    scene: Scene
    plan: Plan
    outcomes: tuple[Outcome, ...]
    fits: tuple[Fit, ...]
    reference: str
    notes: tuple[str, ...]
    environment: Mapping[str, Any]
    provenance: Mapping[str, Any] = field(default_factory=dict)

    @property
    def complete(self) -> bool:
        """Nothing was cut short."""
        return all(outcome.status != CUT for outcome in self.outcomes)


def contest(
    scene: Scene,
    *,
    plan: Plan = FULL,
    contestants: Iterable[str] | None = None,
    progress: Report = lambda step, share: None,
) -> Contest:
    """Measures errors, energy and run times of entrants on a forward scene.

    Args:
        contestants: Families or engines; all by default.

    Raises:
        ScrewgaugeError: Bad input. An entrant that fails is a row.
    """
    begin = perf_counter()
    start = started(scene)
    if not scene.observables:
        raise DescriptionError("there is no observable to measure errors of", scene.name, "add [[observables]]")
    here = _shortened(scene, plan)
    lay, notes = check_start(here, start)
    if plan.share < 1.0:
        part = f"Only the first {plan.share:.0%} of the motion were integrated; published results are of all of it."
        notes = (*notes, part)
    chosen = _chosen(here, start, lay, contestants, quick=plan.share < 1.0)
    outcomes: list[Outcome] = []
    with tempfile.TemporaryDirectory(prefix="screwgauge-") as folder:
        write_models(scene.mechanism, Path(folder), gravity=scene.gravity)
        progress(REFERENCE, 0.0)
        work = Work(here, start, Path(folder), plan)
        waiting, n = list(chosen), len(chosen)
        while waiting:
            # the shortest first, as far as the family's last one tells
            entrant = min(waiting, key=lambda one: (_foreseen(one, outcomes), one.effort))
            waiting.remove(entrant)
            progress(entrant.family, 1.0 - (len(waiting) + 1) / n)
            outcomes.append(_turn(work, entrant, outcomes, plan.budget - perf_counter() + begin))
        names = dict.fromkeys(entrant.engine for entrant in chosen)
        files = provenance(scene, {name: model_files(scene, name, Path(folder))[0] for name in names})
    return Contest(
        scene=here,
        plan=plan,
        outcomes=tuple(_by_family(outcomes)),
        fits=tuple(_fits(outcomes)),
        reference=work.source,
        notes=notes,
        environment={**environment(), "one_thread": one_thread()},
        provenance=files,
    )


def _by_family(outcomes: Sequence[Outcome]) -> list[Outcome]:
    """Family by family, those of `screw` first."""
    names = list(dict.fromkeys(o.entrant.family for o in outcomes))
    return sorted(outcomes, key=lambda o: (o.entrant.engine != "screw", names.index(o.entrant.family)))


def _foreseen(entrant: Entrant, before: Sequence[Outcome]) -> float:
    """How long an entrant will last [s]: from the setting before it of its family, or the first of its engine."""
    same = [o for o in before if o.entrant.family == entrant.family]
    if not same:
        alike = [o.wall for o in before if o.entrant.engine == entrant.engine and o.entrant.parameter is None]
        alike = [wall for wall in alike if np.isfinite(wall) and entrant.parameter is None]
        return FOREVER if entrant.late else max([FIRST.get(entrant.engine, 0.0), *alike[:1]])
    last = same[-1]
    if last.status == CUT:
        return FOREVER
    longer = LONGER
    if entrant.parameter and last.entrant.parameter:
        longer = last.entrant.parameter[1] / entrant.parameter[1]
    return last.wall * longer if np.isfinite(last.wall) else 0.0


def _turn(work: Work, entrant: Entrant, before: Sequence[Outcome], left: float) -> Outcome:
    """The outcome of an entrant, unless the budget is spent or it would take too long anyway."""
    if left <= 0.0:
        return Outcome(entrant, CUT, "the budget was spent before its turn")
    known = any(o.entrant.family == entrant.family for o in before)
    if known and _foreseen(entrant, before) > work.plan.each:
        reason = f"the setting before tells that it would take more than {work.plan.each:g} s"
        return Outcome(entrant, CUT, reason)
    return work.outcome(entrant, left)


def _shortened(scene: Scene, plan: Plan) -> Scene:
    """The scene on a few of its times, up to a share of its duration."""
    t = scene.motion.t
    t = t[t <= t[0] + plan.share * (t[-1] - t[0])] if plan.share < 1.0 else t
    rows = np.unique(np.linspace(0, len(t) - 1, min(len(t), plan.samples)).round().astype(int))
    return scene.at(t[rows])


def _chosen(scene: Scene, start: Forward, lay: Layout, names: Iterable[str] | None, *, quick: bool) -> list[Entrant]:
    problem = make_problem(scene, start, scene.mechanism_file, None)
    fast = stiffness(lay, forces_over_time(problem, lay), start)
    explicit = replace(start, method=replace(start.method, name=EXPLICIT[0]))
    stiff = bool(stiff_warning(fast, explicit, float(scene.motion.t[-1])))
    t = scene.motion.t
    everyone = entrants(start.method.name, float(t[-1]) - start.since, stiff=stiff, quick=quick)
    if names is None:
        return everyone
    known = dict.fromkeys(name for entrant in everyone for name in (entrant.family, entrant.engine))
    wanted = check_choice("contestant", names, known, "--contestants")
    return [entrant for entrant in everyone if {entrant.family, entrant.engine} & set(wanted)]


def _fits(outcomes: Sequence[Outcome]) -> list[Fit]:
    """Slopes of the energy error of the families that have an order.

    Observables may converge faster than that where errors average out over a period; the energy does not.
    """
    found = []
    for family in dict.fromkeys(o.entrant.family for o in outcomes if o.entrant.order is not None):
        here = [o for o in outcomes if o.entrant.family == family and o.energy_scaled > 0.0]
        points = [(o.entrant.parameter[1], o.energy_scaled) for o in here if o.entrant.parameter]
        order = next((o.entrant.order for o in here), None)
        if points and order is not None and here[0].entrant.parameter is not None:
            one = fit(Rule(family, "energy", order), here[0].entrant.parameter[0], points)
            if np.isfinite(one.slope):  # three points between saturation and rounding
                found.append(one)
    return found
