"""Models of others: those of packages that are installed, and all in the folders of ``--models``.

``pip install --no-deps $(python tests/campaigns/public.py)`` installs the packages.
"""

import tomllib
from collections.abc import Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path

from screwgauge.models.importing import is_model
from screwgauge.report.blocks import LONG, Block, Group, Text, table
from screwgauge.study.formatting import Row, group_rows

#: Package -> its version, its folder of models, their files, and those besides of which the base floats.
PACKAGES = tomllib.loads(Path(__file__).with_name("public.toml").read_text(encoding="utf-8"))
#: Models that campaigns change or compare.
ROBOTS = tomllib.loads(Path(__file__).with_name("robots.toml").read_text(encoding="utf-8"))
#: Pairs of files of one robot, and the fact that leads.
PAIRS = PACKAGES.pop("pair")


@dataclass(frozen=True, slots=True)
class Public:
    """A model file of others.

    Attributes:
        name: Its path in there, without the ending.
        source: Package, or folder, that it is from.
        version: Of the package that is installed.
        path: Of the file in the package or folder.
        floating: Its base moves freely, which a URDF does not say.
    """

    file: Path
    name: str
    source: str
    version: str = ""
    path: str = ""
    floating: bool = False


def public_models(folders: Iterable[Path], count: int | None = None) -> list[Public]:
    models = [
        Public(path, _label(name := path.relative_to(folder)), folder.name, path=name.as_posix())
        for folder in folders
        for path in sorted(folder.rglob("*"))
        if is_model(path)
    ]
    for package in PACKAGES:
        with suppress(PackageNotFoundError):
            models += packaged(package)
    return models[:count]


def packaged(package: str) -> Iterator[Public]:
    """Models of a package.

    Raises:
        PackageNotFoundError: It is not installed.
    """
    listed, version = PACKAGES[package], distribution(package).version
    floating = listed.get("floating", ())
    for name in (*listed["files"], *floating):
        path = f"{listed['folder']}/{name}"
        yield Public(installed(package, name), _label(name), package, version, path, name in floating)


def installed(package: str, name: str) -> Path:
    """Where a package has a model.

    Raises:
        PackageNotFoundError: It is not installed.
    """
    return Path(str(distribution(package).locate_file(f"{PACKAGES[package]['folder']}/{name}")))


def _label(path: Path | str) -> str:
    return Path(path).with_suffix("").as_posix()


def by_source(rows: Iterable[Row], columns: str) -> list[Block]:
    blocks: list[Block] = []
    for (source,), some in group_rows(rows, "source").items():
        every = table(some, columns)
        blocks += [Text(str(source), 2), Group("folded", (every,), f"All {len(some)} models") if some[LONG:] else every]
    return blocks


if __name__ == "__main__":
    print(*(f"{package}=={listed['version']}" for package, listed in PACKAGES.items()))
