"""The report on the paper: the errata, each with the size of its effect."""

from pathlib import Path
from typing import NamedTuple

import pandas as pd
from paper.case import SCENE
from paper.dynamics import AxialRule, Reach
from paper.erratum import KINDS, Erratum
from paper.figures import make_plots
from paper.scheme import Runs

from screwgauge.quantities import MAX_DIGITS
from screwgauge.report.blocks import Banner
from screwgauge.report.layout import Report
from screwgauge.report.record import judged_files, shorten_hashes
from screwgauge.scene.read import load_scene
from screwgauge.study.comparison import provenance
from screwgauge.study.formatting import Row, number, unit_text

NOISE = 10.0**-MAX_DIGITS  # nothing here is known better than to the last bit of one
SOURCE = "Zhao, Wei, Sun: Dynamics of a 3-UPS-UPU-S Parallel Mechanism, Appl. Sci. 2023, 13, 3912"


class Paper(NamedTuple):
    errata: list[Erratum]
    reach: Reach
    runs: Runs
    axial: AxialRule


def errata_frame(paper: Paper) -> pd.DataFrame:
    """The table of ``errata.csv``."""
    rows = []
    for row in paper.errata:
        gives = (f"{form.words} -> {number(form.value)}" for form in (row.printed, row.right))
        rows.append((row.number, f"{row.equation}: {row.measure}", *gives, float(row.effect), row.unit))
    return pd.DataFrame(rows, columns=["number", "equation", "printed", "right", "effect", "unit"])


def _value(value: float) -> str:
    if abs(value) < NOISE:
        return "0"
    if 1e3 <= abs(value) < 1e6:
        return f"{value:.0f}"
    return number(value, 1 if abs(value) < 1e-9 else 3)


def _rows(paper: Paper) -> list[Row]:
    return [
        {
            "no": f"{row.number} {row.kind}",
            "equation": row.equation,
            "measure": row.measure,
            "amount": f"{_value(row.effect)} {unit_text(row.unit)}".removesuffix(" 1"),
            "printed": f"{row.printed.words} → {_value(row.printed.value)}",
            "right": f"{row.right.words} → {_value(row.right.value)}",
        }
        for row in paper.errata
    ]


def _banner(paper: Paper) -> Banner:
    count = len({row.number for row in paper.errata})
    sentence = (
        f"{count} of 18 errata of the paper are measured, each by running the form as printed beside the "
        f"right one, in {len(paper.errata)} rows. {paper.reach.sentence}"
    )
    return Banner(sentence, "✓ COMPLETE", "agree")


def _files(paper: Paper) -> dict[str, str]:
    return judged_files(provenance(load_scene(SCENE), {}))


PAGE = Report(
    text=str(Path(__file__).with_name("paper")),
    banner=_banner,
    data={"errata.csv": errata_frame},
    values={
        "title": lambda paper: "The paper, checked",
        "about": lambda paper: {"paper": SOURCE, **shorten_hashes(_files(paper))},
        "files": _files,
        "errata": _rows,
        "meaning": lambda paper: ", ".join(f"{key} {word}" for key, word in KINDS.items()),
    },
    draw=make_plots,
)
