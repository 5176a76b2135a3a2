"""Cases in which engines are put under stress, and what came of them."""

from __future__ import annotations

from screwgauge.study.cases.case import DEGRADED, GOOD, OK, REFUSED, SILENT, Finding, StressCase
from screwgauge.study.cases.loops import ITERATIONS
from screwgauge.study.cases.open_states import FORWARD, HARD
from screwgauge.study.cases.registry import CASES, decades
from screwgauge.study.stress import COLUMNS, Stress, climb, stress
