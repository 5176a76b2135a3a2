"""A diagnosis as plain data: ``diagnosis.json``."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

from screwgauge.diagnosis.causes.attribution import Attribution, Cause
from screwgauge.diagnosis.diagnose import Diagnosis
from screwgauge.diagnosis.differences.change import Difference
from screwgauge.diagnosis.model import Model

SCHEMA = 2
#: What shares of causes are of.
SCALE = "projection on the torque difference at random states, torques of each unit over the largest of it"


def summary(found: Diagnosis) -> dict[str, Any]:
    """What ``diagnosis.json`` has."""
    why, proof = found.attribution, found.proof
    return {
        "schema": SCHEMA,
        "date": found.date,
        "headline": found.headline,
        "verdict": found.verdict,
        "same": found.same,
        "not_all_compared": found.undecided,
        "not_compared": found.not_compared,
        "seed": found.seed,
        "models": {side: _facts(model) for side, model in (("A", found.a), ("B", found.b))},
        "map": {"joints": found.pairing.joints, "how": found.pairing.how, "bodies": found.pairing.bodies},
        "missing": {"in_b": found.pairing.only_a, "in_a": found.pairing.only_b},
        "differences": [_difference(each) for each in found.differences],
        "causes": [_cause(cause) for cause in found.causes],
        "dynamics": [asdict(row) for row in found.rows],
        "loops": found.loops and asdict(found.loops),
        "order": found.order and asdict(found.order),
        "growth": found.growth and asdict(found.growth),
        "attribution": why and _attribution(why),
        "torque_by_joint": [dict(zip(("component", "before", "after"), each, strict=True)) for each in found.by_joint],
        "soft_equalities": found.soft and _attribution(found.soft),
        "backfill": proof and {"on": proof.on, "left": asdict(proof.left), "why_not": proof.why_not},
        "libraries_together": found.together and asdict(found.together),
        "libraries": [asdict(witness) for witness in found.witnesses],
        "matrix": found.matrix and asdict(found.matrix),
        "notes": found.notes,
        "doubts": found.doubts,
        "left_out": found.left_out,
    }


def _facts(model: Model) -> dict[str, Any]:
    return {
        "file": model.label,
        "library": model.library,
        "sha256": model.sha256,
        "loops": model.loops and {"file": str(model.loops), "sha256": model.loops_sha256},
        "digits": model.digits,
        "joints": len(model.reading.joints),
        "bodies": len(model.reading.bodies),
        "mass": model.reading.mass,
        "ignored": model.reading.ignored,
    }


def _attribution(why: Attribution) -> dict[str, Any]:
    return {
        "before": asdict(why.before),
        "left": asdict(why.left),
        "share": why.share,
        "scale": SCALE,
        "causes": [_cause(cause) for cause in why.causes],
    }


def _cause(cause: Cause) -> dict[str, Any]:
    """`differences` are numbers of those in the list of all."""
    names = ("name", "sentence", "short", "kind", "share", "of_rest", "differences", "slips")
    return {name: getattr(cause, name) for name in names}


def _difference(each: Difference) -> dict[str, Any]:
    plain = {key: getattr(each, key) for key in ("item_a", "item_b", "what", "unit", "size", "kind", "sentence")}
    a, b = each.whole or (each.a, each.b)
    return {**plain, "a": a, "b": b}
