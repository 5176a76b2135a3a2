"""Questions of stress cases."""

from screwgauge.study.bench.question import (
    ENGINES,
    POSES,
    SCENE,
    SCREW,
    Question,
    compare,
    exact_text,
    findings,
    loaded_scene,
    push,
    scene_at,
    tree_coordinates,
)
from screwgauge.study.bench.singular import BASE_LOCK, SINGULAR_B, WRIST_LOCKS
