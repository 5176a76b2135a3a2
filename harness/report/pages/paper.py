"""The report of ``screwgauge paper``: the errata, each with the size of its effect."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict

import pandas as pd

from screwgauge.quantities import MAX_DIGITS
from screwgauge.report.blocks import Banner
from screwgauge.report.figures.paper import make_plots
from screwgauge.report.formatting import Row, number, unit_text
from screwgauge.report.layout import Report, Value
from screwgauge.report.pages.scene import judged, short
from screwgauge.scene.read import load_scene
from screwgauge.study.paper.case import SCENE
from screwgauge.study.paper.errata import KINDS, Erratum
from screwgauge.study.paper.measure import NUMBERS, Paper
from screwgauge.study.provenance import provenance

NOISE = 10.0**-MAX_DIGITS  # nothing here is known better than to the last bit of one
SOURCE = "Zhao, Wei, Sun: Dynamics of a 3-UPS-UPU-S Parallel Mechanism, Appl. Sci. 2023, 13, 3912"
MEANING = ", ".join(f"{key} {word}" for key, word in KINDS.items())


def _value(value: float) -> str:
    """Three figures; a residual of rounding as its power of ten."""
    if abs(value) < NOISE:
        return "0"
    if 1e3 <= abs(value) < 1e6:
        return f"{value:.0f}"
    return number(value, 1 if abs(value) < 1e-9 else 3)


def _rows(paper: Paper) -> list[Row]:
    numeric = ("printed", "right", "effect")
    return [
        {
            **asdict(row),
            **{name: _value(getattr(row, name)) for name in numeric},
            "no": f"{row.number} {row.kind}",
            "amount": f"{_value(row.effect)} {unit_text(row.unit)}".removesuffix(" 1"),
        }
        for row in paper.errata
    ]


def errata_frame(errata: Sequence[Erratum]) -> pd.DataFrame:
    """The table of ``errata.csv``."""
    rows = []
    for row in errata:
        forms = ((row.printed_form, row.printed), (row.right_form, row.right))
        gives = (f"{form} -> {number(value)}" for form, value in forms)
        rows.append((row.number, f"{row.equation}: {row.measure}", *gives, row.effect, row.unit))
    return pd.DataFrame(rows, columns=["number", "equation", "printed", "right", "effect", "unit"])


def _banner(paper: Paper) -> Banner:
    count = len({row.number for row in paper.errata})
    sentence = (
        f"{count} of {len(NUMBERS)} errata of the paper are measured, each by running the form as printed beside the "
        f"right one, in {len(paper.errata)} rows. {paper.reach.sentence}"
    )
    return Banner(sentence, "✓ COMPLETE", "agree") if paper.complete else Banner(sentence, "✗ INCOMPLETE", "failed")


def _files(paper: Paper) -> dict[str, str]:
    return judged(provenance(load_scene(SCENE), {}))


VALUES: dict[str, Value] = {
    "title": lambda paper: "The paper, checked",
    "about": lambda paper: {"paper": SOURCE, **short(_files(paper))},
    "files": _files,
    "errata": _rows,
    "meaning": lambda paper: MEANING,
    "reach": lambda paper: paper.reach.sentence,
}
PAGE = Report(
    text="paper",
    banner=_banner,
    data={"errata.csv": lambda paper: errata_frame(paper.errata)},
    values=VALUES,
    draw=make_plots,
)
