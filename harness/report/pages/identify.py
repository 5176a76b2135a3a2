"""The report of an identification: identified and unidentifiable numbers, and predictions of the measured forces."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import groupby
from typing import Any

import numpy as np
import pandas as pd

from screwgauge.reference.errors import first_few
from screwgauge.reference.parameters import unit
from screwgauge.report.blocks import Banner
from screwgauge.report.layout import Report
from screwgauge.study.formatting import Row, join_all, number
from screwgauge.study.identify.directions import LIST, MASS
from screwgauge.study.identify.run import FASTER, Identification

#: Number of rows on the first screen, and number of entries per line for a direction.
SHOWN, ENTRIES = 12, 6


def headline(found: Identification) -> str:
    """State what the data determine, what any motion can determine, and what this motion can determine."""
    parts, fit, any_motion = list[str](), found.fit, found.structure
    if fit is not None and not fit.explains:
        parts.append(
            f"The residual is not noise: its correlation from sample to sample is {number(fit.correlation, 2)}. "
            "These numbers do not describe all forces that act."
        )
    if fit is not None:
        parts.append(
            f"In samples that were not fitted, forces are predicted to {_share(fit.error)} of the largest force (noise "
            f"{_share(fit.noise)}); {int(found.known.sum())} of {len(found.names)} numbers are identified."
        )
    faster = f", {found.faster} at {FASTER:g} times the speed" if found.faster > found.determined else ""
    parts.append(
        f"Motions can identify {any_motion.rank} of {any_motion.count} numbers or combinations of them; this motion "
        f"identifies {found.determined} with noise of {_share(found.noise)} of the largest force{faster}."
    )
    return " ".join(parts)


def _share(value: float) -> str:
    return f"{number(100.0 * value, 3)} %"


def _banner(found: Identification) -> Banner:
    return Banner.of(headline(found), found.exit_status == 0, "TOLD" if found.fit else "COUNTED", "NOT EXPLAINED")


def _blind_spots(found: Identification) -> Iterator[str]:
    """Yield sentences on mass moments that may shift through a joint unnoticed, and on numbers that have no effect."""
    through = [one for one in found.structure.directions if one.kind != LIST]
    for (joint, kind, bodies), some in groupby(through, lambda one: (one.joint, one.kind, one.bodies)):
        axes = [one.axis for one in some]
        many, where = len(axes) > 1, "at the centre" if kind == MASS else f"({join_all(axes)})"
        what = f"{kind}s {where} of {joint}" if many else f"a {kind} {where} of {joint}"
        ends = f"may shift between {join_all(bodies)}"
        yield f"{what} {ends if len(bodies) > 1 else f'on {bodies[0]} ' + ('are' if many else 'is') + ' unobservable'}"
    lists = [[*one.entries] for one in found.structure.directions if one.kind == LIST]
    if alone := [names[0] for names in lists if len(names) == 1]:
        yield f"{first_few(alone, SHOWN)} {'is' if len(alone) == 1 else 'are'} unobservable"


def _lists(found: Identification) -> Iterator[Row]:
    """Yield groups of numbers that may change together without changing any force."""
    for one in found.structure.directions:
        some = [f"{number(value, 3)} {name}" for name, value in one.entries.items()]
        if one.kind == LIST and len(some) > 1:
            more = f" and {len(some) - ENTRIES} more" if len(some) > ENTRIES else ""
            yield {"entries": ", ".join(some[:ENTRIES]) + more}


def _rows(found: Identification) -> list[Row]:
    """Return a row for each number: value in the scene, prior, identifiability, and estimate."""
    values = [""] * len(found.names) if found.fit is None else [number(x, 5) for x in found.fit.values]
    columns = found.names, found.nominal, found.prior, found.after, found.known, values
    return [
        {
            "name": f"{name} [{unit(name)}]".removesuffix(" []"),
            "nominal": number(nominal, 5),
            "before": number(before, 2),
            "after": number(after, 2),
            "determined": "yes" if known else "no",
            "value": value,
        }
        for name, nominal, before, after, known, value in zip(*columns, strict=True)
    ]


def _best_rows(found: Identification) -> list[Row]:
    """Return rows for the most accurately determined numbers."""
    shares = np.where(found.known, found.after / np.where(found.prior > 0.0, found.prior, 1.0), np.inf)
    order = np.argsort(shares, kind="stable")
    rows = _rows(found)
    return [rows[i] for i in order[: min(SHOWN, int(found.known.sum()))]]


def numbers_table(found: Identification) -> pd.DataFrame:
    """Build the table of all numbers, in full precision."""
    columns: dict[str, Any] = {"number": found.names, "nominal": found.nominal, "prior": found.prior}
    columns |= {"expected": found.expected}
    if found.fit is not None:
        columns |= {"value": found.fit.values, "deviation": found.fit.deviations}
    return pd.DataFrame({**columns, "determined": found.known})


def directions_table(found: Identification) -> pd.DataFrame:
    """Build the table of all unidentifiable directions, with a row for each entry."""
    rows = [
        [i, one.kind, one.joint, one.axis, name, value]
        for i, one in enumerate(found.structure.directions, 1)
        for name, value in one.entries.items()
    ]
    return pd.DataFrame(rows, columns=["direction", "kind", "joint", "axis", "number", "share"])


PAGE = Report(
    text="identify",
    banner=_banner,
    data={"numbers.csv": numbers_table, "directions.csv": directions_table},
    values={
        "title": lambda found: f"Identification of {found.scene.title}",
        "headline": headline,
        "about": lambda found: {"scene": found.scene.name, "data": found.data.name if found.data else "none"},
        "seen": _best_rows,
        "unseen": lambda found: [*_blind_spots(found)],
        "lists": lambda found: [*_lists(found)],
        "numbers": _rows,
        "prior": lambda found: _share(found.size),
    },
)
