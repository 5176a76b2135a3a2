from collections import Counter
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import pandas as pd
from campaigns.rows import TEXTS

from screwgauge.report.blocks import Banner
from screwgauge.report.layout import Report, Value


def study(file: str, title: str, banner: Callable[[pd.DataFrame], Banner], **values: Value) -> Report:
    return Report(
        text=str(TEXTS / Path(file).stem),
        banner=banner,
        data={file: lambda results: results},
        values={
            "title": lambda results: title,
            "about": lambda results: {"table": f"{file}, {len(results)} rows"},
            **values,
        },
    )


def counted(values: Iterable[Any]) -> str:
    return ", ".join(f"{count} {value}" for value, count in Counter(values).most_common())
