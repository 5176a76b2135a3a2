"""All errata in one report, whose numbers are those of the report that is kept."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from paper.page import PAGE, errata_frame

from screwgauge.commands.execution import carry_out

pytestmark = pytest.mark.slow

#: Read before any test may write it anew.
KEPT = pd.read_csv(Path(__file__).parents[2] / "reports/paper/errata.csv")

#: By how much of its row's largest number a number may be off. Other kernels of linear algebra move most by 1e-13 of
#: it, and by 3e-12 what 10 000 steps have added up; the rest is for sines and cosines of other libraries.
SHARE = 1e-9
SHARES = {
    # second differences of positions: their rounding of 1e-16 m over (2 ms)^2; 3e-9 is seen
    "(49): centres of mass of the legs, error": 1e-7,
    # the shortest step of RK4 leaves 1e-12 m, to which rounding adds some 1e-16 m; 4e-6 is seen
    "(27): order of the gap in the step": 1e-4,
    # forces grow as 1 / a, and a = 0.2 - 0.2 cos t is 1e-6 rad there, rounded to 3e-17; 7e-10 is seen
    "(56): driving force at t = 6.28 s": 1e-7,
    # a is 3e-9 rad, and the equations have a condition of 1e11; 1e-6 is seen
    "(56): driving force at t = 6.283 s": 1e-4,
}
#: Where a row is nothing but rounding: screws of 1 m, a few operations.
ROUNDED = 1e-15
#: Half a unit of the sixth figure, with which both forms are written.
SIX_FIGURES = 5.01e-6


def parted(row: pd.Series) -> tuple[tuple[object, ...], np.ndarray]:
    (printed, _, first), (right, _, second) = (row[name].rpartition(" -> ") for name in ("printed", "right"))
    numbers = np.array([first, second, row["effect"]], dtype=float)
    return (row["number"], row["equation"], printed, right, row["unit"]), numbers


@pytest.mark.slow
def test_every_row_is_the_kept_one(checked):
    rows = errata_frame(checked)
    assert {*KEPT["number"]} == set(range(1, 19))
    assert len(rows) == len(KEPT)
    off = []
    for (_, kept), (_, row) in zip(KEPT.iterrows(), rows.iterrows(), strict=True):
        (texts, numbers), (words, measured) = parted(kept), parted(row)
        share = SHARES.get(kept["equation"], SHARE) * np.abs(numbers).max() + ROUNDED
        bounds = share + np.array([SIX_FIGURES, SIX_FIGURES, 0.0]) * np.abs(numbers)
        if words != texts or not (np.abs(measured - numbers) <= bounds).all():
            off.append(f"{words} {measured}, was {texts} {numbers}, within {bounds}")
    assert off == []


def test_looser_bounds_are_those_of_rows():
    assert {*SHARES} <= {*KEPT["equation"]}


@pytest.mark.slow
def test_the_report_is_written(checked, request, tmp_path):
    out = (request.config.getoption("--reports") or tmp_path).absolute() / "paper"
    carry_out(PAGE, out, lambda progress: checked, force=True)
    assert len(pd.read_csv(out / "errata.csv")) == len(checked.errata)
    report = (out / "report.md").read_text(encoding="utf-8")
    assert all(row.measure.replace("|", r"\|") in report for row in checked.errata)
    assert report.count("plots/") == len([*out.glob("plots/*.svg")]) == 3
    assert "<svg" in (out / "report.html").read_text(encoding="utf-8")
