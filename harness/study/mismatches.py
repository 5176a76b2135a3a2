"""Comparison of a user's model files with the description of a scene: differences, keys for allowing them, and forces
that only the files contain.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING
from xml.etree.ElementTree import ParseError

from screwgauge.engines.registry import ENGINES, Engine, get_engine
from screwgauge.models.catalog import load_mechanism
from screwgauge.models.check import (
    SUFFIXES,
    CheckRow,
    check_file,
    compare_loops,
    compare_readings,
    expected_reading,
)
from screwgauge.models.content import FORMATS, extras, unread_rows
from screwgauge.models.files.loops import loops_of
from screwgauge.models.importing.left_out import check_whole, left_out_of
from screwgauge.models.readings.read import read, read_source
from screwgauge.models.readings.reading import Reading
from screwgauge.models.readings.source import prepare
from screwgauge.problem import ModelFiles
from screwgauge.reference.errors import ModelFileError, ScrewgaugeError, first_few
from screwgauge.reference.files import read_file
from screwgauge.reference.left_out import LeftOut, StrokeResistance, TurnResistance
from screwgauge.reference.mechanism import Mechanism
from screwgauge.reference.rotations import Array
from screwgauge.scene.scene import Scene
from screwgauge.solution import Mismatch

if TYPE_CHECKING:
    from screwgauge.diagnosis.answer import Difference

#: Properties of a file that a description lacks: `departures` reports the use of limits, and all others are measured.
#: Softness states how exactly a library satisfies a constraint; it is not a property of the machine.
_NOT_DESCRIBED = {"limits", "armature", "damping", "friction", "stiffness", "rest", "gravcomp", "softness"}
_NOT_DESCRIBED |= {"density", "viscosity", "actuator", "driven joint", "gear"}
#: Owners of differences that concern no single part: the model, or its loops file.
MODEL, LOOPS = "model", "loops"


def mismatches(scene: Scene, name: str, files: ModelFiles) -> tuple[Mismatch, ...]:
    """Return differences in masses, geometry, gravity and closures, largest first, then those in the loops file."""
    who = f"A: the description, B: {files.model.name}"
    found = [
        Mismatch(f"{each.item_a or each.item_b or MODEL}.{each.what}", f"{each.sentence} ({who})", each.kind == "model")
        for each in physical_differences(scene, name, files.model)
    ]
    return (*found, *(Mismatch(f"{LOOPS}.closure", sentence) for sentence in loop_differences(scene, name, files)[1]))


def physical_differences(scene: Scene, name: str, model: Path) -> list[Difference]:
    """Return differences between a model file and the description, largest first, and mark those due to rounding.

    Args:
        name: Name of the engine that reads the user's file; no differences are found in formats that this package
            cannot read.
    """
    # not needed for scenes without the user's own files
    from screwgauge.diagnosis.answer import differences_of
    from screwgauge.diagnosis.explanation import compare_readings
    from screwgauge.diagnosis.facts.fact import ALL, digits_of, mark_rounding

    engine, mechanism = get_engine(name), scene.mechanism
    cut = engine.cut or "full"  # the cut used for a description
    expected = expected_reading(mechanism, cut, scene.applied.g)
    try:
        actual = _own_reading(engine, model, mechanism, scene.applied.g)
        digits = digits_of(read_file(model)) if engine.reads in FORMATS else ALL
    except ScrewgaugeError:
        return []  # `departures` reports that the file cannot be compared
    if actual is None:
        return []
    if actual.gravity is None and not actual.closures:  # a URDF, whose loops and couplings are in a separate file
        expected = replace(expected, closures={}, couplings=actual.couplings and expected.couplings)
    told = compare_readings(expected, actual)
    facts = [fact for fact in mark_rounding(told.facts, (ALL, digits)) if fact.what not in _NOT_DESCRIBED]
    order = ("model", "convention", "digits")
    facts.sort(key=lambda fact: (order.index(fact.kind), -fact.size))
    return [*differences_of(told.pair, facts)]


def _own_reading(engine: Engine, model: Path, mechanism: Mechanism, gravity: Array) -> Reading | None:
    """Read a user's model file as an engine does; return None for formats without a reader in this package.

    Raises:
        ScrewgaugeError: The file cannot be read.
    """
    if engine.reads == ".toml":
        return expected_reading(load_mechanism(model), "full", gravity)
    if engine.reads not in FORMATS:
        return None
    return read(
        model, reader_of(engine), home=dict(zip(mechanism.coordinates, map(float, mechanism.home), strict=True))
    )


#: How an engine of this package treats properties that the description lacks -> phrase for a sentence.
_FATE = {"ignored": "ignored by {} in {}", "applied": "applied by {} in {}, but not described"}
MEASURED = "measured"  # a run reports the size of such a property
_NOT_KNOWN = "may or may not be applied by {} in {}"
SAME = 1e-12  # relative error in an amount due to rounding of a gear
_NAMED, _LONGEST = 3, 80  # largest number of items of a kind that are named, and largest length of an item


def departures(scene: Scene, name: str, files: ModelFiles) -> tuple[str, ...]:
    """Return sentences on differences between a user's model file and the description of the scene.

    Args:
        name: Name of the engine that reads the user's file.
        files: The file, which the engine has loaded, and its loops file.
    """
    engine, mechanism = get_engine(name), scene.mechanism
    if engine.reads == ".toml":
        return tuple(_deviations(files.model, _of_description(mechanism, files.model)))
    if engine.reads not in FORMATS:
        return (_NOT_KNOWN.format(name, f"{files.model.name}: anything"),)
    reader = reader_of(engine)
    sentences = [
        *_extra_contents(mechanism, engine, files.model, known=name in ENGINES),
        *_deviations(files.model, check_file(mechanism, engine.cut, files.model, reader, gravity=scene.applied.g)),
    ]
    ignored, other = loop_differences(scene, name, files)
    return (*sentences, *ignored, *other)


def left_out_of_file(scene: Scene, engine: Engine, model: Path) -> tuple[LeftOut, ...]:
    """Find forces in a user's model file that no engine includes, along coordinates and on bodies of a scene.

    Raises:
        ModelFileError: The file has an active constraint that the engine ignores, or a force that cannot be measured.
    """
    if engine.reads not in FORMATS:
        return ()
    source = prepare(model)
    reading = read_source(source, reader_of(engine))
    check_whole(reading, source)
    coupled = {coupling.coordinate for coupling in scene.mechanism.couplings}
    known, said = [{*coupling.named} for coupling in scene.mechanism.couplings], reading.couplings.values()
    if lost := [each.joint for each in said if each.joint not in coupled and {*each.named} not in known]:
        what = f"joint {first_few(lost, _NAMED)} follows another joint or is locked, unlike in the description"
        raise ModelFileError(what, str(model), "remove its mimic or equality, or add a coupling to the description")
    mechanism, found = scene.mechanism, list[LeftOut]()
    known_amounts = {(one.coordinate, one.what): one.amount for one in mechanism.resistances}
    for one in left_out_of(source, reading):
        if isinstance(one, StrokeResistance):
            along = {name: share for name, share in one.along.items() if name in mechanism.coordinates}
            reached = {body for body, _ in one.path} <= mechanism.body_index.keys()
            more = _excess(replace(one, along=along), known_amounts)
            acts = more.armature or more.damping or more.friction or more.stiffness
            found += [more] if acts and (along or (one.path and reached)) else []
        elif not isinstance(one, TurnResistance) and one.body in mechanism.body_index:
            found.append(one)
    return tuple(found)


def _excess(one: StrokeResistance, known: dict[tuple[str, str], float]) -> StrokeResistance:
    """Reduce a resistance to its excess over the description; subtract the part that is described from `known`."""
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


def loop_differences(scene: Scene, name: str, files: ModelFiles) -> tuple[list[str], list[str]]:
    """Return sentences on differences in a user's loops file: in entries that the engine ignores, and in all others."""
    if files.loops is None or files.loops != files.model.with_suffix(".loops.toml"):
        return [], []
    rows = check_file(scene.mechanism, get_engine(name).cut, files.loops, "loops")
    unread = unread_rows(name.partition("-")[0])
    ignored = _deviations(files.loops, (row for row in rows if row.what in unread), f"ignored by {name} in ")
    return [*ignored], [*_deviations(files.loops, (row for row in rows if row.what not in unread))]


def reader_of(engine: Engine) -> str:
    """Return the library that reads an engine's model files; for an external engine, the library of their format."""
    own = engine.name.partition("-")[0]
    fitting = [name for name, ending in SUFFIXES.items() if ending == engine.reads]
    return own if own in fitting else fitting[0]


def _extra_contents(mechanism: Mechanism, engine: Engine, model: Path, *, known: bool) -> Iterator[str]:
    by_fate: dict[str, dict[str, list[str]]] = {}
    try:
        beyond = extras(model, FORMATS[engine.reads], mechanism)
    except (ParseError, LookupError, ValueError) as error:
        yield f"{model.name} cannot be searched for properties that the description lacks ({error})"
        return
    for extra in (extra for extra in beyond if not (known and extra.kind == MEASURED)):
        fate = _FATE.get(extra.kind, _NOT_KNOWN) if known else _NOT_KNOWN
        by_fate.setdefault(fate, {}).setdefault(extra.what, []).append(extra.whose)
    for fate in sorted(by_fate, key=[*_FATE.values(), _NOT_KNOWN].index):
        things = (f"{what}{first_few(whose, 1)}" for what, whose in by_fate[fate].items())
        yield f"{fate.format(engine.name, model.name)}: {_list(things)}"


def _of_description(mechanism: Mechanism, path: Path) -> list[CheckRow]:
    """Compare a user's description with the description of the scene, ignoring the names of both."""
    given = replace(load_mechanism(path), name=mechanism.name)
    actual, expected = (expected_reading(one, "full", mechanism.home[:0]) for one in (given, mechanism))
    return [
        *compare_loops(loops_of(mechanism, "full"), loops_of(given, "full"), mechanism),
        *compare_readings(expected, replace(actual, gravity=None), mechanism),
    ]


def _deviations(path: Path, rows: Iterable[CheckRow], fate: str = "") -> Iterator[str]:
    bad = [row for row in rows if not row.ok]
    if bad and bad[0].what == "file":
        yield f"{path.name} cannot be compared with the description: {bad[0].found}"
    elif bad:
        things = _list(f"{row.what} of {row.item}" if row.item else row.what for row in bad)
        yield f"{fate}{path.name}, unlike the description: {things}"


def _list(things: Iterable[str]) -> str:
    named = [thing if len(thing) <= _LONGEST else f"{thing[: _LONGEST - 3]}..." for thing in things]
    return first_few(named, _NAMED)
