"""Input that cannot be used is refused by its place and a remedy, a row each of `claims/refusals.toml`."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from screwgauge import ScrewgaugeError, load_scene, run
from support.claims import cases, edited, filled, table, text_of
from support.geometry import number
from support.mechanism import load_mechanism
from support.models import import_model, read_loops
from support.readings import libraries_for, read, with_loops
from support.scene import check_home

TABLE = table("refusals")
ACTS: dict[str, Callable[..., object]] = {
    "run": lambda path, *engines: run(load_scene(path), engines=engines or ["screw"]),
    "mechanism": lambda path: check_home(load_mechanism(path, closed=False)),
    "loops": read_loops,
    "read": lambda path, library="": read(path, library or libraries_for(path)[0]),
    "with loops": lambda path, model: with_loops(read(path.with_name(model), "pinocchio"), path),
    "import": import_model,
    "number": lambda path: number(path.read_text(encoding="utf-8"), path.name),
}
KEYS = {"by", "with", "files", "edits", "old", "new", "text", "at", "says"}


def refusal(row: dict[str, Any], folder: Path) -> ScrewgaugeError:
    """Write the files of a row, the first one edited, and take that in; return the refusal."""
    texts = {name: text_of(text, TABLE["texts"]) for name, text in row["files"].items()}
    name = next(iter(texts))
    edits = row.get("edits", [[row["old"], row.get("new", "")]] if "old" in row else [])
    texts[name] = edited(filled(row.get("text", texts[name]), TABLE["texts"]), edits)
    for file, text in texts.items():
        (folder / file).write_text(filled(text, TABLE["texts"]), encoding="utf-8", newline="")
    with pytest.raises(ScrewgaugeError) as error:
        ACTS[row["by"]](folder / name, *row.get("with", ()))
    return error.value


@pytest.mark.parametrize("row", [*cases(TABLE["refused"], KEYS)])
def test_place_and_remedy(row, tmp_path, capfd):
    if any(name.endswith(".usda") for name in row["files"]):
        pytest.importorskip("pxr", reason="usd-core (extra: usd)")
    error = refusal(row, tmp_path)
    assert error.where.replace(f"{tmp_path}/", "") == row["at"]
    assert [word for word in row["says"] if word not in f"{error.what}; {error.remedy}"] == []
    assert "\n" not in str(error)
    assert len(str(error)) < 3000
    assert capfd.readouterr().err == ""
