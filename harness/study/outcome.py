"""Outcomes of a comparison, from strongest to weakest, with their exit statuses."""

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
#: Outcome -> exit status.
EXIT: dict[Outcome, int] = {
    "agree": 0,  # everything requested was compared, and is within tolerance
    "judged": 0,  # a single engine ran, and satisfies the equations of mechanics
    "unread": 1,  # a scene of a gate names a file that was not read
    "rigid": 1,  # inertia in a file is left out, and the rest agrees
    "unlike": 1,  # a model file differs from the description, and the scene does not allow it
    "undecided": 1,  # out of tolerance by no more than the engines' error estimates
    "partly": 1,  # not everything requested was compared
    "unjudged": 1,  # no equation was checked for an engine
    "nothing": 1,  # nothing was compared
    "faulted": 1,  # an equation of mechanics is violated
    "differ": 1,  # two engines differ
    "refused": 2,  # bad input
    "failed": 3,  # an engine or its process failed
}
_ORDER = [*EXIT]


def weakest(outcomes: Iterable[Outcome]) -> Outcome:
    """Return the weakest outcome, with which a verdict begins."""
    return max(outcomes, key=_ORDER.index)
