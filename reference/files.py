"""Every input file is opened here, and what inputs hold is limited here."""

from __future__ import annotations

import os
import re
import stat
from pathlib import Path

from screwgauge.reference.errors import DescriptionError, OutputError

#: The most that an input holds. Beyond, memory or time grow without bound: with the square of the bodies, with samples
#: times terms; and Pinocchio's parser crashes on chains of a few thousand links.
LIMITS = {
    "MB": 16,
    "MB of CSV": 256,
    "CSV columns": 1000,
    "samples": 10_000_000,
    "bodies": 500,
    "joints": 1000,
    "links": 2000,
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
    "nested brackets": 10,
}


def check_count(count: float, what: str, where: str, remedy: str = "take fewer") -> None:
    """Refuses more of something than `LIMITS` has of it.

    Raises:
        DescriptionError: There is more.
    """
    if count > LIMITS[what]:
        raise DescriptionError(f"{count:.6g} {what}, more than {LIMITS[what]:.6g}", where, remedy)


def is_file(path: Path) -> bool:
    """Whether there is such a file; what can be no path at all, being too long, is none."""
    try:
        return path.is_file()
    except OSError:
        return False


def is_path(name: str) -> bool:
    """Whether a name means a file, there or not, and nothing built-in."""
    return "/" in name or name.endswith(".toml")


def beside(folder: Path, name: str) -> Path:
    """The file that another one in `folder` names; ``~`` is the user's own folder."""
    try:
        return folder / Path(name).expanduser()
    except RuntimeError:  # nobody is called so
        return folder / name


def read_file(path: Path, most: str = "MB") -> str:
    """The text of an input file: a regular one, in UTF-8, with or without a byte order mark.

    Args:
        most: Its size in `LIMITS`.

    Raises:
        DescriptionError: There is no such file, or it is not of that kind or larger.
    """
    try:
        return read_bytes(path, most).decode("utf-8-sig")
    except UnicodeDecodeError:
        raise DescriptionError("is not UTF-8 text", str(path), "save it as UTF-8") from None


def read_bytes(path: Path, most: str = "MB") -> bytes:
    """What an input file holds, see `read_file`."""
    limit = LIMITS[most] * 10**6
    try:
        # opening a FIFO would wait for somebody to write into it
        with open(path, "rb", opener=lambda name, flags: os.open(name, flags | os.O_NONBLOCK)) as file:
            reason = "" if stat.S_ISREG(os.fstat(file.fileno()).st_mode) else "it is no regular file"
            data = b"" if reason else file.read(limit + 1)
        if len(data) > limit:
            reason = f"it has more than {LIMITS[most]} {most}"
    except FileNotFoundError:
        reason = "it does not exist"
    except (OSError, ValueError) as error:  # a path with a null byte
        reason = why(error)
    if reason:
        raise DescriptionError(f"cannot be read ({reason})", str(path), "check the path")
    return data


def why(error: OSError | ValueError) -> str:
    """What the system says of a file that cannot be read or written."""
    return (getattr(error, "strerror", None) or str(error)).lower()


def read_model(path: Path) -> str:
    """The text of a URDF or MJCF, which a library is about to parse.

    Raises:
        DescriptionError: It cannot be read, or has too many links.
    """
    text = read_file(path)
    check_count(len(re.findall(r"<(?:link|body)[\s/>]", text)), "links", str(path))
    return text


def replace_file(path: Path, content: str | bytes) -> None:
    """Writes a file in whole or not at all: beside its place, onto the disk, then by renaming.

    Raises:
        OutputError: It cannot be written; it is then as it was.
    """
    beside = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        try:
            with beside.open("wb") as file:
                file.write(content.encode() if isinstance(content, str) else content)
                file.flush()
                os.fsync(file.fileno())
            os.replace(beside, path)
        finally:
            beside.unlink(missing_ok=True)
    except (OSError, ValueError) as error:
        raise OutputError(f"cannot be written ({why(error)})", str(path), "name another file") from error
