"""The user's tables, treated as engines: how they answer a scene, and how the answers are judged."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace

import numpy as np
import pandas as pd

from screwgauge.engines.registry import engine_names
from screwgauge.judging.answer import largest
from screwgauge.judging.judge import judge
from screwgauge.problem import Problem, Rows
from screwgauge.quantities import QUANTITIES, Names
from screwgauge.reference.closed.assembly_mode import positions
from screwgauge.reference.courses import same_times
from screwgauge.reference.errors import DescriptionError, UnknownNameError, check_choice
from screwgauge.reference.graph import layout
from screwgauge.reference.rotations import Array
from screwgauge.scene.observables import Header, Recorded, read_header
from screwgauge.scene.rest import unique_samples
from screwgauge.scene.scene import Scene
from screwgauge.solution import REFERENCE, Solution, Values, empty
from screwgauge.study.fixed import with_fixed

#: Distance within which an angle counts as equal to the scene's angle, up to whole revolutions [rad].
NEAR = 0.1
NO_TREE = "joint forces of an open tree depend on where an engine cuts the loops"

Columns = dict[str, dict[str, Array]]
"""Quantity -> component -> values."""


def check_tables(scene: Scene) -> None:
    """Reject tables with the name of an engine or of the reference solution.

    Raises:
        DescriptionError: A table has such a name.
    """
    for name in {*engine_names(), REFERENCE} & {*scene.tables}:
        why = "an engine" if name != REFERENCE else "the reference solution of a simulation"
        raise DescriptionError(
            f"the table '{name}' has the same name as {why}", f"{scene.file or scene.name}, tables", "rename it"
        )


def answer_of_table(scene: Scene, name: str, names: Names, wanted: Collection[str]) -> Solution:
    """Answer a scene from a table, like an engine that lacks what the table does not contain.

    Args:
        name: Name of the table.
        names: Quantity -> components and units that a table may have.
        wanted: Names of the quantities to compare; notes name all other quantities of the table.

    Raises:
        ScrewgaugeError: The table has unknown columns or wrong units, or none of the compared quantities.
    """
    table, n = scene.tables[name], len(scene.t)
    (rows, at), columns = same_times(scene.t, table.t), _columns(table, names, wanted)
    skipped = len(table.t) - len(np.unique(at))
    if any(QUANTITIES[quantity].needs == "f" for quantity in columns):
        told = unique_samples(scene)
        rows, at, n = rows[told[rows]], at[told[rows]], int(told.sum())
    if not rows.size:
        raise DescriptionError("contains none of the scene's times", table.where, "choose times that it contains")
    values: dict[str, Values] = {}
    for quantity in (quantity for quantity in names if quantity in wanted and quantity in columns):
        units = {name: unit for name, unit in zip(*names[quantity], strict=True) if name in columns[quantity]}
        array = np.full((len(scene.t), len(units)), np.nan)
        array[rows] = np.stack([columns[quantity][name][at] for name in units], axis=1)
        values[quantity] = Values(tuple(units), tuple(units.values()), array)
    if not values:
        what = f"contains none of the compared quantities ({', '.join(wanted)})"
        raise DescriptionError(what, table.where, "request its quantities, or omit the table")
    values, assembly = with_fixed(scene.mechanism, values), _assembly(scene, rows)
    if "joint_position" in values:
        values["joint_position"] = _unwind(values["joint_position"], scene.mechanism.coordinates, assembly)
    short, long = _lacks(name, values, names, wanted, [f"only {len(rows)} of the {n} samples"] * (len(rows) < n))
    unused = [f"has {quantity}, which is not compared" for quantity in columns if quantity not in wanted]
    if skipped:
        unused.append(f"{skipped} of its {len(table.t)} times were not compared, because the scene lacks them")
    unused += [f"{name} was converted to SI units" for name in table.converted]
    return Solution(
        engine=name,
        version=table.file.name if table.file else table.where,
        values=values,
        condition=empty(len(scene.t)),
        notes=(*long, *unused, *(f"has no {tree}: {NO_TREE}" for tree in wanted if tree.startswith("tree_force"))),
        assembly=None if _is_whole(values, names, "joint_position") else assembly,
        rows=None if len(rows) == len(scene.t) else rows,
        warnings=short,
        lacks=dict.fromkeys({*wanted} - {*values}, "the table has no such column"),
    )


def _columns(table: Recorded, names: Names, wanted: Collection[str]) -> Columns:
    """Return the columns of a table by quantity and component."""
    columns: Columns = {}
    for text, values in table.columns.items():
        header = read_header(text)
        quantity = _quantity(header, names, wanted, table.where)
        components, units = names[quantity]
        header.check_unit(units[components.index(header.component)], table.where)
        if header.component in columns.setdefault(quantity, {}):
            raise DescriptionError(f"{header.component} of {quantity} appears twice", table.where, "remove one column")
        columns[quantity][header.component] = values if header.factor == 1.0 else header.factor * values
    for quantity in table.error:
        check_choice("quantity", [quantity], columns, f"{table.where}, error")
    return columns


def _quantity(header: Header, names: Names, wanted: Collection[str], where: str) -> str:
    """Return the quantity that a column names, or else the only compared quantity that has the column's component."""
    if header.quantity and header.quantity not in names:
        raise UnknownNameError("quantity", header.quantity, names, f"{where}, column '{header.text}'")
    having = [name for name in [header.quantity] if name] or [*names]
    having = [name for name in having if header.component in names[name][0]]
    units = {name: names[name][1][names[name][0].index(header.component)] for name in having}
    having = [name for name in having if header.of(name, units[name])] or having
    if not having:
        known = dict.fromkeys(c for name in names for c in names[name][0] if header.quantity in ("", name))
        raise UnknownNameError("column", header.text, known, where)
    compared = having if len(having) == 1 else [name for name in having if name in wanted]
    if len(compared) != 1:
        *others, last = compared or having
        several = f"{', '.join(others)} or {last}"
        remedy = f"rename it, for example to {last}/{header.component}, or choose one quantity with --quantities"
        raise DescriptionError(f"column '{header.text}' may belong to {several}", where, remedy)
    return compared[0]


def _lacks(
    name: str, values: Mapping[str, Values], names: Names, wanted: Collection[str], samples: list[str]
) -> tuple[tuple[str, ...], list[str]]:
    """Describe what a table lacks of the wanted quantities: in one sentence, and in notes that list components."""
    lost = [quantity for quantity in names if quantity in wanted and quantity not in values]
    short = [*samples, *[f"no {', '.join(lost)}"] * bool(lost)]
    long = [f"has {each}" for each in short]
    for quantity, has in values.items():
        if rest := [component for component in names[quantity][0] if component not in has.components]:
            short.append(f"only {len(has.components)} of the {len(names[quantity][0])} components of {quantity}")
            long.append(f"has no {', '.join(rest)} for {quantity}")
    return (f"{name} has {'; '.join(short)}",) if short else (), long


def _is_whole(values: Mapping[str, Values], names: Names, quantity: str) -> bool:
    return quantity in values and values[quantity].components == names[quantity][0]


def _assembly(scene: Scene, rows: Rows) -> Array:
    """Compute the scene's joint coordinates, at which tables without positions are judged. Shape (n, n_q)."""
    motion, mechanism = scene.motion.part(rows), scene.mechanism
    q = np.full((len(scene.t), len(mechanism.coordinates)), np.nan)
    q[rows] = positions(layout(mechanism), motion.y, motion.t, (motion.yd, motion.ydd))
    return q


def _unwind(values: Values, coordinates: Sequence[str], q: Array) -> Values:
    """Add whole revolutions to recorded angles if they otherwise fit: an encoder counts within one revolution.

    Args:
        q: All coordinates, computed from the scene. Shape (n, n_q).
    """
    off = q[:, [coordinates.index(name) for name in values.components]] - values.array
    turns = np.round(off / (2 * np.pi)) * [unit == "rad" for unit in values.units]
    near = np.nanmax(np.abs(off - 2 * np.pi * turns), axis=0) < NEAR
    return replace(values, array=values.array + 2 * np.pi * np.where(near, turns, 0.0))


def judge_table(scene: Scene, problem: Problem, answer: Solution, names: Names) -> pd.DataFrame:
    """Judge the quantities for which a table has all components, because the equations need all of them.

    Tolerances are at least the error that the table states for its values. Positions are judged only if the table
    contains them.
    """
    values = {name: one for name, one in answer.values.items() if _is_whole(answer.values, names, name)}

    def tolerance_of(quantity: str) -> float:
        usual, stated = scene.tolerance(quantity), scene.tables[answer.engine].error.get(quantity)
        if stated is None or quantity not in values:
            return usual
        columns = {u: [has == u for has in values[quantity].units] for u in values[quantity].units}
        return max(usual, *(stated / (largest(values[quantity].array[:, of]) or 1.0) for of in columns.values()))

    known = replace(answer, values=values, assembly=answer.assembly if values else None)
    rows = judge(scene.mechanism, problem, known, tolerance_of=tolerance_of)
    return rows if "joint_position" in values else rows[rows["residual"] != "loop_closure"]
