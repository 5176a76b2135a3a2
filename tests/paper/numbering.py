"""The paper's references to its own equations: erratum 6."""

import tomllib
from pathlib import Path

from paper.erratum import Erratum, Form

#: Where, the number printed, the number meant.
REFERENCES: list[tuple[str, str, str]] = tomllib.loads(
    Path(__file__).with_name("references.toml").read_text(encoding="utf-8")
)["references"]


def references() -> list[Erratum]:
    """6: numbers are shifted from eq. (19) on, and more from eq. (53) on."""
    measure = f"wrong ones of {len(REFERENCES)} references"
    printed = Form(
        "references as printed, such as (22) for (24)", sum(number != meant for _, number, meant in REFERENCES)
    )
    return [Erratum(6, "N", "throughout", measure, printed, Form("the equation that is meant", 0), "count")]
