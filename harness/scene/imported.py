"""Writes what was imported: description and scene, both or none."""

from __future__ import annotations

import os
import tempfile
from dataclasses import replace
from pathlib import Path

from screwgauge.models.catalog import load_mechanism
from screwgauge.models.importing.convert import Imported
from screwgauge.models.importing.model import notes
from screwgauge.models.importing.write import description
from screwgauge.reference.errors import OutputError
from screwgauge.reference.files import check_free, stamped
from screwgauge.scene.default import SUFFIX, acting_on, default_scene


def write_imported(imported: Imported, file: Path, *, force: bool = False) -> tuple[Path, Path]:
    """Writes the description and, beside it, its scene.

    Args:
        force: Files in the way are replaced, whoever wrote them.

    Returns:
        Their paths.

    Raises:
        OutputError: They cannot be written, or a file is there that is not as it was written here.
        ScrewgaugeError: No scene can be made.
    """
    if file.suffix != ".toml":
        raise OutputError("is no name of a description", str(file), "let it end in .toml")
    scene = file.with_name(f"{file.stem}{SUFFIX}")
    for path in (file, scene):
        check_free(path, force=force)
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=file.parent, prefix=".import-") as folder:
            made = Path(folder) / file.name, Path(folder) / scene.name
            _write(made[0], description(imported.mechanism, notes(imported)))
            # as it will be read, to the last digit; what is wrong is wrong in the file that was imported
            mechanism = replace(load_mechanism(made[0]), where=imported.mechanism.where)
            _write(made[1], default_scene(mechanism, Path(file.name), **acting_on(imported)))
            for path, target in zip(made, (file, scene), strict=True):
                os.replace(path, target)
    except OSError as error:
        raise OutputError(f"cannot be written ({error.strerror})", str(file), "name another file by --out") from None
    return file, scene


def _write(path: Path, text: str) -> None:
    path.write_text(stamped(text), encoding="utf-8")
