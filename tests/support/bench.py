"""The benchmark of engines: contestants, rows and runs."""

from __future__ import annotations

from screwgauge.study.bench.contestant import TABLE, Contestant
from screwgauge.study.bench.forward_run import FULL, contest, simulated
from screwgauge.study.bench.forward_run import QUICK as QUICK_SIMULATIONS
from screwgauge.study.bench.leaving_out import LEAVING_OUT
from screwgauge.study.bench.questions import motion, simulation
from screwgauge.study.bench.registry import contestants, simulators
from screwgauge.study.bench.rows import ABSOLUTE, COLUMNS, CUT, FAILED, OK, BenchRow, absolute_table, bench_table, reach
from screwgauge.study.bench.run import QUICK, Bench, Plan, bench, fits
from screwgauge.study.bench.slopes import RULES, Rule, table
from screwgauge.study.bench.slopes import fits as fit_slopes
from screwgauge.study.bench.stamp import NAME, stamp
from screwgauge.study.bench.timing import Protocol, enough, measure, once
from screwgauge.study.store import Journal
