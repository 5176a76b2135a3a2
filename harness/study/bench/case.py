"""What all contestants of a bench share: the scene at the compared times, model files, reference values."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from screwgauge.engines.registry import GENERATED
from screwgauge.judging.compare import reference_scale
from screwgauge.models.generate import stem, write_models
from screwgauge.problem import Motion, OldProblem
from screwgauge.quantities import natural_scales
from screwgauge.reference.errors import DescriptionError
from screwgauge.reference.rotations import Array
from screwgauge.scene.scene import Scene
from screwgauge.solution import Values
from screwgauge.study.bench.contestant import QUANTITIES, Outcome
from screwgauge.study.bench.reference import Reference, reference_values

T = TypeVar("T")


@dataclass(frozen=True, eq=False)
class Case:
    """A scene prepared for contestants.

    Attributes:
        whole: The scene with its own times.
        scene: The same at the compared times, rule ``min_norm``.
        folder: Where the generated model files are.
        scales: Quantity -> unit -> S of the scaled error.
        quick: A reduced bench.
    """

    whole: Scene
    scene: Scene
    folder: Path
    reference: Reference
    scales: Mapping[str, Mapping[str, float]]
    quick: bool
    _kept: dict[object, Any] = field(default_factory=dict)

    @property
    def times(self) -> Array:
        """Compared times [s]. Shape (n,)."""
        return self.scene.motion.t

    def share(self, key: object, make: Callable[[], T]) -> T:
        """What several contestants need and none changes; made once."""
        if key not in self._kept:
            self._kept[key] = make()
        found: T = self._kept[key]
        return found

    def problem(self, engine: str, quantities: tuple[str, ...], motion: Motion | None = None) -> OldProblem:
        """The problem that an engine is given, on the compared times unless a motion says otherwise."""
        model, loops = self.scene.mechanism_file, None
        if engine in GENERATED:
            cut, ending = GENERATED[engine]
            name = stem(self.scene.mechanism.name, cut)
            model, loops = self.folder / f"{name}{ending}", self.folder / f"{name}.loops.toml"
        return OldProblem(
            model=model,
            loops=loops,
            gravity=self.scene.gravity,
            loads=self.scene.loads,
            rule="min_norm",
            motion=self.scene.motion if motion is None else motion,
            quantities=frozenset(quantities),
        )

    def given(self, coordinates: tuple[str, ...]) -> tuple[Array, Array, Array]:
        """True joint positions, rates and accelerations of some coordinates. Shape (n, n_coordinate) each."""
        q, v, a = (self.some(name, coordinates).array for name in QUANTITIES[:3])
        return q, v, a

    def some(self, quantity: str, components: tuple[str, ...]) -> Values:
        """Reference values of some components, in the order given."""
        return pick(self.reference.values[quantity], components)

    def outcome(self, quantity: str, array: Array, components: tuple[str, ...] | None = None) -> Outcome:
        """An outcome at the compared times with the names and units of the reference."""
        like = self.reference.values[quantity]
        if components is not None:
            like = pick(like, components)
        return Outcome(Values(like.components, like.units, np.asarray(array, dtype=float)))


def pick(values: Values, components: tuple[str, ...]) -> Values:
    """Some components of a quantity, in the order given."""
    columns = [values.components.index(name) for name in components]
    return Values(components, tuple(values.units[i] for i in columns), values.array[:, columns].copy())


def compared_rows(n: int, most: int) -> Array:
    """Rows of `n` samples that are compared: at most `most`, evenly spread, both ends among them."""
    return np.unique(np.linspace(0, n - 1, min(n, most)).round().astype(int))


def scales_of(scene: Scene, reference: Reference) -> dict[str, dict[str, float]]:
    """S by quantity and unit."""
    natural = natural_scales(scene.mechanism)
    return {
        name: {unit: reference_scale(values, unit, natural[unit]) for unit in dict.fromkeys(values.units)}
        for name, values in reference.values.items()
    }


def make_case(scene: Scene, folder: Path, *, samples: int, quick: bool) -> Case:
    """Writes the model files and computes the reference values.

    Args:
        folder: For the model files.
        samples: Compared times, at most.
    """
    if scene.springs or scene.motors:
        raise DescriptionError(
            "the bench of a given motion knows no springs and no motors",
            scene.name,
            "remove them, or add [forward]",
        )
    whole = replace(scene, rule="min_norm", models={})
    here = whole.at(whole.motion.t[compared_rows(len(whole.motion), samples)])
    write_models(scene.mechanism, folder, gravity=scene.gravity)
    reference = reference_values(whole, here.motion.t, QUANTITIES)
    return Case(whole, here, folder, reference, scales_of(here, reference), quick)
