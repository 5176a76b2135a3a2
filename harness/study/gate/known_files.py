"""Smoke test of readers, diagnosis and import with model files of built-in mechanisms.

A URDF and an MJCF describe the same machine with different fixed links, frames and inertia axes. The diagnosis must
find both files equal, and must find differences that are planted in the MJCF.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from screwgauge.diagnosis.answer import Diagnosis
from screwgauge.diagnosis.diagnose import diagnose
from screwgauge.models.catalog import load_mechanism
from screwgauge.models.generate import model_texts
from screwgauge.models.importing.model import description, import_model
from screwgauge.reference.files import read_file
from screwgauge.scene.read import FOLDER
from screwgauge.study.gate.items import GateRow, Item
from screwgauge.study.gate.measure import GateSettings, compare_pair

_FILES = FOLDER / "files"
PAIR = (str(_FILES / "spatial-slider-crank.urdf"), str(_FILES / "spatial-slider-crank.xml"))
#: Property -> its item, a string in the MJCF, and its replacement: one value grows and one shrinks.
PLANTED = {"damping": ("slide", 'damping="0.5"', 'damping="0.505"'), "mass": ("rod", 'mass="0.05"', 'mass="0.0495"')}
#: Relative size of these differences; allowed error in the diagnosed size; allowed asymmetry between A - B and B - A.
SIZE, EXACTLY, ALIKE = 1e-2, 0.02, 1e-6
#: Mechanisms with loops, couplings of degree two and rotated inertias, whose home coordinates are nonzero, and with
#: couplings of several coordinates.
IMPORTED = ("ruse", "belt-leg")


def known_item() -> Item:
    """Return the pair as an item of a gate."""
    return Item("two-model-files", PAIR)


def known_row(item: Item, settings: GateSettings) -> GateRow:
    """Check that both files agree, that planted differences are found, and that imported models are unchanged."""
    row = compare_pair(item, settings)
    wrong = next(_failures(), "") if row.ok else ""
    return replace(row, status="failed", sentence=wrong) if wrong else row


def _failures() -> Iterator[str]:
    """Yield a sentence for each failed check of the model files."""
    urdf, text = PAIR[0], read_file(Path(PAIR[1]))
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for what, (item, here, there) in PLANTED.items():
            file = folder / f"{what}.xml"
            file.write_text(text.replace(here, there), encoding="utf-8")
            yield from _misses(what, item, diagnose(urdf, file), diagnose(file, urdf))
        for built_in in IMPORTED:
            yield from _import_deviations(folder, built_in)


def _misses(what: str, item: str, found: Diagnosis, back: Diagnosis) -> Iterator[str]:
    """Yield sentences on a planted difference that a diagnosis, in either order of the files, misses or misjudges."""
    planted = f"{what} of {item} changed by {SIZE:.0%}"
    for each in (found, back):
        told = [(one.what, one.item_a, one.size) for one in each.differences]
        if each.same or [one[:2] for one in told] != [(what, item)]:
            yield f"a planted difference ({planted}) is diagnosed as: {each.headline}"
            return
        if not abs(told[0][2] - SIZE) <= EXACTLY * SIZE:
            yield f"a planted difference ({planted}) is diagnosed with the size {told[0][2]:.3g}"
    one, other = (each.found.torques.value for each in (found, back))
    if not abs(one - other) <= ALIKE * max(one, other):
        yield f"a planted difference ({planted}) changes torques by {one:.3g}, but by {other:.3g} with files swapped"


def _import_deviations(folder: Path, name: str) -> Iterator[str]:
    """Yield a sentence if a description imported from the MJCF differs from the URDF."""
    texts = model_texts(load_mechanism(name))
    for ending in (".urdf", ".loops.toml", ".xml"):
        (folder / f"{name}{ending}").write_text(texts[f"{name}{ending}"], encoding="utf-8")
    imported = import_model(folder / f"{name}.xml")
    file = folder / f"{name}.toml"
    file.write_text(description(imported.mechanism), encoding="utf-8")
    again = diagnose(file, folder / f"{name}.urdf")
    if not again.same:
        yield f"the description imported from {name}.xml differs from {name}.urdf: {again.headline}"
