import json
from itertools import count

import pytest

import screwgauge
from screwgauge.diagnosis import diagnose
from support import robots
from support.diagnosis import Deadline


@pytest.fixture
def pair(tmp_path):
    model = robots.write(tmp_path)[1]
    other = robots.edited(model, 'damping="0.14"', 'damping="0.24"', "other.xml")
    return model, robots.edited(other, 'gravity="0 0 -9.81"', 'gravity="0 0 -9"', "other.xml")


def stopping(monkeypatch, work):
    def deadline(limit):
        late = []

        class Late(Deadline):
            def is_over(self, what):
                late.extend([what] if what.startswith(work) else [])
                self._end = -1.0 if late else self._end
                return super().is_over(what)

        return Late(limit)

    monkeypatch.setattr(diagnose, "Deadline", deadline)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("work", "there"),
    [
        ("causes", {"facts"}),
        ("torques of", {"facts", "causes"}),
        ("proof", {"facts", "causes", "witnesses"}),
    ],
)
def test_what_is_there_is_reported_and_what_is_not_is_named(pair, monkeypatch, work, there):
    stopping(monkeypatch, work)
    found = screwgauge.diagnose(*pair)
    assert "Stopped after 3600 s (--limit); skipped: " in found.verdict
    assert found.exit_status == 3
    assert not found.same
    assert found.left_out[0].startswith(work)
    assert {name for name in ("facts", "causes", "fix", "witnesses") if getattr(found.found, name)} == there
    assert {each.what for each in found.differences} == {"gravity", "damping"}


def test_a_deadline_is_over_when_its_time_is():
    ticks = count()
    deadline = Deadline(3.0, lambda: float(next(ticks)))  # asked for the time at 0
    assert [deadline.is_over(work) for work in "abcc"] == [False, False, True, True]
    assert deadline.left_out == ["c"]
    assert not Deadline().is_over("anything")


def test_the_same_is_not_said_of_what_was_not_compared(pair, monkeypatch):
    stopping(monkeypatch, "torques of")
    found = screwgauge.diagnose(pair[0], pair[0])
    assert "compared differs. Stopped" in found.verdict
    assert not found.same


def test_the_command_writes_the_partial_report_and_ends_with_3(pair, tmp_path, inside, command):
    out = tmp_path / "out"
    assert "STOPPED" in command("diagnose", *map(str, pair), "--limit", "1e-9", "--out", out, status=3).out
    assert json.loads((out / "diagnosis.json").read_text(encoding="utf-8"))["left_out"]
    assert "Omitted for lack of time" in (out / "report.md").read_text(encoding="utf-8")
    for bad in ("0", "-1", "nan"):
        assert "--limit" in command("diagnose", *map(str, pair), "--limit", bad, status=2).err
