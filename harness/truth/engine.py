"""The engine `truth`: computes every value, and a rigorous radius for it, in ball arithmetic.

It reads the numbers in the text of the description and the scene exactly, treats times, which are doubles, as exact,
and solves at most `MOST` evenly spread samples. The float64 solver supplies only a starting guess of the positions,
which does not affect the result, because positions are certified independently.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from pathlib import Path

import flint
import numpy as np
from flint import ctx

import screwgauge
import screwgauge.reference
import screwgauge.truth
from screwgauge.models.catalog import load_mechanism, mechanism_tables
from screwgauge.problem import GivenMotion, ModelFiles, Problem, Progress, Rows, check_fits, quiet, spread
from screwgauge.quantities import QUANTITIES, Names, description_names, stages
from screwgauge.reference.closed.assembly_mode import positions
from screwgauge.reference.errors import DescriptionError
from screwgauge.reference.graph import layout, spanning_tree
from screwgauge.reference.mechanism import Mechanism
from screwgauge.reference.rotations import Array
from screwgauge.solution import ENCLOSURE, Clock, Error, Solution, Timing, Values, empty
from screwgauge.truth import LACKS, MOST, cache
from screwgauge.truth.exact import LONG
from screwgauge.truth.forces import RoutesDisagree
from screwgauge.truth.kinematics import LoopsOpen, NotCertified
from screwgauge.truth.linkage import Linkage
from screwgauge.truth.samples import (
    Balls,
    Sampler,
    SampleTable,
    enclose_sample,
    enclosures,
    needs_rule,
    recentre_sample,
)

BITS = 192  # 57 digits, of which 12 are lost on the way to the reactions; 30 correct digits are required


def load(files: ModelFiles) -> TruthModel:
    """Read a description."""
    return TruthModel(files.model, load_mechanism(files.model))


class TruthModel:
    """A description whose numbers are read exactly."""

    def __init__(self, file: Path, mechanism: Mechanism) -> None:
        self.file, self.mechanism = file, mechanism

    @property
    def independent(self) -> tuple[str, ...]:
        return tuple(self.mechanism.independent)

    def solve(self, problem: Problem, progress: Progress = quiet) -> Solution:
        """Enclose every quantity in balls.

        Raises:
            NotCertified: No sample could be certified.
            RoutesDisagree: Two enclosures of the same force are disjoint.
        """
        motion = self._check(problem)
        n = len(motion)
        rows = spread(n, MOST)
        depth = stages(_certify(problem))
        files = (__file__, screwgauge.truth.__file__, screwgauge.reference.__file__)
        version = cache.code_version(*(Path(str(file)).parent for file in files), packages=("python-flint", "numpy"))
        key = _key(self.file, problem, motion, rows, depth)
        stored, note = cache.read(key, version)
        kept = None if stored is None else _usable_table(stored, problem, self.mechanism, motion.y[rows])
        notes = [cache.DAMAGED if stored is not None and kept is None else note]
        table = kept or _compute(self, problem, motion, rows, depth, progress)
        if kept is None:
            notes.append(cache.write(key, version, table.pack()))
        solution = _solution(problem, self.mechanism, rows, table, notes, cached=kept is not None)
        assembly = np.full((n, len(self.mechanism.coordinates)), np.nan)
        assembly[rows] = table.mid["joint_position"]
        return replace(solution, assembly=assembly)

    def _check(self, problem: Problem) -> GivenMotion:
        motion, applied = problem.task, problem.applied
        if not isinstance(motion, GivenMotion):
            raise DescriptionError("truth supports only given motions", str(self.file), "run without truth")
        if applied.springs or applied.motors:
            raise DescriptionError("truth does not support springs and motors", "the scene", "run without truth")
        check_fits(problem, self.mechanism, str(self.file))
        return motion


def _certify(problem: Problem) -> frozenset[str]:
    return problem.wanted - set(LACKS)


def _usable_table(stored: cache.Arrays, problem: Problem, mechanism: Mechanism, y: Array) -> SampleTable | None:
    """Return a table from the cache if it fits this problem."""
    try:
        table = SampleTable.unpack(stored)
    except (KeyError, TypeError, ValueError):
        return None
    sizes = {name: len(columns[0]) for name, columns in description_names(mechanism, problem.points).items()}
    return table if table.answers(_certify(problem), sizes, y, mechanism.independent_columns) else None


def _key(file: Path, problem: Problem, whole: GivenMotion, rows: Rows, depth: str) -> str:
    """Hash all inputs: their text where it is available, and doubles elsewhere."""
    wording, motion, applied = problem.wording, whole.part(rows), problem.applied
    gravity = None if applied.gravity is None else applied.gravity.tolist()
    idle = [*motion.idle]
    return cache.digest(
        mechanism_tables(file),
        wording.motion or [array.tolist() for array in (motion.y, motion.yd, motion.ydd)],
        [idle, motion.y[:, idle].tolist(), motion.yd[:, idle].tolist()],
        [wording.gravity, gravity],
        [wording.loads, [load.numbers() for load in applied.loads]],
        motion.t.tobytes(),
        [problem.rule, depth, needs_rule(problem), BITS],
        [[one.name, one.body, one.place.tolist()] for one in problem.points] if "jacobian" in problem.wanted else [],
    )


def _compute(
    model: TruthModel, problem: Problem, motion: GivenMotion, rows: Rows, depth: str, progress: Progress
) -> SampleTable:
    """Compute all samples with exact decimals; if redundant loops do not close, treat long decimals as rounded."""
    try:
        return _table(model, problem, motion, rows, depth, progress)
    except LoopsOpen:
        return _table(model, problem, motion, rows, depth, progress, rounded=True)


def _table(
    model: TruthModel,
    problem: Problem,
    motion: GivenMotion,
    rows: Rows,
    depth: str,
    progress: Progress,
    *,
    rounded: bool = False,
) -> SampleTable:
    mechanism, clock = model.mechanism, Clock()
    tables = mechanism_tables(model.file)

    def sampler(bits: int = BITS, *, wide: bool = False) -> Sampler:
        with ctx.workprec(bits):
            linkage = Linkage(mechanism, tables, rounded=wide)
            return Sampler(linkage, problem, depth, clock, redundant=wide or not rounded)

    if rounded:
        sample = partial(recentre_sample, sampler(wide=True), sampler(), motion)
    else:
        sample = partial(enclose_sample, [sampler(bits) for bits in (BITS, 2 * BITS)], motion)
    # only a starting guess
    start = positions(layout(mechanism), motion.y, motion.t, (motion.yd, motion.ydd))[rows].tolist()
    balls: list[Balls | None] = []
    reasons: list[str] = []
    remedy = ""
    for i, row in enumerate(rows.tolist()):
        try:
            balls.append(sample(row, start[i]))
        except RoutesDisagree as error:
            raise RoutesDisagree(error.what, _place(mechanism, motion.t[row], motion.y[row]), error.remedy) from None
        except NotCertified as error:
            if isinstance(error, LoopsOpen) and not rounded:
                raise
            balls.append(None)
            remedy = remedy or error.remedy
            reasons.append(f"{_place(mechanism, motion.t[row], motion.y[row])}: {error.what}")
        progress((i + 1) / len(rows))
    if all(one is None for one in balls):
        where, _, what = reasons[0].partition(": ")
        raise NotCertified(f"no sample can be certified: {what}", where, remedy)
    return SampleTable(*enclosures(balls, rounded), reasons, dict(clock.spent), rounded)


def _place(mechanism: Mechanism, t: float, y: Array) -> str:
    return f"t = {t:g} s, {mechanism.pose_text(y)}"


def _solution(
    problem: Problem, mechanism: Mechanism, rows: Rows, table: SampleTable, notes: list[str], *, cached: bool
) -> Solution:
    n = len(problem.task)
    done = ~np.isnan(next(iter(table.mid.values()))).any(axis=1)
    names = description_names(mechanism, problem.points)
    wanted = [name for name in QUANTITIES if name in table.mid and name in problem.wanted]

    def spread(array: Array) -> Array:
        full = np.full((n, array.shape[1]), np.nan)
        full[rows] = array
        full.setflags(write=False)
        return full

    solved = rows[done]
    how = f"{BITS} bits" + (", from the cache" if cached else "")
    covers = "{} of all solved samples, once" + (", when the cache file was written" if cached else "")
    return Solution(
        engine="truth",
        version=f"{screwgauge.__version__}, python-flint {flint.__version__}",
        values={name: Values(*names[name], spread(table.mid[name])) for name in wanted},
        condition=empty(n),
        timings=tuple(
            Timing("truth", how, stage, len(rows), seconds, seconds, covers.format(stage))
            for stage, seconds in table.spent.items()
        ),
        notes=tuple(note for note in [*_notes(table, names, mechanism, f"{len(solved)} of {n}"), *notes] if note),
        errors={name: Error(np.zeros(n), source=ENCLOSURE, radius=spread(table.radius[name])) for name in wanted},
        rows=None if len(solved) == n else solved,
    )


def _notes(table: SampleTable, names: Names, mechanism: Mechanism, how_many: str) -> list[str]:
    sizes = {
        f"{name}, {unit}": _scaled_radius(table, name, [i for i, u in enumerate(names[name][1]) if u == unit])
        for name in table.mid
        for unit in names[name][1]
    }
    worst = max(sizes, key=lambda key: sizes[key])
    note = f"{how_many} samples were enclosed; the largest scaled radius is {sizes[worst]:.1e} ({worst})"
    if "reaction" in table.mid:
        note += "; the two routes to the forces agree at every sample"
    notes = [note]
    if table.rounded:
        notes.append(
            f"redundant loops close only if decimals of {LONG} or more digits are read as rounded: the radii cover "
            "every mechanism with closed loops whose frames and axes round to these decimals"
        )
    rows = 6 * len(spanning_tree(mechanism).cuts) + len(mechanism.couplings) + len(mechanism.independent)
    if rows > len(mechanism.coordinates):
        notes.append(
            "the mechanism is overconstrained: its redundant loops close within the radii, which does not prove that "
            "they close; undetermined reactions are one set out of many that satisfy the balance"
        )
    if table.reasons:
        notes.append(
            f"{len(table.reasons)} samples could not be certified and are omitted; the first: {table.reasons[0]}"
        )
    return notes


def _scaled_radius(table: SampleTable, name: str, columns: list[int]) -> float:
    mid, radius = table.mid[name][:, columns], table.radius[name][:, columns]
    return float(np.nanmax(radius)) / (float(np.nanmax(np.abs(mid) + radius)) or 1.0)
