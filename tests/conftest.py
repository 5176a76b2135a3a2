"""Fixtures shared by all tests."""

from __future__ import annotations

from pathlib import Path

import pytest

from screwgauge.models.catalog import load_mechanism
from screwgauge.reference.mechanism import Mechanism


@pytest.fixture(scope="session")
def paper() -> Mechanism:
    """The 3-UPS-UPU-S of the paper."""
    return load_mechanism("3ups-upu-s")


@pytest.fixture
def write(tmp_path: Path):
    """Writes a text file into the test's own folder and returns its path."""

    def write_text(name: str, text: str) -> Path:
        path = tmp_path / name
        path.write_text(text, encoding="utf-8")
        return path

    return write_text
