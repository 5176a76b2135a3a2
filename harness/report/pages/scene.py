"""What a report says of a scene: its motion, loads, springs and motors, how it is simulated; and of files judged."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import PurePath
from typing import Any

import numpy as np

from screwgauge.reference.applied import JointSpring, Load, Motor, Spring
from screwgauge.reference.rotations import Array
from screwgauge.report.formatting import number, span, vector
from screwgauge.scene.scene import Scene
from screwgauge.solution import REFERENCE


def judged(provenance: Mapping[str, Any]) -> dict[str, str]:
    """Files of scene, description and models, and the date."""
    files = {
        "scene file": {"file": provenance.get("scene_file"), "sha256": provenance.get("scene_sha256")},
        "description": provenance.get("description", {}),
        **{f"model of {engine}": model for engine, model in provenance.get("models", {}).items()},
    }
    found = {what: f"{file['file']}, SHA-256 {file['sha256']}" for what, file in files.items() if file.get("file")}
    return {**found, "date": provenance.get("date", "")}


def short(judged: Mapping[str, str]) -> dict[str, str]:
    """What was judged, with names of files alone and the beginnings of their hashes."""

    def shortened(text: str) -> str:
        file, sha, digest = text.rpartition(", SHA-256 ")
        return f"{PurePath(file).name} (SHA-256 {digest[:8]})" if sha else text

    return {what: shortened(text) for what, text in judged.items() if text}


def samples(t: Array) -> str:
    """``101 samples, t = 0 to 1 s``."""
    return f"{len(t)} sample{'s' * (len(t) != 1)}, t = {span(number(t[0]), number(t[-1]))} s"


def about(scene: Scene, t: Array) -> dict[str, Any]:
    """What was computed: names and values."""
    described = {
        "scene": scene.name,
        "mechanism": scene.mechanism.title or scene.mechanism.name,
        "source": scene.mechanism.source,
        "samples": samples(t),
        "independent coordinates": ", ".join(f"{k} = {v}" for k, v in scene.mechanism.independent.items()),
        "gravity": f"{vector(scene.applied.g)} m/s²",
        "load": [*map(_load, scene.applied.loads)],
        "motion": [f"{label} = {_inline(table)}" for label, table in scene.text.get("motion", {}).items()],
        "spring and damper": [*map(_spring, scene.applied.springs)],
        "motor": [*map(_motor, scene.applied.motors)],
    }
    return {**described, **(_simulated(scene) if scene.simulated else {"rule for redundant forces": scene.rule})}


def _simulated(scene: Scene) -> dict[str, str]:
    """How the scene starts and is integrated, what is followed."""
    names, start = scene.mechanism.independent, scene.start
    place, rates = (
        ", ".join(f"{name} = {number(value)}" for name, value in zip(names, values, strict=True))
        for values in (start.start, start.rates)
    )
    method = start.integration
    return {
        "start": f"t = {number(start.since)} s, {place}",
        "velocities there": rates,
        "integrated by": f"{method.name}, rtol {number(method.rtol)}, atol {number(method.atol)}",
        "observables": ", ".join(f"{item.name} [{item.unit}]" for item in scene.observables),
        REFERENCE: "" if scene.known is None else scene.known.source,
    }


def _inline(value: Any) -> str:
    """A value of a scene file on one line."""
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{key} = {_inline(item)}" for key, item in value.items()) + " }"
    return f"[{', '.join(map(_inline, value))}]" if isinstance(value, list) else f'"{value}"'


def _load(load: Load) -> str:
    point = "its centre of mass" if load.point is None else f"{vector(load.point)} m in its frame"
    named = (("force", load.force, "N"), ("moment", load.torque, "N·m"))
    parts = [f"{name} {vector(values)} {unit}" for name, values, unit in named if np.any(values)]
    return f"on {load.body} at {point}, world axes: {', '.join(parts) or 'none'}"


def _spring(spring: Spring) -> str:
    amounts = f"k = {number(spring.stiffness)}, rest {number(spring.rest)}, c = {number(spring.damping)}"
    if isinstance(spring, JointSpring):
        return f"along {spring.coordinate}: {amounts}"
    first, second = vector(spring.first_point), vector(spring.second_point)
    return f"from {spring.first} {first} to {spring.second} {second}: {amounts}"


def _motor(motor: Motor) -> str:
    powers = ("", " t", *(f" t^{k}" for k in range(2, len(motor.polynomial))))
    terms = [f"{number(c)}{power}" for c, power in zip(motor.polynomial.tolist(), powers, strict=False) if c]
    for omega, cos, sin in motor.harmonics.tolist():
        terms += (f"{number(c)} {name} {number(omega)} t" for c, name in ((cos, "cos"), (sin, "sin")) if c)
    return f"along {motor.coordinate}: {' + '.join(terms) or '0'}"
