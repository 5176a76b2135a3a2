"""The report of a study that is one table."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Collection, Iterable, Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from screwgauge.report.blocks import Banner, Picture
from screwgauge.report.layout import TEXTS, Report, Value


def study(
    file: str,
    title: str,
    banner: Callable[[pd.DataFrame], Banner],
    kept: Collection[str] = (),
    draw: Callable[[pd.DataFrame], Sequence[Picture]] = lambda found: (),
    grown: bool = True,
    texts: Path = TEXTS,
    **values: Value,
) -> Report:
    """A report whose text, in the folder `texts`, has the name of the table's file.

    Args:
        kept: Columns of the file, all by default.
    """
    return Report(
        text=str(texts / Path(file).stem),
        banner=banner,
        data={file: lambda found: found[[*kept]] if kept else found},
        values={
            "title": lambda found: title,
            "about": lambda found: {"table": f"{file}, {len(found)} rows"},
            **values,
        },
        draw=draw,
        grown=grown,
    )


def counted(values: Iterable[Any]) -> str:
    """``3 agree, 1 differ``, the most frequent first."""
    return ", ".join(f"{count} {value}" for value, count in Counter(values).most_common())
