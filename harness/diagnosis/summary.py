"""A diagnosis as plain data: ``diagnosis.json``."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from screwgauge.diagnosis.machine.whole import Whole

if TYPE_CHECKING:
    from screwgauge.diagnosis.answer import Difference
    from screwgauge.diagnosis.diagnose import Diagnosis
    from screwgauge.diagnosis.facts.fact import Fact
    from screwgauge.diagnosis.findings import Findings
    from screwgauge.diagnosis.model import Model

SCHEMA = 3
#: What shares of causes are of.
SCALE = "projection on the torque difference at random states, torques of each unit over the largest of it"


def summary(diagnosis: Diagnosis) -> dict[str, Any]:
    """What ``diagnosis.json`` has; `differences` of causes are numbers in the list of all."""
    found = diagnosis.found
    return {
        "schema": SCHEMA,
        "date": diagnosis.date,
        "headline": diagnosis.headline,
        "verdict": diagnosis.verdict,
        "same": diagnosis.same,
        "not_all_compared": diagnosis.undecided,
        "not_compared": diagnosis.not_compared,
        "only": found.only,
        "seed": found.seed,
        "models": {side: _model(model) for side, model in (("A", found.a), ("B", found.b))},
        **_partners(found),
        "differences": [_difference(each) for each in diagnosis.differences],
        "facts": [_fact(each) for each in found.standing],
        "causes": [asdict(cause) for cause in diagnosis.causes],
        "torques": {**asdict(found.torques), "scale": SCALE},
        "torque_by_joint": [{"component": name, "change": change} for name, change in found.by_joint],
        "mobility": found.mobility and dict(zip("AB", found.mobility, strict=True)),
        "agreement": found.agreement and asdict(found.agreement),
        "order": found.order and asdict(found.order),
        "fix": found.fix
        and {"proved": found.fix.proved, "unheard": found.fix.unheard, "not_fixed": diagnosis.not_fixed},
        "libraries_together": found.together and asdict(found.together),
        "libraries": [asdict(witness) for witness in found.witnesses],
        "notes": diagnosis.notes,
        "doubts": diagnosis.doubts,
        "left_out": found.left_out,
    }


def _model(model: Model) -> dict[str, Any]:
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


def _partners(found: Findings) -> Mapping[str, Any]:
    """Which parts are partners, and which have none."""
    pair, alone = found.pair, (found.pair.alignment.only_a, found.pair.alignment.only_b)
    joints = {name: pair.partner(name).name for name in found.how}
    missing = {
        key: ["/".join(link.names) for link in links] for key, links in zip(("in_b", "in_a"), alone, strict=True)
    }
    return {"map": {"joints": joints, "how": found.how, "bodies": pair.alignment.bodies}, "missing": missing}


def _difference(each: Difference) -> dict[str, Any]:
    return {key: _value(getattr(each, key)) for key in each.__slots__}


def _fact(each: Fact) -> dict[str, Any]:
    keys = ("part", "partner", "what", "of", "more", "a", "b", "unit", "size", "kind")
    return {key: _value(getattr(each, key)) for key in keys}


def _value(value: Any) -> Any:
    return asdict(value) if isinstance(value, Whole) else value
