"""Results of a gate: rows for assertions in tests, and their export to formats that CI services read."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from screwgauge.environment import json_text
from screwgauge.models.importing import is_model
from screwgauge.reference.errors import DescriptionError, first_few, printable
from screwgauge.study.formatting import number, size, unit_text
from screwgauge.study.gate.baseline import Against, compare_baseline, read_baseline, write_baseline
from screwgauge.study.gate.items import GateRow, find_unread, items, read_tolerances
from screwgauge.study.gate.known_files import known_item
from screwgauge.study.gate.measure import GateSettings
from screwgauge.study.gate.run import check_items
from screwgauge.study.outcome import EXIT
from screwgauge.study.runner import Executor

SCHEMA = 1  #: Version of the JSON format.
ADMITTED = "Explicitly allowed"
#: Number of file names listed in a sentence.
SHOWN = 5
#: Exit status of a row -> element of JUnit.
_KINDS = {1: "failure", 2: "error", 3: "error"}


@dataclass(frozen=True, slots=True, eq=False)
class Check:
    """Result of a gate.

    Attributes:
        rows: One row for each scene or pair of models.
        smoke: True if only a few samples were checked.
        against: Comparison with a baseline; None without a baseline.
        unread: Descriptions, scenes and models in the named folders that were not read.
        date: Date of the check, ISO 8601 in UTC.
    """

    rows: Sequence[GateRow]
    smoke: bool = False
    against: Against | None = None
    unread: Sequence[str] = ()
    date: str = ""

    @property
    def ok(self) -> bool:
        """True if there are rows, all of them pass, and no digits were lost."""
        return self.exit_status == 0

    def __bool__(self) -> bool:
        """Return `ok`, so that ``assert check`` passes only if the check is ok."""
        return self.ok

    @property
    def exit_status(self) -> int:
        """Exit status: 0 all within tolerance; 1 out of tolerance, or digits were lost; 2 bad input; 3 a failure."""
        worst = max((EXIT[row.status] for row in self.rows), default=1)
        return worst or int(bool(self.against and self.against.worse))

    @property
    def faults(self) -> list[str]:
        """Sentences on rows that do not pass: scene, quantity, component, time, both values, tolerance and cause."""
        lost = [f"Regression: {each}." for each in self.against.worse] if self.against else []
        return [*(message(row) for row in self.rows if not row.ok), *lost]

    @property
    def left_alone(self) -> str:
        """Sentence that names the files in the folders that were not read; empty if all were read."""
        return f"Not read, because no scene names them: {first_few(self.unread, SHOWN)}." if self.unread else ""

    def assert_ok(self) -> None:
        """Raise an error unless the check is ok.

        Raises:
            AssertionError: A row does not pass, or there are no rows; the message says what failed, where, when, by how
                much and why.
        """
        __tracebackhide__ = True  # makes pytest show the calling line instead of this one
        if not self.ok:
            raise AssertionError("\n".join(self.faults) or "nothing was checked")

    def write_baseline(self, file: str | Path, *, force: bool = False) -> None:
        """Write this check as the new baseline.

        Args:
            file: File of the baseline; an existing baseline is replaced.
            force: Replace an existing file even if it is not a baseline.

        Raises:
            OutputError: A row has no numbers, or the file cannot be written; an existing file stays unchanged.
        """
        write_baseline(Path(file), self.rows, self.smoke, force=force)

    @property
    def record(self) -> dict[str, Any]:
        """The whole check, converted to plain data."""
        known = asdict(self.against) if self.against else None
        rows = [{**asdict(row), "ok": row.ok} for row in self.rows]
        for row in rows:  # `files` contains the given names; absolute paths are specific to this machine
            del row["read"]
        content = {"schema": SCHEMA, "ok": self.ok, "smoke": self.smoke, "rows": rows, "baseline": known}
        return {**content, "unread": [*self.unread]}

    @property
    def json(self) -> str:
        """The record, formatted as JSON."""
        return json_text(self.record, escaped=True)

    def junit(self) -> str:
        """Format JUnit XML: a test case for each row, and one for the baseline."""
        cases = [(row.scene, row.seconds, EXIT[row.status], message(row), row.admitted) for row in self.rows]
        if self.against is not None:
            lost = "; ".join(self.against.worse)
            cases.append((f"baseline {self.against.file}", 0.0, int(bool(lost)), lost, ()))
        kinds = Counter(_KINDS.get(status, "") for _, _, status, *_ in cases)
        suite = ET.Element("testsuite", name="screwgauge", tests=str(len(cases)))
        for name, kind in (("failures", "failure"), ("errors", "error")):
            suite.set(name, str(kinds[kind]))
        for name, seconds, status, reason, admitted in cases:
            case = ET.SubElement(suite, "testcase", classname="screwgauge", name=printable(name), time=f"{seconds:.3f}")
            if status in _KINDS:
                ET.SubElement(case, _KINDS[status], message=printable(reason))
            if admitted:
                ET.SubElement(case, "system-out").text = printable(f"{ADMITTED}: {', '.join(admitted)}")
        if self.unread:
            ET.SubElement(suite, "system-out").text = printable(self.left_alone)
        return ET.tostring(suite, encoding="unicode", xml_declaration=True) + "\n"

    def annotations(self) -> Iterator[str]:
        """Yield GitHub workflow commands that annotate lines of models and scenes."""
        for row in self.rows:
            marks = {} if row.ok else {"error": message(row)}
            if row.admitted:
                marks["warning"] = f"{row.scene}: {ADMITTED.lower()}: {', '.join(row.admitted)}"
            for kind, text in marks.items():
                place = _escape(row.file, "%\r\n:,")
                yield f"::{kind} file={place},line={max(row.line, 1)}::{_escape(printable(text), '%')}"


def _escape(text: str, signs: str) -> str:
    """Escape characters that have a special meaning for GitHub."""
    return "".join(f"%{ord(sign):02X}" if sign in signs else sign for sign in text)


def message(row: GateRow) -> str:
    """Describe the outcome of a row: the worst error with quantity, component, time, values, tolerance and cause."""
    worst, unread = row.worst, "".join(f" {text}." for text in row.unread)
    if worst is None or worst.ok:
        rest = "all else agrees" if row.status == "unread" else row.sentence
        return f"{row.scene}:{unread} {rest}" if unread else f"{row.scene}: {rest}"
    at = f" at {worst.component}" if worst.component else ""
    when = f", t = {number(worst.t)} s" if math.isfinite(worst.t) else ""
    unit, pair = unit_text(worst.unit), zip((worst.a, worst.b), worst.values, strict=True)
    both = ", ".join(f"{name} {number(value, 10)} {unit}" for name, value in pair if math.isfinite(value))
    scaled = f"{size(worst.error)} scaled, tolerance {number(worst.tolerance, 2)} ({worst.reason})"
    return (
        f"{row.scene}: {worst.quantity}{at}{when}: {both or f'{worst.a} - {worst.b}'}; {scaled}. {row.sentence}{unread}"
    )


def check_with(
    execute: Executor,
    what: Sequence[str | Path],
    settings: GateSettings,
    *,
    tolerances: str | Path | Mapping[str, float] | None = None,
    baseline: str | Path | None = None,
    progress: Callable[[str, float], None] = lambda step, share: None,
    place: Path | None = None,
) -> Check:
    """Check scenes for `screwgauge.check` with any executor. `place`: see `check_items`."""
    requested = [*items(what), *([known_item()] if settings.smoke and not what else [])]
    if settings.meshes and not any(is_model(name) for item in requested for name in item.files):
        raise DescriptionError("--meshes applies only to model files", "check", 'add allow = ["meshes"] to the scene')
    settings = replace(settings, tolerances=read_tolerances(tolerances))
    if baseline is not None:
        read_baseline(Path(baseline), settings.smoke, [item.name for item in requested])
    rows = check_items(requested, settings, execute=execute, progress=progress, place=place)
    others = [name for name in (tolerances, baseline) if isinstance(name, str | Path)]
    read = [*(name for row in rows for name in row.read), *(name for item in requested for name in item.files)]
    left = find_unread(what, [*read, *map(str, others)])
    known = None if baseline is None else compare_baseline(Path(baseline), rows, settings.smoke)
    return Check(rows, settings.smoke, known, left, datetime.now(UTC).isoformat(timespec="seconds"))
