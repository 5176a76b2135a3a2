"""An interrupted bench keeps what it has, and takes it up only if nothing has changed."""

from __future__ import annotations

from dataclasses import replace

import pytest

import screwgauge
from support.bench import Journal, fits, stamp
from support.errors import OutputError


@pytest.fixture
def path(tmp_path):
    return tmp_path / "out" / "bench.partial.jsonl"


def test_results_and_times_come_back(path):
    first = Journal(path, "stamp")
    first.keep("a", {"status": "ok", "n_sample": 3})
    first.time("a", 0.25)
    first.time("a", 0.5)
    second = Journal(path, "stamp")
    assert second.results == {"a": {"status": "ok", "n_sample": 3}}
    assert second.times == {"a": [0.25, 0.5]}
    assert "Resumed: 1 " in second.note


def test_not_a_number_comes_back(path):
    Journal(path, "stamp").keep("a", {"scores": [float("nan")]})
    assert str(Journal(path, "stamp").results["a"]["scores"][0]) == "nan"


def test_another_stamp_starts_afresh_and_says_so(path):
    Journal(path, "old").keep("a", {})
    fresh = Journal(path, "new")
    assert not fresh.results
    assert "have changed" in fresh.note
    assert not Journal(path, "new").results


def test_a_line_cut_off_while_it_was_written_is_dropped(path):
    first = Journal(path, "stamp")
    first.time("a", 0.25)
    with path.open("a", encoding="utf-8") as file:
        file.write('{"key": "a", "ti')
    second = Journal(path, "stamp")
    assert second.times == {"a": [0.25]}
    second.time("a", 0.5)
    assert Journal(path, "stamp").times == {"a": [0.25, 0.5]}


@pytest.mark.parametrize("text", ["no JSON at all\n", "[1, 2]\n", "\x00\n", '{"mine": 1}\n'])
def test_a_file_of_something_else_is_no_journal_and_stays(path, text):
    path.parent.mkdir()
    path.write_text(text, encoding="utf-8")
    with pytest.raises(OutputError, match="is no journal of interrupted work"):
        Journal(path, "stamp")
    assert path.read_text(encoding="utf-8") == text


def test_an_empty_journal_is_begun(path):
    path.parent.mkdir()
    path.write_text("", encoding="utf-8")
    Journal(path, "stamp").time("a", 1.0)
    assert Journal(path, "stamp").times == {"a": [1.0]}


def test_a_complete_bench_leaves_none(path):
    journal = Journal(path, "stamp")
    journal.remove()
    assert not path.exists()


def test_a_folder_that_cannot_be_written_is_one_sentence(tmp_path):
    (tmp_path / "file").write_text("", encoding="utf-8")
    with pytest.raises(OutputError, match="cannot be written"):
        Journal(tmp_path / "file" / "bench.partial.jsonl", "stamp")


def test_the_stamp_knows_scene_environment_and_extent():
    scene = screwgauge.load_scene("3ups-upu-s").at([0.0, 1.0])
    stamps = [
        stamp(scene, {}, False, 5),
        stamp(scene, {"cpu": "another"}, False, 5),
        stamp(scene, {}, True, 5),
        stamp(scene, {}, False, 6),
        stamp(scene.at([0.0, 2.0]), {}, False, 5),
        stamp(screwgauge.load_scene("3ups-upu-s-eq55").at([0.0, 1.0]), {}, False, 5),
        stamp(replace(scene, text={**scene.text, "gravity": ["0", "0", "-9.81000000000000000001"]}), {}, False, 5),
    ]
    assert len(set(stamps)) == len(stamps)
    assert stamp(screwgauge.load_scene("3ups-upu-s").at([0.0, 1.0]), {}, False, 5) == stamps[0]


SCORED = {"status": "ok", "n_sample": 3, "first": 0.5, "scores": {"reaction": [1e-12, float("nan"), ""]}}


@pytest.mark.parametrize(
    "change",
    [
        {"status": "green"},
        {"n_sample": "3"},
        {"first": None},
        {"first": float("nan")},
        {"scores": []},
        {"scores": {"reaction": [1.0]}},
        {"scores": {"reaction": ["1", "2", ""]}},
        {"status": "failed", "reason": 3},
    ],
)
def test_results_of_a_bench_with_an_odd_entry_are_made_anew(change):
    assert fits(SCORED)
    assert fits({"status": "failed", "reason": "it crashed"})
    assert not fits(SCORED | change)
