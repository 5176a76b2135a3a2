"""What ``screwgauge stress`` prints. Fits 100 columns."""

from __future__ import annotations

import textwrap

import numpy as np

from screwgauge.report.formatting import digits, text_table
from screwgauge.report.stress.report import headline
from screwgauge.study.stress.case import DEGRADED, REFUSED, SILENT
from screwgauge.study.stress.run import Stress

COLUMNS = 100


def format_terminal(found: Stress) -> str:
    """Headline, and for each case and engine the fewest and most digits and how many rows were what."""
    body = []
    for case in found.cases:
        rows = [row.finding for row in found.rows if row.case == case.name]
        for engine in dict.fromkeys(finding.engine for finding in rows):
            here = [finding for finding in rows if finding.engine == engine]
            kept = [digits(finding.error) for finding in here if np.isfinite(finding.error)]
            span = f"{min(kept):.1f} to {max(kept):.1f}" if kept else ""
            counts = [sum(f.verdict == verdict for f in here) for verdict in (DEGRADED, REFUSED, SILENT)]
            body.append((case.name, engine, span, *(str(n) if n else "" for n in counts)))
    head = ("case", "engine", "digits", "degraded", "refused", "silently wrong")
    table = text_table(head, body, right=(3, 4, 5))
    return "\n".join(line[:COLUMNS] for line in [*textwrap.wrap(headline(found), COLUMNS), "", *table])
