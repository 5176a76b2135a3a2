"""Writes a ``robot.yaml``: frames of a URDF that coincide, and its motors, as public parallel robots say them."""

from __future__ import annotations

import json
from collections.abc import Sequence

from screwgauge.models.layout import Closure, lay_out
from screwgauge.reference.mechanism import Frame, Mechanism

#: Part of model files that brings it, see `screwgauge.models.generate`.
PART = "yaml"


def closure_frames(closure: Closure) -> list[tuple[tuple[str, str, Frame], tuple[str, str, Frame]]]:
    """Pairs of frames that coincide: name, link that it is fixed to, placement there. Two of an R joint's axis."""
    sides = (closure.parent, "parent"), (closure.child, "child")
    if closure.type == "weld":
        frames = [[closure.parent_frame], [closure.child_frame]]
    else:
        frames = [[Frame(p) for p in points] for points in (closure.parent_points, closure.child_points)]
    numbers = [""] if len(frames[0]) == 1 else ["1", "2"]
    named = [
        [(f"{closure.joint}@{side}{number}", link, frame) for number, frame in zip(numbers, placed, strict=True)]
        for (link, side), placed in zip(sides, frames, strict=True)
    ]
    return list(zip(*named, strict=True))


def write_loops_yaml(mechanism: Mechanism, cut: str) -> str:
    """The loops and motors of a cut mechanism; its URDF has the frames as links, see `closure_frames`."""
    pairs, types = list[list[str]](), list[str]()
    for closure in lay_out(mechanism, cut).closures:
        for first, second in closure_frames(closure):
            pairs.append([first[0], second[0]])
            types.append("6d" if closure.type == "weld" else "3d")
    motors = [joint.coordinates[0] for joint in mechanism.actuators]
    lines = ["# Written by screwgauge models.", f"closed_loop: {_flow(pairs)}", f"type: {_flow(types)}"]
    return "\n".join([*lines, f"name_mot: {_flow(motors)}"]) + "\n"


def _flow(value: Sequence[object]) -> str:
    """A list in YAML, of which JSON is a part."""
    return json.dumps(value, ensure_ascii=False)
