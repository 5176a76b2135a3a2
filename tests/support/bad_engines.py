"""Engines of another package that crash, or eat all memory, when they are asked."""

from functools import partial
from pathlib import Path

from screwgauge.engines.registry import GROUP, Engine
from screwgauge.problem import GivenMotion
from support.bad_works import hog, load, segfault

NAMES = ("segfault", "hog")
load_segfault, load_hog = (partial(load, work=work) for work in (segfault, hog))
SEGFAULT, HOG = (
    Engine(name, name, f"{__name__}:load_{name}", frozenset((GivenMotion,)), "screwgauge") for name in NAMES
)


def install(folder: Path) -> None:
    """What pip leaves of such a package, for every process that has the folder on its path."""
    said = folder / "bad_engines-1.dist-info"
    said.mkdir()
    (said / "METADATA").write_text("Metadata-Version: 2.1\nName: bad_engines\nVersion: 1\n", encoding="utf-8")
    entries = "\n".join(f"{name} = {__name__}:{name.upper()}" for name in NAMES)
    (said / "entry_points.txt").write_text(f"[{GROUP}]\n{entries}\n", encoding="utf-8")
