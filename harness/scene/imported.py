"""Writes what was imported: description and scene, both or none."""

from __future__ import annotations

import hashlib
import os
import tempfile
from dataclasses import replace
from pathlib import Path

from screwgauge.models.catalog import load_mechanism
from screwgauge.models.importing.convert import Imported
from screwgauge.models.importing.model import notes
from screwgauge.models.importing.write import description
from screwgauge.reference.errors import OutputError
from screwgauge.scene.default import SUFFIX, acting_on, default_scene

#: How the last line begins, which tells a file as it was imported from one that somebody has worked on.
DIGEST = "# As imported, lines above: sha256 "


def write_imported(imported: Imported, file: Path) -> tuple[Path, Path]:
    """Writes the description and, beside it, its scene.

    Returns:
        Their paths.

    Raises:
        OutputError: They cannot be written, or a file is there that is not as an import has written it.
        ScrewgaugeError: No scene can be made.
    """
    if file.suffix != ".toml":
        raise OutputError("is no name of a description", str(file), "let it end in .toml")
    scene = file.with_name(f"{file.stem}{SUFFIX}")
    for path in (file, scene):
        if path.exists() and not _as_imported(path):
            what = "is there, and not as an import has written it: by hand, or changed since"
            raise OutputError(what, str(path), "name another file by --out, or take this one away")
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
    path.write_text(f"{text}{_last(text)}", encoding="utf-8")


def _last(text: str) -> str:
    return f"{DIGEST}{hashlib.sha256(text.encode()).hexdigest()}\n"


def _as_imported(path: Path) -> bool:
    try:
        lines = path.read_text(encoding="utf-8").splitlines(keepends=True)
    except (OSError, UnicodeDecodeError):
        return False
    return bool(lines) and lines[-1] == _last("".join(lines[:-1]))
