"""Axes that fit what they show, with ticks at round numbers."""

from __future__ import annotations

from collections.abc import Callable, Iterable

import numpy as np

from screwgauge.reference.rotations import Array
from screwgauge.report.figures.data import Axis
from screwgauge.report.formatting import number

STEPS = (1.0, 2.0, 2.5, 5.0, 10.0)
NARROWEST = 1e-6  # of the largest value: a linear axis shows no smaller range
FEW = 3  # decades below which 1, 2 and 5 times each of them are ticks
MOST = 7  # decades with a tick


def linear(label: str, values: Iterable[Array], most: int = 8, margin: float = 0.05) -> Axis:
    """A linear axis over all finite values, with `most` ticks or a few less."""
    low, high = _range(values, (0.0, 1.0))
    size = max(abs(low), abs(high))
    span = max(high - low, NARROWEST * size) if high > low else size or 1.0
    middle, half = (low + high) / 2, span * (0.5 + margin)
    power = 10.0 ** np.floor(np.log10(2 * half / most))
    step = next(float(s * power) for s in STEPS if s * power * most >= 2 * half * (1 - 1e-9))
    ticks = [k * step for k in range(int(np.ceil((middle - half) / step)), int((middle + half) // step) + 1)]
    if step < 1e-4 or max(map(abs, ticks)) >= 1e5:
        names = [number(tick, 8) for tick in ticks]
    else:  # as many decimals as the step has
        decimals = next(d for d in range(8) if abs(round(step, d) - step) < 1e-9 * step)
        names = [f"{tick:.{decimals}f}".replace("-", "\N{MINUS SIGN}") for tick in ticks]
    return Axis(label, middle - half, middle + half, tuple(zip(ticks, names, strict=True)))


def log(label: str, values: Iterable[Array], name: Callable[[float], str] | None = None, *, whole: bool = True) -> Axis:
    """A logarithmic axis over all positive values.

    Args:
        name: Writes a tick; powers of ten by default.
        whole: From decade to decade; otherwise as far as the values reach, and a bit.
    """
    least, largest = _range((np.where(v > 0, v, np.nan) for v in values), (1.0, 10.0))
    low, high = np.log10(least), np.log10(largest)
    low, high = low - 0.15 - 0.02 * (high - low), high + 0.15 + 0.02 * (high - low)
    if whole:
        low = np.floor(np.log10(least) + 1e-9)
        high = max(np.ceil(np.log10(largest) - 1e-9), low + 1)
    decades = range(int(np.ceil(low)), int(np.floor(high)) + 1)
    if not whole and len(decades) < FEW:
        ticks = [s * 10.0**k for k in range(int(np.floor(low)), int(np.ceil(high))) for s in (1, 2, 5)]
        named = [(tick, number(tick, 2)) for tick in ticks if low <= np.log10(tick) <= high]
    else:
        named = [(10.0**k, name(10.0**k) if name else decade(k)) for k in decades[:: -(-len(decades) // MOST)]]
    return Axis(label, 10.0**low, 10.0**high, tuple(named), log=True)


def decade(k: int) -> str:
    """``0.01``, ``1000``, ``1e4``."""
    return f"{10.0**k:g}" if -2 <= k <= 3 else f"1e{k}"


def _range(values: Iterable[Array], otherwise: tuple[float, float]) -> tuple[float, float]:
    """Smallest and largest finite value."""
    numbers = np.concatenate([np.empty(0), *(v[np.isfinite(v)] for v in values)])
    return (float(numbers.min()), float(numbers.max())) if len(numbers) else otherwise
