"""What pip leaves of a package with engines."""

from collections.abc import Mapping
from pathlib import Path

from screwgauge.engines.registry import GROUP


def install(folder: Path, name: str, engines: Mapping[str, str]) -> None:
    """Install engines, name -> ``module:object``, for every process that has the folder on its path."""
    left = folder / f"{name.replace('-', '_')}-1.dist-info"
    left.mkdir()
    (left / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1\n", encoding="utf-8")
    entries = "".join(f"{engine} = {place}\n" for engine, place in engines.items())
    (left / "entry_points.txt").write_text(f"[{GROUP}]\n{entries}", encoding="utf-8")
