"""Pytest plugin: the fixture ``screwgauge``, and scenes as tests. Heavy modules are imported on first use."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType

import pytest

CONTRACT = "screwgauge.contract"
_SCENES = pytest.StashKey[list[Path]]()


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the options ``--screwgauge DIR`` and ``--engine NAME``, each of which may be repeated."""
    text = "collect the scenes (TOML) of a folder as tests that must pass `screwgauge.check`"
    group = parser.getgroup("screwgauge")
    group.addoption("--screwgauge", dest="screwgauge_folders", action="append", default=[], metavar="DIR", help=text)
    text = "engine to be tested by `--pyargs screwgauge.contract`"
    group.addoption("--engine", dest="screwgauge_engines", action="append", default=[], metavar="NAME", help=text)


def pytest_configure(config: pytest.Config) -> None:
    """Find the scenes before any test runs, because workers may run in a different folder."""
    names = config.option.screwgauge_folders
    config.option.screwgauge_folders = folders = [Path(name).absolute() for name in names]
    config.stash[_SCENES] = [path for folder in folders for path in _scenes(folder)]
    if config.option.pyargs and any(name.startswith(CONTRACT) for name in config.args):
        contract_engines(config)


def contract_engines(config: pytest.Config) -> list[str]:
    """Return the names of the engines to be tested against the contract.

    Raises:
        pytest.UsageError: No engine is named, or a named engine is unknown.
    """
    from screwgauge.engines.registry import check_engines
    from screwgauge.reference.errors import ScrewgaugeError

    if not config.option.screwgauge_engines:
        raise pytest.UsageError("no engine is named; pass --engine NAME, one of `screwgauge list engines`")
    try:
        return list(check_engines(config.option.screwgauge_engines, "--engine"))
    except ScrewgaugeError as error:
        raise pytest.UsageError(f"{error} Your own engine is known once its package is installed.") from None


def _scenes(folder: Path) -> list[Path]:
    from screwgauge.reference.errors import ScrewgaugeError
    from screwgauge.study.gate.items import items

    if not os.path.isdir(folder):
        raise pytest.UsageError(f"--screwgauge: {folder} is not a folder")
    try:
        return [Path(item.files[0]) for item in items([folder])]
    except ScrewgaugeError as error:
        raise pytest.UsageError(f"--screwgauge: {error}") from None


@pytest.hookimpl(tryfirst=True)  # before other hooks, so that scenes can be deselected
def pytest_collection_modifyitems(session: pytest.Session, items: list[pytest.Item]) -> None:
    """Add the scenes, even if pytest does not search their folder."""
    for path in session.config.stash[_SCENES]:
        items += SceneFile.from_parent(session, path=path).collect()


class SceneFile(pytest.File):
    """A scene file."""

    def collect(self) -> Iterator[pytest.Item]:
        yield SceneItem.from_parent(self, name="screwgauge")


class SceneItem(pytest.Item):
    """Test item of a scene, which must pass the gate."""

    def runtest(self) -> None:
        from screwgauge.api import check

        check(self.path).assert_ok()

    def repr_failure(self, excinfo: pytest.ExceptionInfo[BaseException], style: object = None) -> str:
        """Show what differs, and why, without a traceback of this package."""
        from screwgauge.reference.errors import log_text

        if excinfo.errisinstance(AssertionError):
            return log_text(str(excinfo.value))
        return str(super().repr_failure(excinfo))

    def reportinfo(self) -> tuple[Path, int, str]:
        from screwgauge.reference.errors import printable

        return self.path, 0, printable(f"scene {self.path.stem}")


@pytest.fixture
def screwgauge(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    """Return the package. In a test with this fixture, relative paths start from the folder of the test's file."""
    import screwgauge

    monkeypatch.chdir(request.path.parent)
    return screwgauge
