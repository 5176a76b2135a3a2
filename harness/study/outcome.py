"""Outcomes of a comparison, the weaker the later, and the exit status of each."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Literal

Outcome = Literal[
    "agree",
    "judged",
    "unread",
    "rigid",
    "unlike",
    "undecided",
    "partly",
    "unjudged",
    "nothing",
    "faulted",
    "differ",
    "refused",
    "failed",
]
#: Exit status of each.
EXIT: dict[Outcome, int] = {
    "agree": 0,  # all that was asked was compared, and is within tolerance
    "judged": 0,  # one engine, for which the equations of mechanics hold
    "unread": 1,  # a gate names a file that nobody read
    "rigid": 1,  # inertia of a file is left out, and the rest agrees
    "unlike": 1,  # a model file differs from the description, and the scene does not allow it
    "undecided": 1,  # out of tolerance by no more than the engines admit
    "partly": 1,  # not all that was asked was compared
    "unjudged": 1,  # of an engine no equation was looked at
    "nothing": 1,  # nothing was compared
    "faulted": 1,  # an equation of mechanics does not hold
    "differ": 1,  # two engines differ
    "refused": 2,  # bad input
    "failed": 3,  # an engine, or its process
}
_ORDER = [*EXIT]


def weakest(outcomes: Iterable[Outcome]) -> Outcome:
    """The one that a verdict begins with."""
    return max(outcomes, key=_ORDER.index)
