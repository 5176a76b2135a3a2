"""Estimation of physically consistent bodies, rotors and friction, from actuator forces and priors from the file."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.linalg import solve_triangular
from scipy.optimize import least_squares

from screwgauge.engines.screw.matter import consistent_bodies
from screwgauge.reference.errors import ScrewgaugeError
from screwgauge.reference.rotations import Array
from screwgauge.study.identify.regressor import Regressor

#: Step of differences; largest number of trust-region steps, their tolerance, and margin of the first point to bounds.
STEP, STEPS, ENOUGH, TINY = 1e-4, 500, 1e-7, 1e-9
#: Number of successive noise estimates from residuals, and the smallest noise that differs from rounding.
ROUNDS, LEAST = 3, 1e-6
#: Default noise relative to the largest force.
NOISE = 1e-3
#: Correlation between successive samples above which residuals are not noise; prediction error that counts as rounding.
CORRELATED, ROUNDING = 0.3, 1e-6


class Unknowns:
    """Dimensionless coordinates of all numbers: zero is the value in the scene, one is a prior standard deviation away.

    Each body has ten coordinates, see `consistent_bodies`, so that every point is a physically consistent body; each
    resistance has one, with a lower bound.
    """

    def __init__(self, regressor: Regressor, prior: float) -> None:
        self.matter, self.deviations, self.prior = regressor.matter, regressor.deviations, prior
        self.count = len(self.matter.nominal)

    @property
    def least(self) -> Array:
        """Lower bounds of the coordinates, below which a resistance would be negative. Shape (count,)."""
        first = self.matter.end
        return np.concatenate([np.full(first, -np.inf), -self.matter.nominal[first:] / self.deviations])

    def numbers(self, x: Array) -> Array:
        """Return the numbers in the order of `Matter.nominal`. Shape (count, V) -> (V, count)."""
        bodies, first = self.matter.of_bodies(self.matter.nominal), self.matter.end
        parts = [consistent_bodies(body, self.prior * x[10 * i : 10 * i + 10]).T for i, body in enumerate(bodies)]
        return np.concatenate([*parts, self.matter.nominal[first:] + self.deviations * x[first:].T], axis=1)

    def features(self, x: Array) -> Array:
        """Return the features on which forces depend linearly, see `Matter.features`. (count, V) -> (V, n_feature)."""
        return self.matter.features(self.numbers(x))

    @cached_property
    def nominal_slopes(self) -> tuple[Array, Array]:
        """Derivatives at the numbers of the scene, see `slopes`."""
        return self.slopes(np.zeros(self.count))

    def slopes(self, x: Array) -> tuple[Array, Array]:
        """Return derivatives of numbers and of features. Shape (count,) -> (count, count), (n_feature, count)."""
        ways = x[:, None] + STEP * np.concatenate([np.eye(self.count), -np.eye(self.count)], axis=1)
        return _difference(self.numbers(ways)), _difference(self.features(ways))


def _difference(values: Array) -> Array:
    ahead, behind = np.split(values, 2)
    return np.asarray((ahead - behind).T / (2.0 * STEP))


@dataclass(frozen=True, slots=True, eq=False)
class Fit:
    """Estimates from measured forces.

    Attributes:
        values: Most likely numbers. Shape (E,).
        deviations: Standard deviations of the numbers. Shape (E,).
        noise: Standard deviation of the measured forces, relative to the largest force with the same unit.
        error: RMS prediction error at samples that were not fitted, relative to the largest force with the same unit.
        correlation: Correlation of the residuals between successive samples.
    """

    values: Array
    deviations: Array
    noise: float
    error: float
    correlation: float

    @property
    def explains(self) -> bool:
        """True if the residuals are noise."""
        return self.error < ROUNDING or self.correlation < CORRELATED


def count_determined(unknowns: Unknowns, matrix: Array, noise: float) -> int:
    """Count the combinations of numbers that rows determine better than the prior."""
    slopes = matrix @ unknowns.nominal_slopes[1] / noise
    return int((np.linalg.svd(slopes, compute_uv=False) > 1.0).sum())


def expected_deviations(unknowns: Unknowns, matrix: Array, noise: float) -> Array:
    """Return the expected standard deviations of the numbers after measuring rows. Shape (E,)."""
    ways, features = unknowns.nominal_slopes
    return _deviations(ways, _covariance(np.concatenate([matrix @ features / noise, np.eye(unknowns.count)])))


def fit_samples(unknowns: Unknowns, measured: Array, matrix: Array, independent: int, noise: float | None) -> Fit:
    """Fit the most likely machine to every second sample, and predict the remaining samples.

    Args:
        measured: Measured forces minus the forces at zero features, relative to the largest force of the same unit.
            Shape (n, c).
        matrix: Derivatives of the forces with respect to the features. Shape (n, c, n_feature).
        independent: Number of independent forces per sample, which is less than c for redundant actuators.
        noise: Noise of the forces; estimated from residuals if None, starting with `NOISE`.

    Raises:
        ScrewgaugeError: The estimate does not converge.
    """
    fitted, test, known = slice(0, None, 2), slice(1, None, 2), noise is not None
    forces, count, noise = measured[fitted].ravel(), len(measured[fitted]) * independent, noise or NOISE
    Q, R = np.linalg.qr(np.concatenate(matrix[fitted]))
    t, rest = Q.T @ forces, float(forces @ forces)
    rest -= float(t @ t)
    x, covariance = np.zeros(unknowns.count), np.eye(unknowns.count)
    for _ in range(1 if known else ROUNDS):
        x, covariance = _most_likely(unknowns, R, t, noise, x)
        if not known:
            left = t - R @ unknowns.features(x[:, None])[0]
            determined = unknowns.count - float(np.trace(covariance))  # effective number of parameters determined
            noise = max(np.sqrt(max(rest + float(left @ left), 0.0) / max(count - determined, 1.0)), LEAST)
    left = measured - matrix @ unknowns.features(x[:, None])[0]
    return Fit(
        values=unknowns.numbers(np.maximum(x, unknowns.least)[:, None])[0],
        deviations=_deviations(unknowns.slopes(x)[0], covariance),
        noise=noise,
        error=float(np.sqrt((left[test] ** 2).sum() / (len(left[test]) * independent))),
        correlation=float((left[1:] * left[:-1]).sum() / max((left * left).sum(), 1e-300)),
    )


def _most_likely(unknowns: Unknowns, R: Array, t: Array, noise: float, x: Array) -> tuple[Array, Array]:
    """Return the coordinates that fit the rows best, starting from an initial guess, and their covariance."""

    def residuals(x: Array) -> Array:
        return np.concatenate([(R @ unknowns.features(x[:, None])[0] - t) / noise, x])

    def slopes(x: Array) -> Array:
        return np.concatenate([R @ unknowns.slopes(x)[1] / noise, np.eye(len(x))])

    some = {"xtol": ENOUGH, "ftol": ENOUGH, "gtol": None, "max_nfev": STEPS}
    found = least_squares(residuals, x, slopes, bounds=(unknowns.least - TINY, np.inf), **some)
    if found.status <= 0:
        raise ScrewgaugeError("the estimate does not converge", "identify", "use a smaller prior or other data")
    return found.x, _covariance(found.jac)


def _covariance(slopes: Array) -> Array:
    """Compute the covariance from the derivatives of the rows and of the prior. Shape (count, count)."""
    inverse = solve_triangular(np.linalg.qr(slopes, mode="r"), np.eye(slopes.shape[1]))
    return np.asarray(inverse @ inverse.T)


def _deviations(ways: Array, covariance: Array) -> Array:
    """Compute standard deviations of numbers from the covariance of coordinates. Shape (E,)."""
    return np.asarray(np.sqrt(np.maximum(((ways @ covariance) * ways).sum(axis=1), 0.0)))
