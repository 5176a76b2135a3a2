"""Which files were judged, and when: so that a report says what it is about."""

from __future__ import annotations

from collections.abc import Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from screwgauge.models import catalog
from screwgauge.reference.errors import DescriptionError
from screwgauge.reference.files import digest
from screwgauge.scene import read as scenes
from screwgauge.scene.scene import Scene

SCHEMA = 1  #: Of ``summary.json``: raised when a key goes or changes its meaning.
_BUILT_IN = (scenes.FOLDER, catalog.FOLDER)


def provenance(
    scene: Scene | None, models: Mapping[str, Path], *, description: Path | None = None, date: datetime | None = None
) -> dict[str, Any]:
    """Names and contents of what was judged.

    Args:
        scene: None where there is no single one.
        models: Engine -> model file as it read it; generated ones must still be there.
        description: What describes the mechanism where that is not the scene's file; generated, too.
        date: When it was judged; now by default.

    Returns:
        ``models`` (engine -> ``file`` and ``sha256``), ``scene_file`` and ``scene_sha256``, ``description`` (``file``,
        ``sha256``), ``date`` (ISO 8601, UTC) and ``schema``. Files are named as they were given.
    """
    found: dict[str, Any] = {"date": (date or datetime.now(UTC)).astimezone(UTC).isoformat(timespec="seconds")}
    if scene is not None:
        given = {*scene.models.values(), scene.mechanism_file, *(table.file for table in scene.tables.values())}
        found["models"] = {name: _file(path, generated=path not in given) for name, path in models.items()}
        described = description or scene.mechanism_file
        found["description"] = _file(described, generated=described not in given)
        if scene.file is not None:
            found["scene_file"], found["scene_sha256"] = _file(scene.file).values()
    return {**found, "schema": SCHEMA}


def built_in(path: Path) -> bool:
    """Whether a file comes with this package."""
    return any(path.is_relative_to(folder) for folder in _BUILT_IN)


def _file(path: Path, *, generated: bool = False) -> dict[str, str | None]:
    """Name and SHA-256; none where the file has gone since."""
    name = f"generated {path.name}" if generated else f"built-in {path.name}" if built_in(path) else str(path)
    try:
        return {"file": name, "sha256": digest(path)}
    except DescriptionError:
        return {"file": name, "sha256": None}
