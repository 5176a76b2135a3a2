"""Cases in which engines are put under stress, and what came of them."""

from __future__ import annotations

from screwgauge.study.cases.asking import (
    ENGINES,
    POSES,
    SCENE,
    SCREW,
    compare,
    exactly,
    loaded,
    push,
    still,
    tree_coordinates,
)
from screwgauge.study.cases.case import DEGRADED, GOOD, OK, REFUSED, SILENT, Case, Finding
from screwgauge.study.cases.loops import ITERATIONS
from screwgauge.study.cases.open_states import FORWARD, HARD
from screwgauge.study.cases.poses import BASE_LOCK, SINGULAR_B, WRIST_LOCKS
from screwgauge.study.cases.question import Question, findings
from screwgauge.study.cases.registry import CASES, decades
from screwgauge.study.stress import COLUMNS, Stress, climb, stress
