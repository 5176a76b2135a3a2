"""Identification: which numbers of a machine can be determined from its forces, and their estimates."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from screwgauge.environment import environment
from screwgauge.problem import Report, silent
from screwgauge.quantities import description_names
from screwgauge.reference.errors import DescriptionError
from screwgauge.reference.mechanism import Mechanism
from screwgauge.reference.parameters import mechanism_with
from screwgauge.reference.rotations import Array
from screwgauge.reference.traced.parametric import ClosedSamples
from screwgauge.scene.motion import read_drive
from screwgauge.scene.observables import Recorded, read_recorded
from screwgauge.scene.scene import Scene
from screwgauge.study.identify.directions import Structure, structure
from screwgauge.study.identify.estimate import NOISE, Fit, Unknowns, count_determined, expected_deviations, fit_samples
from screwgauge.study.identify.regressor import FORCE, Regressor
from screwgauge.study.tables import answer_of_table

DATA = "data"
#: Smallest number of samples in a table: some are fitted, and some predicted.
FEWEST = 4
#: Default prior relative to the size of a number, and prior force of a resistance that the scene lacks, relative to the
#: largest force.
PRIOR, SHARE = 0.1, 0.05
#: Ratio of posterior to prior standard deviation below which a number counts as determined.
TOLD = 0.5
#: Speed of a faster motion, relative to that of the scene.
FASTER = 2.0


@dataclass(frozen=True, slots=True, eq=False)
class Identification:
    """Information that a scene provides about the numbers of its machine.

    Attributes:
        names: Full names of the E unknown numbers.
        nominal, prior: Values in the scene, and prior standard deviations. Shape (E,).
        expected: Standard deviations after this motion, if forces have this `noise`. Shape (E,).
        structure: Combinations of numbers that any motion can determine.
        determined, faster: Number of combinations that this motion determines better than the prior, at its own speed
            and at `FASTER` times that speed.
        size: Prior standard deviation of a body.
        fit: Estimates from the measured forces; None without data.
    """

    scene: Scene
    names: Sequence[str]
    nominal: Array
    prior: Array
    expected: Array
    structure: Structure
    determined: int
    faster: int
    noise: float
    size: float
    fit: Fit | None = None
    data: Path | None = None
    environment: Mapping[str, Any] = field(default_factory=environment)

    @property
    def exit_status(self) -> int:
        return 0 if self.fit is None or self.fit.explains else 1

    @property
    def after(self) -> Array:
        """Standard deviations of the estimate if there is an estimate, otherwise after this motion. Shape (E,)."""
        return self.expected if self.fit is None else self.fit.deviations

    @property
    def known(self) -> NDArray[np.bool_]:
        """True for the numbers that are determined. Shape (E,)."""
        return np.asarray(self.after < TOLD * self.prior)

    @property
    def mechanism(self) -> Mechanism:
        """The mechanism with the most likely numbers.

        Raises:
            DescriptionError: No forces were measured.
        """
        if self.fit is None:
            raise DescriptionError("there are no measured forces", "identify", "pass a file of forces with --data")
        values = dict(zip(self.names, self.fit.values.tolist(), strict=True))
        return mechanism_with(self.scene.mechanism, values)


def identify(
    scene: Scene,
    data: Path | Recorded | None = None,
    *,
    numbers: Sequence[str] = (),
    noise: float | None = None,
    prior: float = PRIOR,
    seed: int = 0,
    progress: Report = silent,
) -> Identification:
    """Determine which numbers of a machine a motion identifies, and estimate them from measured actuator forces.

    Args:
        data: Table of times and actuator forces, and of the motion if it differs from the scene's motion.
        numbers: Names or patterns of the unknown numbers, see `unknown`.
        noise: Standard deviation of measured forces, relative to the largest force with the same unit; estimated from
            data by default.
        prior: Prior standard deviation of a body and of the resistances of its joints.
        seed: Seed of the random rates.

    Raises:
        ScrewgaugeError: The input is invalid, or the motion cannot be followed.
    """
    for value, name in ((noise, "noise"), (prior, "prior")):
        if value is not None and not 0.0 < value < 1.0:
            raise DescriptionError(f"{value} is out of range", f"identify, {name}", "choose a number between 0 and 1")
    if scene.simulated:
        raise DescriptionError("a simulated scene has no given motion", "identify", "add a [motion]")
    table = read_recorded(data) if isinstance(data, Path) else data
    scene = scene if table is None else _scene_of_table(scene, table)
    progress("motion", 0.0)
    regressor = Regressor(scene, numbers, prior, SHARE)
    unknowns, matrix = Unknowns(regressor, prior), regressor.rows(regressor.matrix)
    progress("any motion", 0.3)
    any_motion = structure(regressor, seed)
    fit = None
    if table is not None:
        progress("estimate", 0.7)
        fit = fit_samples(unknowns, *_measurements(regressor), noise)
    share = fit.noise if fit else noise or NOISE
    return Identification(
        scene=scene,
        names=regressor.matter.entries,
        nominal=regressor.matter.nominal,
        prior=np.linalg.norm(unknowns.nominal_slopes[0], axis=1),
        expected=expected_deviations(unknowns, matrix, share),
        structure=any_motion,
        determined=count_determined(unknowns, matrix, share),
        faster=count_determined(unknowns, regressor.rows(regressor.forces(_speed_up(regressor.poses))[1]), share),
        noise=share,
        size=prior,
        fit=fit,
        data=table.file if table else None,
    )


def _scene_of_table(scene: Scene, table: Recorded) -> Scene:
    """Return the scene at the times of a table, and with the motion of the table if the table contains a motion."""
    labels = [*scene.mechanism.independent]
    of_motion = {f"{label}{order}" for label in labels for order in ("", "d", "dd")}
    if table.file is not None and of_motion <= {*table.columns}:  # an actuator may be named like a coordinate
        drive, _ = read_drive({"csv": table.file.name}, labels, table.file.parent, str(table.file))
        scene = replace(scene, drive=drive)
        forces = {name: values for name, values in table.columns.items() if name not in of_motion}
        if not forces:
            raise DescriptionError("has no actuator force", table.where, "name columns after the actuators")
        table = replace(table, columns=forces)
    return replace(scene.at(table.t), tables={DATA: table})


def _speed_up(poses: ClosedSamples) -> ClosedSamples:
    """Return the same poses, with motion at a higher speed."""
    return replace(poses, t=poses.t / FASTER, yd=FASTER * poses.yd, ydd=FASTER**2 * poses.ydd)


def _measurements(regressor: Regressor) -> tuple[Array, Array, int]:
    """Return measured forces relative to `Regressor.sizes`, minus those at zero features, and their derivatives.

    Returns:
        Shapes (n, c), (n, c, n_feature), and the number of independent forces among the c forces of a sample.
    """
    scene, units = regressor.scene, description_names(regressor.scene.mechanism)[FORCE]
    values, where = answer_of_table(scene, DATA, {FORCE: units}, [FORCE]).values[FORCE], scene.tables[DATA].where
    columns = [units[0].index(name) for name in values.components]
    surplus, measured = max(len(units[0]) - len(scene.mechanism.independent), 0), values.array
    if surplus and len(columns) < len(units[0]):
        what = f"has only {len(columns)} of the {len(units[0])} forces of redundant actuators"
        raise DescriptionError(what, where, "add the missing forces")
    if surplus:
        measured = regressor.without_preload(measured)
    base, matrix = regressor.values, regressor.matrix
    nothing = base - matrix @ regressor.matter.features(regressor.matter.base[None])[0]
    scaled = (measured - nothing[:, columns]) / regressor.sizes[columns]
    rows = np.isfinite(scaled).all(axis=1)
    if rows.sum() < FEWEST:
        raise DescriptionError(f"has {int(rows.sum())} samples with known forces", where, f"record {FEWEST} or more")
    return scaled[rows], (matrix / regressor.sizes[:, None])[rows][:, columns], len(columns) - surplus
