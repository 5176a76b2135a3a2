"""Models of others: those of the packages of the extra ``study``, and all in the folders of ``--models``."""

from __future__ import annotations

import tomllib
from collections.abc import Iterable
from dataclasses import dataclass
from importlib.metadata import distribution
from pathlib import Path

from screwgauge.models.importing import is_model
from screwgauge.report.blocks import LONG, Block, Folded, Heading, table
from screwgauge.study.formatting import Row, grouped

#: Package -> its folder of models, their files, and which of them float, as a URDF cannot say.
PACKAGES = tomllib.loads(Path(__file__).with_name("public.toml").read_text(encoding="utf-8"))
#: Pairs of files of one robot, and the fact that leads.
PAIRS = PACKAGES.pop("pair")


@dataclass(frozen=True, slots=True)
class Public:
    """A model file of others.

    Attributes:
        name: Its path in there, without the ending.
        source: Package, or folder, that it is from.
        floating: Its base moves freely, which a URDF does not say.
    """

    file: Path
    name: str
    source: str
    floating: bool = False


def public_models(folders: Iterable[Path], count: int | None = None) -> list[Public]:
    """Models in some folders, then those of packages; the first `count` of them."""
    models = [
        Public(path, _label(path.relative_to(folder)), folder.name)
        for folder in folders
        for path in sorted(folder.rglob("*"))
        if is_model(path)
    ]
    for package, listed in PACKAGES.items():
        floating = listed.get("floating", ())
        models += [
            Public(installed(package, name), _label(name), package, name in floating) for name in listed["files"]
        ]
    return models[:count]


def installed(package: str, name: str) -> Path:
    """Where a package has a model.

    Raises:
        PackageNotFoundError: It is not installed.
    """
    return Path(str(distribution(package).locate_file(f"{PACKAGES[package]['folder']}/{name}")))


def _label(path: Path | str) -> str:
    return Path(path).with_suffix("").as_posix()


def by_source(rows: Iterable[Row], columns: str) -> list[Block]:
    """A heading and a table for each package or folder that models are from."""
    blocks: list[Block] = []
    for (source,), some in grouped(rows, "source").items():
        every = table(some, columns)
        blocks += [Heading(str(source)), Folded(f"All {len(some)} models", (every,)) if some[LONG:] else every]
    return blocks
