"""What a run's report says of springs and motors, and of scenes that are simulated."""

from __future__ import annotations

from screwgauge.problem import InitialValue
from screwgauge.reference.applied import JointSpring, Motor, Spring
from screwgauge.reference.rotations import Array
from screwgauge.report.blocks import Table, table
from screwgauge.report.formatting import Row, missing, number, rows, size, vector
from screwgauge.scene.observables import Published
from screwgauge.scene.scene import Scene
from screwgauge.solution import REFERENCE
from screwgauge.study.comparison import Comparison


def acting(scene: Scene) -> dict[str, list[str]]:
    """Springs and motors in words."""
    springs, motors = map(spring_text, scene.applied.springs), map(motor_text, scene.applied.motors)
    return {"spring and damper": list(springs), "motor": list(motors)}


def simulated(scene: Scene, start: InitialValue) -> dict[str, str]:
    """How the scene starts and is integrated, what is followed."""

    def named(values: Array) -> str:
        names = scene.mechanism.independent
        return ", ".join(f"{name} = {number(value)}" for name, value in zip(names, values, strict=True))

    method = start.integration
    return {
        "start": f"t = {number(start.since)} s, {named(start.start)}",
        "velocities there": named(start.rates),
        "integrated by": f"{method.name}, rtol {number(method.rtol)}, atol {number(method.atol)}",
        "observables": ", ".join(f"{item.name} [{item.unit}]" for item in scene.observables),
        REFERENCE: "" if scene.known is None else scene.known.source,
    }


def spring_text(spring: Spring) -> str:
    """One spring in words."""
    amounts = f"k = {number(spring.stiffness)}, rest {number(spring.rest)}, c = {number(spring.damping)}"
    if isinstance(spring, JointSpring):
        return f"along {spring.coordinate}: {amounts}"
    first, second = vector(spring.first_point), vector(spring.second_point)
    return f"from {spring.first} {first} to {spring.second} {second}: {amounts}"


def motor_text(motor: Motor) -> str:
    """One motor in words."""
    powers = ("", " t", *(f" t^{k}" for k in range(2, len(motor.polynomial))))
    terms = [f"{number(c)}{power}" for c, power in zip(motor.polynomial.tolist(), powers, strict=False) if c]
    for omega, cos, sin in motor.harmonics.tolist():
        waves = (f"{number(c)} {name} {number(omega)} t" for c, name in ((cos, "cos"), (sin, "sin")) if c)
        terms += waves
    return f"along {motor.coordinate}: {' + '.join(terms) or '0'}"


SHOWN = (
    "who | observable off by = observable | energy off by [J] = energy | processor time [s] = cpu_s | remark | source"
)


def published(results: Comparison) -> Table | None:
    """Errors and times of this run beside those that others have published."""
    ours = (_ours(results, name) for name in results.solutions if name != REFERENCE)
    theirs_ = map(theirs, results.scene.published)
    return table([*ours, *theirs_], SHOWN) if results.scene.published else None


def _ours(results: Comparison, engine: str) -> Row:
    pairs, judged, solution = results.pairs, results.judge, results.solutions[engine]
    known = rows(pairs[(pairs["a"] == engine) & (pairs["b"] == REFERENCE)].dropna(subset="max_abs"))
    balance = judged[(judged["engine"] == engine) & (judged["residual"] == "energy_balance")]
    return {
        "who": f"**{engine}**, {solution.setting}",
        "observable": ", ".join(f"{size(row['max_abs'])} {row['unit']}" for row in known),
        "energy": "".join(map(size, balance["max_abs"])),
        "cpu_s": None if solution.cost is None else solution.cost.cpu_s,
        "remark": "",
        "source": "this run",
    }


def theirs(item: Published) -> Row:
    """A published result, its error beside what it measures."""
    off = "" if missing(item.accuracy) else size(item.accuracy)
    errors = {measure: off if measure == item.measure else "" for measure in ("observable", "energy")}
    cpu_s = None if missing(item.cpu_s) else item.cpu_s
    return {"who": item.who, **errors, "cpu_s": cpu_s, "remark": item.remark, "source": item.source}
