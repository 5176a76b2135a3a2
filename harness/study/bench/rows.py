"""Rows of a bench: one for each contestant, setting and quantity; and the times to reach an error."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd

from screwgauge.quantities import digits
from screwgauge.study.bench.contestant import NOTHING, Contestant

COLUMNS = [
    *(
        "family",
        "contestant",
        "setting",
        "quantity",
        "max_scaled",
        "rms_scaled",
        "digits",
        "time_s",
        "n_sample",
    ),
    *("covers", "status", "reason"),
]
TIMING_COLUMNS = ["contestant", "setting", "quantity", "rounds", "n_sample", "min_s", "median_s", "covers"]
REACH_COLUMNS = ["quantity", "error", "family", "seconds_per_sample", "contestant", "setting", "given"]
LEVELS = (1e-3, 1e-6, 1e-9, 1e-12)
OK, FAILED, CUT = "ok", "failed", "cut short"


@dataclass(frozen=True, slots=True, eq=False)
class Row:
    """What was found of one quantity of one contestant. `seconds`: every measurement, in the order made."""

    contestant: Contestant
    quantity: str
    max_scaled: float
    rms_scaled: float
    n_sample: int
    seconds: tuple[float, ...]
    status: str
    reason: str

    @property
    def time_s(self) -> float:
        """Shortest measurement: disturbances only ever add."""
        return min(self.seconds, default=float("nan"))

    @property
    def scored(self) -> bool:
        """Whether there is an error at all."""
        return bool(np.isfinite(self.max_scaled))

    @property
    def per_sample(self) -> float:
        """Run time for each sample delivered [s]."""
        return self.time_s / self.n_sample if self.n_sample else float("nan")


def bench_table(rows: Sequence[Row]) -> pd.DataFrame:
    """The rows of ``bench.csv``."""
    body = [
        (
            row.contestant.family,
            row.contestant.name,
            row.contestant.setting,
            row.quantity,
            row.max_scaled,
            row.rms_scaled,
            digits(row.max_scaled),
            row.time_s,
            row.n_sample,
            row.contestant.covers,
            row.status,
            row.reason,
        )
        for row in rows
    ]
    return pd.DataFrame(body, columns=COLUMNS)


def timing_table(rows: Sequence[Row]) -> pd.DataFrame:
    """The rows of ``timings.csv``: shortest and median measurement."""
    body = [
        (
            row.contestant.name,
            row.contestant.setting,
            row.quantity,
            len(row.seconds),
            row.n_sample,
            row.time_s,
            float(np.median(row.seconds)),
            row.contestant.covers,
        )
        for row in rows
        if row.seconds
    ]
    return pd.DataFrame(body, columns=TIMING_COLUMNS)


def reach(rows: Sequence[Row]) -> pd.DataFrame:
    """Quickest setting of each family for each quantity and error; families that never get there are left out."""
    body = []
    for quantity in dict.fromkeys(row.quantity for row in rows if row.quantity != NOTHING):
        here = [r for r in rows if r.quantity == quantity and r.contestant.drawn and r.per_sample > 0]
        for level in LEVELS:
            best: dict[str, Row] = {}
            for row in here:
                family = row.contestant.family
                if row.max_scaled <= level and (family not in best or row.per_sample < best[family].per_sample):
                    best[family] = row
            for family, row in sorted(best.items(), key=lambda item: item[1].per_sample):
                c = row.contestant
                body.append((quantity, level, family, row.per_sample, c.name, c.setting, c.given))
    return pd.DataFrame(body, columns=REACH_COLUMNS)
