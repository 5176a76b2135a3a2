"""What `screwgauge.check` returns: rows that can be asserted, and shown as terminals, CI services and people read them."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from screwgauge.environment import json_text
from screwgauge.report.blocks import Banner, Block, Heading, Items, Table
from screwgauge.report.formatting import digits_text, number, size
from screwgauge.report.markdown import markdown
from screwgauge.report.terminal import terminal
from screwgauge.study.gate.row import EXIT, Row

SCHEMA = 1  #: Of the JSON.
WORDS = {"agree": "✓ ok", "differ": "✗ differ", "failed": "✗ failed", "refused": "✗ refused"}


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Check:
    """What a gate found.

    Attributes:
        rows: One for each scene or pair of models.
        notes: Sentences on what was checked.
    """

    rows: Sequence[Row]
    notes: Sequence[str] = ()

    @property
    def ok(self) -> bool:
        """Whether there is something, and all of it passes."""
        return self.exit_status == 0

    @property
    def exit_status(self) -> int:
        """0 all within tolerance; 1 something is not, or nothing was checked; 2 bad input; 3 something failed."""
        return max((EXIT[row.status] for row in self.rows), default=1)

    def assert_ok(self) -> None:
        """Raises:
        AssertionError: Something does not pass; the message says what, where, when, by how much and why.
        """
        if not self.ok:
            raise AssertionError("\n".join(message(row) for row in self.rows if not row.ok) or "nothing was checked")

    def blocks(self) -> list[Block]:
        """What commands print and the job summary shows."""
        lines = []
        for row in self.rows:
            worst = row.worst
            cells = ("",) * 4
            if worst is not None:
                cells = (f"{worst.quantity}", size(worst.error), digits_text(worst.error), number(worst.tolerance, 2))
            lines.append((row.scene, WORDS[row.status], *cells))
        bad = [row for row in self.rows if not row.ok]
        said = f"{len(self.rows) - len(bad)} of {len(self.rows)} pass"
        banner = Banner(f"{said}.", "✗ FAILED" if bad else "✓ OK", "differ" if bad else "agree")
        table = Table(("scene", "status", "worst quantity", "scaled", "digits", "tolerance"), tuple(lines))
        return [banner, table, *([Items(tuple(map(message, bad)))] if bad else [])]

    def __repr__(self) -> str:
        return terminal(self.blocks())

    def markdown(self) -> str:
        """A job summary."""
        return markdown([Heading("Screwgauge", 2), *self.blocks()])

    @property
    def json(self) -> str:
        """All of it."""
        return json_text({"schema": SCHEMA, "ok": self.ok, "rows": [asdict(row) for row in self.rows]}, escaped=True)

    def junit(self) -> str:
        """JUnit XML: a test case for each row."""
        suite = ET.Element("testsuite", name="screwgauge", tests=str(len(self.rows)))
        return ET.tostring(suite, encoding="unicode")


def message(row: Row) -> str:
    """What was found of a row, in a sentence or two."""
    return f"{row.scene}: {row.sentence}"


def check(
    *what: str | Path,
    smoke: bool = False,
    tolerances: str | Path | Mapping[str, float] | None = None,
    baseline: str | Path | None = None,
    **more: Any,
) -> Check:
    """Compares engines on scenes, or pairs of model files, with tolerances.

    Args:
        what: Built-in scenes, files, folders of TOML; two model files are a pair. All built-in scenes by default.
        smoke: A few samples of an exciting motion in place of a scene's own.
        tolerances: Quantity -> scaled error that is admitted, or a TOML file of them; scenes' own come first.
        baseline: File of errors of a known state, which must not have grown.
    """
    raise NotImplementedError
