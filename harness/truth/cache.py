"""Finished truths on disk, looked up by the content of what they were computed from."""

from __future__ import annotations

import hashlib
import io
import json
import os
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

Arrays = Mapping[str, NDArray[Any]]

VARIABLE = "SCREWGAUGE_CACHE"
DAMAGED = "the cache file was damaged; computed anew"
_MAGIC = b"screwgauge-truth"


def folder() -> Path:
    """Where truths are kept: ``$SCREWGAUGE_CACHE``, else ``screwgauge/truth`` in the user's cache folder."""
    named = os.environ.get(VARIABLE)
    if named:
        return Path(named)
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "screwgauge" / "truth"


def digest(*parts: Any) -> str:
    """Hash of texts, bytes and tables. Their order counts: it is that of the columns."""
    total = hashlib.sha256()
    for part in parts:
        data = part if isinstance(part, bytes) else json.dumps(part, default=str).encode()
        total.update(len(data).to_bytes(8, "big") + data)
    return total.hexdigest()


def code_version(*folders: Path, extra: str = "") -> str:
    """Hash of the source files that a truth depends on: another version computes it anew."""
    files = sorted(path for folder in folders for path in folder.glob("*.py"))
    return digest(extra, *(path.read_bytes() for path in files))


def read(key: str, version: str) -> tuple[Arrays | None, str]:
    """A truth and a sentence: what is wrong with the file, or nothing.

    Args:
        key: Hash of the input.
        version: Of the code; a file of another version is stale.
    """
    try:
        data = (folder() / key).read_bytes()
    except FileNotFoundError:
        return None, ""
    except OSError as error:
        return None, f"the cache cannot be read ({_reason(error)}); computed anew"
    head, _, payload = data.partition(b"\n")
    fields = head.split(b" ")
    if len(fields) != 3 or fields[0] != _MAGIC or fields[2] != hashlib.sha256(payload).hexdigest().encode():
        return None, DAMAGED
    if fields[1] != version.encode():
        return None, "the cache file was of another version; computed anew"
    try:
        with np.load(io.BytesIO(payload), allow_pickle=False) as stored:
            return {name: stored[name] for name in stored.files}, ""
    except Exception:  # numpy, zip and zlib raise what they like about a file
        return None, DAMAGED


def write(key: str, version: str, arrays: Arrays) -> str:
    """Keeps a truth; a sentence if that fails, which is no reason to lose it."""
    buffer = io.BytesIO()
    np.savez_compressed(buffer, **arrays)  # type: ignore[arg-type]
    payload = buffer.getvalue()
    head = b" ".join([_MAGIC, version.encode(), hashlib.sha256(payload).hexdigest().encode()])
    name = None
    try:
        folder().mkdir(parents=True, exist_ok=True)
        with tempfile.NamedTemporaryFile(dir=folder(), delete=False) as file:
            name = file.name
            file.write(head + b"\n" + payload)
        os.replace(name, folder() / key)
    except OSError as error:
        if name is not None:
            Path(name).unlink(missing_ok=True)
        return f"the cache cannot be written ({_reason(error)})"
    return ""


def _reason(error: OSError) -> str:
    return (error.strerror or str(error)).lower()
