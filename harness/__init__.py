"""Screwgauge: do two descriptions of a mechanism's motion agree, by how much, and if not, why?

The names below are imported on first use, so that ``screwgauge --help`` stays quick and engines are only loaded when
they are needed.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from screwgauge.api import check, compile, diagnose, import_model, review, run
    from screwgauge.diagnosis.answer import Diagnosis
    from screwgauge.families.draw import random
    from screwgauge.reference.errors import ScrewgaugeError
    from screwgauge.report.diagnosed import DiagnosisReport
    from screwgauge.report.figures.saved import Figure
    from screwgauge.report.pages.check import CheckReport
    from screwgauge.report.results import Figures, Results
    from screwgauge.report.reviewed import ReviewReport
    from screwgauge.scene.default import exciting
    from screwgauge.scene.observables import Recorded
    from screwgauge.scene.read import load_scene
    from screwgauge.scene.scene import Scene
    from screwgauge.study.gate.check import Check
    from screwgauge.study.isolation import Limits
    from screwgauge.study.stream import stream

__all__ = [
    "Check",
    "CheckReport",
    "Diagnosis",
    "DiagnosisReport",
    "Figure",
    "Figures",
    "Limits",
    "Recorded",
    "Results",
    "ReviewReport",
    "Scene",
    "ScrewgaugeError",
    "check",
    "compile",
    "diagnose",
    "exciting",
    "import_model",
    "load_scene",
    "random",
    "review",
    "run",
    "stream",
]

_HOMES = {
    "Check": "screwgauge.study.gate.check",
    "CheckReport": "screwgauge.report.pages.check",
    "Diagnosis": "screwgauge.diagnosis.answer",
    "DiagnosisReport": "screwgauge.report.diagnosed",
    "Figure": "screwgauge.report.figures.saved",
    "Figures": "screwgauge.report.results",
    "Limits": "screwgauge.study.isolation",
    "Recorded": "screwgauge.scene.observables",
    "Results": "screwgauge.report.results",
    "ReviewReport": "screwgauge.report.reviewed",
    "Scene": "screwgauge.scene.scene",
    "ScrewgaugeError": "screwgauge.reference.errors",
    "check": "screwgauge.api",
    "compile": "screwgauge.api",
    "diagnose": "screwgauge.api",
    "exciting": "screwgauge.scene.default",
    "import_model": "screwgauge.api",
    "load_scene": "screwgauge.scene.read",
    "random": "screwgauge.families.draw",
    "review": "screwgauge.api",
    "run": "screwgauge.api",
    "stream": "screwgauge.study.stream",
}

__version__: str


def __getattr__(name: str) -> Any:
    if name == "__version__":
        globals()[name] = _version()
        return globals()[name]
    if name in _HOMES:
        return getattr(import_module(_HOMES[name]), name)
    raise AttributeError(f"module 'screwgauge' has no attribute {name!r}")


def _version() -> str:
    """Return the installed version; the lookup takes as long as the rest of the import."""
    from importlib.metadata import PackageNotFoundError, version

    try:
        return version("screwgauge")
    except PackageNotFoundError:  # a source tree that was never installed
        return "0+unknown"


def __dir__() -> list[str]:
    return sorted({*__all__, "__version__", *(name for name in globals() if name.startswith("__"))})
