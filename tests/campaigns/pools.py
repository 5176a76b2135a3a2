"""Models that are changed: random trees, built-in mechanisms, and public robots where they are installed."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from dataclasses import dataclass, replace
from importlib.util import find_spec
from pathlib import Path

from support.robots import mjcf, tree, urdf

from screwgauge.models.catalog import load_mechanism
from screwgauge.models.mjcf import write_mjcf
from screwgauge.models.urdf import write_urdf

#: Path below a folder that Python packages are installed in; the packages are those of the extra ``study``.
PUBLIC = {
    name: f"cmeel.prefix/share/example-robot-data/robots/{path}"
    for name, path in {
        "panda": "panda_description/urdf/panda.urdf",
        "ur5": "ur_description/urdf/ur5_robot.urdf",
        "solo12": "solo_description/robots/solo12.urdf",
        "kinova": "kinova_description/robots/kinova.urdf",
        "anymal": "anymal_b_simple_description/robots/anymal.urdf",
        "tiago": "tiago_description/robots/tiago.urdf",
        "allegro": "allegro_hand_description/urdf/allegro_right_hand.urdf",
    }.items()
} | {
    "sawyer": "robosuite/models/assets/robots/sawyer/robot.xml",
    "panda-mjcf": "robosuite/models/assets/robots/panda/robot.xml",
}


@dataclass(frozen=True, slots=True)
class Pool:
    """A machine and the files that say it, the first of which is that of A.

    Attributes:
        files: Path and library that reads it, of each; all of them say the same. Libraries that are not installed are
            left out.
    """

    name: str
    files: tuple[tuple[Path, str], ...]
    public: bool = False


def pools(folder: Path, quick: bool = False) -> list[Pool]:
    """All that there are.

    Args:
        folder: Where those that are made here are written.
        quick: Fewer and small ones.
    """
    names = ("arm7",) if quick else ("arm7", "3ups-upu-s", "stewart")
    made = [*_trees(folder, 2 if quick else 4), *_built_in(folder, names)]
    found = made if quick else [*made, *public()]
    return [replace(pool, files=tuple(file for file in pool.files if find_spec(file[1]))) for pool in found]


def _trees(folder: Path, count: int) -> Iterator[Pool]:
    for seed in range(count):
        parts, name = tree(seed), f"tree{seed}"
        one, two, full = (folder / f"{name}{ending}" for ending in (".urdf", ".xml", "-full.xml"))
        one.write_text(urdf(parts), encoding="utf-8")
        two.write_text(mjcf(parts), encoding="utf-8")
        full.write_text(mjcf(parts, full=True), encoding="utf-8")
        yield Pool(name, ((one, "pinocchio"), (one, "yourdfpy"), (two, "mujoco")))
        yield Pool(f"{name}-full", ((full, "mujoco"),))


def _built_in(folder: Path, names: tuple[str, ...]) -> Iterator[Pool]:
    for name in names:
        mechanism = load_mechanism(name)
        one, two = folder / f"{name}.urdf", folder / f"{name}.xml"
        one.write_text(write_urdf(mechanism, "minimal"), encoding="utf-8")
        two.write_text(write_mjcf(mechanism, "minimal"), encoding="utf-8")
        yield Pool(name, ((one, "pinocchio"), (one, "yourdfpy")))
        yield Pool(f"{name}-mjcf", ((two, "mujoco"),))


def public() -> Iterator[Pool]:
    """Public robots that are installed."""
    for name, path in PUBLIC.items():
        found = [file for entry in sys.path if (file := Path(entry) / path).is_file()]
        if found:
            libraries = ("pinocchio", "yourdfpy") if path.endswith(".urdf") else ("mujoco",)
            yield Pool(name, tuple((found[0], library) for library in libraries), True)
