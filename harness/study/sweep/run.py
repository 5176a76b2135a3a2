"""Runs sweeps in chunks of variants, and computes how much each number contributes to the scatter of the results."""

from __future__ import annotations

from base64 import b64decode, b64encode
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from screwgauge.environment import environment
from screwgauge.problem import Progress, Report, Rows, silent, spread
from screwgauge.quantities import description_names, digits
from screwgauge.reference.errors import DescriptionError, ScrewgaugeError, first_few
from screwgauge.reference.rotations import Array
from screwgauge.study.address import address
from screwgauge.study.runner import Executor, InTurn, Task, run_tasks
from screwgauge.study.store import Journal
from screwgauge.study.sweep.draw import Draw
from screwgauge.study.sweep.plan import Plan, Scatter

if TYPE_CHECKING:
    from screwgauge.engines.screw.variants import Variants

#: Number of variants per task; a task takes seconds, and is one row in the journal.
CHUNK = 4096
#: Number of names listed in a sentence.
NAMED = 3


@dataclass(frozen=True, slots=True)
class Column:
    """Column of the table: a statistic of a component."""

    statistic: str
    quantity: str
    component: str
    unit: str

    @property
    def name(self) -> str:
        return f"{self.statistic} {self.quantity}/{self.component} [{self.unit}]"


def columns(plan: Plan) -> list[Column]:
    """Return the columns of the table, grouped by statistic."""
    known = description_names(plan.scene.mechanism)
    each = [(quantity, *pair) for quantity in plan.quantities for pair in zip(*known[quantity], strict=True)]
    return [Column(statistic, *one) for statistic in plan.statistics for one in each]


def _solve_chunk(plan: Plan, key: str, first: int, stop: int, progress: Progress) -> dict[str, Any]:
    """Solve some variants; return their values as base64 text, and the reasons why variants have no values.

    Args:
        key: Key of the plan, so that a process compiles it only once.
    """
    draw, variants = _compile(plan, key)
    motion, values = plan.scene.motion, draw.values(range(first, stop))
    given = dict(zip(draw.names, values, strict=True))
    found = variants.statistics(motion.y, motion.yd, motion.ydd, plan.statistics, parameters=given, t=motion.t)
    table = np.concatenate([found[one][name] for one in plan.statistics for name in plan.quantities], 1)
    why = next(iter(found.values())).why
    text = b64encode(np.ascontiguousarray(table).tobytes()).decode()
    return {"values": text, "why": {str(i): str(why[i]) for i in np.flatnonzero(why != "")}}


#: Key -> the plan that this process compiled last.
_known: dict[str, tuple[Draw, Variants]] = {}


def _compile(plan: Plan, key: str) -> tuple[Draw, Variants]:
    if key not in _known:
        from screwgauge.engines.screw.variants import Variants

        draw = Draw(plan)
        _known.clear()
        _known[key] = draw, Variants(plan.scene, plan.quantities, draw.names, "llvm")
    return _known[key]


@dataclass(frozen=True, slots=True)
class Checked:
    """Variant that was checked by the engines of the scene, each of which read its own model files."""

    variant: int
    ok: bool
    digits: float
    what: str


@dataclass(frozen=True, eq=False)
class Sweep:
    """Results of all variants.

    Attributes:
        values: Statistics. Shape (V, C).
        why: Reason why a variant has no statistics; empty if it has statistics. Shape (V,).
        nominal: Statistics of the unchanged scene. Shape (C,).
        effects: Effect of each scatter.
        indices: If requested, number -> Sobol's first-order and total indices for the column with the largest scatter.
    """

    plan: Plan
    columns: Sequence[Column]
    values: Array
    why: Array
    nominal: Array
    effects: Sequence[Scatter]
    checked: Sequence[Checked]
    indices: Mapping[str, tuple[float, float]]
    note: str
    environment: Mapping[str, Any] = field(default_factory=environment)

    @property
    def exit_status(self) -> int:
        return 0 if all(one.ok for one in self.checked) else 1

    @cached_property
    def numbers(self) -> pd.DataFrame:
        """Varied numbers of each variant."""
        draw = Draw(self.plan)
        return pd.DataFrame(draw.values(range(len(self.values))).T, columns=draw.names)

    @property
    def table(self) -> pd.DataFrame:
        """A row for each variant: numbers, statistics, and the reason if there are no statistics."""
        found = pd.DataFrame(self.values, columns=[column.name for column in self.columns])
        return pd.concat([self.numbers, found.assign(why=self.why)], axis=1)

    @property
    def sizes(self) -> Array:
        """Scale of each column: the largest nominal value for the same statistic and unit. Shape (C,)."""
        keys = [(column.statistic, column.unit) for column in self.columns]
        largest = dict.fromkeys(keys, 0.0)
        for key, value in zip(keys, self.nominal, strict=True):
            largest[key] = max(largest[key], abs(float(value)))
        return np.array([largest[key] or 1.0 for key in keys])

    @property
    def ranked(self) -> list[tuple[Scatter, int]]:
        """Effects in descending order, each with the column that it changes most."""
        some = [i for i, column in enumerate(self.columns) if column.statistic == self.plan.statistics[0]]
        shares = [np.abs(effect.changes / self.sizes)[some] for effect in self.effects]
        order = sorted(range(len(shares)), key=lambda i: -float(shares[i].max(initial=0.0)))
        return [(self.effects[i], some[int(np.argmax(shares[i]))]) for i in order]

    def worst(self, column: int) -> int | None:
        """Return the variant whose statistic is farthest from the nominal value."""
        away = np.abs(self.values[:, column] - self.nominal[column])
        return int(np.nanargmax(away)) if np.isfinite(away).any() else None


def sweep(
    plan: Plan, *, progress: Report = silent, execute: Executor | None = None, place: Path | None = None
) -> Sweep:
    """Solve all variants of a plan.

    Args:
        execute: Executor of the chunks; this process by default.
        place: Folder of the report. If given, finished chunks are kept on disk until all are finished.

    Raises:
        ScrewgaugeError: The variation would remove the mobility of the machine, or the scene's motion cannot be
            followed.
    """
    key = address("sweep", _content(plan), files=[plan.file, *_files(plan)])
    draw, variants = _compile(plan, key)
    _check_mobility(plan, variants)
    kept, count = Journal(place, key), plan.variants
    chunks = [(i, min(i + CHUNK, count)) for i in range(0, count, CHUNK)]
    rows = run_tasks(
        [
            Task(f"variants {i + 1} to {stop}", partial(_solve_chunk, plan, key, i, stop), str(i), _files(plan))
            for i, stop in chunks
        ],
        execute or InTurn(),
        lost=lambda name, reason: {"values": "", "why": {"": reason}},
        before=kept.results,
        keep=kept.keep,
        progress=progress,
    )
    known = columns(plan)
    parts = [_read(row, stop - i, len(known)) for row, (i, stop) in zip(rows, chunks, strict=True)]
    values, why = np.concatenate([part[0] for part in parts]), np.concatenate([part[1] for part in parts])
    nominal, slopes = _slopes(plan, variants)
    slopes = slopes[:, [variants.names.index(name) for name in draw.names]]
    effects = [replace(one, changes=_change(slopes @ ways)) for one, ways in draw.deviations()]
    progress("checks", 0.99)
    checked = [*_check_variants(plan, draw, np.flatnonzero(why == ""))]
    found = Sweep(plan, known, values, why, nominal, effects, checked, {}, kept.note)
    if plan.indices:
        found = replace(found, indices=_indices(found, draw, variants))
    kept.remove()
    return found


def _content(plan: Plan) -> list[Any]:
    scatter = [[one.name, one.kind, one.size, one.value] for one in plan.scatter]
    grid, t = [[name, values.tolist()] for name, values in plan.grid.items()], plan.scene.t
    return [plan.count, plan.seed, plan.design, [*plan.quantities], [*plan.statistics], scatter, grid, t.tobytes()]


def _files(plan: Plan) -> list[Path]:
    scene = plan.scene
    return [file for file in (scene.file, scene.mechanism_file) if file is not None]


def _check_mobility(plan: Plan, variants: Variants) -> None:
    """Reject numbers whose change would remove the mobility of an overconstrained machine, before solving variants."""
    if costs := [*variants.cannot_change]:
        where = str(plan.file)
        what = f"{first_few(costs, NAMED)} cannot change separately, because the loops would no longer close"
        raise DescriptionError(what, where, "omit these numbers, or move all affected parts together")


def _read(row: Mapping[str, Any], count: int, width: int) -> tuple[Array, Any]:
    """Decode the values and reasons of a chunk. Shapes (count, width), (count,)."""
    why = np.full(count, row["why"].get("", ""), dtype=object)
    for i, reason in row["why"].items():
        if i:
            why[int(i)] = reason
    data = np.frombuffer(b64decode(row["values"]))
    return (data.reshape(count, width) if data.size else np.full((count, width), np.nan)), why


def _change(ways: Array) -> Array:
    """Return the signed change due to a number, or the norm of the ten changes due to a body. (C, 1 or 10) -> (C,)."""
    return ways[:, 0] if ways.shape[1] == 1 else np.asarray(np.linalg.norm(ways, axis=1))


def _slopes(plan: Plan, variants: Variants) -> tuple[Array, Array]:
    """Return the scene's statistics, and their derivatives with respect to all numbers. Shapes (C,), (C, P)."""
    motion, nominal, slopes = plan.scene.motion, list[float](), list[Array]()
    given = motion.y, motion.yd, motion.ydd
    values = variants(*given, parameters={}, t=motion.t)
    by_quantity = {name: (values[name][0], variants.jacobian(name, *given, motion.t)) for name in plan.quantities}
    for statistic in plan.statistics:
        for f, J in by_quantity.values():
            for x, slope in zip(f.T, np.moveaxis(J, 1, 0), strict=True):
                value, weights = _statistic(statistic, x)
                nominal.append(value)
                slopes.append(weights @ slope)
    return np.array(nominal), np.array(slopes)


def _statistic(name: str, x: Array) -> tuple[float, Array]:
    """Return a statistic of a time series, and its derivatives with respect to all values, shape (n,)."""
    n, at = len(x), np.zeros(len(x))
    if name == "mean":
        return float(x.mean()), at + 1.0 / n
    if name == "rms":
        rms = float(np.sqrt(np.mean(x * x)))
        return rms, x / (n * rms) if rms else at
    i = int({"peak": np.argmax(np.abs(x)), "min": np.argmin(x), "max": np.argmax(x)}[name])
    at[i] = np.sign(x[i]) if name == "peak" else 1.0
    return float(at[i] * x[i]), at


def _check_variants(plan: Plan, draw: Draw, rows: Rows) -> Iterator[Checked]:
    """Check selected variants with the engines of the scene, each engine using its own model files."""
    from screwgauge.study.run import run

    for i in rows[spread(len(rows), plan.check)].tolist() if len(rows) and plan.check else ():
        given = dict(zip(draw.names, draw.values(range(i, i + 1))[:, 0].tolist(), strict=True))
        try:
            with np.errstate(all="ignore"):  # a NaN is reported in a row
                results = run(plan.scene.with_(given), quantities=plan.quantities)
        except ScrewgaugeError as error:
            yield Checked(i, False, np.nan, str(error))
            continue
        worst = float(results.pairs["max_scaled"].max()) if len(results.pairs) else np.nan
        yield Checked(i, results.exit_status == 0, digits(worst), ", ".join(results.solutions))


def _indices(found: Sweep, draw: Draw, variants: Variants) -> dict[str, tuple[float, float]]:
    """Compute Sobol's indices for the column with the largest scaled scatter."""
    from scipy.stats import sobol_indices, uniform

    plan, motion = found.plan, found.plan.scene.motion
    column = int(np.nanargmax(np.nanstd(found.values, axis=0) / found.sizes))
    one = found.columns[column]
    place = [c.component for c in found.columns if (c.statistic, c.quantity) == (one.statistic, one.quantity)]

    def measure(u: Array) -> Array:
        given = dict(zip(draw.names, draw.scatter(u), strict=True))
        got = variants.statistics(motion.y, motion.yd, motion.ydd, [one.statistic], parameters=given, t=motion.t)
        return got[one.statistic][one.quantity][:, place.index(one.component)]

    rng = np.random.default_rng(plan.seed)
    result = sobol_indices(func=measure, n=plan.indices, dists=[uniform()] * draw.dimensions, rng=rng)
    pairs = zip(plan.scatter, result.first_order, result.total_order, strict=True)
    return {number.name: (float(first), float(total)) for number, first, total in pairs}
