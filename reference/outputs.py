"""What may be written over: nothing that a command reads, and nothing that this program did not write as it is now.

A text that is written for users to keep ends with a comment that bears the digest of all lines above it: so a file that
somebody has worked on since is told from one that can be made again.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterable
from pathlib import Path

from screwgauge.reference.errors import DescriptionError, OutputError
from screwgauge.reference.files import read_file, why

_SAID = "As screwgauge wrote it, lines above: sha256 "


def stamped(text: str) -> str:
    """A text of XML, HTML, TOML or YAML with the comment that says how it was written."""
    text = text if text.endswith("\n") else f"{text}\n"
    return f"{text}{_last(text)}"


def _last(text: str) -> str:
    said = f"{_SAID}{hashlib.sha256(text.encode(errors='surrogateescape')).hexdigest()}"
    return f"<!-- {said} -->\n" if text.lstrip("\ufeff \n").startswith("<") else f"# {said}\n"


def is_as_written(path: Path) -> bool:
    """Whether a file is a text as this program wrote it."""
    try:
        text = read_file(path)
    except DescriptionError:
        return False
    above, _, last = text.removesuffix("\n").rpartition("\n")
    return text.endswith("\n") and f"{last}\n" == _last(f"{above}\n")


def check_free(path: Path, inputs: Iterable[str | Path] = (), *, force: bool = False) -> None:
    """Refuses a file in the way, before any work.

    Args:
        inputs: What the command reads.
        force: Whatever is there may be replaced.

    Raises:
        OutputError: It is an input, or this program did not write it as it is now.
    """
    try:
        there = os.path.lexists(path)
        if path.is_dir():
            raise OutputError("is a folder", str(path), "name a file")
    except (OSError, ValueError) as error:  # a path that is too long, or has a null byte
        raise OutputError(f"cannot be written ({why(error)})", str(path), "name another file") from None
    if not there or force:
        return
    if any(_same(path, Path(name)) for name in inputs):
        raise OutputError("is what the command reads", str(path), "name another file, or overwrite it by --force")
    if not is_as_written(path):
        what = "is there, and not as screwgauge wrote it: from elsewhere, or changed since"
        raise OutputError(what, str(path), "name another file, or overwrite it by --force")


def _same(path: Path, other: Path) -> bool:
    try:
        return path.samefile(other)
    except (OSError, ValueError):  # a name of something built-in is no file
        return False
