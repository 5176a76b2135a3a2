"""Which files in a folder a report wrote: a list of names and digests, believed only where a file has its digest.

Anybody can have written such a list, and anybody can have changed a file since: what a digest does not prove to be as a
report wrote it is somebody's own, and is neither replaced nor removed.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from pathlib import Path, PurePosixPath
from typing import Any

from screwgauge.environment import json_text
from screwgauge.reference.errors import DescriptionError, OutputError
from screwgauge.reference.files import digest, read_json

MANIFEST = "report-files.json"
#: Endings of what reports consist of.
ENDINGS = (".md", ".html", ".svg", ".csv", ".json", ".parquet", ".pdf")
_REMEDY = "move it, or choose another folder with --out"


def written(out: Path) -> set[str]:
    """Names of the files in a folder that a report wrote and nobody has changed since; none if there is no report.

    Raises:
        OutputError: There is something else in the place of the list.
    """
    return {name for name, digests in _listed(out).items() if _digest(out / name) in digests}


def manifest(out: Path, fresh: Mapping[str, str], others: Iterable[str]) -> str:
    """The list of a report that is about to be written.

    Where a file is replaced, the digest of the old one stays in the list beside the new one: whenever the writing is
    cut off, each file has one of the two.

    Args:
        fresh: Name -> SHA-256 of what will be there.
        others: Further files of the report; those that are there count as they are.
    """
    listed, entries = _listed(out), dict[str, list[str]]()
    for name in sorted({*fresh, *others}):
        old = _digest(out / name)
        ours = name not in fresh or old in listed.get(name, ())
        entries[name] = [*dict.fromkeys([*filter(None, [fresh.get(name), old if ours else ""])])]
    return json_text({"files": entries})


def _listed(out: Path) -> dict[str, list[Any]]:
    """Name -> digests, as the list says, of names that a report could have."""
    if not os.path.lexists(out / MANIFEST):
        return {}
    try:
        files = read_json(out / MANIFEST, "list of a report's files", _REMEDY).get("files")
    except DescriptionError:
        files = None
    if not isinstance(files, dict | list):
        raise OutputError(f"{MANIFEST} is no list of a report's files", str(out), _REMEDY)
    # the lists of earlier versions have names only, which prove nothing
    named = files.items() if isinstance(files, dict) else ()
    return {name: digests for name, digests in named if _is_ours(name) and isinstance(digests, list)}


def _is_ours(name: str) -> bool:
    """Whether a report could have written a file of that name, in its folder and nowhere else."""
    path = PurePosixPath(name)
    inside = str(path) == name and str(path.parent) in (".", "plots") and path.name not in ("", "..", MANIFEST)
    return inside and path.suffix in ENDINGS


def _digest(path: Path) -> str:
    """SHA-256 of a regular file that is no link, as its folder is none; empty for anything else."""
    if os.path.islink(path) or os.path.islink(path.parent):
        return ""
    try:
        return digest(path, "MB of a report's file")
    except DescriptionError:
        return ""
