"""The timing protocol: rounds over all contestants, each call preceded by an untimed one, within a budget."""

from __future__ import annotations

import gc
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from math import inf
from time import perf_counter_ns
from typing import Any

#: Duration [s] below which an untimed call precedes the measured one, to refill the caches that the previous contestant
#: has evicted. Longer calls fill caches in a fraction of their time.
WARM_BELOW = 0.05
#: Pairs of a duration [s] and the number of rounds that suffices above it, because disturbances matter less.
ENOUGH = ((5.0, 1), (0.5, 2))


@dataclass(frozen=True, slots=True)
class Plan:
    """Extent of a bench.

    Attributes:
        samples: Largest number of compared times.
        rounds: Largest number of measurements of a contestant.
        budget: Time after which no measurement begins, and simulations stop [s].
        quick: True to omit the slowest settings.
        each: Time after which a contestant of a simulation is stopped [s].
        share: Fraction of a simulation that is integrated.
        deadline: Reading of the clock [ns] at which no further measurement begins.
        clock: Function that returns the time [ns].
    """

    samples: int
    rounds: int
    budget: float
    quick: bool
    each: float = inf
    share: float = 1.0
    deadline: float = inf
    clock: Callable[[], int] = perf_counter_ns

    def start(self, seconds: float, clock: Callable[[], int] = perf_counter_ns) -> Plan:
        """Return the plan with a deadline, some seconds from now on a clock."""
        return replace(self, deadline=clock() + seconds * 1e9, clock=clock)

    @property
    def left(self) -> float:
        """Time until the deadline [s]."""
        return (self.deadline - self.clock()) * 1e-9

    @property
    def over(self) -> bool:
        return self.left <= 0.0


FULL = Plan(samples=201, rounds=12, budget=480.0, quick=False)
QUICK = Plan(samples=41, rounds=3, budget=48.0, quick=True)


def time_call(call: Callable[[], Any], clock: Callable[[], int]) -> tuple[float, Any]:
    """Return the duration of one call [s], and its result. The garbage collector is paused during the call."""
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
    plan: Plan,
    record: Callable[[str, float], None],
    known: Mapping[str, list[float]],
    first: Mapping[str, float],
) -> None:
    """Measure all contestants in turn, round after round, so that a temporary slowdown affects all alike.

    Args:
        calls: Key -> function to measure, which has already been called once.
        record: Called with key and seconds of each measurement.
        known: Key -> times measured so far [s], to which `record` appends.
        first: Key -> duration of the first call [s], which determines rounds and warm-up.
    """
    for turn in range(plan.rounds):
        for key, call in calls.items():
            before = known.get(key, [])
            shortest = min([first[key], *before])
            if len(before) > turn or len(before) >= rounds_needed(shortest, plan.rounds):
                continue
            if plan.over:
                return
            if shortest < WARM_BELOW:
                call()
            record(key, time_call(call, plan.clock)[0])


def rounds_needed(seconds: float, rounds: int) -> int:
    """Return the number of rounds for a contestant whose calls take a given time [s]."""
    for limit, few in ENOUGH:
        if seconds >= limit:
            return min(few, rounds)
    return rounds
