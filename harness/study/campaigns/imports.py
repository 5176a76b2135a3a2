"""Public models put through import and run: one row each, with the reason where it ends early."""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path
from tempfile import TemporaryDirectory
from time import process_time

import numpy as np
import pandas as pd

from screwgauge.models.importing import is_model
from screwgauge.models.importing.convert import Imported
from screwgauge.models.importing.model import Options
from screwgauge.reference.errors import DescriptionError, ScrewgaugeError
from screwgauge.scene.imported import write_imported
from screwgauge.scene.read import load_scene
from screwgauge.study.campaigns.campaign import judged
from screwgauge.study.loading import import_apart
from screwgauge.study.run import run
from screwgauge.study.table import columns_of, frame

#: Models of packages that the extra ``study`` installs.
LIST = Path(__file__).with_name("public.toml")
ENGINES = ("screw", "pinocchio", "mujoco")
SAMPLES = 5


@dataclass(frozen=True, slots=True)
class Public:
    """A model file of others.

    Attributes:
        name: Its path in there, without the ending.
        source: Package, or folder, that it is from.
        floating: Its base moves freely, which a URDF does not say.
    """

    file: Path
    name: str
    source: str
    floating: bool = False


@dataclass(frozen=True, slots=True)
class ImportRow:
    """What became of a model.

    Attributes:
        joints: Kinds of its joints, one letter each.
        freedoms, loops, couplings, actuators: How many.
        verdict: As of a random mechanism (see `campaign.judged`), or ``refused`` before any engine ran.
        max_scaled: Largest scaled error of a pair of engines, of `quantity`.
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
    reason: str = ""
    import_s: float = 0.0
    run_s: float = 0.0
    remarks: str = ""
    left_out: str = ""


def listed_models() -> list[Public]:
    """Models of the installed packages.

    Raises:
        DescriptionError: A package is not installed.
    """
    found = []
    for package, models in tomllib.loads(LIST.read_text(encoding="utf-8")).items():
        try:
            root = distribution(package)
        except PackageNotFoundError:
            raise DescriptionError(f"{package} is not installed", "public models", "pip install '.[study]'") from None
        for name in models["files"]:
            path = Path(str(root.locate_file(f"{models['folder']}/{name}")))
            found.append(Public(path, _label(name), package, name in models.get("floating", ())))
    return found


def models_in(folders: Iterable[Path]) -> list[Public]:
    """All model files in some folders."""
    return [
        Public(path, _label(path.relative_to(folder)), folder.name)
        for folder in folders
        for path in sorted(folder.rglob("*"))
        if is_model(path)
    ]


def _label(path: Path | str) -> str:
    return Path(path).with_suffix("").as_posix()


def imports(
    models: Sequence[Public], progress: Callable[[str, float], None] = lambda step, share: None
) -> pd.DataFrame:
    """A row for each model, a column for each field of `ImportRow`."""
    rows = []
    for i, model in enumerate(models):
        progress(model.name, i / len(models))
        rows.append(import_row(model))
    return frame(rows, columns_of(ImportRow))


def import_row(model: Public) -> ImportRow:
    """Imports a model, and drives all engines with its default scene at a few samples."""
    row = ImportRow(model.name, model.source, "URDF" if model.file.suffix == ".urdf" else "MJCF")
    begin = process_time()
    try:
        imported = import_apart(model.file, Options(floating=model.floating))
    except ScrewgaugeError as error:
        return replace(row, reason=error.what)
    row = replace(_counted(row, imported), import_s=round(process_time() - begin, 2))
    begin = process_time()
    try:
        with TemporaryDirectory() as folder:
            _, file = write_imported(imported, Path(folder) / "model.toml")
            scene = load_scene(file)
            rows = np.unique(np.linspace(0, len(scene.t) - 1, SAMPLES).astype(int))
            found = judged(run(scene.at(scene.t[rows]), ENGINES))
    except ScrewgaugeError as error:
        return replace(row, reason=error.what)
    return replace(
        row,
        verdict=str(found["verdict"]),
        max_scaled=str(found.get("max_scaled", "")),
        quantity=str(found.get("quantity", "")),
        reason=str(found.get("reason") or found.get("judge", "")),
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
