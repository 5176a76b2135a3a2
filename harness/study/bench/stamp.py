"""What the pieces of an interrupted bench depend on."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from typing import Any

from screwgauge.environment import json_text
from screwgauge.models.catalog import mechanism_tables
from screwgauge.models.generate import model_texts
from screwgauge.scene.scene import Scene

NAME = "bench.partial.jsonl"
VERSION = 2  # of the protocol: raise it when old pieces no longer fit new ones


def stamp(scene: Scene, environment: Mapping[str, Any], quick: bool, samples: int) -> str:
    """Hash of all that results depend on: mechanism and its text, motion, gravity and loads, environment, protocol.

    Model files of the user's own are not among it: a bench reads none.
    """
    motion, applied = scene.motion, scene.applied
    record = {
        "models": model_texts(scene.mechanism),
        "text": [mechanism_tables(scene.mechanism_file), scene.text],  # which the truth reads unrounded
        "motion": [array.tobytes().hex() for array in (motion.t, motion.y, motion.yd, motion.ydd)],
        "applied": [applied.g, *(load.numbers() for load in applied.loads)],
        "environment": environment,
        "extent": [quick, samples],
        "v": VERSION,
    }
    return hashlib.sha256(json_text(record).encode()).hexdigest()
