"""Features of mechanisms and scenes that an engine may not support, and the message that rejects them."""

from __future__ import annotations

from screwgauge.engines.registry import Engine
from screwgauge.reference.applied import Applied
from screwgauge.reference.mechanism import Mechanism

#: Feature -> its description. Kinds of joints are features.
FEATURES = {
    "R": "revolute joints",
    "P": "prismatic joints",
    "U": "universal joints",
    "S": "spherical joints",
    "C": "cylindrical joints",
    "E": "planar joints",
    "F": "free joints",
    "fixed": "fixed joints",
    "couplings": "couplings",
    "resistance": "rotors, damping and dry friction",
    "springs": "springs and motors",
    "courses": "time-varying loads",
    "axes": "loads in body axes",
}

#: Task -> its description. `Engine.refuses` may state why an engine does not accept a task.
TASKS = {
    "GivenMotion": "given motion: inverse dynamics",
    "InitialValue": "simulation",
    "States": "given states of an open tree",
}


def features(mechanism: Mechanism, applied: Applied) -> dict[str, str]:
    """Map each feature of a mechanism and its applied forces to the first item that has it, for messages."""
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
    """Return a message about the first feature that an engine does not support; empty if it supports all features."""
    for feature, whose in features(mechanism, applied).items():
        if why := engine.refuses.get(feature):
            return f"{engine.name} does not support {FEATURES[feature]} ({whose}): {why}"
    return ""
