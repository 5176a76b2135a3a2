"""The history of a gate: what checks have left is there in whole, whoever else writes, and is told by version."""

from __future__ import annotations

import errno
import os
import signal
import subprocess
import sys
from dataclasses import replace
from datetime import UTC, datetime

import pytest

from support.errors import DescriptionError, OutputError, UnknownNameError
from support.gate import GateRow, Residual, against, history, keep, write_latest

pytest.importorskip("duckdb", reason="duckdb is not installed")

ERROR = Residual("reaction", "N", "screw", "mujoco", 2e-14, 1e-11, "rounding", True)
ROW = GateRow("a", "agree", "they agree", (ERROR,), "", {"mujoco": "1"}, {"mujoco": "f" * 64}, seconds=2.0)
DAYS = [datetime(2026, 1, day, tzinfo=UTC) for day in (1, 2, 3)]


@pytest.fixture
def store(tmp_path):
    """Three checks: with an older version, a newer one that lost digits, and one that crashed."""
    later = replace(ROW, errors=(replace(ERROR, error=5e-12), replace(ERROR, unit="N m")), versions={"mujoco": "2"})
    crashed = replace(ROW, status="failed", sentence="a: crashed", errors=())
    for day, row in zip(DAYS, (ROW, later, crashed), strict=True):
        keep(tmp_path / "store", [row, replace(ROW, scene="b")], smoke=False, date=day)
    return tmp_path / "store"


@pytest.mark.slow
def test_checks_are_told_in_their_order_by_their_worst_error(store):
    found = history(store, "a")
    assert found["status"].tolist() == ["agree", "agree", "failed"]
    assert found["worst"].tolist() == ["reaction [N] screw - mujoco"] * 2 + ["a: crashed"]
    assert found["error"].tolist()[:2] == [2e-14, 5e-12]
    assert found["digits"].tolist()[1] == pytest.approx(11.3, abs=0.01)
    assert len(history(store)) == 6


def test_the_command_shows_versions_where_they_change(store, tmp_path, command):
    lines = command("history", "a", "--store", store, "--out", tmp_path / "out").out.splitlines()
    assert next(line for line in lines if line.startswith("2026-01-02")).endswith("  mujoco 2")
    assert {path.name for path in (tmp_path / "out" / "plots").iterdir()} == {"history.svg"}


def test_a_baseline_is_the_last_state_that_passed(store, tmp_path):
    file = tmp_path / "known.json"
    write_latest(file, store, smoke=False)
    assert against(file, [ROW], smoke=False).changed[-1] == "a: mujoco: 2 -> 1"
    worse = replace(ROW, errors=(replace(ERROR, error=6e-11), replace(ERROR, unit="N m")))
    assert "1.1 digits lost" in against(file, [worse], smoke=False).worse[0]
    with pytest.raises(DescriptionError, match="has no check that passed with --smoke"):
        write_latest(file, store, smoke=True)


@pytest.mark.slow
def test_a_kill_and_a_full_disk_leave_the_store_as_it_was(store, monkeypatch):
    before = {path.name: path.read_bytes() for path in store.glob("*.parquet")}
    code = (
        "import os, pathlib, signal, sys\nos.replace = lambda *a: os.kill(os.getpid(), signal.SIGKILL)\n"
        "from screwgauge.study.gate.items import GateRow\nfrom screwgauge.study.gate.history import keep\n"
        "keep(pathlib.Path(sys.argv[1]), [GateRow('a', 'agree', '')], False)"
    )
    assert subprocess.run([sys.executable, "-c", code, store], check=False).returncode == -signal.SIGKILL

    def full(*arguments):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(OutputError, match="no space left"):
        keep(store, [ROW], smoke=False)
    assert {path.name: path.read_bytes() for path in store.glob("*.parquet")} == before
    assert len(history(store, "a")) == 3


@pytest.mark.slow
def test_two_at_once_are_both_kept(store):
    code = (
        "import pathlib, sys\nfrom screwgauge.study.gate.items import GateRow\n"
        "from screwgauge.study.gate.history import keep\n"
        "for i in range(5): keep(pathlib.Path(sys.argv[1]), [GateRow('c', 'agree', '')], False)"
    )
    both = [subprocess.Popen([sys.executable, "-c", code, store]) for _ in range(2)]
    assert [process.wait() for process in both] == [0, 0]
    assert len(history(store, "c")) == 10


BAD = {
    "no store": ("none", "has no history"),
    "a file": ("file", "is no folder"),
    "something else": ("other", "cannot be read as Parquet"),
}


@pytest.mark.parametrize("name", BAD)
def test_bad_input_is_one_sentence(name, tmp_path, refused):
    folder, said = BAD[name]
    (tmp_path / "file").write_text("")
    (tmp_path / "other").mkdir()
    (tmp_path / "other" / "a.parquet").write_text("no Parquet")
    assert said in refused("history", "--store", tmp_path / folder)


def test_what_is_not_installed_is_said_before_any_work(tmp_path, refused, monkeypatch):
    monkeypatch.setattr("screwgauge.study.gate.history.find_spec", lambda name: None if name == "duckdb" else object())
    assert "needs duckdb" in refused("check", "a01-pendulum", "--smoke", "--store", tmp_path / "store")


def test_an_unknown_scene_is_named(store):
    with pytest.raises(UnknownNameError, match="unknown scene 'aa'; did you mean 'a'"):
        history(store, "aa")
