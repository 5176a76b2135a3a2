"""Edits of public arms, hands and legs, each put to `diagnose` against the file as it was published.

An edit changes physics, changes content besides rigid bodies, or only the way in which a file states the same.
"""

import xml.etree.ElementTree as ET
from collections.abc import Callable, Iterator
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pandas as pd
from campaigns.corpus.parts import NoPlaceError
from campaigns.editors.content import CONTENT
from campaigns.editors.elements import Edit
from campaigns.editors.forms import FORMS
from campaigns.editors.rigid import RIGID
from campaigns.page import study
from campaigns.public import ROBOTS, installed

import screwgauge
from screwgauge.report.blocks import Banner
from screwgauge.study.formatting import rows

SEED, COUNT = 2026, 60
KINDS = {**RIGID, **CONTENT, **FORMS}
#: Kinds that change no force at a given motion: models stay the same.
SAME = (*FORMS, "integrator")


def edits(count: int, progress: Callable[[str, float], None]) -> pd.DataFrame:
    models = {
        name: installed(package, file) for package, files in ROBOTS["edits"].items() for name, file in files.items()
    }
    table = []
    for number in range(count):
        kind = [*KINDS][number % len(KINDS)]
        progress(kind, number / count)
        name, root, edit = next(_edited(models, kind, np.random.default_rng([SEED, number])))
        table.append({"number": number, "model": name, "kind": kind, **row(models[name], root, edit, kind)})
    return pd.DataFrame(table)


def _edited(models: dict[str, Path], kind: str, rng: np.random.Generator) -> Iterator[tuple[str, ET.Element, Edit]]:
    for name in map(str, rng.permutation([*models])):
        root = ET.parse(models[name]).getroot()
        try:
            yield name, root, KINDS[kind](root, rng)
        except (NoPlaceError, ValueError):
            continue


def row(file: Path, root: ET.Element, edit: Edit, kind: str) -> dict[str, object]:
    cells = {"edit": edit.what, "expected": "same" if kind in SAME else "not same"}
    with TemporaryDirectory() as folder:
        b = Path(folder) / f"edited{file.suffix}"
        ET.ElementTree(root).write(b, encoding="unicode")
        if edit.beside:
            (b.parent / "robot.yaml").write_text(edit.beside, encoding="utf-8")
        try:
            diagnosis = screwgauge.diagnose(file, b)
        except screwgauge.ScrewgaugeError as error:
            refused = str(error).replace(folder, "").replace(str(file.parent), "")
            return {**cells, "said": "refused", "named": "", "verdict": refused}
    text = " ".join([diagnosis.verdict, *(each.sentence for each in diagnosis.differences), *diagnosis.notes])
    named = edit.item in text if edit.item else ""
    return {**cells, "said": "same" if diagnosis.same else "not same", "named": named, "verdict": diagnosis.verdict}


def wrong(table: pd.DataFrame) -> pd.DataFrame:
    return table[(table["expected"] != table["said"]) & (table["said"] != "refused") | (table["named"] == False)]  # noqa: E712


def _banner(table: pd.DataFrame) -> Banner:
    off, refused = len(wrong(table)), int((table["said"] == "refused").sum())
    return Banner.of(f"{len(table)} edits: {off} with a wrong verdict or part, {refused} refused.", not off)


PAGE = study(
    "edits.csv",
    "Edits of public arms, hands and legs",
    _banner,
    edits=lambda table: [{**row, "edit": f"{row['kind']}: {row['edit']}"} for row in rows(table)],
)
