"""False alarms of the gate, and changes that it misses, counted over random mechanisms."""

from dataclasses import replace
from typing import Any
from zlib import crc32

import numpy as np
import pandas as pd
from campaigns.page import study
from campaigns.rows import drawn

from screwgauge.models.generate import stem, write_models
from screwgauge.quantities import length
from screwgauge.reference.errors import ScrewgaugeError
from screwgauge.reference.mechanism import Mechanism
from screwgauge.report.blocks import Banner
from screwgauge.study.comparison import Comparison
from screwgauge.study.formatting import Row, rows
from screwgauge.study.gate.measure import GateSettings, compare_scene

COLUMNS = ("family", "seed", "quiet", "parameter", "share", "caught", "error", "tolerance", "reason")
#: How much the dynamics are changed: the largest scaled change of a compared force.
CHANGE = 1e-9
#: Effect of a parameter that is wrong by its whole size, below which it is not among those that are changed.
LEAST = 1e-3


def measured(item: tuple[int, str]) -> dict[str, Any]:
    settings = GateSettings(lambda results: "")
    with drawn(item, COLUMNS) as (scene, row):
        try:
            first, results = compare_scene(scene, settings)
        except ScrewgaugeError as error:
            return {**row, "quiet": "refused", "reason": error.what}
        worst = first.worst
        if not first.ok and worst is not None:
            row |= {"reason": f"{worst.key}: {worst.error:.2g} by {worst.tolerance:.2g}, {worst.reason}"}
        row["quiet"] = "yes" if first.ok else "no"
        rng = np.random.default_rng([row["seed"], crc32(row["family"].encode())])
        if not (chosen := _chosen(results, rng)):
            return row
        parameter, share = chosen
        folder = scene.file.parent / "changed"
        write_models(changed(scene.mechanism, parameter, share), folder, gravity=scene.applied.g)
        own = folder / f"{stem(scene.mechanism.name, 'minimal')}.xml"
        after = compare_scene(replace(scene, models={"mujoco": own}), settings)[0]
        row |= {"parameter": parameter, "share": f"{share:.2g}", "caught": "no" if after.ok else "yes"}
        if (most := after.worst) is not None:
            row |= {"error": f"{most.error:.2g}", "tolerance": f"{most.tolerance:.2g}"}
    return row


def _chosen(results: Comparison, rng: np.random.Generator) -> tuple[str, float] | None:
    """An inertial parameter, and the share of its size that makes `CHANGE` of the forces; None if none has effect."""
    rows = [
        row
        for row in results.coverage.parameters
        if row["effect"] > LEAST and row["parameter"].startswith(("mass", "com", "inertia"))
    ]
    if not rows:
        return None
    row = rows[int(rng.integers(len(rows)))]
    return str(row["parameter"]), CHANGE / float(row["effect"])


def changed(mechanism: Mechanism, parameter: str, share: float) -> Mechanism:
    what, _, name = parameter.partition(" of ")
    kind, _, axes = what.partition(" ")
    bodies = list(mechanism.bodies)
    i = next(i for i, body in enumerate(bodies) if body.name == name)
    body = bodies[i]
    if kind == "mass":
        bodies[i] = replace(body, mass=body.mass + share * (body.mass or mechanism.mass))
    elif kind == "com":
        bodies[i] = replace(body, com=body.com + share * length(mechanism) * np.eye(3)["xyz".index(axes)])
    else:
        size = float(np.abs(body.inertia).max()) or body.mass * length(mechanism) ** 2
        j, k = ("xyz".index(axis) for axis in axes)
        more = np.zeros((3, 3))
        more[j, k] = more[k, j] = share * size
        bodies[i] = replace(body, inertia=body.inertia + more)
    return replace(mechanism, bodies=tuple(bodies))


def sentence(found: pd.DataFrame) -> str:
    """The counts in words."""
    return (
        "{mechanisms} random mechanisms of {families} families: {alarms} false alarms of {looked} ({refused} refused); "
        "{missed} of {changed} changes of the dynamics by {change:g} missed."
    ).format(**_counts(found), families=found["family"].nunique(), change=CHANGE)


def passed(found: pd.DataFrame) -> bool:
    n = _counts(found)
    return bool(n["looked"] and n["changed"]) and not n["alarms"] and not n["missed"]


def _counts(found: pd.DataFrame) -> dict[str, int]:
    quiet, caught = found["quiet"], found["caught"]
    refused, n = int((quiet == "refused").sum()), len(found)
    alarms, missed = int((quiet == "no").sum()), int((caught == "no").sum())
    counts = {"mechanisms": n, "refused": refused, "looked": n - refused, "alarms": alarms}
    return {**counts, "changed": int((caught != "").sum()), "missed": missed}


def _bad(found: pd.DataFrame) -> list[str]:
    def because(row: Row) -> str:
        missed = "{parameter} by {share} missed ({error}, tolerance {tolerance})".format(**row)
        return "; ".join([*([row["reason"]] if row["reason"] else []), *([missed] if row["caught"] == "no" else [])])

    bad = rows(found[(found["quiet"] != "yes") | (found["caught"] == "no")])
    return [f"{row['family']} {row['seed']}: {because(row)}" for row in bad]


PAGE = study(
    "alarms.csv",
    "False alarms and missed changes",
    lambda found: Banner.of(sentence(found), passed(found), "PASSED", "FAILED"),
    sentence=sentence,
    families=lambda found: [{"family": name, **_counts(some)} for name, some in found.groupby("family")],
    bad=_bad,
)
