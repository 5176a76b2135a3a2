"""Random mechanisms in motions larger than those that they are drawn with, and what truth says of each difference.

Amplitudes are taken three times, else twice, else one and a half times: the largest that no engine refuses. Where the
default engines do not agree, the scene is run again with the engine ``truth``: a difference is confirmed where one of
the two engines is off from the truth, too.
"""

import csv
import tomllib
from functools import partial
from io import StringIO
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import pandas as pd
import tomli_w
from campaigns.rows import grown, keep

import screwgauge

FACTORS = (3.0, 2.0, 1.5)
FIRST = 2000  # seed
COLUMNS = ["seed", "family", "factor", "verdict", "confirmed", "reason"]


def larger(file: Path, factor: float) -> screwgauge.Scene:
    tables = tomllib.loads(file.read_text(encoding="utf-8"))
    for motion in tables["motion"].values():
        motion["harmonics"] = [[omega, factor * c, factor * s] for omega, c, s in motion["harmonics"]]
    tables["time"] = {"duration": 1, "step": 0.025}
    path = file.with_name(f"larger-{file.name}")
    path.write_text(tomli_w.dumps(tables), encoding="utf-8")
    return screwgauge.load_scene(path)


def confirmed(scene: screwgauge.Scene, bad: pd.DataFrame) -> bool:
    """Whether the truth differs from one of the two engines in each quantity in which these differ and that it has.

    It has no forces of the open tree, which follow from accelerations.
    """
    pairs = screwgauge.run(scene, [*scene.engines, "truth"]).pairs
    pairs = pairs[(pairs["a"] == "truth") | (pairs["b"] == "truth")]
    off = pairs[~pairs["ok"].astype(bool)]
    seen = {(row.quantity, engine) for row in off.itertuples() for engine in (row.a, row.b)}
    asked = bad[bad["quantity"].isin(pairs["quantity"])]
    return not asked.empty and all({(row.quantity, row.a), (row.quantity, row.b)} & seen for row in asked.itertuples())


def row(seed: int, folder: Path) -> dict[str, object]:
    drawn = screwgauge.random(seed, folder=folder)
    found: dict[str, object] = {"seed": seed, "family": drawn.mechanism.name.rpartition("-")[0]}
    for factor in FACTORS:
        try:
            scene = larger(drawn.file, factor)
            results = screwgauge.run(scene)
        except screwgauge.ScrewgaugeError as error:
            found |= {"verdict": "refused", "reason": error.what}
            continue
        found |= {"factor": factor, "verdict": "agree", "reason": ""}
        if results.failures:
            said = "; ".join(f"{name}: {failure.reason}" for name, failure in results.failures.items())
            return found | {"verdict": "failed", "reason": said}
        if not results.ok:
            bad = results.pairs[~results.pairs["ok"].astype(bool)]
            if bad.empty:  # engines agree, and the judge finds the equations of one beyond tolerance
                fault = results.judge[~results.judge["ok"].astype(bool)].iloc[0]
                size = f"{fault['max_scaled']:.2g} of {fault['tolerance']:.2g}, {fault['reason']}"
                return found | {"verdict": "judge", "reason": f"{fault['residual']}: {fault['engine']} {size}"}
            worst = bad.loc[(bad["max_scaled"] / bad["tolerance"]).idxmax()]
            size = f"{worst['max_scaled']:.2g} of {worst['tolerance']:.2g}"
            said = f"{worst['quantity']}: {worst['a']} - {worst['b']} {size}"
            return found | {"verdict": "differ", "confirmed": confirmed(scene, bad), "reason": said}
        return found
    return found


def rows_of_larger_motions(count: int, file: Path) -> list[dict[str, str]]:
    table = list[dict[str, str]]()
    while (left := count - sum(each["verdict"] != "refused" for each in table)) > 0:
        works = {f"{seed}": partial(_rows, seed) for seed in range(FIRST, FIRST + len(table) + left)}
        text = grown(file, COLUMNS, works, lambda seed, why: {"seed": seed, "reason": why})
        table = [*csv.DictReader(StringIO(text))]
    keep(file, text)
    return table


def _rows(seed: int) -> list[dict[str, Any]]:
    with TemporaryDirectory() as folder:
        return [row(seed, Path(folder))]
