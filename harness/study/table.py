"""Tidy tables: one row for each item, columns as data."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from operator import attrgetter
from typing import Any

import pandas as pd


def frame(items: Iterable[Any], columns: Mapping[str, str]) -> pd.DataFrame:
    """A row for each item.

    Args:
        columns: Column -> attribute of an item, dotted where it is one of an attribute.
    """
    return pd.DataFrame(
        [[attrgetter(name)(item) for name in columns.values()] for item in items], columns=list(columns)
    )
