"""Numbers of a program while it is made: floats, arrays over samples, or nodes of a trace."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

Scalar = Any
"""A float, an array over samples, or a `trace.Node`."""

#: Function -> what computes it on arrays.
FUNCTIONS: dict[str, Callable[..., Any]] = {
    "sqrt": np.sqrt,
    "sin": np.sin,
    "cos": np.cos,
    "atan2": np.arctan2,
    "max": np.maximum,
}


def apply(name: str, *x: Scalar) -> Scalar:
    """A function by its name, see `FUNCTIONS`."""
    for value in x:
        if hasattr(value, "op"):  # a node
            return value.trace.function(name, *x)
    found = FUNCTIONS[name](*x)
    return found if np.ndim(found) else float(found)
