"""What a run's report says of springs and motors, and of scenes that are simulated."""

from __future__ import annotations

import numpy as np

from screwgauge.reference.applied import JointSpring, Motor, Spring
from screwgauge.reference.rotations import Array
from screwgauge.report.blocks import Block, Column, Numbers, Paragraph, table
from screwgauge.report.formatting import Row, blank, missing, number, size
from screwgauge.scene.scene import Scene
from screwgauge.scene.setting import Forward, Published
from screwgauge.solution import REFERENCE
from screwgauge.study.comparison import Comparison


def acting(scene: Scene) -> list[tuple[str, str]]:
    """Rows of the scene's table: springs and motors."""
    springs = [("spring and damper", spring_text(spring)) for spring in scene.springs]
    return [*springs, *(("motor", motor_text(motor)) for motor in scene.motors)]


def simulated(scene: Scene, start: Forward) -> list[tuple[str, str]]:
    """Rows of the scene's table: how it starts and is integrated, what is followed."""

    def named(values: Array) -> str:
        names = scene.mechanism.independent
        return ", ".join(f"{name} = {number(value)}" for name, value in zip(names, values, strict=True))

    method = start.method
    return [
        ("start", f"t = {number(start.since)} s, {named(start.start)}"),
        ("velocities there", named(start.rates)),
        ("integrated by", f"{method.name}, rtol {number(method.rtol)}, atol {number(method.atol)}"),
        ("observables", ", ".join(f"{item.name} [{item.unit}]" for item in scene.observables)),
        *([] if scene.known is None else [(REFERENCE, scene.known.source)]),
    ]


def spring_text(spring: Spring) -> str:
    """One spring in words."""
    amounts = f"k = {number(spring.stiffness)}, rest {number(spring.rest)}, c = {number(spring.damping)}"
    if isinstance(spring, JointSpring):
        return f"along {spring.coordinate}: {amounts}"
    points = (spring.first_point, spring.second_point)
    first, second = ("(" + ", ".join(map(number, point)) + ")" for point in points)
    return f"from {spring.first} {first} to {spring.second} {second}: {amounts}"


def motor_text(motor: Motor) -> str:
    """One motor in words."""
    powers = ("", " t", *(f" t^{k}" for k in range(2, len(motor.polynomial))))
    terms = [f"{number(c)}{power}" for c, power in zip(motor.polynomial.tolist(), powers, strict=False) if c]
    for omega, cos, sin in motor.harmonics.tolist():
        waves = (f"{number(c)} {name} {number(omega)} t" for c, name in ((cos, "cos"), (sin, "sin")) if c)
        terms += waves
    return f"along {motor.coordinate}: {' + '.join(terms) or '0'}"


LEAD = """\
Largest errors over the whole motion, in the units of the observables. Times of others were measured on other machines,
and are not comparable beyond their order of magnitude."""
COLUMNS = (
    *(Column("who", "who"), Numbers("observable off by", "observable"), Numbers("energy off by [J]", "energy")),
    *(Numbers("processor time [s]", "cpu", blank(lambda value: number(value, 3))), Column("remark", "remark")),
    Column("source", "source"),
)


def published(results: Comparison) -> list[Block]:
    """Errors and times of this run beside those that others have published; nothing if nobody has."""
    if not results.scene.published:
        return []
    ours = (_ours(results, name) for name in results.solutions if name != REFERENCE)
    return [Paragraph(LEAD), table([*ours, *map(theirs, results.scene.published)], COLUMNS)]


def _ours(results: Comparison, engine: str) -> Row:
    pairs, judged, timings = results.pairs, results.judge, results.solutions[engine].timings
    known = pairs[(pairs["a"] == engine) & (pairs["b"] == REFERENCE)]
    balance = judged[(judged["engine"] == engine) & (judged["residual"] == "energy_balance")]
    errors = [f"{size(row.max_abs)} {row.unit}" for row in known.itertuples() if not missing(row.max_abs)]
    return {
        "who": f"**{engine}**, {timings[0].setting if timings else ''}",
        "observable": ", ".join(errors),
        "energy": size(float(balance["max_abs"].iloc[0])) if len(balance) else "",
        "cpu": next((x.min_s for x in timings if x.stage.endswith("processor time")), None),
        "remark": "",
        "source": "this run",
    }


def theirs(item: Published) -> Row:
    """A published result, its error beside what it measures."""
    off = "" if np.isnan(item.accuracy) else size(item.accuracy)
    return {
        "who": item.who,
        **{measure: off if measure == item.measure else "" for measure in ("observable", "energy")},
        "cpu": item.cpu_s,
        "remark": item.remark,
        "source": item.source,
    }
