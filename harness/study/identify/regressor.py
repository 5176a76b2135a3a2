"""The regressor: actuator forces of a scene, linear in the moments of its bodies and the resistances of its joints."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np

from screwgauge.engines.screw.matter import ENTRIES, Matter
from screwgauge.engines.screw.nominal import NominalMachine
from screwgauge.quantities import description_names
from screwgauge.reference.closed_motion import ClosedMotion
from screwgauge.reference.equations.forward import preload_space
from screwgauge.reference.errors import DescriptionError, ScrewgaugeError
from screwgauge.reference.parameters import numbers, resisting_joint, resolve
from screwgauge.reference.rotations import Array
from screwgauge.reference.traced.parametric import ClosedSamples
from screwgauge.scene.default import exciting
from screwgauge.scene.scene import RULES, Scene

FORCE = "actuator_force"
#: Number of poses of a motion for which rates are drawn, and number of draws per pose.
POSES, DRAWS = 60, 3
#: Moments of a body: mass, mass times centre of mass, inertia about the body's origin.
MOMENTS = ("mass", "mx", "my", "mz", *(entry.removeprefix("inertia.") for entry in ENTRIES[4:]))


class Regressor:
    """Actuator forces relative to the largest force with the same unit, as a function of numbers of the machine.

    Attributes:
        matter: The unknown numbers.
        values, matrix: Result of `forces` at the poses of the scene. Shapes (n, m), (n, m, n_feature).
        sizes: For each component, the largest nominal force with the same unit [N or N m]. Shape (m,).
        deviations: Prior standard deviation of each resistance. Shape (n_resist,).
    """

    def __init__(self, scene: Scene, patterns: Sequence[str], prior: float, share: float) -> None:
        """Follow the motion of a scene.

        Args:
            patterns: Unknown numbers, see `unknown`.
            prior: Relative standard deviation of an existing resistance.
            share: Prior standard deviation of the force of a resistance that the scene lacks, relative to the largest
                force.

        Raises:
            ScrewgaugeError: The motion cannot be followed, or the forces cannot be computed.
        """
        self.scene = replace(scene, rule=RULES[0])  # minimum-norm forces are linear, too
        self.machine = NominalMachine(self.scene, [FORCE])
        self.matter = Matter(self.machine, unknown(scene, patterns), "llvm")
        motion = scene.motion
        self.poses = self.machine.at(motion.y, motion.yd, motion.ydd, motion.t)
        self.values, self.matrix = self.forces(self.poses)
        units = description_names(scene.mechanism)[FORCE][1]
        peaks = np.abs(self.values).max(axis=0)
        largest = {unit: max(x for x, u in zip(peaks, units, strict=True) if u == unit) for unit in units}
        self.sizes = np.array([largest[unit] or 1.0 for unit in units])
        first, count = self.matter.end, len(self.matter.nominal)
        resist = (self.matrix / self.sizes[:, None])[..., first:count]
        taken = np.abs(resist).max(axis=(0, 1), initial=0.0)
        given = prior * np.abs(self.matter.nominal[first:])
        self.deviations = np.where(given > 0.0, given, share / np.where(taken > 0.0, taken, np.inf))

    def forces(self, poses: ClosedSamples) -> tuple[Array, Array]:
        """Return the forces of `Matter.base`, and their changes per unit feature. Shapes (n, m), (n, m, n_feature)."""
        parts = [(base, matrix) for _, base, matrix in self.matter.parts(poses)]
        return np.concatenate([base for base, _ in parts]), np.concatenate([matrix for _, matrix in parts])

    def without_preload(self, measured: Array) -> Array:
        """Subtract forces of redundant actuators that cancel each other, which no motion determines. Shape (n, m)."""
        loops, poses = self.machine.work.loops, self.poses
        at = ClosedMotion(loops, poses.q, poses.yd, poses.ydd, self.scene.applied, poses.t)
        free = preload_space(at.B)
        return np.asarray(measured - np.einsum("nip,njp,nj->ni", free, free, measured))

    def rows(self, matrix: Array) -> Array:
        """Return changes per unit feature relative to `sizes`, sample by sample. Shapes (n, m, f) -> (n m, f)."""
        return np.asarray((matrix / self.sizes[:, None]).reshape(-1, matrix.shape[-1]))

    @cached_property
    def names(self) -> list[str]:
        """Names of moments and resistances, the columns of `random_effects`."""
        bodies = [f"{body.name}.{moment}" for body in self.matter.bodies for moment in MOMENTS]
        return [*bodies, *(name.removeprefix("joints.") for name in self.matter.resists)]

    def random_effects(self, seed: int) -> Array:
        """Return the effect of a unit of each moment and resistance at poses of the machine with random rates.

        The poses come from the scene and from an exciting motion. Since rates and accelerations are random, numbers
        without effect here have no effect in any motion through these poses. Shape (rows, n_moment + n_resist).
        """
        rng, found, columns = np.random.default_rng(seed), list[Array](), self.scene.mechanism.independent_columns
        for poses in self._all_poses():
            some = poses.q[np.linspace(0, len(poses.q) - 1, min(POSES, len(poses.q))).astype(int)]
            q, k = np.tile(some, (DRAWS, 1)), poses.y.shape[1]
            y = q[:, columns]
            yd, ydd = rng.standard_normal((2, len(q), k)) * self.machine.work.loops.sizes[columns]
            found.append(self.rows(self.forces(ClosedSamples(np.zeros(len(q)), y, yd, ydd, q))[1]))
        matrix, count = np.concatenate(found), len(self.matter.nominal)
        return matrix[:, :count] + matrix[:, count:] @ self._centres

    @property
    def _centres(self) -> Array:
        """Derivatives of the centres of mass of loaded bodies with respect to moments. Shape (n_feature - E, E)."""
        matter, count = self.matter, len(self.matter.nominal)
        bodies, rows = matter.of_bodies(matter.base), list[Array]()
        for i in matter.loaded:
            for axis in range(3):
                row = np.zeros(count)
                row[10 * i], row[10 * i + 1 + axis] = -bodies[i, 1 + axis] / bodies[i, 0], 1.0 / bodies[i, 0]
                rows.append(row)
        return np.reshape(rows, (-1, count))

    def _all_poses(self) -> list[ClosedSamples]:
        """Return the poses of the scene, and poses of an exciting motion if the limits leave room for it."""
        try:
            motion = exciting(self.scene).motion
            return [self.poses, self.machine.at(motion.y, motion.yd, motion.ydd, motion.t)]
        except ScrewgaugeError:
            return [self.poses]


def unknown(scene: Scene, patterns: Sequence[str]) -> list[str]:
    """Return the full names of the unknown numbers.

    Args:
        patterns: Names or patterns; a number of a body stands for all its moments. By default, all bodies with mass and
            the resistances of actuated joints are unknown.

    Raises:
        ScrewgaugeError: A name is unknown, or forces do not depend linearly on the number.
    """
    mechanism, known = scene.mechanism, numbers(scene.mechanism, scene.applied)
    of_body = {f"bodies.{body.name}.{entry}": body.name for body in mechanism.bodies if body.mass for entry in ENTRIES}
    driven = {joint.name for joint in mechanism.actuators}
    if not patterns:
        return [name for name in known if name in of_body or resisting_joint(name) in driven]
    names = resolve(known, patterns, "identify, numbers")
    if other := [name for name in names if not (name in of_body or resisting_joint(name))]:
        what = f"'{other[0]}' belongs neither to a body with mass nor to a rotor, damping or friction"
        raise DescriptionError(what, "identify, numbers", "omit it: forces are not linear in it")
    bodies = {of_body[name] for name in names if name in of_body}
    return [name for name in known if name in names or of_body.get(name) in bodies]
