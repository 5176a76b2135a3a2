"""The bench of a simulation: how one contestant did, and what all are measured against."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from screwgauge.judging.answer import answer_at
from screwgauge.judging.energy import energy_balance
from screwgauge.problem import Integration, Problem
from screwgauge.reference.errors import DescriptionError
from screwgauge.reference.pose import layout
from screwgauge.reference.rotations import Array
from screwgauge.scene.observables import known_values, observe
from screwgauge.scene.scene import Scene
from screwgauge.solution import Solution, Values
from screwgauge.study.ask import model_files
from screwgauge.study.bench.contestant import Contestant
from screwgauge.study.bench.rows import FAILED, OK, Row
from screwgauge.study.method import Method
from screwgauge.study.posed import Posed
from screwgauge.study.reference import Reference, scales_of, score

NAN = float("nan")
TIGHTEST = 1e-12  # tolerance of the solver where it is the reference


@dataclass(frozen=True, slots=True, eq=False)
class Outcome:
    """How one contestant did.

    Attributes:
        scaled, rms: Largest and RMS scaled error of the observables.
        largest: Largest error by unit [rad, m].
        energy, energy_scaled: Largest energy that is not accounted for [J], and over the largest of its parts.
        wall, cpu: Shortest time of the integration [s].
        n_sample: Samples that it delivered.
    """

    contestant: Contestant
    status: str
    reason: str
    scaled: float = NAN
    rms: float = NAN
    largest: Mapping[str, float] | None = None
    energy: float = NAN
    energy_scaled: float = NAN
    wall: float = NAN
    cpu: float = NAN
    n_sample: int = 0
    steps: int = 0
    evaluations: int = 0

    @property
    def rows(self) -> tuple[Row, Row]:
        """Its rows of ``bench.csv``: the observables, and the energy. Times are wall times."""
        seconds = (self.wall,) if np.isfinite(self.wall) else ()
        rest = (self.n_sample, seconds, self.status, self.reason)
        return (
            Row(self.contestant, "observable", self.scaled, self.rms, *rest),
            Row(self.contestant, "energy", self.energy_scaled, NAN, *rest),
        )


def simulated(scene: Scene, folder: Path) -> Posed:
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
    return Posed(scene, scene, folder, Reference(name, values, "", scales_of(scene.mechanism, values)))


def outcome(posed: Posed, contestant: Contestant, problem: Problem, solution: Solution, times: Array) -> Outcome:
    """Scores an answer as far as it came.

    Args:
        times: Wall and processor time of each integration [s]. Shape (n, 2).
    """
    scene, m = posed.scene, solution.n_solved
    if m < 2:
        return Outcome(contestant, FAILED, f"stopped before the first sample: {solution.stopped}")
    q, right = solution.values["joint_position"].array[:m], posed.reference.values["observable"].at(slice(m))
    observed = observe(layout(scene.mechanism), scene.observables, q)
    error = score(observed, right, posed.reference.scales["observable"])
    judged = replace(problem, applied=scene.applied)  # a model file of one's own may have another gravity
    energy = next(energy_balance(answer_at(scene.mechanism, judged, solution, np.arange(m))), {})
    reason = solution.stopped or (f"only {m} of {len(scene.t)} samples" if m < len(scene.t) else error.reason)
    wall, cpu = times.min(axis=0).tolist()
    return Outcome(
        contestant,
        FAILED if reason else OK,
        reason,
        scaled=error.max_scaled,
        rms=error.rms_scaled,
        largest=_by_unit(observed, right),
        energy=energy.get("max_abs", NAN),
        energy_scaled=energy.get("max_scaled", NAN),
        wall=wall,
        cpu=cpu,
        n_sample=m,
        steps=solution.cost.steps if solution.cost else 0,
        evaluations=solution.cost.evaluations if solution.cost else 0,
    )


def _by_unit(observed: Values, right: Values) -> dict[str, float]:
    """Largest absolute error of each unit."""
    largest = {}
    for unit in dict.fromkeys(right.units):
        names = tuple(c for c, u in zip(right.components, right.units, strict=True) if u == unit)
        largest[unit] = score(observed.pick(names), right.pick(names), {unit: 1.0}).max_scaled
    return largest
