"""Blocks of a report, which three renderers turn into files. Text is literal unless `Marked`."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, fields, replace
from itertools import compress
from operator import attrgetter
from typing import Any, Literal, TypeVar

import numpy as np

from screwgauge.reference.errors import printable
from screwgauge.study.formatting import FORMS, missing, number, words

T = TypeVar("T")
Status = Literal["agree", "differ", "failed", "note"]
LONG = 12  # rows of a table that are shown; the others may be folded
_STARS = r"(?<![\w*]){0}([^\s*](?:[^*]*[^\s*])?){0}(?![\w*])"
_MARKUP = re.compile("|".join((r"`([^`]+)`", _STARS.format(r"\*\*"), _STARS.format(r"\*"))))
_VALUE = r"-?(\d+(\.\d+)?(e-?\d+)?|NaN|inf)"
_NUMBER = re.compile(rf"-|({_VALUE}( to {_VALUE})?( [^\d ]+){{0,2}})?|refused|no number|cut short")


class Marked(str):
    """Text of this package with **bold**, *emphasis* and `code`; never text from files, engines or users."""

    __slots__ = ()


@dataclass(frozen=True, slots=True)
class Heading:
    """A heading; level 1 is the title of the report."""

    text: str
    level: int = 2


@dataclass(frozen=True, slots=True)
class Paragraph:
    """Running text; line breaks in it are ignored."""

    text: str


@dataclass(frozen=True, slots=True)
class Banner:
    """A sentence set apart, a result or a warning; `status` sets its colour, `word` repeats that in text."""

    text: str
    word: str = ""
    status: Status = "note"

    @staticmethod
    def of(text: str, good: bool, yes: str = "AGREE", no: str = "NOT ALL AGREE") -> Banner:
        """Build the banner of a positive or negative result."""
        return Banner(text, f"✓ {yes}", "agree") if good else Banner(text, f"✗ {no}", "differ")


@dataclass(frozen=True, slots=True)
class Items:
    """List of items."""

    texts: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Table:
    """Cells as text, row by row; a table without a head holds names and values."""

    head: tuple[str, ...]
    body: tuple[tuple[str, ...], ...]

    @property
    def right(self) -> frozenset[int]:
        """Columns of numbers, which are right-aligned."""
        columns = enumerate(zip(*self.body, strict=True) if any(self.head) else ())
        return frozenset(i for i, cells in columns if all(map(_NUMBER.fullmatch, cells)) and any(cells))


@dataclass(frozen=True, slots=True)
class Picture:
    """Finished picture, with an interactive version for pages with scripts.

    Attributes:
        name: File name without ending.
        chart: Interactive chart, as JSON of Vega-Lite; empty if there is none.
        stage: Interactive drawing in space, as JSON for ``stage.js``; empty if there is none.
        lost: Reason why it could not be drawn; empty if it was.
        of: Quantity that the picture shows; empty if it shows something else.
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
class Folded:
    """Blocks folded under a title with a short note; `printed` opens them in print."""

    title: str
    blocks: tuple[Block, ...]
    note: str = ""
    printed: bool = True


@dataclass(frozen=True, slots=True)
class Front:
    """First screen: blocks beside a picture, or below two pictures."""

    blocks: tuple[Block, ...]


@dataclass(frozen=True, slots=True)
class Appendix:
    """Details at the end: sections folded on a screen and expanded in print."""

    blocks: tuple[Block, ...]


@dataclass(frozen=True, slots=True)
class Glossary:
    """Words with their meaning; the first use of a word on a page links here."""

    entries: tuple[tuple[str, str], ...]


Block = Heading | Paragraph | Banner | Items | Table | Picture | Folded | Front | Appendix | Glossary


def as_kind(kind: type[T], record: Any) -> T:
    """Convert a record to another class with the same fields."""
    return kind(**{item.name: getattr(record, item.name) for item in fields(record)})


def walk(blocks: Iterable[Block]) -> Iterator[Block]:
    """Iterate over all blocks, parents before children."""
    for block in blocks:
        yield block
        if isinstance(block, (Folded, Front, Appendix)):
            yield from walk(block.blocks)


def changed(blocks: Iterable[Block], change: Callable[[Block], Block]) -> list[Block]:
    """Apply a change to each leaf block."""
    return [
        replace(block, blocks=tuple(changed(block.blocks, change)))
        if isinstance(block, (Folded, Front, Appendix))
        else change(block)
        for block in blocks
    ]


def or_reason(block: Block) -> Block:
    """Replace a picture that could not be drawn by the reason."""
    if isinstance(block, Picture) and block.lost:
        return Paragraph(f"Not drawn: {block.title} ({block.lost}).")
    return block


def table(rows: Iterable[Any], columns: str) -> Table:
    """Build a table with a row for each mapping or object.

    Args:
        columns: ``head = key | head = key``; where there is no key, it is the head with ``_`` for spaces. The key says
            how values read, see `FORMS`; with a ``?``, a cell is empty where the row has no number; with two, the whole
            column is left out if it is empty. ``key:form`` has another form, and a key with ``{}`` in it is filled in
            by the row. After ``||`` comes ``across = cell``: lines with the same cells are one, with a column more for
            each value of `across`.
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
    if value is None or (key.endswith("?") and missing(value)):
        return ""
    return value if isinstance(value, Marked) else FORMS.get(form or name, str)(value)


def facts(mapping: Mapping[str, Any]) -> Block:
    """Build a table of names and values: a line for each value of a list or mapping, none for an empty text."""
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
    return Table(("", ""), tuple(body)) if body else Paragraph("Not recorded.")


def _value_text(value: Any) -> str:
    if isinstance(value, (bool, np.bool_)):
        return "yes" if value else "no"
    return number(value) if isinstance(value, float) else str(value)


def spans(text: str) -> Iterator[tuple[str, str]]:
    """Split a `printable` text into pieces with their HTML elements; empty for plain pieces."""
    shown, end = printable(str(text)), 0
    for match in _MARKUP.finditer(shown) if isinstance(text, Marked) else ():
        yield "", shown[end : match.start()]
        yield ("code", "strong", "em")[(match.lastindex or 1) - 1], match.group(match.lastindex or 1)
        end = match.end()
    yield "", shown[end:]


def plain(text: str) -> str:
    """Remove the marks of a text."""
    return "".join(piece for _, piece in spans(text))
