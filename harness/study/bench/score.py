"""Errors of an outcome against the reference."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from screwgauge.solution import Values
from screwgauge.study.bench.contestant import Outcome


@dataclass(frozen=True, slots=True)
class Score:
    """Scaled error of one quantity: the largest, and RMS over samples and components. `reason` if there is none."""

    max_scaled: float
    rms_scaled: float
    reason: str = ""


def score(outcome: Outcome, reference: Values, scales: Mapping[str, float]) -> Score:
    """Largest and RMS scaled error over all samples and components.

    Samples for which the reference itself has no number are left out.

    Args:
        reference: At the same samples, with at least the outcome's components.
        scales: Unit -> S.
    """
    values = outcome.values
    columns = [reference.components.index(name) for name in values.components]
    truth = reference.array[:, columns]
    known = np.isfinite(truth).all(axis=1)
    scale = np.array([scales[unit] for unit in values.units])
    error = (np.abs(values.array - truth) / scale)[known]
    lost = int((~np.isfinite(error)).any(axis=1).sum())
    if lost or not error.size:
        return Score(float("nan"), float("nan"), f"not a number at {lost} of {len(error)} samples")
    return Score(float(error.max()), float(np.sqrt(np.mean(error**2))))
