"""What `screwgauge.check` returns, rows that can be asserted; its report, and what services for CI read."""

from __future__ import annotations

import math
import os
import xml.etree.ElementTree as ET
from argparse import Namespace
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from screwgauge.environment import json_text
from screwgauge.judging.residual import JUDGE
from screwgauge.reference.errors import OutputError, first_few, printable
from screwgauge.reference.files import check_free, replace_file, stamped, why
from screwgauge.report.blocks import Banner, Heading
from screwgauge.report.formatting import beyond, digits_text, number, size, unit_text
from screwgauge.report.html import fragment
from screwgauge.report.layout import Report
from screwgauge.report.left_out import more
from screwgauge.report.text import markdown, terminal
from screwgauge.report.verdict import verdict
from screwgauge.study.comparison import Comparison
from screwgauge.study.gate.baseline import Against, against, check_baseline, read_baseline, write_baseline
from screwgauge.study.gate.items import GateRow, items, read_tolerances, unread
from screwgauge.study.gate.known_files import known_item
from screwgauge.study.gate.measure import GateSettings
from screwgauge.study.gate.run import check_items, files_in
from screwgauge.study.outcome import EXIT, Outcome
from screwgauge.study.runner import Executor

SCHEMA = 1  #: Of the JSON.
ADMITTED = "Admitted on purpose"
#: Variable with the name of the file to which GitHub wants the summary of a job to be added.
SUMMARY = "GITHUB_STEP_SUMMARY"
WORDS: dict[Outcome, str] = {
    "agree": "✓ ok",
    "judged": "✓ judged",
    "unread": "✗ not read",
    "rigid": "✗ inertia left out",
    "unlike": "✗ models differ",
    "undecided": "✗ not decided",
    "partly": "✗ partly",
    "unjudged": "✗ not judged",
    "nothing": "✗ nothing compared",
    "faulted": "✗ out of tolerance",
    "differ": "✗ differ",
    "refused": "✗ refused",
    "failed": "✗ failed",
}
#: Names of files that a verdict lists.
SHOWN = 5


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Check:
    """Result of a gate.

    Attributes:
        rows: One for each scene or pair of models.
        smoke: Whether a few samples were looked at only.
        against: What has become of a known state; None without a baseline.
        unread: Descriptions, scenes and models in the folders that were named, of which nothing was read.
        date: When it was made, ISO 8601 in UTC.
    """

    rows: Sequence[GateRow]
    smoke: bool = False
    against: Against | None = None
    unread: Sequence[str] = ()
    date: str = ""

    @property
    def ok(self) -> bool:
        """Whether there is something, all of it passes, and no digits were lost."""
        return self.exit_status == 0

    def __bool__(self) -> bool:
        """Truthiness: ``assert check`` passes only if the check is ok."""
        return self.ok

    @property
    def exit_status(self) -> int:
        """0 all within tolerance; 1 something is not, or has lost digits; 2 bad input; 3 something failed."""
        worst = max((EXIT[row.status] for row in self.rows), default=1)
        return worst or int(bool(self.against and self.against.worse))

    @property
    def faults(self) -> list[str]:
        """What does not pass, in sentences: scene, quantity, component, time, both values, tolerance and cause."""
        lost = [f"Regression: {each}." for each in self.against.worse] if self.against else []
        return [*(message(row) for row in self.rows if not row.ok), *lost]

    def assert_ok(self) -> None:
        """Raises:
        AssertionError: Something does not pass; the message says what, where, when, by how much and why.
        """
        __tracebackhide__ = True  # pytest shows the line that asks, not this one
        if not self.ok:
            raise AssertionError("\n".join(self.faults) or "nothing was checked")

    def write_baseline(self, file: str | Path) -> None:
        """Makes this the known state.

        Raises:
            OutputError: Something could not be checked, or the file not be written; it is then as it was.
        """
        write_baseline(Path(file), self.rows, self.smoke)

    def __repr__(self) -> str:
        return terminal(PAGE.terminal(self))

    def _repr_html_(self) -> str:
        return fragment(PAGE.terminal(self))

    def markdown(self) -> str:
        """The summary of a job."""
        return markdown([Heading("Screwgauge"), *PAGE.terminal(self)])

    @property
    def record(self) -> dict[str, Any]:
        """All of it, as plain data."""
        known = asdict(self.against) if self.against else None
        rows = [{**asdict(row), "ok": row.ok} for row in self.rows]
        for row in rows:  # names of files as they are given are in `files`; where those lie is this machine's own
            del row["read"]
        content = {"schema": SCHEMA, "ok": self.ok, "smoke": self.smoke, "rows": rows, "baseline": known}
        return {**content, "unread": [*self.unread]}

    @property
    def json(self) -> str:
        """The record as text."""
        return json_text(self.record, escaped=True)

    def junit(self) -> str:
        """JUnit XML: a test case for each row, and one for the baseline."""
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
            ET.SubElement(suite, "system-out").text = printable(_left_alone(self))
        return ET.tostring(suite, encoding="unicode", xml_declaration=True) + "\n"

    def annotations(self) -> Iterator[str]:
        """Commands of GitHub that mark a line of a model or scene."""
        for row in self.rows:
            marks = {} if row.ok else {"error": message(row)}
            if row.admitted:
                marks["warning"] = f"{row.scene}: {ADMITTED.lower()}: {', '.join(row.admitted)}"
            for kind, text in marks.items():
                place = _escaped(row.file, "%\r\n:,")
                yield f"::{kind} file={place},line={max(row.line, 1)}::{_escaped(printable(text), '%')}"


def _escaped(text: str, signs: str) -> str:
    """A text with codes for the signs that mean something to GitHub."""
    return "".join(f"%{ord(sign):02X}" if sign in signs else sign for sign in text)


#: Elements of JUnit by the exit status of what they are about.
_KINDS = {1: "failure", 2: "error", 3: "error"}


def _banners(check: Check) -> list[Banner]:
    """The verdict, and what no machine has."""
    odd = [(row.scene, sentence) for row in check.rows for sentence in row.doubts]
    odd += [(row.scene, f"{row.more}.") for row in check.rows if row.more and row.ok]
    return [_banner(check), *(Banner(f"{scene}: {sentence}", "Warning") for scene, sentence in odd)]


def _banner(check: Check) -> Banner:
    sentences = [f"{sum(row.ok for row in check.rows)} of {len(check.rows)} pass."]
    agree = [row for row in check.rows if row.status == "agree"]
    alone = [row.scene for row in check.rows if row.status == "judged"]
    judged = {any(error.b == JUDGE for error in row.errors) for row in agree}  # of a pair of models nobody is
    if check.ok and judged == {True}:
        each = "In each of them" if not alone else "In the others" if len(agree) > 1 else f"In {agree[0].scene}"
        sentences.append(f"{each} all engines agree within tolerance, and the equations of mechanics hold.")
    elif check.ok and agree:
        sentences.append(f"Models {'and engines ' * (True in judged)}agree within tolerance.")
    if check.ok and alone:
        named = first_few(alone, SHOWN)
        sentences.append(f"Nothing was compared in {named}: one engine ran, for which the equations of mechanics hold.")
    larger = [row.scene for row in check.rows if row.more and row.ok]
    if check.ok and larger:
        sentences.append(f"Of {first_few(larger, SHOWN)} only the rigid machine is compared: forces are left out.")
    sentences += filter(None, [_left_alone(check)])
    qualified = alone or larger or check.unread or any(row.admitted or row.doubts for row in check.rows)
    return Banner.of(" ".join(sentences), check.ok, "OK, but" if qualified else "OK", "FAILED")


def _left_alone(check: Check) -> str:
    """Which files of the folders were not read."""
    return f"Not read, because no scene names them: {first_few(check.unread, SHOWN)}." if check.unread else ""


def _admitted(check: Check) -> list[str]:
    """What is admitted on purpose, and in which scenes."""
    scenes: dict[str, list[str]] = {}
    for row in check.rows:
        for each in row.admitted:
            scenes.setdefault(each, []).append(row.scene)
    return [f"{each} ({first_few(names, SHOWN)})" for each, names in scenes.items()]


def _lines(rows: Iterable[GateRow]) -> list[dict[str, Any]]:
    """What tables say of rows: status and worst error."""
    nothing = dict.fromkeys(("quantity", "error", "digits", "tolerance", "reason"))
    lines = []
    for row in rows:
        worst = {**asdict(row.worst), "digits": digits_text(row.worst.error)} if row.worst else nothing
        scaled = size(row.worst.error) if row.worst else ""
        lines.append({**worst, "scene": row.scene, "word": WORDS[row.status], "scaled": scaled})
    return lines


def _nearest(check: Check) -> list[dict[str, Any]]:
    """The three that come nearest to their tolerance, or are farthest beyond it."""
    sized = [(beyond(row.worst.error, row.worst.tolerance), row) for row in check.rows if row.worst is not None]
    return _lines(row for _, row in sorted(sized, key=lambda pair: pair[0], reverse=True)[:3])


def _about(check: Check) -> dict[str, Any]:
    """Facts of the first screen: how much was checked, by which engines, from which files and when."""
    engines = dict.fromkeys(f"{name} {version}".strip() for row in check.rows for name, version in row.versions.items())
    files = [f"{name} (SHA-256 {digest.removeprefix('SHA-256 ')[:8]})" for name, digest in _files(check).items()]
    return {
        "scenes and pairs": len(check.rows),
        "motion": "a few samples of an exciting one" if check.smoke else "its own",
        "engines": ", ".join(engines),
        "files": first_few(files, SHOWN) + (", see Environment" if len(files) > SHOWN else ""),
        "date": check.date,
    }


def _files(check: Check) -> dict[str, str]:
    """Whose file -> its hash."""
    return {f"{row.scene}: {of}": f"SHA-256 {digest}" for row in check.rows for of, digest in row.files.items()}


def _tolerances(check: Check) -> list[str]:
    """The largest of each quantity by where they come from."""
    by: dict[str, dict[str, float]] = {}
    for one in (error for row in check.rows for error in row.errors):
        sizes = by.setdefault(one.reason, {})
        sizes[one.quantity] = max(sizes.get(one.quantity, 0.0), one.tolerance)
    return [f"{why}: {', '.join(f'{name} {number(x, 2)}' for name, x in of.items())}" for why, of in by.items()]


class _Page(Report):
    """A report with the files that services for CI read."""

    def write(
        self, results: Check, out: Path, *, junit: Path | None = None, baseline: Path | None = None, **writing: Any
    ) -> Path:
        """Writes ``check.json``, the report and ``environment.json``; JUnit and baseline where they are asked for.

        The summary of a job is added to the file that `SUMMARY` names.
        """
        if junit is not None:
            replace_file(junit, stamped(results.junit()))
        if summary := os.environ.get(SUMMARY):
            try:
                with Path(summary).open("a", encoding="utf-8") as file:
                    file.write(results.markdown())
            except OSError as error:
                what = f"cannot be written ({why(error)})"
                raise OutputError(what, f"{SUMMARY}, {summary}", "unset it, or name a file") from error
        super().write(results, out, **writing)
        if baseline is not None:
            results.write_baseline(baseline)
        return out


PAGE = _Page(
    text="check",
    banner=_banners,
    data={"check.json": lambda check: check.record},
    values={
        "title": lambda check: "Check",
        "nearest": _nearest,
        "about": _about,
        "files": _files,
        "rows": lambda check: _lines(sorted(check.rows, key=lambda row: row.ok)),
        "tolerances": _tolerances,
        "unread": lambda check: [*check.unread],
        "admitted": _admitted,
        "tested": lambda check: [f"{row.scene}: {row.coverage or row.sentence}" for row in check.rows if row.ok],
    },
)


def message(row: GateRow) -> str:
    """The outcome of a row: quantity, component, time, both values and tolerance of the worst, then the cause."""
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


def sentence_of(results: Comparison) -> str:
    """The verdict of a comparison."""
    banner = verdict(results)
    return f"{banner.word}: {banner.text}"


def check_files(options: Namespace) -> None:
    """Finds out before long work whether single files can be written.

    Raises:
        OutputError: One of them cannot.
    """
    for path in (options.junit, options.baseline if options.update else None):
        if path is not None and (os.path.isdir(path) or not os.access(path.parent, os.W_OK)):
            what = "is a folder" if os.path.isdir(path) else "cannot be written (no such folder, or not allowed)"
            raise OutputError(what, str(path), "name another file")
    if options.junit is not None:
        check_free(options.junit, force=options.force)
    if options.update:
        check_baseline(options.baseline, force=options.force)


def check_outputs(options: Namespace) -> dict[str, Path]:
    """Option or variable -> file that the command writes beside its report."""
    known = options.baseline if options.update else None
    named = {"--junit": options.junit, "--baseline": known, SUMMARY: os.environ.get(SUMMARY)}
    return {name: Path(file) for name, file in named.items() if file}


def check_inputs(options: Namespace) -> Iterator[Path]:
    """Every file that the command reads."""
    yield from map(Path, filter(None, (options.tolerances, None if options.update else options.baseline)))
    for item in items(options.what):
        yield from map(Path, item.files)
        yield from files_in(item)


def check_with(
    execute: Executor,
    what: Sequence[str | Path],
    *,
    smoke: bool = False,
    tolerances: str | Path | Mapping[str, float] | None = None,
    baseline: str | Path | None = None,
    progress: Callable[[str, float], None] = lambda step, share: None,
    place: Path | None = None,
) -> Check:
    """What `screwgauge.check` does, wherever scenes are to be checked. `place`: see `check_items`."""
    requested = [*items(what), *([known_item()] if smoke and not what else [])]
    settings = GateSettings(sentence_of, smoke, read_tolerances(tolerances), more)
    if baseline is not None:
        read_baseline(Path(baseline), smoke, [item.name for item in requested])
    rows = check_items(requested, settings, execute=execute, progress=progress, place=place)
    others = [name for name in (tolerances, baseline) if isinstance(name, str | Path)]
    read = [*(name for row in rows for name in row.read), *(name for item in requested for name in item.files)]
    left = unread(what, [*read, *map(str, others)])
    date = datetime.now(UTC).isoformat(timespec="seconds")
    return Check(rows, smoke, None if baseline is None else against(Path(baseline), rows, smoke), left, date)
