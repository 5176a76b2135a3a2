import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import screwgauge
from support import bad_works
from support.command import CLI
from support.engines import run_isolated, silent
from support.processes import inherit_safely, safe_path

#: Modules that processes import early, by whatever starts them.
NAMES = ("cloudpickle", "json", "numpy", "loky", "multiprocessing", "pickle", "threading", "screwgauge", "pinocchio")
#: Leaves a mark, and then is what it stands for.
CODE = """import os, sys
open("imported", "a").write(__name__)
here = os.path.dirname(os.path.abspath(__file__))
sys.path[:] = [place for place in sys.path if os.path.abspath(place or ".") != here]
del sys.modules[__name__]
__import__(__name__)
"""
STARTS = re.compile(r"""sys\.executable|\[str\(python\), "-[^P]""")


@pytest.mark.slow
@pytest.mark.parametrize("command", ["check turn.toml", "run turn.toml", "import four-bar.xml --out new.toml"])
def test_modules_beside_a_scene_are_not_imported(command, theirs):
    for name in NAMES:
        Path(f"{name}.py").write_text(CODE, encoding="utf-8")
    environment = {name: value for name, value in os.environ.items() if name not in ("PYTHONPATH", "PYTHONSAFEPATH")}
    # as the console script starts: the folder is on nobody's path
    code = f"import sys; sys.path.remove(''); {CLI}"
    done = subprocess.run(
        [sys.executable, "-c", code, *command.split()], env=environment, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    assert not Path("imported").exists()


def test_the_current_folder_is_on_no_path_that_children_get(inside, monkeypatch):
    monkeypatch.setattr(sys, "path", [str(inside), "", "lib", *sys.path])
    before = [*sys.path], dict(os.environ)
    with inherit_safely():
        assert os.environ["PYTHONSAFEPATH"] == "1"
        assert {"", str(inside)}.isdisjoint(sys.path)
        assert str(inside / "lib") in sys.path
        assert sys.path == [os.path.abspath(place) for place in safe_path()]
    assert ([*sys.path], dict(os.environ)) == before


def test_every_start_of_python_leaves_the_folder_out():
    package = Path(screwgauge.__file__).parent
    assert {path.name for path in package.rglob("*.py") if STARTS.search(path.read_text(encoding="utf-8"))} == {
        "matrix.py",  # names the Python of an environment that uv makes
        "processes.py",
    }


def test_a_process_that_is_kept_works_in_the_folder_in_which_it_is_asked(tmp_path, monkeypatch):
    for name in ("first", "second"):
        (tmp_path / name).mkdir()
        monkeypatch.chdir(tmp_path / name)
        assert run_isolated({"kept": bad_works.where}, screwgauge.Limits(), silent) == {"kept": str(tmp_path / name)}
    shutil.rmtree(tmp_path / "first")
