"""Differences of a user's model files from the description of a scene, with the keys by which a scene allows them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from screwgauge.engines.registry import Engine, get_engine
from screwgauge.models.catalog import load_mechanism
from screwgauge.models.check import expected_reading
from screwgauge.models.content import FORMATS
from screwgauge.models.readings.read import read
from screwgauge.models.readings.reading import Reading
from screwgauge.problem import ModelFiles
from screwgauge.reference.errors import ScrewgaugeError
from screwgauge.reference.files import read_file
from screwgauge.reference.mechanism import Mechanism
from screwgauge.reference.rotations import Array
from screwgauge.scene.scene import Scene
from screwgauge.solution import Mismatch
from screwgauge.study.user_files import of_loops, reader_of

if TYPE_CHECKING:
    from screwgauge.diagnosis.answer import Difference

#: What a description lacks of a file: `departures` tells what becomes of limits, all else is measured. Softness tells
#: how exactly a library keeps a constraint, and nothing of the machine.
_NOT_DESCRIBED = {"limits", "armature", "damping", "friction", "stiffness", "rest", "gravcomp", "softness"}
_NOT_DESCRIBED |= {"density", "viscosity", "actuator", "driven joint", "gear"}
#: What has a difference that is of no part: the model, or its loops file.
MODEL, LOOPS = "model", "loops"


def mismatches(scene: Scene, name: str, files: ModelFiles) -> tuple[Mismatch, ...]:
    """Mass properties, geometry, gravity and closures, the largest difference first; then the loops file."""
    who = f"A: the description, B: {files.model.name}"
    found = [
        Mismatch(f"{each.item_a or each.item_b or MODEL}.{each.what}", f"{each.sentence} ({who})", each.kind == "model")
        for each in physical(scene, name, files.model)
    ]
    return (*found, *(Mismatch(f"{LOOPS}.closure", sentence) for sentence in of_loops(scene, name, files)[1]))


def physical(scene: Scene, name: str, model: Path) -> list[Difference]:
    """Differences of a model file from the description, the largest first; those that rounding makes are marked.

    Args:
        name: The engine, which reads a file of the user's own; of formats that nobody here reads nothing is known.
    """
    # a scene without files of the user's own has no use for the diagnosis
    from screwgauge.diagnosis.answer import differences_of
    from screwgauge.diagnosis.explanation import compared
    from screwgauge.diagnosis.facts.fact import ALL, digits_of, rounded

    engine, mechanism = get_engine(name), scene.mechanism
    cut = engine.cut or "full"  # which a description is read as
    expected = expected_reading(mechanism, cut, scene.applied.g)
    try:
        actual = _own_reading(engine, model, mechanism, scene.applied.g)
        digits = digits_of(read_file(model)) if engine.reads in FORMATS else ALL
    except ScrewgaugeError:
        return []  # `departures` tells that it cannot be compared
    if actual is None:
        return []
    if actual.gravity is None and not actual.closures:  # of a URDF, whose loops and couplings stand beside it
        expected = replace(expected, closures={}, couplings=actual.couplings and expected.couplings)
    told = compared(expected, actual)
    facts = [fact for fact in rounded(told.facts, (ALL, digits)) if fact.what not in _NOT_DESCRIBED]
    order = ("model", "convention", "digits")
    facts.sort(key=lambda fact: (order.index(fact.kind), -fact.size))
    return [*differences_of(told.pair, facts)]


def _own_reading(engine: Engine, model: Path, mechanism: Mechanism, gravity: Array) -> Reading | None:
    """A user's model file as an engine reads it; None of a format that nobody here reads.

    Raises:
        ScrewgaugeError: It cannot be read.
    """
    if engine.reads == ".toml":
        return expected_reading(load_mechanism(model), "full", gravity)
    if engine.reads not in FORMATS:
        return None
    return read(
        model, reader_of(engine), home=dict(zip(mechanism.coordinates, map(float, mechanism.home), strict=True))
    )
