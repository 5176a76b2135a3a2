"""Identification: scenes whose numbers are another's, and what an engine of another kind measures of them."""

from collections.abc import Sequence

import numpy as np

from screwgauge.engines.screw.matter import moments, numbers_of
from screwgauge.judging.answer import largest
from screwgauge.reference.parameters import resisting_joint
from screwgauge.scene.observables import Recorded
from screwgauge.scene.scene import Scene
from screwgauge.study.identify.directions import structure
from screwgauge.study.identify.estimate import Unknowns
from screwgauge.study.identify.regressor import Regressor, unknown
from screwgauge.study.identify.run import PRIOR, SHARE, identify
from screwgauge.study.run import run
from support.geometry import Array

FORCE = "actuator_force"
__all__ = ["FORCE", "PRIOR", "Recorded", "Regressor", "identify", "largest", "structure", "unknown"]


def regressor(scene: Scene, numbers: Sequence[str] = ()) -> Regressor:
    return Regressor(scene, numbers, PRIOR, SHARE)


def drawn(scene: Scene, rng: np.random.Generator) -> tuple[list[str], Array]:
    known = regressor(scene)
    unknowns = Unknowns(known, PRIOR)
    values = unknowns.numbers(rng.standard_normal((unknowns.count, 1)))[0]
    resists = np.array([bool(resisting_joint(name)) for name in known.matter.entries])
    return known.matter.entries, np.where(resists, np.abs(values), values)


def moved(scene: Scene, known: Regressor, moment: Array) -> Scene:
    matter = known.matter
    bodies = numbers_of(moments(matter.of_bodies(matter.nominal)) + matter.of_bodies(moment))
    first = 10 * len(matter.bodies)
    values = np.concatenate([bodies.ravel(), matter.nominal[first:] + moment[first:]])
    return scene.with_(dict(zip(matter.entries, values.tolist(), strict=True)))


def forces(scene: Scene, engine: str = "pinocchio") -> tuple[tuple[str, ...], Array]:
    """Actuator forces by an engine that shares no mechanics with the regressor. Shape (n, m)."""
    values = run(scene, [engine], [FORCE]).solutions[engine].values[FORCE]
    return values.components, values.array


def log(scene: Scene, noise: float, rng: np.random.Generator, engine: str = "pinocchio") -> Recorded:
    """What a noisy sensor records."""
    names, values = forces(scene, engine)
    noisy = values + noise * largest(values) * rng.standard_normal(values.shape)
    return Recorded(scene.t, {f"{FORCE}/{name}": noisy[:, i] for i, name in enumerate(names)})
