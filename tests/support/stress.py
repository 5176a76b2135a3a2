"""Cases in which engines are put under stress, and what came of them."""

from __future__ import annotations

from screwgauge.study.cases.loops import ITERATIONS
from screwgauge.study.cases.open_states import FORWARD, HARD
from screwgauge.study.cases.question import DEGRADED, GOOD, OK, REFUSED, SILENT, Finding
from screwgauge.study.stress import CASES, COLUMNS, Stress, StressCase, climb, decades, stress
