"""A cause that is thought of."""

from __future__ import annotations

from dataclasses import dataclass

from screwgauge.diagnosis.files.opened import Opened
from screwgauge.reference.rotations import Array

INERTIAL = ("mass", "com", "inertia")
#: How many numbers a property is, where it is not as many as its value has.
COUNT = {"mass": 1, "com": 3, "inertia": 6, "placement": 6, "axis": 2, "centre": 2, "pose": 6}
#: A slip or ratio is common to a model if so many parts have it.
COMMON = 2


@dataclass(frozen=True, slots=True, eq=False)
class Value:
    """One property in both models.

    Attributes:
        item: Link, body or joint, in B's name; empty for the model.
        what: Property.
        a, b: In A and in B, in a frame of B: that of the link of mass properties.
    """

    item: str
    what: str
    a: Array
    b: Array


@dataclass(frozen=True, slots=True, eq=False)
class Hypothesis:
    """A cause that would explain differences.

    Attributes:
        name: In words: what of which part.
        differences: Numbers of those that it accounts for.
        slips: What B's value would be made from A's by, if it is a slip of convention or unit; any of them.
        numbers: How many numbers it changes.
        values: What it changes.
    """

    name: str
    differences: tuple[int, ...]
    slips: tuple[str, ...] = ()
    numbers: int = 1
    values: tuple[Value, ...] = ()


@dataclass(frozen=True, slots=True, eq=False)
class Files:
    """The files of two models, where they are known and can be put beside their readings."""

    a: Opened | None = None
    b: Opened | None = None
