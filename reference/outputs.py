"""Writes output files atomically; never replaces a user's own file.

A command overwrites neither its inputs nor a file that was edited or was not written by this program. A file that users
keep contains a digest of its content, which reveals edits; the digest of a CSV is in a second file.
"""

from __future__ import annotations

import codecs
import errno
import hashlib
import os
import struct
import zlib
from collections.abc import Iterable, Mapping
from contextvars import ContextVar
from pathlib import Path

from screwgauge.reference.errors import DescriptionError, OutputError
from screwgauge.reference.files import digest, read_bytes, read_file, why

#: How the caller permits overwriting: the Python argument by default; a command line sets the name of its option.
OVERWRITING = ContextVar("OVERWRITING", default="force=True")
_SAID = "As screwgauge wrote it, lines above: sha256 "
_PNG, _PNG_END = b"\x89PNG\r\n\x1a\n", 12  # PNG signature, and length of the last chunk


def save_file(
    path: str | Path, content: str | bytes, inputs: Iterable[str | Path] = (), *, force: bool = False
) -> Path:
    """Write a file for the user to keep, with its digest; see `replace_file`.

    Args:
        content: Content; a string is encoded in UTF-8, with escapes for paths that are not valid text.
        inputs, force: See `check_free`.

    Raises:
        OutputError: See `check_free`; or the file cannot be written, in which case it is unchanged.
    """
    check_free(path := Path(path), inputs, force=force)
    content = content.encode(errors="backslashreplace") if isinstance(content, str) else content
    if path.suffix == ".csv":  # a CSV cannot contain a digest
        replace_file(_digest_file(path), f"{hashlib.sha256(content).hexdigest()}  {path.name}\n")
    replace_file(path, content if path.suffix == ".csv" else with_digest(content))
    return path


def replace_file(path: Path, content: str | bytes) -> None:
    """Write a file atomically: write a temporary file in the same folder, sync it, and rename it.

    The folder is created if necessary. A symbolic link is kept, and its target is replaced.

    Raises:
        OutputError: The file cannot be written, in which case it is unchanged.
    """
    named, path = path, Path(os.path.realpath(path))
    temporary = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        try:
            with temporary.open("wb") as file:
                file.write(content.encode() if isinstance(content, str) else content)
                file.flush()
                os.fsync(file.fileno())
            os.replace(temporary, path)
        finally:
            temporary.unlink(missing_ok=True)
    except (OSError, ValueError) as error:
        raise OutputError(f"cannot be written ({why(error)})", str(named), "choose another file") from error


def stamp(text: str) -> str:
    """Append a comment with the digest to XML, HTML, TOML or YAML text."""
    return with_digest(text.encode(errors="surrogateescape")).decode(errors="surrogateescape")


def with_digest(content: bytes) -> bytes:
    """Append the digest of the content: as a comment in text or PDF, and as the penultimate chunk in PNG."""
    if content.startswith(_PNG):
        return content[:-_PNG_END] + _mark(content) + content[-_PNG_END:]
    content = content if content.endswith(b"\n") else content + b"\n"
    return content + _mark(content)


def _mark(content: bytes) -> bytes:
    line = f"{_SAID}{hashlib.sha256(content).hexdigest()}".encode()
    if content.startswith(_PNG):
        chunk = b"tEXtComment\0" + line
        return struct.pack(">I", len(chunk) - 4) + chunk + struct.pack(">I", zlib.crc32(chunk))
    if content.startswith(b"%PDF"):
        return b"%" + line + b"\n"
    marked_up = content.removeprefix(codecs.BOM_UTF8).lstrip(b" \n").startswith(b"<")
    return b"<!-- " + line + b" -->\n" if marked_up else b"# " + line + b"\n"


def _digest_file(file: Path) -> Path:
    """Return the path of the hidden file with the digest of a CSV."""
    return file.with_name(f".{file.name}.sha256")


def is_as_written(path: Path) -> bool:
    """Return True if the digest of a file shows that the file is unchanged since this program wrote it."""
    try:
        if os.path.lexists(_digest_file(path)):
            return read_file(_digest_file(path)).partition(" ")[0] == digest(path)
        content = read_bytes(path, "MB of CSV")
    except DescriptionError:
        return False
    end = len(content) - (_PNG_END if content.startswith(_PNG) else 0)
    return with_digest(content[: end - len(_mark(content))] + content[end:]) == content


def check_free(path: Path, inputs: Iterable[str | Path] = (), *, force: bool = False) -> None:
    """Reject an existing file or an unwritable path before any work is done.

    Args:
        inputs: Files that the command reads.
        force: Allow replacing any existing file.

    Raises:
        OutputError: The file is an input, was edited, or was not written by this program; or see `check_place`.
    """
    check_place(path)
    if force or not os.path.lexists(path):
        return
    if any(_is_same_file(path, Path(name)) for name in inputs):
        raise OutputError("is an input of the command", str(path), _other_file())
    if not is_as_written(path):
        what = "already exists and nothing in it proves that it is an unmodified output of screwgauge"
        raise OutputError(what, str(path), _other_file())


def check_place(path: Path) -> None:
    """Reject a path at which a file cannot be written, before any work is done.

    Raises:
        OutputError: The path is not a file, or its folder cannot be written or created.
    """
    try:
        if path.exists() and not path.is_file():
            what = "is a folder" if path.is_dir() else "is not a regular file"
            raise OutputError(what, str(path), "choose a file name")
        home = next(folder for folder in path.absolute().parents if folder.exists())
        if not (home.is_dir() and os.access(home, os.W_OK | os.X_OK)):
            raise PermissionError(errno.EACCES, f"{home} is not a folder that you can write to")
    except (OSError, ValueError) as error:  # the path is too long or contains a null byte
        raise OutputError(f"cannot be written ({why(error)})", str(path), "choose another file") from None


def force_hint() -> str:
    """Return the remedy by which this caller can overwrite a file, e.g. ``overwrite it with --force``."""
    return f"overwrite it with {OVERWRITING.get()}"


def _other_file() -> str:
    return f"choose another file, or {force_hint()}"


def check_apart(outputs: Mapping[str, Path], inputs: Iterable[str | Path] = ()) -> None:
    """Reject an output that is an input, and two outputs at the same path, before any work is done.

    Args:
        outputs: Option or name of each output -> path.
        inputs: Files that the command reads; iterated only if an output exists.

    Raises:
        OutputError: Two of these paths are the same file.
    """
    writers = dict[tuple[int, int] | str, str]()
    for name, path in outputs.items():
        if (other := writers.setdefault(_node(path) or os.path.realpath(path), name)) is not name:
            raise OutputError(f"is an output of both {other} and {name}", str(path), "choose two files")
    there = any(isinstance(place, tuple) for place in writers)
    for file in inputs if there else ():
        if (node := _node(Path(file))) in writers:
            raise OutputError(f"is an input of the command and the output of {writers[node]}", str(file), _other_file())


def _node(path: Path) -> tuple[int, int] | None:
    """Return device and inode number of a file, or None if the file does not exist."""
    try:
        status = path.stat()
    except OSError:
        return None
    return status.st_dev, status.st_ino


def _is_same_file(path: Path, other: Path) -> bool:
    try:
        return path.samefile(other)
    except (OSError, ValueError):  # the name of a built-in is not a file
        return False
