"""The timing protocol."""

import gc
from dataclasses import replace

import pytest

from support.bench import QUICK, measure, rounds_needed, time_call


class Clock:
    """Clock that only calls move."""

    def __init__(self) -> None:
        self.now = 0

    def __call__(self) -> int:
        return self.now

    def spend(self, seconds: float) -> None:
        self.now += round(seconds * 1e9)


@pytest.fixture
def clock() -> Clock:
    return Clock()


def contestants(clock: Clock, durations: dict[str, float], log: list[str]):
    def make(key: str):
        def call() -> None:
            log.append(key)
            clock.spend(durations[key])

        return call

    return {key: make(key) for key in durations}


def run(clock: Clock, durations: dict[str, float], *, rounds: int = 3, budget: float = 1e9, known=None):
    log: list[str] = []
    times: dict[str, list[float]] = dict(known or {})
    measure(
        contestants(clock, durations, log),
        replace(QUICK, rounds=rounds).start(budget, clock),
        lambda key, seconds: times.setdefault(key, []).append(seconds),
        times,
        durations,
    )
    return log, times


def test_one_call_is_measured_to_the_nanosecond_and_its_result_kept(clock):
    seconds, result = time_call(lambda: clock.spend(2.5) or "result", clock)
    assert seconds == 2.5
    assert result == "result"


def test_the_garbage_collector_waits_and_comes_back(clock):
    assert gc.isenabled()
    assert time_call(gc.isenabled, clock)[1] is False
    assert gc.isenabled()


def test_contestants_take_turns_round_by_round(clock):
    log, times = run(clock, {"a": 0.1, "b": 0.2})
    assert log == ["a", "b"] * 3
    assert times == {"a": [pytest.approx(0.1)] * 3, "b": [pytest.approx(0.2)] * 3}


def test_a_short_call_is_made_once_without_the_clock_before_it_is_measured(clock):
    log, times = run(clock, {"short": 0.01}, rounds=2)
    assert log == ["short"] * 4
    assert len(times["short"]) == 2


def test_what_takes_long_is_measured_less_often(clock):
    _, times = run(clock, {"a": 0.1, "long": 1.0, "longest": 9.0}, rounds=5)
    assert {key: len(found) for key, found in times.items()} == {"a": 5, "long": 2, "longest": 1}
    assert rounds_needed(9.0, 5) == 1


def test_a_budget_too_small_keeps_what_was_measured(clock):
    _, times = run(clock, {"a": 1.0, "b": 1.0, "c": 1.0}, budget=1.5)
    assert times == {"a": [1.0], "b": [1.0]}


def test_no_measurement_begins_after_the_budget_is_spent(clock):
    assert run(clock, {"a": 1.0}, budget=0.0) == ([], {})


def test_what_was_measured_before_is_not_measured_again(clock):
    log, times = run(clock, {"a": 0.1, "b": 0.1}, known={"a": [0.3, 0.3, 0.3]})
    assert log == ["b"] * 3
    assert times["a"] == [0.3, 0.3, 0.3]
