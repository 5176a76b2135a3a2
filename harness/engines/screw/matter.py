"""Solves machines that differ only in mass properties: forces are linear in ten moments per body and in resistances.

Moments are mass, mass times centre of mass, and second moments about the body's origin. If a load acts at the centre
of mass, forces are also linear in the position of that centre. These variables are called features. A program
evaluates the machine and one neighbouring machine per feature. The results determine a matrix, so that every variant
requires only a matrix product.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from screwgauge.engines.screw.nominal import NominalMachine
from screwgauge.engines.screw.programs import Runner, runner
from screwgauge.reference.mechanism import SLACK, Body
from screwgauge.reference.parameters import TENSOR, XYZ, numbers, resisting_joint
from screwgauge.reference.rotations import Array
from screwgauge.reference.traced.parametric import ClosedSamples, Symbols

#: Largest number of matrix entries kept in memory at a time.
HELD = 8_000_000
#: Parameters of a body, in order.
ENTRIES = ("mass", *(f"com.{axis}" for axis in XYZ), *(f"inertia.{key}" for key in TENSOR))
_PLACES = [*TENSOR.values()]
_LOWER = np.tril_indices(4)


def moments(numbers: Array) -> Array:
    """Convert bodies' mass, centre of mass and central inertia to moments. Shape (..., 10) -> (..., 10)."""
    mass, com = numbers[..., :1], numbers[..., 1:4]
    return np.concatenate([mass, mass * com, numbers[..., 4:] + mass * _steiner(com)], axis=-1)


def numbers_of(moment: Array) -> Array:
    """Convert moments back to mass, centre of mass and central inertia. Shape (..., 10) -> (..., 10)."""
    mass = moment[..., :1]
    com = moment[..., 1:4] / mass
    return np.concatenate([mass, com, moment[..., 4:] - mass * _steiner(com)], axis=-1)


def _steiner(com: Array) -> Array:
    """Return the second moments of a unit mass at a point, entry by entry. Shape (..., 3) -> (..., 6)."""
    square = (com * com).sum(-1)
    return np.stack([(square if i == k else 0.0) - com[..., i] * com[..., k] for i, k in _PLACES], axis=-1)


def consistent_bodies(body: Array, z: Array) -> Array:
    """Return physically possible bodies near a given body.

    Their pseudo-inertias are ``L (1 + z) (1 + z)^T L^T``, where ``L L^T`` is the pseudo-inertia of the given body.

    Args:
        body: Parameters in the order of `ENTRIES`. Shape (10,).
        z: Entries of a dimensionless lower triangular matrix. Shape (10, n).

    Returns:
        Parameters of the n bodies. Shape (10, n).
    """
    moment = moments(body)
    second = np.zeros((3, 3))
    for (i, k), value in zip(_PLACES, moment[4:], strict=True):
        second[i, k] = second[k, i] = value
    P = np.zeros((4, 4))
    P[:3, :3] = 0.5 * np.trace(second) * np.eye(3) - second
    P[:3, 3] = P[3, :3] = moment[1:4]
    P[3, 3] = moment[0]
    values, vectors = np.linalg.eigh(P)
    root = vectors * np.sqrt(np.maximum(values, 0.0))  # works even for thin bodies, whose matrix is singular
    ways = np.zeros((z.shape[1], 4, 4))
    ways[:, _LOWER[0], _LOWER[1]] = z.T
    half = root @ (np.eye(4) + ways)
    made = half @ half.swapaxes(1, 2)
    sums = np.trace(made[:, :3, :3], axis1=1, axis2=2)
    entries = [(sums if i == k else 0.0) - made[:, i, k] for i, k in _PLACES]
    return numbers_of(np.stack([made[:, 3, 3], *made[:, :3, 3].T, *entries], axis=1)).T


class Matter:
    """Solver for changed mass properties of some bodies.

    Attributes:
        bodies: Bodies with a changed parameter.
        loaded: Indices of bodies with a load at the centre of mass.
        end: Number of body parameters; parameters of joints follow.
        resists: Full names of the rotor, damping and friction parameters that change.
        entries, nominal: Full names and values of ten parameters per body, then of the resistances. Shape (E,).
    """

    def __init__(self, machine: NominalMachine, names: Sequence[str], backend: str) -> None:
        self.machine, self.backend = machine, backend
        self.bodies = [body for body in machine.scene.mechanism.bodies if any(_of(body, name) for name in names)]
        self.resists = [name for name in names if resisting_joint(name)]
        self.end = 10 * len(self.bodies)
        entries = [*(f"bodies.{body.name}.{entry}" for body in self.bodies for entry in ENTRIES), *self.resists]
        known = numbers(machine.scene.mechanism, machine.scene.applied)
        self.nominal = np.array([known[name] for name in entries])
        self._places = [(entries.index(name), k) for k, name in enumerate(names) if name in entries]
        self.entries, self._made = entries, list[tuple[Symbols, Runner]]()
        loads = {load.body for load in machine.scene.applied.loads if load.point is None}
        self.loaded = [i for i, body in enumerate(self.bodies) if body.name in loads]
        self._kept: tuple[ClosedSamples, Array, Array] | None = None

    def numbers(self, p: Array) -> Array:
        """Return all parameters of each variant, in the order of `nominal`. Shape (P, V) -> (V, E)."""
        out = np.repeat(self.nominal[:, None], p.shape[1], axis=1)
        for row, k in self._places:
            out[row] = p[k]
        return out.T

    def of_bodies(self, numbers: Array) -> Array:
        """Select the body parameters, with one row per body. Shape (..., E) -> (..., n_body, 10)."""
        return numbers[..., : self.end].reshape(*numbers.shape[:-1], -1, 10)

    def possible(self, p: Array) -> NDArray[np.bool_]:
        """Flag variants in which all bodies are physically possible. Shape (P, V) -> (V,)."""
        if not self.bodies:
            return np.ones(p.shape[1], dtype=bool)
        numbers = self.of_bodies(self.numbers(p))
        mass, (xx, xy, xz, yy, yz, zz) = numbers[..., 0], np.moveaxis(numbers[..., 4:], -1, 0)
        half = 0.5 * (xx + yy + zz)
        allowed = np.array([body.allowed for body in self.bodies])
        moments_hold = _not_negative(xx, yy, zz, xy, xz, yz)
        # second moments are nonnegative if no principal moment of inertia exceeds the sum of the others
        triangle_holds = _not_negative(half - xx, half - yy, half - zz, -xy, -xz, -yz) | allowed
        some = (mass > 0.0) | ((mass == 0.0) & ~numbers[..., 4:].any(axis=-1))
        return np.asarray((moments_hold & triangle_holds & some).all(axis=1))

    def fill(self, poses: ClosedSamples, p: Array, into: Sequence[Array]) -> None:
        """Fill in the values of variants; `p` has shape (P, V), and each array in `into` has shape (n, m, V)."""
        change = self.features(self.numbers(p)) - self.features(self.base[None])
        ends = np.cumsum([0, *(array.shape[1] for array in into)])
        for rows, base, matrix in self.parts(poses):
            values = base[..., None] + (matrix.reshape(-1, change.shape[1]) @ change.T).reshape(*base.shape, -1)
            for array, first, end in zip(into, ends, ends[1:], strict=False):
                array[rows] = values[:, first:end]

    def features(self, numbers: Array) -> Array:
        """Return the features in which forces are linear: moments, resistances, and centres of mass where loads act.

        Shape (V, E) -> (V, n_feature).
        """
        bodies = self.of_bodies(numbers)
        found = [moments(bodies).reshape(len(numbers), -1), numbers[:, self.end :]]
        return np.concatenate([*found, *(bodies[:, i, 1:4] for i in self.loaded)], axis=1)

    def _neighbours(self) -> Array:
        """Return parameters of the base machine, and of one neighbouring machine per feature. (1 + n_feature, E)."""
        mechanism, L = self.machine.scene.mechanism, self.machine.work.loops.length
        away = mechanism.mass * np.array([1.0, *[L] * 3, *[L * L] * 6])
        steps = [*np.diag([*np.tile(away, len(self.bodies)), *[mechanism.mass * L * L] * len(self.resists)])]
        for i in self.loaded:  # a larger mass and a displaced centre of mass
            for axis in (1, 2, 3):
                steps.append(np.zeros(len(self.nominal)))
                steps[-1][[10 * i, 10 * i + axis]] = 2.0 * away[[0, axis]]
        shifts = np.concatenate([np.zeros((1, len(self.nominal))), np.reshape(steps, (-1, len(self.nominal)))])
        bodies = numbers_of(moments(self.of_bodies(self.base)) + self.of_bodies(shifts))
        return np.concatenate([bodies.reshape(len(shifts), -1), (self.base + shifts)[:, self.end :]], axis=1)

    @property
    def base(self) -> Array:
        """Parameters of the base machine: the nominal parameters, with nonzero mass for all bodies. Shape (E,)."""
        base = self.nominal.copy()
        masses = np.arange(0, self.end, 10)
        base[masses[base[masses] == 0.0]] = self.machine.scene.mechanism.mass
        return base

    def parts(self, poses: ClosedSamples) -> Any:
        """Yield slices of samples, base values, (n, m), and derivatives with respect to features, (n, m, n_feature)."""
        if self._kept is not None and self._kept[0] is poses:
            yield slice(None), *self._kept[1:]
            return
        step = max(1, HELD // max(1, self.machine.count * len(self.entries)))
        for first in range(0, len(poses.q), step):
            rows = slice(first, first + step)
            base, matrix = self._matrix(poses, rows)
            if step >= len(poses.q):
                self._kept = poses, base, matrix
            yield rows, base, matrix

    def _matrix(self, poses: ClosedSamples, rows: slice) -> tuple[Array, Array]:
        """Evaluate all neighbouring machines, one per lane of a program; return base values and the matrix."""
        known = dict(zip(self.entries, self.nominal.tolist(), strict=True))
        if not self._made:
            symbols = self.machine.symbols(known, 0)
            self._made.append((symbols, runner(symbols.program(self.machine.outputs(symbols)), self.backend)[0]))
        symbols, run = self._made[0]
        lanes = self._neighbours()
        numbers = np.ascontiguousarray(lanes.T)
        given, start, near = (np.zeros((len(x), len(lanes))) for x in (poses.given.T, symbols.predicted, symbols.near))
        out = np.empty((self.machine.count, len(lanes)))
        bound, found = run.bind([given, start, near, numbers], [out]), list[Array]()
        for row, q in zip(poses.given[rows], poses.q[rows], strict=True):
            given[:], start[:], near[:] = row[:, None], q[symbols.predicted, None], q[symbols.near, None]
            bound()
            found.append(out.copy())
        whole, features = np.array(found), self.features(lanes)
        return whole[..., 0], (whole[..., 1:] - whole[..., :1]) @ np.linalg.inv(features[1:] - features[0]).T


def _not_negative(xx: Array, yy: Array, zz: Array, xy: Array, xz: Array, yz: Array) -> NDArray[np.bool_]:
    """Flag symmetric matrices that, up to rounding, have no negative eigenvalues, using principal minors."""
    trace = xx + yy + zz
    pairs = xx * yy + yy * zz + zz * xx - xy * xy - xz * xz - yz * yz
    product = xx * (yy * zz - yz * yz) - xy * (xy * zz - yz * xz) + xz * (xy * yz - yy * xz)
    size = np.abs(trace)
    return np.asarray((trace >= 0.0) & (pairs >= -SLACK * size**2) & (product >= -SLACK * size**3))


def _of(body: Body, name: str) -> bool:
    return name in {f"bodies.{body.name}.{entry}" for entry in ENTRIES}
