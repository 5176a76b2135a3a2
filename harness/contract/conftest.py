"""Runs the tests of this folder for each engine named by ``--engine``."""

from __future__ import annotations

import pytest

from screwgauge.contract.fixtures import *  # noqa: F403 (pytest finds fixtures by name)
from screwgauge.pytest_plugin import contract_engines


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """Parametrise tests by engine."""
    if "engine_name" in metafunc.fixturenames:
        metafunc.parametrize("engine_name", contract_engines(metafunc.config), scope="session")
