import resource
from contextlib import contextmanager

import pytest

from screwgauge.report import write
from screwgauge.truth import cache
from support.bench import Journal, journals
from support.command import main
from support.errors import OutputError
from support.report import write_files

pytestmark = pytest.mark.slow

RUN = ["run", "slider-crank", "--engines", "screw", "--quantities", "joint_position"]


@contextmanager
def files_of_at_most(size: int):
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


def test_rows_before_the_disk_was_full_are_there_in_whole(tmp_path, cache_folder):
    journal = Journal(tmp_path, "x")
    journal.keep("1", {"b": "first"})
    (file,) = journals()
    with (
        files_of_at_most(file.stat().st_size + 5),
        pytest.raises(OutputError, match=r"journal-.*: cannot be written \(.*run the s"),
    ):
        journal.keep("2", {"b": "x" * 50})
    journal.keep("3", {"b": "third"})
    assert [*Journal(tmp_path, "x").results.items()] == [("1", {"b": "first"}), ("3", {"b": "third"})]


def test_where_no_journal_can_be_kept_work_is_done_all_the_same(monkeypatch, tmp_path):
    monkeypatch.setenv(cache.VARIABLE, "/dev/null/none")
    journal = Journal(tmp_path, "x")
    journal.keep("1", {"b": "first"})
    assert journal.results == {"1": {"b": "first"}}
    assert "If interrupted, this work loses" in journal.note


def test_a_run_whose_numbers_cannot_be_written_says_what_it_found(tmp_path, command, monkeypatch, no_progress):
    def put(*arguments):
        with files_of_at_most(500):  # several of them are longer
            write_files(*arguments)

    monkeypatch.setattr(write, "write_files", put)
    said = command(*RUN, "--out", tmp_path / "out", status=2)
    assert "Only screw ran" in said.out
    assert said.out.endswith("report: none\n")
    assert "cannot write to the folder (" in said.err
    assert not (tmp_path / "out").exists()


@pytest.mark.slow
@pytest.mark.parametrize("home", [None, "", "/dev/null/home"])
def test_who_has_no_home_runs_all_the_same(home, tmp_path, monkeypatch, no_progress):
    for name in (cache.VARIABLE, "XDG_CACHE_HOME", "HOME"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr("os.path.expanduser", lambda path: path if home is None else path.replace("~", home))
    if home is not None:
        monkeypatch.setenv("HOME", home)
    assert main([*RUN, "--out", str(tmp_path / "out")]) == 0
