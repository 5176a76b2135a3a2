"""The time limit of a diagnosis; once it is reached, the remaining work is skipped and the report lists this work."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from time import monotonic

from screwgauge.reference.errors import DescriptionError

#: Default limit [s]; the largest public robots take a minute.
LIMIT = 3600.0


@dataclass(slots=True, eq=False)
class Deadline:
    """A time limit, checked before each piece of work.

    Attributes:
        seconds: Time allowed from now on [s].
        clock: Function that returns the time [s].
        left_out: Work that was skipped for lack of time.

    Raises:
        DescriptionError: The limit is not a positive number.
    """

    seconds: float = math.inf
    clock: Callable[[], float] = monotonic
    left_out: list[str] = field(default_factory=list)
    _end: float = field(init=False)

    def __post_init__(self) -> None:
        if not self.seconds > 0.0:
            raise DescriptionError(
                f"the limit must be positive, got {self.seconds:g} s", "--limit", "pass a positive number of seconds"
            )
        self._end = self.clock() + self.seconds

    def is_over(self, work: str) -> bool:
        """Return True if no time is left for a piece of work, and record that work as skipped."""
        if self.clock() < self._end:
            return False
        if work not in self.left_out:
            self.left_out.append(work)
        return True
