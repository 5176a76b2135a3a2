"""Plugin of pytest: the fixture ``screwgauge``, and scenes as tests. Nothing heavy is imported before one is used."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from types import ModuleType

import pytest

_SCENES = pytest.StashKey[frozenset[Path]]()


def pytest_addoption(parser: pytest.Parser) -> None:
    """``--screwgauge DIR``, any number of times."""
    said = "collect the scenes (TOML) of a folder as tests, each of which `screwgauge.check` has to pass"
    parser.getgroup("screwgauge").addoption(
        "--screwgauge", dest="screwgauge_folders", action="append", default=[], metavar="DIR", help=said
    )


def pytest_configure(config: pytest.Config) -> None:
    """Finds the scenes. They are collected whether or not the folder is one that pytest would look into."""
    folders = config.option.screwgauge_folders = [str(Path(name).absolute()) for name in config.option.screwgauge_folders]
    scenes = [path for folder in folders for path in _scenes(folder)]
    config.stash[_SCENES] = frozenset(scenes)
    config.args += [str(path) for path in scenes if str(path) not in config.args]


def _scenes(folder: str) -> list[Path]:
    from screwgauge.reference.errors import ScrewgaugeError
    from screwgauge.study.gate.items import items

    if not Path(folder).is_dir():
        raise pytest.UsageError(f"--screwgauge: {folder} is no folder")
    try:
        return [Path(item.files[0]) for item in items([folder])]
    except ScrewgaugeError as error:
        raise pytest.UsageError(f"--screwgauge: {error}") from None


def pytest_collect_file(file_path: Path, parent: pytest.Collector) -> pytest.Collector | None:
    """A scene as a file of one test."""
    return SceneFile.from_parent(parent, path=file_path) if file_path in parent.config.stash[_SCENES] else None


class SceneFile(pytest.File):
    """A scene file."""

    def collect(self) -> Iterator[pytest.Item]:
        yield SceneItem.from_parent(self, name="screwgauge")


class SceneItem(pytest.Item):
    """A scene, which the gate has to pass."""

    def runtest(self) -> None:
        from screwgauge.report.gate import check

        check(self.path).assert_ok()

    def repr_failure(self, excinfo: pytest.ExceptionInfo[BaseException], style: object = None) -> str:
        """What differs, and why; no traceback of ours."""
        if excinfo.errisinstance(AssertionError):
            return str(excinfo.value)
        return str(super().repr_failure(excinfo))

    def reportinfo(self) -> tuple[Path, int, str]:
        return self.path, 0, f"scene {self.path.stem}"


@pytest.fixture
def screwgauge(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    """The package. In a test that asks for it, files are looked for beside the test's own."""
    import screwgauge

    monkeypatch.chdir(request.path.parent)
    return screwgauge
