"""Questions that the stress cases put to engines."""

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
from screwgauge.study.cases.poses import BASE_LOCK, SINGULAR_B, WRIST_LOCKS
from screwgauge.study.cases.question import Question, findings
