"""What the report says of springs, motors and of scenes that are integrated."""

from __future__ import annotations

import numpy as np

from screwgauge.reference.applied import JointSpring, Motor, Spring
from screwgauge.reference.rotations import Array
from screwgauge.report.formatting import markdown_table, missing, number, size
from screwgauge.scene.scene import Scene
from screwgauge.scene.setting import Forward, Published
from screwgauge.solution import REFERENCE
from screwgauge.study.results import Results


def acting(scene: Scene) -> list[tuple[str, str]]:
    """Rows of the scene's table: springs and motors."""
    springs = [("spring and damper", spring_text(spring)) for spring in scene.springs]
    return [*springs, *(("motor", motor_text(motor)) for motor in scene.motors)]


def integrated(scene: Scene, start: Forward) -> list[tuple[str, str]]:
    """Rows of the scene's table: how it starts and is integrated, what is followed."""
    labels = list(scene.mechanism.independent)
    facts = [
        ("start", f"t = {number(start.since)} s, {_named(labels, start.start)}"),
        ("rates there", _named(labels, start.rates)),
        (
            "integrated by",
            f"{start.method.name}, rtol {number(start.method.rtol)}, atol {number(start.method.atol)}",
        ),
        ("observables", ", ".join(f"{item.name} [{item.unit}]" for item in scene.observables)),
    ]
    return [*facts, (REFERENCE, scene.known.source)] if scene.known is not None else facts


def _named(labels: list[str], values: Array) -> str:
    return ", ".join(f"{label} = {number(value)}" for label, value in zip(labels, values, strict=True))


def spring_text(spring: Spring) -> str:
    """One spring in words."""
    amounts = f"k = {number(spring.stiffness)}, rest {number(spring.rest)}, c = {number(spring.damping)}"
    if isinstance(spring, JointSpring):
        return f"along {spring.coordinate}: {amounts}"
    points = (spring.first_point, spring.second_point)
    first, second = ("(" + ", ".join(number(x) for x in point) + ")" for point in points)
    return f"from {spring.first} {first} to {spring.second} {second}: {amounts}"


def motor_text(motor: Motor) -> str:
    """One motor in words."""
    terms = [
        f"{number(c)}" + (f" t^{k}" if k > 1 else " t" if k else "")
        for k, c in enumerate(motor.polynomial.tolist())
        if c
    ]
    for omega, cos, sin in motor.harmonics.tolist():
        terms += [f"{number(cos)} cos {number(omega)} t"] if cos else []
        terms += [f"{number(sin)} sin {number(omega)} t"] if sin else []
    return f"along {motor.coordinate}: {' + '.join(terms) or '0'}"


def published(results: Results) -> str:
    """Errors and times of this run beside those that others have published; empty if nobody has."""
    scene = results.scene
    if not scene.published:
        return ""
    body = [_own(results, name) for name in results.solutions if name != REFERENCE]
    body += [_theirs(item) for item in scene.published]
    head = ["who", "observable off by", "energy off by [J]", "processor time [s]", "remark", "source"]
    lead = (
        "Largest errors over the whole motion, in the units of the observables. Times of others were measured on "
        "other machines, and are not comparable beyond their order of magnitude."
    )
    return f"{lead}\n\n{markdown_table(head, body, (1, 2, 3))}"


def _own(results: Results, engine: str) -> list[str]:
    pairs, judged = results.pairs, results.judge
    known = pairs[(pairs["a"] == engine) & (pairs["b"] == REFERENCE)]
    balance = judged[(judged["engine"] == engine) & (judged["residual"] == "energy_balance")]
    times = [x for x in results.solutions[engine].timings if x.stage.endswith("processor time")]
    errors = [f"{size(row.max_abs)} {row.unit}" for row in known.itertuples() if not missing(row.max_abs)]
    setting = results.solutions[engine].timings[0].setting if results.solutions[engine].timings else ""
    return [
        f"**{engine}**, {setting}",
        ", ".join(errors),
        size(float(balance["max_abs"].iloc[0])) if len(balance) else "",
        number(times[0].min_s, 3) if times else "",
        "",
        "this run",
    ]


def _theirs(item: Published) -> list[str]:
    off = "" if np.isnan(item.accuracy) else size(item.accuracy)
    return [
        item.who,
        off if item.measure == "observable" else "",
        off if item.measure == "energy" else "",
        "" if np.isnan(item.cpu_s) else number(item.cpu_s, 3),
        item.remark,
        item.source,
    ]
