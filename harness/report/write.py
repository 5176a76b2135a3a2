"""Writes reports and their data into folders: all of it or nothing."""

from __future__ import annotations

import errno
import os
import shutil
from collections.abc import Mapping, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Any
from uuid import uuid4

import pandas as pd

from screwgauge.environment import json_text
from screwgauge.reference.errors import OutputError
from screwgauge.report.blocks import Block, Picture
from screwgauge.report.html import page
from screwgauge.report.markdown import markdown

SAMPLES = "samples.parquet"


def write_report(out: Path, blocks: Sequence[Block], data: Mapping[str, Any], figures: int | None = None) -> Path:
    """Writes ``report.md``, ``report.html``, the plots in them, and data files.

    Args:
        out: Folder, made if need be. Files of an earlier report there are replaced; other files stay.
        data: File name -> table for CSV and Parquet, anything else for JSON.
        figures: Significant figures of the numbers in CSV; every bit by default.

    Raises:
        OutputError: The folder cannot be written; it is then as it was before.
    """
    drawn = {f"plots/{block.name}.svg": block.svg for block in blocks if isinstance(block, Picture)}
    texts = {name: _text(value, figures) if name != SAMPLES else value for name, value in data.items()}
    return write_files(out, {**drawn, "report.md": markdown(blocks), "report.html": page(blocks), **texts})


def _text(value: Any, figures: int | None) -> str:
    if not isinstance(value, pd.DataFrame):
        return json_text(value)
    form = None if figures is None else f"%.{figures}g"
    return value.to_csv(index=False, na_rep="nan", lineterminator="\n", float_format=form)


def check_writable(out: Path, *, samples: bool = False) -> None:
    """Finds out before a long computation whether its output can be written; leaves nothing behind.

    Args:
        samples: Whether there will be samples.

    Raises:
        OutputError: It cannot.
    """
    if samples and find_spec("pyarrow") is None:
        raise OutputError(f"{SAMPLES} needs pyarrow, which is not installed", "", "run pip install pyarrow")
    made = [folder for folder in (out, *out.parents) if not folder.exists()]
    try:
        shutil.rmtree(_stage(out))
    except OSError as error:
        raise _cannot(out, error) from error
    finally:
        for folder in made:
            if folder.is_dir() and not any(folder.iterdir()):
                folder.rmdir()


def write_files(out: Path, files: Mapping[str, str | pd.DataFrame]) -> Path:
    """Writes files into a new folder beside their place, then moves them there.

    Args:
        files: Path below `out` -> text, or table for Parquet.

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
                path.write_text(content, encoding="utf-8", newline="\n")
            else:
                content.to_parquet(path, index=False)
        _move(stage, out)
    except OSError as error:
        raise _cannot(out, error) from error
    finally:
        if stage is not None and stage.exists():
            shutil.rmtree(stage, ignore_errors=True)
    return out


def _stage(out: Path) -> Path:
    """An empty folder on the same disk: in `out` where that exists (it may be a mount), else beside it."""
    out = out.absolute()
    if out.exists() and not out.is_dir():
        raise NotADirectoryError(errno.ENOTDIR, "it is a file")
    home = out if out.is_dir() else out.parent
    home.mkdir(parents=True, exist_ok=True)
    stage = home / f".screwgauge-{uuid4().hex[:8]}"
    stage.mkdir()
    return stage


def _move(stage: Path, out: Path) -> None:
    """Puts the files in place by renaming; ``summary.json`` comes last, as the sign that all are there."""
    if not out.exists():
        stage.rename(out)
        return
    names = sorted(path.relative_to(stage) for path in stage.rglob("*") if path.is_file())
    for name in names:
        if (out / name).is_dir():
            raise IsADirectoryError(errno.EISDIR, f"{name} is a folder")
    whole = any(name.name == "report.md" for name in names)
    old = {path.relative_to(out) for path in (*out.glob("plots/*.svg"), out / SAMPLES) if whole and path.is_file()}
    for name in sorted(names, key=lambda name: name.name == "summary.json"):
        (out / name).parent.mkdir(exist_ok=True)
        os.replace(stage / name, out / name)
    for name in old - set(names):  # of an earlier run; beside the new report they would mislead
        (out / name).unlink()


def _cannot(out: Path, error: OSError) -> OutputError:
    reason = (error.strerror or str(error)).lower()
    return OutputError(f"the folder cannot be written ({reason})", str(out), "choose another with --out")
