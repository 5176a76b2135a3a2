"""Disk cache of results and machine code, keyed by their inputs and trusted only if this user's program wrote them.

Each file contains a code (HMAC) of its key, of the version that wrote it and of its content. The secret for this code
is stored in the same folder. Each line in the journal of a long computation also contains such a code. The content of a
file that was edited or replaced is therefore computed again rather than used, and machine code and scripts in pages are
used only as this program wrote them.
"""

from __future__ import annotations

import hashlib
import hmac
import io
import json
import os
import secrets
import stat
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

Arrays = Mapping[str, NDArray[Any]]

VARIABLE = "SCREWGAUGE_CACHE"
DAMAGED = "the cache file was damaged; its content was recomputed"
STALE = "the cache file was from a different version; its content was recomputed"
#: Name of the file with the secret, and length of the secret in bytes.
SECRET, LENGTH = "secret-1", 32
MOST = 2**28  # largest size of a file in bytes
_FAMILY, _MAGIC = b"screwgauge-", b"screwgauge-cache-1"
_OTHERS = stat.S_IRWXG | stat.S_IRWXO
_CHANGEABLE = stat.S_IWGRP | stat.S_IWOTH


class _UnsafeError(OSError):
    """Raised for a file or folder that other users could have written, or that cannot be trusted for another reason."""


def folder() -> Path:
    """Return the cache directory: ``$SCREWGAUGE_CACHE``, else ``screwgauge/truth`` in the user's cache folder.

    Raises:
        OSError: The user has no home folder, and no environment variable names a cache directory.
    """
    named = os.environ.get(VARIABLE)
    if named:
        return Path(named)
    place = os.environ.get("XDG_CACHE_HOME", "")
    if not os.path.isabs(place) and os.environ.get("HOME") != "":  # the specification ignores relative paths
        place = os.path.expanduser("~/.cache")
    if not os.path.isabs(place):
        raise OSError(f"there is no home folder; set {VARIABLE} to a cache folder")
    return Path(place) / "screwgauge" / "truth"


def digest(*parts: Any) -> str:
    """Hash strings, bytes and tables; the order of a table's keys matters, because it is the order of columns."""
    total = hashlib.sha256()
    for part in parts:
        data = part if isinstance(part, bytes) else json.dumps(part, default=str).encode()
        total.update(len(data).to_bytes(8, "big") + data)
    return total.hexdigest()


def code_version(*folders: Path, packages: Iterable[str] = (), extra: str = "") -> str:
    """Hash the code and packages that, besides the key, determine results; a new version invalidates results.

    Args:
        folders: Folders of source files, searched recursively.
        packages: Names of distributions, whose versions are included.
    """
    files = sorted(path for folder in folders for path in folder.rglob("*.py"))
    return digest(extra, [f"{name} {version(name)}" for name in packages], *(path.read_bytes() for path in files))


def read(key: str, version: str) -> tuple[Arrays | None, str]:
    """Return the arrays stored under a key, or None, and a sentence that describes the fault of the file, if any.

    Args:
        key: Hash of all inputs of the result.
        version: Version of the code; a file of a different version is stale.
    """
    try:
        with _open() as place:
            data = _content(place, key)
            secret = b"" if data is None else _secret(place)
    except FileNotFoundError:
        return None, ""
    except OSError as error:
        return None, f"the cache cannot be read ({_reason(error)}); its content was recomputed"
    if data is None:
        return None, ""
    head, _, payload = data.partition(b"\n")
    magic, written_by, code = (*head.split(b" ", 2), b"", b"")[:3]
    if magic != _MAGIC:
        return None, STALE if magic.startswith(_FAMILY) else DAMAGED
    if written_by != version.encode():
        return None, STALE
    if not hmac.compare_digest(code, _code(secret, key, written_by, payload)):
        return None, DAMAGED
    try:
        with np.load(io.BytesIO(payload), allow_pickle=False) as stored:
            return {name: stored[name] for name in stored.files}, ""
    except Exception:  # numpy, zip and zlib may raise any exception for a damaged file
        return None, DAMAGED


def write(key: str, version: str, arrays: Arrays) -> str:
    """Write a result; if this fails, return a sentence instead of raising an exception."""
    buffer = io.BytesIO()
    np.savez_compressed(buffer, **arrays)  # type: ignore[arg-type]
    payload, writer = buffer.getvalue(), version.encode()
    try:
        folder().mkdir(mode=0o700, parents=True, exist_ok=True)
        with _open() as place:
            head = b" ".join([_MAGIC, writer, _code(_secret(place), key, writer, payload)])
            _write(place, key, head + b"\n" + payload)
    except OSError as error:
        return f"the cache cannot be written ({_reason(error)})"
    return ""


def signer() -> Callable[[str, str], str]:
    """Return a function that takes a key and a string, and signs them with the folder's secret.

    Raises:
        OSError: The folder cannot be created or opened, or other users could have written into it.
    """
    folder().mkdir(mode=0o700, parents=True, exist_ok=True)
    with _open() as place:
        secret = _secret(place)
    return lambda key, text: _code(secret, key, b"", text.encode()).decode()


def _code(secret: bytes, key: str, version: bytes, payload: bytes) -> bytes:
    """Compute a hexadecimal code that includes the lengths of all parts, so that bytes cannot shift between parts."""
    parts = (key.encode(), version, payload)
    sizes = b"".join(len(part).to_bytes(8, "big") for part in parts)
    return hmac.new(secret, sizes + b"".join(parts), hashlib.sha256).hexdigest().encode()


@contextmanager
def _open() -> Iterator[int]:
    """Open and check the folder; with its descriptor, the check remains valid even if the folder is renamed.

    Raises:
        OSError: The folder does not exist, or other users could have written into it.
    """
    place = os.open(folder(), os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
    try:
        _check_own(os.fstat(place), "folder")
        yield place
    finally:
        os.close(place)


def _check_own(status: os.stat_result, what: str) -> None:
    if status.st_uid != os.geteuid():
        raise _UnsafeError(f"the {what} belongs to another user")
    if status.st_mode & _CHANGEABLE:
        raise _UnsafeError(f"other users can write to the {what}; remove their access with chmod go-w")


def _content(place: int, name: str) -> bytes | None:
    """Return the content of a file in the folder; None if the file does not exist.

    Raises:
        OSError: The file is a link, not a regular file, or too large; or other users own the file or can write to it.
    """
    try:
        file = os.open(name, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC, dir_fd=place)
    except FileNotFoundError:
        return None
    with open(file, "rb") as stream:
        status = os.fstat(file)
        # the secret has two names for a moment while it is created
        if not stat.S_ISREG(status.st_mode) or status.st_size > MOST or (status.st_nlink > 1 and name != SECRET):
            raise _UnsafeError("the file is a link, too large, or not a regular file")
        _check_own(status, "file")
        if name == SECRET and status.st_mode & _OTHERS:
            raise _UnsafeError("other users can read the secret")
        return stream.read(MOST)


def _secret(place: int) -> bytes:
    """Return the folder's secret; create it on first use, and replace it if other users can read it."""
    for replace in (False, True):
        try:
            secret = _content(place, SECRET)
        except OSError:
            secret = b""
        if secret is not None and len(secret) == LENGTH:
            return secret
        _write(place, SECRET, secrets.token_bytes(LENGTH), replace=replace or secret is not None)
    secret = _content(place, SECRET)
    if secret is None or len(secret) != LENGTH:
        raise _UnsafeError("the secret cannot be created")
    return secret


def _write(place: int, name: str, data: bytes, *, replace: bool = True) -> None:
    """Write a file atomically; unless `replace` is set, keep an existing file."""
    fresh = f".new-{secrets.token_hex(8)}"
    file = os.open(fresh, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o600, dir_fd=place)
    try:
        with open(file, "wb") as stream:
            stream.write(data)
        if not replace:
            with suppress(OSError):  # a different process was faster, or the file system does not support hard links
                os.link(fresh, name, src_dir_fd=place, dst_dir_fd=place)
        else:
            os.replace(fresh, name, src_dir_fd=place, dst_dir_fd=place)
    finally:
        with suppress(FileNotFoundError):
            os.unlink(fresh, dir_fd=place)


def _reason(error: OSError) -> str:
    return (error.strerror or str(error)).lower()
