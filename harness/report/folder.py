"""The folder of a report: one command writes at a time, and replaces only report files.

A list of names and digests identifies these files. Because anyone could write such a list, or change a file later, a
file whose digest does not match is considered the user's own, and is neither replaced nor removed. If a file of a
report cannot be written, the folder stays unchanged.
"""

from __future__ import annotations

import errno
import fcntl
import os
import shutil
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from importlib.util import find_spec
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING, Any
from uuid import uuid4

from screwgauge.environment import json_text
from screwgauge.reference.errors import DescriptionError, OutputError
from screwgauge.reference.files import digest, read_json, why
from screwgauge.reference.outputs import force_hint

if TYPE_CHECKING:
    import pandas as pd

SAMPLES = "samples.parquet"
_ELSEWHERE = "move it, or choose another folder"
PAGES = ("report.md", "report.html")


def check_writable(out: Path, names: Iterable[str] = (), *, force: bool = False) -> None:
    """Check before a long computation that its report can be written, without leaving a trace.

    Args:
        names: Names of all files except the report's pages.
        force: Accept existing files of any origin; links and folders in their places are still rejected.

    Raises:
        OutputError: Cannot write to the folder, or a file in it with one of these names is not from a report.
    """
    names = (*names, *PAGES, MANIFEST)
    if SAMPLES in names and find_spec("pyarrow") is None:
        raise OutputError(f"{SAMPLES} needs pyarrow, which is not installed", "", "run pip install pyarrow")
    made: list[Path] = []
    try:
        made = [folder for folder in (out, *out.parents) if not folder.exists()]
        shutil.rmtree(_stage(out))
        _check_own(out, names, force)
    except (OSError, ValueError) as error:  # ValueError: the path contains a null byte
        raise _refusal(out, error) from error
    finally:
        for folder in made:
            if folder.is_dir() and not any(folder.iterdir()):
                folder.rmdir()


def _check_own(out: Path, names: Iterable[str], force: bool) -> None:
    """Reject replacing files that are not from reports, and writing through links, which may lead out of the folder."""
    for name in (MANIFEST, "plots", *names):
        path, odd = out / name, ""
        if path.is_symlink():
            odd = "is a link"
        elif path.exists() and path.is_dir() is not (name == "plots"):
            odd = "is a folder" if path.is_dir() else "is not a folder"
        if odd:
            raise OutputError(f"{name} {odd}", str(out), _ELSEWHERE)
    ours = {MANIFEST, *unchanged_files(out)}
    for name in names:
        if not force and name not in ours and (out / name).exists():
            what = f"{name} exists, but is not from an earlier report, or has changed since (see {MANIFEST})"
            raise OutputError(what, str(out), f"{_ELSEWHERE}, or {force_hint()}")


def write_files(out: Path, files: Mapping[str, str | pd.DataFrame], others: Iterable[str] | None = None) -> Path:
    """Write files into a new folder next to their destination, then move them there.

    Args:
        files: Path below `out` -> content: a string, or a table for Parquet.
        others: Further files of the same report; a list of these and of `files` is written first, unless `others` is
            None.

    Raises:
        OutputError: Cannot write to the folder, which is left unchanged.
    """
    stage = None
    try:
        stage = _stage(out)
        for name, content in files.items():
            path = stage / name
            path.parent.mkdir(parents=True, exist_ok=True)
            if isinstance(content, str):
                # write an undecodable path, e.g. of a scene, with escapes
                path.write_text(content, encoding="utf-8", errors="backslashreplace", newline="\n")
            else:
                content.to_parquet(path, index=False)
        if others is not None:
            text = manifest(out, {name: digest(stage / name, "MB of a report's file") for name in files}, others)
            (stage / MANIFEST).write_text(text, encoding="utf-8")
        _move(stage, out)
    except (OSError, ValueError) as error:
        raise _refusal(out, error) from error
    finally:
        if stage is not None and stage.exists():
            shutil.rmtree(stage, ignore_errors=True)
    return out


def _stage(out: Path) -> Path:
    """Create an empty folder on the same disk: in `out` if it exists (it may be a mount point), else next to it."""
    out = out.absolute()
    if "\0" in str(out):
        raise ValueError("its path contains a null byte")
    if out.exists() and not out.is_dir():
        raise NotADirectoryError(errno.ENOTDIR, "it is a file")
    home = out if out.is_dir() else out.parent
    home.mkdir(parents=True, exist_ok=True)
    stage = home / f".screwgauge-{uuid4().hex[:8]}"
    stage.mkdir()
    return stage


def _move(stage: Path, out: Path) -> None:
    """Rename the files into place: first their list, and last ``summary.json``, which marks the report as complete."""
    if not out.exists():
        stage.rename(out)
        return
    names = sorted(path.relative_to(stage).as_posix() for path in stage.rglob("*") if path.is_file())
    for name in sorted(names, key=lambda name: (name != MANIFEST, name == "summary.json")):
        (out / name).parent.mkdir(exist_ok=True)
        os.replace(stage / name, out / name)


def _refusal(out: Path, error: OSError | ValueError) -> OutputError:
    return OutputError(f"cannot write to the folder ({why(error)})", str(out), "choose another folder")


MANIFEST = "report-files.json"
#: File extensions of reports.
ENDINGS = (".md", ".html", ".svg", ".csv", ".json", ".parquet", ".pdf")


def unchanged_files(out: Path) -> set[str]:
    """Return the names of a report's unchanged files in a folder; empty if there is no report.

    Raises:
        OutputError: The file `MANIFEST` does not contain a list.
    """
    return {name for name, digests in _read_list(out).items() if _digest(out / name) in digests}


def manifest(out: Path, fresh: Mapping[str, str], others: Iterable[str]) -> str:
    """Return the list of a report's files, to be written before the report.

    For a replaced file, the list contains the old and the new digest, so that each file matches one of them even if
    writing is interrupted.

    Args:
        fresh: Name -> SHA-256 of the new file.
        others: Further files of the report; files that exist are listed with their current digest.
    """
    listed, entries = _read_list(out), dict[str, list[str]]()
    for name in sorted({*fresh, *others}):
        old = _digest(out / name)
        ours = name not in fresh or old in listed.get(name, ())
        entries[name] = [*dict.fromkeys([*filter(None, [fresh.get(name), old if ours else ""])])]
    return json_text({"files": entries})


def _read_list(out: Path) -> dict[str, list[Any]]:
    """Read name -> digests from the list, for names that a report could use."""
    if not os.path.lexists(out / MANIFEST):
        return {}
    try:
        files = read_json(out / MANIFEST, "list of a report's files", _ELSEWHERE).get("files")
    except DescriptionError:
        files = None
    if not isinstance(files, dict | list):
        raise OutputError(f"{MANIFEST} is not a list of a report's files", str(out), _ELSEWHERE)
    # the lists of earlier versions contain only names, which prove nothing
    named = files.items() if isinstance(files, dict) else ()
    return {name: digests for name, digests in named if _is_ours(name) and isinstance(digests, list)}


def _is_ours(name: str) -> bool:
    """Return True if a report could have written a file with that name directly in its folder."""
    path = PurePosixPath(name)
    inside = str(path) == name and str(path.parent) in (".", "plots") and path.name not in ("", "..", MANIFEST)
    return inside and path.suffix in ENDINGS


def _digest(path: Path) -> str:
    """Return the SHA-256 of a regular file; an empty string if the file or its folder is a link."""
    if os.path.islink(path) or os.path.islink(path.parent):
        return ""
    try:
        return digest(path, "MB of a report's file")
    except DescriptionError:
        return ""


#: Error numbers of file systems whose folders cannot be locked, such as certain network file systems.
_UNABLE = {errno.EBADF, errno.ENOLCK, errno.EOPNOTSUPP, errno.ENOSYS, errno.EINVAL}


@contextmanager
def lock_folder(out: Path) -> Iterator[None]:
    """Create a folder if needed, and lock it within the context; the system unlocks it if the process dies.

    If the created folder stays empty, it is removed.

    Raises:
        OutputError: Another command has locked the folder, or the folder cannot be created.
    """
    made, place = list[Path](), -1
    try:
        made = [folder for folder in (out, *out.parents) if not folder.exists()]
        out.mkdir(parents=True, exist_ok=True)
        place = os.open(out, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
        fcntl.flock(place, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        os.close(place)
        what, remedy = "another command is writing into the folder", "wait until it ends, or choose another folder"
        raise OutputError(what, str(out), remedy) from None
    except (OSError, ValueError) as error:  # ValueError: the path contains a null byte
        if place < 0 or getattr(error, "errno", None) not in _UNABLE:
            raise _refusal(out, error) from error
    try:
        yield
    finally:
        os.close(place)
        with suppress(OSError):  # the folder is not empty
            for folder in made:
                folder.rmdir()
