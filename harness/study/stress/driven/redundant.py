"""Redundant constraints: planar four-bars in a row, their loops closed by points and, wrongly, by whole frames."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from screwgauge.models.fourbars import four_bars
from screwgauge.reference.rotations import Array
from screwgauge.study.stress.case import Case, Finding, Rung

if TYPE_CHECKING:
    from screwgauge.study.bench.case import Case as Bench

ENGINES = ("screw", "pinocchio", "mujoco")
#: Regular poses (they are singular at crank = pi/2), at speed.
SCENE = """\
mechanism = "mechanism.toml"
gravity = [0, -9.81, 0]
[motion.crank]
polynomial = [0.3, -5, 4]
[time]
times = [0, 0.05, 0.1]
"""
_FORWARD = "joint_acceleration"


def redundant_constraints() -> Case:
    """More and more loops, three redundant constraints each."""
    return Case(
        name="redundant-constraints",
        title="Redundant constraints in planar loops",
        axis="number of loops [1]",
        about=(
            "Four-bars in a row, every hinge a full R joint: three constraints too many in every loop, one freedom in "
            "all. Generalised force and those reactions that are unique, by inverse dynamics; accelerations from "
            "the true torque at the crank, with the loops closed by points on the hinge's axis (3D, connect) and by "
            "whole frames (6D, weld), which locks the hinge that was cut. In a plane the forces in the plane stay "
            "unique; forces across it and moments in it depend on how the parts were forced together."
        ),
        drawn=_FORWARD,
        low=1.0,
        high=40.0,
        whole=True,
        full=(1.0, 2.0, 3.0, 4.0, 6.0, 8.0, 12.0, 16.0),
        quick=(1.0, 2.0, 3.0, 4.0, 6.0, 8.0),
        rung=lambda n, quick: Rung(n, lambda: climb(int(n))),
    )


@dataclass(frozen=True, slots=True)
class Open:
    """Which reactions redundant constraints leave open."""

    unique: tuple[str, ...]
    words: str


def climb(n: int) -> Iterator[Finding]:
    """All engines on n loops."""
    from screwgauge.scene.read import load_scene
    from screwgauge.study.bench.case import make_case

    with tempfile.TemporaryDirectory(prefix="screwgauge-") as name:
        folder = Path(name)
        (folder / "mechanism.toml").write_text(four_bars(n, driven=True), encoding="utf-8")
        (folder / "scene.toml").write_text(SCENE, encoding="utf-8")
        case = make_case(load_scene(folder / "scene.toml"), folder / "models", samples=3, quick=True)
        yield from _inverse(case)
        yield from _forward(case)


def _inverse(case: Bench) -> Iterator[Finding]:
    """Forces from the motion, only the unique ones of the reactions."""
    from screwgauge.judging.compare import reference_scale
    from screwgauge.quantities import natural_scales
    from screwgauge.study.bench.case import pick
    from screwgauge.study.bench.reference import reference_values
    from screwgauge.study.run import solve

    quantities = ("generalized_force", "reaction")
    right = reference_values(case.scene, case.times, quantities).values
    open_ = _open(case)
    solutions, failures = solve(case.scene, ENGINES, quantities)
    natural = natural_scales(case.scene.mechanism)
    for engine in ENGINES:
        for quantity in quantities:
            if engine in failures:
                yield Finding(engine, quantity, reason=failures[engine].reason)
                continue
            found = solutions[engine]
            names = open_.unique if quantity == "reaction" else right[quantity].components
            mine, theirs = pick(found.values[quantity], names), pick(right[quantity], names)
            scale = np.array([reference_scale(theirs, unit, natural[unit]) for unit in theirs.units])
            yield Finding(
                engine,
                quantity,
                float((np.abs(mine.array - theirs.array) / scale).max()),
                condition=float(found.condition.max()),
                time_s=sum(timing.min_s for timing in found.timings),
                reason=open_.words if quantity == "reaction" else "",
            )


def _open(case: Bench) -> Open:
    from screwgauge.reference.kinematics import positions
    from screwgauge.reference.mobility import mobility
    from screwgauge.reference.pose import layout

    lay = layout(case.scene.mechanism)
    found = mobility(lay, positions(lay, case.scene.motion.y[:1], case.times[:1]))
    reactions = found.names[: found.constraints]
    unique = tuple(name for name, flag in zip(reactions, found.unique, strict=False) if flag)
    kinds = [sorted({name.split(".")[1] for name in group}) for group in (unique, {*reactions} - {*unique})]
    return Open(
        unique,
        f"unique and compared: {', '.join(kinds[0])}; not unique, left out: {', '.join(kinds[1])} "
        f"({found.overconstraints} redundant constraints)",
    )


def _forward(case: Bench) -> Iterator[Finding]:
    """Accelerations from the true torque at the crank, loops closed in two ways."""
    from screwgauge.study.stress.driven import redundant_mujoco, redundant_pinocchio
    from screwgauge.study.stress.driven.loaded import screw

    own = screw(case)
    yield own
    for way in (redundant_pinocchio.points, redundant_pinocchio.frames):
        yield way(case)
    for way in (redundant_mujoco.connects, redundant_mujoco.welds):
        yield way(case)


def locked(J: Array, mobility: int = 1) -> str:
    """Why a closure is wrong: freedoms that it leaves, by rank, against those that there are; empty if it is not."""
    from screwgauge.reference import linear

    left = J.shape[1] - linear.rank(J)
    if left == mobility:
        return ""
    return f"a closure by whole frames locks the hinge: rank leaves {left} freedoms of {mobility}, which nothing says"
