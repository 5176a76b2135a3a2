"""Benches."""

from pathlib import Path

from screwgauge.study.bench import TABLE
from screwgauge.study.bench.contestants import LEAVING_OUT, Contestant, choose, contestants, simulators
from screwgauge.study.bench.forward_run import FULL, pose_simulation
from screwgauge.study.bench.forward_run import QUICK as QUICK_SIMULATIONS
from screwgauge.study.bench.given import motion, simulation
from screwgauge.study.bench.run import BESIDE, Bench, address_of, bench, fits
from screwgauge.study.bench.tables import (
    ABSOLUTE,
    COLUMNS,
    CUT,
    FAILED,
    OK,
    RULES,
    BenchRow,
    absolute_table,
    bench_table,
    reach,
    slopes_table,
)
from screwgauge.study.bench.tables import fits as fit_slopes
from screwgauge.study.bench.timing import QUICK, Plan, measure, rounds_needed, time_call
from screwgauge.study.store import Journal
from screwgauge.truth import cache


def journals() -> list[Path]:
    """Journals in the cache."""
    return [*cache.folder().glob("journal-*")]
