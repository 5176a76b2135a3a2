"""What reports are made of. Texts may hold **bold**, *emphasis* and `code`; three renderers make files of them."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from operator import attrgetter
from typing import TYPE_CHECKING, Any, Literal

if TYPE_CHECKING:
    from screwgauge.report.plots import Plot

Status = Literal["agree", "differ", "failed", "note"]
LONG = 12  # rows from which a table is folded
_MARKUP = re.compile(r"`([^`]+)`|\*\*(\S(?:.*?\S)?)\*\*|\*(\S(?:.*?\S)?)\*")


@dataclass(frozen=True, slots=True)
class Heading:
    """A heading; level 1 is the title of the report."""

    text: str
    level: int = 2


@dataclass(frozen=True, slots=True)
class Paragraph:
    """Running text; line breaks in it mean nothing."""

    text: str


@dataclass(frozen=True, slots=True)
class Banner:
    """A sentence set apart: what was found, or a warning. `status` decides its colour, `word` says the same."""

    text: str
    word: str = ""
    status: Status = "note"


@dataclass(frozen=True, slots=True)
class Items:
    """A list."""

    texts: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Table:
    """Cells as text, line by line; `right` are the columns of numbers. Without any head it has names and values."""

    head: tuple[str, ...]
    body: tuple[tuple[str, ...], ...]
    right: frozenset[int] = frozenset()


@dataclass(frozen=True, slots=True)
class Picture:
    """Where a plot stands."""

    plot: Plot


@dataclass(frozen=True, slots=True)
class Folded:
    """Blocks behind their title."""

    title: str
    blocks: tuple[Block, ...]


Block = Heading | Paragraph | Banner | Items | Table | Picture | Folded


@dataclass(frozen=True, slots=True)
class Column:
    """One column of a table.

    Attributes:
        value: Key of a mapping, path of attributes (``contestant.name``) or function of a row.
        form: How the value reads.
        right: Whether it holds numbers.
    """

    head: str
    value: str | Callable[[Any], Any]
    form: Callable[[Any], str] = str
    right: bool = False

    def cell(self, row: Any) -> str:
        """The text of one row."""
        if not isinstance(self.value, str):
            return self.form(self.value(row))
        return self.form(row[self.value] if isinstance(row, Mapping) else attrgetter(self.value)(row))


Numbers = partial(Column, right=True)


def section(title: str, *blocks: Block) -> tuple[Block, ...]:
    """Blocks with their heading."""
    return Heading(title), *blocks


def table(rows: Iterable[Any], columns: Sequence[Column]) -> Table:
    """One line for each row."""
    body = tuple(tuple(column.cell(row) for column in columns) for row in rows)
    right = frozenset(i for i, column in enumerate(columns) if column.right)
    return Table(tuple(column.head for column in columns), body, right)


def cross_table(
    rows: Sequence[Any],
    columns: Sequence[Column],
    across: str | Callable[[Any], str],
    cell: Callable[[Any], str],
    names: Iterable[str] = (),
) -> Table:
    """One line for each distinct text of the columns, with one cell more for each value of `across`.

    Args:
        names: Values of `across` in the order wanted; that of the rows by default.
    """
    top, lines = Column("", across), dict[tuple[str, ...], dict[str, str]]()
    for row in rows:
        lines.setdefault(tuple(column.cell(row) for column in columns), {})[top.cell(row)] = cell(row)
    names = tuple(names) or tuple(dict.fromkeys(map(top.cell, rows)))
    body = tuple((*line, *(cells.get(name, "") for name in names)) for line, cells in lines.items())
    head = (*(column.head for column in columns), *names)
    texts = frozenset(i for i, column in enumerate(columns) if not column.right)
    return Table(head, body, frozenset(range(len(head))) - texts)


def pairs(values: Iterable[Sequence[str]]) -> Table:
    """Names and values, without a head."""
    return Table(("", ""), tuple((name, value) for name, value in values))


def folded(title: str, long: Table) -> Block:
    """A table, behind its title if it is long."""
    return Folded(title, (long,)) if len(long.body) > LONG else long


def prose(text: str) -> list[Block]:
    """Paragraphs and lists (``- ``) of a text with empty lines between them."""
    blocks: list[Block] = []
    for part in text.strip().split("\n\n"):
        items = re.split(r"^- ", part, flags=re.MULTILINE)
        lead, *rest = (" ".join(item.split()) for item in items)
        blocks += [*([Paragraph(lead)] if lead else []), *([Items(tuple(rest))] if rest else [])]
    return blocks


def spans(text: str) -> Iterator[tuple[str, str]]:
    """Pieces of a text with the name of the HTML element each belongs in; empty for plain ones."""
    end = 0
    for match in _MARKUP.finditer(text):
        yield "", text[end : match.start()]
        yield ("code", "strong", "em")[(match.lastindex or 1) - 1], match.group(match.lastindex or 1)
        end = match.end()
    yield "", text[end:]


def plots(blocks: Iterable[Block]) -> Iterator[Plot]:
    """All plots in their order."""
    for block in blocks:
        if isinstance(block, Picture):
            yield block.plot
        elif isinstance(block, Folded):
            yield from plots(block.blocks)
