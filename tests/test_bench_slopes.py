"""Slopes of errors."""

from dataclasses import replace

import numpy as np
import pytest

from support.bench import CUT, RULES, BenchRow, Contestant, fit_slopes, motion, slopes_table
from support.engines import Method

RULE = {"line": "line", "quantity": "q", "expected": 2.0}


def rows(points: list[tuple[float, float]]) -> list[BenchRow]:
    def row(x: float, error: float) -> BenchRow:
        contestant = Contestant("line", "line", f"{x}", Method("screw"), motion, ("q",), "", parameter=("h", x))
        return BenchRow("q", error=error, rms=error, contestant=contestant, status="ok", n_sample=1, seconds=(1.0,))

    return [row(x, error) for x, error in points]


def test_a_power_law_is_found_between_floor_and_saturation():
    x = 10.0 ** -np.arange(9.0)
    error = 3.0 * x**2 / (1.0 + 3.0 * x**2) + 2e-11
    (fit,) = fit_slopes(rows(list(zip(x, error, strict=True))), [RULE])
    assert fit.slope == pytest.approx(2.0, rel=0.02)
    assert fit.ok
    assert not fit.used[[0, -1]].any()


def test_another_slope_is_not_ok():
    (fit,) = fit_slopes(rows([(x, 1e-3 * x) for x in (1e-3, 1e-2, 1e-1)]), [RULE])
    assert fit.slope == pytest.approx(1.0)
    assert not fit.ok


def test_two_points_are_no_slope():
    (fit,) = fit_slopes(rows([(1e-3, 1e-6), (1e-2, 1e-4)]), [RULE])
    assert np.isnan(fit.slope)
    assert not fit.ok


def test_a_line_cut_short_before_it_had_three_points_has_no_slope():
    points = rows([(1e-3, 1e-6), (1e-2, 1e-4)])
    assert fit_slopes([*points, replace(points[0], error=np.nan, status=CUT)], [RULE]) == []
    three = rows([(1e-3, 1e-6), (1e-2, 1e-4), (1e-1, 1e-2)])
    assert fit_slopes([*three, replace(points[0], error=np.nan, status=CUT)], [RULE])[0].ok


def test_lines_without_rows_have_no_slope():
    assert fit_slopes([], RULES) == []


def test_every_family_on_the_paper_scene_has_its_slope(bench_of_all):
    slopes = slopes_table(bench_of_all.fits)
    families = {row.contestant.family for row in bench_of_all.rows}
    assert set(slopes["family"]) == {rule["line"] for rule in RULES if rule["line"].split(" ")[0] in families}
    assert len(slopes) == 8
    assert slopes["ok"].all(), slopes.to_string()
