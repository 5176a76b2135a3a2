"""The nominal machine that variants are based on: closed poses, and their derivatives with respect to parameters."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from screwgauge.engines.screw.buffers import check_array, check_finite
from screwgauge.engines.screw.inverse import Work
from screwgauge.engines.screw.programs import check_traceable, runner
from screwgauge.engines.screw.traced import LOST, TWICE, anchors
from screwgauge.models.layout import open_tree
from screwgauge.problem import GivenMotion
from screwgauge.reference.closed.loops import loop_equations
from screwgauge.reference.errors import ClosureError, DescriptionError
from screwgauge.reference.graph import layout
from screwgauge.reference.parameters import geometric
from screwgauge.reference.rotations import Array
from screwgauge.reference.traced.parametric import ClosedSamples, Symbols, residual_slopes
from screwgauge.reference.traced.trace import Scalar
from screwgauge.reference.traced.tracing import TracedQuantities, quantities
from screwgauge.scene.scene import Scene

#: A parameter removes mobility if it causes a larger residual that no motion closes; rounding causes 1e-14.
COSTS = 1e-9


class NominalMachine:
    """The machine of a scene, whose parameters are inputs of programs.

    Attributes:
        components: Quantity -> names of its components.
        anchors: Samples of the scene's motion, with closed poses, at which pivots are chosen.
    """

    def __init__(self, scene: Scene, wanted: Iterable[str]) -> None:
        """Follow the scene's motion.

        Raises:
            ScrewgaugeError: The motion cannot be followed, or no program covers the scene.
        """
        self.scene, self.problem = scene, scene.problem([*wanted])
        self.lay = layout(scene.mechanism)
        if scene.motion.idle:
            what = "the motion of an undriven coordinate follows from the forces"
            raise DescriptionError(
                what, "compile, parameters", "prescribe its motion, or vary the scene with scene.with_"
            )
        if any(load.sampled for load in scene.applied.loads):
            what = "a load is known only at the times of its file"
            raise DescriptionError(what, "compile, parameters", "define it as a function of time")
        check_traceable(self.lay, self.problem)
        self.work = Work(self.lay, self.problem)
        names = self.work.names()
        self.components = {name: names[name][0] for name in wanted}
        some, q = anchors(self.work, scene.motion)
        self.anchors = ClosedSamples(np.zeros(len(q)), some.y, some.yd, some.ydd, q)
        self._last: ClosedSamples | None = None

    @property
    def count(self) -> int:
        """Number of values of all quantities at a sample."""
        return sum(map(len, self.components.values()))

    def symbols(self, known: Mapping[str, float], steps: int) -> Symbols:
        """Trace the equations with the given parameters as inputs, see `Symbols`."""
        axial = self.problem.rule == "spherical_axial"
        return Symbols(self.work.loops, self.problem.applied, known, self.anchors, steps=steps, axial=axial)

    def outputs(self, symbols: Symbols) -> list[Scalar]:
        """Return the components of all quantities, in order."""
        wanted = TracedQuantities([*self.components], symbols.at.axial, *open_tree(self.lay))
        return [x for values in quantities(symbols.at, wanted).values() for x in values]

    def at(self, y: Array, yd: Array, ydd: Array, t: Array | None) -> ClosedSamples:
        """Return closed poses at samples, cached for the next call.

        Raises:
            ScrewgaugeError: An array is invalid, or a sample cannot be reached from the home pose.
        """
        k = len(self.scene.mechanism.independent)
        for name, array in (("y", y), ("yd", yd), ("ydd", ydd)):
            check_array(array, (len(y) if np.ndim(y) else 0, k), name)
            check_finite(array, name)
        applied = self.scene.applied
        if t is None and not (
            all(x.course.constant for x in applied.motors) and not any(x.courses for x in applied.loads)
        ):
            raise DescriptionError("a motor or a load depends on time, but t is missing", "compile", "pass t")
        times = np.arange(float(len(y))) if t is None else np.array(t, dtype=float)
        check_array(times, (len(y),), "t")
        last = self._last
        if last is not None and all(map(np.array_equal, (last.t, last.y, last.yd, last.ydd), (times, y, yd, ydd))):
            return last
        motion = GivenMotion(times, y.copy(), yd.copy(), ydd.copy())
        q = self._close(motion, follow=t is not None)
        self._last = ClosedSamples(motion.t, motion.y, motion.yd, motion.ydd, q)
        return self._last

    def _close(self, motion: GivenMotion, *, follow: bool) -> Array:
        mode = self.work.mode
        mode.restart()
        if follow:
            return self.work.close(motion, self.work.predict(motion))
        guess, lost, twice = mode.reach(motion.y)
        for rows, what in ((lost, LOST), (twice, TWICE)):
            if rows.any():
                first = int(np.argmax(rows))
                where = f"row {first} ({self.scene.mechanism.pose_text(motion.y[first])})"
                raise ClosureError(what, where, "use samples nearer to the home pose, or pass t")
        return mode.close(guess)


def stack_inputs(symbols: Symbols, poses: ClosedSamples, numbers: Array) -> Array:
    """Stack all inputs of a program at closed poses; `numbers` has shape (P,), the result has shape (inputs, n)."""
    parts = [poses.given, poses.q[:, symbols.predicted], poses.q[:, symbols.near]]
    return np.ascontiguousarray(np.concatenate([*parts, np.tile(numbers, (len(poses.q), 1))], axis=1).T)


class Slopes:
    """Pose derivatives ``dq/dp = -M^-1 dr/dp`` for parameters p, and the residuals that no joint motion can close."""

    def __init__(self, machine: NominalMachine, known: Mapping[str, float]) -> None:
        self.machine, self.names, self.nominal = machine, [*known], np.array([*known.values()])
        self._symbols = machine.symbols(known, 0)
        self.predicted, self.moving = self._symbols.predicted, any(map(geometric, known))
        self._rows: Any = None

    def of(self, poses: ClosedSamples) -> tuple[Array, Array]:
        """Return derivatives of the dependent coordinates, and of the remaining residuals, with respect to parameters.

        Returns:
            Shapes (n, c, P), (n, m, P); the residuals are dimensionless.
        """
        n, P = len(poses.q), len(self.names)
        if not (self.predicted and self.moving):
            return np.zeros((n, len(self.predicted), P)), np.zeros((n, 0, P))
        if self._rows is None:
            program = residual_slopes(self._symbols)
            self._rows = len(program.outputs), runner(program, "numpy")[0]
        count, run = self._rows
        entries = np.empty((count, n))
        run.bind([stack_inputs(self._symbols, poses, self.nominal)], [entries])()
        change = np.ascontiguousarray(np.moveaxis(entries.reshape(-1, P, n), -1, 0))
        loops = loop_equations(self.machine.lay)
        system, size = loops.closing_system(poses.q).system, loops.size[: loops.moving, None]
        slopes = -(system.inverse / loops.unit * size) @ change
        opens = change / loops.unit[:, None] + system.A[..., : loops.moving] @ (slopes / size)
        places = [loops.unknown.index(c) for c in self.predicted]
        return np.ascontiguousarray(slopes[:, places]), opens

    @property
    def _openings(self) -> Array:
        return self.of(self.machine.anchors)[1]

    def costs(self) -> dict[str, float]:
        """Return the closure residual caused by each parameter that removes mobility when it is changed alone.

        Residuals are first-order values at samples of the scene's motion [rad or mechanism lengths, per unit of the
        parameter].
        """
        worst = np.abs(self._openings).max(axis=(0, 1), initial=0.0)
        return {name: float(x) for name, x in zip(self.names, worst, strict=True) if x > COSTS}

    def combinations(self) -> list[dict[str, float]]:
        """Return combinations of the parameters in `costs` that preserve mobility to first order, in echelon form."""
        names = [*self.costs()]
        some = self._openings[..., [self.names.index(name) for name in names]].reshape(-1, len(names))
        values, back = np.linalg.svd(some, full_matrices=True)[1:]
        rank = int((values > COSTS * values.max(initial=0.0)).sum())
        rows = echelon(back[rank:])
        return [{name: float(x) for name, x in zip(names, row, strict=True) if abs(x) > COSTS} for row in rows]


def echelon(rows: Array) -> Array:
    """Return the reduced echelon form of independent rows: each has a 1 where all other rows have 0. Shape (m, n)."""
    out, free = rows.copy(), [*range(len(rows))]
    while free:
        i, column = max(((i, int(np.argmax(np.abs(out[i])))) for i in free), key=lambda at: abs(out[at]))
        out[i] /= out[i, column]
        for other in range(len(out)):
            if other != i:
                out[other] -= out[other, column] * out[i]
        free.remove(i)
    return out
