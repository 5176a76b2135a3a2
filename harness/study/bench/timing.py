"""The timing protocol: rounds over all contestants, each call after an unclocked one, within a budget."""

from __future__ import annotations

import gc
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from math import inf
from time import perf_counter_ns
from typing import Any

#: A call shorter than this [s] is repeated without the clock right before the measured one: it refills the caches
#: that the contestant before has emptied. Longer calls fill them in a fraction of their time.
WARM_BELOW = 0.05
#: Durations [s] from which on so many rounds are enough: disturbances matter less to longer calls.
ENOUGH = ((5.0, 1), (0.5, 2))


@dataclass(frozen=True, slots=True)
class Plan:
    """Extent of a bench.

    Attributes:
        samples: Times compared, at most.
        rounds: Measurements of a contestant, at most.
        budget: Seconds after which nothing further begins; simulations stop then, too.
        quick: Settings that take longest are left out.
        each: Seconds after which a contestant of a simulation is stopped.
        share: Share of a simulation that is integrated.
    """

    samples: int
    rounds: int
    budget: float
    quick: bool
    each: float = inf
    share: float = 1.0


FULL = Plan(samples=201, rounds=12, budget=480.0, quick=False)
QUICK = Plan(samples=41, rounds=3, budget=48.0, quick=True)


@dataclass(frozen=True, slots=True)
class Protocol:
    """Rounds and deadline of measurements.

    Attributes:
        rounds: Times that each contestant is measured.
        deadline: Reading of the clock [ns] at which no further measurement begins.
        clock: Returns nanoseconds.
    """

    rounds: int
    deadline: float
    clock: Callable[[], int] = perf_counter_ns

    @property
    def left(self) -> float:
        """Time until the deadline [s]."""
        return (self.deadline - self.clock()) * 1e-9

    @property
    def over(self) -> bool:
        return self.left <= 0.0


def once(call: Callable[[], Any], clock: Callable[[], int]) -> tuple[float, Any]:
    """Return seconds of one call, and its result. The garbage collector waits outside."""
    on = gc.isenabled()
    gc.disable()
    try:
        start = clock()
        result = call()
        end = clock()
    finally:
        if on:
            gc.enable()
    return (end - start) * 1e-9, result


def measure(
    calls: Mapping[str, Callable[[], Any]],
    protocol: Protocol,
    record: Callable[[str, float], None],
    known: Mapping[str, list[float]],
    first: Mapping[str, float],
) -> None:
    """Measure all contestants in turn, round after round: what slows the machine for a while slows all alike.

    Args:
        calls: Key -> measured function, which was called once outside the clock.
        record: Function that takes key and seconds of each measurement.
        known: Key -> seconds so far; `record` adds to it.
        first: Key -> seconds of that first call, which fix rounds and warming.
    """
    for turn in range(protocol.rounds):
        for key, call in calls.items():
            before = known.get(key, [])
            shortest = min([first[key], *before])
            if len(before) > turn or len(before) >= enough(shortest, protocol.rounds):
                continue
            if protocol.over:
                return
            if shortest < WARM_BELOW:
                call()
            record(key, once(call, protocol.clock)[0])


def enough(seconds: float, rounds: int) -> int:
    """Return the rounds for a contestant whose call lasts so long."""
    for limit, few in ENOUGH:
        if seconds >= limit:
            return min(few, rounds)
    return rounds
