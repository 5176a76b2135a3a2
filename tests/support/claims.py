"""Tables of claims: texts, edits of them, and what has to be found."""

import re
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import pytest

from screwgauge import models

FOLDER = Path(__file__).parents[1] / "claims"


def table(name: str) -> dict[str, Any]:
    """A table of ``claims/``."""
    return tomllib.loads((FOLDER / f"{name}.toml").read_text(encoding="utf-8"))


def cases(rows: Sequence[Mapping[str, Any]], keys: set[str]) -> Iterator[Any]:
    """Parameters of a test, one for each case of each row: the row with what the case says.

    Args:
        keys: All that a row may say besides its name and its cases.
    """
    for row in rows:
        each = row.get("each", [{}])
        for i, case in enumerate(each, 1):
            merged = {key: value for key, value in {**row, **case}.items() if key != "each"}
            assert merged.keys() <= {"name", *keys}, f"{row['name']}: {merged.keys() - keys}"
            yield pytest.param(merged, id=row["name"] + f" {i}" * (len(each) > 1))


def text_of(name: str, texts: Mapping[str, str]) -> str:
    if name not in texts and len(name.splitlines()) == 1 and name.count("/") == 1 and not name.startswith("<"):
        return (Path(models.__file__).parent / name).read_text(encoding="utf-8")
    return texts.get(name, name)


def filled(text: str, parts: Mapping[str, str]) -> str:
    """A text with the parts that it names as ``{part}``; ``«text*n»`` is a text n times."""
    for _ in range(2):  # parts name parts
        text = re.sub(r"\{(\w+)\}", lambda match: parts.get(match[1], match[0]), text)
    return re.sub(r"«(.*?)\*(\d+)»", lambda match: match[1] * int(match[2]), text, flags=re.DOTALL)


def edited(text: str, edits: Sequence[Sequence[str]]) -> str:
    """A text with the first of each old text replaced by a new one; a new text without an old one goes to the end."""
    for old, new in edits:
        assert old in text, f"{old} is not in the text"
        text = text.replace(old, new, 1) if old else text + new
    return text


def written(row: Mapping[str, Any], texts: Mapping[str, str], folder: Path) -> Path:
    files = {name: text_of(text, texts) for name, text in row["files"].items()}
    first = next(iter(files))
    edits = row.get("edits", [[row["old"], row.get("new", "")]] if "old" in row else [])
    files[first] = edited(filled(row.get("text", files[first]), texts), edits)
    for name, text in files.items():
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).write_text(filled(text, texts), encoding="utf-8", newline="")
    return folder / first
