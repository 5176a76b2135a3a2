"""Random mechanisms put to all engines, a row each: do these agree, and does the truth certify `screw`?"""

import re
from time import process_time
from typing import Any

from campaigns.rows import drawn
from campaigns.verdict import counts, judged

from screwgauge.reference.errors import ScrewgaugeError
from screwgauge.scene.scene import Scene
from screwgauge.study.run import run

ENGINES = ("screw", "pinocchio", "mujoco", "pinocchio-full", "mujoco-full")
TRUTH, CERTIFIED = "truth", "certified"
TRUTH_EVERY = 10  # seeds
COLUMNS = (
    *("family", "seed", "redrawn", "bodies", "joints", "freedoms", "loops", "engines", "verdict"),
    *("max_scaled", "tolerance", "quantity", "pair", "component", "estimate", "judge", "branch", "reason"),
    *("truth", "cpu_s", *(f"{engine}_s" for engine in ENGINES)),
)


def measured(item: tuple[int, str]) -> dict[str, Any]:
    with drawn(item, COLUMNS) as (scene, row):
        row["redrawn"] = re.findall(r"\d+(?= draws)", scene.description)[0]
        row |= counts(scene.mechanism)
        begin = process_time()
        try:
            row |= judged(run(scene, ENGINES))
        except ScrewgaugeError as error:
            row |= {"verdict": "refused", "reason": f"{type(error).__name__}: {error.what}"}
        row["cpu_s"] = f"{process_time() - begin:.3g}"
        if row["seed"] % TRUTH_EVERY == 0 and row["verdict"] != "refused":
            row["truth"] = _certified(scene)
    return row


def _certified(scene: Scene) -> str:
    results = run(scene, (TRUTH, ENGINES[0]))
    if TRUTH in results.failures:
        return str(results.failures[TRUTH].reason)
    truth = results.solutions[TRUTH]
    if truth.rows is not None:
        return f"{len(truth.rows)} of {len(scene.t)} samples certified"
    found = judged(results)
    return CERTIFIED if found["verdict"] in ("agree", "estimated") else f"{found['verdict']} by {found['max_scaled']}"
