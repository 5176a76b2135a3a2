"""A folder that reports are written into: what in it is theirs, and how files get there, all or none."""

from __future__ import annotations

import errno
import os
import shutil
from collections.abc import Iterable, Mapping
from importlib.util import find_spec
from pathlib import Path
from uuid import uuid4

import pandas as pd

from screwgauge.reference.errors import OutputError
from screwgauge.reference.files import digest, why
from screwgauge.report.manifest import MANIFEST, manifest, written

SAMPLES = "samples.parquet"
_ELSEWHERE = "move it, or choose another folder with --out"
PAGES = ("report.md", "report.html")
#: Grow before there is a report; who adds to them looks whose they are.
WORKING = ("matrix.csv", *(f"{name}.partial.jsonl" for name in ("bench", "check", "matrix", "stress")))


def check_writable(out: Path, names: Iterable[str] = (), *, force: bool = False) -> None:
    """Finds out before a long computation whether its report can be written; leaves nothing behind.

    Args:
        names: Of all files but those of the report's pages.
        force: Files of these names may be anybody's; links and folders in their places are refused all the same.

    Raises:
        OutputError: The folder cannot be written, or holds something else of that name.
    """
    names = (*names, *PAGES, MANIFEST)
    if SAMPLES in names and find_spec("pyarrow") is None:
        raise OutputError(f"{SAMPLES} needs pyarrow, which is not installed", "", "run pip install pyarrow")
    made: list[Path] = []
    try:
        made = [folder for folder in (out, *out.parents) if not folder.exists()]
        shutil.rmtree(_stage(out))
        _check_own(out, names, force)
    except (OSError, ValueError) as error:  # a path with a null byte
        raise _cannot(out, error) from error
    finally:
        for folder in made:
            if folder.is_dir() and not any(folder.iterdir()):
                folder.rmdir()


def _check_own(out: Path, names: Iterable[str], force: bool) -> None:
    """Refuses to touch what no report wrote, and to follow links out of the folder."""
    for name in (MANIFEST, "plots", *names):
        path, odd = out / name, ""
        if path.is_symlink():
            odd = "is a link"
        elif path.exists() and path.is_dir() is not (name == "plots"):
            odd = "is a folder" if path.is_dir() else "is no folder"
        if odd:
            raise OutputError(f"{name} {odd}", str(out), _ELSEWHERE)
    ours = {*WORKING, MANIFEST, *written(out)}
    for name in names:
        if not force and name not in ours and (out / name).exists():
            what = f"{name} is there, and is not as an earlier report wrote it ({MANIFEST} has the digests)"
            raise OutputError(what, str(out), f"{_ELSEWHERE}, or overwrite it by --force")


def put_files(out: Path, files: Mapping[str, str | pd.DataFrame], others: Iterable[str]) -> None:
    """Writes files of a report that has others, too, and first the list of all of them."""
    write_files(out, files, others)


def write_files(out: Path, files: Mapping[str, str | pd.DataFrame], others: Iterable[str] | None = None) -> Path:
    """Writes files into a new folder beside their place, then moves them there.

    Args:
        files: Path below `out` -> text, or table for Parquet.
        others: Further files of the report that these belong to; None if they belong to none.

    Raises:
        OutputError: The folder cannot be written; it is then as it was before.
    """
    stage = None
    try:
        stage = _stage(out)
        for name, content in files.items():
            path = stage / name
            path.parent.mkdir(parents=True, exist_ok=True)
            if isinstance(content, str):
                # a path that is no text, such as that of a scene, is written with escapes
                path.write_text(content, encoding="utf-8", errors="backslashreplace", newline="\n")
            else:
                content.to_parquet(path, index=False)
        if others is not None:
            text = manifest(out, {name: digest(stage / name, "MB of a report's file") for name in files}, others)
            (stage / MANIFEST).write_text(text, encoding="utf-8")
        _move(stage, out)
    except (OSError, ValueError) as error:
        raise _cannot(out, error) from error
    finally:
        if stage is not None and stage.exists():
            shutil.rmtree(stage, ignore_errors=True)
    return out


def _stage(out: Path) -> Path:
    """An empty folder on the same disk: in `out` where that exists (it may be a mount), else beside it."""
    out = out.absolute()
    if "\0" in str(out):
        raise ValueError("it holds a null byte")
    if out.exists() and not out.is_dir():
        raise NotADirectoryError(errno.ENOTDIR, "it is a file")
    home = out if out.is_dir() else out.parent
    home.mkdir(parents=True, exist_ok=True)
    stage = home / f".screwgauge-{uuid4().hex[:8]}"
    stage.mkdir()
    return stage


def _move(stage: Path, out: Path) -> None:
    """Puts the files in place by renaming: their list first, and last ``summary.json``, the sign that all are there."""
    if not out.exists():
        stage.rename(out)
        return
    names = sorted(path.relative_to(stage).as_posix() for path in stage.rglob("*") if path.is_file())
    for name in sorted(names, key=lambda name: (name != MANIFEST, name == "summary.json")):
        (out / name).parent.mkdir(exist_ok=True)
        os.replace(stage / name, out / name)


def _cannot(out: Path, error: OSError | ValueError) -> OutputError:
    return OutputError(f"the folder cannot be written ({why(error)})", str(out), "choose another with --out")
