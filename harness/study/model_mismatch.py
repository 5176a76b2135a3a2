"""Differences of a user's model file from the description, and what the engine makes of them."""

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
    Comparison,
    check_file,
    compare_loops,
    compare_readings,
    expected_reading,
)
from screwgauge.models.content import FORMATS, extras, unread_rows
from screwgauge.models.readings.read import LIBRARIES, read
from screwgauge.models.urdf import loops_of
from screwgauge.problem import ModelFiles
from screwgauge.reference.errors import ScrewgaugeError, first_few
from screwgauge.reference.files import read_file
from screwgauge.reference.mechanism import Mechanism
from screwgauge.scene.scene import Scene

if TYPE_CHECKING:
    from screwgauge.diagnosis.differences.change import Difference

#: Library -> what the description does not say and the library does not apply: `departures` says what becomes of it.
_UNUSED = {"pinocchio": {"limits", "damping", "friction", "stiffness", "rest"}, "mujoco": {"limits"}}

#: What an engine of this package makes of something beyond the description, by its kind.
_FATE = {"ignored": "ignored by {} in {}", "applied": "applied by {} in {}, beyond the description"}
_NOT_KNOWN = "not known whether applied by {} in {}"
_NAMED, _LONGEST = 3, 80  # things of a kind that are named, the others being counted; characters of one


def departures(scene: Scene, name: str, files: ModelFiles) -> tuple[str, ...]:
    """Sentences on what is otherwise than in the description of the scene; none if nothing is.

    Args:
        name: The engine, which reads a file of the user's own.
        files: That file, which the engine has loaded, and its loops file.
    """
    engine, mechanism = get_engine(name), scene.mechanism
    if engine.reads == ".toml":
        return tuple(_other_than_described(files.model, _of_description(mechanism, files.model)))
    if engine.reads not in FORMATS:
        return (_NOT_KNOWN.format(name, f"{files.model.name}: anything"),)
    known, library = name in ENGINES, name.partition("-")[0]
    reader = library if known else _reader(engine)
    said = [
        *_beyond(mechanism, engine, files.model, known=known),
        *_other_than_described(
            files.model, check_file(mechanism, engine.cut, files.model, reader, gravity=scene.applied.g)
        ),
    ]
    ignored, other = of_loops(scene, name, files)
    return (*said, *ignored, *other)


def physical_mismatch(scene: Scene, name: str, files: ModelFiles) -> tuple[str, ...]:
    """Sentences on mass properties, geometry, gravity and closures, the largest difference first; on the loops file."""
    from screwgauge.diagnosis.differences.words import with_sides

    sides = "in the description", f"in {files.model.name}"
    said = (with_sides(each.sentence, *sides) for each in physical(scene, name, files.model))
    return (*said, *of_loops(scene, name, files)[1])


def physical(scene: Scene, name: str, model: Path) -> list[Difference]:
    """Differences of a model file from the description, the largest first; those that rounding makes are marked.

    Args:
        name: The engine, which reads a URDF or MJCF of the user's own; of others nothing is said.
    """
    # a scene without files of the user's own has no use for the diagnosis
    from screwgauge.diagnosis.differences.digits import ALL, digits_of, marked
    from screwgauge.diagnosis.differences.static import differences, sorted_by_size
    from screwgauge.diagnosis.pairing.branches import missing
    from screwgauge.diagnosis.pairing.common import brought
    from screwgauge.diagnosis.pairing.mapping import paired

    engine, mechanism, library = get_engine(name), scene.mechanism, name.partition("-")[0]
    if library not in LIBRARIES or engine.reads not in (".urdf", ".xml"):
        return []
    expected = expected_reading(mechanism, engine.cut, scene.applied.g)
    try:
        home = dict(zip(mechanism.coordinates, map(float, mechanism.home), strict=True))
        found = read(model, library, home=home)
        digits = digits_of(read_file(model))
    except ScrewgaugeError:
        return []  # `departures` says that it cannot be compared
    silent = _UNUSED.get(library, set()) | ({"closure", "gravity", "coupling"} if found.gravity is None else set())
    pairing = paired(expected, found)
    said = [*missing(expected, found, pairing), *differences(brought(expected, found, pairing))[0]]
    return sorted_by_size([each for each in marked(said, (ALL, digits)) if each.what not in silent])


def of_loops(scene: Scene, name: str, files: ModelFiles) -> tuple[list[str], list[str]]:
    """A sentence on what a loops file of the user's own says otherwise that the engine ignores, and one on the rest."""
    if files.loops is None or files.loops != files.model.with_suffix(".loops.toml"):
        return [], []
    rows = check_file(scene.mechanism, get_engine(name).cut, files.loops, "loops")
    unread = unread_rows(name.partition("-")[0])
    ignored = _other_than_described(files.loops, (row for row in rows if row.what in unread), f"ignored by {name} in ")
    return [*ignored], [*_other_than_described(files.loops, (row for row in rows if row.what not in unread))]


def _reader(engine: Engine) -> str:
    """What reads the model files of an engine of another package."""
    return next(name for name, ending in SUFFIXES.items() if ending == engine.reads)


def _beyond(mechanism: Mechanism, engine: Engine, model: Path, *, known: bool) -> Iterator[str]:
    found: dict[str, dict[str, list[str]]] = {}
    try:
        said = extras(model, FORMATS[engine.reads], mechanism)
    except (ParseError, LookupError, ValueError) as error:
        yield f"{model.name} cannot be searched for what is beyond the description ({error})"
        return
    for extra in said:
        fate = _FATE.get(extra.kind, _NOT_KNOWN) if known else _NOT_KNOWN
        found.setdefault(fate, {}).setdefault(extra.what, []).append(extra.whose)
    for fate in sorted(found, key=[*_FATE.values(), _NOT_KNOWN].index):
        things = (f"{what}{first_few(whose, 1)}" for what, whose in found[fate].items())
        yield f"{fate.format(engine.name, model.name)}: {_listed(things)}"


def _of_description(mechanism: Mechanism, path: Path) -> list[CheckRow]:
    """A description of the user's own against that of the scene; their names may differ."""
    own, out = replace(load_mechanism(path), name=mechanism.name), Comparison(path.name, "screw")
    compare_loops(out, loops_of(mechanism, "full"), loops_of(own, "full"), mechanism)
    said, expected = (expected_reading(one, "full", mechanism.home[:0]) for one in (own, mechanism))
    compare_readings(out, expected, replace(said, gravity=None), mechanism)
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
