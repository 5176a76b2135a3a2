"""Kinds of reports, each with a text template in ``texts/``, functions that fill it, data files, and pictures."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cache, reduce
from pathlib import Path
from typing import Any

from screwgauge.environment import environment
from screwgauge.reference.errors import ReportError
from screwgauge.report.blocks import (
    LONG,
    Banner,
    Block,
    Group,
    Items,
    Marked,
    Picture,
    Table,
    Text,
    facts,
    map_leaves,
    table,
    without_lost_picture,
)
from screwgauge.report.figures.renderer import RENDERER, losses
from screwgauge.report.text import markdown
from screwgauge.report.write import write_report

TEXTS = Path(__file__).with_name("texts")
RECORD, TERMINAL = "environment.json", "On a terminal"
MACHINE = ("screwgauge", "pin", "mujoco", "python", "platform", "cpu", "commit")  # of the record, on the first screen
Value = Callable[[Any], Any]


def folds(results: Any, pictures: Sequence[Picture]) -> list[Block]:
    """Fold each picture under its title."""
    return [Group("folded", (picture,), picture.title) for picture in pictures]


@dataclass(frozen=True, slots=True, kw_only=True)
class Report:
    """Kind of report.

    Level-1 headings in its text start sections; the text before them fills the first screen, and folded sections
    follow ``# Appendix``. A section whose heading ends with ``?`` is omitted if all its placeholders are empty. A line
    ``{name}`` is replaced with the value of that name: a string, list, facts, or blocks. ``{name: columns; else}`` is a
    table of rows, see `table`, or the text ``else`` if there are no rows; ``{name+ lines: columns}`` shows `LONG` rows
    and folds the rest, even on paper. A paragraph or an item that begins with ``{?name}`` is shown only if the value is
    true, with ``{!name}`` only if it is false. Names in paragraphs and items are replaced, too. ``{# Title}`` is
    replaced with the text of the section with that title.

    Attributes:
        text: Name of the file in ``texts/``, or path of a different file, without ``.md``.
        banner: Function that returns the verdict in a sentence, then warnings.
        data: File name -> function that returns the content. A record of the computer is added: the record in the
            results, or else a record of the current computer.
        values: Name -> function that computes the value when a text needs it. Names that are missing here are
            attributes of the results (``a.b``: attribute b of a, empty if a is None). All texts can use ``title``,
            ``verdict`` (the banners), ``environment``, ``about`` (facts for the first screen, including the computer),
            ``plots`` and ``picture remarks`` (about the last picture of `lead`).
        draw: Function that returns the pictures.
        lead: Function that selects the pictures of the first screen.
        plots: Function that shows all other pictures.
        figures: Significant digits of numbers in CSV; exact by default.
    """

    text: str
    banner: Callable[[Any], Banner | Sequence[Banner]]
    data: Mapping[str, Value]
    values: Mapping[str, Value]
    draw: Callable[[Any], Sequence[Picture]] = lambda results: ()
    lead: Callable[[Any, Sequence[Picture]], Sequence[Picture]] = lambda results, pictures: pictures[:1]
    plots: Callable[[Any, Sequence[Picture]], list[Block]] = folds
    figures: int | None = None

    @property
    def DATA(self) -> tuple[str, ...]:
        """Names of the data files."""
        return (*self.data, RECORD)

    @property
    def NAME(self) -> str:
        """Name of the file with the first table."""
        return next(iter(self.data))

    def write(
        self,
        results: Any,
        out: Path,
        *,
        more: Mapping[str, Any] | None = None,
        pdf: bool = False,
        safe: Callable[[], None] = lambda: None,
        force: bool = False,
    ) -> Path:
        """Write the data, the pages and the pictures.

        Args:
            more: Name -> content of further files.
            safe: Called when the data are on disk, before anything is drawn.
            force: Replace existing files, whatever their origin.

        Raises:
            ReportError: The data were written, but the pages or some pictures were not.
        """
        with suppress(OSError):
            RENDERER.start()  # the data are written while it starts
        record = getattr(results, "environment", None) or environment()
        data = {**{name: make(results) for name, make in self.data.items()}, RECORD: record, **(more or {})}

        def tell() -> list[Block]:
            return self.blocks(results, self.draw(results), record)

        with losses() as lost:
            write_report(out, tell, data, self.figures, pdf=pdf, safe=safe, force=force)
        if lost:
            what = f"{len(lost)} of the report's pictures could not be drawn: {lost[0]}"
            raise ReportError(what, str(out), "use the rest of the report, which contains all numbers")
        return out

    def blocks(
        self, results: Any, pictures: Iterable[Picture] = (), record: Mapping[str, Any] | None = None
    ) -> list[Block]:
        """Return the blocks of ``report.md`` and ``report.html``."""
        drawn = [*pictures]
        lead = self.lead(results, drawn)
        first, others = lead[-1] if lead else None, [each for each in drawn if each not in lead]
        filled = _Filled(self, results, record or getattr(results, "environment", {}), first, others)
        front, sections, appendix = _parts(self.text)
        screen = [*filled["verdict"], *filled.section("", front), *lead]
        blocks: list[Block] = [Text(filled["title"], 1), Group("front", tuple(screen))]
        blocks += (block for title, text in sections if title != TERMINAL for block in filled.section(title, text))
        last = [block for title, text in appendix for block in filled.section(title, text)]
        words = _used_entries(markdown([*blocks, *last]))
        last += [Text("Glossary", 2), Group("glossary", (Table(("", ""), words),))] if words else []
        return map_leaves([*blocks, Group("appendix", tuple(last))], without_lost_picture)

    def terminal(self, results: Any) -> list[Block]:
        """Return the blocks of the section "On a terminal"."""
        filled, (_, sections, _) = _Filled(self, results, {}), _parts(self.text)
        return [block for title, text in sections if title == TERMINAL for block in filled.section("", text)]


Sections = list[tuple[str, str]]


@cache
def _parts(name: str) -> tuple[str, Sections, Sections]:
    """Split a template into its first screen, sections and appendix."""
    front, *rest = re.split(r"^# (.*)\n", (TEXTS / f"{name}.md").read_text(encoding="utf-8"), flags=re.MULTILINE)
    known = dict(zip(rest[::2], rest[1::2], strict=True))
    sections = [(title, re.sub(r"\{# (.*)\}", lambda x: known[x[1]].strip(), text)) for title, text in known.items()]
    at = [title for title, _ in sections].index("Appendix")
    return front, sections[:at], sections[at + 1 :]


class _Filled(dict[str, Any]):
    """Values for the text of one report, each computed when the text first uses it."""

    def __init__(
        self,
        report: Report,
        results: Any,
        record: Mapping[str, Any],
        first: Picture | None = None,
        others: Sequence[Picture] = (),
    ) -> None:
        self.report, self.results, self.record, self.first, self.others = report, results, record, first, others

    def __missing__(self, name: str) -> Any:
        self[name] = value = self._value(name)
        return value

    def _value(self, name: str) -> Any:
        values = self.report.values
        if name == "verdict":
            banners = self.report.banner(self.results)
            return [banners] if isinstance(banners, Banner) else banners
        if name == "plots":
            return self.report.plots(self.results, self.others)
        if name == "picture remarks":
            from screwgauge.report.stage.picture import remarks

            return remarks(self.first) if self.first and self.first.stage else []
        if name == "environment":
            return facts({**(values["files"](self.results) if "files" in values else {}), **self.record})
        if name == "about":
            known = {**self.record.get("packages", {}), **self.record}
            about = values["about"](self.results)
            return {**about, **{key: known[key] for key in MACHINE if key in known and key not in about}}
        if name in values:
            return values[name](self.results)
        path = name.replace(" ", "_").split(".")
        return reduce(lambda value, part: None if value is None else getattr(value, part), path, self.results)

    def section(self, title: str, text: str) -> list[Block]:
        """Return the heading and the blocks of a section; empty for optional sections without content."""
        shown, places, filled = list[Block](), 0, 0
        text = _WHEN.sub(lambda x: f"{x[1] or ''}{x[4]}\n" if bool(self[x[3]]) is (x[2] == "?") else "", text)
        for part in filter(None, re.split(r"\n{2,}", text.strip())):
            if part.startswith("{") and all(map(_PLACE.fullmatch, part.splitlines())):
                blocks = [block for line in part.splitlines() for block in self._place(line)]
                shown, places, filled = [*shown, *blocks], places + 1, filled + bool(blocks)
            else:
                shown += prose(part.format_map(self))
        if title.endswith("?") and places and not filled:
            return []
        return [*([Text(title.rstrip("?").format_map(self), 2)] if title else []), *shown]

    def _place(self, line: str) -> list[Block]:
        name, columns, empty = (text or "" for text in _PLACE.findall(line)[0])
        name, plus, noun = name.partition("+")
        value = self[name]
        if value is None or (not isinstance(value, Block) and not len(value)):
            return [Text(empty)] if empty else []
        if columns:
            value = table(value, columns)
        if plus:
            lines: Any = value.body if isinstance(value, Table) else tuple(value)
            parts = (lines[:LONG], lines[LONG:])
            short, rest = (Table(value.head, part) if isinstance(value, Table) else Items(part) for part in parts)
            return [short, Group("more", (rest,), f"{len(parts[1])} more{noun}")] if parts[1] else [short]
        if isinstance(value, str):
            return [Text(value)]
        if isinstance(value, Mapping):
            return [facts(value)]
        if isinstance(value, Block):
            return [value]
        return [Items(tuple(value))] if isinstance(value[0], str) else list(value)


_WHEN = re.compile(r"^(- )?\{([?!])([^}]*)\}\s*(.*(?:\n(?!\n|- ).*)*)\n?", re.MULTILINE)
_PLACE = re.compile(r"\{([^:;{}]+)(?:: ((?:[^;{}]|\{[^}]*\})+))?(?:; (.*))?\}")


def prose(text: str) -> list[Block]:
    """Split a string at empty lines into paragraphs and lists (``- ``)."""
    blocks: list[Block] = []
    for part in filter(None, text.strip().split("\n\n")):
        lead, *items = (" ".join(item.split()) for item in re.split(r"^- ", part, flags=re.MULTILINE))
        blocks += [Text(Marked(lead))] if lead else []
        blocks += [Items(tuple(map(Marked, items)))] if items else []
    return blocks


def _used_entries(text: str) -> tuple[tuple[str, str], ...]:
    """Return the glossary entries whose words a text uses."""
    return tuple((w, m) for w, m in _glossary().items() if re.search(rf"\b{re.escape(w)}\b", text, re.IGNORECASE))


@cache
def _glossary() -> dict[str, str]:
    """Read word -> meaning from ``texts/glossary.md``."""
    lines = " ".join((TEXTS / "glossary.md").read_text(encoding="utf-8").split()).split(" - **")[1:]
    return {word: Marked(meaning) for word, _, meaning in (line.partition("**: ") for line in lines)}
