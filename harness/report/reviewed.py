"""Describes reviews of tables: the faults in columns, and the agreement after the faults are corrected."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict
from typing import Any

from screwgauge.reference.errors import first_few
from screwgauge.report.blocks import Banner, Block, Table, table
from screwgauge.report.html import fragment
from screwgauge.report.text import terminal
from screwgauge.study.formatting import Row, digits_text, is_empty, join_all, number, size, unit_text
from screwgauge.study.review import ReviewedColumn, TableReview
from screwgauge.study.transformations import Fault

NAMED, FIGURES = 4, 4  # number of columns named in a sentence, if more are counted; number of significant figures
COLUMNS = "column = name | unit | finding | digits = error:as_digits | corrected = after"
#: Kind of a fault -> words for columns that have it.
WORDS = {
    "sign": "{be} negated",
    "unit": "{be} in {unit}",
    "factor": "{be} {times} times the correct numbers, a factor that no unit explains",
    "side": "{be} given for the opposite body at {fault.of}: the force of the successor on the predecessor",
    "permutation": "{have} the numbers of {fault.of}",
    "shift": "{be} {late} by {time} s{samples}",
    "held": "{be} interpolated between samples, with the first or last number held constant",
    "offset": "{be} off by a constant {amount}",
    "mean": "{be} filtered: {fault.of} ({fault.size:g} samples)",
    "filter": "{be} filtered: {fault.of}, cutoff {cutoff} Hz",
    "missing": "{be} without the {fault.of}",
    "reversed": "{have} the {fault.of} reversed",
    "noise": "{have} noise of {amount} (rms)",
}


class ReviewReport(TableReview):
    """A review with its report."""

    __slots__ = ()

    @property
    def verdict(self) -> str:
        """Describe the faults of the table in a sentence or two."""
        return banner(self).text

    def __repr__(self) -> str:
        return terminal(blocks(self))

    def _repr_html_(self) -> str:
        return fragment(blocks(self))


def blocks(review: TableReview) -> list[Block]:
    """Return the verdict, and a table with a line for each column."""
    return [banner(review), columns(review)]


def columns(review: TableReview) -> Table:
    """Build a table with a line for each column of the review."""
    return table(rows(review), COLUMNS)


def banner(review: TableReview) -> Banner:
    """Build the banner with the verdict."""
    word = "AGREE" if review.ok else "FAULTS" if review.explained else "NOT EXPLAINED"
    more = [f"Converted to SI units: {first_few(review.converted, NAMED)}."] if review.converted else []
    return Banner(
        " ".join([*sentences(review), *more]), f"{'✓' if review.ok else '✗'} {word}", "agree" if review.ok else "differ"
    )


def sentences(review: TableReview) -> list[str]:
    """Return sentences on faults, on agreement after correcting the faults, and on unexplained columns."""
    whole = [column for column in review.columns if column.faults is not None]
    lost = [column for column in review.columns if column.faults is None]
    if not review.columns:
        return [f"No value in {review.name} is unique, so nothing is compared."]
    agree = f"{_all(review, whole)} to {digits_text(max((c.left for c in whole), default=1.0))} digits"
    if review.ok:
        return [f"{agree} with {review.engine}.", *_printed_digits(review)]
    kinds = {fault.kind for column in whole for fault in column.faults or ()}
    noisy = ", as far as the noise allows" if "noise" in kinds else ""
    right = f"; corrected, {agree}{noisy}" if kinds - {"noise"} else f"; {agree}{noisy}"
    said = [f"{'; '.join(_phrases(review))}{right}."] if kinds else [f"{agree}."] * bool(whole)
    if lost:
        worst = max(lost, key=lambda column: column.error)
        many = "No known fault explains" if len(lost) == 1 else "No known faults explain"
        by = f"{_name(review, worst)} is off by {size(worst.error)} of its largest value"
        said.append(f"{many} {_names(review, lost)} ({by}).")
    return said


def _printed_digits(review: TableReview) -> Iterator[str]:
    """Yield sentences on columns that agree within their printed digits, but not within the tolerance of a run."""
    for quantity in dict.fromkeys(column.quantity for column in review.columns if not column.ok):
        place = max(column.place for column in review.columns if column.quantity == quantity)
        yield f"The numbers are rounded for printing: a run agrees with error.{quantity} = {number(place, 2)}."


def _all(review: TableReview, some: list[ReviewedColumn]) -> str:
    if len(some) == 1:
        return "it agrees" if len(review.columns) == 1 else f"{_name(review, some[0])} agrees"
    return f"{_names(review, some)} agree" if some else "nothing agrees"


def _phrases(review: TableReview) -> Iterator[str]:
    """Yield a description of each fault and its columns."""
    for group in review.faults.values():
        yield f"{_names(review, [column for column, _ in group])} {phrase(review, group)}"


def phrase(review: TableReview, group: list[tuple[ReviewedColumn, Fault]]) -> str:
    """Describe the columns that share a fault."""
    column, fault = group[0]
    sizes = sorted(abs(each.size) for _, each in group)
    step = review.step
    return WORDS[fault.kind].format(
        fault=fault,
        be="is" if len(group) == 1 else "are",
        have="has" if len(group) == 1 else "have",
        unit=unit_text(fault.of),
        times=number(fault.size, 6),
        amount=f"{number(sizes[-1] if fault.kind == 'noise' else fault.size, FIGURES)} {unit_text(column.unit)}",
        late="late" if fault.size > 0.0 else "early",
        time=number(sizes[0], FIGURES),
        samples=f" ({number(sizes[0] / step, 3)} samples)" if step else "",
        cutoff=number(fault.size, 3),
    )


def _name(review: TableReview, column: ReviewedColumn) -> str:
    one = len({each.quantity for each in review.columns}) == 1
    return column.component if one else f"{column.quantity}/{column.component}"


def _names(review: TableReview, some: list[ReviewedColumn]) -> str:
    if 1 < len(some) == len(review.columns):
        return f"all {len(some)} columns"
    names = [_name(review, column) for column in some]
    return join_all(names) if len(names) <= NAMED else first_few(names, NAMED - 1)


def rows(review: TableReview) -> list[Row]:
    """Return a table row for each column of the review."""
    return [
        {
            **asdict(column),
            "name": _name(review, column),
            "finding": _finding(review, column),
            "after": digits_text(column.left) if column.faults else "",
        }
        for column in review.columns
    ]


def _finding(review: TableReview, column: ReviewedColumn) -> str:
    if column.faults is None:
        return "✗ not explained"
    return "; ".join(phrase(review, [(column, fault)]) for fault in column.faults) or "✓ agrees"


def summary(review: TableReview) -> dict[str, Any]:
    """Convert a review to plain data."""
    found = [
        {**asdict(column), "finding": _finding(review, column), "left": None if is_empty(column.left) else column.left}
        for column in review.columns
    ]
    verdict = banner(review).text
    return {"name": review.name, "ok": review.ok, "explained": review.explained, "verdict": verdict, "columns": found}
