from __future__ import annotations

import os
import re
import subprocess
from pathlib import Path

import pytest

from screwgauge.engines.registry import GROUP
from support import guide
from support.processes import python

pytestmark = pytest.mark.slow
HEAD = """
from screwgauge.engines.registry import Engine
from screwgauge.engines.screw import model as screw
from screwgauge.problem import GivenMotion, InitialValue, States
from screwgauge.quantities import OF_MOTION
from screwgauge.reference.errors import ModelFileError
ENGINE = Engine("own", "an engine", "own_engine:load", frozenset([GivenMotion, InitialValue, States]), "own-engine")
def load(files):
    return screw.load(files)
"""
FILTER = "slider-crank or planar-4 or test_answers or test_refusals"
WHOLE = f"{FILTER} or test_tasks or feature or redundant or rccc or 3-upu or stewart or belt-leg or geared or ruse"


def contract(folder: Path, *options: str, engine: str = "", text: str = "", module: str = "") -> tuple[int, str]:
    """Install an engine and run the contract in an empty folder."""
    (folder / "empty").mkdir()
    (folder / "own_engine.py").write_text(module or HEAD + text, encoding="utf-8")
    said = folder / "own_engine-1.dist-info"
    said.mkdir()
    (said / "METADATA").write_text("Metadata-Version: 2.1\nName: own-engine\nVersion: 1\n", encoding="utf-8")
    (said / "entry_points.txt").write_text(f"[{GROUP}]\nown = own_engine:ENGINE\n", encoding="utf-8")
    named = ["--engine", engine] if engine else []
    command = python("-m", "pytest", "-q", "-rsf", "-p", "no:cacheprovider", "-p", "no:xdist")
    command += ["--pyargs", "screwgauge.contract", *named, *options]
    environment = {**os.environ, "PYTHONPATH": str(folder), "COLUMNS": "500"}
    done = subprocess.run(command, cwd=folder / "empty", env=environment, capture_output=True, text=True, check=False)
    return done.returncode, done.stdout + done.stderr


def test_an_engine_that_does_all_passes(tmp_path):
    status, said = contract(tmp_path, "-k", FILTER, engine="own")
    assert status == 0, said
    assert "failed" not in said


def named(text: str) -> str:
    """Name of the module that `contract` installs."""
    package, source = re.subn(r'package="[^"]+"', 'package="own-engine"', text)[0], r'"\w+:load"'
    return re.sub(source, '"own_engine:load"', package)


@pytest.mark.parametrize("file", ["my_engine.py", "tree_engine.py"])
def test_engines_of_the_page_pass(file, tmp_path):
    text = guide.shown_files()[file]
    assert {*re.findall(r"screwgauge[.\w]*", text)} == {"screwgauge.plugins"}
    status, said = contract(tmp_path, "-k", WHOLE, engine="own", module=named(text))
    assert status == 0, said


#: What an engine does -> what its author reads, beside the names of tests.
WRONG = {
    "nothing": ("ENGINE = replace(ENGINE, tasks=frozenset())", "takes no task; name GivenMotion"),
    "lacks all": ("ENGINE = replace(ENGINE, lacks=dict.fromkeys(OF_MOTION, 'no'))", "lacks every quantity"),
    "refuses all": (
        "def load(files): raise ModelFileError('is odd', 'own', 'leave it')",
        "first (3ups-upu-s-fast: own: is odd",
    ),
    "misses a library": (
        "def load(files): import missing",
        "'missing'); pip install missing",
    ),
    "prints": ("def load(files):\n    print('loaded')\n    return screw.load(files)", "it prints; turn the output"),
    "crashes": (
        "import os\n"
        "def load(files):\n"
        "    if files.model.stem == 'slider-crank': os.abort()\n"
        "    return screw.load(files)",
        "crashed: its process got SIGABRT",
    ),
    "is wrong": (
        "class Model:\n"
        "    def __init__(self, files): self.right = screw.load(files)\n"
        "    def solve(self, problem, progress=lambda share: None):\n"
        "        answer = self.right.solve(problem, progress)\n"
        "        if 'actuator_force' not in answer.values: return answer\n"
        "        old = answer.values['actuator_force']\n"
        "        new = replace(old, array=old.array * (1 + 1e-8))\n"
        "        return replace(answer, values={**answer.values, 'actuator_force': new})\n"
        "def load(files): return Model(files)",
        "a load) differs, first in crank by",
    ),
}


@pytest.mark.parametrize("kind", WRONG)
def test_its_author_is_told_what_is_wrong(kind, tmp_path):
    text, said = WRONG[kind]
    status, printed = contract(
        tmp_path,
        "-k",
        "slider-crank or planar-4 or printed",
        engine="own",
        text=f"from dataclasses import replace\n{text}\n",
    )
    assert status == pytest.ExitCode.TESTS_FAILED, printed
    assert said in printed
    assert "AttributeError" not in printed


def test_what_an_engine_lacks_is_skipped_by_name(tmp_path):
    text = "from dataclasses import replace\nENGINE = replace(ENGINE, lacks={'reaction': 'has none'})"
    status, said = contract(tmp_path, "-k", "slider-crank", engine="own", text=text)
    assert status == 0, said
    assert "own lacks reaction: has none" in said


@pytest.mark.parametrize(("engine", "said"), [("", "give --engine"), ("onw", "did you mean 'own'")])
def test_an_engine_that_there_is_not_is_one_sentence(engine, said, tmp_path):
    status, printed = contract(tmp_path, engine=engine)
    assert status == pytest.ExitCode.USAGE_ERROR
    assert said in printed
    assert len(printed.strip().splitlines()) == 1
