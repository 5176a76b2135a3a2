"""Writes what was imported: description and scene, both or none."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path

from screwgauge.models.catalog import load_mechanism
from screwgauge.models.importing.convert import Imported
from screwgauge.models.importing.model import notes
from screwgauge.models.importing.write import description
from screwgauge.reference.errors import OutputError
from screwgauge.scene.default import SUFFIX, acting_on, default_scene

#: How files begin that may be written again.
FIRST = "# Imported from "


def write_imported(imported: Imported, file: Path) -> tuple[Path, Path]:
    """Writes the description and, beside it, its scene.

    Returns:
        Their paths.

    Raises:
        OutputError: They cannot be written, or a file is there that no import has written.
        ScrewgaugeError: No scene can be made.
    """
    if file.suffix != ".toml":
        raise OutputError("is no name of a description", str(file), "let it end in .toml")
    scene = file.with_name(f"{file.stem}{SUFFIX}")
    for path in (file, scene):
        if path.exists() and not _ours(path):
            raise OutputError("is there, and no import has written it", str(path), "name another file by --out")
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=file.parent, prefix=".import-") as folder:
            made = Path(folder) / file.name, Path(folder) / scene.name
            made[0].write_text(description(imported.mechanism, notes(imported)), encoding="utf-8")
            mechanism = load_mechanism(made[0])  # as it will be read, to the last digit
            text = default_scene(mechanism, Path(file.name), **acting_on(imported))
            made[1].write_text(text, encoding="utf-8")
            for path, target in zip(made, (file, scene), strict=True):
                os.replace(path, target)
    except OSError as error:
        raise OutputError(f"cannot be written ({error.strerror})", str(file), "name another file by --out") from None
    return file, scene


def _ours(path: Path) -> bool:
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError):
        return False
    return text.startswith(FIRST)
