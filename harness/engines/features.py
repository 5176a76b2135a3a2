"""Features of mechanisms and scenes that an engine may lack, and the message that rejects them."""

from __future__ import annotations

from screwgauge.engines.registry import Engine
from screwgauge.reference.applied import Applied
from screwgauge.reference.mechanism import Mechanism

#: Feature -> its description. Kinds of joints are features.
FEATURES = {
    "R": "revolute joint",
    "P": "prismatic joint",
    "U": "universal joint",
    "S": "spherical joint",
    "C": "cylindrical joint",
    "E": "planar joint",
    "F": "free joint",
    "fixed": "fixed joint",
    "couplings": "coupling",
    "resistance": "rotor, damping or dry friction",
    "springs": "spring or motor",
    "courses": "load over time",
    "axes": "load in axes of its body",
}

#: Task -> its description. `Engine.refuses` may state why an engine does not accept a task.
TASKS = {
    "GivenMotion": "given motion: inverse dynamics",
    "InitialValue": "simulation",
    "States": "states of an open tree as they are",
}


def features(mechanism: Mechanism, applied: Applied) -> dict[str, str]:
    """Find the features of a mechanism and its applied forces: feature -> its first owner."""
    found: dict[str, str] = {}
    for joint in mechanism.joints:
        found.setdefault(joint.kind, f"joint {joint.name}")
    for coupling in mechanism.couplings[:1]:
        found["couplings"] = f"coordinate {coupling.coordinate}"
    for resistance in mechanism.resistances[:1]:
        found["resistance"] = f"coordinate {resistance.coordinate}"
    if applied.springs or applied.motors:
        found["springs"] = "the scene"
    if any(load.courses for load in applied.loads):
        found["courses"] = "the scene"
    if any(load.axes == "body" for load in applied.loads):
        found["axes"] = "the scene"
    return found


def refusal(engine: Engine, mechanism: Mechanism, applied: Applied) -> str:
    """Return a message about the first feature that an engine lacks; empty if the engine supports all."""
    for feature, whose in features(mechanism, applied).items():
        if why := engine.refuses.get(feature):
            return f"{engine.name} takes no {FEATURES[feature]}, which {whose} has or is: {why}"
    return ""
