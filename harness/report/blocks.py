"""Blocks of a report, which three renderers turn into files. Strings are shown literally unless they are `Marked`."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, fields, replace
from itertools import compress
from operator import attrgetter
from typing import Any, Literal, TypeVar

import numpy as np

from screwgauge.reference.errors import printable
from screwgauge.study.formatting import FORMS, is_empty, number, words

T = TypeVar("T")
Status = Literal["agree", "differ", "failed", "note"]
LONG = 12  # number of table rows that are shown; the rest may be folded
_STARS = r"(?<![\w*]){0}([^\s*](?:[^*]*[^\s*])?){0}(?![\w*])"
_MARKUP = re.compile("|".join((r"`([^`]+)`", _STARS.format(r"\*\*"), _STARS.format(r"\*"))))
_VALUE = r"-?(\d+(\.\d+)?(e-?\d+)?|NaN|inf)"
_NUMBER = re.compile(rf"-|({_VALUE}( to {_VALUE})?( [^\d ]+){{0,2}})?|refused|no number|cut short")


class Marked(str):
    """A string of this package with **bold**, *emphasis* and `code`; strings from elsewhere are never marked."""

    __slots__ = ()


@dataclass(frozen=True, slots=True)
class Text:
    """Running text, or a heading (level 1 is the title of the report); line breaks in the text are ignored."""

    text: str
    level: int = 0


@dataclass(frozen=True, slots=True)
class Banner:
    """A highlighted result or warning; `status` sets the colour, and `word` states the status in words."""

    text: str
    word: str = ""
    status: Status = "note"

    @staticmethod
    def of(text: str, good: bool, yes: str = "AGREE", no: str = "NOT ALL AGREE") -> Banner:
        """Return the banner for a positive or negative result."""
        return Banner(text, f"✓ {yes}", "agree") if good else Banner(text, f"✗ {no}", "differ")


@dataclass(frozen=True, slots=True)
class Items:
    """List of items."""

    texts: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Table:
    """Table of strings, row by row; a table without a head contains names and values."""

    head: tuple[str, ...]
    body: tuple[tuple[str, ...], ...]

    @property
    def right(self) -> frozenset[int]:
        """Indices of the numeric columns, which are right-aligned."""
        columns = enumerate(zip(*self.body, strict=True) if any(self.head) else ())
        return frozenset(i for i, cells in columns if all(map(_NUMBER.fullmatch, cells)) and any(cells))


@dataclass(frozen=True, slots=True)
class Picture:
    """Finished picture, with an interactive version for pages with scripts.

    Attributes:
        name: File name without extension.
        chart: Interactive chart, as Vega-Lite JSON, or an empty string.
        stage: Interactive 3D drawing, as JSON for ``stage.js``, or an empty string.
        lost: Reason why the picture could not be drawn; empty if it was drawn.
        of: Quantity that the picture shows; empty if it does not show a quantity.
    """

    name: str
    title: str
    svg: str
    chart: str = ""
    stage: str = ""
    lost: str = ""
    of: str = ""

    def __post_init__(self) -> None:
        for part in ("svg", "chart", "stage"):
            object.__setattr__(self, part, printable(getattr(self, part), lines=True))


@dataclass(frozen=True, slots=True)
class Group:
    """Blocks that belong together.

    Attributes:
        kind: ``front``: the first screen, blocks beside one picture or below two pictures. ``appendix``: details at the
            end, each section folded on screen and expanded in print. ``folded``: folded under a title with a short
            note, and expanded in print. ``more``: also folded in print. ``glossary``: a table of words and their
            meanings; the first use of a word in each section links to it.
    """

    kind: Literal["front", "appendix", "folded", "more", "glossary"]
    blocks: tuple[Block, ...]
    title: str = ""
    note: str = ""


Block = Text | Banner | Items | Table | Picture | Group


def as_kind(kind: type[T], record: Any) -> T:
    """Convert a record to another class with the same fields."""
    return kind(**{item.name: getattr(record, item.name) for item in fields(record)})


def walk(blocks: Iterable[Block]) -> Iterator[Block]:
    """Yield all blocks, parents before children."""
    for block in blocks:
        yield block
        if isinstance(block, Group):
            yield from walk(block.blocks)


def map_leaves(blocks: Iterable[Block], change: Callable[[Block], Block]) -> list[Block]:
    """Apply a function to each block that is not a group, and rebuild the groups."""
    return [
        replace(block, blocks=tuple(map_leaves(block.blocks, change))) if isinstance(block, Group) else change(block)
        for block in blocks
    ]


def without_lost_picture(block: Block) -> Block:
    """Replace a picture that could not be drawn with a paragraph that states the reason."""
    if isinstance(block, Picture) and block.lost:
        return Text(f"Not drawn: {block.title} ({block.lost}).")
    return block


def table(rows: Iterable[Any], columns: str) -> Table:
    """Build a table with a row for each mapping or object.

    Args:
        columns: ``head = key | head = key``; a missing key defaults to the head, with ``_`` for spaces. The key
            determines the format of values, see `FORMS`. With a ``?``, a cell is empty if its row lacks a number; with
            ``??``, an empty column is omitted. ``key:form`` selects a different format, and a key that contains ``{}``
            is a template filled from the row. ``|| across = cell`` at the end merges rows with equal cells into one
            line, and adds a column for each value of `across`.
    """
    down, _, cross = columns.partition("||")
    shown, lines = _columns(down), [(row, tuple(_text(row, key) for key in _columns(down).values())) for row in rows]
    if not cross:
        kept = [not key.endswith("??") or any(x[i] for _, x in lines) for i, key in enumerate(shown.values())]
        head, *body = (tuple(compress(line, kept)) for line in (shown, *(x for _, x in lines)))
        return Table(head, tuple(body))
    across, cell = cross.strip().split(" = ")
    cells, names = dict[tuple[str, ...], dict[str, str]](), dict[str, None]()
    for row, line in lines:
        names[name := _text(row, across)] = None
        cells.setdefault(line, {})[name] = _text(row, cell)
    return Table((*shown, *names), tuple((*line, *(some.get(x, "") for x in names)) for line, some in cells.items()))


def _columns(columns: str) -> dict[str, str]:
    parts = (column.strip().rpartition("=") for column in columns.split("|"))
    return {
        (head if equal else key.partition(":")[0]).strip().rstrip("?"): key.strip()
        if "{" in key
        else key.strip().replace(" ", "_")
        for head, equal, key in parts
    }


def _text(row: Any, key: str) -> str:
    if "{" in key:
        return key.format_map(row)
    name, _, form = key.rstrip("?").partition(":")
    value = row.get(name) if isinstance(row, Mapping) else attrgetter(name)(row)
    if value is None or (key.endswith("?") and is_empty(value)):
        return ""
    return value if isinstance(value, Marked) else FORMS.get(form or name, str)(value)


def facts(mapping: Mapping[str, Any]) -> Block:
    """Build a table of names and values, with a line for each value of a list or mapping; empty strings are omitted."""
    body: list[tuple[str, str]] = []
    for key, value in mapping.items():
        name = words(key)
        if isinstance(value, Mapping) and all(isinstance(v, (bool, np.bool_)) for v in value.values()):
            sides = {_value_text(side): [k for k, v in value.items() if bool(v) is side] for side in (True, False)}
            body.append((name, "; ".join(f"{word}: {', '.join(keys)}" for word, keys in sides.items() if keys)))
        elif isinstance(value, Mapping):
            body += [(f"{name}: {k}", _value_text(v)) for k, v in value.items()]
        else:
            body += [(name, _value_text(v)) for v in (value if isinstance(value, list) else [value]) if v != ""]
    return Table(("", ""), tuple(body)) if body else Text("Not recorded.")


def _value_text(value: Any) -> str:
    if isinstance(value, (bool, np.bool_)):
        return "yes" if value else "no"
    return number(value) if isinstance(value, float) else str(value)


def spans(text: str) -> Iterator[tuple[str, str]]:
    """Split a `printable` string into pieces with their HTML elements; the element is empty for plain pieces."""
    shown, end = printable(str(text)), 0
    for match in _MARKUP.finditer(shown) if isinstance(text, Marked) else ():
        yield "", shown[end : match.start()]
        yield ("code", "strong", "em")[(match.lastindex or 1) - 1], match.group(match.lastindex or 1)
        end = match.end()
    yield "", shown[end:]


def plain(text: str) -> str:
    """Remove the markup of a string."""
    return "".join(piece for _, piece in spans(text))
