"""Reference values for measuring the errors of methods, and preparation of scenes with a given motion.

Reference values come from the engine ``truth`` if it is installed, otherwise from ``screw``; a note states
the source.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from screwgauge.judging.compare import reference_scale
from screwgauge.judging.residual import SizedResidual
from screwgauge.problem import GivenMotion, ModelFiles, Problem, Rows, States, Task, spread
from screwgauge.quantities import natural_scales
from screwgauge.reference.applied import Applied
from screwgauge.reference.graph import spanning_tree
from screwgauge.reference.mechanism import Mechanism, driven_coordinates
from screwgauge.reference.rotations import Array
from screwgauge.scene.scene import Scene
from screwgauge.solution import TRUTH, Failure, Values
from screwgauge.study.fixed import with_fixed
from screwgauge.study.run import run
from screwgauge.study.solving import model_files, write_scene_models
from screwgauge.witness.joints import mechanism_tree
from screwgauge.witness.kinematics import move
from screwgauge.witness.tree import TreeStates, stack_frames

STANDIN = "screw"
_NOTES = {
    TRUTH: "Errors are measured against the engine truth: ball arithmetic with a rigorous radius.",
    STANDIN: f"Errors are measured against the engine {STANDIN} in double precision, not against a truth ({{reason}}): "
    "errors below 1e-12 are meaningless, and contestants that share its code look better than they are.",
}
MOST = 200  # largest number of times solved at once


@dataclass(frozen=True, slots=True, eq=False)
class Reference:
    """Values against which errors are measured.

    Attributes:
        engine: Source of the values.
        note: Sentence for the report.
        scales: Quantity -> unit -> scale of the scaled error.
    """

    engine: str
    values: Mapping[str, Values]
    note: str
    scales: Mapping[str, Mapping[str, float]]

    @classmethod
    def by_size(cls, engine: str, mechanism: Mechanism, values: Mapping[str, Values], note: str = "") -> Reference:
        """Build a reference that scales errors by its largest values, or by a natural scale if these vanish."""
        natural = natural_scales(mechanism)
        scales = {
            name: {unit: reference_scale(has, unit, natural[unit]) for unit in dict.fromkeys(has.units)}
            for name, has in values.items()
        }
        return cls(engine, values, note, scales)

    def score(self, quantity: str, values: Values, rows: slice | Rows = slice(None)) -> SizedResidual:
        """Return the error of given components of a quantity at given samples of the reference."""
        right = self.values[quantity].pick(values.components).at(rows)
        return score(quantity, deviation(values, right), self.scales[quantity])


def deviation(values: Values, right: Values) -> Values:
    """Return the errors at the samples for which the reference has a value.

    Args:
        right: Reference values for the same samples and components.
    """
    known = np.isfinite(right.array).all(axis=1)
    return Values(values.components, values.units, (values.array - right.array)[known])


def score(quantity: str, off: Values, scales: Mapping[str, float]) -> SizedResidual:
    """Return the largest and RMS scaled errors over all samples and components; NaN if any error is not finite.

    Args:
        off: See `deviation`.
        scales: Unit -> scale.
    """
    error = np.abs(off.array) / np.array([scales[unit] for unit in off.units])
    lost = int((~np.isfinite(error)).any(axis=1).sum())
    if lost or not error.size:
        return SizedResidual(quantity, reason=f"not a number at {lost} of {len(error)} samples")
    most = float(error.max())
    return SizedResidual(quantity, error=most, max_abs=most, rms=float(np.sqrt(np.mean(error**2))), scale=1.0)


def sizes(values: Values) -> dict[str, float]:
    """Return the largest magnitude for each unit; empty without values."""
    if not values.array.size:
        return {}
    size = np.abs(values.array).max(axis=0)
    return {unit: float(size[[u == unit for u in values.units]].max()) for unit in dict.fromkeys(values.units)}


def reference_values(scene: Scene, times: Array, quantities: Iterable[str]) -> Reference:
    """Compute reference values of a scene at given times, without its model files.

    Args:
        times: Times [s]. Shape (n,).
        quantities: Names of quantities.

    Raises:
        ScrewgaugeError: The scene cannot be solved.
    """
    names, reason, scene = tuple(quantities), "", replace(scene, models={})
    for engine, note in _NOTES.items():
        values = _solve(scene, times, names, engine)
        if not isinstance(values, Failure):
            return Reference.by_size(engine, scene.mechanism, values, note.format(reason=reason))
        reason = values.reason
    raise RuntimeError(f"no reference values: {reason}")


def _solve(scene: Scene, times: Array, quantities: tuple[str, ...], engine: str) -> dict[str, Values] | Failure:
    parts = []
    for first in range(0, len(times), MOST):
        results = run(scene.at(times[first : first + MOST]), engines=(engine,), quantities=quantities)
        if engine in results.failures:
            return results.failures[engine]
        parts.append(results.solutions[engine].values)
    return with_fixed(scene.mechanism, {name: join_samples(part[name] for part in parts) for name in parts[0]})


def join_samples(parts: Iterable[Values]) -> Values:
    """Concatenate the samples of a quantity."""
    values = list(parts)
    return Values(values[0].components, values[0].units, np.concatenate([part.array for part in values]))


#: Measured quantities of given motions, in order.
QUANTITIES = ("joint_position", "joint_velocity", "joint_acceleration", "actuator_force")


@dataclass(frozen=True, slots=True, eq=False)
class PreparedScene:
    """Scene prepared for methods.

    Attributes:
        whole: The scene at its own times, with the rule ``min_norm``.
        scene: The same scene at the times of comparison.
        folder: Folder of the generated model files.
    """

    whole: Scene
    scene: Scene
    folder: Path
    reference: Reference

    @property
    def t(self) -> Array:
        """Times of comparison [s]. Shape (n,)."""
        return self.scene.t

    def files(self, engine: str) -> ModelFiles:
        """Return the generated model files of an engine."""
        return model_files(self.scene, engine, self.folder)

    def list_files(self) -> list[Path]:
        """Return all files in the folder of the scene."""
        return [path for path in self.folder.rglob("*") if path.is_file()]

    def problem(self, *wanted: str, task: Task | None = None) -> Problem:
        """Return the problem of the scene, optionally with a different task."""
        return Problem(self.scene.applied, self.scene.task if task is None else task, frozenset(wanted))

    def states(self, coordinates: tuple[str, ...]) -> States:
        """Return the true motion of given joint coordinates."""
        q, v, a = (self.reference.values[name].pick(coordinates).array for name in QUANTITIES[:3])
        return States(coordinates, q, v, a=a)

    def acceleration_problem(self, coordinates: tuple[str, ...]) -> Problem:
        """Return the problem of computing the accelerations at the true states of a tree under the true forces."""
        q, force = (self.reference.values[name].array for name in ("joint_position", "actuator_force"))
        return acceleration_problem(self.scene.mechanism, self.scene.applied, self.states(coordinates), q, force)


def acceleration_problem(mechanism: Mechanism, applied: Applied, states: States, q: Array, force: Array) -> Problem:
    """Return the problem of computing the accelerations of a tree under actuator forces and loads.

    Loads are included in the forces along the coordinates, so that engines need not transform them.

    Args:
        q: All joint coordinates, see `along_tree`. Shape (n, n_q).
        force: Actuator forces. Shape (n, n_actuator).
    """
    names = states.coordinates
    tau = along_tree(mechanism, names, q, applied)
    tau[:, [names.index(name) for name in driven_coordinates(mechanism.joints)]] += force
    task = States(names, states.q, states.v, tau=tau)
    return Problem(Applied(gravity=applied.g), task, frozenset(("joint_acceleration",)))


def along_tree(mechanism: Mechanism, coordinates: tuple[str, ...], q: Array, applied: Applied) -> Array:
    """Convert loads to forces along coordinates of the spanning tree, using the bodies that each coordinate moves.

    Args:
        q: All joint coordinates; coordinates of cut joints move no body. Shape (n, n_q).

    Returns:
        Forces along the coordinates. Shape (n, n_coordinate).
    """
    out = np.zeros((len(q), len(coordinates)))
    if not applied.loads:
        return out
    tree, still = mechanism_tree(mechanism, spanning_tree(mechanism)), np.zeros_like(q)
    motion, columns = move(tree, TreeStates(q, still, still)), mechanism.columns(coordinates)
    for load in applied.loads:
        point = mechanism.body(load.body).com if load.point is None else load.point
        at = stack_frames([tree.body_frames[load.body].place(np.eye(3), point)])
        J = motion.jacobian(at, motion.links.frames(at).p)[:, 0][..., columns]
        out += load.torque @ J[:, :3] + load.force @ J[:, 3:]
    return out


def pose_scene(scene: Scene, folder: Path, *, samples: int) -> PreparedScene:
    """Write the model files and compute the reference values.

    Args:
        folder: Folder for the model files.
        samples: Largest number of times at which methods are compared.

    Raises:
        ScrewgaugeError: The scene cannot be solved.
    """
    whole = replace(scene, rule="min_norm", models={})
    motion: GivenMotion = whole.motion
    compared = whole.at(motion.t[spread(len(motion), samples)])
    write_scene_models(scene, folder)
    return PreparedScene(whole, compared, folder, reference_values(whole, compared.t, QUANTITIES))
