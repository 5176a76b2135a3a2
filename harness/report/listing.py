"""What `screwgauge list` shows."""

from __future__ import annotations

from collections.abc import Callable
from importlib.util import find_spec

from screwgauge.engines.registry import ENGINES, MEANINGS
from screwgauge.models.catalog import load_mechanism, mechanism_names
from screwgauge.quantities import QUANTITIES
from screwgauge.scene.scene import load_scene, scene_names
from screwgauge.study.stress.registry import CASES
from screwgauge.study.stress.registry import load as load_case

_PACKAGES = {"pinocchio": "pinocchio", "mujoco": "mujoco", "truth": "flint"}


def listing(what: str | None) -> str:
    """Names with a line on each: ``mechanisms``, ``scenes``, ``engines``, ``quantities``, ``cases``, or all of them."""
    tables: dict[str, Callable[[], list[tuple[str, str]]]] = {
        "mechanisms": lambda: [(name, load_mechanism(name).title) for name in mechanism_names()],
        "scenes": lambda: [(name, load_scene(name).title) for name in scene_names()],
        "engines": lambda: [(name, _engine(name)) for name in ENGINES],
        "quantities": lambda: [(name, quantity.meaning) for name, quantity in QUANTITIES.items()],
        "cases": lambda: [(name, f"{case.title} ({case.span})") for name in CASES for case in [load_case(name)]],
    }
    if what:
        return _table(tables[what]())
    return "\n\n".join(f"{name}\n{_table(rows())}" for name, rows in tables.items())


def _engine(name: str) -> str:
    package = _PACKAGES.get(name.split("-")[0])
    missing = package is not None and find_spec(package) is None
    return MEANINGS.get(name, "") + (" (not installed)" if missing else "")


def _table(rows: list[tuple[str, str]]) -> str:
    width = max(len(name) for name, _ in rows)
    return "\n".join(f"{name:<{width}}  {meaning}" for name, meaning in rows)
