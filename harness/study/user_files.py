"""Files of the user: tables of numbers as the answer of an engine, and model files against the description."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from xml.etree.ElementTree import ParseError

import numpy as np
import pandas as pd

from screwgauge.engines.registry import ENGINES, Engine, engine_names, get_engine
from screwgauge.judging.answer import largest
from screwgauge.judging.judge import judge
from screwgauge.models.catalog import load_mechanism
from screwgauge.models.check import (
    SUFFIXES,
    CheckRow,
    ModelComparison,
    check_file,
    compare_loops,
    compare_readings,
    expected_reading,
)
from screwgauge.models.content import FORMATS, extras, unread_rows
from screwgauge.models.files.loops import loops_of
from screwgauge.models.importing.left_out import check_whole, left_out_of
from screwgauge.models.readings.read import read_source
from screwgauge.models.readings.source import prepare
from screwgauge.problem import ModelFiles, Problem, Rows
from screwgauge.quantities import QUANTITIES, Names
from screwgauge.reference.closed.assembly_mode import positions
from screwgauge.reference.courses import same_times
from screwgauge.reference.errors import (
    DescriptionError,
    ModelFileError,
    UnknownNameError,
    check_choice,
    first_few,
)
from screwgauge.reference.graph import layout
from screwgauge.reference.left_out import LeftOut, Resistance, TurnResistance
from screwgauge.reference.mechanism import Mechanism
from screwgauge.reference.rotations import Array
from screwgauge.scene.observables import Header, Recorded, read_header
from screwgauge.scene.rest import unique
from screwgauge.scene.scene import Scene
from screwgauge.solution import REFERENCE, Solution, Values, empty
from screwgauge.study.fixed import with_fixed

#: An angle that is so close to that of the scene, whole turns aside, is meant to be that [rad].
NEAR = 0.1
NO_TREE = "joint forces of an open tree are those of the tree that an engine cuts"

Columns = dict[str, dict[str, Array]]
"""Quantity -> component -> values."""


def check_tables(scene: Scene) -> None:
    """Refuses tables whose names are taken.

    Raises:
        DescriptionError: One is.
    """
    for name in {*engine_names(), REFERENCE} & {*scene.tables}:
        why = "as an engine is" if name != REFERENCE else "as the reference of a simulation is"
        raise DescriptionError(f"a table is called '{name}', {why}", f"{scene.file or scene.name}, tables", "rename it")


def recorded(scene: Scene, name: str, names: Names, wanted: Collection[str]) -> Solution:
    """A table as an answer.

    Args:
        name: That of the table.
        names: Components and units of every quantity that a table may have.
        wanted: Names of quantities; others are not compared, and a note names them.

    Raises:
        ScrewgaugeError: It has unknown columns or other units, or nothing of what is compared.
    """
    table, n = scene.tables[name], len(scene.t)
    (rows, at), columns = same_times(scene.t, table.t), _columns(table, names, wanted)
    skipped = len(table.t) - len(np.unique(at))
    if any(QUANTITIES[quantity].needs == "f" for quantity in columns):
        told = unique(scene)
        rows, at, n = rows[told[rows]], at[told[rows]], int(told.sum())
    if not rows.size:
        raise DescriptionError("has none of the times of the scene", table.where, "ask for times that it has")
    values: dict[str, Values] = {}
    for quantity in (quantity for quantity in names if quantity in wanted and quantity in columns):
        units = {name: unit for name, unit in zip(*names[quantity], strict=True) if name in columns[quantity]}
        array = np.full((len(scene.t), len(units)), np.nan)
        array[rows] = np.stack([columns[quantity][name][at] for name in units], axis=1)
        values[quantity] = Values(tuple(units), tuple(units.values()), array)
    if not values:
        what = f"gives nothing of what is compared ({', '.join(wanted)})"
        raise DescriptionError(what, table.where, "ask for its quantities, or leave it out")
    values, assembly = with_fixed(scene.mechanism, values), _assembly(scene, rows)
    if "joint_position" in values:
        values["joint_position"] = _unwound(values["joint_position"], scene.mechanism.coordinates, assembly)
    short, long = _left_out(name, values, names, wanted, [f"only {len(rows)} of the {n} samples"] * (len(rows) < n))
    unused = [f"gives {quantity}, which is not compared" for quantity in columns if quantity not in wanted]
    if skipped:
        unused.append(f"{skipped} of its {len(table.t)} times are not compared: the scene has others")
    unused += [f"{name} is converted to SI units" for name in table.converted]
    return Solution(
        engine=name,
        version=table.file.name if table.file else table.where,
        values=values,
        condition=empty(len(scene.t)),
        notes=(*long, *unused, *(f"gives no {tree}: {NO_TREE}" for tree in wanted if tree.startswith("tree_force"))),
        assembly=None if _whole(values, names, "joint_position") else assembly,
        rows=None if len(rows) == len(scene.t) else rows,
        warnings=short,
    )


def _columns(table: Recorded, names: Names, wanted: Collection[str]) -> Columns:
    """Columns of a table by quantity and component."""
    columns: Columns = {}
    for text, values in table.columns.items():
        header = read_header(text)
        quantity = _quantity(header, names, wanted, table.where)
        components, units = names[quantity]
        header.check_unit(units[components.index(header.component)], table.where)
        if header.component in columns.setdefault(quantity, {}):
            raise DescriptionError(f"{header.component} of {quantity} is there twice", table.where, "remove one")
        columns[quantity][header.component] = values if header.factor == 1.0 else header.factor * values
    for quantity in table.error:
        check_choice("quantity", [quantity], columns, f"{table.where}, error")
    return columns


def _quantity(header: Header, names: Names, wanted: Collection[str], where: str) -> str:
    """The quantity of a column: the one it names, or the only compared one that has its component."""
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
        several = f"{', '.join(others)} and {last}"
        remedy = f"write {last}/{header.component}, or whichever it is, or ask for one of them by --quantities"
        raise DescriptionError(f"column '{header.text}' is of {several}", where, remedy)
    return compared[0]


def _left_out(
    name: str, values: Mapping[str, Values], names: Names, wanted: Collection[str], samples: list[str]
) -> tuple[tuple[str, ...], list[str]]:
    """What a table lacks of the wanted quantities: in one sentence, and in notes by component."""
    lost = [quantity for quantity in names if quantity in wanted and quantity not in values]
    short = [*samples, *[f"no {', '.join(lost)}"] * bool(lost)]
    long = [f"gives {each}" for each in short]
    for quantity, has in values.items():
        if rest := [component for component in names[quantity][0] if component not in has.components]:
            short.append(f"only {len(has.components)} of the {len(names[quantity][0])} components of {quantity}")
            long.append(f"of {quantity} it gives no {', '.join(rest)}")
    return (f"{name} gives {'; '.join(short)}",) if short else (), long


def _whole(values: Mapping[str, Values], names: Names, quantity: str) -> bool:
    return quantity in values and values[quantity].components == names[quantity][0]


def _assembly(scene: Scene, rows: Rows) -> Array:
    """Joint coordinates that follow from the scene, at which numbers without positions are judged. Shape (n, n_q)."""
    motion, mechanism = scene.motion.part(rows), scene.mechanism
    q = np.full((len(scene.t), len(mechanism.coordinates)), np.nan)
    q[rows] = positions(layout(mechanism), motion.y, motion.t, (motion.yd, motion.ydd))
    return q


def _unwound(values: Values, coordinates: Sequence[str], q: Array) -> Values:
    """Recorded angles with whole turns added where these and little else are missing: an encoder counts within one.

    Args:
        q: All coordinates, as they follow from the scene. Shape (n, n_q).
    """
    off = q[:, [coordinates.index(name) for name in values.components]] - values.array
    turns = np.round(off / (2 * np.pi)) * [unit == "rad" for unit in values.units]
    near = np.nanmax(np.abs(off - 2 * np.pi * turns), axis=0) < NEAR
    return replace(values, array=values.array + 2 * np.pi * np.where(near, turns, 0.0))


def judge_table(scene: Scene, problem: Problem, answer: Solution, names: Names) -> pd.DataFrame:
    """Judges those quantities of a table that have all of their components: equations hold for no others.

    What a table states as its error it may leave over; positions that it does not give are not judged.
    """
    values = {name: one for name, one in answer.values.items() if _whole(answer.values, names, name)}

    def tolerance_of(quantity: str) -> float:
        usual, stated = scene.tolerance(quantity), scene.tables[answer.engine].error.get(quantity)
        if stated is None or quantity not in values:
            return usual
        columns = {u: [has == u for has in values[quantity].units] for u in values[quantity].units}
        return max(usual, *(stated / (largest(values[quantity].array[:, of]) or 1.0) for of in columns.values()))

    known = replace(answer, values=values, assembly=answer.assembly if values else None)
    rows = judge(scene.mechanism, problem, known, tolerance_of=tolerance_of)
    return rows if "joint_position" in values else rows[rows["residual"] != "loop_closure"]


#: What an engine of this package makes of something beyond the description, by its kind.
_FATE = {"ignored": "ignored by {} in {}", "applied": "applied by {} in {}, beyond the description"}
MEASURED = "measured"  # which a run names with its size
_NOT_KNOWN = "not known whether applied by {} in {}"
SAME = 1e-12  # share of an amount that rounding of a gear leaves
_NAMED, _LONGEST = 3, 80  # things of a kind that are named, the others being counted; characters of one


def departures(scene: Scene, name: str, files: ModelFiles) -> tuple[str, ...]:
    """Sentences on differences between a user's model file and the description of the scene.

    Args:
        name: The engine, which reads a file of the user's own.
        files: That file, which the engine has loaded, and its loops file.
    """
    engine, mechanism = get_engine(name), scene.mechanism
    if engine.reads == ".toml":
        return tuple(_other_than_described(files.model, _of_description(mechanism, files.model)))
    if engine.reads not in FORMATS:
        return (_NOT_KNOWN.format(name, f"{files.model.name}: anything"),)
    reader = reader_of(engine)
    sentences = [
        *_beyond(mechanism, engine, files.model, known=name in ENGINES),
        *_other_than_described(
            files.model, check_file(mechanism, engine.cut, files.model, reader, gravity=scene.applied.g)
        ),
    ]
    ignored, other = of_loops(scene, name, files)
    return (*sentences, *ignored, *other)


def left_out_of_file(scene: Scene, engine: Engine, model: Path) -> tuple[LeftOut, ...]:
    """What acts in a user's model file and in no engine on the description, along its coordinates and on its bodies.

    Raises:
        ModelFileError: A constraint acts that the engine leaves out, or something that cannot be measured.
    """
    if engine.reads not in FORMATS:
        return ()
    source = prepare(model)
    reading = read_source(source, reader_of(engine))
    check_whole(reading, source)
    coupled = {coupling.coordinate for coupling in scene.mechanism.couplings}
    known, said = [{*coupling.named} for coupling in scene.mechanism.couplings], reading.couplings.values()
    if lost := [each.joint for each in said if each.joint not in coupled and {*each.named} not in known]:
        what = f"joint {first_few(lost, _NAMED)} follows another one or is held, which the description does not say"
        raise ModelFileError(what, str(model), "take its mimic or equality out, or give the description a coupling")
    mechanism, found = scene.mechanism, list[LeftOut]()
    known_amounts = {(one.coordinate, one.what): one.amount for one in mechanism.resistances}
    for one in left_out_of(source, reading):
        if isinstance(one, Resistance):
            along = {name: share for name, share in one.along.items() if name in mechanism.coordinates}
            reached = {body for body, _ in one.path} <= mechanism.body_index.keys()
            more = _more(replace(one, along=along), known_amounts)
            acts = more.armature or more.damping or more.friction or more.stiffness
            found += [more] if acts and (along or (one.path and reached)) else []
        elif not isinstance(one, TurnResistance) and one.body in mechanism.body_index:
            found.append(one)
    return tuple(found)


def _more(one: Resistance, known: dict[tuple[str, str], float]) -> Resistance:
    """What of it the description has not; what it has of `known` is used up."""
    if len(one.along) != 1 or len(one.damping) > 1:
        return one
    ((name, share),) = one.along.items()
    left = dict[str, float]()
    for what, unit, amount in (
        ("rotor", share**2, one.armature),
        ("damping", share**2, sum(one.damping)),
        ("friction", abs(share), one.friction),
    ):
        has = min(known.get((name, what), 0.0), unit * amount)
        known[name, what] = known.get((name, what), 0.0) - has
        more = amount - has / unit
        left[what] = more if abs(more) > SAME * amount else 0.0
    damping = (left["damping"],) if left["damping"] else ()
    return replace(one, armature=left["rotor"], damping=damping, friction=left["friction"])


def of_loops(scene: Scene, name: str, files: ModelFiles) -> tuple[list[str], list[str]]:
    """Sentences on differences of a user's loops file: those that the engine ignores, and the others."""
    if files.loops is None or files.loops != files.model.with_suffix(".loops.toml"):
        return [], []
    rows = check_file(scene.mechanism, get_engine(name).cut, files.loops, "loops")
    unread = unread_rows(name.partition("-")[0])
    ignored = _other_than_described(files.loops, (row for row in rows if row.what in unread), f"ignored by {name} in ")
    return [*ignored], [*_other_than_described(files.loops, (row for row in rows if row.what not in unread))]


def reader_of(engine: Engine) -> str:
    """The library that reads the model files of an engine; of another package, the one of its format."""
    own = engine.name.partition("-")[0]
    fitting = [name for name, ending in SUFFIXES.items() if ending == engine.reads]
    return own if own in fitting else fitting[0]


def _beyond(mechanism: Mechanism, engine: Engine, model: Path, *, known: bool) -> Iterator[str]:
    by_fate: dict[str, dict[str, list[str]]] = {}
    try:
        beyond = extras(model, FORMATS[engine.reads], mechanism)
    except (ParseError, LookupError, ValueError) as error:
        yield f"{model.name} cannot be searched for what is beyond the description ({error})"
        return
    for extra in (extra for extra in beyond if not (known and extra.kind == MEASURED)):
        fate = _FATE.get(extra.kind, _NOT_KNOWN) if known else _NOT_KNOWN
        by_fate.setdefault(fate, {}).setdefault(extra.what, []).append(extra.whose)
    for fate in sorted(by_fate, key=[*_FATE.values(), _NOT_KNOWN].index):
        things = (f"{what}{first_few(whose, 1)}" for what, whose in by_fate[fate].items())
        yield f"{fate.format(engine.name, model.name)}: {_listed(things)}"


def _of_description(mechanism: Mechanism, path: Path) -> list[CheckRow]:
    """Compares a user's description with that of the scene; their names may differ."""
    given, out = replace(load_mechanism(path), name=mechanism.name), ModelComparison(path.name, "screw")
    compare_loops(out, loops_of(mechanism, "full"), loops_of(given, "full"), mechanism)
    actual, expected = (expected_reading(one, "full", mechanism.home[:0]) for one in (given, mechanism))
    compare_readings(out, expected, replace(actual, gravity=None), mechanism)
    return out.rows


def _other_than_described(path: Path, rows: Iterable[CheckRow], fate: str = "") -> Iterator[str]:
    bad = [row for row in rows if not row.ok]
    if bad and bad[0].what == "file":
        yield f"{path.name} cannot be compared with the description: {bad[0].found}"
    elif bad:
        things = _listed(f"{row.what} of {row.item}" if row.item else row.what for row in bad)
        yield f"{fate}{path.name}, other than described: {things}"


def _listed(things: Iterable[str]) -> str:
    named = [thing if len(thing) <= _LONGEST else f"{thing[: _LONGEST - 3]}..." for thing in things]
    return first_few(named, _NAMED)
