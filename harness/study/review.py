"""Reviews of the user's tables: which columns agree with an engine, and which faults explain the remaining columns."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain, combinations
from typing import Any

import numpy as np
import pandas as pd

from screwgauge.judging.compare import reference_scale
from screwgauge.problem import Rows
from screwgauge.quantities import QUANTITIES, natural_scales
from screwgauge.reference.applied import Load, Motor, PointSpring, Spring
from screwgauge.reference.courses import same_times
from screwgauge.reference.resistance import without_resistance
from screwgauge.reference.rotations import Array
from screwgauge.scene.motion import Sampled
from screwgauge.scene.observables import read_header
from screwgauge.scene.scene import Scene
from screwgauge.solution import Solution, Values, common_rows, reference_first
from screwgauge.study.solving import solve
from screwgauge.study.table_faults import Column, Explanation, explanations, last_place
from screwgauge.study.transformations import Expected, Fault, Key, even_step, shifts

SIGN = Fault("sign", size=-1.0)
STANDIN = "screw"  # engine that computes the expected values without a force, and at different times
DENSE = 2001  # number of times between which expected values are interpolated
PAIRED = 6  # largest number of acting forces for which pairs of missing forces are tried
Solved = Callable[[str, Array], Mapping[str, Values]]
"""Function that takes the name of a force to omit (empty for none) and times [s]; returns quantity -> values."""


@dataclass(frozen=True, slots=True)
class ReviewedColumn:
    """Column of a table, compared with an engine.

    Attributes:
        error: Largest scaled error before correction.
        faults: Faults in the column, empty if it agrees; None if unknown.
        left: Largest scaled error after correction of the faults.
        place: Unit in the last place of the largest value, in the unit of the column.
        ok: True if the uncorrected column is within tolerance.
    """

    quantity: str
    component: str
    unit: str
    error: float
    faults: tuple[Fault, ...] | None
    left: float
    place: float
    ok: bool


@dataclass(frozen=True, slots=True)
class TableReview:
    """Review of a user's table, compared with an engine.

    Attributes:
        engine: Engine with which the table is compared.
        step: Time between samples [s]; 0 if it varies.
        columns: Columns in the order of the quantities; components without a unique value are omitted.
        converted: Headers of the columns whose numbers were converted to SI units.
    """

    name: str
    engine: str
    step: float
    columns: tuple[ReviewedColumn, ...]
    converted: tuple[str, ...] = ()

    @property
    def ok(self) -> bool:
        """True if all columns agree to their printed digits."""
        return bool(self.columns) and all(column.faults == () for column in self.columns)

    def __bool__(self) -> bool:
        return self.ok

    @property
    def explained(self) -> bool:
        """True if the named faults explain every column."""
        return all(column.faults is not None for column in self.columns)

    @property
    def faults(self) -> dict[Key, list[tuple[ReviewedColumn, Fault]]]:
        """Key of a fault -> all columns that have it, each with the fault as found there."""
        found: dict[Key, list[tuple[ReviewedColumn, Fault]]] = {}
        for column in self.columns:
            for fault in column.faults or ():
                found.setdefault(fault.key, []).append((column, fault))
        return found


def reviews(
    scene: Scene,
    solutions: Mapping[str, Solution],
    tables: Mapping[str, Solution],
    errors: pd.DataFrame,
    faulted: Collection[str],
) -> dict[str, TableReview]:
    """Review the tables of a scene.

    Args:
        solutions: Solutions of engines and tables, in a common chart of joint angles.
        tables: Solutions of tables, in the user's chart.
        errors: Rows of component pairs.
        faulted: Engines that fail the judge's checks; tables are not compared with them.
    """
    engines = [one for one in reference_first(solutions.values()) if one.engine not in {*scene.tables, *faulted}]
    if scene.simulated or not engines:
        return {}
    found, solved = {}, _standin(scene, errors.loc[errors["ok"].eq(False), "quantity"])
    for name, table in tables.items():
        columns = list[ReviewedColumn]()
        for quantity in table.values:
            if engine := next((one for one in engines if quantity in one.values), None):
                pair = errors[(errors["quantity"] == quantity) & errors["a"].isin(both := {name, engine.engine})]
                readings, pair = (solutions[name], table), pair[pair["b"].isin(both)]
                columns += _review_quantity(scene, quantity, engine, readings, pair, solved)
        step, converted = even_step(scene.tables[name].t), tuple(scene.tables[name].converted)
        found[name] = TableReview(name, engines[0].engine, step, tuple(columns), converted)
    return found


def _review_quantity(
    scene: Scene, quantity: str, engine: Solution, readings: Sequence[Solution], pair: pd.DataFrame, solved: Solved
) -> Iterator[ReviewedColumn]:
    """Yield the columns of one quantity; further values are computed only for columns out of tolerance.

    Args:
        readings: The table converted to the engine's chart, and as given, because the conversion is meaningless for
            angles in degrees.
    """
    rows = common_rows(len(scene.t), engine, readings[0])
    right = engine.values[quantity].at(rows)
    known = {row["component"]: row for row in pair.to_dict("records") if not pd.isna(row["ok"])}
    read = [_columns(scene, quantity, right, one, rows, known) for one in readings]
    why: dict[str, Explanation | None] = {name: None for name, row in known.items() if not row["ok"]}
    expected = _expect_values(scene, quantity, right, scene.t[rows], solved) if why else None
    for columns in read if expected else ():
        wrong = [column for name, column in columns.items() if name in why and why[name] is None]
        found = explanations(wrong, expected) if wrong and expected else []
        why |= {column.component: one for column, one in zip(wrong, found, strict=True)}
    if quantity == "reaction":
        why |= _sides([*read[0].values()], why)
    for name, column in read[0].items():
        row, error = known[name], float(known[name]["max_scaled"])
        one = why.get(name, Explanation((), error))
        left, faults = (one.left, one.faults) if one else (error, None)
        place = float(column.place.max())
        yield ReviewedColumn(quantity, name, column.unit, error, faults, left, place, bool(row["ok"]))


def _columns(
    scene: Scene, quantity: str, right: Values, table: Solution, rows: Rows, known: Mapping[str, Any]
) -> dict[str, Column]:
    """Return the table columns whose reference values are uniquely determined."""
    given, natural = table.values[quantity].at(rows), natural_scales(scene.mechanism)
    recorded, columns = scene.tables[table.engine], {}
    stated, at = recorded.error.get(quantity, 0.0), same_times(scene.t[rows], recorded.t)[1]
    headers = [*map(read_header, recorded.columns)]
    for name, unit, values in zip(given.components, given.units, given.array.T, strict=True):
        if name in known:
            scale = reference_scale(right, unit, natural[unit])
            tolerance = max(stated, scale * float(known[name]["tolerance"]))
            own = right.array[:, right.components.index(name)]
            # as printed, before whole revolutions were added
            header = next(h for h in headers if h.component == name and h.of(quantity, unit))
            place = header.factor * last_place(recorded.columns[header.text])[at]
            columns[name] = Column(name, unit, values, own, scale, tolerance, place)
    return columns


def _sides(columns: Sequence[Column], why: Mapping[str, Explanation | None]) -> dict[str, Explanation]:
    """Explain components of a joint that are all negated, except for zeros, as the reaction on the other body."""
    found: dict[str, Explanation] = {}
    for joint in {column.component.rpartition(".")[0] for column in columns}:
        some = [c for c in columns if c.component.rpartition(".")[0] == joint and np.abs(c.values).max() > c.tolerance]
        known = {column.component: one for column in some if (one := why.get(column.component)) and SIGN in one.faults}
        side = {SIGN: Fault("side", joint, -1.0)}
        for name, one in known.items() if len(known) == len(some) else ():
            found[name] = replace(one, faults=tuple(side.get(fault, fault) for fault in one.faults))
    return found


def _standin(scene: Scene, quantities: Iterable[str]) -> Solved:
    """Return a caching function that solves a scene without a given force, for all quantities at once."""
    wanted = frozenset(quantities)
    forces, parts = (name for name in wanted if QUANTITIES[name].needs == "f"), _parts(scene)
    asked = {"": wanted, **dict.fromkeys(parts, frozenset(forces))}
    known: dict[tuple[str, bytes], Mapping[str, Values]] = {}

    def solve_part(part: str, times: Array) -> Mapping[str, Values]:
        if (key := (part, times.tobytes())) not in known:
            changed = replace(parts.get(part, scene), models={}, tables={}).at(times)
            known[key] = solve(changed, [STANDIN], asked[part])[0][STANDIN].values
        return known[key]

    return solve_part


def _expect_values(scene: Scene, quantity: str, right: Values, t: Array, solved: Solved) -> Expected:
    """Return an engine's values: as computed, with forces omitted or reversed, and at shifted times."""
    given = scene.drive.samples.t if isinstance(scene.drive, Sampled) else None
    dense = np.unique(np.linspace(scene.t[0], scene.t[-1], DENSE)) if given is None else given
    times = np.union1d(t, dense)

    def without(part: str) -> Array:
        return solved(part, times)[quantity].pick(right.components).array

    base = without("")
    parts = _parts(scene) if QUANTITIES[quantity].needs == "f" else {}
    less = {Fault("missing", name): without(name) - base for name in parts}
    some = chain.from_iterable(combinations(less, n) for n in range(3 if len(less) <= PAIRED else 2))
    changes = {faults: sum((less[one] for one in faults), 0.0 * base) for faults in some}
    turned = (one for one in less if not one.of.startswith("spring"))
    changes |= {(replace(one, kind="reversed"),): 2.0 * less[one] for one in turned}
    faults = [faults for faults in changes for _ in right.components]
    every, m = np.concatenate([*changes.values()], axis=1), len(changes)
    arrays = np.tile(right.array, m) + every[np.searchsorted(times, t)]
    moved = shifts(t, dense, (np.tile(base, m) + every)[np.searchsorted(times, dense)])
    return Expected(right.components * m, faults, t, arrays, moved)


#: Resistance of joints -> its name in a sentence about a table that lacks it.
_RESISTS = {"rotor": "rotors", "damping": "damping of joints", "friction": "dry friction"}


def _parts(scene: Scene) -> dict[str, Scene]:
    """Return name of a force or resistance -> scene without it, for everything that acts on the machine."""
    applied, mechanism = scene.applied, scene.mechanism
    parts = {"gravity": replace(scene, applied=replace(applied, gravity=np.zeros(3)))} if applied.g.any() else {}
    for field in ("loads", "springs", "motors"):
        some: tuple[Any, ...] = getattr(applied, field)
        for k, one in enumerate(some):
            name = _name(one)
            name = f"{name} ({k + 1})" if name in parts else name
            without: dict[str, Any] = {field: (*some[:k], *some[k + 1 :])}
            parts[name] = replace(scene, applied=replace(applied, **without))
    for what in dict.fromkeys(one.what for one in mechanism.resistances):
        parts[_RESISTS[what]] = replace(scene, mechanism=without_resistance(mechanism, what))
    return parts


def _name(one: Load | Spring | Motor) -> str:
    if isinstance(one, Load):
        return f"load on {one.body}"
    if isinstance(one, PointSpring):
        return one.where
    return f"{'motor' if isinstance(one, Motor) else 'spring'} at {one.coordinate}"
