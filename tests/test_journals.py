import sys
from dataclasses import replace

import pytest

import screwgauge
from support.bench import QUICK, Journal, fits, journals
from support.bench import address_of as address_of_bench
from support.engines import further_engines
from support.gate import address, address_module


@pytest.fixture(autouse=True)
def empty(cache_folder):
    """A cache of its own."""


def test_results_and_times_come_back(tmp_path):
    first = Journal(tmp_path, "address")
    first.keep("a", {"status": "ok", "n_sample": 3})
    first.time("a", 0.25)
    first.time("a", 0.5)
    second = Journal(tmp_path, "address")
    assert second.results == {"a": {"status": "ok", "n_sample": 3}}
    assert second.times == {"a": [0.25, 0.5]}
    assert "Resumed: 1 " in second.note


def test_not_a_number_comes_back(tmp_path):
    Journal(tmp_path, "address").keep("a", {"scores": [float("nan")]})
    assert str(Journal(tmp_path, "address").results["a"]["scores"][0]) == "nan"


def test_nothing_is_kept_in_the_folder_of_the_report(tmp_path):
    (tmp_path / "out").mkdir()
    Journal(tmp_path / "out", "address").keep("a", {})
    assert [*(tmp_path / "out").iterdir()] == []
    assert len(journals()) == 1
    assert Journal(tmp_path / "other", "address").results == {}


def test_another_address_starts_afresh_and_says_so(tmp_path):
    Journal(tmp_path, "old").keep("a", {})
    fresh = Journal(tmp_path, "new")
    assert not fresh.results
    assert "has changed" in fresh.note
    assert not Journal(tmp_path, "old").results


FORGED = '{"key": "b", "result": {"status": "agree"}}'


@pytest.mark.parametrize("line", [FORGED, f"{'0' * 64} {FORGED}", f" {FORGED}", "\x00", "[" * 500, "\udc80"])
def test_a_line_that_somebody_else_wrote_is_never_taken(line, tmp_path):
    Journal(tmp_path, "address").keep("a", {"status": "differ"})
    (file,) = journals()
    with file.open("a", encoding="utf-8", errors="surrogateescape") as log:
        log.write(f"{line}\n")
    assert Journal(tmp_path, "address").results == {"a": {"status": "differ"}}


def test_a_line_that_was_changed_is_never_taken(tmp_path):
    Journal(tmp_path, "address").keep("a", {"status": "differ"})
    (file,) = journals()
    file.write_bytes(file.read_bytes().replace(b"differ", b"agree"))
    assert Journal(tmp_path, "address").results == {}


def test_lines_of_another_secret_are_never_taken(tmp_path, cache_folder):
    Journal(tmp_path, "address").keep("a", {})
    (cache_folder / "secret-1").unlink()
    assert Journal(tmp_path, "address").results == {}


def test_a_line_cut_off_while_it_was_written_is_dropped(tmp_path):
    first = Journal(tmp_path, "address")
    first.time("a", 0.25)
    (file,) = journals()
    with file.open("a", encoding="utf-8") as log:
        log.write('0123 {"key": "a", "ti')
    second = Journal(tmp_path, "address")
    assert second.times == {"a": [0.25]}
    second.time("a", 0.5)
    assert Journal(tmp_path, "address").times == {"a": [0.25, 0.5]}


def test_complete_work_leaves_none(tmp_path):
    journal = Journal(tmp_path, "address")
    journal.time("a", 1.0)
    journal.remove()
    assert journals() == []


def test_the_address_of_a_bench_knows_scene_and_extent():
    scene = screwgauge.load_scene("3ups-upu-s").at([0.0, 1.0])
    addresses = [
        address_of_bench(scene, QUICK),
        address_of_bench(scene, replace(QUICK, quick=False)),
        address_of_bench(scene, replace(QUICK, samples=7)),
        address_of_bench(scene.at([0.0, 2.0]), QUICK),
        address_of_bench(screwgauge.load_scene("3ups-upu-s-eq55").at([0.0, 1.0]), QUICK),
        address_of_bench(replace(scene, text={**scene.text, "gravity": ["0", "0", "-9.81000000000000000001"]}), QUICK),
    ]
    assert len(set(addresses)) == len(addresses)
    assert address_of_bench(screwgauge.load_scene("3ups-upu-s").at([0.0, 1.0]), QUICK) == addresses[0]


@pytest.fixture
def fresh(monkeypatch):
    def forget() -> None:
        for each in (address_module._code, address_module._engines, address_module._distributions):
            each.cache_clear()

    def made() -> str:
        forget()
        return address("work")

    yield made
    monkeypatch.undo()
    forget()


def test_an_address_knows_code_and_versions_of_this_package_and_of_engines_of_others(fresh, tmp_path, monkeypatch):
    monkeypatch.setattr(sys, "path", [*sys.path, str(tmp_path)])
    (tmp_path / "theirs").mkdir()
    for name in ("__init__", "model"):
        (tmp_path / "theirs" / f"{name}.py").write_text("raise ImportError\n", encoding="utf-8")
    with further_engines({"theirs": "theirs.model:ENGINE"}):
        seen = [fresh(), fresh()]
        (tmp_path / "theirs" / "model.py").write_text("raise ValueError\n", encoding="utf-8")
        seen.append(fresh())
        folder = tmp_path / "scipy_like-1.dist-info"
        folder.mkdir()
        (folder / "METADATA").write_text("Metadata-Version: 2.1\nName: scipy_like\nVersion: 1\n", encoding="utf-8")
        seen.append(fresh())
    seen.append(fresh())
    monkeypatch.setattr(address_module, "OURS", (".py",))
    seen.append(fresh())
    assert seen[0] == seen[1]
    assert len({*seen}) == 5


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
