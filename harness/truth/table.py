"""What the truth finds, as it is kept: midpoints and radii of all samples."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass

import numpy as np

from screwgauge.reference.rotations import Array
from screwgauge.truth import cache
from screwgauge.truth.samples import Balls


@dataclass(frozen=True, slots=True, eq=False)
class Table:
    """What is computed and cached: midpoints and radii by quantity (n_row, m), reasons of samples without any.

    Attributes:
        rounded: Long decimals of the geometry were read as rounded.
    """

    mid: dict[str, Array]
    radius: dict[str, Array]
    reasons: list[str]
    spent: dict[str, float]
    rounded: bool

    def pack(self) -> dict[str, Array]:
        return {
            **{f"mid.{name}": array for name, array in self.mid.items()},
            **{f"radius.{name}": array for name, array in self.radius.items()},
            "reasons": np.array(self.reasons, dtype=str),
            "stages": np.array(list(self.spent), dtype=str),
            "seconds": np.array(list(self.spent.values())),
            "rounded": np.array(self.rounded),
        }

    @classmethod
    def unpack(cls, stored: cache.Arrays) -> Table:
        mid, radius = (
            {name.removeprefix(part): array for name, array in stored.items() if name.startswith(part)}
            for part in ("mid.", "radius.")
        )
        spent = dict(zip(stored["stages"].tolist(), map(float, stored["seconds"]), strict=True))
        return cls(mid, radius, list(map(str, stored["reasons"])), spent, bool(stored["rounded"]))

    def answers(self, wanted: Collection[str], sizes: Mapping[str, int], y: Array, columns: list[int]) -> bool:
        """Whether this can be the answer to a problem.

        Args:
            wanted: Quantities that an answer has.
            sizes: Number of components of every quantity.
            y: Independent coordinates. Shape (n_row, k).
            columns: Theirs among the joint coordinates.
        """
        if not ({"joint_position", *wanted} <= self.mid.keys() == self.radius.keys() <= sizes.keys()):
            return False
        for name, array in [*self.mid.items(), *self.radius.items()]:
            if array.dtype != np.float64 or array.shape != (len(y), sizes[name]):
                return False
        q = self.mid["joint_position"]
        lost = np.isnan(q).any(axis=1)
        there = (np.isfinite(array[~lost]).all() and np.isnan(array[lost]).all() for array in self.mid.values())
        known = ((array[~lost] >= 0.0).all() for array in self.radius.values())
        same = np.isclose(q[:, columns], y, rtol=1e-9, atol=1e-9)[~lost].all()
        return bool(len(self.reasons) == lost.sum() < len(y) and all(there) and all(known) and same)


def enclosures(found: list[Balls | None], rounded: bool) -> tuple[dict[str, Array], dict[str, Array]]:
    """Midpoints rounded to doubles, and upper bounds of the radii; NaN where there is nothing.

    A ball that holds zero is centred there, what vanishes by symmetry being zero and not 1e-58; if decimals were
    rounded, it may be as wide as a number that does not vanish.
    """
    first = next(one for one in found if one is not None)
    mid = {name: np.full((len(found), len(balls)), np.nan) for name, balls in first.items()}
    radius = {name: array.copy() for name, array in mid.items()}
    for i, one in enumerate(found):
        for name, balls in (one or {}).items():
            centred = [not rounded and ball.contains(0) for ball in balls]
            mid[name][i] = [0.0 if zero else float(b.mid()) for b, zero in zip(balls, centred, strict=True)]
            size = [float(b.abs_upper() if zero else b.rad()) for b, zero in zip(balls, centred, strict=True)]
            radius[name][i] = np.nextafter(size, np.inf)
    return mid, radius
