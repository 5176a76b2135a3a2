"""Ladders of what the bodies are made of: ratio of masses, size of the whole, shape of the inertia."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from screwgauge.study.stress.case import Case, Finding, Rung
from screwgauge.study.stress.inverse.measure import measure, still
from screwgauge.study.stress.inverse.states import (
    ACCELERATIONS,
    POSES,
    RATES,
    Tables,
    all_of,
    changed,
    decades,
    each,
    exactly,
    samples,
    times,
)

#: Moments of the platform as a plate and of a leg half as a rod [kg m^2], about those of the paper.
PLATE, ROD = 0.46, 1.16e-2


def mass_ratio() -> Case:
    """Legs against the platform, from feathers to anvils."""
    return Case(
        name="mass-ratio",
        title="Mass of the legs against the platform's",
        axis="mass ratio, 1 = paper",
        about="Mass and inertia of all leg halves times the ratio: below 1 the platform is the heavier, above 1 the "
        "legs are. Gravity and rates of 10 rad/s, no load.",
        drawn="actuator_force",
        low=1e-12,
        high=1e12,
        full=decades(-6, 6),
        quick=decades(-6, 6, 2),
        rung=_rung(_heavier_legs),
    )


def scale() -> Case:
    """The mechanism from the size of a grain to that of a hill."""
    return Case(
        name="scale",
        title="Size of the whole mechanism",
        axis="scale of lengths, 1 = paper",
        about="Lengths times s, masses times s^3, inertias times s^5, the same angles, rates and gravity.",
        drawn="actuator_force",
        low=1e-3,
        high=1e3,
        full=decades(-3, 3),
        quick=decades(-3, 3),
        rung=_rung(_larger),
    )


def inertia_anisotropy() -> Case:
    """Legs as needles and the platform as a plate, up to the bound of what a body can be."""
    return Case(
        name="inertia-anisotropy",
        title="Needles for legs, a plate for the platform",
        axis="slenderness e [1]",
        about="Leg halves have the principal moments J (1, 1, e), the platform I (1 + e, 1, 2): both reach the "
        "bound of the triangle inequality as e vanishes. Their axes are turned against the bodies' frames, so that "
        "an engine that diagonalises the tensor has to find a small moment beside a large one.",
        drawn="actuator_force",
        low=1e-18,
        high=1.0,
        full=decades(0, -16),
        quick=decades(0, -15, 3),
        rung=_rung(_slender),
        falling=True,
    )


def _rung(change: Callable[[float], Callable[[Tables], None]]) -> Callable[[float, bool], Rung]:
    """Rungs whose severity changes the description."""

    def rung(severity: float, quick: bool) -> Rung:
        def found() -> Iterator[Finding]:
            with changed(change(severity)) as scene:
                y, yd, ydd = (samples(array, quick) for array in (POSES, RATES, ACCELERATIONS))
                yield from measure(still(scene, y, yd, ydd))

        return Rung(severity, found)

    return rung


def _heavier_legs(ratio: float) -> Callable[[Tables], None]:
    def change(tables: Tables) -> None:
        for name, body in tables["bodies"].items():
            if name.startswith("leg"):
                body["mass"] = times(body["mass"], ratio)
                body["inertia"] = each(body["inertia"], ratio)

    return change


def _larger(s: float) -> Callable[[Tables], None]:
    def change(tables: Tables) -> None:
        for body in tables["bodies"].values():
            body["mass"] = times(body["mass"], s**3)
            body["com"] = all_of(body["com"], s)
            body["inertia"] = each(body["inertia"], s**5)
        for joint in tables["joints"].values():
            for frame in (joint[key] for key in ("parent_frame", "child_frame") if key in joint):
                frame["position"] = all_of(frame["position"], s)
            if joint["kind"] == "P":
                joint["home"] = all_of(joint["home"], s)

    return change


def _slender(e: float) -> Callable[[Tables], None]:
    def change(tables: Tables) -> None:
        for name, body in tables["bodies"].items():
            if name.startswith("leg"):
                moments, axis = (ROD, ROD, ROD * e), ["3/7", "2/7", "-6/7"]
            else:
                moments, axis = (PLATE * (1.0 + e), PLATE, 2.0 * PLATE), ["6/7", "2/7", "3/7"]
            body["inertia"] = {key: exactly(x) for key, x in zip(("xx", "yy", "zz"), moments, strict=True)}
            body["inertia_rotation"] = {"axis": axis, "angle": "0.4"}

    return change
