import json
import re
import subprocess
from pathlib import Path

import pytest

from screwgauge import environment as env
from screwgauge.environment import environment
from support.command import loaded_after


def test_environment_names_no_place_or_person() -> None:
    record = environment()
    assert {"platform", "cpu", "cores", "python", "packages", "threads"} <= set(record)
    text = json.dumps(record)
    assert str(Path.home()) not in text
    assert str(Path(__file__).resolve().parents[1]) not in text


def test_a_commit_is_marked_where_its_code_was_changed_and_not_where_reports_were(tmp_path, monkeypatch) -> None:
    for name in ("harness/environment.py", "models/a.py", "reference/a.py", "pyproject.toml", "reports/a.csv"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text("1\n", encoding="utf-8")
    git = ["git", "-C", str(tmp_path), "-c", "user.name=a", "-c", "user.email=a"]
    for words in (["init", "-q"], ["add", "."], ["commit", "-qm", "a"]):
        subprocess.run([*git, *words], check=True)
    monkeypatch.setattr(env, "__file__", str(tmp_path / "harness/environment.py"))
    (tmp_path / "reports/a.csv").write_text("2\n", encoding="utf-8")
    assert re.fullmatch(r"[0-9a-f]{40}", env._commit.__wrapped__())
    (tmp_path / "models/a.py").write_text("2\n", encoding="utf-8")
    assert re.fullmatch(r"[0-9a-f]{40}-dirty", env._commit.__wrapped__())


@pytest.mark.slow
def test_environment_imports_no_engine() -> None:
    code = "from screwgauge.environment import environment; environment()"
    assert loaded_after(code, "pinocchio", "mujoco", "vl_convert") == set()
