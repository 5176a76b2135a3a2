"""Input that cannot be used is refused by its place and a remedy, a row each of `claims/refusals.toml`."""

from collections.abc import Callable

import pytest

from screwgauge import ScrewgaugeError, load_scene, run
from support.claims import cases, table, written
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


@pytest.mark.parametrize("row", [*cases(TABLE["refused"], KEYS)])
def test_place_and_remedy(row, tmp_path, capfd):
    if any(name.endswith(".usda") for name in row["files"]):
        pytest.importorskip("pxr", reason="usd-core (extra: usd)")
    path = written(row, TABLE["texts"], tmp_path)
    with pytest.raises(ScrewgaugeError) as caught:
        ACTS[row["by"]](path, *row.get("with", ()))
    error = caught.value
    assert error.where.replace(f"{tmp_path}/", "") == row["at"]
    assert [word for word in row["says"] if word not in f"{error.what}; {error.remedy}"] == []
    assert "\n" not in str(error)
    assert len(str(error)) < 3000
    assert capfd.readouterr().err == ""
