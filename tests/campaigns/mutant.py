"""A model file changed in one place, and what a diagnosis has to say of it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

Random = np.random.Generator
#: Item of a change of all parts.
EVERYWHERE = "*"
#: Slips with the orientation in which a tensor is written.
TURNED = ("not turned by its orientation", "transposed")


@dataclass(frozen=True, slots=True)
class Expected:
    """What was changed.

    Attributes:
        item: Link or joint, as the file calls it; empty for the model, `EVERYWHERE` for all parts.
        what: Properties by which the change may be told; one of them has to be.
        magnitude: How large it is, by the norm of the difference of its numbers; NaN where there is none.
        slip: Words that have to be in the name of the slip, if it is one.
    """

    item: str
    what: tuple[str, ...]
    magnitude: float = np.nan
    slip: str = ""


class CannotError(Exception):
    """A kind of change that a file has no place for."""
