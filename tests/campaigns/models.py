"""Public models put through import and run, and beside their own library: a row each, with the reason where it ends."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from time import process_time

import numpy as np
import pandas as pd
from campaigns.own_library import own_library
from campaigns.page import counted, study
from campaigns.public import Public, by_source
from campaigns.rows import rows_in_turn
from campaigns.verdict import judged

from screwgauge.judging.residual import columns_of, frame
from screwgauge.models.importing.model import Imported, Options
from screwgauge.reference.errors import ScrewgaugeError
from screwgauge.report.blocks import Banner
from screwgauge.scene.default import write_imported
from screwgauge.scene.read import load_scene
from screwgauge.study.formatting import rows
from screwgauge.study.loading import import_isolated
from screwgauge.study.run import run

ENGINES = ("screw", "pinocchio", "mujoco")
SAMPLES = 5
#: Suffix -> format; MJCF has that of all XML.
FORMATS = {".urdf": "URDF", ".sdf": "SDF", ".usd": "USD", ".usda": "USD", ".usdc": "USD", ".usdz": "USD"}


@dataclass(frozen=True, slots=True)
class ImportRow:
    """What became of a model.

    Attributes:
        joints: Kinds of its joints, one letter each.
        freedoms, loops, couplings, actuators: How many.
        verdict: As of a random mechanism (see `verdict.judged`), ``refused`` before any engine ran, or ``wrong`` where
            the library of its format has other inverse dynamics of the file.
        max_scaled: Largest scaled error of a pair of engines, of `quantity`.
        library, apart, states, untouched: See `own_library.OwnLibrary`; none where it cannot be asked.
        import_s, run_s: Processor time of this process [s].
    """

    model: str
    source: str
    version: str
    path: str
    format: str
    bodies: int = 0
    joints: str = ""
    freedoms: int = 0
    loops: int = 0
    couplings: int = 0
    actuators: int = 0
    verdict: str = "refused"
    max_scaled: str = ""
    quantity: str = ""
    library: str = ""
    apart: str = ""
    states: int = 0
    untouched: bool = False
    reason: str = ""
    import_s: float = 0.0
    run_s: float = 0.0
    remarks: str = ""
    left_out: str = ""


def imports(models: Sequence[Public], progress: Callable[[str, float], None]) -> pd.DataFrame:
    table = rows_in_turn([(model.name, partial(import_row, model)) for model in models], progress)
    return frame(table, columns_of(ImportRow))


def import_row(model: Public) -> ImportRow:
    form = FORMATS.get(model.file.suffix, "MJCF")
    row = ImportRow(model.name, model.source, model.version, model.path, form)
    begin = process_time()
    try:
        imported = import_isolated(model.file, Options(floating=model.floating, meshes=True))
    except ScrewgaugeError as error:
        return replace(row, reason=error.what)
    row = replace(_counted(row, imported), import_s=round(process_time() - begin, 2))
    begin = process_time()
    try:
        with TemporaryDirectory() as folder:
            _, file = write_imported(imported, Path(folder) / "model.toml")
            scene = load_scene(file)
            some = np.unique(np.linspace(0, len(scene.t) - 1, SAMPLES).astype(int))
            outcome = judged(run(scene.at(scene.t[some]), ENGINES))
    except ScrewgaugeError as error:
        return replace(row, reason=error.what)
    row = replace(
        row,
        verdict=str(outcome["verdict"]),
        max_scaled=str(outcome.get("max_scaled", "")),
        quantity=str(outcome.get("quantity", "")),
        reason=str(outcome.get("reason") or outcome.get("judge", "")),
        run_s=round(process_time() - begin, 2),
    )
    return _beside(row, model, imported)


def _beside(row: ImportRow, model: Public, imported: Imported) -> ImportRow:
    try:
        own = own_library(model.file, imported, floating=model.floating)
    except (ScrewgaugeError, ImportError, LookupError, ValueError) as error:
        return replace(row, reason=" ".join(filter(None, (row.reason, str(error)))))
    row = replace(row, library=own.library, apart=f"{own.apart:.2g}", states=own.states, untouched=own.untouched)
    return replace(row, verdict="wrong") if own.wrong else row


def _counted(row: ImportRow, imported: Imported) -> ImportRow:
    mechanism = imported.mechanism
    return replace(
        row,
        bodies=len(mechanism.bodies),
        joints="".join(joint.kind for joint in mechanism.joints),
        freedoms=len(mechanism.independent),
        loops=len(mechanism.joints) - len(mechanism.bodies),
        couplings=len(mechanism.couplings),
        actuators=len(mechanism.actuators),
        remarks=" ".join(imported.remarks[1:]),
        left_out="; ".join(imported.left_out),
    )


def _banner(table: pd.DataFrame) -> Banner:
    closed, free = int((table["loops"] > 0).sum()), sum("F" in kinds for kinds in table["joints"])
    have = f"{closed} have closed loops, {free} bodies that move freely."
    return Banner(f"{len(table)} models: {counted(table['verdict'])}. {have}")


SHOWN = "model | format | bodies | joints | freedoms | loops | couplings | actuators | verdict | error = {max_scaled}"
SHOWN += " | own library = {library} | apart = {apart}"
PAGE = study(
    "imports.csv",
    "Public models",
    _banner,
    reasons=lambda table: [row for row in rows(table) if row["reason"]],
    models=lambda table: by_source(rows(table), SHOWN),
    omitted=lambda table: [row for row in rows(table) if row["left_out"]],
)
