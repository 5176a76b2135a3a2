"""Public models put through import and run: one row each, with the reason where it ends early."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from time import process_time

import numpy as np
import pandas as pd
from campaigns.loaded import apart
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


@dataclass(frozen=True, slots=True)
class ImportRow:
    """What became of a model.

    Attributes:
        joints: Kinds of its joints, one letter each.
        freedoms, loops, couplings, actuators: How many.
        verdict: As of a random mechanism (see `verdict.judged`), or ``refused`` before any engine ran.
        max_scaled: Largest scaled error of a pair of engines, of `quantity`.
        loaded: Share by which MuJoCo's inverse dynamics of the file itself differ, see `loaded.apart`.
        import_s, run_s: Processor time of this process [s].
    """

    model: str
    source: str
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
    loaded: str = ""
    reason: str = ""
    import_s: float = 0.0
    run_s: float = 0.0
    remarks: str = ""
    left_out: str = ""


def imports(models: Sequence[Public], progress: Callable[[str, float], None]) -> pd.DataFrame:
    """A row for each model, a column for each field of `ImportRow`."""
    table = rows_in_turn([(model.name, partial(import_row, model)) for model in models], progress)
    return frame(table, columns_of(ImportRow))


def import_row(model: Public) -> ImportRow:
    """Imports a model, and drives all engines with its default scene at a few samples."""
    row = ImportRow(model.name, model.source, "URDF" if model.file.suffix == ".urdf" else "MJCF")
    begin = process_time()
    try:
        imported = import_isolated(model.file, Options(floating=model.floating))
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
            own = apart(model.file, imported, scene.at(scene.t[some]))
    except ScrewgaugeError as error:
        return replace(row, reason=error.what)
    return replace(
        row,
        verdict=str(outcome["verdict"]),
        max_scaled=str(outcome.get("max_scaled", "")),
        quantity=str(outcome.get("quantity", "")),
        loaded="" if np.isnan(own) else f"{own:.2g}",
        reason=str(outcome.get("reason") or outcome.get("judge", "")),
        run_s=round(process_time() - begin, 2),
    )


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
SHOWN += " | as loaded = {loaded}"
PAGE = study(
    "imports.csv",
    "Public models",
    _banner,
    reasons=lambda table: [row for row in rows(table) if row["reason"]],
    models=lambda table: by_source(rows(table), SHOWN),
    omitted=lambda table: [row for row in rows(table) if row["left_out"]],
)
