import subprocess
import sys
from pathlib import Path

import pytest
from fuzz_files import KINDS

pytestmark = pytest.mark.slow

SCRIPT = Path(__file__).with_name("fuzz_commands.py")


@pytest.mark.slow
def test_commands_on_broken_files_answer_or_refuse():
    """A process of its own forks one for each case: this one has threads."""
    pytest.importorskip("pyarrow", reason="pyarrow is not installed")
    command = [sys.executable, str(SCRIPT), "--count", "3", "--seed", "7"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "WRONG" not in done.stdout
    ended = [line.split("\t") for line in done.stdout.splitlines() if "\t" in line]
    assert sum(int(count) for *_, count in ended) == 3 * len(KINDS)
    assert {kind for kind, *_ in ended} == {*KINDS}
