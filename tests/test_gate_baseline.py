import errno
import json
import os
import signal
import subprocess
import sys
from dataclasses import replace

import pytest

from screwgauge import CheckReport
from support.command import main, replace_file
from support.errors import DescriptionError, OutputError
from support.gate import GateRow, Residual, compare_baseline, write_baseline

USUAL = Residual("reaction", "N", "screw", "mujoco", 2e-14, 1e-11, "rounding", True, "leg1", 0.5)


def rows(error: float, **changes: object) -> list[GateRow]:
    row = GateRow("a", "agree", "they agree", (replace(USUAL, error=error),), "", {"mujoco": "1"}, {"mujoco": "0" * 64})
    return [replace(row, **changes)]


@pytest.fixture
def known(tmp_path):
    """A baseline of two scenes."""
    file = tmp_path / "baseline.json"
    write_baseline(file, [*rows(2e-14), *rows(3e-12, scene="b")], smoke=False)
    return file


@pytest.mark.parametrize(
    ("before", "now", "worse", "improved"),
    [
        (2e-14, 9e-13, "", ""),  # what rounding makes of it on another machine
        (2e-14, 3e-12, "2.2 digits lost", ""),
        (2e-12, 1.9e-11, "", ""),
        (2e-12, 2.1e-11, "1.0 digits lost", ""),
        (2e-6, 2e-14, "", "8.0 digits gained"),
        (2e-14, float("nan"), "no longer a number", ""),
        (float("nan"), float("nan"), "", ""),
        (0.0, 1e-16, "", ""),
    ],
)
def test_an_error_has_grown_when_a_digit_more_than_noise_is_lost(tmp_path, before, now, worse, improved):
    file = tmp_path / "baseline.json"
    write_baseline(file, rows(before), smoke=False)
    found = compare_baseline(file, rows(now), smoke=False)
    assert bool(found.worse) is bool(worse)
    assert bool(found.improved) is bool(improved)
    for sentence in (*found.worse, *found.improved):
        assert sentence.startswith("a: reaction [N] screw - mujoco: ")
    if "lost" in worse or "number" in worse:
        assert worse in found.worse[0]
    if improved:
        assert improved in found.improved[0]


def test_a_regression_fails_within_every_tolerance_and_shows_first_what_changed(known):
    now = rows(9e-12, versions={"mujoco": "2"}, files={"mujoco": "1" * 64})
    check = CheckReport(now, against=compare_baseline(known, now, smoke=False))
    assert now[0].ok
    assert check.exit_status == 1
    text = repr(check)
    said = ["a: mujoco: 1 -> 2", "a: mujoco has changed", "b is in the baseline", "digits lost"]
    assert all(sentence in text for sentence in said)
    assert text.index(said[0]) < text.index("scene  ") < text.index("digits lost")
    with pytest.raises(AssertionError, match="Regression: a: reaction"):
        check.assert_ok()
    assert 'failures="1"' in check.junit()


def test_time_and_machine_do_not_count(known):
    assert "seconds" not in known.read_text()
    record = json.loads(known.read_text())
    record["environment"] |= {"cpu": "another", "numpy": "1.0"}
    known.write_text(json.dumps(record))
    found = compare_baseline(known, rows(2e-14, seconds=1e6), smoke=False)
    assert not found.worse
    assert any(sentence.startswith("cpu: another -> ") for sentence in found.changed)
    assert any(sentence.startswith("numpy: 1.0 -> ") for sentence in found.changed)


def test_what_is_compared_no_longer_is_a_regression_and_new_ones_are_said(known):
    assert compare_baseline(known, rows(0.0, errors=()), smoke=False).worse == [
        "a: reaction [N] screw - mujoco is no longer compared"
    ]
    new = [*rows(2e-14), *rows(1.0, scene="c")]
    assert "c is not in the baseline (--update adds it)" in compare_baseline(known, new, smoke=False).notes


def test_a_baseline_of_something_else_is_bad_input(known):
    with pytest.raises(DescriptionError, match="is a baseline for a, b, not for c"):
        compare_baseline(known, rows(0.0, scene="c"), smoke=False)
    with pytest.raises(DescriptionError, match="was made without --smoke"):
        compare_baseline(known, rows(0.0), smoke=True)


def test_what_could_not_be_checked_is_no_known_state(known):
    before = known.read_bytes()
    with pytest.raises(OutputError, match="a cannot be checked"):
        write_baseline(known, rows(0.0, status="failed"), smoke=False)
    assert known.read_bytes() == before


@pytest.mark.slow
def test_updating_is_explicit(tmp_path, inside, command, capfd):
    usual = ["check", "a01-pendulum", "--smoke", "--baseline", "known.json"]
    assert main(usual) == 2
    assert main([*usual, "--update"]) == 0
    before = (tmp_path / "known.json").read_bytes()
    assert main(usual) == 0
    assert (tmp_path / "known.json").read_bytes() == before
    record = json.loads(before)
    record["scenes"]["a01-pendulum"]["errors"]["reaction [N] screw - mujoco"] = 1e-14
    (tmp_path / "known.json").write_text(json.dumps(record))
    capfd.readouterr()
    assert "is no longer compared" in command(*usual, status=1).out


@pytest.mark.parametrize("at", ["fsync", "replace"])
def test_a_kill_leaves_the_file_as_it_was(known, at):
    before = known.read_bytes()
    code = (
        f"import os, signal, sys, pathlib\nos.{at} = lambda *a: os.kill(os.getpid(), signal.SIGKILL)\n"
        "from screwgauge.reference.outputs import replace_file\n"
        "replace_file(pathlib.Path(sys.argv[1]), 'new')\n"
    )
    assert subprocess.run([sys.executable, "-c", code, known], check=False).returncode == -signal.SIGKILL
    assert known.read_bytes() == before
    replace_file(known, "new")
    assert known.read_text() == "new"


def test_a_full_disk_leaves_the_file_as_it_was(known, monkeypatch):
    def full(number):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    before = known.read_bytes()
    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(OutputError, match="no space left"):
        write_baseline(known, rows(0.0), smoke=False)
    assert known.read_bytes() == before
    assert [path.name for path in known.parent.iterdir()] == [known.name]


@pytest.mark.slow
def test_of_two_at_once_one_is_there_in_whole(known):
    code = "import pathlib, sys\nfrom screwgauge.reference.outputs import replace_file\n"
    code += "for i in range(200): replace_file(pathlib.Path(sys.argv[1]), sys.argv[2] * 10000)"
    both = [subprocess.Popen([sys.executable, "-c", code, known, sign]) for sign in "ab"]
    assert [process.wait() for process in both] == [0, 0]
    assert known.read_text() in ("a" * 10000, "b" * 10000)
