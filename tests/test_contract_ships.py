import os
import re
import subprocess
from pathlib import Path

import pytest

from support import guide
from support.packages import install
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
WHOLE = f"{FILTER} or test_tasks or feature or redundant or rccc or 3-upu or belt-leg or ruse"


def contract(folder: Path, *options: str, **modules: str) -> tuple[int, str]:
    (folder / "empty").mkdir()
    install(folder, "own-engine", {name: f"{name}_engine:ENGINE" for name in modules})
    for name, text in modules.items():
        (folder / f"{name}_engine.py").write_text(text, encoding="utf-8")
    command = python("-m", "pytest", "-q", "-rsfE", "-p", "no:cacheprovider", "-p", "no:xdist")
    command += ["--pyargs", "screwgauge.contract", *options]
    environment = {**os.environ, "PYTHONPATH": str(folder), "COLUMNS": "500"}
    done = subprocess.run(command, cwd=folder / "empty", env=environment, capture_output=True, text=True, check=False)
    return done.returncode, done.stdout + done.stderr


def own(name: str, text: str = "") -> str:
    return f"{HEAD}{text}\n".replace("own_engine", f"{name}_engine").replace('"own"', f'"{name}"')


def test_an_engine_that_does_all_passes(tmp_path):
    status, said = contract(tmp_path, "-k", FILTER, "--engine", "own", own=own("own"))
    assert status == 0, said
    assert "failed" not in said


def named(text: str) -> str:
    package, source = re.subn(r'package="[^"]+"', 'package="own-engine"', text)[0], r'"\w+:load"'
    return re.sub(source, '"own_engine:load"', package)


@pytest.mark.parametrize("file", ["my_engine.py", "tree_engine.py"])
def test_engines_of_the_page_pass(file, tmp_path):
    text = guide.shown_files()[file]
    assert {*re.findall(r"screwgauge[.\w]*", text)} == {"screwgauge.plugins"}
    status, said = contract(tmp_path, "-k", WHOLE, "--engine", "own", own=named(text))
    assert status == 0, said


#: What an engine does -> what its author reads, beside the names of tests.
WRONG = {
    "nothing": ("ENGINE = replace(ENGINE, tasks=frozenset())", "accepts no task; list GivenMotion"),
    "lacks all": ("ENGINE = replace(ENGINE, lacks=dict.fromkeys(OF_MOTION, 'no'))", "lacks every quantity"),
    "refuses all": (
        "def load(files): raise ModelFileError('is odd', 'own', 'leave it')",
        "try (3ups-upu-s-fast: own: is odd",
    ),
    "misses a library": (
        "def load(files): import missing",
        "'missing'); pip install missing",
    ),
    "prints": (
        "def load(files):\n    print('loaded')\n    return screw.load(files)",
        "the engine prints; turn off the output",
    ),
    "crashes": (
        "import os\n"
        "def load(files):\n"
        "    if files.model.stem == 'slider-crank': os.abort()\n"
        "    return screw.load(files)",
        "crashed: its process received SIGABRT",
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


@pytest.fixture(scope="module")
def told(tmp_path_factory):
    texts = {kind.replace(" ", "_"): text for kind, (text, _) in WRONG.items()}
    texts["has_less"] = "ENGINE = replace(ENGINE, lacks={'reaction': 'has none'})"
    modules = {name: own(name, f"from dataclasses import replace\n{text}") for name, text in texts.items()}
    named = [option for name in modules for option in ("--engine", name)]
    folder = tmp_path_factory.mktemp("contract")
    status, printed = contract(folder, "-k", "slider-crank or planar-4 or printed", *named, **modules)
    assert status == pytest.ExitCode.TESTS_FAILED, printed
    return printed


@pytest.mark.parametrize("kind", WRONG)
def test_its_author_is_told_what_is_wrong(kind, told):
    name, said = kind.replace(" ", "_"), WRONG[kind][1]
    assert any(line.startswith(("FAILED", "ERROR")) and f"[{name}" in line for line in told.splitlines()), told
    assert said in told
    assert "AttributeError" not in told


def test_what_an_engine_lacks_is_skipped_by_name(told):
    assert not any(line.startswith(("FAILED", "ERROR")) and "[has_less" in line for line in told.splitlines()), told
    assert "has_less lacks reaction: has none" in told


@pytest.mark.parametrize(("engine", "said"), [("", "pass --engine"), ("onw", "did you mean 'own'")])
def test_an_engine_that_there_is_not_is_one_sentence(engine, said, tmp_path):
    status, printed = contract(tmp_path, *(["--engine", engine] if engine else []), own=own("own"))
    assert status == pytest.ExitCode.USAGE_ERROR
    assert said in printed
    assert len(printed.strip().splitlines()) == 1
