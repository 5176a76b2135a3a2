import json
import os
import re
from contextlib import suppress
from dataclasses import asdict
from pathlib import Path
from urllib.parse import unquote

import numpy as np
import pandas as pd
import pytest

import screwgauge
from screwgauge import ScrewgaugeError
from support.bench import Journal
from support.command import LIMITS, digest, main, read_json
from support.errors import DescriptionError, UnknownNameError, printable, quote
from support.gate import GateRow, Residual, compare_baseline, from_record, is_record, write_baseline
from support.scene import read_columns

ERROR = Residual("reaction", "N", "screw", "mujoco", 2e-14, 1e-11, "rounding", True, "leg1", 0.5)
ROW = GateRow(
    "a", "agree", "they agree", (ERROR,), "", {"mujoco": "1"}, {"mujoco": "0" * 64}, unread=("x",), read=("y",)
)
BRACKETS = "[" * 100_000


def special(make):
    return lambda path: (path.unlink(missing_ok=True), make(path))


SPECIAL = {
    "fifo": special(os.mkfifo),
    "endless": special(lambda path: path.symlink_to("/dev/zero")),
    "folder": special(os.mkdir),
    "huge": special(lambda path: (path.touch(), os.truncate(path, 10**12))),
}


@pytest.fixture
def known(tmp_path) -> Path:
    file = tmp_path / "baseline.json"
    write_baseline(file, [ROW], smoke=False)
    return file


@pytest.mark.parametrize("kind", SPECIAL)
def test_state_that_is_no_regular_file_in_bounds_is_refused_at_once(kind, known):
    SPECIAL[kind](known)
    said = r": cannot be read \((it is .* regular file|is a directory|it has more than \d+ MB.*)\); check the path\.$"
    with pytest.raises(DescriptionError, match=said):
        compare_baseline(known, [ROW], smoke=False)


def changed(**entries: object):
    def change(record):
        record["scenes"]["a"] |= entries

    return change


def of_error(value: object):
    return changed(errors={"reaction [N] screw - mujoco": value})


@pytest.mark.parametrize(
    "change",
    [
        of_error("text"),
        of_error([]),
        of_error(True),
        of_error(-1.0),
        of_error({}),
        changed(errors=[]),
        changed(versions={"mujoco": 3}),
        changed(files=None),
        lambda record: record.update(environment={"cpu": []}),
        lambda record: record.update(scenes={"a": None}),
    ],
)
def test_a_baseline_with_an_odd_entry_is_none(change, known):
    record = json.loads(known.read_text())
    change(record)
    known.write_text(json.dumps(record))
    with pytest.raises(DescriptionError, match=r"is (no|not a) baseline; create one with --update"):
        compare_baseline(known, [ROW], smoke=False)


@pytest.mark.parametrize("text", [BRACKETS, "9" * 5000, "[]", "", "\x00", '{"a": "\\ud800"}', '{"a": ' * 200 + "1"])
def test_a_baseline_of_odd_text_is_none(text, known):
    known.write_text(text)
    with pytest.raises(DescriptionError, match=r"is (no|not a) baseline|control character") as caught:
        compare_baseline(known, [ROW], smoke=False)
    assert str(caught.value).count("\n") == 0


def test_an_error_of_400_digits_is_none(known):
    known.write_text(known.read_text().replace("2e-14", "9" * 400))
    with pytest.raises(DescriptionError, match="digits"):
        compare_baseline(known, [ROW], smoke=False)


def test_nesting_in_json_is_bounded(tmp_path):
    file, deep = tmp_path / "x.json", LIMITS["nested entries"]
    file.write_text('{"a": ' + "[" * (deep - 2) + "1" + "]" * (deep - 2) + "}")
    assert read_json(file, "thing", "mend it")
    file.write_text('{"a": ' + "[" * deep + "1" + "]" * deep + "}")
    with pytest.raises(DescriptionError, match="nested entries, more than 100"):
        read_json(file, "thing", "mend it")


def test_a_row_comes_back_from_json():
    record = json.loads(json.dumps(asdict(ROW)))
    assert is_record(record, GateRow)
    assert repr(from_record(record, GateRow)) == repr(ROW)


ODD = {"scene": 3, "status": "green", "errors": [{}], "versions": {"a": 1}, "unread": [3], "seconds": "1", "more": 1}


@pytest.mark.parametrize("key", ODD)
def test_a_journal_s_odd_row_is_made_anew(key, tmp_path):
    record = {**json.loads(json.dumps(asdict(ROW))), key: ODD[key]}
    assert not is_record(record, GateRow)


def test_results_that_do_not_fit_are_not_taken_over(tmp_path, cache_folder):
    Journal(tmp_path, "x").keep("a", {"status": 3})
    assert Journal(tmp_path, "x", lambda result: isinstance(result["status"], str)).results == {}


def test_a_table_of_which_a_byte_is_other_is_read_or_refused(tmp_path):
    pytest.importorskip("pyarrow", reason="pyarrow is not installed")
    file, rng = tmp_path / "x.parquet", np.random.default_rng(0)
    pd.DataFrame({"t": [0.0, 1.0], "x": ["a", "b"]}).to_parquet(file)
    data = file.read_bytes()
    for i in rng.integers(len(data), size=100):
        file.write_bytes(data[:i] + bytes([rng.integers(256)]) + data[i + 1 :])
        with suppress(ScrewgaugeError):
            read_columns(file, ["t"])


def test_a_digest_is_that_of_a_regular_file(tmp_path):
    (tmp_path / "x").write_text("")
    assert digest(tmp_path / "x").startswith("e3b0c442")
    os.mkfifo(tmp_path / "fifo")
    with pytest.raises(DescriptionError, match=r"(no|not a) regular file"):
        digest(tmp_path / "fifo")


HIDDEN = ("\u202e", "\u2066", "\u200b", "\u200d", "\ufeff", "\ufe0f", "\u3164", "\x1b", "\x07", "\udcff", "\U000e0041")


@pytest.mark.parametrize("sign", HIDDEN)
def test_what_steers_a_terminal_or_is_not_seen_becomes_a_space(sign):
    assert printable(f"a{sign}b") == "a b"
    assert printable(f"a{sign}\nb", lines=True) == "a \nb"


class Mute:
    def __repr__(self) -> str:
        raise RuntimeError("no words")


@pytest.mark.parametrize(
    "value",
    [16**5000, [1, {"a": 16**5000}], "x" * 10**7, ["x" * 99] * 99, Mute(), [Mute()], "a\nb\u202e::error::", 1.5, None],
    ids=range(9),
)
def test_any_value_is_quoted_on_one_line_of_sixty_characters(value):
    assert len(quote(value)) <= 60
    assert quote(value).isprintable()
    assert len(str(UnknownNameError("engine", value, ["screw"]))) < 200


def test_a_short_value_is_quoted_as_it_is():
    assert (quote("a'b"), quote([1, "x"]), quote("y" * 58)) == ('"a\'b"', "[1, 'x']", f"'{'y' * 58}'")


def test_github_marks_a_file_whatever_its_name_is():
    name = "a\r\nb: c,d%.toml"
    (line,) = screwgauge.Check([GateRow("a", "differ", "100 %\n::x", file=name)]).annotations()
    place, _, text = line.removeprefix("::error file=").partition(",line=1::")
    assert (unquote(place), unquote(text)) == (name, "a: 100 % ::x")
    assert not set("\r\n:,") & set(place)


def test_names_of_files_reach_the_terminal_as_printable_text(inside, monkeypatch, command):
    """U+202E turns what follows it around: a file can look like another one."""
    name = "turn\u202elmot.\u200b.toml"
    Path(name).write_text('mechanism = "slider-crank"\nmotion = 3\n', encoding="utf-8")
    monkeypatch.setenv("GITHUB_ACTIONS", "true")
    assert main(["check", name, "--junit", "junit.xml"]) == 2
    said = "".join(command("run", name, status=2))
    assert "lmot" in said
    written = [path.read_text(encoding="utf-8") for path in Path("screwgauge-out").rglob("report.*")]
    assert len(written) == 2
    for text in (said, *written, Path("junit.xml").read_text(encoding="utf-8"), repr(screwgauge.check(name))):
        assert all(sign.isprintable() or sign in "\n\N{NO-BREAK SPACE}" for sign in text)  # of numbers and units


def test_of_many_names_the_nearest_are_listed_and_the_others_counted():
    names = [f"body{n}.x" for n in range(200)]
    said = str(UnknownNameError("column", "body17", names))
    listed = re.findall(r"body\d+\.x", said)
    assert "body17.x" in listed
    assert len(listed) < 10
    assert f"{200 - len({*listed})} more" in said
    few = names[:12]
    assert re.findall(r"body\d+\.x", str(UnknownNameError("column", "nothing", few))) == few
