"""Opens input files, limits their size and content, and parses JSON."""

from __future__ import annotations

import codecs
import hashlib
import json
import os
import re
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from io import BufferedReader
from pathlib import Path
from typing import Any

from screwgauge.reference.errors import DescriptionError, quote

#: Upper limits of an input. Beyond these, memory or time would grow without bound (with the square of the number of
#: bodies, or with samples times terms), and Pinocchio's parser crashes on chains of a few thousand links.
LIMITS = {
    "MB": 16,
    "MB of CSV": 256,
    "MB of a report's file": 4000,
    "CSV columns": 1000,
    "samples": 10_000_000,
    "bodies": 500,
    "joints": 1000,
    "links": 2000,
    "copies": 10_000,
    "closures": 1000,
    "couplings": 1000,
    "harmonics": 1000,
    "coefficients": 100,
    "entries": 1000,
    "panels": 24,
    "characters": 1000,
    "nested elements": 500,
    "nested models": 10,
    "MB of a mesh": 64,
    "MB of meshes": 256,
    "characters of YAML": 50_000,
    "nodes of YAML": 10_000,
    "nested brackets": 10,
    "nested entries": 100,
    "parts of a dotted key": 100,
}
#: Control characters except line breaks and tabs; lone surrogates, which are invalid in text.
_CONTROL = re.compile(r"[\x00-\x08\x0b\x0c\x0e-\x1f\x7f-\x9f\ud800-\udfff\ufffe\uffff]")
#: Number of digits of the largest accepted integer: doubles overflow there, and Python refuses to print 4300 digits.
_DIGITS = 300
#: Encoding named in an XML declaration.
_DECLARED = re.compile(r"""<\?xml\s[^>]*?\bencoding\s*=\s*["']([^"']*)["']""")


def check_count(count: float, what: str, where: str, remedy: str = "use fewer") -> None:
    """Reject a count above its entry in `LIMITS`.

    Raises:
        DescriptionError: The count exceeds its limit.
    """
    if count > LIMITS[what]:
        raise DescriptionError(f"{count:.6g} {what}, more than {LIMITS[what]:.6g}", where, remedy)


#: Description, for messages, of a name that refers to a file instead of a built-in mechanism.
A_PATH = "the path of a TOML file, URDF, MJCF, SDF or USD"


def is_file(path: Path) -> bool:
    """Return True if the file exists; False for a string that is too long for a path."""
    return os.path.isfile(path)


def is_path(name: str) -> bool:
    """Return True if a name refers to a file (existing or not) instead of a built-in mechanism."""
    return "/" in name or name.endswith(".toml")


def named_file(folder: Path, name: str) -> Path:
    """Resolve a file name that a file in `folder` contains; ``~`` stands for the user's home folder."""
    try:
        return folder / Path(name).expanduser()
    except RuntimeError:  # unknown user
        return folder / name


def read_file(path: Path, most: str = "MB") -> str:
    """Read the text of an input file, which must be a regular UTF-8 file with or without a byte order mark.

    Args:
        most: Key of the size limit in `LIMITS`.

    Raises:
        DescriptionError: The file does not exist, is not a UTF-8 file, or is too large.
    """
    try:
        return read_bytes(path, most).decode("utf-8-sig")
    except UnicodeDecodeError:
        raise DescriptionError("is not UTF-8 text", str(path), "save it as UTF-8") from None


def read_xml(path: Path) -> str:
    """Read XML text, which must be UTF-8 whatever its declaration says.

    Raises:
        DescriptionError: The file cannot be read, see `read_file`, or its encoding would yield a different text.
    """
    text = read_file(path)
    text = text.lstrip() if text.lstrip().startswith("<?xml") else text  # a declaration must come first
    declared = _DECLARED.match(text)
    if declared and not _means_the_same(text, declared[1]):
        what = f"declares the encoding {quote(declared[1])}, but must be UTF-8"
        raise DescriptionError(what, str(path), 'save it as UTF-8, and write encoding="UTF-8"')
    return text


def _means_the_same(text: str, encoding: str) -> bool:
    """Return True if the encoding decodes UTF-8 text to the same text."""
    ascii_signs = bytes(range(128))
    try:
        same = ascii_signs.decode(encoding) == ascii_signs.decode()
        return same and (text.isascii() or codecs.lookup(encoding).name == "utf-8")
    except (LookupError, ValueError):  # the encoding is unknown or cannot decode these bytes
        return False


def read_bytes(path: Path, most: str = "MB") -> bytes:
    """Read the bytes of an input file, see `read_file`."""
    with _open(path, most) as file:
        data = file.read(LIMITS[most] * 10**6 + 1)
    if len(data) > LIMITS[most] * 10**6:  # the file has grown or does not report its size
        raise _refusal(path, _too_large(most))
    return data


def digest(path: Path, most: str = "MB of CSV") -> str:
    """Compute the SHA-256 of a file in blocks, with the limits of `read_file`."""
    with _open(path, most) as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


_READ: ContextVar[list[Path] | None] = ContextVar("_READ", default=None)


@contextmanager
def files_read() -> Iterator[list[Path]]:
    """Record the paths of files that are read within the context."""
    paths = list[Path]()
    token = _READ.set(paths)
    try:
        yield paths
    finally:
        _READ.reset(token)


@contextmanager
def _open(path: Path, most: str) -> Iterator[BufferedReader]:
    """Open a regular file of limited size for reading; raise DescriptionError if this is impossible."""
    try:
        # opening a FIFO would wait for a writer
        with open(path, "rb", opener=lambda name, flags: os.open(name, flags | os.O_NONBLOCK)) as file:
            status = os.fstat(file.fileno())
            if not stat.S_ISREG(status.st_mode):
                raise ValueError("it is not a regular file")
            if status.st_size > LIMITS[most] * 10**6:
                raise ValueError(_too_large(most))
            if (read := _READ.get()) is not None:
                read.append(path)
            yield file
    except FileNotFoundError:
        raise _refusal(path, "it does not exist") from None
    except (OSError, ValueError) as error:  # the path contains a null byte
        raise _refusal(path, str(error) if type(error) is ValueError else why(error)) from None


def _too_large(most: str) -> str:
    return f"it has more than {LIMITS[most]} {most}"


def _refusal(path: Path, reason: str) -> DescriptionError:
    return DescriptionError(f"cannot be read ({reason})", str(path), "check the path")


def read_json(path: Path, what: str, remedy: str) -> dict[str, Any]:
    """Read the entries of a JSON file.

    Args:
        what: Noun for the file in the error message.
        remedy: Remedy if the file is not JSON.

    Raises:
        DescriptionError: The file cannot be read, or is not a JSON object.
    """
    value = parse_json(read_file(path), what, str(path), remedy)
    if not isinstance(value, dict):
        raise DescriptionError(f"is not a {what}", str(path), remedy)
    return value


def parse_json(text: str, what: str, where: str, remedy: str) -> Any:
    """Parse JSON text; reject deep nesting, invalid numbers and invalid strings; see `read_json`."""
    try:
        value = json.loads(text)
    except (ValueError, RecursionError):
        raise DescriptionError(f"is not a {what}: its JSON is malformed or nested too deeply", where, remedy) from None
    check_plain(value, where)
    return value


def check_plain(value: Any, where: str) -> None:
    """Reject deep nesting, control characters, and integers that a double cannot approximate.

    Args:
        value: Value parsed from TOML or JSON.

    Raises:
        DescriptionError: The value contains one of these.
    """
    pending = [(value, 0)]
    while pending:
        node, depth = pending.pop()
        check_count(depth, "nested entries", where, "write them flat")
        if isinstance(node, str) and (odd := _CONTROL.search(node)):
            raise DescriptionError(
                f"{quote(node)} contains the control character U+{ord(odd[0]):04X}", where, "remove it"
            )
        if isinstance(node, int) and abs(node) >= 10**_DIGITS:
            what = f"contains an integer of more than {_DIGITS} digits"
            raise DescriptionError(what, where, "use a number in the range of doubles")
        inside = (*node, *node.values()) if isinstance(node, dict) else node if isinstance(node, list) else ()
        pending += [(item, depth + 1) for item in inside]


def why(error: OSError | ValueError) -> str:
    """Return the reason that the operating system gives for failing to read or write a file."""
    return (getattr(error, "strerror", None) or str(error)).lower()


def read_model(path: Path) -> str:
    """Read the text of a URDF or MJCF before a library parses it.

    Raises:
        DescriptionError: The file cannot be read, or has too many links.
    """
    text = read_xml(path)
    check_count(len(re.findall(r"<(?:link|body)[\s/>]", text)), "links", str(path))
    return text
