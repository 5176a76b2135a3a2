"""Files of `tests/data`: descriptions, scenes and models of toy mechanisms, and what is written around them."""

from pathlib import Path

DATA = Path(__file__).parents[1] / "data"


def data(name: str) -> str:
    """Text of a data file."""
    return (DATA / name).read_text(encoding="utf-8")
