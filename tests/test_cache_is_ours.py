import hashlib
import os
import shutil
import stat
from pathlib import Path

import numpy as np
import pytest

import screwgauge
from screwgauge.report import html
from screwgauge.truth import cache
from support.report import RENDERER

ARRAYS = {"numbers": np.arange(3.0)}

pytestmark = pytest.mark.usefixtures("cache_folder")


def entries(folder: Path) -> list[Path]:
    return [path for path in folder.iterdir() if path.name != cache.SECRET]


def keep(key: str = "key", version: str = "version") -> None:
    assert cache.write(key, version, ARRAYS) == ""


def test_folder_and_files_are_the_user_s_alone(cache_folder):
    keep()
    assert stat.S_IMODE(cache_folder.stat().st_mode) == 0o700
    assert {stat.S_IMODE(path.stat().st_mode) for path in cache_folder.iterdir()} == {0o600}
    found, said = cache.read("key", "version")
    assert (found["numbers"].tolist(), said) == ([0.0, 1.0, 2.0], "")


@pytest.mark.slow
def test_a_program_of_one_mechanism_under_the_name_of_another_is_not_run(cache_folder):
    pytest.importorskip("llvmlite")

    def forces(name: str) -> screwgauge.compile:
        return screwgauge.compile(screwgauge.load_scene(name), ("actuator_force",))

    first, second = ("slider-crank", "five-bar")
    forces(first)
    (a,) = entries(cache_folder)
    kept = a.read_bytes()
    forces(second)
    (b,) = {*entries(cache_folder)} - {a}
    b.write_bytes(kept)
    assert [*forces(second).notes] == [cache.DAMAGED]
    assert b.read_bytes() != kept
    assert forces(second).notes == ()


def test_an_entry_under_another_name_is_not_used(cache_folder):
    keep("a")
    shutil.copy(cache_folder / "a", cache_folder / "b")
    assert cache.read("b", "version") == (None, cache.DAMAGED)


def test_an_edited_entry_with_a_fresh_hash_is_not_used(cache_folder):
    keep()
    file = cache_folder / "key"
    head, _, payload = file.read_bytes().partition(b"\n")
    edited = payload + b"more"
    for code in (hashlib.sha256(edited).hexdigest().encode(), b"", head.split(b" ")[2]):
        file.write_bytes(b" ".join([*head.split(b" ")[:2], code]) + b"\n" + edited)
        assert cache.read("key", "version") == (None, cache.DAMAGED)


def test_what_another_format_has_left_is_stale(cache_folder):
    keep()
    payload = (cache_folder / "key").read_bytes().partition(b"\n")[2]
    digest = hashlib.sha256(payload).hexdigest().encode()
    (cache_folder / "key").write_bytes(b" ".join([b"screwgauge-truth", b"version", digest]) + b"\n" + payload)
    assert cache.read("key", "version") == (None, cache.STALE)


def test_another_secret_makes_all_of_it_anew(cache_folder):
    keep()
    (cache_folder / cache.SECRET).write_bytes(bytes(cache.LENGTH))
    assert cache.read("key", "version") == (None, cache.DAMAGED)


@pytest.mark.parametrize("damage", [lambda p: p.write_bytes(b"short"), lambda p: p.chmod(0o644), Path.unlink])
def test_a_secret_that_is_none_any_more_is_replaced(damage, cache_folder):
    keep()
    before = (cache_folder / cache.SECRET).read_bytes()
    damage(cache_folder / cache.SECRET)
    assert cache.read("key", "version") == (None, cache.DAMAGED)
    keep()
    assert cache.read("key", "version")[1] == ""
    assert (cache_folder / cache.SECRET).read_bytes() != before
    assert stat.S_IMODE((cache_folder / cache.SECRET).stat().st_mode) == 0o600


@pytest.mark.parametrize("mode", [0o770, 0o707, 0o777, 0o1777])
def test_a_folder_that_others_can_write_is_not_used(mode, cache_folder):
    keep()
    cache_folder.chmod(mode)
    for said in (cache.read("key", "version")[1], cache.write("key", "version", ARRAYS)):
        assert "chmod go-w" in said
    cache_folder.chmod(0o755)  # they may look
    assert cache.read("key", "version")[1] == ""


def linked(file: Path) -> None:
    file.rename(file.with_name("elsewhere"))
    file.symlink_to("elsewhere")


def doubled(file: Path) -> None:
    os.link(file, file.with_name("elsewhere"))


def piped(file: Path) -> None:
    file.unlink()
    os.mkfifo(file)


def opened_up(file: Path) -> None:
    file.chmod(0o620)


@pytest.mark.parametrize("change", [linked, doubled, piped, opened_up])
def test_what_is_no_file_of_the_user_s_own_is_not_used_and_made_anew(change, cache_folder):
    keep()
    change(cache_folder / "key")
    found, said = cache.read("key", "version")
    assert found is None
    assert said.startswith("the cache cannot be read (")
    assert said.endswith("recomputed")
    keep()
    assert cache.read("key", "version")[1] == ""


def test_a_folder_of_another_user_is_not_used(cache_folder, monkeypatch):
    keep()
    monkeypatch.setattr(os, "geteuid", lambda: os.getuid() + 1)
    for said in (cache.read("key", "version")[1], cache.write("key", "version", ARRAYS)):
        assert "belongs to another user" in said


def test_a_file_beside_it_puts_no_script_into_a_page(cache_folder, monkeypatch):
    monkeypatch.setattr(RENDERER, "ask", lambda call: "vega();")
    assert html.chart_script() == "vega();"
    (file,) = entries(cache_folder)
    for _ in range(2):
        keep("other", "release")
        file.write_bytes((cache_folder / "other").read_bytes())
        assert html.chart_script() == "vega();"


def test_who_has_no_home_has_no_cache_and_is_told(monkeypatch):
    monkeypatch.delenv(cache.VARIABLE)
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    for home in ("", "not/absolute"):
        monkeypatch.setenv("HOME", home)
        assert "there is no home folder" in cache.write("key", "version", ARRAYS)
        assert "there is no home folder" in cache.read("key", "version")[1]
    monkeypatch.setenv("XDG_CACHE_HOME", "relative")  # counts as none
    assert "there is no home folder" in cache.write("key", "version", ARRAYS)
