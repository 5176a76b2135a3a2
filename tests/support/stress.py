"""Stress cases and their rows."""

from screwgauge.study.bench.question import DEGRADED, GOOD, OK, REFUSED, SILENT, Finding
from screwgauge.study.bench.stress import CASES, COLUMNS, Stress, StressCase, climb, decades, stress
