"""Runs the tests of this folder with each engine that ``--engine`` names."""

from __future__ import annotations

import pytest

from screwgauge.contract.fixtures import *  # noqa: F403 (pytest finds fixtures by name)
from screwgauge.pytest_plugin import contract_engines


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """Runs a test once with each engine."""
    if "engine_name" in metafunc.fixturenames:
        metafunc.parametrize("engine_name", contract_engines(metafunc.config), scope="session")
