"""Fixtures shared by all tests."""

from __future__ import annotations

import os

from screwgauge.processes import ONE

# BLAS reads these when numpy is first imported. One thread, as on the command line: workers are as many as cores, and
# threads that wait for each other's cores cost forty four-bars six times the processor time.
os.environ.update(ONE)

import gc
import shutil
import sys
from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import TYPE_CHECKING, Any, NamedTuple

import pandas as pd
import pytest

import screwgauge
from screwgauge import load_scene
from screwgauge.engines.screw.integrate import integrate
from screwgauge.study import isolation
from screwgauge.study.bench import timing
from support.bench import LEAVING_OUT, Bench, Plan, bench, contestants
from support.command import main
from support.engines import ENGINES, Problem, unwatched
from support.geometry import Array
from support.mechanism import Mechanism, load_mechanism
from support.repository import repository
from support.scene import FOLDER, observe
from support.solve import Layout, TracedForward, Trajectory, layout

if TYPE_CHECKING:
    from screwgauge import Diagnosis

IN_PROCESSES = isolation.run_isolated


def pytest_addoption(parser: pytest.Parser) -> None:
    group = parser.getgroup("campaigns", "campaigns (-m campaign)")
    group.addoption("--count", type=int, metavar="N", help="rows of each campaign (those of the report that is kept)")
    group.addoption("--models", type=Path, action="append", default=[], metavar="DIR", help="further public models")
    where = "Dask cluster that makes the rows of random mechanisms; all of it needs the folder tests on PYTHONPATH"
    group.addoption("--cluster", metavar="ADDRESS|FILE", help=where)
    group.addoption("--reports", type=Path, metavar="DIR", help="folder of their reports (one that goes away)")


def pytest_ignore_collect(collection_path: Path, config: pytest.Config) -> bool | None:
    """Collect campaigns only on request."""
    return (collection_path.name == "campaigns" and "campaign" not in config.getoption("markexpr")) or None


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    _thin_out(items)
    expression = config.getoption("markexpr")
    late = [name for name in ("campaign", "thorough") if name not in expression]
    left_out = [item for item in items if any(map(item.get_closest_marker, late))]
    config.hook.pytest_deselected(items=left_out)
    items[:] = [item for item in items if item not in {*left_out}]


def _thin_out(items: list[pytest.Item]) -> None:
    seen = Counter[str]()
    for item in items:
        marker = item.get_closest_marker("sampled")
        if marker is not None:
            name = item.nodeid.partition("[")[0]
            if seen[name] % marker.args[0]:
                item.add_marker("thorough")
            seen[name] += 1


def pytest_collection_finish() -> None:
    """Keep the garbage collector off what stays until the end."""
    gc.freeze()
    gc.set_threshold(20_000, 20, 50)


@pytest.fixture(scope="session")
def paper() -> Mechanism:
    return load_mechanism("3ups-upu-s")


@pytest.fixture(scope="session")
def paper_models(paper: Mechanism) -> dict[str, str]:
    """Model files: name -> text."""
    from support.models import model_texts  # whatever reads and imports models comes along, which takes a moment

    return model_texts(paper)


@pytest.fixture(scope="session", autouse=True)
def cache(tmp_path_factory: pytest.TempPathFactory):
    folder = tmp_path_factory.getbasetemp()
    folder = (folder.parent if "PYTEST_XDIST_WORKER" in os.environ else folder) / "cache"
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("SCREWGAUGE_CACHE", str(folder))
        yield


@pytest.fixture(scope="session", autouse=True)
def here():
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(isolation, "run_isolated", unwatched)
        yield


@pytest.fixture
def isolated(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(isolation, "run_isolated", IN_PROCESSES)


@pytest.fixture
def cache_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty cache."""
    monkeypatch.setenv("SCREWGAUGE_CACHE", str(tmp_path / "cache"))
    return tmp_path / "cache"


@pytest.fixture
def diagnosed(tmp_path: Path) -> Callable[..., Diagnosis]:
    def of(a: str, b: str, ending: str = "xml", **options: Any) -> Diagnosis:
        files = [tmp_path / f"{side}.{ending}" for side in "ab"]
        for file, text in zip(files, (a, b), strict=True):
            file.write_text(text, encoding="utf-8")
        return screwgauge.diagnose(*files, **options)

    return of


def first_times(calls, protocol, record, known, first) -> None:
    for key in calls:
        if not known.get(key):
            record(key, first[key])


@pytest.fixture(scope="session")
def bench_of_all() -> Bench:
    chosen = dict.fromkeys(c.name for c in contestants(quick=True) if c.name != LEAVING_OUT)
    plan = Plan(samples=5, rounds=1, budget=1e9, quick=True)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(timing, "measure", first_times)
        return bench(load_scene("3ups-upu-s"), plan=plan, contestants=chosen)


@pytest.fixture
def no_progress(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("screwgauge.report.console.QUIET", float("inf"))


@pytest.fixture(scope="session")
def their_repository(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The repository that `theirs` copies."""
    return repository(tmp_path_factory.mktemp("theirs"))


@pytest.fixture
def theirs(their_repository: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A user's repository as working folder."""
    folder = tmp_path / "theirs"
    shutil.copytree(their_repository, folder)
    monkeypatch.chdir(folder)
    return folder


@pytest.fixture
def inside(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def write(tmp_path: Path):
    def write_text(name: str, text: str) -> Path:
        path = tmp_path / name
        path.write_text(text, encoding="utf-8")
        return path

    return write_text


@pytest.fixture
def refused(capfd: pytest.CaptureFixture[str], tmp_path: Path, no_progress: None):
    """Run a command that must refuse: one sentence, exit 2, nothing written."""

    def check(*arguments: str | Path, out: Path | None = None) -> str:
        before = {path: path.read_bytes() if path.is_file() else b"" for path in tmp_path.rglob("*")}
        status = main([*map(str, arguments), "--out", str(out or tmp_path / "out")])
        said = capfd.readouterr()
        after = {path: path.read_bytes() if path.is_file() else b"" for path in tmp_path.rglob("*")}
        assert status == 2, said.out
        assert said.out == ""
        assert said.err.startswith("screwgauge: ")
        assert said.err.endswith(".\n")
        assert said.err.count("\n") == 1
        assert "Traceback" not in said.err
        assert after == before
        return said.err

    return check


@pytest.fixture
def command(capfd: pytest.CaptureFixture[str]):
    def run(*arguments: object, status: int = 0) -> pytest.CaptureResult[str]:
        assert main([*map(str, arguments)]) == status
        return capfd.readouterr()

    return run


@pytest.fixture
def paper_scene(write):
    def make(**entries: str) -> Path:
        usual = {
            "mechanism": 'mechanism = "3ups-upu-s"',
            "time": "time = { times = [0, 0.5] }",
            "motion": "motion = { a = { offset = 0.1 }, b = { offset = 0.05 } }",
        }
        return write("scene.toml", "\n".join([*(usual | entries).values()]) + "\n")

    return make


@pytest.fixture
def scene(paper_scene) -> screwgauge.Scene:
    return load_scene(paper_scene())


@pytest.fixture
def changed_scene(write, paper_scene):
    def make(changes: str, **entries: str) -> Path:
        write("changed.toml", f'extends = "3ups-upu-s"\nname = "changed"\n{changes}\n')
        return paper_scene(mechanism='mechanism = "changed.toml"', **entries)

    return make


@pytest.fixture
def stand_in(monkeypatch: pytest.MonkeyPatch):
    """Replace engines by functions of a problem: ``stand_in(mujoco=function)``."""

    def put(**functions: Callable[[Problem], object]) -> None:
        for name, function in functions.items():
            module = ModuleType(f"stand_in_for_{name}")
            model = SimpleNamespace(solve=lambda problem, progress=None, function=function: function(problem))
            module.load = lambda files, model=model: model
            monkeypatch.setitem(sys.modules, module.__name__, module)
            monkeypatch.setitem(ENGINES, name, replace(ENGINES[name], source=f"{module.__name__}:load"))

    return put


class Answer(NamedTuple):
    lay: Layout
    trajectory: Trajectory
    observable: Array


@pytest.fixture(scope="session")
def answer():
    def solve(name: str, until: float = float("inf"), every: int = 10, tolerance: float | None = None):
        known = pd.read_csv(FOLDER / f"{name}.csv", comment="#")[::every]
        known = known[known["t"] <= until]
        scene = load_scene(name).at(known["t"].to_numpy())
        lay, task = layout(scene.mechanism), scene.start
        if tolerance is not None:
            method = replace(task.integration, rtol=tolerance, atol=tolerance)
            task = replace(task, integration=method)

        problem = Problem(scene.applied, task, frozenset({"joint_position"}))
        found = integrate(lay, task, scene.applied, traced=TracedForward(lay, problem, task, "llvm"))
        assert found.stopped == ""
        assert len(found.t) == len(known)
        return Answer(lay, found, observe(lay, scene.observables, found.rates.q).array), known

    return solve
